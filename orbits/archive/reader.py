"""Reading an archive: only committed data, checked when read."""

from __future__ import annotations

import os
import zlib
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from orbits.archive import schema
from orbits.archive.chunks import Chunks, samples_crc, whole_chunks
from orbits.archive.commits import CHUNK, ROW, ROW_BYTES, SLOTS, Commit, decoded
from orbits.archive.creation import busy
from orbits.archive.ended import Ended, ended_in
from orbits.archive.header import Header
from orbits.archive.origin import Origin
from orbits.archive.pace import Pace, pace_in
from orbits.archive.samples import Samples
from orbits.archive.schema import Layout
from orbits.archive.steps import KEPT, ArchivedSteps
from orbits.archive.storage import Storage, raw_bytes
from orbits.errors import ArchiveError
from orbits.marching.clocks import variable_steps
from orbits.time_grid import TimeGrid

if TYPE_CHECKING:
    from orbits.system import System

Checkpoint = dict[str, NDArray[Any]]

# A checkpoint may change while it is read, if a run commits at the same time: it is then read again.
_ATTEMPTS = 20


class _DamageError(Exception):
    """A checksum that does not match; the caller makes the error message."""


class Archive:
    """A finished, interrupted or still growing run in a file, in its state when the file was opened.

    `Archive.open(path)` opens one, and raises ArchiveError for a file that cannot be read. Close it, or use it in a
    `with` statement, to release the file.

    times : (n,) float64, since the epoch; all requested samples, of which `committed` are stored
    q, v : (committed, bodies, 3) float64, read when indexed, and checked when first read
    steps : the states at the beginnings of steps, for dense output (see `orbits.archive.steps`), or None
    dt : the signed step; grid : step and times together

    All of these are in the units of `system`, the state at the start.
    """

    def __init__(
        self,
        storage: Storage,
        path: Path,
        header: Header,
        layout: Layout,
        chunks: Chunks,
        checkpoint: Checkpoint | None,
        commit: Commit | None,
    ) -> None:
        encoded = None if checkpoint is None else checkpoint.pop(KEPT, None)
        self._storage = storage
        self._header = header
        self._chunks = chunks
        self._checkpoint = checkpoint
        self._commit = commit
        self.path = path
        self.layout = layout
        self.committed = chunks.samples
        self.q = Samples(storage, layout.q, chunks)
        self.v = Samples(storage, layout.v, chunks)
        self.steps = None if layout.steps is None or encoded is None else ArchivedSteps(storage, layout.steps, encoded)

    @classmethod
    def open(cls, path: str | os.PathLike[str], *, salvage: bool = False) -> Self:
        """Open the archive at `path` after its last commit, checking header, last chunk and checkpoint.

        salvage : read the undamaged part of a damaged file; such a run cannot be resumed
        Raises ArchiveError for a file that is missing, empty, foreign, newer, truncated or damaged, and for one without
        any commit; StorageError if the device cannot be read.
        """
        place = schema.resolved(path)
        storage = opened(place, os.O_RDONLY)
        try:
            return cls._of(storage, place, salvage=salvage)
        except BaseException:
            storage.close()
            raise

    @classmethod
    def claim(cls, path: str | os.PathLike[str]) -> Self:
        """Open the archive at `path` to continue it: it is locked for other writers until it is closed or released.

        All of its samples are checked. Raises ArchiveError as `open` does, for any damage, and if another run is
        writing the file.
        """
        place = schema.resolved(path)
        storage = opened(place, os.O_RDWR)
        try:
            if not storage.lock():
                raise busy(place)
            # The contents are read from here on, under the lock: no other process can add to them.
            archive = cls._of(storage, place)
            archive.verify()
            return archive
        except BaseException:
            storage.close()
            raise

    @classmethod
    def after(cls, storage: Storage, path: Path, header: Header, layout: Layout, commit: Commit) -> Self:
        """Return the archive of an open file in its state after a commit; later writes are not visible.

        Raises ArchiveError if it is damaged.
        """
        try:
            return cls(storage, path, header, layout, *_checked(storage, path, layout, commit), commit)
        except _DamageError as damage:
            raise _damaged(path, damage) from None

    @classmethod
    def _of(cls, storage: Storage, path: Path, *, salvage: bool = False) -> Self:
        header, layout = schema.read(storage, path)
        if not storage.is_at(path):
            raise ArchiveError(f"{path} was replaced by another file while it was opened; open it again.")
        if salvage:
            chunks = Chunks(storage, path, layout, whole_chunks(storage, layout))
            return cls(storage, path, header, layout, chunks, None, None)
        for _ in range(_ATTEMPTS):
            commit = _last_commit(storage, layout)
            if commit is None:
                raise ArchiveError(
                    f"{path} holds no commit that is whole, so there is nothing to resume. Restore it from a copy, "
                    "read what is whole with orbits.Archive.open(path, salvage=True), or start the run again with "
                    "overwrite=True."
                )
            try:
                return cls(storage, path, header, layout, *_checked(storage, path, layout, commit), commit)
            except _DamageError as damage:
                found = damage
                if _last_commit(storage, layout) == commit:
                    break
        raise _damaged(path, found)

    @property
    def system(self) -> System:
        """The System at the start of the run, equal to the original."""
        return self._header.system

    @property
    def integrator(self) -> Mapping[str, Any]:
        """{"name": ..., "parameters": {...}}, as from `orbits.integrators.describe`."""
        return self._header.integrator

    @property
    def grid(self) -> TimeGrid:
        """The step and the samples of the run, including future ones."""
        return self._header.grid

    @property
    def dt(self) -> float:
        """The step in the system's unit of time, as at creation."""
        return self.grid.h

    @property
    def times(self) -> NDArray[np.float64]:
        """Times of all samples of the run, including future ones, since the epoch in the system's unit of time."""
        return self.grid.times

    @property
    def provenance(self) -> Mapping[str, str]:
        """Versions and processor of the run."""
        return MappingProxyType(dict(self._header.provenance))

    @property
    def certificate_text(self) -> str:
        """The certificate measured before the run, as JSON; "" without one."""
        return self._header.certificate

    @property
    def events_text(self) -> str:
        """What was sought in the run, as JSON; "" without events."""
        return self._header.events

    @property
    def origin(self) -> Origin | None:
        """The scenario that the run was made by, with its options; None for one without options, and other runs."""
        return self._header.origin

    @property
    def approaches(self) -> bool:
        """Whether closest approaches are recorded."""
        return self._header.approaches

    @property
    def energy_bound(self) -> float:
        """The relative energy error that ends the run; infinite without one."""
        return self._header.energy_bound

    @property
    def complete(self) -> bool:
        """Whether all samples of the run are stored, and the run came to its end."""
        return self.committed == len(self.times) and (self.ended.finished or not self.grid.goes_on)

    @property
    def ended(self) -> Ended:
        """How the run ended, if it did."""
        return ended_in(self._checkpoint)

    @property
    def pace(self) -> Pace:
        """How fast the run went up to its last commit."""
        return pace_in(self._checkpoint)

    @property
    def writer(self) -> int | None:
        """The number of the process that writes the file at this moment: -1 for one of which only the lock is seen, as
        one on another machine; None if nothing writes it. The file is not locked to find out.
        """
        return self._storage.writer

    @property
    def reached(self) -> float:
        """The time that the run has reached, since the epoch; in a salvaged file that of the last sample."""
        last = float(self.times[self.committed - 1]) if self.committed else 0.0
        known = [last, *_reading(self._checkpoint, self.grid)]
        if self.ended.time is not None:
            known.append(self.ended.time)
        furthest = max(known, key=lambda time: time * self.grid.direction)
        following = float(self.grid.goals[min(self.committed, len(self.grid.goals) - 1)])
        return min(furthest, following, key=lambda time: time * self.grid.direction)

    @property
    def marched(self) -> float:
        """The time of the march at the last checkpoint: that of the end of a step, before the next sample."""
        return next(iter(_reading(self._checkpoint, self.grid)), 0.0)

    def checkpoint(self) -> Checkpoint:
        """Return the state from which to resume, committed with the last sample. Raises ArchiveError if salvaged."""
        if self._checkpoint is None:
            raise ArchiveError(f"{self.path} was opened to salvage its samples; it cannot be resumed.")
        return {name: array.copy() for name, array in self._checkpoint.items()}

    def verify(self) -> None:
        """Read and check all committed data. Raises ArchiveError, naming the damaged samples."""
        self._chunks.check_all()
        if self.steps is not None:
            self.steps.check_all()

    def damaged(self) -> list[tuple[int, int]]:
        """Return the first and the last sample of each stretch of committed samples that do not hold their checksums,
        or cannot be read.
        """
        return self._chunks.damaged()

    def before(self) -> tuple[Commit, Checkpoint] | None:
        """Return the last commit but one with its checkpoint, if they are whole, and the last one is the last still."""
        last, slot = self.last, self.last.sequence % SLOTS
        row = self._storage.read(self.layout.commits.offset + slot * ROW.itemsize, ROW_BYTES)
        commit = decoded(row, slot)
        if commit is None or commit.sequence != last.sequence - 1:
            return None
        checkpoint, crc = _checkpoint_in(self._storage, self.layout, slot)
        checkpoint.pop(KEPT, None)
        return (commit, checkpoint) if crc == commit.checkpoint_crc else None

    @property
    def chunks(self) -> NDArray[Any]:
        """The committed rows of the table of chunks."""
        return self._chunks.table.copy()

    @property
    def last(self) -> Commit:
        """The last commit when the file was opened. Raises ArchiveError if salvaged."""
        if self._commit is None:
            raise ArchiveError(f"{self.path} was opened to salvage its samples; it cannot be resumed.")
        return self._commit

    def parts(self) -> tuple[Storage, Header, Layout]:
        """Return the parts that a writer needs: the open file, the header, and the layout of the arrays."""
        return self._storage, self._header, self.layout

    def release(self) -> None:
        """Unlock the file for other writers; it stays open for reading."""
        self._storage.unlock()

    def close(self) -> None:
        """Close the file; data already read stay usable."""
        self._storage.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def __repr__(self) -> str:
        state = "complete" if self.complete else "not complete"
        return f"<Archive {self.path}: {self.committed} of {len(self.times)} samples, {state}>"


