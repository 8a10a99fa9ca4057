"""Kicks and drifts of a state in doubled precision, a vector at a time or eight particles in lanes."""

from __future__ import annotations

from typing import Any, NamedTuple

from orbits.kernels.compile import kernel
from orbits.kernels.lanes import WIDTH, load, store
from orbits.kernels.steps import Particles
from orbits.kernels.sums.summation import accumulate, add_product


class Columns(NamedTuple):
    """Massless particles, (3, padded) each: like `State`, with a column for each particle."""

    q: Any
    q_lo: Any
    v: Any
    v_lo: Any


@kernel
def kick(v, v_lo, h, g, start, stop):
    """Advance components start ... stop - 1 of (v, v_lo) by h g; the vectors are padded, start is a multiple of 8."""
    for k in range(start, stop, WIDTH):
        hi, lo = accumulate(load(v, k), load(v_lo, k), h * load(g, k))
        store(v, k, hi)
        store(v_lo, k, lo)


@kernel
def drift(q, q_lo, h, v, v_lo, start, stop):
    """Advance components start ... stop - 1 of (q, q_lo) by h (v, v_lo); padded as for `kick`."""
    for k in range(start, stop, WIDTH):
        hi, lo = add_product(load(q, k), load(q_lo, k), h, load(v, k), load(v_lo, k))
        store(q, k, hi)
        store(q_lo, k, lo)


@kernel(inline=True)
def copy(source, start, stop, out):
    """Copy elements start ... stop - 1 of a vector into another; padded as for `kick`."""
    for k in range(start, stop, WIDTH):
        store(out, k, load(source, k))


@kernel
def all_finite(q, v, size):
    """Return whether the first `size` elements of q and v are finite."""
    for k in range(size):  # noqa: SIM110 - Numba compiles loops, not all() of a generator
        if not (q[k] * 0.0 == 0.0 and v[k] * 0.0 == 0.0):
            return False
    return True


@kernel(inline=True)
def kicked(particles, h, g):
    """Return particles with the velocities advanced by h g, g being (gx, gy, gz)."""
    x, y, z, x_lo, y_lo, z_lo, vx, vy, vz, vx_lo, vy_lo, vz_lo = particles
    vx, vx_lo = accumulate(vx, vx_lo, h * g[0])
    vy, vy_lo = accumulate(vy, vy_lo, h * g[1])
    vz, vz_lo = accumulate(vz, vz_lo, h * g[2])
    return Particles(x, y, z, x_lo, y_lo, z_lo, vx, vy, vz, vx_lo, vy_lo, vz_lo)


@kernel(inline=True)
def shifted(particles, h, g):
    """Return particles with the positions advanced by h g, g being (gx, gy, gz)."""
    x, y, z, x_lo, y_lo, z_lo, vx, vy, vz, vx_lo, vy_lo, vz_lo = particles
    x, x_lo = accumulate(x, x_lo, h * g[0])
    y, y_lo = accumulate(y, y_lo, h * g[1])
    z, z_lo = accumulate(z, z_lo, h * g[2])
    return Particles(x, y, z, x_lo, y_lo, z_lo, vx, vy, vz, vx_lo, vy_lo, vz_lo)


@kernel(inline=True)
def drifted(particles, h):
    """Return particles with the positions advanced by h times the velocities."""
    x, y, z, x_lo, y_lo, z_lo, vx, vy, vz, vx_lo, vy_lo, vz_lo = particles
    x, x_lo = add_product(x, x_lo, h, vx, vx_lo)
    y, y_lo = add_product(y, y_lo, h, vy, vy_lo)
    z, z_lo = add_product(z, z_lo, h, vz, vz_lo)
    return Particles(x, y, z, x_lo, y_lo, z_lo, vx, vy, vz, vx_lo, vy_lo, vz_lo)


@kernel(inline=True)
def load_particles(columns, p):
    """Return particles p ... p + 7 of a `Columns`."""
    q, q_lo, v, v_lo = columns
    return Particles(
        load(q[0], p), load(q[1], p), load(q[2], p),
        load(q_lo[0], p), load(q_lo[1], p), load(q_lo[2], p),
        load(v[0], p), load(v[1], p), load(v[2], p),
        load(v_lo[0], p), load(v_lo[1], p), load(v_lo[2], p),
    )  # fmt: skip


@kernel(inline=True)
def store_particles(columns, p, particles):
    """Write eight particles to where `load_particles` reads them."""
    q, q_lo, v, v_lo = columns
    x, y, z, x_lo, y_lo, z_lo, vx, vy, vz, vx_lo, vy_lo, vz_lo = particles
    store(q[0], p, x)
    store(q[1], p, y)
    store(q[2], p, z)
    store(q_lo[0], p, x_lo)
    store(q_lo[1], p, y_lo)
    store(q_lo[2], p, z_lo)
    store(v[0], p, vx)
    store(v[1], p, vy)
    store(v[2], p, vz)
    store(v_lo[0], p, vx_lo)
    store(v_lo[1], p, vy_lo)
    store(v_lo[2], p, vz_lo)


@kernel(inline=True)
def load_particle(columns, p):
    """Return particle p, in float64."""
    q, q_lo, v, v_lo = columns
    return Particles(
        q[0, p], q[1, p], q[2, p], q_lo[0, p], q_lo[1, p], q_lo[2, p],
        v[0, p], v[1, p], v[2, p], v_lo[0, p], v_lo[1, p], v_lo[2, p],
    )  # fmt: skip


@kernel(inline=True)
def store_particle(columns, p, particle):
    """Write a particle to where `load_particle` reads it."""
    q, q_lo, v, v_lo = columns
    q[0, p], q[1, p], q[2, p], q_lo[0, p], q_lo[1, p], q_lo[2, p] = particle[:6]
    v[0, p], v[1, p], v[2, p], v_lo[0, p], v_lo[1, p], v_lo[2, p] = particle[6:]
