"""The stages of maps in Jacobi coordinates for planets: Kepler motions and kicks, one by one, and whole steps of those
that stay in registers, which are the same without leaving them.
"""

from __future__ import annotations

from orbits.kernels.compile import kernel
from orbits.kernels.kepler.flow import kepler_increments
from orbits.kernels.lanes import alike, full, load, store, turned, unit
from orbits.kernels.maps.interaction import change_along, displace, interact, interact_in, interaction, modify_in
from orbits.kernels.maps.jacobi_tables import tabulate
from orbits.kernels.maps.layout import (
    ATTRACTING,
    CHANGE,
    FORCE,
    MOVED,
    PLACE,
    ROWS,
    SHIFTED,
    STATE_ROWS,
    kind_of,
    masses_of,
    registers_in,
    stay_in_registers,
)
from orbits.kernels.maps.nearest import note_nearest
from orbits.kernels.maps.orbits import displaced, drifted, kicked, kicked_and_drifted, orbits_of, write_orbits
from orbits.kernels.maps.programs import KICK, LAZY, LENGTH, MODIFIED, SHIFT, STANDARD, WHOLE
from orbits.kernels.maps.terms_by_kind import has_terms, if_terms, strength_of
from orbits.kernels.maps.terms_of_dominant import flow, flow_of_register, force_with_pulls, kick_more
from orbits.kernels.maps.threes import added, load_three, load_three_like, store_three, store_three_like, times
from orbits.kernels.sums.summation import add_product

NO_TABLE = -1
"""In the place of the first row of a table: none is written."""


