"""What a march has recorded of the passages of a run."""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from orbits.errors import ArchiveError, IntegrationError
from orbits.kernels.search.record import DISTANCE2, STEP, TIME, WHEN
from orbits.marching.planet_excursions import LeavingMarcher
from orbits.propagation.marchers import bound, restore, unchanged
from orbits.results.passages import Record, Seen

if TYPE_CHECKING:
    from orbits.marching.marcher import Marcher
    from orbits.trajectory import Trajectory

Array = NDArray[np.float64]


def record_of(marcher: Marcher, end: float) -> Record:
    """Return the record of a marcher so far, including the rest of the run up to its end: the march goes on to the
    last whole step before it; if steps differ, it ends there, and cannot go on.
    """
    with suppress(IntegrationError):  # where the run itself failed
        if not marcher.clock.changes and abs(end) > abs(marcher.time):  # it was stopped behind its last sample
            marcher.advance_to(marcher.clock.place(end))
    dominant, reaches, step = marcher.dominant, marcher.reaches.copy(), marcher.reading
    if isinstance(marcher, LeavingMarcher) and marcher.is_away:
        return Record(*marcher.record_at(end), dominant, reaches, step)
    if marcher.clock.changes:
        if (end - marcher.time) * marcher.clock.direction > 0.0:  # not where a condition ended it later
            with suppress(IntegrationError):  # where the run itself failed
                marcher.end_at(end)
        return Record(_closest(marcher), *marcher.passages(), dominant, reaches, marcher.reading)
    closest, (listed, left_out) = _closest(marcher), marcher.passages()
    h = marcher.clock.h
    rest = end - marcher.clock.time(step)
    if not 0.0 < rest / h < 1.0:
        return Record(closest, listed, left_out, dominant, reaches, step)
    try:
        part = marcher.part_of_a_step(rest)
    except IntegrationError:  # where the run itself failed
        return Record(closest, listed, left_out, dominant, reaches, step)
    share = rest / h
    if closest is not None:
        later = part.approaches()
        later[TIME] = step + share * later[TIME]
        closest = np.where(later[DISTANCE2] < closest[DISTANCE2], later, closest)
    more = part.passages()[0].copy()
    more[:, STEP] = step
    more[:, WHEN] = step + share * more[:, WHEN]
    return Record(closest, np.concatenate([listed, more]), left_out, dominant, reaches, step)


def _closest(marcher: Marcher) -> Array | None:
    return marcher.approaches() if marcher.looks_for_approaches else None


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
        record = record_of(marcher, observed_until(trajectory))
    return Seen(trajectory.system, record, trajectory.clock)
