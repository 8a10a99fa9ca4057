"""The interaction of planets in Jacobi coordinates, one in each lane, and its change along itself, which the modified
kick adds.

`orbits.kernels.maps.jacobi` has its formula, a sum of d / |d|^3 over pairs of places. Its change along a displacement
is the same sum of the changes of these, by the same source: `changes`, a literal, says which of the two is asked for.
The pairs within a register are formed by turning it: by 1, 2 and 3 lanes for both planets of a pair, by 4 for one.
Those of two registers are formed by broadcasting the planets of one. Up to sixteen planets stay in registers, in one or
in two at once, `joined`: one source for both. More are taken by passes over memory.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from orbits.kernels.binding import plus
from orbits.kernels.compile import kernel
from orbits.kernels.compile.verbs import verb
from orbits.kernels.lanes import (
    WIDTH,
    alike,
    exact_mul,
    exact_sub,
    first_lane,
    fma,
    full,
    halves,
    inverse_powers,
    joined,
    lane,
    load,
    pair,
    total,
    turned,
    unit,
)
from orbits.kernels.maps.layout import (
    FORCE,
    MASS,
    MOVED,
    PLACE,
    ROWS,
    SHARE,
    SHIFTED,
    STATE_ROWS,
    masses_of,
)
from orbits.kernels.maps.orbits import orbits_of
from orbits.kernels.maps.threes import (
    added,
    dot,
    half_of_three,
    inside_of,
    joined_three,
    load_three,
    load_three_like,
    minus,
    outside_of,
    store_three,
    store_three_like,
    times,
    totals,
)


@kernel(inline=True, exact=True)
def difference(a, b, c, d):
    """Return a b - c d, which is exactly 0 for equal products."""
    return exact_sub(exact_mul(a, b), exact_mul(c, d))


class Pair(NamedTuple):
    """A difference of two places, three numbers; its length to the power of -3 and of -2."""

    apart: Any
    cubed: Any
    squared: Any


class Pairs(NamedTuple):
    """The pairs of planets that stay in registers: four of those of the first register with those 1 ... 4 lanes on;
    that of each with the dominant body, and with the centre of mass of those inside.
    """

    among: Any
    inwards: Any
    own: Any


@kernel(inline=True)
def pair_of(apart):
    """Return the `Pair` of a difference."""
    cubed, squared = inverse_powers(dot(apart, apart))
    return Pair(apart, cubed, squared)


@kernel(inline=True)
def change_of_pull(of, e):
    """Return the change of d / |d|^3 along e."""
    return times(of.cubed, added(e, -3.0 * dot(of.apart, e) * of.squared, of.apart))


@kernel(inline=True)
def pull_of(of, e, changes):
    """Return d / |d|^3 of a `Pair`, or its change along e."""
    return change_of_pull(of, e) if changes else times(of.cubed, of.apart)


@kernel(inline=True)
def with_pull(f, mass, d, e, changes):
    """Return three numbers with `mass` times d / |d|^3, or its change along e."""
    cubed, squared = inverse_powers(fma(d[2], d[2], fma(d[1], d[1], d[0] * d[0])))
    return added(f, mass, change_of_pull(Pair(d, cubed, squared), e)) if changes else added(f, cubed * mass, d)


@kernel
def _interact(like, planets, room, shifted):
    """`interact`, of planets that stay in registers."""
    r = load_three_like(like, room, SHIFTED, ROWS) if shifted else orbits_of(like, planets).place
    force, place, _ = interaction(r, masses_of(like, room))
    store_three_like(room, FORCE, ROWS, force)
    store_three_like(room, PLACE, ROWS, place)


@verb
def interact_in(registers, planets, room, count, shifted):
    """`interact` in the registers of a form; see `registers_of`."""
    if registers == pair:
        return lambda registers, planets, room, count, shifted: _interact(registers, planets, room, shifted)
    return lambda registers, planets, room, count, shifted: interact(planets, room, count, shifted)


@kernel
def interact(planets, room, count, shifted):
    """Write the interaction of `count` planets into the rows FORCE; shifted : whether at the displaced positions."""
    if room.shape[0] < 2 * ROWS:
        _interact(full(0.0), planets, room, shifted)
        return
    _write_places(planets, room, shifted, PLACE)
    _sum_in_passes(planets, room, count, shifted, False)


@kernel
def _modify(like, planets, room, shift):
    """`modify`, of planets that stay in registers."""
    masses, force = masses_of(like, room), load_three_like(like, room, FORCE, ROWS)
    _, _, pairs = interaction(orbits_of(like, planets).place, masses)
    change, shifted, moved = change_along(force, pairs, shift, masses)
    store_three_like(room, SHIFTED, ROWS, shifted)
    store_three_like(room, MOVED, ROWS, moved)
    store_three_like(room, FORCE, ROWS, change)


@verb
def modify_in(registers, planets, room, count, shift):
    """`modify` in the registers of a form."""
    if registers == pair:
        return lambda registers, planets, room, count, shift: _modify(registers, planets, room, shift)
    return lambda registers, planets, room, count, shift: modify(planets, room, count, shift)


@kernel
def modify(planets, room, count, shift):
    """Add `shift` times the derivative of the interaction along itself to the rows FORCE.

    The sum is the acceleration by the potential V - shift/2 sum of m'_i |r''_i|^2, with the masses m'_i of Jacobi's
    coordinates. `interact` must have been called.
    """
    registers = room.shape[0] // ROWS
    if registers == 1:
        _modify(full(0.0), planets, room, shift)
        return
    for first in range(0, ROWS * registers, ROWS):
        store_three(room, first + SHIFTED, times(shift, load_three(room, first + FORCE)))
    _write_places(planets, room, True, MOVED)
    _sum_in_passes(planets, room, count, False, True)


@kernel
def displace(planets, room, shift):
    """Write r' displaced by `shift` times the interaction."""
    for register in range(room.shape[0] // ROWS):
        first, other = STATE_ROWS * register, ROWS * register
        there = added(load_three(planets, first), full(shift), load_three(room, other + FORCE))
        store_three(room, other + SHIFTED, there)


# --------------------------------------------------------------------------------------------------------- in registers


@kernel(inline=True)
def interaction(r, masses):
    """Return the interaction of planets that stay in registers at r', u, and their `Pairs`."""
    u = plus(r, inside_of(masses.share, r))
    among = _pairs_within(_first_register(u))
    own = _pulls(u, among, u, masses, False)
    pairs = Pairs(among, pair_of(u), pair_of(r))  # after a loop over planets, in which registers are scarce
    return _summed(own, pairs, r, u, masses, False), u, pairs


@kernel(inline=True)
def change_along(force, pairs, shift, masses):
    """Return the interaction of planets that stay in registers with `shift` times its derivative along itself, r' and u
    moved by `shift` times the interaction; pairs : of `interaction`.
    """
    shifted = times(shift, force)
    moved = plus(shifted, inside_of(masses.share, shifted))
    own = _pulls(pairs.inwards.apart, pairs.among, moved, masses, True)
    return plus(force, _summed(own, pairs, shifted, moved, masses, True)), shifted, moved


@kernel(inline=True)
def _summed(own, pairs, shifted, moved, masses, changes):
    """Return the interaction, or its change along a displacement of r' and the one of u; own : of `_pulls`."""
    kepler, centre = pull_of(pairs.own, shifted, changes), pull_of(pairs.inwards, moved, changes)
    beyond = outside_of(_on_inner(masses, own, pairs.inwards, centre, changes))
    return _whole(masses, own, beyond, pairs, kepler, centre, changes)


@kernel(inline=True)
def _on_inner(masses, own, inwards, centre, changes):
    """Return m F, which is summed over the planets further out; centre : see `_whole`."""
    if changes:
        return times(masses.mass, added(own, -masses.central, centre))
    return times(masses.mass, added(own, -masses.central * inwards.cubed, inwards.apart))


@kernel(inline=True)
def _whole(masses, own, beyond, pairs, kepler, centre, changes):
    """Return the interaction, or its change, from its three parts.

    kepler, centre : the changes of the pulls by the centre of mass of those inside and by the dominant body; else not
        used, as the pulls themselves are rounded once, with their masses
    """
    if changes:
        apart = added(kepler, -masses.pull, centre)
        further = times(masses.inner, beyond)
    else:
        (x, y, z), (ux, uy, uz), near = pairs.own.apart, pairs.inwards.apart, pairs.inwards.cubed
        pull, power = masses.pull * near, pairs.own.cubed
        apart = difference(x, power, ux, pull), difference(y, power, uy, pull), difference(z, power, uz, pull)
        further = added(times(-(masses.rest * near), pairs.inwards.apart), masses.inner, beyond)
    return added(added(further, masses.outer, own), masses.attracting, apart)


@verb
def _first_register(u):
    """Return the first register of three."""
    return (lambda u: half_of_three(u, 0)) if u[0] == pair else lambda u: u


@kernel(inline=True)
def _pairs_within(u):
    """Return the pairs of the planets of a register with those 1 ... 4 lanes on."""
    return pair_of(_apart(u, 1)), pair_of(_apart(u, 2)), pair_of(_apart(u, 3)), pair_of(_apart(u, 4))


@kernel(inline=True)
def _apart(a, places):
    """Return what three numbers are so many lanes on, less what they are."""
    return turned(a[0], places) - a[0], turned(a[1], places) - a[1], turned(a[2], places) - a[2]


@kernel(inline=True)
def pulls_within(u, mass):
    """Return the accelerations of the planets of a register at u by each other."""
    return _pulls_of_pairs(_pairs_within(u), u, mass, False)


@kernel(inline=True)
def _pulls_of_pairs(among, moved, mass, changes):
    """Return the accelerations of the planets of a register by each other, or their changes with the places moved."""
    a, b = pull_of(among[0], _apart(moved, 1), changes), pull_of(among[1], _apart(moved, 2), changes)
    c, d = pull_of(among[2], _apart(moved, 3), changes), pull_of(among[3], _apart(moved, 4), changes)
    return _sum_of_pairs(mass, a, b, c, d)


@kernel(inline=True)
def _sum_of_pairs(mass, a, b, c, d):
    """Return the sums over pairs: a ... d times the mass of the planet 1 ... 4 lanes on, and back."""
    return (
        _component(mass, a[0], b[0], c[0], d[0]),
        _component(mass, a[1], b[1], c[1], d[1]),
        _component(mass, a[2], b[2], c[2], d[2]),
    )


@kernel(inline=True)
def _component(mass, a, b, c, d):
    there = fma(turned(mass, 1), a, turned(mass, 2) * b) + fma(turned(mass, 3), c, turned(mass, 4) * d)
    return there - ((turned(mass * a, 7) + turned(mass * b, 6)) + turned(mass * c, 5))


@verb
def _pulls(u, among, moved, masses, changes):
    """Return the accelerations of planets by each other, or their changes with the places moved; among : the pairs of
    those in the first register.
    """
    if moved[0] == pair:
        return _pulls_of_two
    return lambda u, among, moved, masses, changes: _pulls_of_pairs(among, moved, masses.mass, changes)


def _pulls_of_two(u, among, moved, masses, changes):
    """Those of the first register by turning it; then each planet of the second one with all others at once, so that
    the time grows with how many there are.
    """
    (mass, source), here, none = halves(masses.mass), unit(0), (full(0.0), full(0.0), full(0.0))
    U, E, b = half_of_three(u, 1), half_of_three(moved, 1), none
    f = joined_three(_pulls_of_pairs(among, half_of_three(moved, 0), mass, changes), none)
    _, attracting = halves(masses.attracting)
    for _ in range(first_lane(attracting <= 0.0)):  # the planets in the second register
        d = _first_less(U, u)
        # A body feels nothing of itself: its distance, 0, is made 1.
        r2 = fma(d[0], d[0], fma(d[1], d[1], fma(d[2], d[2], joined(full(0.0), here))))
        cubed, squared = inverse_powers(r2)
        there, back = alike(lane(source, 0), cubed), mass
        if changes:
            d = change_of_pull(Pair(d, cubed, squared), _first_less(E, moved))
        else:
            there, back = there * cubed, back * halves(cubed)[0]
        x, y, z = half_of_three(d, 0)
        f = added(f, there, d)
        b = added(b, here, (-total(back * x), -total(back * y), -total(back * z)))
        U, E, source, here = _turned(U), _turned(E), turned(source, 1), turned(here, 7)
    return plus(f, joined_three(none, b))


@kernel(inline=True)
def _first_less(A, a):
    """Return the first lanes of three registers less others."""
    return lane(A[0], 0) - a[0], lane(A[1], 0) - a[1], lane(A[2], 0) - a[2]


@kernel(inline=True)
def _turned(a):
    return turned(a[0], 1), turned(a[1], 1), turned(a[2], 1)


# ------------------------------------------------------------------------------------------------ in passes over memory


@kernel
def _write_places(planets, room, shifted, row):
    """Write r' of planets, or the rows SHIFTED, relative to the dominant body into three rows of each register."""
    inside = 0.0, 0.0, 0.0
    for register in range(room.shape[0] // ROWS):
        first, r = ROWS * register, _coordinates_of(planets, room, register, shifted)
        share = load(room, first + SHARE)
        store_three(room, first + row, plus(r, plus(inside, inside_of(share, r))))
        inside = plus(inside, totals(times(share, r)))


@kernel(inline=True)
def _coordinates_of(planets, room, register, shifted):
    """Return r' of a register, or the displaced one."""
    if shifted:
        return load_three(room, ROWS * register + SHIFTED)
    return load_three(planets, STATE_ROWS * register)


@kernel
def _sum_in_passes(planets, room, count, displaced, changes):
    """Write the interaction at u, in the rows PLACE, into the rows FORCE; or add its change along the rows SHIFTED, and
    MOVED for u. From outside inwards, for the sums over the planets further out.

    displaced : whether r' is in the rows SHIFTED, too
    """
    registers, beyond = room.shape[0] // ROWS, (0.0, 0.0, 0.0)
    for k in range(registers):
        register = registers - 1 - k
        first = ROWS * register
        masses, u = masses_of(full(0.0), room[first:]), load_three(room, first + PLACE)
        shifted, moved = load_three(room, first + SHIFTED), load_three(room, first + MOVED)
        pairs = Pairs(_pairs_within(u), pair_of(u), pair_of(_coordinates_of(planets, room, register, displaced)))
        own = _pulls_of_pairs(pairs.among, moved, masses.mass, changes)
        for source in range(registers):
            other = ROWS * source
            for slot in range(min(WIDTH, count - WIDTH * source) if source != register else 0):
                d, e = minus(_column(room, other + PLACE, slot), u), minus(_column(room, other + MOVED, slot), moved)
                own = with_pull(own, room[other + MASS, slot], d, e, changes)
        kepler, centre = pull_of(pairs.own, shifted, changes), pull_of(pairs.inwards, moved, changes)
        inner = _on_inner(masses, own, pairs.inwards, centre, changes)
        further = plus(outside_of(inner), beyond)
        beyond = plus(beyond, totals(inner))
        force = _whole(masses, own, further, pairs, kepler, centre, changes)
        if changes:
            force = plus(load_three(room, first + FORCE), force)
        store_three(room, first + FORCE, force)


@kernel(inline=True)
def _column(room, first, slot):
    return room[first, slot], room[first + 1, slot], room[first + 2, slot]