@kernel
def kick_planets(planets, room, h):
    """Advance the velocities by h times the interaction."""
    for register in range(room.shape[0] // ROWS):
        own = planets[STATE_ROWS * register :]
        force = load_three(room, ROWS * register + FORCE)
        write_orbits(own, kicked(orbits_of(full(0.0), own), times(h, force)))


@kernel
def move_planets(planets, room, h):
    """Advance the planets on their Kepler orbits by h, of any length."""
    for register in range(room.shape[0] // ROWS):
        own, attracting = planets[STATE_ROWS * register :], load(room, ROWS * register + ATTRACTING)
        orbits = orbits_of(full(0.0), own)
        (x, y, z), (vx, vy, vz) = orbits.place, orbits.velocity
        dx, dy, dz, dvx, dvy, dvz = kepler_increments(x, y, z, vx, vy, vz, attracting, full(h))
        write_orbits(own, kicked(displaced(orbits, (dx, dy, dz)), (dvx, dvy, dvz)))
    move_centre(planets, h)


@kernel
def advance_planets(planets, room, h, kick):
    """The same, to the same accuracy, fast for steps that are short beside the orbits, and from velocities changed by
    `kick` times the interaction.

    The velocities are not changed: the rows CHANGE receive the change, that by the kick included.
    """
    for register in range(room.shape[0] // ROWS):
        own, other = planets[STATE_ROWS * register :], ROWS * register
        force, attracting = load_three(room, other + FORCE), load(room, other + ATTRACTING)
        moved, change = kicked_and_drifted(orbits_of(full(0.0), own), attracting, h, kick, force)
        write_orbits(own, moved)
        store_three(room, other + CHANGE, change)
    move_centre(planets, h)


@kernel
def finish_velocities(planets, room, kick):
    """Add the rows CHANGE, and `kick` times the interaction, to the velocities, rounded once."""
    for register in range(room.shape[0] // ROWS):
        own, other = planets[STATE_ROWS * register :], ROWS * register
        change = added(load_three(room, other + CHANGE), full(kick), load_three(room, other + FORCE))
        write_orbits(own, kicked(orbits_of(full(0.0), own), change))


@kernel(inline=True)
def move_centre(planets, h):
    """Advance the centre of mass: its position is in lanes 0 ... 2, its velocity in the next three."""
    centre = STATE_ROWS * registers_in(planets)
    there, rest = load(planets, centre), load(planets, centre + 1)
    h = h * (unit(0) + unit(1) + unit(2))
    there, rest = add_product(there, rest, h, turned(there, 3), turned(rest, 3))
    store(planets, centre, there)
    store(planets, centre + 1, rest)


@kernel
def evaluate_kick(registers, model, kind, shift, planets, room, table, first):
    """Write the interaction for a kick, with terms of positions alone: plain, modified, or at displaced positions.

    kind : see `orbits.kernels.maps.programs`; shift : h^2/12
    table, first : where particles find what they need of it, see `orbits.kernels.maps.jacobi_tables`, or `NO_TABLE`
    """
    strength = strength_of(model)
    count = strength.shape[0] - 2
    interact_in(registers, planets, room, count, False)
    if kind != MODIFIED:
        kick_more(model, planets, room)
    if first >= 0:
        tabulate(strength, planets, room, table, first, STANDARD)
    if kind == MODIFIED:
        modify_in(registers, planets, room, count, shift)
    elif kind == LAZY:
        displace(planets, room, shift)
        interact_in(registers, planets, room, count, True)
    else:
        return
    kick_more(model, planets, room)
    if first >= 0:
        tabulate(strength, planets, room, table, first, kind)


@kernel
def step_in_memory(registers, model, coefficients, planets, room, table, first, flows):
    """Take a step of any number of planets: half a kick, Kepler motions, half a kick, with half the flow of terms that
    depend on velocities before and after the motions.

    table, first, flows : where particles find what they need of the kick and of the flows, or `NO_TABLE`
    """
    whole, kick = coefficients[0, WHOLE], 0.5 * coefficients[0, WHOLE]
    kind, shift = int(coefficients[0, KICK]), coefficients[0, SHIFT]
    if has_terms(model):
        second = flows + 3 * (strength_of(model).shape[0] - 1) if flows >= 0 else NO_TABLE
        kick_planets(planets, room, kick)
        flow(model, planets, room, table, flows, kick)
        advance_planets(planets, room, whole, 0.0)
        finish_velocities(planets, room, 0.0)
        flow(model, planets, room, table, second, kick)
        evaluate_kick(registers, model, kind, shift, planets, room, table, first)
        kick_planets(planets, room, kick)
    else:
        advance_planets(planets, room, whole, kick)
        evaluate_kick(registers, model, kind, shift, planets, room, table, first)
        finish_velocities(planets, room, kick)


@kernel(inline=True)
def take_step(registers, model, coefficients, planets, room, table, first, flows):
    """Take a step: half a kick, Kepler motions, half a kick, with half the flow of terms that depend on velocities
    before and after the motions; table, first, flows : see `step_in_memory`.
    """
    terms, strength, whole, shift = if_terms(model), strength_of(model), coefficients[0, WHOLE], coefficients[0, SHIFT]
    if not stay_in_registers(registers, room) or (has_terms(model) and first >= 0):
        step_in_memory(registers, model, coefficients, planets, room, table, first, flows)
    elif coefficients[0, KICK] == LAZY:
        step_lazy(registers, terms, strength, planets, room, table, first, whole, shift)
    elif coefficients[0, KICK] == MODIFIED:
        step_modified(registers, terms, strength, planets, room, table, first, whole, shift)
    else:
        step_plain(registers, terms, strength, planets, room, table, first, whole)


@kernel
def step_plain(registers, model, strength, planets, room, table, first, h):
    """Take a step of planets that stay in registers: half a kick, Kepler motions, half a kick.

    The same as `advance_planets`, the interaction for the kick and `finish_velocities`, to the last bit, but that
    nothing leaves registers, in two thirds of the time; with terms of the dominant body, half the flow of those that
    depend on velocities stands on both sides of the Kepler motions. The rows FORCE have the interaction of the kick
    before, and receive that of this one.

    registers : see `orbits.kernels.maps.layout.registers_of`; model : with terms, else None
    table, first : as in `evaluate_kick`
    """
    _step(kind_of(registers), model, strength, planets, room, table, first, h, 0.0, STANDARD)


@kernel
def step_modified(registers, model, strength, planets, room, table, first, h, shift):
    """The same with the modified kick, changed by `shift` times its derivative along itself."""
    _step(kind_of(registers), model, strength, planets, room, table, first, h, shift, MODIFIED)


@kernel
def step_lazy(registers, model, strength, planets, room, table, first, h, shift):
    """The same with the lazy kick, by the interaction at places displaced by `shift` times the interaction."""
    _step(kind_of(registers), model, strength, planets, room, table, first, h, shift, LAZY)


@kernel(inline=True)
def _step(like, model, strength, planets, room, table, first, h, shift, kind):
    orbits, kick = orbits_of(like, planets), 0.5 * h
    masses, force = masses_of(like, room), load_three_like(like, room, FORCE, ROWS)
    if has_terms(model):
        none = alike(0.0, like)
        orbits = flow_of_register(model, masses, kicked(orbits, times(kick, force)), kick)
        orbits, change = drifted(orbits, masses.attracting, h, orbits.velocity)
        orbits, change = flow_of_register(model, masses, kicked(orbits, change), kick), (none, none, none)
    else:
        orbits, change = kicked_and_drifted(orbits, masses.attracting, h, kick, force)
    write_orbits(planets, orbits)  # and read again for the kick: registers are scarce in between
    force, place, pairs = interaction(orbits.place, masses)
    note_nearest(room, pairs)
    if kind == LAZY:
        force = force_with_pulls(model, masses, place, force)
    if first >= 0 and kind != STANDARD:
        _tabulate(strength, planets, room, table, first, STANDARD, force, place)
    if kind == LAZY:
        there = added(orbits.place, shift, force)
        store_three_like(room, SHIFTED, ROWS, there)
        force, place, _ = interaction(there, masses)
    if kind == MODIFIED:
        force, shifted, moved = change_along(force, pairs, shift, masses)
        store_three_like(room, SHIFTED, ROWS, shifted)
        store_three_like(room, MOVED, ROWS, moved)
    force = force_with_pulls(model, masses, place, force)
    if first >= 0:
        _tabulate(strength, planets, room, table, first, kind, force, place)
    write_orbits(planets, kicked(orbits_of(like, planets), added(change, kick, force)))
    store_three_like(room, PLACE, ROWS, place)
    store_three_like(room, FORCE, ROWS, force)
    move_centre(planets, h)


@kernel(inline=True)
def _tabulate(strength, planets, room, table, first, evaluation, force, place):
    """`tabulate`, of planets in registers whose positions are written already."""
    store_three_like(room, PLACE, ROWS, place)
    store_three_like(room, FORCE, ROWS, force)
    tabulate(strength, planets, room, table, first, evaluation)


@kernel
def step_in_pairs(registers, strength, planets, room, stages, table, rows):
    """Take a step of kicks and Kepler motions in turn.

    registers : see `orbits.kernels.maps.layout.registers_of`
    stages : (2 s, columns), see `orbits.kernels.maps.programs`
    table, rows : where particles find what they need of the kicks, and the rows for each, or 0 if there are none
    """
    if stay_in_registers(registers, room):
        _step_in_registers(kind_of(registers), strength, planets, room, stages, table, rows)
        return
    for i in range(stages.shape[0] // 2):
        interact(planets, room, strength.shape[0] - 2, False)
        if rows > 0:
            tabulate(strength, planets, room, table, i * rows, STANDARD)
        advance_planets(planets, room, stages[2 * i + 1, LENGTH], stages[2 * i, LENGTH])
        finish_velocities(planets, room, 0.0)


@kernel
def _step_in_registers(like, strength, planets, room, stages, table, rows):
    """The same for planets that fit into as many registers as `like` has, without leaving them."""
    orbits, masses = orbits_of(like, planets), masses_of(like, room)
    for i in range(stages.shape[0] // 2):
        kick, h = stages[2 * i, LENGTH], stages[2 * i + 1, LENGTH]
        force, place, _ = interaction(orbits.place, masses)
        if rows > 0:
            write_orbits(planets, orbits)
            _tabulate(strength, planets, room, table, i * rows, STANDARD, force, place)
        orbits, change = kicked_and_drifted(orbits, masses.attracting, h, kick, force)
        orbits = kicked(orbits, change)
        move_centre(planets, h)
    write_orbits(planets, orbits)
