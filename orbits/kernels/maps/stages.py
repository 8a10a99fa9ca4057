"""The stages of Wisdom–Holman maps, one by one, in the coordinates of a method, and the change to these; see
`orbits.kernels.maps.programs`.

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
    enter_planets,
    leave_planets,
    number_planets,
    prepare_room,
    show_planets,
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
    STATE_ROWS,
    coordinate,
    copy_rows,
    registers_in,
    registers_of,
    rest_elsewhere,
)
from orbits.kernels.maps.programs import DRIFT, FLOW, HEADER, LENGTH, SHIFT, programs_of
from orbits.kernels.maps.terms_by_kind import strength_of
from orbits.kernels.maps.terms_of_dominant import flow
from orbits.kernels.maps.threes import load_three, times
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


@verb
def step_in_stages(method, model, planets, room, table, rows):
    """Take a step of kicks and Kepler motions in turn.

    table, rows : where particles find what they need of the kicks, and the rows for each, or 0 if there are none
    """
    return _step_in_heliocentric if is_heliocentric(method) else _step_in_jacobi


def _step_in_jacobi(method, model, planets, room, table, rows):
    _, stages = programs_of(method.coefficients)
    step_in_pairs(registers_of(method), model.parameters, planets, room, stages, table, rows)


def _step_in_heliocentric(method, model, planets, room, table, rows):
    _, stages = programs_of(method.coefficients)
    for i in range(stages.shape[0] // 2):
        count, kick, drift = model.parameters.shape[0] - 2, stages[2 * i, LENGTH], stages[2 * i + 1, LENGTH]
        if rows > 0:
            tabulate_heliocentric(planets, room, table, i * rows, count)
        jump = kick_and_drift_heliocentric(planets, room, count, kick, drift)
        for k in range(3 if rows > 0 else 0):
            table[i * rows + count + 1, k] = jump[k]


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
