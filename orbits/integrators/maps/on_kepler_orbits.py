"""What the forms of all Wisdom–Holman maps share: planets and massless particles are marched in the carry, by the
stages of `orbits.kernels.maps.stages`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from orbits.integrators.forms import Array, Form, padded
from orbits.integrators.maps.dominant import registers_for, require_dominant
from orbits.kernels.compile import kernel
from orbits.kernels.lanes import WIDTH
from orbits.kernels.maps.jacobi_particles import MEMORY_ROWS, store_marched, take_particles
from orbits.kernels.maps.jacobi_tables import table_rows
from orbits.kernels.maps.layout import ROWS, STATE_ROWS, rooms
from orbits.kernels.maps.programs import ENTRY, HEADER, KICK, STANDARD, WHOLE, stretch
from orbits.kernels.maps.stages import (
    at_the_end,
    enter_among,
    enter_map,
    leave_among,
    leave_map,
    prepare,
    show_coordinates,
)
from orbits.kernels.maps.terms_by_kind import strength_of
from orbits.kernels.steps import NOWHERE

Program = list[tuple[int, float]]
"""Stages, (kind, length) each; see `orbits.kernels.maps.programs`."""


@kernel
def enter(method, model, h, state, storage):
    """Change to what is marched: other coordinates, and the program that leads there, such as a corrector."""
    room, _ = rooms(storage.carry, storage.scratch)
    enter_map(method, model, state, storage.carry, room, storage.stages)


@kernel
def leave(method, model, h, state, storage):
    """Change back; the marched state is lost."""
    room, _ = rooms(storage.carry, storage.scratch)
    leave_map(method, model, state, storage.carry, room, storage.stages)


@kernel
def show(method, model, state, storage):
    """Write the state of the bodies, of methods that march within the first Kepler motion of a step."""
    room, copy = rooms(storage.carry, storage.scratch)
    at_the_end(method, storage.carry, room, copy)
    show_coordinates(method, strength_of(model), copy, room, state.q, state.p)


@kernel
def begin(method, model, t, h, state, storage):
    """Write the constants of the planets."""
    room, _ = rooms(storage.carry, storage.scratch)
    prepare(method, strength_of(model), storage.carry, room)


@kernel
def enter_particles(method, model, state, particles, rows, storage):
    """Change to what is marched."""
    room, _ = rooms(storage.carry, storage.scratch)
    enter_among(method, model, state, storage.carry, room, storage.stages, particles, rows, storage.share)


@kernel
def leave_particles(method, model, state, particles, rows, storage):
    """Change back; what is marched is lost."""
    room, _ = rooms(storage.carry, storage.scratch)
    leave_among(method, model, storage.carry, room, storage.stages, particles, rows, storage.share)


@kernel(inline=True)
def begin_particles(method, model, particles, storage):
    """Return eight particles as they are marched, from their rows of the carry."""
    # Those that are retired are at one place, as the padding is.
    there = 1.0 - (particles.x == NOWHERE) * (particles.y == NOWHERE) * (particles.z == NOWHERE)
    return take_particles(storage.carry, storage.share.start, there, storage.scratch)


@kernel(inline=True)
def keep_particles(method, carry, storage):
    """Write eight particles as they are marched into their rows of the carry."""
    store_marched(storage.carry, storage.share.start, carry, storage.scratch)


def in_order(carry: Array, n: int) -> NDArray[np.int64]:
    """Return the numbers of n bodies in the order of a map whose carry this is, (n,): the dominant one, then the
    planets outwards.
    """
    first = STATE_ROWS * registers_for(3 * n)
    return np.append(carry[first, 6], carry[first + 2 :].ravel()[: n - 1]).astype(np.int64)


@dataclass(frozen=True)
class OnKeplerOrbits(Form):
    """Base of the forms of Wisdom–Holman maps. By default planets are marched within the first Kepler motion of a step.

    among_particles : whether the planets leave tables for massless particles
    in_two_registers : whether the planets, nine to sixteen, stay in two registers
    kernels_among : what is then added to `kernels`, besides what all maps have
    """

    among_particles: bool = field(default=False, kw_only=True)
    in_two_registers: bool = field(default=False, kw_only=True)

    kernels: ClassVar[Mapping[str, Any]]
    kernels_among: ClassVar[Mapping[str, Any]]

    def own_kernels(self) -> Mapping[str, Any]:
        """Return the kernels of this instance, and the number of registers if it is compiled for it."""
        own = {"enter": enter, "leave": leave, "show": show, "begin": begin, "stretch": stretch, **self.kernels}
        if self.among_particles:
            common = {
                "begin_particles": begin_particles,
                "keep_particles": keep_particles,
                "enter_particles": enter_particles,
                "leave_particles": leave_particles,
            }
            own = {**own, **common, **self.kernels_among}
        return {**own, "registers": 2} if self.in_two_registers else own

    def for_particles(self) -> Self:
        """Return the form whose planets leave tables for massless particles."""
        return replace(self, among_particles=True)

    def entry(self, h: float) -> Program:
        """Return what leads from the states that are seen to those that are marched, with steps of h."""
        raise NotImplementedError(f"{type(self).__name__} must define what leads to the states that are marched")

    def program(self, h: float) -> Program:
        """Return a step of h."""
        raise NotImplementedError(f"{type(self).__name__} must define its stages")

    def stages_of(self, h: float) -> tuple[Array, Array]:
        """Return `entry` and `program` as arrays, (s, 2) each, for tangent vectors."""
        entry, program = (np.array(rows, dtype=np.float64).reshape(-1, 2) for rows in (self.entry(h), self.program(h)))
        return entry, program

    def coefficients(self, h: float, before: float) -> Array:
        """Return the header and both programs, (1 + stages, 8), see `orbits.kernels.maps.programs`."""
        entry, program = self.stages_of(h)
        rows = np.zeros((HEADER + len(entry) + len(program), WIDTH))
        rows[0, [WHOLE, KICK, ENTRY]] = h, STANDARD, len(entry)
        rows[HEADER:, :2] = np.concatenate([entry, program])
        return rows

    def stages_shape(self, size: int) -> tuple[int, int]:
        """The tables for particles, and workspace. None are kept without particles."""
        if not self.among_particles:
            return 1, padded(size)
        return self.tables(size // 3 - 1) + 3 * registers_for(size), WIDTH

    def tables(self, planets: int) -> int:
        """Return the number of rows of the tables of a step for particles: by default one for each kick."""
        return table_rows(planets) * sum(kind == STANDARD for kind, _ in self.program(1.0))

    def room_shape(self, size: int) -> tuple[int, int]:
        """Return the shape of the part of the scratch that has the constants of the planets."""
        return ROWS * registers_for(size) + WIDTH, WIDTH

    def scratch_shape(self, size: int) -> tuple[int, int]:
        """The constants, and a copy of the planets."""
        return self.room_shape(size)[0] + self.carry_rows(size), WIDTH

    def carry_rows(self, size: int) -> int:
        """The planets, eight in a register, with low parts; their centre of mass; their order."""
        return (STATE_ROWS + 1) * registers_for(size) + 2

    @property
    def particle_carry_rows(self) -> int:
        """Massless particles as they are marched."""
        return MEMORY_ROWS if self.among_particles else 0

    def forget(self, carry: Array) -> None:
        """Nothing in the carry depends on the length of the steps."""

    def check_start(self, parameters: Any, q: Array, v: Array) -> None:
        """Raise InputError for softened gravity, and if no body dominates the others."""
        require_dominant(parameters)


class InJacobiCoordinates(OnKeplerOrbits):
    """Base of the forms in Jacobi coordinates."""

    def for_bodies(self, count: int) -> Self:
        """Return the form whose planets stay in two registers, if there are nine to sixteen."""
        return replace(self, in_two_registers=registers_for(3 * count) == 2)
