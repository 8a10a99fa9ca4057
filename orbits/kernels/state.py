"""Kicks and drifts of a state in doubled precision, a vector at a time or eight particles in lanes."""

from __future__ import annotations

from orbits.kernels.compile import kernel
from orbits.kernels.lanes import WIDTH, load, store
from orbits.kernels.summation import accumulate, add_product


@kernel(inline=True)
def copy(source, start, stop, out):
    """Write elements start ... stop - 1 of a vector into those of another (a slice assignment would allocate)."""
    for k in range(start, stop):
        out[k] = source[k]


@kernel
def kick(v, v_lo, h, g, size):
    """Advance (v, v_lo) by h g, component by component; the vectors are padded."""
    for k in range(0, size, WIDTH):
        hi, lo = accumulate(load(v, k), load(v_lo, k), h * load(g, k))
        store(v, k, hi)
        store(v_lo, k, lo)


@kernel
def drift(q, q_lo, h, v, v_lo, size):
    """Advance (q, q_lo) by h (v, v_lo), component by component; the vectors are padded."""
    for k in range(0, size, WIDTH):
        hi, lo = add_product(load(q, k), load(q_lo, k), h, load(v, k), load(v_lo, k))
        store(q, k, hi)
        store(q_lo, k, lo)


@kernel
def all_finite(q, v, size):
    """Return whether the first `size` elements of q and v are finite."""
    for k in range(size):  # noqa: SIM110 - Numba compiles loops, not all() of a generator
        if not (q[k] * 0.0 == 0.0 and v[k] * 0.0 == 0.0):
            return False
    return True


@kernel
def first_not_finite(q, v, start, stop):
    """Return the first of particles start ... stop - 1 whose state is not finite, or -1; q, v : (3, padded)."""
    for p in range(start, stop):
        for k in range(3):
            if not (q[k, p] * 0.0 == 0.0 and v[k, p] * 0.0 == 0.0):
                return p
    return -1


@kernel(inline=True)
def load_particles(q, q_lo, p):
    """Return x, y, z and their low parts of particles p ... p + 7; q, q_lo : (3, padded)."""
    return load(q[0], p), load(q[1], p), load(q[2], p), load(q_lo[0], p), load(q_lo[1], p), load(q_lo[2], p)


@kernel(inline=True)
def store_particles(q, q_lo, p, x, y, z, x_lo, y_lo, z_lo):
    """Write what `load_particles` would read."""
    store(q[0], p, x)
    store(q[1], p, y)
    store(q[2], p, z)
    store(q_lo[0], p, x_lo)
    store(q_lo[1], p, y_lo)
    store(q_lo[2], p, z_lo)
