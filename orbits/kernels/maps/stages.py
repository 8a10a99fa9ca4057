"""The stages of Wisdom–Holman maps, one by one, of planets and of massless particles, in the coordinates of a method;
what enters and leaves these; see `orbits.kernels.maps.programs`.

Steps of planets that stay in registers, and of particles, are the same stages in sequence.
"""

from __future__ import annotations

from orbits.kernels.binding import kernel_of
from orbits.kernels.compile import kernel
from orbits.kernels.compile.verbs import WithoutFirst, verb
from orbits.kernels.lanes import WIDTH, full, select
from orbits.kernels.maps.heliocentric import (
    drift_heliocentric,
    enter_heliocentric,
    kick_and_drift_heliocentric,
    kick_heliocentric,
    leave_heliocentric,
    origin_of,
    prepare_heliocentric,
    show_heliocentric,
    tabulate_heliocentric,
    tabulate_origin,
)
from orbits.kernels.maps.jacobi import (
    centre_of,
    difference_of_pairs,
    enter_planets,
    leave_planets,
    number_planets,
    prepare_room,
    show_planets,
    sum_of_pairs,
)
from orbits.kernels.maps.jacobi_particles import (
    ATTRACTED,
    ELSEWHERE,
    NUMBER,
    interaction,
    kicked_particles,
    moved_particles,
    present,
    store_marched,
    take_particles,
)
from orbits.kernels.maps.jacobi_stages import (
    NO_TABLE,
    advance_planets,
    evaluate_kick,
    finish_velocities,
    kick_planets,
    move_planets,
    step_in_pairs,
)
from orbits.kernels.maps.jacobi_tables import flow_rows, tabulate_centres
from orbits.kernels.maps.layout import (
    ATTRACTING,
    STATE_ROWS,
    constant,
    coordinate,
    copy_rows,
    dominant,
    registers_in,
    registers_of,
    rest_elsewhere,
)
from orbits.kernels.maps.particle_flow import change_momenta, flowing_particles
from orbits.kernels.maps.programs import DRIFT, FLOW, HEADER, LENGTH, SHIFT, STANDARD, programs_of, stage_of
from orbits.kernels.maps.terms_by_kind import has_terms, strength_of
from orbits.kernels.maps.terms_of_dominant import change_variables, flow
from orbits.kernels.maps.threes import load_three, times
from orbits.kernels.search.apsides import apsides
from orbits.kernels.search.context import flat


def is_heliocentric(method):
    """Return whether a method, by its Numba type, marches democratic heliocentric coordinates."""
    return kernel_of(method.types[0], "heliocentric") is not None


@verb
def prepare(method, strength, planets, room):
    """Write the constants of the planets in their order."""
    return WithoutFirst(prepare_heliocentric if is_heliocentric(method) else prepare_room)


@verb
def _enter_component(method, planets, room, component, n, x, x_lo):
    return WithoutFirst(enter_heliocentric if is_heliocentric(method) else enter_planets)


@verb
def _leave_component(method, planets, room, component, n, x, x_lo):
    return WithoutFirst(leave_heliocentric if is_heliocentric(method) else leave_planets)


@kernel
def enter_coordinates(method, strength, q, q_lo, p, p_lo, planets, room):
    """Write the planets of a state of bodies, and their constants, and number them unless they are numbered already."""
    n, furthest = strength.shape[0] - 1, 0.0
    if planets[STATE_ROWS * registers_in(planets), 7] == 0.0:
        number_planets(strength, q, p, planets)
    prepare(method, strength, planets, room)
    for component in range(6):
        x, x_lo = (q, q_lo) if component < 3 else (p, p_lo)
        axis = component % 3 * n
        _enter_component(method, planets, room, component, n, x[axis:], x_lo[axis:])
        for i in range(n - 1 if component < 3 else 0):
            furthest = max(furthest, abs(coordinate(planets, component, i)))
    rest_elsewhere(planets, n - 1, furthest)


