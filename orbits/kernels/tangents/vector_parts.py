"""What the derivatives of all stages of Wisdom–Holman maps share; see `orbits.kernels.tangents.through_maps`."""

from __future__ import annotations

from orbits.kernels.compile import kernel
from orbits.kernels.lanes import fma, full, load, store
from orbits.kernels.maps.layout import INNER, MASS, OUTER, SHARE, constant
from orbits.kernels.sums.summation import accumulate

HERE, MOVED, ALONG = 0, 1, 2
"""Rows of `VectorRoom.places`: places and u, six numbers; those of displaced positions; the displacement of both. Of
`VectorRoom.bends`: there, there, and in the flow of terms."""


@kernel(inline=True)
def add_three(hi, lo, a, x, y, z):
    """Add a vector to rows a ... a + 2 in doubled precision."""
    b, b_lo = accumulate(load(hi, a), load(lo, a), x)
    c, c_lo = accumulate(load(hi, a + 1), load(lo, a + 1), y)
    d, d_lo = accumulate(load(hi, a + 2), load(lo, a + 2), z)
    store(hi, a, b)
    store(hi, a + 1, c)
    store(hi, a + 2, d)
    store(lo, a, b_lo)
    store(lo, a + 1, c_lo)
    store(lo, a + 2, d_lo)


@kernel
def to_places(scratch, count, d, out):
    """Write the change of u by that of r', or of its velocity."""
    bx, by, bz = full(0.0), full(0.0), full(0.0)
    for i in range(count):
        x, y, z = load(d, 3 * i), load(d, 3 * i + 1), load(d, 3 * i + 2)
        store(out, 3 * i, bx + x)
        store(out, 3 * i + 1, by + y)
        store(out, 3 * i + 2, bz + z)
        w = full(constant(scratch, SHARE, i))
        bx, by, bz = fma(w, x, bx), fma(w, y, by), fma(w, z, bz)


@kernel
def add_from_places(scratch, count, size, pull, out, first):
    """Add `size` times derivatives by u, per mass, as derivatives by r' over the reduced masses, to rows from `first`
    on.
    """
    hx, hy, hz = full(0.0), full(0.0), full(0.0)
    for back in range(count):
        i = count - 1 - back
        a, b = 3 * i, first + 3 * i
        fx, fy, fz = size * load(pull, a), size * load(pull, a + 1), size * load(pull, a + 2)
        outer, inner = full(constant(scratch, OUTER, i)), full(constant(scratch, INNER, i))
        store(out, b, load(out, b) + fma(outer, fx, inner * hx))
        store(out, b + 1, load(out, b + 1) + fma(outer, fy, inner * hy))
        store(out, b + 2, load(out, b + 2) + fma(outer, fz, inner * hz))
        mass = full(constant(scratch, MASS, i))
        hx, hy, hz = fma(mass, fx, hx), fma(mass, fy, hy), fma(mass, fz, hz)
