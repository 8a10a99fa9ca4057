"""The form of a Wisdom–Holman map in Jacobi coordinates; see `orbits.integrators.wisdom_holman`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from orbits.errors import InputError
from orbits.integrators.base import Integrator
from orbits.integrators.forms import Array
from orbits.integrators.maps.dominant import registers_for, require_dominant
from orbits.integrators.maps.jacobi_form_particles import (
    begin_among_particles,
    begin_pair,
    begin_particles,
    keep_pair,
    step_among_particles,
    step_pair,
    step_particles,
)
from orbits.integrators.maps.on_kepler_orbits import InJacobiCoordinates, Program, in_order
from orbits.kernels.compile import cpu_features, kernel
from orbits.kernels.lanes import WIDTH
from orbits.kernels.maps.jacobi import number_planets, prepare_room, show_planets
from orbits.kernels.maps.jacobi_stages import NO_TABLE, evaluate_kick, take_step
from orbits.kernels.maps.jacobi_tables import table_rows
from orbits.kernels.maps.layout import kind_of, registers_of, stay_in_registers
from orbits.kernels.maps.nearest import begin_nearest
from orbits.kernels.maps.programs import ANGLE, DRIFT, FLOW, KICK, LAZY, MODIFIED, SHIFT, STANDARD
from orbits.kernels.maps.terms_by_kind import strength_of
from orbits.kernels.steps import OK
from orbits.tableaux.correctors import corrector_lengths

KICKS = {"standard": STANDARD, "modified-kick": MODIFIED, "lazy": LAZY}
"""The kicks by their names."""


@kernel
def show(method, model, state, storage):
    """Write the state of the bodies, uncorrected."""
    show_planets(strength_of(model), storage.carry, storage.scratch, state.q, state.p)


@kernel
def begin(method, model, t, h, state, storage):
    """Compute the interaction of the first half of a kick, which later steps take over."""
    registers, planets, room, own = registers_of(method), storage.carry, storage.scratch, method.coefficients
    prepare_room(strength_of(model), planets, room)
    if stay_in_registers(registers, room):
        begin_nearest(kind_of(registers), planets, room, h, own[0, ANGLE])
    evaluate_kick(registers, model, int(own[0, KICK]), own[0, SHIFT], planets, room, storage.stages, NO_TABLE)


@kernel(inline=True)
def step(method, model, t, h, state, storage):
    """Take one step."""
    table = storage.stages
    take_step(
        registers_of(method), model, method.coefficients, storage.carry, storage.scratch, table, NO_TABLE, NO_TABLE
    )
    return OK, 0, 1


@dataclass(frozen=True)
class KeplerSplitting(InJacobiCoordinates):
    """The steps of a Wisdom–Holman map in Jacobi coordinates, which are marched in the carry.

    kernel : the kick, corrector : its order, and corrector2 : whether there is a second one; see `WisdomHolman`
    with_terms : whether the Lagrangian has terms of the dominant body
    """

    kernel: str
    corrector: int
    corrector2: bool = False
    with_terms: bool = False

    kernels: ClassVar[Mapping[str, Any]] = {"show": show, "begin": begin, "step": step}
    kernels_among: ClassVar[Mapping[str, Any]] = {
        "begin": begin_among_particles,
        "step": step_among_particles,
        "begin_particles": begin_particles,
        "step_particles": step_particles,
    }
    of_pairs: ClassVar[Mapping[str, Any]] = {
        "begin_pair": begin_pair,
        "step_pair": step_pair,
        "keep_pair": keep_pair,
    }

    def own_kernels(self) -> Mapping[str, Any]:
        """Return the kernels of this instance. Particles with terms are not taken two times eight at once; nor are
        others whose kick has two parts, where a register of the processor has four numbers: eight at a time are then
        faster, by 0.87.
        """
        own = super().own_kernels()
        if not self.among_particles:
            return own
        if self.kernel != "standard" and "avx512f" not in cpu_features():
            return {**own, "group": WIDTH}
        return own if self.with_terms else {**own, **self.of_pairs}

    def entry(self, h: float) -> Program:
        """The corrector."""
        lengths = h * corrector_lengths(self.corrector, self.corrector2) if self.corrector else np.zeros((0, 2))
        entry: Program = []
        for drift, length in lengths.tolist():
            entry.append((DRIFT, drift))
            if length != 0.0:
                entry += [(FLOW, length), (STANDARD, length)] if self.with_terms else [(STANDARD, length)]
        return entry

    def program(self, h: float) -> Program:
        """Kick, Kepler motions, kick, with the flow of terms in between."""
        flow = [(FLOW, h / 2)] if self.with_terms else []
        kick = KICKS[self.kernel], h / 2
        return [kick, *flow, (DRIFT, h), *flow, kick]

    def coefficients(self, h: float, before: float) -> Array:
        """Return the header, with the kick, and both programs."""
        rows = super().coefficients(h, before)
        rows[0, [KICK, ANGLE]] = KICKS[self.kernel], 2.0 * math.pi / Integrator.least_steps
        rows[0, SHIFT] = 0.0 if self.kernel == "standard" else h * h / 12
        return rows

    def tables(self, planets: int) -> int:
        """Those before and after a step, and of the flow of terms; see `orbits.kernels.maps.jacobi_tables`."""
        return 2 * table_rows(planets) + (6 * (planets + 1) if self.with_terms else 0)

    def notes_nearest(self, size: int) -> bool:
        """Whether the steps note how close the planets come: those that stay in registers, without particles."""
        return registers_for(size) <= 2 and not self.among_particles

    def stages_read(self, size: int) -> int:
        """Return how many numbers of its stages a step writes or reads: not the table before it, but for the first."""
        rows, columns = self.stages_shape(size)
        return (rows - table_rows(size // 3 - 1)) * columns if self.among_particles else rows * columns

    def scratch_shape(self, size: int) -> tuple[int, int]:
        """The constants of the planets."""
        return self.room_shape(size)

    def check_start(self, parameters: Any, q: Array, v: Array) -> None:
        """Raise InputError for softened gravity, and if no body dominates the others."""
        newton, *own = parameters if isinstance(parameters, tuple) else (parameters,)
        require_dominant(newton)
        gm = newton[1:]
        others = [int(vector[0]) for vector in own if int(vector[0]) != int(gm.argmax())]
        if others:
            raise InputError(
                f"a Wisdom–Holman step takes terms of the dominant body alone, the {_ordinal(int(gm.argmax()))} of the "
                f"massive bodies; got one of the {_ordinal(others[0])}. Use a method such as Gauss(stages=8)."
            )


def outwards(gm: Array, q: Array, v: Array) -> list[int]:
    """Return the numbers of the bodies in the order of the method: the dominant one, then the planets outwards.

    gm : (n,); q, v : (n, 3)
    """
    form = KeplerSplitting("standard", 0)
    planets = np.zeros((form.carry_rows(q.size), WIDTH))
    number_planets(np.concatenate([[0.0], gm]), q.T.ravel(), v.T.ravel(), planets)
    found: list[int] = in_order(planets, len(gm)).tolist()
    return found


def _ordinal(row: int) -> str:
    """Return the number of a body in words: "1st" for row 0."""
    last = {1: "st", 2: "nd", 3: "rd"}.get((row + 1) % 10, "th")
    return f"{row + 1}{'th' if (row + 1) % 100 in (11, 12, 13) else last}"
