"""The form of a Wisdom–Holman map in Jacobi coordinates; see `orbits.integrators.wisdom_holman`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from orbits.errors import InputError
from orbits.integrators.base import Integrator
from orbits.integrators.forms import Array, padded
from orbits.integrators.maps.dominant import registers_for, require_dominant
from orbits.integrators.maps.jacobi_form_particles import (
    begin_among_particles,
    begin_pair,
    begin_particles,
    enter_particles,
    keep_pair,
    leave_particles,
    step_among_particles,
    step_pair,
    step_particles,
    step_particles_with_terms,
    step_with_terms_among_particles,
)
from orbits.integrators.maps.jacobi_form_steps import (
    ANGLE,
    HALF,
    LAZY,
    SHIFT,
    WHOLE,
    begin,
    enter,
    leave,
    show,
    step,
    step_with_terms,
    stretch,
)
from orbits.integrators.maps.on_kepler_orbits import InJacobiCoordinates, in_order, keep_particles, rows_of
from orbits.kernels.lanes import WIDTH
from orbits.kernels.maps.jacobi import number_planets
from orbits.kernels.maps.jacobi_particles import table_rows
from orbits.kernels.maps.stages import DRIFT, FLOW, MODIFIED, STANDARD
from orbits.kernels.maps.stages import LAZY as LAZY_KICK
from orbits.tableaux.correctors import corrector_lengths


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

    of_pairs: ClassVar[Mapping[str, Any]] = {
        "begin_pair": begin_pair,
        "step_pair": step_pair,
        "keep_pair": keep_pair,
    }

    kernels_with_terms: ClassVar[Mapping[str, Any]] = {"step": step_with_terms}
    more_kernels_with_terms: ClassVar[Mapping[str, Any]] = {
        "step": step_with_terms_among_particles,
        "step_particles": step_particles_with_terms,
    }

    def own_kernels(self) -> Mapping[str, Any]:
        """Return the kernels of this instance."""
        own = {**super().own_kernels(), **(self.kernels_with_terms if self.with_terms else {})}
        if not self.among_particles:
            return own
        return {**own, **(self.more_kernels_with_terms if self.with_terms else self.of_pairs)}

    def coefficients(self, h: float, before: float) -> Array:
        """Return the lengths of a step and of the stages of the corrector, (1 + stages, 8)."""
        stages = h * corrector_lengths(self.corrector, self.corrector2) if self.corrector else np.zeros((0, 2))
        rows = np.zeros((1 + len(stages), WIDTH))
        rows[0, [HALF, WHOLE, LAZY, ANGLE]] = h / 2, h, self.kernel == "lazy", 2.0 * math.pi / Integrator.least_steps
        rows[0, SHIFT] = 0.0 if self.kernel == "standard" else h * h / 12
        rows[1:, :2] = stages
        return rows

    def stages_of(self, h: float) -> tuple[Array, Array]:
        """The corrector, and kick, Kepler motions, kick, with the flow of terms in between."""
        flow = [(FLOW, h / 2)] if self.with_terms else []
        kick = {"standard": STANDARD, "modified-kick": MODIFIED, "lazy": LAZY_KICK}[self.kernel], h / 2
        entry: list[tuple[int, float]] = []
        for drift, length in self.coefficients(h, h)[1:, :2].tolist():
            entry.append((DRIFT, drift))
            if length != 0.0:
                entry += [(FLOW, length), (STANDARD, length)] if self.with_terms else [(STANDARD, length)]
        return rows_of(entry), rows_of([kick, *flow, (DRIFT, h), *flow, kick])

    def stages_shape(self, size: int) -> tuple[int, int]:
        """The tables before and after a step, and workspace; see `orbits.kernels.maps.jacobi_particles`. None are kept
        without particles.
        """
        if not self.among_particles:
            return 1, padded(size)
        planets = size // 3 - 1
        flows = 6 * (planets + 1) if self.with_terms else 0
        return 2 * (3 * (planets + 1) + planets) + flows + 3 * registers_for(size), WIDTH

    def notes_nearest(self, size: int) -> bool:
        """Whether the steps note how close the planets come: those that stay in registers, without particles."""
        most = 1 if self.with_terms else 2
        return registers_for(size) <= most and not self.among_particles

    def stages_read(self, size: int) -> int:
        """Return how many numbers of its stages a step writes or reads: not the table before it, but for the first."""
        rows, columns = self.stages_shape(size)
        return (rows - table_rows(size // 3 - 1)) * columns if self.among_particles else rows * columns

    def scratch_shape(self, size: int) -> tuple[int, int]:
        """The rows of `orbits.kernels.maps.jacobi`."""
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