@kernel
def leave_coordinates(method, strength, planets, room, q, q_lo, p, p_lo):
    """Write the state of the bodies, in doubled precision."""
    n = strength.shape[0] - 1
    for component in range(6):
        x, x_lo = (q, q_lo) if component < 3 else (p, p_lo)
        axis = component % 3 * n
        _leave_component(method, planets, room, component, n, x[axis:], x_lo[axis:])


@verb
def show_coordinates(method, strength, planets, room, q, p):
    """Write the state of the bodies, rounded: for observers, at every step."""
    return WithoutFirst(show_heliocentric if is_heliocentric(method) else show_planets)


@verb
def origin(method, strength, planets, room, i, component):
    """Return a component of that to which particles with the place i are relative, as a pair (hi, lo)."""
    if is_heliocentric(method):
        return lambda method, strength, planets, room, i, component: origin_of(
            planets, room, strength.shape[0] - 2, component
        )
    return lambda method, strength, planets, room, i, component: centre_of(strength, planets, room, i, component)


@kernel
def _take_in_jacobi(model, kind, length, shift, planets, room, table, tabled):
    if kind == DRIFT:
        move_planets(planets, room, length)
    elif kind == FLOW:
        flow(model, planets, room, table, flow_rows(strength_of(model).shape[0] - 2) if tabled else NO_TABLE, length)
    else:
        evaluate_kick(None, model, kind, shift, planets, room, table, 0 if tabled else NO_TABLE)
        kick_planets(planets, room, length)


@kernel
def _take_in_heliocentric(model, kind, length, planets, room):
    if kind == DRIFT:
        drift_heliocentric(planets, room, length)
    else:
        kick_heliocentric(planets, room, strength_of(model).shape[0] - 2, length)


@verb
def take(method, model, kind, length, planets, room, table, tabled):
    """Take a stage of the planets; tabled : whether to write the first table for particles, and that of the flow."""
    if is_heliocentric(method):
        return lambda method, model, kind, length, planets, room, table, tabled: _take_in_heliocentric(
            model, kind, length, planets, room
        )
    return lambda method, model, kind, length, planets, room, table, tabled: _take_in_jacobi(
        model, kind, length, method.coefficients[0, SHIFT], planets, room, table, tabled
    )


@verb
def go_back(method, planets, room):
    """Take the only stage of the entry backwards, a Kepler motion, fast: from what is marched to the end of a step."""

    def in_jacobi(method, planets, room):
        advance_planets(planets, room, -method.coefficients[HEADER, LENGTH], 0.0)
        finish_velocities(planets, room, 0.0)

    def in_heliocentric(method, planets, room):
        drift_heliocentric(planets, room, -method.coefficients[HEADER, LENGTH])

    return in_heliocentric if is_heliocentric(method) else in_jacobi


@kernel
def at_the_end(method, planets, room, copy):
    """Write the planets at the end of a step into `copy`."""
    copy_rows(planets, copy)
    go_back(method, copy, room)


@kernel
def _take_entry(method, model, leaving, planets, room, table):
    """Take the stages of the entry, or back."""
    entry, _ = programs_of(method.coefficients)
    for i in range(entry.shape[0]):
        kind, length = stage_of(entry, i, leaving)
        take(method, model, kind, length, planets, room, table, False)


@kernel
def enter_map(method, model, state, planets, room, table):
    """Change from a state of bodies to what is marched."""
    enter_coordinates(method, strength_of(model), state.q, state.q_lo, state.p, state.p_lo, planets, room)
    change_variables(model, planets, room, table, NO_TABLE, -1.0)
    _take_entry(method, model, False, planets, room, table)


@kernel
def leave_map(method, model, state, planets, room, table):
    """Change back; what is marched is lost."""
    prepare(method, strength_of(model), planets, room)
    _take_entry(method, model, True, planets, room, table)
    change_variables(model, planets, room, table, NO_TABLE, 1.0)
    leave_coordinates(method, strength_of(model), planets, room, state.q, state.q_lo, state.p, state.p_lo)


# ------------------------------------------------------------------------------------------ steps of kicks and motions


@verb
def step_in_stages(method, model, planets, room):
    """Take a step of kicks and Kepler motions in turn."""
    return _step_in_heliocentric if is_heliocentric(method) else _step_in_jacobi