def _reading(checkpoint: Checkpoint | None, grid: TimeGrid) -> list[float]:
    """Return the time of a march at its checkpoint, if that is one of a run."""
    name, place = ("clock", variable_steps.TIME) if grid.clock.changes else ("counts", 0)
    array = None if checkpoint is None else checkpoint.get(name)
    if array is None or array.ndim != 1 or len(array) <= place or not np.isfinite(array[place]):
        return []
    return [float(array[place]) if grid.clock.changes else float(grid.clock.time(float(array[place])))]


def opened(path: Path, flags: int) -> Storage:
    """Open an existing file. Raises ArchiveError if it is missing or cannot be opened."""
    if os.path.isdir(path):
        raise ArchiveError(f"{path} is a folder; expected an archive that orbits.propagate(archive=...) wrote.")
    try:
        storage = Storage(path, flags | getattr(os, "O_NONBLOCK", 0))
    except FileNotFoundError as error:
        raise ArchiveError(f"{path} does not exist; expected an archive. Check the name and the folder.") from error
    except OSError as error:
        raise ArchiveError(f"{path} cannot be opened ({error.strerror}); check its permissions.") from error
    except ValueError as error:
        raise ArchiveError(f"{str(path)!r} is not a path ({error}).") from error
    if not os.path.isfile(path):
        storage.close()
        raise ArchiveError(f"{path} is not a file; expected an archive that orbits.propagate(archive=...) wrote.")
    return storage


