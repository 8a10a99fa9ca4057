"""What maps move on Kepler orbits: planets of one or two registers, or massless particles, in lanes.

One source for all of them: eight in a register, or sixteen in two at once (`joined`).
"""

from __future__ import annotations

from typing import Any, NamedTuple

from orbits.kernels.compile import kernel
from orbits.kernels.kepler.short_flow import short_increments
from orbits.kernels.lanes import alike, fma, load_like, store_like
from orbits.kernels.maps.layout import STATE_ROWS
from orbits.kernels.sums.summation import accumulate


class Orbits(NamedTuple):
    """Places and velocities in the coordinates of a map, and their low parts, in the order of the rows of `planets`."""

    x: Any
    y: Any
    z: Any
    vx: Any
    vy: Any
    vz: Any
    x_lo: Any
    y_lo: Any
    z_lo: Any
    vx_lo: Any
    vy_lo: Any
    vz_lo: Any


@kernel(inline=True)
def orbits_of(like, planets):
    """Return the planets of as many registers as `like` has."""
    return Orbits(
        load_like(like, planets, 0, STATE_ROWS),
        load_like(like, planets, 1, STATE_ROWS),
        load_like(like, planets, 2, STATE_ROWS),
        load_like(like, planets, 3, STATE_ROWS),
        load_like(like, planets, 4, STATE_ROWS),
        load_like(like, planets, 5, STATE_ROWS),
        load_like(like, planets, 6, STATE_ROWS),
        load_like(like, planets, 7, STATE_ROWS),
        load_like(like, planets, 8, STATE_ROWS),
        load_like(like, planets, 9, STATE_ROWS),
        load_like(like, planets, 10, STATE_ROWS),
        load_like(like, planets, 11, STATE_ROWS),
    )


@kernel(inline=True)
def write_orbits(planets, orbits):
    """Write planets to where `orbits_of` reads them."""
    store_like(planets, 0, STATE_ROWS, orbits.x)
    store_like(planets, 1, STATE_ROWS, orbits.y)
    store_like(planets, 2, STATE_ROWS, orbits.z)
    store_like(planets, 3, STATE_ROWS, orbits.vx)
    store_like(planets, 4, STATE_ROWS, orbits.vy)
    store_like(planets, 5, STATE_ROWS, orbits.vz)
    store_like(planets, 6, STATE_ROWS, orbits.x_lo)
    store_like(planets, 7, STATE_ROWS, orbits.y_lo)
    store_like(planets, 8, STATE_ROWS, orbits.z_lo)
    store_like(planets, 9, STATE_ROWS, orbits.vx_lo)
    store_like(planets, 10, STATE_ROWS, orbits.vy_lo)
    store_like(planets, 11, STATE_ROWS, orbits.vz_lo)


@kernel(inline=True)
def place_of(orbits):
    """Return (x, y, z)."""
    return orbits.x, orbits.y, orbits.z


@kernel(inline=True)
def velocity_of(orbits):
    """Return (vx, vy, vz)."""
    return orbits.vx, orbits.vy, orbits.vz


@kernel(inline=True)
def added(a, factor, b):
    """Return a + factor b of three numbers each."""
    return fma(factor, b[0], a[0]), fma(factor, b[1], a[1]), fma(factor, b[2], a[2])


@kernel(inline=True)
def times(factor, a):
    """Return factor a of three numbers."""
    return factor * a[0], factor * a[1], factor * a[2]


@kernel(inline=True)
def displaced(orbits, change):
    """Return orbits with other places, changed by three numbers, rounded once."""
    x, x_lo = accumulate(orbits.x, orbits.x_lo, change[0])
    y, y_lo = accumulate(orbits.y, orbits.y_lo, change[1])
    z, z_lo = accumulate(orbits.z, orbits.z_lo, change[2])
    return Orbits(
        x, y, z, orbits.vx, orbits.vy, orbits.vz, x_lo, y_lo, z_lo, orbits.vx_lo, orbits.vy_lo, orbits.vz_lo
    )


@kernel(inline=True)
def kicked(orbits, change):
    """Return orbits with other velocities, changed by three numbers, rounded once."""
    vx, vx_lo = accumulate(orbits.vx, orbits.vx_lo, change[0])
    vy, vy_lo = accumulate(orbits.vy, orbits.vy_lo, change[1])
    vz, vz_lo = accumulate(orbits.vz, orbits.vz_lo, change[2])
    return Orbits(
        orbits.x, orbits.y, orbits.z, vx, vy, vz, orbits.x_lo, orbits.y_lo, orbits.z_lo, vx_lo, vy_lo, vz_lo
    )


@kernel(inline=True)
def drifted(orbits, gm, h, velocity):
    """Return orbits with the places after a Kepler motion of h about gm from other velocities, and the change of these
    in it, which the orbits do not have yet. Fast for steps that are short beside the orbits.
    """
    (x, y, z), (vx, vy, vz) = place_of(orbits), velocity
    dx, dy, dz, dvx, dvy, dvz = short_increments(x, y, z, vx, vy, vz, gm, alike(h, vx))
    return displaced(orbits, (dx, dy, dz)), (dvx, dvy, dvz)


@kernel(inline=True)
def kicked_and_drifted(orbits, gm, h, kick, force):
    """Return the same with velocities changed by `kick` times the force, which the change then includes."""
    moved, change = drifted(orbits, gm, h, added(velocity_of(orbits), kick, force))
    return moved, added(change, kick, force)
