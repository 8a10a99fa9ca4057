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
from orbits.kernels.lanes import WIDTH
from orbits.kernels.maps.entering import (
    begin,
    begin_particles,
    enter,
    enter_particles,
    keep_particles,
    leave,
    leave_particles,
    show,
)
from orbits.kernels.maps.jacobi_particles import MEMORY_ROWS
from orbits.kernels.maps.jacobi_tables import table_rows
from orbits.kernels.maps.layout import ROWS, STATE_ROWS
from orbits.kernels.maps.programs import ENTRY, HEADER, KICK, STANDARD, WHOLE, stretch

Program = list[tuple[int, float]]
"""Stages, (kind, length) each; see `orbits.kernels.maps.programs`."""


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
