"""Marching a finished run again, for states between its samples and for closest approaches."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from orbits.checks import checked_flag
from orbits.errors import InputError, IntegrationError, shown
from orbits.integrators.forms import Array
from orbits.marching.legs.excursions.chosen_steps import PREFIX as AWAY
from orbits.time_grid import TimeGrid
from orbits.trajectory.marched_again import MarchesAgain

if TYPE_CHECKING:
    from orbits.marching.following.retirement import Retirement
    from orbits.marching.legs.march import March as Marching
    from orbits.protocols import March
    from orbits.results.approach import Approach
    from orbits.results.approaches import Approaches
    from orbits.results.error_bars import ErrorBars
    from orbits.results.megno import Megno
    from orbits.results.passages import Seen
    from orbits.results.state_transition import StateTransition
    from orbits.results.stop import Stop
    from orbits.trajectory import Trajectory
    from orbits.trajectory.retired import RetiredParticles


class Replay(MarchesAgain):
    """Marches runs again with their own method and step, for the methods of `Trajectory`."""

    def begun(self, run: Trajectory) -> March:
        from orbits.propagation.marchers import bound

        _refuse_legs(run, "run.to_spk() marches")
        return bound(run.system, run.integrator, run.clock)

    def at(self, run: Trajectory, t: Any) -> Any:
        from orbits.propagation.results.dense_output import state_at

        return state_at(run, t)

    def before(self, run: Trajectory, times: Array) -> tuple[Array, Array]:
        from orbits.propagation.results.dense_output import states_before

        return states_before(run, times)

    def closest_approaches(self, run: Trajectory, covariance: Any = None, body: str | None = None) -> Approaches:
        seen = seen_by(run)
        if not seen.looked:
            raise InputError(
                f"this run of {run.integrator.label} did not look for closest approaches; expected one made with "
                "orbits.propagate(..., approaches=True). Passages that its step did not resolve are in "
                "run.unresolved()."
            )
        if covariance is None:
            if body is not None:
                raise InputError(
                    f"body is {shown(body)} without covariance; expected both, as body is the one that "
                    "the covariance is of. The approaches of one body alone are run.closest_approaches()[name]."
                )
            return approaches_of(run, seen)
        from orbits.propagation.variations.deviations import Uncertain, followed, sigmas_of_passages

        given = Uncertain.of(run.system, covariance, body)
        followed(run, given, run.times[-1:])  # what cannot be followed is refused here, not when sigmas are shown
        return approaches_of(run, seen, partial(sigmas_of_passages, run, given))

    def unresolved(self, run: Trajectory) -> list[Approach]:
        from orbits.propagation.checks.unresolved_passages import spoiling

        seen = seen_by(run)
        approaches = approaches_of(run, seen)
        if seen.left_out < 0:  # a run of an earlier version, which kept no states of the passages
            approaches.know_all()
        found = [k for k, _ in spoiling(run, seen)]
        return approaches.several(found)

    def error_estimate(self, run: Trajectory) -> ErrorBars:
        from orbits.propagation.results.error_estimate import error_bars

        _refuse_legs(run, "the companions of run.error_estimate() march")
        return error_bars(run)

    def megno(self, run: Trajectory, *, coupled: bool, seed: int) -> Megno:
        from orbits.propagation.variations.following import require_followable
        from orbits.propagation.variations.megno import checked_seed, megno_of

        _refuse_legs(run, "the tangent vectors of run.megno() march")
        grid, seed = TimeGrid(run.clock, run.times), checked_seed(seed)
        require_followable(run.system, run.integrator, grid)
        return megno_of(run.system, run.integrator, grid, coupled=checked_flag(coupled, "coupled"), seed=seed)

    def state_transition(self, run: Trajectory, *, coupled: bool, parameters: Sequence[str]) -> StateTransition:
        from orbits.propagation.variations.state_transition import asked_parameters, state_transition_of

        _refuse_legs(run, "the tangent vectors of run.state_transition() march")
        grid, coupled = TimeGrid(run.clock, run.times), checked_flag(coupled, "coupled")
        asked = asked_parameters(run.system, run.integrator, grid, parameters, coupled)
        return state_transition_of(run.system, run.integrator, grid, coupled=coupled, parameters=asked)

    def retired(self, run: Trajectory) -> RetiredParticles:
        # Those listed in its last checkpoint, and those lost between its last whole step and its last sample.
        from orbits.trajectory.retired import RetiredParticles

        checkpoint = {} if run.archive is None else run.archive.checkpoint()
        listed = checkpoint.get("retired")
        lost = [checkpoint[name][:, 0].any() for name in ("retired", AWAY + "retired") if name in checkpoint]
        if listed is None or not (any(lost) or (len(run) and np.isnan(run.q[-1].value).any())):
            return RetiredParticles()
        from orbits.marching.following.particle_excursions import parts_taken
        from orbits.marching.following.retirement import retirements

        particles = np.flatnonzero(~run.system.massive)
        q, v, clocks = checkpoint["particle_q"], checkpoint["particle_v"], checkpoint.get("particle_clock")
        parts = parts_taken(checkpoint["particle_memory"]) if run.integrator.in_encounters.follow_particles else None
        names = [run.names[k] for k in np.flatnonzero(run.system.massive)]
        rows = retirements(listed, q, v, particles, clocks, parts, names)
        if run.integrator.in_encounters.follow_planets or missing(run, rows):
            from orbits.propagation.resuming.from_checkpoint import march_at

            rows = lost_by_the_end(march_at(run, checkpoint), run)
        return RetiredParticles.of(run.system, run.clock, rows, run.changes)

    def stopped(self, run: Trajectory) -> Stop:
        from astropy import units as u

        from orbits.results.stop import Stop

        assert run.archive is not None
        ended = run.archive.ended
        time = run._reached if ended.time is None else ended.time
        return Stop(ended.why, None, u.Quantity(time, run.system.units.time), self.at(run, time))


REPLAY = Replay()


def missing(run: Trajectory, retired: list[Retirement]) -> bool:
    """Return whether massless particles have no place in the last sample of a run, though they are not retired."""
    if not len(run) or run.system.massive.all():
        return False
    lost = np.isnan(run._q[-1]).any(axis=1) & ~run.system.massive
    return bool(set(lost.nonzero()[0]) - {one.body for one in retired})


def lost_by_the_end(march: Marching, run: Trajectory) -> list[Retirement]:
    """Return the retired particles of a run, whose march is at its end, with those lost in the step that leads beyond:
    it is marched up to the last sample, on a copy.
    """
    retired = march.retired()
    if missing(run, retired):
        with suppress(IntegrationError):  # of the massive bodies, where the run ends
            return march.retired(float(run.times[-1]))
    return retired


def _refuse_legs(run: Trajectory, what: str) -> None:
    """Raise InputError for a run whose bodies changed on the way, but for massless ones that were lost."""
    if run.changes is not None and run.changes.begin_legs:
        raise InputError(
            f"{what} the same bodies from start to end, but in this run bodies merge, bounce, or are changed at events "
            "(see run.events and run.legs). run.at(times) and the samples go through these changes."
        )


def seen_by(run: Trajectory) -> Seen:
    """Return the passages of a run, which are determined once and stored with it."""
    _refuse_legs(run, "run.closest_approaches() and run.unresolved() follow")
    if run._record is None and run._ended is None and run.archive is None:
        raise InputError(
            f"{run!r} has samples only, but closest approaches are recorded during a run; expected the whole run as "
            "returned by orbits.propagate or orbits.resume."
        )
    if run._passages is None:
        from orbits.propagation.results.recording import passages_of

        run._passages = passages_of(run)
    seen: Seen = run._passages
    return seen


def approaches_of(run: Trajectory, seen: Seen, sigmas: Any = None) -> Approaches:
    """Return the closest approaches of a run, refined by marching it again when they are asked for."""
    from orbits.propagation.checks.unresolved_passages import error_at_end
    from orbits.propagation.results.refinement import refine
    from orbits.results.approaches import Approaches

    refining, judging = partial(refine, run, seen), partial(error_at_end, run, seen)
    return Approaches(run.system, run.clock, seen, refine=refining, error_at_end=judging, sigmas=sigmas)
