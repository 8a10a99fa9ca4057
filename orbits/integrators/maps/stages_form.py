"""The form of a map of several kicks a step in Jacobi coordinates; see `orbits.integrators.saba`.

What is marched stands within the first Kepler motion of a step, which is thereby joined to the last one of the step
before it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from orbits.integrators.maps.on_kepler_orbits import InJacobiCoordinates, Program
from orbits.kernels.compile import kernel
from orbits.kernels.maps.jacobi_particles import (
    drifted_particles,
    interaction,
    kicked_particles,
    moved_particles,
    seen_at,
    with_force,
)
from orbits.kernels.maps.jacobi_stages import advance_planets, evaluate_kick, finish_velocities, step_in_stages
from orbits.kernels.maps.jacobi_tables import table_rows, tabulate_centres
from orbits.kernels.maps.layout import registers_of, rooms
from orbits.kernels.maps.programs import DRIFT, HEADER, LENGTH, STANDARD, programs_of
from orbits.kernels.maps.stages import at_the_end
from orbits.kernels.steps import OK
from orbits.tableaux.near_integrable import binary_splitting


@kernel
def step(method, model, t, h, state, storage):
    """Take one step."""
    room, _ = rooms(storage.carry, storage.scratch)
    _, stages = programs_of(method.coefficients)
    step_in_stages(registers_of(method), storage.carry, room, model.parameters.shape[0] - 2, stages)
    return OK, 0, stages.shape[0] // 2


@kernel
def step_among_particles(method, model, t, h, state, storage):
    """As `step`, with a table at each kick: of the planets to the same bits."""
    planets, table, strength = storage.carry, storage.stages, model.parameters
    (room, copy), (_, stages) = rooms(planets, storage.scratch), programs_of(method.coefficients)
    kicks, rows = stages.shape[0] // 2, table_rows(strength.shape[0] - 2)
    for i in range(kicks):
        evaluate_kick(registers_of(method), model, STANDARD, 0.0, planets, room, table, i * rows)
        advance_planets(planets, room, stages[2 * i + 1, LENGTH], stages[2 * i, LENGTH])
        finish_velocities(planets, room, 0.0)
    at_the_end(method, planets, room, copy)
    tabulate_centres(strength, copy, room, table, 0)
    return OK, 0, kicks


@kernel(inline=True)
def step_particles(method, model, t, h, particles, carry, storage):
    """Take one step of eight particles. They are returned as observers see them."""
    rows, table, (_, stages), marched = storage.scratch, storage.stages, programs_of(method.coefficients), carry
    kicks, apart = stages.shape[0] // 2, table_rows(model.parameters.shape[0] - 2)
    for i in range(kicks):
        g = interaction(model, table, i * apart, 0.0, False, marched, rows)
        kick, drift = stages[2 * i, LENGTH], stages[2 * i + 1, LENGTH]
        marched, change = drifted_particles(with_force(marched, g), drift, kick)
        marched = kicked_particles(marched, change, 0.0, g)
    ended = moved_particles(marched, -method.coefficients[HEADER, LENGTH])
    return seen_at(table, 0, ended, rows), marched, OK, kicks


@dataclass(frozen=True)
class KeplerStages(InJacobiCoordinates):
    """The steps of `SABA` in Jacobi coordinates, which are marched in the carry.

    orders : the generalized order of the scheme
    """

    orders: tuple[int, ...]

    kernels: ClassVar[Mapping[str, Any]] = {"step": step}
    kernels_among: ClassVar[Mapping[str, Any]] = {"step": step_among_particles, "step_particles": step_particles}

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
