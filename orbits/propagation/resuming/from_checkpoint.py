"""Going on with the run in an archive: its march from one of its checkpoints, or from the start."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np

from orbits.errors import ArchiveError
from orbits.marching.legs.march import March
from orbits.propagation.chain_of_legs import ChainOfLegs
from orbits.propagation.collisions.bodies_of_run import BodiesOfRun
from orbits.propagation.control.stop_conditions import Conditions
from orbits.propagation.events.archived import sought_again
from orbits.propagation.events.base import Sample, Sought
from orbits.propagation.events.seeking import Seeking
from orbits.propagation.march_of_run import march_of_run
from orbits.propagation.marchers import bound, restore
from orbits.propagation.resuming.sample_store import accounts_in
from orbits.system.model import most_inner
from orbits.time_grid import TimeGrid
from orbits.trajectory.archived import made_by
from orbits.trajectory.changes import CHANGES

if TYPE_CHECKING:
    from orbits.archive import Archive
    from orbits.trajectory import Trajectory


def taken_up(
    archive: Archive,
    grid: TimeGrid,
    place: tuple[dict[str, Any], int] | None,
    events: Sought | Sequence[Sought],
    conditions: Conditions | None = None,
    *,
    exactly: bool,
    threads: int | None,
) -> tuple[March, Seeking, Any]:
    """Return the march of an archived run, what it seeks, and the accounts of its forces.

    place : one of its checkpoints, with the number of samples before it; None for the start
    events, exactly : as in `resume`; conditions : that may end it
    """
    system, path, (integrator, _) = archive.system, archive.path, made_by(archive)
    seeking = sought_again(archive, events, path, exactly)
    marcher = march_of_run(system, integrator, grid.clock, threads, seeking, conditions, archive.approaches)
    accounts = accounts_in(archive, len(grid), len(system.forces), most_inner(system))
    if place is not None:
        checkpoint, committed = place
        restore(marcher, checkpoint, path)
        seeking.restore(checkpoint, path)
        marcher.follow_events()
        _check_place(marcher, grid, committed, path)
    return marcher, seeking, accounts


def march_at(run: Trajectory, checkpoint: dict[str, Any]) -> March:
    """Return the march of a run in an archive at one of its checkpoints, which seeks no events."""
    assert run.archive is not None
    system, integrator, clock, approaches = run.system, run.integrator, run.clock, run.archive.approaches
    marcher: March
    if CHANGES in checkpoint:
        bodies = BodiesOfRun(system, integrator, clock, None, None, False, approaches)
        marcher = ChainOfLegs(bodies, Seeking(system, [], clock.direction), room=len(checkpoint[CHANGES]))
    else:
        marcher = bound(system, integrator, clock, approaches=approaches)
    restore(marcher, checkpoint, run.archive.path)
    return marcher


def last_sample(archive: Archive, committed: int) -> Sample | None:
    """Return the last of the first samples in an archive, if there is one."""
    if not committed:
        return None
    k = committed - 1
    return Sample(float(archive.times[k]), np.array(archive.q[k]), np.array(archive.v[k]))


def _check_place(marcher: March, grid: TimeGrid, committed: int, path: str | PathLike[str]) -> None:
    """Refuse a checkpoint that does not lie between the last stored sample and the next one."""
    following = float(grid.goals[committed])
    # A chosen step of an excursion may begin more than a step of the map before a sample that lies in it.
    last = int(grid.steps[committed - 1]) if committed and marcher.current.leg is marcher.home else 0
    possible = last <= marcher.step <= grid.clock.most_steps(following)
    if not possible or not (following - marcher.time) * grid.direction >= 0.0:
        raise ArchiveError(
            f"{path} is damaged: its checkpoint is at step {marcher.step}, t = {marcher.time:.10g}; expected step "
            f"{last} or a later one, before the next sample at t = {following:.10g}. Restore it from a copy."
        )
