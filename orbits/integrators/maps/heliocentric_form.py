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

from orbits.integrators.maps.on_kepler_orbits import OnKeplerOrbits, Program
from orbits.kernels.compile import kernel
from orbits.kernels.maps.heliocentric import step_heliocentric
from orbits.kernels.maps.heliocentric_particles import (
    PLANETS,
    seen_among_heliocentric,
    stepped_particles,
    tabulate_planets,
    tabulate_the_rest,
)
from orbits.kernels.maps.jacobi_particles import moved_particles
from orbits.kernels.maps.layout import rooms
from orbits.kernels.maps.programs import DRIFT, HEADER, LENGTH, STANDARD, WHOLE
from orbits.kernels.maps.stages import at_the_end
from orbits.kernels.steps import OK


@kernel
def step(method, model, t, h, state, storage):
    """Take one step."""
    room, _ = rooms(storage.carry, storage.scratch)
    step_heliocentric(storage.carry, room, model.parameters.shape[0] - 2, method.coefficients[0, WHOLE])
    return OK, 0, 1


@kernel
def step_among_particles(method, model, t, h, state, storage):
    """As `step`, with the table: of the planets to the same bits."""
    planets, table, strength = storage.carry, storage.stages, model.parameters
    (room, copy), count = rooms(planets, storage.scratch), strength.shape[0] - 2
    tabulate_planets(planets, room, table, count)
    jump = step_heliocentric(planets, room, count, method.coefficients[0, WHOLE])
    at_the_end(method, planets, room, copy)
    tabulate_the_rest(strength, copy, room, table, jump)
    return OK, 0, 1


@kernel(inline=True)
def step_particles(method, model, t, h, particles, carry, storage):
    """Take one step of eight particles. They are returned as observers see them."""
    count = model.parameters.shape[0] - 2
    marched = stepped_particles(carry, storage.stages, count, method.coefficients[0, WHOLE])
    ended = moved_particles(marched, -method.coefficients[HEADER, LENGTH])
    return seen_among_heliocentric(storage.stages, ended), marched, OK, 1


@dataclass(frozen=True)
class DemocraticHeliocentric(OnKeplerOrbits):
    """The steps of a Wisdom–Holman map in democratic heliocentric coordinates, which are marched in the carry."""

    kernels: ClassVar[Mapping[str, Any]] = {"step": step, "heliocentric": 1}
    kernels_among: ClassVar[Mapping[str, Any]] = {"step": step_among_particles, "step_particles": step_particles}

    def entry(self, h: float) -> Program:
        """Half of the Kepler motions."""
        return [(DRIFT, 0.5 * h)]

    def program(self, h: float) -> Program:
        """The kick, and these motions."""
        return [(STANDARD, h), (DRIFT, h)]

    def tables(self, planets: int) -> int:
        """That of a step; see `orbits.kernels.maps.heliocentric_particles`."""
        return PLANETS + planets


__all__ = ["DemocraticHeliocentric"]
