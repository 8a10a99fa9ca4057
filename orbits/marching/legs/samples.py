"""The states of a leg at samples, which change nothing: they are computed from the steps that the leg takes anyway.

Where a step carries nothing on but a guess, the state within it is that after a partial step of the method from the
state at its beginning, rounded as records have it: of a block of steps, all in one compiled call. Otherwise a copy of
the whole state is marched to each sample.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np

from orbits.errors import IntegrationError
from orbits.integrators.forms import Array
from orbits.kernels.lanes import WIDTH
from orbits.marching.clocks.step_times import Behind, Places
from orbits.marching.legs import within_step

if TYPE_CHECKING:
    from orbits.marching.legs.leg import Leg


class Samples(Protocol):
    """How states at samples come about.

    known_in_block : whether the states within a block are known after it
    """

    known_in_block: bool

    def in_block(self, leg: Leg, places: Places) -> tuple[Array, Array]:
        """Return (q, v), each (m, n, 3), at places in the block that was just marched."""

    def ahead(self, leg: Leg, places: Places) -> tuple[Array, Array]:
        """Return (q, v), each (m, n, 3), at the first m >= 1 of these places, up to which the leg has advanced."""


class ByCopies:
    """States at samples to which copies of the leg are marched, one by one, behind all whole steps before them."""

    known_in_block = False

    def in_block(self, leg: Leg, places: Places) -> tuple[Array, Array]:
        """There are none."""
        raise NotImplementedError

    def ahead(self, leg: Leg, places: Places) -> tuple[Array, Array]:
        """Return (q, v), each (1, n, 3), at the first of these places."""
        q, v = within_step.state_at(leg, places.at(0))
        return q[None], v[None]


class FromSteps:
    """States at samples by partial steps from the states at the ends of steps.

    known_in_block : whether all these are recorded
    """

    def __init__(self, *, recorded: bool) -> None:
        self.known_in_block = recorded

    def in_block(self, leg: Leg, places: Places) -> tuple[Array, Array]:
        """Return (q, v), each (m, n, 3), at places in the block that was just marched."""
        try:
            return self._behind(leg, leg.observers.recorded(leg.loop.taken), leg.times.behind(places))
        except IntegrationError:  # the leg has not passed what is not known
            leg.go_back(0)
            raise

    def ahead(self, leg: Leg, places: Places) -> tuple[Array, Array]:
        """Return (q, v), each (m, n, 3), at those of these places that lie in the next step with any."""
        if leg.times.is_at(places.at(0)):
            return ByCopies().ahead(leg, places)
        try:
            state, behind = leg.times.ahead_of(leg, places)
            return self._behind(leg, np.stack([state["q"], state["v"]])[None], behind)
        except IntegrationError:  # no step from there, or no partial one; steps that are chosen anew may lead there
            one = places.between(0, 1)
            return self.ahead(leg, one) if len(places.steps) > 1 else ByCopies().ahead(leg, one)

    def _behind(self, leg: Leg, path: Array, behind: Behind) -> tuple[Array, Array]:
        """Return the states behind those of a path, (states, 2, padded)."""
        count, n = len(behind.steps), len(leg.problem.bodies)
        q, v = np.ascontiguousarray(path[behind.steps, :, : 3 * n].swapaxes(0, 1))
        within = behind.parts != 0.0
        if within.any():
            leg.stepper.partial_steps().take(path, *behind, within, q, v)
        return q.reshape(count, 3, n).swapaxes(1, 2), v.reshape(count, 3, n).swapaxes(1, 2)


class BesideParticles(ByCopies):
    """States at samples of massive bodies as they are without massless particles, and those of particles, which follow
    the stages of a step, from copies.
    """

    _bodies = FromSteps(recorded=False)

    def ahead(self, leg: Leg, places: Places) -> tuple[Array, Array]:
        """Return (q, v), each (1, n, 3), at the first of these places."""
        q, v = super().ahead(leg, places)
        if not leg.times.is_at(places.at(0)):
            bodies = leg.problem.bodies
            q[:, bodies], v[:, bodies] = self._bodies.ahead(leg, places.between(0, 1))
        return q, v


def samples_of(leg: Leg) -> Samples:
    """Return how the states of a leg at samples come about."""
    problem, form = leg.problem, leg.stepper.form
    carried = np.ones((form.carry_rows(3 * len(problem.bodies)), WIDTH))
    form.forget(carried)
    if problem.forces or form.transforms or carried.any() or leg.stepper.loops.parallel is not None:
        return ByCopies()
    if len(problem.particles):
        return BesideParticles()
    return FromSteps(recorded=leg.observers.records_all)
