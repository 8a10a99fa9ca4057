"""Massless particles among planets in Jacobi coordinates: eight in lanes, each with a place in the planets' order.

A massless particle changes no coordinates but its own. One that has i planets inside it moves relative to their centre
of mass R_i, about M_i, as a planet of no mass in their order would (see `orbits.kernels.maps.jacobi`):

    r' = r - R_i,   r'' = -M_i r'/r'^3 + g,   g = f + B_i + M_i r'/r'^3 - m_0 u/u^3,   u = r' + C_i

with f the attraction by the planets, C_i = R_i - R_0 and B_i = -R_i''. Whatever its place, this is its motion to the
last bit; the place decides how small g is. About the dominant body alone, i = 0, the acceleration of that body is a
part of g, which far outside a planet is (r/a)^2 times as large as the attraction by the planet. About the centre of
mass of all, g has the displacement of the dominant body from it, which far inside is (a/r)^4 times as large. So a
particle has those planets inside it whose semi-major axes are below its pericentre distance at the start: where it is
fastest, and the steps are longest for it, g is small.

`memory` is (particles, 2, 8), what is marched: r' and its velocity, i + 1 (0 for a particle that has no place yet,
`ELSEWHERE` for one that other steps march) and M_i; then the low parts of the first six numbers. What particles need of
the planets stands in tables, see `orbits.kernels.maps.jacobi_tables`.

In democratic heliocentric coordinates all particles have the place 0, with C_0 = B_0 = 0: their coordinates are those
of planets (`orbits.kernels.maps.heliocentric`), the position relative to the dominant body and the velocity relative to
the centre of mass of all.

Source: Wisdom & Holman (1991), AJ 102, 1528; Rein & Tamayo (2015), MNRAS 452, 376.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from numba import types

from orbits.kernels.binding import plus
from orbits.kernels.compile import kernel
from orbits.kernels.compile.verbs import verb
from orbits.kernels.lanes import (
    WIDTH,
    fma,
    full,
    get,
    halves,
    inverse_powers,
    joined,
    lane,
    load,
    load_like,
    select,
    store,
    store_like,
    transposed,
    unit,
)
from orbits.kernels.maps.interaction import Pair, change_of_pull, difference, pair_of
from orbits.kernels.maps.jacobi_tables import flow_rows, of_places
from orbits.kernels.maps.orbits import Orbits, displaced, kicked, moved, pushed_and_drifted
from orbits.kernels.maps.terms_by_kind import depends_on_velocities, strength_of
from orbits.kernels.maps.terms_of_dominant import particle_rates, pull_more
from orbits.kernels.maps.threes import (
    added,
    chosen,
    half_of_three,
    joined_three,
    load_three,
    minus,
    store_three,
    times,
)
from orbits.kernels.search.context import flat
from orbits.kernels.steps import NOWHERE, Particles

MEMORY_ROWS = 2
"""Rows of a particle in `memory`."""

NUMBER, ATTRACTED = 6, 7
"""Columns of the first row of a particle: i + 1, and M_i."""

ELSEWHERE = -1.0
"""In the place of i + 1: the particle is not marched by the map, and its state is what is seen of it."""


class Marched(NamedTuple):
    """Eight particles as they are marched, or two times eight.

    orbits : r' and its velocity; g : three numbers; gm : M_i, 0 in lanes without a particle
    number : i; common : i as an integer if it is that of all lanes, else -1
    """

    orbits: Any
    g: Any
    gm: Any
    number: Any
    common: Any


@kernel(inline=True)
def on_orbits(marched, orbits):
    """Return particles on other orbits."""
    return Marched(orbits, marched.g, marched.gm, marched.number, marched.common)


@kernel(inline=True)
def with_force(marched, g):
    """Return particles with another g."""
    return Marched(marched.orbits, g, marched.gm, marched.number, marched.common)


@verb
def _keep_powers(rows, j, cubed, squared):
    """Write powers of the distances from planet j to the workspace of `interaction`, unless this is None."""
    return (lambda rows, j, cubed, squared: None) if rows == types.none else _store_powers


def _store_powers(rows, j, cubed, squared):
    store_like(rows, WIDTH + 4 * j, 1, cubed)
    store_like(rows, WIDTH + 4 * j + 2, 1, squared)


@kernel(inline=True)
def _load_powers(like, rows, j):
    return load_like(like, rows, WIDTH + 4 * j, 1), load_like(like, rows, WIDTH + 4 * j + 2, 1)


@kernel(inline=True)
def _plain(line, first, count, second, place, moved, marched, rows):
    """Return (g, u) at a place relative to R_i.

    line : the table, row after row; second : whether of the planets at displaced positions; moved : C_i and B_i
    rows : receives powers of the distances from the planets, for `_modified`, or None
    """
    u, g = plus(place, moved[0]), moved[1]
    for j in range(count):
        row = WIDTH * (first + j)
        d = minus(load_three(line, row + 3 * second), u)
        cubed, squared = inverse_powers(fma(d[2], d[2], fma(d[1], d[1], d[0] * d[0])))
        _keep_powers(rows, j, cubed, squared)
        g = added(g, cubed * get(line, row + 6), d)
    if marched.common == 0:  # inside all planets the pull of the dominant body is that of the Kepler part, exactly
        return g, u
    kepler, centre = marched.gm * pair_of(place).cubed, central(line, first + count, marched) * pair_of(u).cubed
    return plus(g, _differences(kepler, place, centre, u)), u


@kernel(inline=True)
def central(line, places, marched):
    """Return m_0 of a table, and 0 in lanes without a particle, where nothing attracts."""
    return select(marched.gm > 0.0, get(line, WIDTH * places + 7), 0.0)


@kernel(inline=True)
def _differences(a, b, c, d):
    """Return a b - c d of three numbers each, which are exactly 0 for equal products."""
    return difference(a, b[0], c, d[0]), difference(a, b[1], c, d[1]), difference(a, b[2], c, d[2])


@kernel(inline=True)
def _modified(line, first, count, shift, marched, plain, second, rows):
    """Return g of the modified kick.

    plain : (g, u), from `_plain`, with what it wrote to `rows`; second : the displacement of R_i - R_0, and B_i of the
        modified kick
    """
    (g, u), (e, change) = plain, second
    shifted, e = times(shift, g), added(e, shift, g)
    for j in range(count):
        row = WIDTH * (first + j)
        d, apart = minus(load_three(line, row), u), minus(load_three(line, row + 3), e)
        cubed, squared = _load_powers(marched.gm, rows, j)
        change = added(change, get(line, row + 6), change_of_pull(Pair(d, cubed, squared), apart))
    if marched.common == 0:
        return plus(g, change)
    kepler, centre = change_of_pull(pair_of(marched.orbits.place), shifted), change_of_pull(pair_of(u), e)
    apart = _differences(marched.gm, kepler, central(line, first + count, marched), centre)
    return plus(g, plus(change, apart))


@kernel(inline=True)
def interaction(model, table, first, shift, lazy, marched, rows):
    """Return g for the kick of a step: plain, modified, or at displaced positions.

    shift : h^2/12, or 0 for the plain kick; lazy : whether it is the lazy one
    rows : workspace, (8, 8), and four rows for each planet unless it is the plain or the lazy kick
    """
    count, place = strength_of(model).shape[0] - 2, marched.orbits.place
    line, number, common, places = flat(table), marched.number, marched.common, first + count
    moved = of_places(line, places, 0, number, common, rows)
    if shift != 0.0 and not lazy:
        plain = _plain(line, first, count, 0, place, moved, marched, rows)
        e, b = of_places(line, places, 1, number, common, rows)
        # The plain B_i is in g already.
        g, u = _modified(line, first, count, shift, marched, plain, (e, minus(b, moved[1])), rows), plain[1]
        return pull_more(model, u, g)
    g, u = _plain(line, first, count, 0, place, moved, marched, None)
    if lazy:
        there = added(place, shift, pull_more(model, u, g))
        moved = of_places(line, places, 1, number, common, rows)
        g, u = _plain(line, first, count, 1, there, moved, marched, None)
    return pull_more(model, u, g)


@kernel
def with_interaction(model, table, first, shift, lazy, marched, rows):
    """Return particles with their g, that for the kick of a step, to the bits that `interaction` gives elsewhere: there
    is no product in it whose sum could be rounded in two ways.
    """
    return with_force(marched, interaction(model, table, first, shift, lazy, marched, rows))


@kernel(inline=True)
def drifted_particles(marched, h, kick, jump):
    """Return particles moved on their Kepler orbits by h, from velocities changed by `kick` times g, and the change of
    their velocities, which they do not have yet, that by the kick included; jump : see `pushed_and_drifted`.
    """
    orbits, change = pushed_and_drifted(marched.orbits, marched.gm, h, jump, times(kick, marched.g))
    return on_orbits(marched, orbits), change


@kernel(inline=True)
def kicked_particles(marched, change, kick, g):
    """Return particles with velocities changed by `change` and by `kick` times g, rounded once, and this g."""
    return with_force(on_orbits(marched, kicked(marched.orbits, added(change, kick, g))), g)


@kernel(inline=True)
def moved_particles(marched, h):
    """Return particles after Kepler motions of h."""
    return on_orbits(marched, moved(marched.orbits, marched.gm, h))


@kernel(inline=True)
def seen_at(table, places, marched, rows):
    """Return particles as observers see them, uncorrected, and in lanes without one at rest far away.

    places : the first of the rows of places in the table, which have R_i and its velocity
    """
    there, zero = marched.gm > 0.0, 0.0 * marched.gm
    origin, motion = of_places(flat(table), places, 2, marched.number, marched.common, rows)
    x, y, z = chosen(there, plus(origin, marched.orbits.place), (NOWHERE, NOWHERE, NOWHERE))
    vx, vy, vz = chosen(there, plus(motion, marched.orbits.velocity), (0.0, 0.0, 0.0))
    return Particles(x, y, z, zero, zero, zero, vx, vy, vz, zero, zero, zero)


@kernel(inline=True)
def present(memory, retired, p):
    """Return 1 in the lanes of particles that are neither retired nor marched elsewhere."""
    there = full(1.0)
    for k in range(WIDTH):
        if retired[p + k, 0] != 0 or (p + k < memory.shape[0] and memory[p + k, 0, NUMBER] == ELSEWHERE):
            there = there - unit(k)
    return there


@kernel(inline=True)
def take_particles(memory, p, there, rows):
    """Return particles p ... p + 7, with g = 0; lanes in which `there` is 0 rest far away. rows : (16, 8), workspace"""
    common, held = -2, full(0.0)
    for k in range(WIDTH):
        store(rows, k, full(0.0))
        store(rows, WIDTH + k, full(0.0))
        if p + k < memory.shape[0] and lane(there, k) != 0.0:
            store(rows, k, load(memory[p + k], 0))
            store(rows, WIDTH + k, load(memory[p + k], 1))
            i = int(memory[p + k, 0, NUMBER]) - 1
            common = i if common == -2 or common == i else -1
            held = held + unit(k)
    x, y, z, vx, vy, vz, number, gm = transposed(rows, 0)
    a, b, c, d, e, f, _, _ = transposed(rows, WIDTH)
    # All lanes without a particle are at one place, and take any number.
    number = select(held > 0.0, number - 1.0, full(max(common, 0) * 1.0))
    x = select(held > 0.0, x, NOWHERE)
    orbits = Orbits((x, y, z), (vx, vy, vz), (a, b, c), (d, e, f))
    return Marched(orbits, (full(0.0), full(0.0), full(0.0)), gm, number, 0 if common == -2 else common)


@kernel(inline=True)
def joined_marched(one, two):
    """Return two times eight particles at once."""
    a, b = one.orbits, two.orbits
    orbits = Orbits(
        joined_three(a.place, b.place),
        joined_three(a.velocity, b.velocity),
        joined_three(a.place_lo, b.place_lo),
        joined_three(a.velocity_lo, b.velocity_lo),
    )
    common = one.common if one.common == two.common else -1
    return Marched(orbits, joined_three(one.g, two.g), joined(one.gm, two.gm), joined(one.number, two.number), common)


@kernel(inline=True)
def half_of_marched(both, which):
    """Return eight of `joined_marched`; which : 0 or 1, a literal."""
    a = both.orbits
    orbits = Orbits(
        half_of_three(a.place, which),
        half_of_three(a.velocity, which),
        half_of_three(a.place_lo, which),
        half_of_three(a.velocity_lo, which),
    )
    number, gm = halves(both.number)[which], halves(both.gm)[which]
    return Marched(orbits, half_of_three(both.g, which), gm, number, both.common)


@kernel(inline=True)
def store_marched(memory, p, marched, rows):
    """Write eight particles to where `take_particles` reads them, but for lanes without one."""
    orbits, gm = marched.orbits, marched.gm
    store_three(rows, 0, orbits.place)
    store_three(rows, 3, orbits.velocity)
    store(rows, 6, marched.number + 1.0)
    store(rows, 7, gm)
    store_three(rows, WIDTH, orbits.place_lo)
    store_three(rows, WIDTH + 3, orbits.velocity_lo)
    store(rows, 14, full(0.0))
    store(rows, 15, full(0.0))
    a, b = transposed(rows, 0), transposed(rows, WIDTH)
    for k in range(WIDTH):
        if p + k < memory.shape[0] and lane(gm, k) != 0.0:
            store(memory[p + k], 0, a[k])
            store(memory[p + k], 1, b[k])


# --------------------------------------------------------------------------------------------- the flow of other terms


@verb
def flowing_particles(model, table, first, marched, rows, h):
    """Return particles after h in the flow of terms that depend on velocities."""
    if not depends_on_velocities(model):
        return lambda model, table, first, marched, rows, h: marched
    return lambda model, table, first, marched, rows, h: _flowing(model, table, first, marched, rows, h)


@kernel(inline=True)
def _flowing(model, table, first, marched, rows, h):
    r, v = _rates(model, table, first, marched, rows, 0.5 * h, True)
    return on_orbits(marched, kicked(displaced(marched.orbits, times(h, r)), times(h, v)))


@kernel(inline=True)
def _rates(model, table, first, marched, rows, half, known):
    """Return the rates of r' and of its velocity in the flow of terms; 0 in lanes without a particle."""
    line, orbits, nothing = flat(table), marched.orbits, (0.0, 0.0, 0.0)
    offset, motion = of_places(line, first, 0, marched.number, marched.common, rows)
    drift, pull = of_places(line, first, 1, marched.number, marched.common, rows)
    at, there = WIDTH * (first + 1), marched.gm > 0.0
    central = load_three(line, at), load_three(line, at + 3)
    u, w = plus(orbits.place, offset), plus(orbits.velocity, motion)
    r, v = particle_rates(model, central, u, w, half, known)
    return chosen(there, minus(r, drift), nothing), chosen(there, minus(v, pull), nothing)


@verb
def change_momenta(model, table, particles, sign):
    """Change the velocities of particles to momenta for sign = -1, or back for sign = 1, with the table for it."""
    if not depends_on_velocities(model):
        return lambda model, table, particles, sign: None
    return lambda model, table, particles, sign: _change_all(model, table, particles, sign)


@kernel
def _change_all(model, table, particles, sign):
    memory, retired, rows, share = particles
    first = flow_rows(strength_of(model).shape[0] - 2)
    for p in range(share.start, share.stop, WIDTH):
        marched = take_particles(memory, p, present(memory, retired, p), rows)
        rate, _ = _rates(model, table, first, marched, rows, 0.0, sign > 0.0)
        store_marched(memory, p, on_orbits(marched, kicked(marched.orbits, times(sign, rate))), rows)
