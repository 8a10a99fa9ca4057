"""The states of a leg with massless particles at samples, which change nothing.

Those with clocks of their own take a part of a step up to each sample in it, when they come to it. Those that follow
the stages of a step cannot, as a part of it has other stages: they are kept at the beginnings of the steps with
samples, and after the block a copy of them and of the bodies takes that part of the step.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from orbits.errors import IntegrationError
from orbits.integrators.forms import Array, padded
from orbits.marching.clocks.step_times import Behind, Places
from orbits.marching.following.contract import NO_SAMPLES, SamplesInBlock
from orbits.marching.legs.samples import SamplesOfLeg

if TYPE_CHECKING:
    from orbits.marching.legs.leg import Leg
    from orbits.marching.legs.stepper import State

SHOWN_BYTES = 16 * 1024 * 1024
"""Size of the states of particles at the samples of a block, at the most; one sample takes as much as it takes."""

WORK, FEWEST = 1_000_000, 32
"""About the most evaluations for particles at samples that are shown together, if these are not fewer than the second:
a run can end, and is stored, only after them. By own steps, each may take as many as a step of the bodies, which may be
thousands of orbits of the particles; up to the end of the step, they are followed once more for each group."""

UNKNOWN = 1000
"""The evaluations for a particle in a step of the bodies, before they are known, or up to a sample through stages, with
correctors."""

_NOWHERE = Places(np.zeros(0, dtype=np.int64), np.zeros(0))


class SamplesOfParticles(SamplesOfLeg):
    """States at samples of massive bodies as they are without massless particles, and of these."""

    def __init__(self, leg: Leg) -> None:
        super().__init__(leg)
        self._places, self._shown, self._steps = _NOWHERE, NO_SAMPLES, 0
        self._columns, self._in_step = padded(len(leg.problem.particles)), float(UNKNOWN * len(leg.problem.particles))
        rows, *memory = self._shapes()
        self._most_shown = max(1, SHOWN_BYTES // (8 * (rows * self._columns + int(np.prod(memory)))))

    def _shapes(self) -> tuple[int, ...]:
        """Return how many rows of states are kept of each sample, and the shape of memories, if they are."""
        raise NotImplementedError

    def _at_once(self) -> int:
        """Return how many samples may be shown together."""
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
        return self._samples_in(self._leg.times.underway(self._places), count)

    def _samples_in(self, behind: Behind, steps: int) -> SamplesInBlock:
        """Return samples behind the beginnings of the steps of a block of `steps` steps, of whose states nothing is
        known.
        """
        count, self._steps = len(behind.steps), steps
        if count > len(self._shown.behind):
            room, first = min(2 * count, max(count, self._most_shown)), np.zeros(self._leg.block + 1, dtype=np.int64)
            rows, *memory = self._shapes()
            kept = np.zeros((room, *memory)) if memory else NO_SAMPLES.memory
            self._shown = SamplesInBlock(first, np.zeros(room), np.zeros((room, rows, self._columns)), kept)
        self._shown.first[: steps + 1] = np.searchsorted(behind.steps, np.arange(steps + 1))
        self._shown.behind[:count] = behind.parts
        self._shown.states[:count] = np.nan
        return self._shown

    def in_block(self, places: Places) -> tuple[Array, Array]:
        """Return (q, v), each (m, n, 3), at places in the block just marched."""
        self._places = _NOWHERE
        return super().in_block(places)

    def _with_particles(self, bodies: tuple[Array, Array], particles: Array) -> tuple[Array, Array]:
        """Return the states of bodies, (m, bodies, 3) each, and of particles, (m, 2, 3, particles), in the order of the
        caller.
        """
        problem = self._leg.problem
        out = np.empty((2, len(particles), len(problem.bodies) + len(problem.particles), 3))
        for k in range(2):
            out[k][:, problem.bodies] = bodies[k]
            out[k][:, problem.particles] = particles[:, k].swapaxes(1, 2)
        return out[0], out[1]


class SamplesByOwnClocks(SamplesOfParticles):
    """Those of particles with clocks of their own, which are shown where they come by."""

    def __init__(self, leg: Leg) -> None:
        super().__init__(leg)
        self._counts = leg.step, 0
        self._copy: State = {}

    def _shapes(self) -> tuple[int, ...]:
        return (6,)

    def _at_once(self) -> int:
        """Return how many samples may be shown together, by the evaluations in the steps since the last call."""
        (step, known), leg = self._counts, self._leg
        self._counts = leg.step, leg.stepper.particle_evaluations
        if leg.step > step:
            self._in_step = (leg.stepper.particle_evaluations - known) / (leg.step - step)
        return super()._at_once()

    def _let_follow(self, behind: Behind, numbers: Array | None) -> None:
        """Let copies of the particles follow the bodies in the step that these have just taken."""
        if numbers is None:
            raise IntegrationError("the next step of the leg, in which particles would follow, is not known.")
        leg, samples = self._leg, self._samples_in(behind, 1)
        counts = leg.stepper.counts()
        try:
            self._follow(numbers, samples)
        finally:
            self._in_step = float(leg.stepper.particle_evaluations - counts[1])
            leg.stepper.evaluations, leg.stepper.particle_evaluations = counts

    def _pass(self, numbers: Array) -> None:
        """Let copies of the particles follow the bodies in a step before that of `Ahead`."""
        self._follow(numbers, NO_SAMPLES)

    def _follow(self, numbers: Array, samples: SamplesInBlock) -> None:
        stepper, retired = self._leg.stepper, self._leg.losses.retired
        if not self._copy:
            retired.begin()
            self._copy = {name: x.copy() for name, x in stepper.state.items() if name.startswith("particle_")}
        stepper.particles(self._copy, self._leg.clock, numbers, retired.block, None, 1, samples)

    def _in_next_step(self, places: Places) -> tuple[Array, Array]:
        """The same as `ahead`, by partial steps; copies of the particles begin where the leg is."""
        self._copy = {}
        return super()._in_next_step(places)

    def _behind(self, path: Array, carries: Array | None, behind: Behind) -> tuple[Array, Array]:
        """Return the states behind those of a path, and those of particles, which have been shown; NaN where they are
        gone. Raises an IntegrationError if one could not be followed that is there.
        """
        bodies = super()._behind(path, carries, behind)
        leg, count = self._leg, len(behind.steps)
        state, m = leg.stepper.state, len(leg.problem.particles)
        shown = self._shown.states[:count, :, :m].reshape(count, 2, 3, m)
        shown[behind.steps == self._steps] = np.stack([state[f"particle_{name}"][:, :m] for name in "qv"])
        missing = np.isnan(shown).any(axis=(1, 2))
        if (missing & ~(leg.losses.retired.gone() & leg.problem.retire)).any():
            raise IntegrationError("a massless body cannot be followed to a sample.")
        shown[np.broadcast_to(missing[:, None, None], shown.shape)] = np.nan
        return self._with_particles(bodies, shown)


class SamplesThroughStages(SamplesOfParticles):
    """Those of particles that follow the stages of steps, by copies from where they are kept."""

    def __init__(self, leg: Leg) -> None:
        self._memory = leg.stepper.state["particle_memory"].shape
        super().__init__(leg)
        self._reads_carries = self._reads_carries or leg.stepper.form.keeps_particles
        self._copy: State = {}

    def _shapes(self) -> tuple[int, ...]:
        return 12, *self._memory

    def _let_follow(self, behind: Behind, numbers: Array | None) -> None:
        """Take note that the step begins where the leg is."""
        self._steps = 0

    def _behind(self, path: Array, carries: Array | None, behind: Behind) -> tuple[Array, Array]:
        """Return the states behind those of a path, and those of particles; NaN where they are gone. Raises an
        IntegrationError if one cannot be followed that is there.
        """
        before = None if carries is None else carries.copy()
        bodies = super()._behind(path, carries, behind)
        leg, m = self._leg, len(self._leg.problem.particles)
        counts, retired = leg.stepper.counts(), leg.losses.retired
        shown = np.empty((len(behind.steps), 2, 3, m))
        try:
            for i, (step, time, part) in enumerate(zip(*(x.tolist() for x in behind), strict=True)):
                leg.losses.begin_at(self._steps - step)
                state, taken = self._kept(step), leg.times.step - self._steps + step
                if part or not leg.stepper.loops.is_seen(taken):
                    memory = 0.0 if before is None else before[i]
                    state = self._copied({"memory": memory, **self._of_bodies(path, i), **state})
                    self._show(state, taken, time, part)
                if not leg.problem.retire and retired.lost():
                    raise IntegrationError("a massless body cannot be followed to a sample.")
                shown[i] = state["particle_q"][:, :m], state["particle_v"][:, :m]
                shown[i, :, :, retired.gone()] = np.nan
                if before is not None and leg.problem.forces:
                    leg.shown[i] = {**leg.shown[i], "particle_memory": state["particle_memory"].copy()}
        finally:
            leg.stepper.evaluations, leg.stepper.particle_evaluations = counts
            retired.begin()
        return self._with_particles(bodies, shown)

    def come_before(self, step: int) -> bool:
        """Return whether there are samples in a step of the block, or at its beginning."""
        first = self._shown.first
        return bool(len(self._places.steps) and first[step] < first[step + 1])

    def _kept(self, step: int) -> Mapping[str, Array]:
        """Return what is kept of the state at the beginning of a step of the last block, or at its end. Those in its
        first step were taken `ahead`, before it.
        """
        if step == self._steps:
            return self._leg.stepper.state
        row = self._shown.first[step]
        q, q_lo, v, v_lo = self._shown.states[row].reshape(4, 3, -1)
        columns = {"particle_q": q, "particle_q_lo": q_lo, "particle_v": v, "particle_v_lo": v_lo}
        return {**columns, "particle_memory": self._shown.memory[row]}

    def _of_bodies(self, path: Array, i: int) -> Mapping[str, Array]:
        """Return positions and velocities of the bodies in a row of a path, unless they are known from their carry."""
        return dict(zip(("q", "v", "q_lo", "v_lo"), path[i], strict=True)) if len(path) else {}

    def _copied(self, known: Mapping[str, Any]) -> State:
        """Return a state with these arrays, which is lost with the next one."""
        self._copy = self._copy or self._leg.stepper.copied()
        for name, array in self._copy.items():
            if name in known:
                array[...] = known[name]
        return self._copy

    def _show(self, copy: State, taken: int, time: float, part: float) -> None:
        """March a copy of the state after so many steps by a part of the next, and compute what is seen there."""
        leg, loops, retired = self._leg, self._leg.stepper.loops, self._leg.losses.retired.block
        if taken:
            (loops.leave if part else loops.leave_particles)(copy, leg.clock, retired)
        if part:
            leg.stepper.take_part(copy, time, part, retired)


def samples_of(leg: Leg) -> SamplesOfLeg:
    """Return how the states of a leg at samples come about."""
    if not len(leg.problem.particles):
        return SamplesOfLeg(leg)
    return SamplesByOwnClocks(leg) if leg.stepper.loops.shows_samples else SamplesThroughStages(leg)
