"""The states of a leg at samples, which change nothing: they are computed from the steps that the leg takes anyway.

The state within a step is that after a partial step of the method from the state at its beginning with its low parts,
which are recorded where samples lie within steps: of a block of steps, all in one compiled call. A method that marches
other variables than those seen, or whose carry has more than a guess, needs the carry after each step, which is
recorded in blocks with several samples. Massless particles with clocks of their own take a part of a step up to a
sample when they come to it; those that follow the stages of a step cannot, and to each of their samples a copy is
marched.
"""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING
from weakref import proxy

import numpy as np

from orbits.errors import IntegrationError
from orbits.integrators.forms import Array, padded
from orbits.kernels.gravity.terms_and_forces import FIGURES
from orbits.kernels.lanes import WIDTH
from orbits.marching.clocks.step_times import UNLIMITED, Behind, Place, Places
from orbits.marching.following.contract import NO_SAMPLES, SamplesInBlock
from orbits.marching.legs import within_step
from orbits.marching.legs.interruptions import LegWatcher

if TYPE_CHECKING:
    from orbits.marching.legs.leg import Leg
    from orbits.marching.legs.march import March

_NOTHING = np.zeros((0, 2, 0))

SHOWN_BYTES = 16 * 1024 * 1024
"""Size of the states of particles at the samples of a block, at the most; one sample takes as much as it takes."""

WORK, FEWEST = 1_000_000, 32
"""About the most evaluations for particles at samples that are shown together, if these are not fewer than the second:
a run can end, and is stored, only after them. Each may take as many as a step of the bodies, which may be thousands of
orbits of the particles; up to the end of the step, they are followed once more for each group."""

UNKNOWN = 1000
"""The evaluations for a particle in a step of the bodies, before they are known."""

_NOWHERE = Places(np.zeros(0, dtype=np.int64), np.zeros(0))


class Samples:
    """States of a march at samples, to each of which it leads in turn."""

    def __init__(self, march: March) -> None:
        self._march = march

    def together(self, places: Places) -> int:
        """Return how many of these places the next block may lead to: if there are several, those that it `passed` are
        known after it.
        """
        return 1

    def passed(self, places: Places) -> int:
        """Return how many of these places are in the block just marched, with states that are known."""
        return 0

    def in_block(self, places: Places) -> tuple[Array, Array]:
        """Return (q, v), each (m, n, 3), at places in the block just marched. Raises an IntegrationError if a partial
        step to one fails; the march is then at the beginning of the block.
        """
        raise NotImplementedError

    def ahead(self, places: Places) -> tuple[Array, Array]:
        """Return (q, v), each (m, n, 3), at the first m >= 1 of these places, up to which the march has advanced."""
        q, v = self._march.state_at(places.at(0))
        return q[None], v[None]

    def of_particles(self, count: int) -> SamplesInBlock:
        """Return the samples in the block of `count` steps that the massive bodies have just taken at which particles
        are to be shown as they follow.
        """
        return NO_SAMPLES

    def accounts(self) -> Array:
        """Return what is known of each force at each of the states returned last, (m or 1, forces, columns)."""
        return self._march.accounts()[None]


