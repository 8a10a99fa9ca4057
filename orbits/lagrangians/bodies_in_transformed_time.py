"""Newtonian bodies in transformed time, dt = g dtau, with their dynamical time g as the monitor.

    L~(q, q') = sum_i m_i |q_i'|^2 / (2 g) - g (V(q) - E0)
    g = (sum_{i<j} G (m_i + m_j) / (r_ij^2 + eps^2)^(3/2))^(-1/2)

Its orbits at the energy E0 are those of Newton's Lagrangian, its momenta are the same. It is what
`orbits.TimeTransformed` marches (in positions and velocities, `orbits.integrators.collocation.transformed_bodies`).

Parameters: eps^2, then GM of each body, then E0. Quantities proportional to masses are multiplied by G.
Source: Hairer, Lubich & Wanner (2006), sec. VIII.2.1; Leimkuhler & Reich (2004), sec. 9.2.
"""

from __future__ import annotations

from dataclasses import replace

from numpy.typing import ArrayLike

from orbits.kernels.binding import Tag
from orbits.kernels.compile import kernel
from orbits.kernels.lanes import get, put, rsqrt_cubed, sqrt
from orbits.lagrangians.base import GRADIENTS, Compiled, Lagrangian
from orbits.lagrangians.newtonian import n_body, symmetries


@kernel(inline=True)
def dimension(parameters):
    """Return 3 n."""
    return 3 * (parameters.shape[0] - 2)


@kernel(inline=True)
def bodies(parameters):
    """Return n."""
    return parameters.shape[0] - 2


@kernel(inline=True)
def _pair(parameters, q, i, j):
    """Return the separation of two bodies, 1 / r^3 and r^2, softened."""
    n = parameters.shape[0] - 2
    dx, dy, dz = get(q, j) - get(q, i), get(q, n + j) - get(q, n + i), get(q, 2 * n + j) - get(q, 2 * n + i)
    r2 = dx * dx + dy * dy + dz * dz + parameters[0]
    return dx, dy, dz, rsqrt_cubed(r2), r2


@kernel(inline=True)
def _sums(parameters, q, v):
    """Return g^-2, V and q'.M q'."""
    n = parameters.shape[0] - 2
    zero = get(q, 0) * 0.0
    rate = potential = square = zero
    for i in range(n):
        for j in range(i + 1, n):
            _, _, _, w, r2 = _pair(parameters, q, i, j)
            rate = rate + (parameters[1 + i] + parameters[1 + j]) * w
            potential = potential - parameters[1 + i] * (parameters[1 + j] * (w * r2))
    for k in range(3 * n):
        square = square + parameters[1 + k % n] * get(v, k) * get(v, k)
    return rate, potential, square


@kernel
def value(parameters, t, q, v):
    """Return L~; float64, or lanes for q, v of shape (3n, 8)."""
    rate, potential, square = _sums(parameters, q, v)
    g = 1.0 / sqrt(rate)
    return 0.5 * square / g - g * (potential - parameters[parameters.shape[0] - 1])


@kernel(inline=True)
def _add_slopes(parameters, q, V_q, S_q, first, second):
    """Add the gradient of V to V_q from its element `first` on, and that of g^-2 to S_q from `second` on."""
    n = parameters.shape[0] - 2
    for i in range(n):
        for j in range(i + 1, n):
            dx, dy, dz, w, r2 = _pair(parameters, q, i, j)
            pull = parameters[1 + i] * (parameters[1 + j] * w)
            steep = 3.0 * (parameters[1 + i] + parameters[1 + j]) * w / r2
            for axis in range(3):
                d = dx if axis == 0 else (dy if axis == 1 else dz)
                ii, jj = axis * n + i, axis * n + j
                put(V_q, first + ii, get(V_q, first + ii) - pull * d)
                put(V_q, first + jj, get(V_q, first + jj) + pull * d)
                put(S_q, second + ii, get(S_q, second + ii) + steep * d)
                put(S_q, second + jj, get(S_q, second + jj) - steep * d)


@kernel
def gradients(parameters, t, q, v, f, p):
    """Write dL~/dq into f and the momenta M q' / g into p."""
    d = dimension(parameters)
    n = d // 3
    zero = get(q, 0) * 0.0
    for k in range(d):
        put(f, k, zero)
        put(p, k, zero)
    _add_slopes(parameters, q, p, f, 0, 0)
    rate, potential, square = _sums(parameters, q, v)
    g = 1.0 / sqrt(rate)
    # grad g = -g^3 / 2 times the gradient of g^-2
    back = 0.5 * g * (0.5 * square + g * g * (potential - parameters[parameters.shape[0] - 1]))
    for k in range(d):
        put(f, k, back * get(f, k) - g * get(p, k))
        put(p, k, parameters[1 + k % n] * get(v, k) / g)