def _step_in_jacobi(method, model, planets, room):
    _, stages = programs_of(method.coefficients)
    step_in_pairs(registers_of(method), planets, room, model.parameters.shape[0] - 2, stages)


def _step_in_heliocentric(method, model, planets, room):
    _, stages = programs_of(method.coefficients)
    for i in range(0, stages.shape[0], 2):
        count, kick, drift = model.parameters.shape[0] - 2, stages[i, LENGTH], stages[i + 1, LENGTH]
        kick_and_drift_heliocentric(planets, room, count, kick, drift)


@verb
def kick_and_drift(method, model, kick, drift, planets, room, table, first):
    """Take a kick and Kepler motions, with a table for particles from row `first` on."""
    return _pair_in_heliocentric if is_heliocentric(method) else _pair_in_jacobi


def _pair_in_jacobi(method, model, kick, drift, planets, room, table, first):
    evaluate_kick(registers_of(method), model, STANDARD, 0.0, planets, room, table, first)
    advance_planets(planets, room, drift, kick)
    finish_velocities(planets, room, 0.0)


def _pair_in_heliocentric(method, model, kick, drift, planets, room, table, first):
    count = model.parameters.shape[0] - 2
    tabulate_heliocentric(planets, room, table, first, count)
    jump = kick_and_drift_heliocentric(planets, room, count, kick, drift)
    for k in range(3):
        table[first + count + 1, k] = jump[k]


@verb
def jump_of(method, table, places, kick, marched):
    """Return the jump of particles in a kick, in democratic heliocentric coordinates, else None; places : the first of
    the rows of places in the table.
    """
    if not is_heliocentric(method):
        return lambda method, table, places, kick, marched: None
    return lambda method, table, places, kick, marched: times(
        select(marched.gm > 0.0, full(kick), 0.0), load_three(flat(table), WIDTH * (places + 1))
    )


@verb
def tabulate_origins(method, strength, planets, room, table):
    """Write that to which particles are relative into the first table; planets : at the end of a step."""
    if is_heliocentric(method):
        return lambda method, strength, planets, room, table: tabulate_origin(
            planets, room, table, 0, strength.shape[0] - 2
        )
    return lambda method, strength, planets, room, table: tabulate_centres(strength, planets, room, table, 0)


# ----------------------------------------------------------------------------------------------------- with particles


@kernel
def _take_among(method, model, kind, length, planets, room, table, particles):
    """Take a stage of the planets, and of particles among them; the first table is overwritten.

    particles : their memory, the status of each, workspace, and the share of them
    """
    memory, retired, rows, share = particles
    take(method, model, kind, length, planets, room, table, True)
    for p in range(share.start, share.stop, WIDTH):
        marched = take_particles(memory, p, present(memory, retired, p), rows)
        if kind == DRIFT:
            marched = moved_particles(marched, length)
        elif kind == FLOW:
            flows = flow_rows(strength_of(model).shape[0] - 2)
            marched = flowing_particles(model, table, flows, marched, rows, length)
        else:
            g = interaction(model, table, 0, 0.0, False, marched, rows)
            zero = full(0.0)
            marched = kicked_particles(marched, (zero, zero, zero), length, g)
        store_marched(memory, p, marched, rows)


@kernel
def _take_entry_among(method, model, leaving, planets, room, table, particles):
    """Take the stages of the entry, or back, of the planets, and of particles among them. About a body that is alone a
    corrector leads back to where it began, but not a single motion, without a kick.
    """
    entry, _ = programs_of(method.coefficients)
    alone = strength_of(model).shape[0] == 2 and not has_terms(model)
    for i in range(entry.shape[0] if entry.shape[0] == 1 or not alone else 0):
        kind, length = stage_of(entry, i, leaving)
        _take_among(method, model, kind, length, planets, room, table, particles)


