"""What the caller should know of a run that is done: each check says what it found."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, cast

from orbits.errors import EventWarning, StepWarning
from orbits.finding import Finding
from orbits.marching.legs.record import Record
from orbits.propagation.checks.leg_of_run import LegOfRun
from orbits.propagation.checks.precision import energy_lost
from orbits.propagation.checks.rigid_runs import is_rigid, overlaps
from orbits.propagation.results.recording import observed_until
from orbits.propagation.resuming.marching_again import seen_by
from orbits.propagation.run_ends import RunEnds
from orbits.results.passages import Seen
from orbits.system import System
from orbits.trajectory import Trajectory

if TYPE_CHECKING:
    from orbits.propagation.chain_of_legs import ChainOfLegs


AS_IF_UNCHANGED = " This is of one leg of the run, and said as if bodies did not change after it."


def found_in(trajectory: Trajectory, watch: RunEnds, known: int) -> Iterator[Finding]:
    """Find what the caller should know of a run, after `known` particles were lost before it."""
    if len(trajectory.retired) > known:
        from orbits.propagation.checks.unresolved_passages import lost

        yield from lost(trajectory)
    if remarks := watch.events.remarks():
        yield Finding("of the events that were sought:", EventWarning, "events in doubt", remarks)
    if not watch.check_step:
        return
    yield from energy_lost(trajectory)
    if watch.marcher.changed:
        yield from _in_legs(trajectory, cast("ChainOfLegs", watch.marcher).seen())
    if trajectory._record is None:
        return
    if is_rigid(trajectory.system):
        yield from overlaps(trajectory, seen_by(trajectory))
    if len(trajectory._record.listed):
        yield from _of_passages(trajectory, seen_by(trajectory))


def _of_passages(run: Trajectory | LegOfRun, seen: Seen) -> Iterator[Finding]:
    """Find the passages that a method did not resolve."""
    from orbits.propagation.checks import kepler_splitting, unresolved_passages

    look = kepler_splitting.not_followed if run.integrator.follows_kepler else unresolved_passages.not_resolved
    yield from look(run, seen)


def _in_legs(run: Trajectory, legs: Sequence[tuple[System, Record]]) -> Iterator[Finding]:
    """Find the same in the first leg that has such passages: with these, the rest of a run is not to be trusted."""
    from orbits.propagation.checks.unresolved_passages import MOST_JUDGED

    left = MOST_JUDGED
    for number, (bodies, record) in enumerate(legs, 1):
        seen = Seen(bodies, record, run.clock)
        leg = LegOfRun(bodies, run.integrator, run.clock, run.excursions, observed_until(run), left)
        found = list(_of_passages(leg, seen))
        left -= len(seen.errors)
        if found:
            later = AS_IF_UNCHANGED + " Passages in later legs were not judged." * (number < len(legs))
            yield from (*found[:-1], replace(found[-1], remedy=found[-1].remedy + later))
            return
        if left <= 0:
            yield Finding(
                f"bodies change in this run, and of the close passages between changes {MOST_JUDGED:,} were judged: "
                "none of these spoilt it, but there may be others. Leave dt out: steps are then chosen one by one.",
                StepWarning,
                "passages not judged",
            )
            return
