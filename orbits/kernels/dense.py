"""Dense output: the motion within a step, from the polynomial through the forces at its stages.

With L_j = h b_j g(Q_j) and shifted Legendre polynomials P_k, at the fraction theta of a step:

    v(theta) = v + sum_j once_j L_j,                 once_j  = sum_k c_kj I_k(theta),   I_k = integral of P_k
    q(theta) = q + h theta v + h sum_j twice_j L_j,  twice_j = sum_k c_kj J_k(theta),   J_k = integral of I_k

c_kj b_j is the k-th Legendre coefficient of the j-th Lagrange polynomial of the nodes: for Gauss,
c_kj = (2k + 1) P_k(c_j).
"""

from __future__ import annotations

from numba.extending import overload

from orbits.kernels.binding import OPTIONS, kernel_of
from orbits.kernels.compile import kernel
from orbits.kernels.lanes import full, load
from orbits.kernels.steps import Method


def dense(method, h, q, v, kicks, theta, out_q, out_v):
    """Write q and v at the fraction theta of a step of h that began at q and v and left `kicks` in the carry."""
    raise NotImplementedError("dense() is for compiled code only")


@overload(dense, jit_options=OPTIONS)
def _dense(method, h, q, v, kicks, theta, out_q, out_v):
    compiled = kernel_of(method.types[0], "dense")
    return compiled and (
        lambda method, h, q, v, kicks, theta, out_q, out_v: compiled(method, h, q, v, kicks, theta, out_q, out_v)
    )


@kernel(inline=True)
def integral(k, x, before, now):
    """Return (P_k+1, I_k) from P_k-1 and P_k at x = 2 theta - 1; with P_-1 = -1, so that I_0 = theta. Floats or
    lanes.
    """
    following = x * now
    if k > 0:
        following = ((2.0 * k + 1.0) * following - float(k) * before) * (1.0 / (k + 1.0))
    return following, (following - before) * (0.5 / (2.0 * k + 1.0))


@kernel(inline=True)
def weights(table, first, rows, theta):
    """Return `once` and `twice` for the eight stages of a register.

    table : has the rows c_k, k = 0 ... rows - 1, from row `first` on
    """
    x = 2.0 * theta - 1.0
    once = twice = full(0.0)
    following, now = integral(0, x, -1.0, 1.0)
    legendre, before, double = 1.0, 0.0, 0.5 * theta * theta
    for k in range(rows):
        after, ahead = integral(k + 1, x, legendre, following)
        if k > 0:
            double = (ahead - before) * (0.5 / (2.0 * k + 1.0))
        row = load(table, first + k)
        once, twice = once + now * row, twice + double * row
        before, now, legendre, following = now, ahead, following, after
    return once, twice


@kernel
def motion_within(form, coefficients, times, path, kicks, steps, fractions, q, v):
    """Write the states at fractions of recorded steps.

    form, coefficients : of the method
    times : (steps + 1,), at which the steps begin and the last one ends
    path : (steps + 1, 2, padded), q and v at these times; kicks : (steps, rows, 8), the carry after each step
    steps, fractions : (m,), number and fraction of the step of each state
    q, v : (m, size), receive the states
    """
    method = Method(form, coefficients)
    for i in range(len(steps)):
        k = steps[i]
        dense(method, times[k + 1] - times[k], path[k, 0], path[k, 1], kicks[k], fractions[i], q[i], v[i])