@kernel(inline=True)
def _add_curvatures(parameters, q, out, second):
    """Add the second derivatives of g^-2 to `out`, and those of V from its element `second` on, each (3n, 3n)."""
    n = parameters.shape[0] - 2
    d = 3 * n
    for i in range(n):
        for j in range(i + 1, n):
            dx, dy, dz, w, r2 = _pair(parameters, q, i, j)
            pull = parameters[1 + i] * (parameters[1 + j] * w)
            steep = 3.0 * (parameters[1 + i] + parameters[1 + j]) * w / r2
            for a in range(3):
                da = dx if a == 0 else (dy if a == 1 else dz)
                for b in range(3):
                    db = dx if b == 0 else (dy if b == 1 else dz)
                    same, across = 1.0 if a == b else 0.0, da * db / r2
                    S, V = steep * (5.0 * across - same), pull * (same - 3.0 * across)
                    ii, jj = (a * n + i) * d + b * n + i, (a * n + j) * d + b * n + j
                    ij, ji = (a * n + i) * d + b * n + j, (a * n + j) * d + b * n + i
                    put(out, ii, get(out, ii) + S)
                    put(out, jj, get(out, jj) + S)
                    put(out, ij, get(out, ij) - S)
                    put(out, ji, get(out, ji) - S)
                    put(out, second + ii, get(out, second + ii) + V)
                    put(out, second + jj, get(out, second + jj) + V)
                    put(out, second + ij, get(out, second + ij) - V)
                    put(out, second + ji, get(out, second + ji) - V)


@kernel
def hessians(parameters, t, q, v, out):
    """Write the second derivatives; the blocks not yet needed hold those of V and the gradients of V and g."""
    d = dimension(parameters)
    n, block = d // 3, d * d
    zero = get(q, 0) * 0.0
    for k in range(3 * block):
        put(out, k, zero)
    V_q, g_q, V_qq = block, block + d, 2 * block
    _add_slopes(parameters, q, out, out, V_q, g_q)
    _add_curvatures(parameters, q, out, V_qq)
    rate, potential, square = _sums(parameters, q, v)
    g = 1.0 / sqrt(rate)
    deep = potential - parameters[parameters.shape[0] - 1]
    for k in range(d):
        put(out, g_q + k, -0.5 * g * g * g * get(out, g_q + k))
    for k in range(d):
        for m in range(d):
            both = get(out, g_q + k) * get(out, g_q + m)
            g_qq = 3.0 * both / g - 0.5 * g * g * g * get(out, k * d + m)
            here = square / (g * g * g) * both - (0.5 * square / (g * g) + deep) * g_qq
            here = here - get(out, V_q + k) * get(out, g_q + m) - get(out, g_q + k) * get(out, V_q + m)
            put(out, k * d + m, here - g * get(out, V_qq + k * d + m))
    for k in range(d):
        put(out, 2 * block + k, get(out, g_q + k))
    for k in range(d):
        slope = get(out, 2 * block + k)
        for m in range(d):
            put(out, block + k * d + m, -parameters[1 + m % n] * get(v, m) * slope / (g * g))
    for k in range(block):
        put(out, 2 * block + k, zero)
    for k in range(d):
        put(out, 2 * block + k * d + k, parameters[1 + k % n] / g)


def _compiled() -> Compiled:
    kernels = {
        "dimension": dimension,
        "bodies": bodies,
        "value": value,
        "gradients": gradients,
        "hessians": hessians,
    }
    return Compiled(Tag("bodies-in-transformed-time", kernels), frozenset({GRADIENTS}))


def bodies_in_transformed_time(gm: ArrayLike, energy: float, softening: float = 0.0) -> Lagrangian:
    """Return the Lagrangian of n >= 2 bodies in transformed time; coordinates x, y, z of each body in turn.

    gm : (n,), length^3 / time^2, all > 0; energy : E0, times G; softening : Plummer's eps, length
    Raises InputError for a GM that is not positive.
    """
    newton = n_body(gm, softening)
    return replace(
        newton,
        name="newtonian in transformed time",
        formula="sum m q'^2 / (2 g) - g (V - E0), g = (sum G (m + m') / (r^2 + eps^2)^(3/2))^(-1/2)",
        parameters={**newton.parameters, "E0": energy},
        compile=_compiled,
        # A boost changes the energy, and with it the speed of the clock.
        groups=lambda known: tuple(s for s in symmetries(known) if s.gauge is None),
        source="Hairer, Lubich & Wanner (2006), sec. VIII.2.1",
    )