class SamplesOfLeg(Samples, LegWatcher):
    """States of a leg at samples, by partial steps from the states at the beginnings of steps."""

    def __init__(self, leg: Leg) -> None:
        self._leg: Leg = proxy(leg)
        form = leg.stepper.form
        self._transforms, self._recorded = form.transforms, leg.observers.records_all or form.transforms
        self._stays = np.ones((form.carry_rows(3 * len(leg.problem.bodies)), WIDTH))
        form.forget(self._stays)
        self._reads_carries = form.transforms or bool(self._stays.any())
        self._most = UNLIMITED

    def together(self, places: Places) -> int:
        """Return how many of these places the next block may lead to."""
        leg, self._most = self._leg, UNLIMITED
        if not self._recorded:
            return 1
        loops = leg.stepper.loops
        if not self._transforms:
            loops.keep_lows(bool(places.rests[: leg.times.led_to(places, leg.block)].any()))
        if not self._reads_carries:
            return len(places.steps)
        most = loops.most_kept
        count = leg.times.led_to(places, min(leg.block, most))
        loops.keep_carries(count > 1)
        if count > 1:
            self._most = most
        return max(count, 1)

    def most(self, leg: Leg) -> int:
        """Return the most steps of the next block, if the carry after each is recorded."""
        return self._most

    def passed(self, places: Places) -> int:
        """Return how many of these places are in the block just marched."""
        return self._leg.times.passed(places)

    def in_block(self, places: Places) -> tuple[Array, Array]:
        """Return (q, v), each (m, n, 3), at places in the block just marched."""
        leg = self._leg
        loops, behind, count = leg.stepper.loops, leg.times.behind(places), leg.loop.taken
        path = _NOTHING if self._transforms else leg.observers.recorded(count)[behind.steps]
        if behind.parts.any() and not self._transforms:
            path = np.concatenate([path, loops.lows(count)[behind.steps]], axis=1)
        carries = None
        if self._reads_carries:
            carries = loops.kicks[np.maximum(behind.steps - 1, 0)]
            carries[behind.steps == 0] = leg.loop.begun["memory"]
        try:
            return self._behind(path, carries, behind)
        except IntegrationError:  # the leg has not passed what is not known
            leg.go_back(0)
            raise

    def ahead(self, places: Places) -> tuple[Array, Array]:
        """Return (q, v), each (m, n, 3), at those of these places that lie in the next step with any."""
        first = places.at(0)
        if self._leg.times.is_at(first):
            return self._of_copy(first)
        try:
            return self._in_next_step(places)
        except IntegrationError:  # no step from there, or no partial one; steps that are chosen anew may lead there
            return self.ahead(places.between(0, 1)) if len(places.steps) > 1 else self._of_copy(first)

    def _in_next_step(self, places: Places) -> tuple[Array, Array]:
        """The same, by partial steps; an IntegrationError if the step, or a part of it, cannot be taken."""
        state, behind, numbers = self._leg.times.ahead_of(self._leg, places)
        self._let_follow(behind, numbers)
        count = len(behind.steps) if self._reads_carries else 0
        carries = np.repeat(state["memory"][None], count, axis=0) if count else None
        path = np.empty((len(behind.steps), 4, len(state["q"])))
        for row, name in enumerate(("q", "v", "q_lo", "v_lo")):
            path[:, row] = state[name]
        return self._behind(path, carries, behind)

    def _let_follow(self, behind: Behind, numbers: Array | None) -> None:
        """Let particles follow the bodies in the step of `Ahead`, up to places in it."""

    def accounts(self) -> Array:
        """Return what is known of each force at each of the states returned last, (m or 1, forces, columns)."""
        if not self._leg.problem.forces:
            return np.zeros((1, 0, FIGURES))
        return np.stack([self._leg.stepper.accounts(state) for state in self._leg.shown])

    def _of_copy(self, place: Place) -> tuple[Array, Array]:
        """Return (q, v), each (1, n, 3), at a place, to which a copy is marched."""
        q, v = within_step.state_at(self._leg, place)
        return q[None], v[None]

    def _behind(self, path: Array, carries: Array | None, behind: Behind) -> tuple[Array, Array]:
        """Return the states behind those of a path, (m, 2, padded), or (m, 4, padded) with their low parts.

        carries : (m, rows, 8), those with which the steps begin, a copy; None for a form that needs none
        """
        leg, steps, count = self._leg, np.arange(len(behind.steps)), len(behind.steps)
        n = len(leg.problem.bodies)
        if carries is not None and self._transforms:
            path = leg.stepper.loops.seen(carries, low=True)
        if carries is not None:
            carries *= self._stays
        q, v = np.ascontiguousarray(path[:, :2, : 3 * n].swapaxes(0, 1))
        within = behind.parts != 0.0
        if within.any():
            leg.stepper.partial_steps().take(path, steps, behind.begun, behind.parts, within, q, v, carries)
        leg.shown = [leg.stepper.state]
        if carries is not None and leg.problem.forces:
            leg.shown = [{**leg.stepper.state, "memory": carry} for carry in carries]
        return q.reshape(count, 3, n).swapaxes(1, 2), v.reshape(count, 3, n).swapaxes(1, 2)


class SamplesOfParticles(SamplesOfLeg):
    """States at samples of massive bodies as they are without massless particles, and those of particles, which follow
    the stages of a step, from copies.
    """

    def together(self, places: Places) -> int:
        """Return 1: a block ends before each sample."""
        return 1

    def ahead(self, places: Places) -> tuple[Array, Array]:
        """Return (q, v), each (1, n, 3), at the first of these places."""
        first, leg = places.at(0), self._leg
        q, v = self._of_copy(first)
        if not leg.times.is_at(first):
            shown, bodies = leg.shown, leg.problem.bodies
            with suppress(IntegrationError):  # without particles, too, the bodies are then those of the copy
                q[:, bodies], v[:, bodies] = self._in_next_step(places.between(0, 1))
            leg.shown = shown
        return q, v


