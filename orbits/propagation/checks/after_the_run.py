"""What the caller should know of a run that is done: each check says what it found."""

from __future__ import annotations

from collections.abc import Iterator

from orbits.errors import EventWarning
from orbits.finding import Finding
from orbits.propagation.checks.precision import energy_lost
from orbits.propagation.checks.rigid_runs import is_rigid, overlaps
from orbits.propagation.resuming.marching_again import seen_by
from orbits.propagation.run_ends import RunEnds
from orbits.trajectory import Trajectory


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
    if trajectory._record is None:
        return
    if is_rigid(trajectory.system):
        yield from overlaps(trajectory, seen_by(trajectory))
    if len(trajectory._record.listed):
        from orbits.propagation.checks import kepler_splitting, unresolved_passages

        maps = trajectory.integrator.follows_kepler
        look = kepler_splitting.not_followed if maps else unresolved_passages.not_resolved
        yield from look(trajectory, seen_by(trajectory))
