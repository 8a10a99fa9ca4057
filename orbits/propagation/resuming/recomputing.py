"""Marching an archived run again, and comparing every bit with what the archive has."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from orbits.errors import ArchiveError, Interrupted, StorageError
from orbits.integrators.forms import Array
from orbits.marching.legs.excursions.chosen_steps import COUNTS as EXCURSIONS
from orbits.propagation.control.signals import StopRequest
from orbits.propagation.control.stop_conditions import Conditions
from orbits.propagation.loop import Run, march_into
from orbits.propagation.resuming.from_checkpoint import last_sample, taken_up
from orbits.propagation.run_ends import RunEnds
from orbits.time_grid import TimeGrid
from orbits.trajectory.archived import made_by
from orbits.trajectory.changes import COUNTS as CHANGES

if TYPE_CHECKING:
    from orbits.archive import Archive
    from orbits.propagation.events.base import Sought


MARCHED = ("q", "q_lo", "v", "v_lo", "memory")
"""The arrays of a checkpoint from which a march goes on; those of massless particles have a prefix."""

PARTICLES = "particle_"


@dataclass
class Compared:
    """What came of it.

    first : the first sample that was marched to; samples : how many were compared; steps : those that were taken
    differing : the first sample of which a bit differs, and the name of the first body there; None if none does
    largest : the largest difference of a position, as a fraction of the largest distance from the origin there
    checkpoint : whether the state at the end is that of the last checkpoint; None if the march does not end there
    """

    first: int
    samples: int = 0
    steps: int = 0
    differing: tuple[int, str] | None = None
    largest: float = 0.0
    checkpoint: bool | None = None

    @property
    def same(self) -> bool:
        """Whether all bits that were compared are the same."""
        return self.differing is None and self.checkpoint is not False


def recomputed(
    archive: Archive, *, whole: bool, events: Sought | Sequence[Sought], threads: int | None, progress: bool | None
) -> Compared | None:
    """March the run in an archive again, and compare samples and the state at the end, bit for bit.

    whole : from the start; otherwise from the last checkpoint but one

    None if there is nothing to march. Raises ArchiveError or InputError for a run that cannot be marched here, what a
    run that fails raises, and Interrupted.
    """
    last, before = archive.checkpoint(), None if whole else archive.before()
    grid = _grid_of(archive)
    place = None if before is None or not before[1]["counts"].any() else (before[1], before[0].samples)
    if grid is None or (place is not None and int(place[0]["counts"][0]) == int(last["counts"][0])):
        return None
    first = 0 if place is None else place[1]
    if first == len(grid.goals):
        return None  # the bodies came back to a map at the last sample
    marcher, seeking, accounts = taken_up(archive, grid, place, events, exactly=True, threads=threads)
    watch = RunEnds(archive.system, marcher, Conditions(()), None, False, seeking, last_sample(archive, first))
    integrator, begun = made_by(archive)[0], marcher.step
    run = Run(archive.system, integrator, marcher, grid, first, lambda: None, progress, watch, accounts)
    comparing = _Comparing(archive, first)
    with StopRequest() as stop:
        march_into(run, comparing, stop, run.bar("verifying"))
    if stop.name:
        raise Interrupted(f"stopped by {stop.name}; not all of {archive.path} was computed again.")
    found = comparing.found
    found.steps = marcher.step - begun
    if _place(comparing.last) == _place(last):
        found.checkpoint = _same_state(comparing.last, last)
    return found


def _place(checkpoint: Mapping[str, NDArray[Any]]) -> list[int]:
    """Return where the march of a checkpoint is: its steps, whether its bodies are away from a map, their changes, and
    how many particles are retired, which is decided before a step.
    """
    known = (checkpoint.get(name) for name in ("counts", EXCURSIONS, CHANGES))
    retired = int(checkpoint["retired"][:, 0].astype(bool).sum()) if "retired" in checkpoint else 0
    return [*(int(counts[0]) for counts in known if counts is not None), retired]


def _grid_of(archive: Archive) -> TimeGrid | None:
    """Return the steps and the samples of a run up to its last checkpoint; None if that is the start."""
    times, end, clock = archive.times[: archive.committed], archive.marched, archive.grid.clock
    if clock.changes:  # a step that ends as much as a rounding error behind its goal is not taken
        end += 2.0 * float(np.spacing(end))
    if not len(times):
        return TimeGrid(clock, np.array([end])) if archive.marched else None
    beyond = (end - times[-1]) * clock.direction > 0.0
    return TimeGrid(clock, times, end if beyond else float(times[-1]))


class _Comparing:
    """What takes the samples of a march, in the place of an archive, and compares them with those of an archive."""

    def __init__(self, archive: Archive, first: int) -> None:
        self._archive, self._next = archive, first
        self.found = Compared(first)
        self.last: Mapping[str, NDArray[Any]] = {}

    def commit(self, q: Array, v: Array, checkpoint: Mapping[str, NDArray[Any]]) -> None:
        """Compare the next samples."""
        self.last = checkpoint
        first, end = self._next, min(self._next + len(q), self._archive.committed)
        self._next = end
        for k in range(first, end):
            try:
                known = self._archive.q[k], self._archive.v[k]
            except (ArchiveError, StorageError):
                continue  # damaged, as its checksum tells
            mine = q[k - first], v[k - first]
            self.found.samples += 1
            unlike = np.asarray(~(_same(mine[0], known[0]) & _same(mine[1], known[1])).all(axis=1))
            if unlike.any():
                self._note(k, unlike, mine[0], known[0])

    def _note(self, sample: int, unlike: NDArray[np.bool_], mine: Array, known: Array) -> None:
        if self.found.differing is None:
            self.found.differing = sample, self._archive.system.names[int(unlike.argmax())]
        apart, reach = np.abs(mine - known), np.nanmax(np.linalg.norm(known, axis=1))
        self.found.largest = max(self.found.largest, float(np.nanmax(apart, initial=0.0) / reach))


def _same(one: NDArray[Any], other: NDArray[Any]) -> NDArray[np.bool_]:
    """Return where two arrays have the same bits, or no number both."""
    if one.dtype != np.float64 or other.dtype != np.float64:
        return np.asarray(one == other)
    bits = (np.ascontiguousarray(x).view(np.int64) for x in (one, other))
    return np.asarray(np.equal(*bits) | (np.isnan(one) & np.isnan(other)))


def _same_state(one: Mapping[str, NDArray[Any]], other: Mapping[str, NDArray[Any]]) -> bool:
    """Return whether two checkpoints have the same state of the march."""
    names = [prefix + name for prefix in ("", PARTICLES) for name in MARCHED]
    return all(bool(_same(one[name], other[name]).all()) for name in names if name in one and name in other)
