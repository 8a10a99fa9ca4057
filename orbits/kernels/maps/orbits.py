"""What maps move on Kepler orbits: planets of one or two registers, or massless particles, in lanes.

One source for all of them: eight in a register, or sixteen in two at once (`joined`).
"""

from __future__ import annotations

from typing import Any, NamedTuple

from numba import types

from orbits.kernels.binding import plus
from orbits.kernels.compile import kernel
from orbits.kernels.compile.verbs import verb
from orbits.kernels.kepler.short_flow import short_increments
from orbits.kernels.lanes import alike
from orbits.kernels.maps.layout import STATE_ROWS
from orbits.kernels.maps.threes import accumulated, added, load_three_like, minus, store_three_like


class Orbits(NamedTuple):
    """Places and velocities in the coordinates of a map, and their low parts, three numbers each, in the order of the
    rows of `planets`.
    """

    place: Any
    velocity: Any
    place_lo: Any
    velocity_lo: Any


@kernel(inline=True)
def orbits_of(like, planets):
    """Return the planets of as many registers as `like` has."""
    return Orbits(
        load_three_like(like, planets, 0, STATE_ROWS),
        load_three_like(like, planets, 3, STATE_ROWS),
        load_three_like(like, planets, 6, STATE_ROWS),
        load_three_like(like, planets, 9, STATE_ROWS),
    )


@kernel(inline=True)
def write_orbits(planets, orbits):
    """Write planets to where `orbits_of` reads them."""
    store_three_like(planets, 0, STATE_ROWS, orbits.place)
    store_three_like(planets, 3, STATE_ROWS, orbits.velocity)
    store_three_like(planets, 6, STATE_ROWS, orbits.place_lo)
    store_three_like(planets, 9, STATE_ROWS, orbits.velocity_lo)


@kernel(inline=True)
def displaced(orbits, change):
    """Return orbits with other places, changed by three numbers, rounded once."""
    place, place_lo = accumulated(orbits.place, orbits.place_lo, change)
    return Orbits(place, orbits.velocity, place_lo, orbits.velocity_lo)


@kernel(inline=True)
def kicked(orbits, change):
    """Return orbits with other velocities, changed by three numbers, rounded once."""
    velocity, velocity_lo = accumulated(orbits.velocity, orbits.velocity_lo, change)
    return Orbits(orbits.place, velocity, orbits.place_lo, velocity_lo)


@kernel(inline=True)
def change_of_place(before, after):
    """Return how much the places of orbits have changed."""
    return plus(minus(after.place, before.place), minus(after.place_lo, before.place_lo))


@kernel(inline=True)
def change_of_velocity(before, after):
    """Return how much the velocities of orbits have changed."""
    return plus(minus(after.velocity, before.velocity), minus(after.velocity_lo, before.velocity_lo))


@kernel(inline=True)
def increments(place, velocity, gm, h):
    """Return the changes of place and velocity, three numbers each, in a Kepler motion of h about gm. Fast for steps
    that are short beside the orbits.
    """
    (x, y, z), (vx, vy, vz) = place, velocity
    dx, dy, dz, dvx, dvy, dvz = short_increments(x, y, z, vx, vy, vz, gm, alike(h, vx))
    return (dx, dy, dz), (dvx, dvy, dvz)


@kernel(inline=True)
def drifted(orbits, gm, h, velocity):
    """Return orbits with the places after a Kepler motion of h about gm from other velocities, and the change of these
    in it, which the orbits do not have yet.
    """
    way, change = increments(orbits.place, velocity, gm, h)
    return displaced(orbits, way), change


@kernel(inline=True)
def moved(orbits, gm, h):
    """Return orbits after a Kepler motion of h about gm."""
    there, change = drifted(orbits, gm, h, orbits.velocity)
    return kicked(there, change)


@verb
def _with(a, jump):
    """Return three numbers with others, unless these are None."""
    return (lambda a, jump: a) if jump == types.none else lambda a, jump: plus(a, jump)


@kernel(inline=True)
def pushed_and_drifted(orbits, gm, h, jump, push):
    """Return `drifted` from velocities changed by three numbers, which the change then includes, and from places that
    first jump by three others, unless these are None.
    """
    way, change = increments(_with(orbits.place, jump), plus(orbits.velocity, push), gm, h)
    return displaced(orbits, _with(way, jump)), plus(change, push)


@kernel(inline=True)
def kicked_and_drifted(orbits, gm, h, kick, force):
    """Return `drifted` with velocities changed by `kick` times the force, which the change then includes."""
    there, change = drifted(orbits, gm, h, added(orbits.velocity, kick, force))
    return there, added(change, kick, force)
