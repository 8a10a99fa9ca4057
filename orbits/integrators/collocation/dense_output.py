"""Dense output of `collocation`: the polynomial through the forces at the stages, and coefficients of partial steps."""

from __future__ import annotations

from orbits.integrators.collocation.rows import ETA, HB, HC, HC_LO, LAST, registers
from orbits.kernels.compile import kernel
from orbits.kernels.dense import weights as dense_weights
from orbits.kernels.lanes import WIDTH, fma, full, load, store, total

RESOLVED = 3e-10
"""The last Legendre coefficient of the forces, times h, as a fraction of the position of a body, up to which their
polynomial serves for dense output; it leaves errors of 2e-14 of the position."""

@kernel(inline=True)
def dense(method, h, q, v, kicks, theta, out_q, out_v):
    """Write q and v at a fraction of a step, from the polynomial through the forces at its stages.

    q, v : at the beginning of the step; kicks : its L. See `orbits.kernels.dense`.
    """
    R, coefficients, size = registers(method), method.coefficients, out_q.shape[0]
    block, first, part = kicks.shape[0] // R, ETA + 2 * WIDTH * R, theta * h
    for r in range(R):
        once, twice = dense_weights(coefficients[r], first, WIDTH * R, theta)
        for k in range(size):
            L = load(kicks, r * block + k)
            if r == 0:
                out_v[k], out_q[k] = 0.0, 0.0
            out_v[k] += total(once * L)
            out_q[k] += total(twice * L)
    for k in range(size):
        out_q[k] = q[k] + fma(part, v[k], h * out_q[k])
        out_v[k] += v[k]


@kernel(inline=True)
def resolves(method, h, q, kicks, bodies):
    """Return whether the polynomial through the forces leaves hardly more than round-off in the position of each body:
    about 1e-4 of h times their last Legendre coefficient.
    """
    R, coefficients = registers(method), method.coefficients
    block = kicks.shape[0] // R
    for i in range(bodies):
        off = size = 0.0
        for k in range(i, 3 * bodies, bodies):
            last = 0.0
            for r in range(R):
                last += total(load(coefficients[r], LAST) * load(kicks, r * block + k))
            off, size = max(off, abs(last)), max(size, abs(q[k]))
        if not abs(h) * off <= RESOLVED * size:
            return False
    return True


@kernel(inline=True)
def stretch(method, unit, factor):
    """Write the coefficients of steps `factor` times as long, for a cold start."""
    for r in range(registers(method)):
        table, base = method.coefficients[r], unit.coefficients[r]
        c, hc = load(base, HC), factor * load(base, HC)
        store(table, HC, hc)
        store(table, HC_LO, fma(c, full(factor), -hc) + factor * load(base, HC_LO))
        store(table, HB, factor * load(base, HB))
