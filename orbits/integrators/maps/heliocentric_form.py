"""Wisdom–Holman maps in democratic heliocentric coordinates: the form of `WisdomHolman` for these.

A step is half of the Kepler motions, a kick with the motion of all planets by that of the dominant body, and the other
half; see `orbits.kernels.maps.heliocentric`. There is no corrector: those of `WisdomHolman` are made for Jacobi
coordinates.

Source: Duncan, Levison & Lee (1998), AJ 116, 2067.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from orbits.integrators.forms import Array, padded
from orbits.integrators.maps.dominant import registers_for
from orbits.integrators.maps.on_kepler_orbits import OnKeplerOrbits, begin_particles, keep_particles, rows_of
from orbits.kernels.compile import kernel
from orbits.kernels.lanes import WIDTH, full, load, store
from orbits.kernels.maps.heliocentric import (
    ROWS,
    drift_heliocentric,
    enter_heliocentric,
    leave_heliocentric,
    prepare_heliocentric,
    show_heliocentric,
    step_heliocentric,
)
from orbits.kernels.maps.heliocentric_particles import (
    PLANETS,
    enter_among_heliocentric,
    leave_among_heliocentric,
    seen_among_heliocentric,
    stepped_particles,
    tabulate_planets,
    tabulate_the_rest,
)
from orbits.kernels.maps.jacobi_stages import particles_at_the_end, registers_in
from orbits.kernels.maps.stages import HELIOCENTRIC_DRIFT, HELIOCENTRIC_KICK
from orbits.kernels.steps import OK, Particles

STEP, HALF = 0, 1
"""Columns of the coefficients: the length of a step, and half of it, from what is seen to what is marched."""


@kernel(inline=True)
def _rooms(planets, scratch):
    """Return the parts of the scratch: the room of the planets, and that for a copy of them."""
    rows = ROWS * registers_in(planets)
    return scratch[:rows], scratch[rows:]


@kernel(inline=True)
def _at_the_end(method, planets, room, copy):
    """Write the planets at the end of a step into `copy`."""
    for row in range(planets.shape[0]):
        store(copy, row, load(planets, row))
    drift_heliocentric(copy, room, -method.coefficients[0, HALF])


@kernel
def enter(method, model, h, state, storage):
    """Change to democratic heliocentric coordinates in the middle of the Kepler motions."""
    room, _ = _rooms(storage.carry, storage.scratch)
    enter_heliocentric(model.parameters, state.q, state.q_lo, state.p, state.p_lo, storage.carry, room)
    drift_heliocentric(storage.carry, room, method.coefficients[0, HALF])


@kernel
def leave(method, model, h, state, storage):
    """Change back; the marched state is lost."""
    strength, planets = model.parameters, storage.carry
    room, _ = _rooms(planets, storage.scratch)
    prepare_heliocentric(strength, planets, room)
    drift_heliocentric(planets, room, -method.coefficients[0, HALF])
    leave_heliocentric(strength, planets, room, state.q, state.q_lo, state.p, state.p_lo)


@kernel
def show(method, model, state, storage):
    """Write the state of the bodies."""
    room, copy = _rooms(storage.carry, storage.scratch)
    _at_the_end(method, storage.carry, room, copy)
    show_heliocentric(model.parameters, copy, room, state.q, state.p)


@kernel
def begin(method, model, t, h, state, storage):
    """Write the constants of the planets."""
    room, _ = _rooms(storage.carry, storage.scratch)
    prepare_heliocentric(model.parameters, storage.carry, room)


@kernel
def step(method, model, t, h, state, storage):
    """Take one step."""
    room, _ = _rooms(storage.carry, storage.scratch)
    step_heliocentric(storage.carry, room, model.parameters.shape[0] - 2, method.coefficients[0, STEP])
    return OK, 0, 1


@kernel
def step_among_particles(method, model, t, h, state, storage):
    """As `step`, with the table: of the planets to the same bits."""
    room, copy = _rooms(storage.carry, storage.scratch)
    count = model.parameters.shape[0] - 2
    tabulate_planets(storage.carry, room, storage.stages, count)
    jump = step_heliocentric(storage.carry, room, count, method.coefficients[0, STEP])
    _at_the_end(method, storage.carry, room, copy)
    tabulate_the_rest(copy, room, storage.stages, count, jump)
    return OK, 0, 1


@kernel(inline=True)
def step_particles(method, model, t, h, particles, carry, storage):
    """Take one step of eight particles. They are returned as observers see them."""
    count = model.parameters.shape[0] - 2
    marched = stepped_particles(carry, storage.stages, count, method.coefficients[0, STEP])
    ended = particles_at_the_end(marched, -method.coefficients[0, HALF])
    x, y, z, vx, vy, vz = seen_among_heliocentric(storage.stages, ended)
    zero = full(0.0)
    return Particles(x, y, z, zero, zero, zero, vx, vy, vz, zero, zero, zero), marched, OK, 1


@kernel
def enter_particles(method, model, state, particles, rows, storage):
    """Change to democratic heliocentric coordinates in the middle of the Kepler motions."""
    strength, half = model.parameters, method.coefficients[0, HALF]
    room, _ = _rooms(storage.carry, storage.scratch)
    enter_heliocentric(strength, state.q, state.q_lo, state.p, state.p_lo, storage.carry, room)
    enter_among_heliocentric(strength, storage.carry, room, particles, rows, storage.share, half)


@kernel
def leave_particles(method, model, state, particles, rows, storage):
    """Change back; what is marched is lost."""
    strength, half = model.parameters, method.coefficients[0, HALF]
    room, _ = _rooms(storage.carry, storage.scratch)
    prepare_heliocentric(strength, storage.carry, room)
    drift_heliocentric(storage.carry, room, -half)
    leave_among_heliocentric(strength, storage.carry, room, particles, rows, storage.share, half)


@kernel
def stretch(method, unit, factor):
    """Write the coefficients of a step `factor` times as long."""
    method.coefficients[0, STEP] = factor * unit.coefficients[0, STEP]
    method.coefficients[0, HALF] = factor * unit.coefficients[0, HALF]


@dataclass(frozen=True)
class DemocraticHeliocentric(OnKeplerOrbits):
    """The steps of a Wisdom–Holman map in democratic heliocentric coordinates, which are marched in the carry."""

    kernels: ClassVar[Mapping[str, Any]] = {
        "enter": enter,
        "leave": leave,
        "show": show,
        "begin": begin,
        "step": step,
        "stretch": stretch,
    }
    more_kernels: ClassVar[Mapping[str, Any]] = {
        "step": step_among_particles,
        "begin_particles": begin_particles,
        "step_particles": step_particles,
        "keep_particles": keep_particles,
        "enter_particles": enter_particles,
        "leave_particles": leave_particles,
    }

    def coefficients(self, h: float, before: float) -> Array:
        """Return the length of a step, and half of it, in (1, 8)."""
        row = np.zeros((1, WIDTH))
        row[0, [STEP, HALF]] = h, 0.5 * h
        return row

    def stages_of(self, h: float) -> tuple[Array, Array]:
        """Half of the Kepler motions, and the kick and these motions."""
        return rows_of([(HELIOCENTRIC_DRIFT, h / 2)]), rows_of([(HELIOCENTRIC_KICK, h), (HELIOCENTRIC_DRIFT, h)])

    def room_shape(self, size: int) -> tuple[int, int]:
        """The rows of `orbits.kernels.maps.heliocentric`."""
        return ROWS * registers_for(size), WIDTH

    def stages_shape(self, size: int) -> tuple[int, int]:
        """The table of a step; see `orbits.kernels.maps.heliocentric_particles`. None is kept without particles."""
        return (PLANETS + size // 3 - 1, WIDTH) if self.among_particles else (1, padded(size))

    def scratch_shape(self, size: int) -> tuple[int, int]:
        """The rows of `orbits.kernels.maps.heliocentric`, and a copy of the planets."""
        return ROWS * registers_for(size) + self.carry_rows(size), WIDTH


__all__ = ["DemocraticHeliocentric"]
