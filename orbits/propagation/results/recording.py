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


def passages_of(trajectory: Trajectory, record: Record | None) -> Seen:
    """Return the passages of a run; without `record`, those in the last checkpoint of its archive."""
    if record is None:
        assert trajectory.archive is not None
        how = trajectory.system, trajectory.integrator, trajectory.clock
        marcher = bound(*how, threads=1, approaches=trajectory.archive.approaches)
        restore(marcher, unchanged(trajectory.archive.checkpoint()), trajectory.archive.path)
        if not trajectory.clock.changes and marcher.step > trajectory.archive.grid.whole_steps:
            raise ArchiveError(
                f"{trajectory.archive.path} is damaged: its checkpoint is at step {marcher.step}, which lies "
                "behind the end of the run. Restore it from a copy."
            )
        record = marcher.record(observed_until(trajectory))
    return Seen(trajectory.system, record, trajectory.clock)