class SamplesByOwnClocks(SamplesOfLeg):
    """States at samples, also of massless particles with clocks of their own: they are shown where they come by."""

    def __init__(self, leg: Leg) -> None:
        super().__init__(leg)
        self._places, self._shown, self._steps = _NOWHERE, NO_SAMPLES, 0
        self._columns = padded(len(leg.problem.particles))
        self._most_shown = max(1, SHOWN_BYTES // (48 * self._columns))
        self._counts, self._in_step = (leg.step, 0), float(UNKNOWN * len(leg.problem.particles))

    def _at_once(self) -> int:
        """Return how many samples may be shown together, by the evaluations in the steps since the last call."""
        (step, known), leg = self._counts, self._leg
        self._counts = leg.step, leg.stepper.particle_evaluations
        if leg.step > step:
            self._in_step = (leg.stepper.particle_evaluations - known) / (leg.step - step)
        return min(max(int(WORK / max(self._in_step, 1.0)), FEWEST), self._most_shown)

    def together(self, places: Places) -> int:
        """Return how many of these places the next block may lead to."""
        count = super().together(places.between(0, self._at_once()))
        self._places = places.between(0, count) if count > 1 else _NOWHERE
        return count

    def passed(self, places: Places) -> int:
        """Return how many of these places are in the block just marched."""
        count = super().passed(places)
        self._places = self._places if count else _NOWHERE
        return count

    def ahead(self, places: Places) -> tuple[Array, Array]:
        """Return (q, v), each (m, n, 3), at the first of those of these places that lie in the next step with any."""
        return super().ahead(places.between(0, self._at_once()))

    def of_particles(self, count: int) -> SamplesInBlock:
        """Return the samples in the block that the massive bodies have just taken, at which particles are shown."""
        if not len(self._places.steps):
            return NO_SAMPLES
        return self._samples_in(self._leg.times.behind(self._places), count)

    def _samples_in(self, behind: Behind, steps: int) -> SamplesInBlock:
        """Return samples behind the beginnings of the steps of a block of `steps` steps, of whose states nothing is
        known.
        """
        count, self._steps = len(behind.steps), steps
        if count > len(self._shown.behind):
            room, first = min(2 * count, max(count, self._most_shown)), np.zeros(self._leg.block + 1, dtype=np.int64)
            self._shown = SamplesInBlock(first, np.zeros(room), np.zeros((room, 6, self._columns)))
        self._shown.first[: steps + 1] = np.searchsorted(behind.steps, np.arange(steps + 1))
        self._shown.behind[:count] = behind.parts
        self._shown.states[:count] = np.nan
        return self._shown

    def in_block(self, places: Places) -> tuple[Array, Array]:
        """Return (q, v), each (m, n, 3), at places in the block just marched."""
        self._places = _NOWHERE
        return super().in_block(places)

    def _let_follow(self, behind: Behind, numbers: Array | None) -> None:
        """Let copies of the particles follow the bodies in the step that these have just taken."""
        if numbers is None:
            raise IntegrationError("the next step of the leg, in which particles would follow, is not known.")
        leg, samples = self._leg, self._samples_in(behind, 1)
        counts, retired = leg.stepper.counts(), leg.losses.retired
        retired.begin()
        copy = {name: x.copy() for name, x in leg.stepper.state.items() if name.startswith("particle_")}
        try:
            leg.stepper.particles(copy, leg.clock, numbers, retired.block, None, 1, samples)
        finally:
            self._in_step = float(leg.stepper.particle_evaluations - counts[1])
            leg.stepper.evaluations, leg.stepper.particle_evaluations = counts

    def _behind(self, path: Array, carries: Array | None, behind: Behind) -> tuple[Array, Array]:
        """Return the states behind those of a path, and those of particles, which have been shown; NaN where they are
        gone. Raises an IntegrationError if one could not be followed that is there.
        """
        x = super()._behind(path, carries, behind)
        leg, count = self._leg, len(behind.steps)
        problem, state, m = leg.problem, leg.stepper.state, len(leg.problem.particles)
        shown = self._shown.states[:count, :, :m].reshape(count, 2, 3, m)
        shown[behind.steps == self._steps] = np.stack([state[f"particle_{name}"][:, :m] for name in "qv"])
        missing, gone = np.isnan(shown).any(axis=(1, 2)), leg.losses.retired.gone()
        if (missing & ~(gone & problem.retire)).any():
            raise IntegrationError("a massless body cannot be followed to a sample.")
        out = np.empty((2, count, len(problem.bodies) + m, 3))
        for k in range(2):
            out[k][:, problem.bodies] = x[k]
            out[k][:, problem.particles] = np.where(missing[:, None], np.nan, shown[:, k]).swapaxes(1, 2)
        return out[0], out[1]


def samples_of(leg: Leg) -> SamplesOfLeg:
    """Return how the states of a leg at samples come about."""
    if not len(leg.problem.particles):
        return SamplesOfLeg(leg)
    return SamplesByOwnClocks(leg) if leg.stepper.loops.shows_samples else SamplesOfParticles(leg)
