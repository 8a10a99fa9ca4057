"""The equations of motion of bodies in transformed time, dt = g dtau, with their dynamical time g as the monitor.

    g = (sum_{i<j} G (m_i + m_j) / (r_ij^2 + eps^2)^(3/2))^(-1/2)
    q' = g v,     v' = g a - (H - E0) M^-1 grad g,     t' = g

Array shapes and `strength` as in `orbits.kernels.gravity.pair_sums`.
"""

from __future__ import annotations

from orbits.kernels.compile import kernel
from orbits.kernels.gravity.potential import doubled_attraction
from orbits.kernels.lanes import WIDTH, get, put, rsqrt_cubed, sqrt
from orbits.kernels.sums.summation import add_pairs, multiply_pairs, two_product


@kernel
def transformed_field(strength, energy, q, q_lo, v, pull, velocity, kick):
    """Write q' into `velocity` and v' into `kick`, and return g, for rows (3n, 8) of eight stages.

    energy : E0 as a pair in doubled precision, times G
    q, q_lo : positions in doubled precision, so that distances of close bodies keep their digits
    pull : workspace with the shape of q
    """
    n = strength.shape[0] - 1
    zero = get(q, 0) * 0.0
    for k in range(3 * n):
        put(kick, k, zero)
        put(pull, k, zero)
    rate = potential = kinetic = zero
    for i in range(n):
        gm_i = strength[1 + i]
        for j in range(i + 1, n):
            gm_j = strength[1 + j]
            dx = (get(q, j) - get(q, i)) + (get(q_lo, j) - get(q_lo, i))
            dy = (get(q, n + j) - get(q, n + i)) + (get(q_lo, n + j) - get(q_lo, n + i))
            dz = (get(q, 2 * n + j) - get(q, 2 * n + i)) + (get(q_lo, 2 * n + j) - get(q_lo, 2 * n + i))
            r2 = strength[0] + dx * dx + dy * dy + dz * dz
            w = rsqrt_cubed(r2)
            own = (gm_i + gm_j) * w
            # Not gm_i gm_j first: its rounding error would be that of every stage, and H would be biased.
            rate, potential = rate + own, potential - gm_i * (gm_j * (w * r2))
            # The gradient of the rate by q_i is 3 own / r^2 times the separation.
            steep = 3.0 * own / r2
            w_i, w_j, s_i, s_j = w * gm_j, w * gm_i, steep / gm_i, steep / gm_j
            put(kick, i, get(kick, i) + w_i * dx)
            put(kick, n + i, get(kick, n + i) + w_i * dy)
            put(kick, 2 * n + i, get(kick, 2 * n + i) + w_i * dz)
            put(kick, j, get(kick, j) - w_j * dx)
            put(kick, n + j, get(kick, n + j) - w_j * dy)
            put(kick, 2 * n + j, get(kick, 2 * n + j) - w_j * dz)
            put(pull, i, get(pull, i) + s_i * dx)
            put(pull, n + i, get(pull, n + i) + s_i * dy)
            put(pull, 2 * n + i, get(pull, 2 * n + i) + s_i * dz)
            put(pull, j, get(pull, j) - s_j * dx)
            put(pull, n + j, get(pull, n + j) - s_j * dy)
            put(pull, 2 * n + j, get(pull, 2 * n + j) - s_j * dz)
    for k in range(3 * n):
        kinetic = kinetic + strength[1 + k % n] * get(v, k) * get(v, k)
    g = 1.0 / sqrt(rate)
    # grad g = -g^3 / 2 times the gradient of the rate
    back = 0.5 * (((0.5 * kinetic + potential) - energy[0]) - energy[1]) * g * g * g
    for k in range(3 * n):
        put(velocity, k, g * get(v, k))
        put(kick, k, g * get(kick, k) + back * get(pull, k))
    return g


@kernel
def energy_of_bodies(strength, q, v, room):
    """Return the energy H, times G, in doubled precision.

    q, v : (3n,) or longer; room : (4 (n + 8),) workspace
    With a rounded E0, the orbit would have that energy instead of its own: a phase error of one rounding of the energy
    at the start, where kinetic and potential energy may be large, in each radian.
    """
    n = strength.shape[0] - 1
    stride = n + WIDTH
    gm, places = room[:stride], room[stride : 4 * stride].reshape(3, stride)
    kinetic, kinetic_lo = 0.0, 0.0
    for i in range(n):
        gm[i] = strength[1 + i]
        for axis in range(3):
            k = axis * n + i
            places[axis, i] = q[k]
            square, lost = two_product(v[k], v[k])
            own, own_lo = multiply_pairs(square, lost, 0.5 * gm[i], 0.0)
            kinetic, kinetic_lo = add_pairs(kinetic, kinetic_lo, own, own_lo)
    depth, depth_lo = doubled_attraction(gm, places, strength[0], 0.0)
    return add_pairs(kinetic, kinetic_lo, -depth, -depth_lo)
