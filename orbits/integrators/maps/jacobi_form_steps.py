"""The steps of Wisdom–Holman maps in Jacobi coordinates: of the planets, with their corrector, and what they show."""

from __future__ import annotations

from orbits.integrators.maps.on_kepler_orbits import stretch_rows
from orbits.kernels.compile import kernel
from orbits.kernels.maps.interaction import (
    ROWS,
    displace,
    interact,
    interact_in,
    kind_of,
    modify_in,
    registers_of,
    stay_in_registers,
)
from orbits.kernels.maps.jacobi import (
    advance_planets,
    enter_planets,
    finish_velocities,
    kick_planets,
    leave_planets,
    move_planets,
    prepare_room,
    show_planets,
    step_lazy,
    step_modified,
    step_plain,
    step_with_terms_in_a_register,
)
from orbits.kernels.maps.nearest import begin_nearest
from orbits.kernels.maps.terms_of_dominant import flow, kick_more, strength_of, to_momenta, to_velocities
from orbits.kernels.steps import OK

HALF, WHOLE, SHIFT, LAZY, ANGLE = 0, 1, 2, 3, 4
"""Columns of the first row of the coefficients: half a kick, the Kepler motion, h^2/12 for the modified and the lazy
kick, 1 for the latter, and the largest turn in a step at a pericentre. The other rows are the corrector: a Kepler
motion and a kick each."""

NO_TABLE = -1
"""The row of a table of the flow of terms that nobody reads."""


@kernel
def _kick_of_a_step(registers, model, coefficients, planets, room):
    """Write the interaction for the kick: plain, modified, or at displaced positions; with the kicks of terms."""
    count = strength_of(model).shape[0] - 2
    interact_in(registers, planets, room, count, False)
    if coefficients[0, LAZY] != 0.0:
        kick_more(model, planets, room)
        displace(planets, room, coefficients[0, SHIFT])
        interact_in(registers, planets, room, count, True)
    elif coefficients[0, SHIFT] != 0.0:
        modify_in(registers, planets, room, count, coefficients[0, SHIFT])
    kick_more(model, planets, room)


@kernel
def _correct(model, coefficients, planets, room, sign):
    """Apply the corrector, or its inverse for sign = -1."""
    stages, count = coefficients.shape[0] - 1, strength_of(model).shape[0] - 2
    for i in range(stages):
        row = 1 + i if sign > 0.0 else stages - i
        move_planets(planets, room, sign * coefficients[row, 0], 0.0)
        finish_velocities(planets, room, 0.0)
        # Backwards, the kick before a Kepler motion follows it.
        other = row if sign > 0.0 else row - 1
        length = coefficients[other, 1] if other > 0 else 0.0
        if length != 0.0:
            if sign > 0.0:
                flow(model, planets, room, length)
            interact(planets, room, count, False)
            kick_more(model, planets, room)
            kick_planets(planets, room, sign * length)
            if sign < 0.0:
                flow(model, planets, room, -length)


@kernel
def enter(method, model, h, state, storage):
    """Change to corrected Jacobi coordinates."""
    planets, room = storage.carry, storage.scratch
    enter_planets(strength_of(model), state.q, state.q_lo, state.p, state.p_lo, planets, room)
    to_momenta(model, planets, room, storage.stages, NO_TABLE)
    _correct(model, method.coefficients, planets, room, 1.0)


@kernel
def leave(method, model, h, state, storage):
    """Change back; the marched state is lost."""
    strength, planets, room = strength_of(model), storage.carry, storage.scratch
    prepare_room(strength, planets, room)
    _correct(model, method.coefficients, planets, room, -1.0)
    to_velocities(model, planets, room, storage.stages, NO_TABLE)
    leave_planets(strength, planets, room, state.q, state.q_lo, state.p, state.p_lo)


@kernel
def show(method, model, state, storage):
    """Write the state of the bodies, uncorrected."""
    show_planets(strength_of(model), storage.carry, storage.scratch, state.q, state.p)


@kernel
def begin(method, model, t, h, state, storage):
    """Compute the interaction of the first half of a kick, which later steps take over."""
    prepare_room(strength_of(model), storage.carry, storage.scratch)
    registers = registers_of(method)
    if stay_in_registers(registers, storage.scratch):
        begin_nearest(kind_of(registers), storage.carry, storage.scratch, h, method.coefficients[0, ANGLE])
    _kick_of_a_step(registers, model, method.coefficients, storage.carry, storage.scratch)


@kernel(inline=True)
def step(method, model, t, h, state, storage):
    """Take one step: half a kick, Kepler motions, half a kick."""
    coefficients, planets, room = method.coefficients, storage.carry, storage.scratch
    registers = registers_of(method)
    if stay_in_registers(registers, room):
        if coefficients[0, LAZY] != 0.0:
            step_lazy(registers, planets, room, coefficients[0, WHOLE], coefficients[0, SHIFT])
        elif coefficients[0, SHIFT] != 0.0:
            step_modified(registers, planets, room, coefficients[0, WHOLE], coefficients[0, SHIFT])
        else:
            step_plain(registers, planets, room, coefficients[0, WHOLE])
    else:
        half = coefficients[0, HALF]
        advance_planets(planets, room, coefficients[0, WHOLE], half)
        _kick_of_a_step(registers, model, coefficients, planets, room)
        finish_velocities(planets, room, half)
    return OK, 0, 1


@kernel
def step_with_terms(method, model, t, h, state, storage):
    """As `step`, with half the flow of terms that depend on velocities before and after the Kepler motions."""
    coefficients, planets, room = method.coefficients, storage.carry, storage.scratch
    half, whole = coefficients[0, HALF], coefficients[0, WHOLE]
    if room.shape[0] < 2 * ROWS:
        lazy = coefficients[0, LAZY] != 0.0
        step_with_terms_in_a_register(model, planets, room, whole, coefficients[0, SHIFT], lazy)
        return OK, 0, 1
    kick_planets(planets, room, half)
    flow(model, planets, room, half)
    advance_planets(planets, room, whole, 0.0)
    finish_velocities(planets, room, 0.0)
    flow(model, planets, room, half)
    _kick_of_a_step(registers_of(method), model, coefficients, planets, room)
    kick_planets(planets, room, half)
    return OK, 0, 1


@kernel
def stretch(method, unit, factor):
    """Write the coefficients of a step `factor` times as long."""
    own, one = method.coefficients, unit.coefficients
    stretch_rows(own, one, factor)
    own[0, SHIFT], own[0, LAZY], own[0, ANGLE] = factor * (factor * one[0, SHIFT]), one[0, LAZY], one[0, ANGLE]
