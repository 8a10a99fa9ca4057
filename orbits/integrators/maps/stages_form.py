"""The forms of maps whose steps are kicks and Kepler motions in turn: those of several kicks a step in Jacobi
coordinates (`orbits.integrators.saba`), and Wisdom–Holman maps in democratic heliocentric coordinates.

What is marched stands within the first Kepler motion of a step, which is thereby joined to the last one of the step
before it.

Source: Duncan, Levison & Lee (1998), AJ 116, 2067, for the latter.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from orbits.integrators.maps.on_kepler_orbits import InJacobiCoordinates, OnKeplerOrbits, Program
from orbits.kernels.compile import kernel
from orbits.kernels.maps.jacobi_particles import (
    drifted_particles,
    interaction,
    kicked_particles,
    moved_particles,
    seen_at,
    with_force,
)
from orbits.kernels.maps.jacobi_tables import table_rows
from orbits.kernels.maps.layout import rooms
from orbits.kernels.maps.programs import DRIFT, HEADER, LENGTH, STANDARD, programs_of
from orbits.kernels.maps.stages import at_the_end, jump_of, step_in_stages, tabulate_origins
from orbits.kernels.steps import OK
from orbits.tableaux.near_integrable import binary_splitting


@kernel
def step(method, model, t, h, state, storage):
    """Take one step."""
    room, _ = rooms(storage.carry, storage.scratch)
    _, stages = programs_of(method.coefficients)
    step_in_stages(method, model, storage.carry, room, storage.stages, 0)
    return OK, 0, stages.shape[0] // 2


@kernel
def step_among_particles(method, model, t, h, state, storage):
    """As `step`, with a table at each kick: of the planets to the same bits."""
    planets, table, strength = storage.carry, storage.stages, model.parameters
    (room, copy), (_, stages) = rooms(planets, storage.scratch), programs_of(method.coefficients)
    step_in_stages(method, model, planets, room, table, table_rows(strength.shape[0] - 2))
    at_the_end(method, planets, room, copy)
    tabulate_origins(method, strength, copy, room, table)
    return OK, 0, stages.shape[0] // 2


@kernel(inline=True)
def step_particles(method, model, t, h, particles, carry, storage):
    """Take one step of eight particles. They are returned as observers see them."""
    rows, table, (_, stages), marched = storage.scratch, storage.stages, programs_of(method.coefficients), carry
    kicks, count = stages.shape[0] // 2, model.parameters.shape[0] - 2
    for i in range(kicks):
        first, kick, drift = i * table_rows(count), stages[2 * i, LENGTH], stages[2 * i + 1, LENGTH]
        g = interaction(model, table, first, 0.0, False, marched, rows)
        jump = jump_of(method, table, first + count, kick, marched)
        marched, change = drifted_particles(with_force(marched, g), drift, kick, jump)
        marched = kicked_particles(marched, change, 0.0, g)
    ended = moved_particles(marched, -method.coefficients[HEADER, LENGTH])
    return seen_at(table, count, ended, rows), marched, OK, kicks


KERNELS: Mapping[str, Any] = {"step": step}
AMONG: Mapping[str, Any] = {"step": step_among_particles, "step_particles": step_particles}


@dataclass(frozen=True)
class KeplerStages(InJacobiCoordinates):
    """The steps of `SABA` in Jacobi coordinates, which are marched in the carry.

    orders : the generalized order of the scheme
    """

    orders: tuple[int, ...]

    kernels: ClassVar[Mapping[str, Any]] = KERNELS
    kernels_among: ClassVar[Mapping[str, Any]] = AMONG

    def entry(self, h: float) -> Program:
        """The Kepler motion to what is marched."""
        drifts, _ = binary_splitting(self.orders, h)
        return [(DRIFT, drifts[0])]

    def program(self, h: float) -> Program:
        """Kicks and Kepler motions in turn."""
        drifts, kicks = binary_splitting(self.orders, h)
        motions = [*drifts[1:-1], drifts[-1] + drifts[0]]
        pairs = zip(kicks, motions, strict=True)
        return [stage for kick, drift in pairs for stage in ((STANDARD, kick), (DRIFT, drift))]


@dataclass(frozen=True)
class DemocraticHeliocentric(OnKeplerOrbits):
    """The steps of a Wisdom–Holman map in democratic heliocentric coordinates, which are marched in the carry: half of
    the Kepler motions, a kick with the motion of all planets by that of the dominant body, and the other half; see
    `orbits.kernels.maps.heliocentric`. There is no corrector: those of `WisdomHolman` are made for Jacobi coordinates.
    """

    kernels: ClassVar[Mapping[str, Any]] = {**KERNELS, "heliocentric": 1}
    kernels_among: ClassVar[Mapping[str, Any]] = AMONG

    def entry(self, h: float) -> Program:
        """Half of the Kepler motions."""
        return [(DRIFT, 0.5 * h)]

    def program(self, h: float) -> Program:
        """The kick, and these motions."""
        return [(STANDARD, h), (DRIFT, h)]

    def tables(self, planets: int) -> int:
        """That of a step, with one place; see `orbits.kernels.maps.jacobi_tables`."""
        return planets + 3
