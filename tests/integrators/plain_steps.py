"""A step of any partitioned Runge–Kutta method in any number of digits: slow, plain, and independent of the package."""

import mpmath


def one_step(tableau, q, p, h):
    """A step of a partitioned method on Kepler's problem by fixed-point iteration in mpmath."""
    s = range(tableau.stages)

    def force(x):
        cube = mpmath.sqrt(x[0] ** 2 + x[1] ** 2) ** 3
        return [-x[0] / cube, -x[1] / cube]

    V = [list(p) for _ in s]
    for _ in range(2000):
        Q = [[q[k] + h * sum(tableau.exact_a[i][j] * V[j][k] for j in s) for k in (0, 1)] for i in s]
        F = [force(x) for x in Q]
        new = [[p[k] + h * sum(tableau.exact_a_bar[i][j] * F[j][k] for j in s) for k in (0, 1)] for i in s]
        change = max(abs(new[i][k] - V[i][k]) for i in s for k in (0, 1))
        V = new
        if change < mpmath.mpf(10) ** (3 - mpmath.mp.dps):
            break
    b = tableau.exact_b
    return [q[k] + h * sum(b[j] * V[j][k] for j in s) for k in (0, 1)]
