"""Wisdom–Holman maps in democratic heliocentric coordinates: the form of `WisdomHolman` for these.

A step is half a kick and half of the motion of all planets by that of the dominant body, Kepler motions, and the other
halves; see `orbits.kernels.heliocentric`. There is no corrector: those of `WisdomHolman` are made for Jacobi coordinates.

Source: Duncan, Levison & Lee (1998), AJ 116, 2067.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from orbits.integrators.dominant import registers, require_dominant
from orbits.integrators.forms import Array, Form, padded
from orbits.kernels.compile import kernel
from orbits.kernels.heliocentric import (
    ROWS,
    attract,
    enter_heliocentric,
    leave_heliocentric,
    prepare_heliocentric,
    show_heliocentric,
    step_heliocentric,
)
from orbits.kernels.heliocentric_particles import (
    PLANETS,
    attracted_particles,
    enter_among_heliocentric,
    leave_among_heliocentric,
    seen_among_heliocentric,
    stepped_particles,
    tabulate_heliocentric,
)
from orbits.kernels.interaction import STATE_ROWS
from orbits.kernels.jacobi_particles import AWAY, MEMORY_ROWS, store_marched, take_particles
from orbits.kernels.lanes import WIDTH, full
from orbits.kernels.steps import OK, Particles


@kernel
def enter(method, model, h, state, storage):
    """Change to democratic heliocentric coordinates."""
    enter_heliocentric(
        model.parameters, state.q, state.q_lo, state.p, state.p_lo, storage.carry, storage.scratch
    )


@kernel
def leave(method, model, h, state, storage):
    """Change back."""
    strength, planets, room = model.parameters, storage.carry, storage.scratch
    prepare_heliocentric(strength, planets, room)
    leave_heliocentric(strength, planets, room, state.q, state.q_lo, state.p, state.p_lo)


@kernel
def show(method, model, state, storage):
    """Write the state of the bodies."""
    show_heliocentric(model.parameters, storage.carry, storage.scratch, state.q, state.p)


@kernel
def begin(method, model, t, h, state, storage):
    """Compute the attraction of the first half of a kick, which later steps take over."""
    prepare_heliocentric(model.parameters, storage.carry, storage.scratch)
    attract(storage.carry, storage.scratch, model.parameters.shape[0] - 2)


@kernel
def step(method, model, t, h, state, storage):
    """Take one step."""
    count = model.parameters.shape[0] - 2
    step_heliocentric(storage.carry, storage.scratch, count, method.coefficients[0, 0])
    return OK, 0, 1


@kernel
def begin_among_particles(method, model, t, h, state, storage):
    """As `begin`, with the table before the first step of a block."""
    strength, planets, room = model.parameters, storage.carry, storage.scratch
    prepare_heliocentric(strength, planets, room)
    attract(planets, room, strength.shape[0] - 2)
    tabulate_heliocentric(strength, planets, room, storage.stages, 0, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0))


@kernel
def step_among_particles(method, model, t, h, state, storage):
    """As `step`, with the table after it."""
    strength, planets, room = model.parameters, storage.carry, storage.scratch
    count = strength.shape[0] - 2
    jumps = step_heliocentric(planets, room, count, method.coefficients[0, 0])
    tabulate_heliocentric(strength, planets, room, storage.stages, PLANETS + count, jumps)
    return OK, 0, 1


@kernel(inline=True)
def begin_particles(method, model, particles, storage):
    """Return eight particles as they are marched, from their rows of the carry, with g."""
    # Those that are retired are at one place, as the padding is.
    there = 1.0 - (particles.x == AWAY) * (particles.y == AWAY) * (particles.z == AWAY)
    marched = take_particles(storage.carry, storage.share.start, there, storage.scratch)
    return attracted_particles(storage.stages, 0, model.parameters.shape[0] - 2, marched)


@kernel(inline=True)
def step_particles(method, model, t, h, particles, carry, storage):
    """Take one step of eight particles. They are returned as observers see them."""
    count = model.parameters.shape[0] - 2
    marched = stepped_particles(carry, storage.stages, PLANETS + count, count, method.coefficients[0, 0])
    x, y, z, vx, vy, vz = seen_among_heliocentric(storage.stages, PLANETS + count, marched)
    zero = full(0.0)
    return Particles(x, y, z, zero, zero, zero, vx, vy, vz, zero, zero, zero), marched, OK, 1


@kernel(inline=True)
def keep_particles(method, carry, storage):
    """Write eight particles as they are marched into their rows of the carry."""
    store_marched(storage.carry, storage.share.start, carry, storage.scratch)


@kernel
def enter_particles(method, model, state, particles, rows, storage):
    """Change to democratic heliocentric coordinates."""
    strength, planets, room = model.parameters, storage.carry, storage.scratch
    enter_heliocentric(strength, state.q, state.q_lo, state.p, state.p_lo, planets, room)
    enter_among_heliocentric(strength, planets, room, particles, storage.share)


@kernel
def leave_particles(method, model, state, particles, rows, storage):
    """Change back."""
    strength, planets, room = model.parameters, storage.carry, storage.scratch
    prepare_heliocentric(strength, planets, room)
    leave_among_heliocentric(strength, planets, room, particles, storage.share)


@kernel
def stretch(method, unit, factor):
    """Write the coefficients of a step `factor` times as long."""
    method.coefficients[0, 0] = factor * unit.coefficients[0, 0]


@dataclass(frozen=True)
class DemocraticHeliocentric(Form):
    """The steps of a Wisdom–Holman map in democratic heliocentric coordinates, which are marched in the carry.

    among_particles : whether the planets leave tables for massless particles
    """

    among_particles: bool = False

    kernels: ClassVar[Mapping[str, Any]] = {
        "enter": enter,
        "leave": leave,
        "show": show,
        "begin": begin,
        "step": step,
        "stretch": stretch,
    }
    more_kernels: ClassVar[Mapping[str, Any]] = {
        "begin": begin_among_particles,
        "step": step_among_particles,
        "begin_particles": begin_particles,
        "step_particles": step_particles,
        "keep_particles": keep_particles,
        "enter_particles": enter_particles,
        "leave_particles": leave_particles,
    }

    def own_kernels(self) -> Mapping[str, Any]:
        """Return the kernels of this instance."""
        return {**self.kernels, **self.more_kernels} if self.among_particles else self.kernels

    def for_particles(self) -> DemocraticHeliocentric:
        """Return the form whose planets leave tables for massless particles."""
        return replace(self, among_particles=True)

    def coefficients(self, h: float, before: float) -> Array:
        """Return the length of a step, in the first element of (1, 8)."""
        row = np.zeros((1, WIDTH))
        row[0, 0] = h
        return row

    def carry_rows(self, size: int) -> int:
        """The planets, eight in a register, with low parts; their centre of mass; their order."""
        return (STATE_ROWS + 1) * registers(size) + 2

    def stages_shape(self, size: int) -> tuple[int, int]:
        """The tables before and after a step; see `orbits.kernels.heliocentric_particles`. None are kept without
        particles.
        """
        return (2 * (PLANETS + size // 3 - 1), WIDTH) if self.among_particles else (1, padded(size))

    @property
    def particle_carry_rows(self) -> int:
        """Massless particles as they are marched."""
        return MEMORY_ROWS if self.among_particles else 0

    def scratch_shape(self, size: int) -> tuple[int, int]:
        """The rows of `orbits.kernels.heliocentric`."""
        return ROWS * registers(size), WIDTH

    def forget(self, carry: Array) -> None:
        """Nothing in the carry depends on the length of the steps."""

    def check_start(self, parameters: Any, q: Array, v: Array) -> None:
        """Raise InputError for softened gravity, and if no body dominates the others."""
        require_dominant(parameters)


__all__ = ["DemocraticHeliocentric"]
