"""The passages that a march has recorded, of a run."""

from __future__ import annotations

from typing import TYPE_CHECKING

from orbits.errors import ArchiveError
from orbits.propagation.marchers import bound, restore, unchanged
from orbits.results.passages import Seen

if TYPE_CHECKING:
    from orbits.marching.legs.record import Record
    from orbits.trajectory import Trajectory


def observed_until(run: Trajectory) -> float:
    """Return the time up to which the passages of a run are known: its end, or where it was stopped."""
    return run._reached if run.complete or run._has_stopped else run._last_time


def passages_of(run: Trajectory) -> Seen:
    """Return the passages of a run: those on record, or those of its last checkpoint and from there to its end."""
    record = _recorded(run) if run._record is None else run._record
    return Seen(run.system, record, run.clock)


def _recorded(run: Trajectory) -> Record:
    archive = run.archive
    if archive is None:
        assert run._ended is not None
        path, (approaches, known) = "this run", run._ended
        checkpoint = known()
    else:
        path, approaches, checkpoint = str(archive.path), archive.approaches, archive.checkpoint()
    marcher = bound(run.system, run.integrator, run.clock, threads=1, approaches=approaches)
    restore(marcher, unchanged(checkpoint), path)
    if archive is not None and marcher.step > run.clock.most_steps(archive.grid.end):
        raise ArchiveError(
            f"{path} is damaged: its checkpoint is at step {marcher.step}, which lies behind the end of the run. "
            "Restore it from a copy."
        )
    return marcher.record(observed_until(run))