@kernel
def enter_among(method, model, state, planets, room, table, particles, rows, share):
    """Write what is marched of particles share.start ... share.stop - 1 from the states that are seen.

    state : of the bodies; their planets become what is marched
    particles : their `Columns`, their memory, and their rows of a status, (padded, 2) int64: those with another one
        than 0 are left alone
    """
    (q, q_lo, v, v_lo), memory, retired = particles
    strength = strength_of(model)
    enter_coordinates(method, strength, state.q, state.q_lo, state.p, state.p_lo, planets, room)
    flows = flow_rows(strength.shape[0] - 2)
    for p in range(share.start, share.stop):
        if retired[p, 0] != 0 or memory[p, 0, NUMBER] == ELSEWHERE:
            continue
        own = memory[p]
        if own[0, NUMBER] == 0.0:
            own[0, NUMBER] = 1.0 + _place_among(method, strength, planets, room, q, v, p)
        i = int(own[0, NUMBER]) - 1
        for component in range(6):
            x, x_lo = (q, q_lo) if component < 3 else (v, v_lo)
            hi, lo = origin(method, strength, planets, room, i, component)
            axis = component % 3
            own[0, component], own[1, component] = difference_of_pairs(x[axis, p], x_lo[axis, p], hi, lo)
        own[0, ATTRACTED] = constant(room, ATTRACTING, i - 1) if i > 0 else strength[1 + dominant(planets)]
    change_variables(model, planets, room, table, flows, -1.0)
    change_momenta(model, table, (memory, retired, rows, share), -1.0)
    _take_entry_among(method, model, False, planets, room, table, (memory, retired, rows, share))


@kernel
def leave_among(method, model, planets, room, table, particles, rows, share):
    """Write the states that are seen of particles share.start ... share.stop - 1, in doubled precision.

    planets : as they are marched; they and the memory are lost. The rest is as for `enter_among`
    """
    (q, q_lo, v, v_lo), memory, retired = particles
    strength = strength_of(model)
    prepare(method, strength, planets, room)
    _take_entry_among(method, model, True, planets, room, table, (memory, retired, rows, share))
    change_variables(model, planets, room, table, flow_rows(strength.shape[0] - 2), 1.0)
    change_momenta(model, table, (memory, retired, rows, share), 1.0)
    for p in range(share.start, share.stop):
        if retired[p, 0] != 0 or memory[p, 0, NUMBER] == ELSEWHERE:
            continue
        own = memory[p]
        for component in range(6):
            x, x_lo = (q, q_lo) if component < 3 else (v, v_lo)
            hi, lo = origin(method, strength, planets, room, int(own[0, NUMBER]) - 1, component)
            hi, lo = sum_of_pairs(hi, lo, own[0, component], own[1, component])
            x[component % 3, p], x_lo[component % 3, p] = hi, lo


@verb
def _place_among(method, strength, planets, room, q, v, p):
    """Return the place of a particle: how many planets, from the innermost outwards, have semi-major axes below its
    pericentre distance about the dominant body; in democratic heliocentric coordinates 0.
    """
    if is_heliocentric(method):
        return lambda method, strength, planets, room, q, v, p: 0
    return lambda method, strength, planets, room, q, v, p: _planets_inside(strength, planets, room, q, v, p)


@kernel
def _planets_inside(strength, planets, room, q, v, p):
    x, y, z, vx, vy, vz = (
        q[0, p] - centre_of(strength, planets, room, 0, 0)[0],
        q[1, p] - centre_of(strength, planets, room, 0, 1)[0],
        q[2, p] - centre_of(strength, planets, room, 0, 2)[0],
        v[0, p] - centre_of(strength, planets, room, 0, 3)[0],
        v[1, p] - centre_of(strength, planets, room, 0, 4)[0],
        v[2, p] - centre_of(strength, planets, room, 0, 5)[0],
    )
    pericentre = apsides(strength[1 + dominant(planets)], x, y, z, vx, vy, vz).least
    for i in range(strength.shape[0] - 2):
        r2, v2 = 0.0, 0.0
        for k in range(3):
            r2 += coordinate(planets, k, i) ** 2
            v2 += coordinate(planets, 3 + k, i) ** 2
        # 1/a of a planet
        if not (2.0 / r2**0.5 - v2 / constant(room, ATTRACTING, i)) * pericentre > 1.0:
            return i
    return strength.shape[0] - 2