def _last_commit(storage: Storage, layout: Layout) -> Commit | None:
    rows = (storage.read(layout.commits.offset + slot * ROW.itemsize, ROW_BYTES) for slot in range(SLOTS))
    commits = [commit for slot, row in enumerate(rows) if (commit := decoded(row, slot)) is not None]
    return max(commits, key=lambda commit: commit.sequence, default=None)


def _damaged(path: Path, found: _DamageError) -> ArchiveError:
    return ArchiveError(
        f"{path} is damaged: {found}. Restore it from a copy, or read what is whole with "
        "orbits.Archive.open(path, salvage=True)."
    )


def _checked(storage: Storage, path: Path, layout: Layout, commit: Commit) -> tuple[Chunks, Checkpoint]:
    """Return chunks and checkpoint of a commit; raise _DamageError if they are damaged."""
    capacity = layout.q.shape[0]
    if commit.chunks > capacity or commit.samples > capacity:
        raise _DamageError(f"commit {commit.sequence} claims {commit.samples} samples where {capacity} have room")
    table = storage.read(layout.chunks.offset, commit.chunks * CHUNK.itemsize)
    if zlib.crc32(table) != commit.chunks_crc:
        raise _DamageError("the table of chunks does not hold its checksum")
    rows = np.frombuffer(bytes(table), dtype=CHUNK)
    ends = [0, *rows["samples"].tolist()]
    if ends[-1] != commit.samples or any(first >= end for first, end in pairwise(ends)):
        raise _DamageError(f"the table of chunks is not one of {commit.samples} samples")
    chunks = Chunks(storage, path, layout, rows)
    checkpoint, checkpoint_crc = _checkpoint_in(storage, layout, commit.slot)
    if checkpoint_crc != commit.checkpoint_crc:
        raise _DamageError("the checkpoint does not hold its checksum")
    if len(ends) > 1:
        first, end = ends[-2:]
        if samples_crc(storage, layout, first, end) != int(rows["crc"][-1]):
            raise _DamageError(f"samples {first} to {end - 1} do not hold their checksum")
    return chunks, checkpoint


def _checkpoint_in(storage: Storage, layout: Layout, slot: int) -> tuple[Checkpoint, int]:
    """Return the checkpoint in a slot, and its CRC-32."""
    checkpoint: Checkpoint = {}
    crc = 0
    for name, place in layout.checkpoints[slot].items():
        array = np.empty(place.shape, dtype=place.dtype)
        if place.size:
            storage.read_into(raw_bytes(array), place.offset)
            crc = zlib.crc32(raw_bytes(array), crc)
        checkpoint[name] = array
    return checkpoint, crc
