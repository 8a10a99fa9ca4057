"""Writing an archive so that it survives an interruption at any point.

A file is created under a temporary name, with the start committed, and then renamed. A commit writes the new samples
and their row in the table of chunks, and the checkpoint into the slot that the last commit did not use; waits until
they have reached the device; writes the commit row; and waits again. If the machine stops at any point, the row of the
last finished commit and all data that it refers to are intact.
"""

from __future__ import annotations

import math
import os
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from orbits.archive import schema
from orbits.archive.commits import CHUNK, ROW, Commit
from orbits.archive.creation import built, check_target, discarded_on_failure, partial_path, take_name
from orbits.archive.header import Header
from orbits.archive.origin import Origin
from orbits.archive.reader import Archive
from orbits.archive.schema import Layout
from orbits.archive.steps import KEPT, ArchivedSteps, Kept, Piece, write_steps
from orbits.archive.storage import BLOCK, Storage, raw_bytes
from orbits.errors import ArchiveError, StorageError
from orbits.system import System
from orbits.time_grid import TimeGrid

SPARE, GROWTH = 1.1, 8.0
"""The room for steps in a larger file, as a multiple of those expected; and at most, of those to be stored."""


class ArchiveWriter:
    """An archive that grows by commits. Made by `create`, `reopen` or `extended`; close it at the end.

    path : its path
    committed : number of committed samples; capacity : number of samples that fit
    """

    def __init__(
        self, storage: Storage, path: Path, header: Header, layout: Layout, commit: Commit, kept: Kept | None = None
    ) -> None:
        self._storage, self._kept = storage, kept or Kept()
        self._header = header
        self._layout = layout
        self._last = commit
        self._unsure = False
        self.path = path
        self.capacity = layout.q.shape[0]

    @classmethod
    def create(
        cls,
        path: str | os.PathLike[str],
        *,
        system: System,
        integrator: Mapping[str, Any],
        grid: TimeGrid,
        checkpoint: Mapping[str, NDArray[Any]],
        provenance: Mapping[str, str],
        certificate: str = "",
        events: str = "",
        steps: int = 0,
        origin: Origin | None = None,
        approaches: bool = True,
        energy_bound: float = math.inf,
        overwrite: bool = False,
    ) -> Self:
        """Create the file, with all of its space reserved and the start of the run committed.

        integrator : {"name": ..., "parameters": {...}}
        grid : the step, and the times of all samples, in the system's unit of time; it determines the size of the file
        checkpoint : the initial state, which is committed before the file gets its name; all commits will have arrays
            of the same names, shapes and types
        provenance : versions and processor, as text
        certificate : the certificate measured before the run, as JSON
        events : what is sought in the run, as JSON
        steps : room for so many states at the beginnings of steps, for dense output; it grows as needed
        origin : the scenario with options that the run is made by
        approaches : whether closest approaches are recorded
        energy_bound : the relative energy error that ends the run, if there is one
        overwrite : whether a file at `path` may be replaced; it is kept until the new one is complete

        Raises ArchiveError for a path that exists, that cannot be written, or that another run is writing;
        StorageError, with the required and the free space, if the device has not enough.
        """
        described = system, dict(integrator), grid, dict(provenance), certificate, events
        header = Header(*described, steps, origin, approaches, energy_bound)
        place = schema.resolved(path)
        check_target(place, overwrite)
        nothing = np.empty((0, len(system), 3))
        with cls._made(place, header, checkpoint) as writer:
            writer._write(nothing, nothing, checkpoint)
            take_name(writer._storage, place, overwrite)
        return writer

    @classmethod
    def reopen(cls, path: str | os.PathLike[str]) -> Self:
        """Open an archive to continue after its last commit. Raises what `Archive.claim` raises."""
        return cls.going_on(Archive.claim(path))

    @classmethod
    def going_on(cls, archive: Archive) -> Self:
        """Continue after the last commit of a claimed archive, whose file is taken over by this writer."""
        storage, header, layout = archive.parts()
        kept = None if archive.steps is None else archive.steps.kept
        return cls(storage, archive.path, header, layout, archive.last, kept)

    @classmethod
    @contextmanager
    def _made(cls, path: Path, header: Header, checkpoint: Mapping[str, NDArray[Any]]) -> Iterator[Self]:
        """Create a file under a temporary name; it is removed if the block fails."""
        storage, layout = built(path, header, checkpoint)
        with discarded_on_failure(storage, partial_path(path)):
            try:
                yield cls(storage, path, header, layout, Commit(0, 0, 0, 0, 0))
            except OSError as error:
                raise StorageError(f"{path} could not be made ({error.strerror}); nothing was left behind.") from error

    @property
    def committed(self) -> int:
        """The number of committed samples in the file."""
        return self._last.samples

    def commit(
        self,
        q: ArrayLike,
        v: ArrayLike,
        checkpoint: Mapping[str, NDArray[Any]],
        steps: Iterable[Piece] = (),
    ) -> None:
        """Add the next k samples, k >= 0, and the state from which to resume; on return they survive any interruption.

        q, v : (k, bodies, 3) float64; checkpoint : names, shapes and types as at creation
        steps : for dense output, the states at the beginnings of the next steps: times (m, 2), q and v (m, bodies, 3).
            If there is no room for them, the archive is copied into a larger file, which then replaces it
        Raises ArchiveError for arrays of the wrong shape or type; StorageError if the device fails: all earlier commits
        then stay readable, and `reopen` continues from there. Raises StorageError also if the file was deleted, moved
        or replaced: the samples are then in it nevertheless, and `to_archive` reads them.
        """
        q_new, v_new = (np.ascontiguousarray(x, dtype="<f8") for x in (q, v))
        self._check(q_new, v_new, checkpoint)
        pieces = list(steps)
        self._make_room(pieces, checkpoint)
        try:
            self._write(q_new, v_new, checkpoint, pieces)
        except OSError as error:
            raise StorageError(
                f"{self.path} could not be written ({error.strerror}); its {self.committed} committed samples stay "
                "readable. Make room or mend the device, then go on with orbits.resume."
            ) from error
        if not self.in_place:
            raise StorageError(self._lost())

    @property
    def in_place(self) -> bool:
        """Return whether its path still refers to the file that is being written."""
        return self._storage.is_at(self.path)

    @property
    def size(self) -> int:
        """The size of the file in bytes, with the room for all samples."""
        return self._storage.size

    def has(self, name: str) -> bool:
        """Return whether the file has room for an array of a checkpoint, which one of an earlier version may lack."""
        return name in self._layout.checkpoints[0]

    def to_archive(self) -> Archive:
        """Stop writing, and return an archive of the committed data that reads through the same open file.

        Raises ArchiveError or StorageError if they cannot be read.
        """
        try:
            archive = Archive.after(self._storage, self.path, self._header, self._layout, self._last)
        except BaseException:
            self.close()
            raise
        archive.release()
        return archive

    def close(self) -> None:
        """Close the file. Committed data are safe; nothing else is pending."""
        self._storage.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def _check(self, q: NDArray[Any], v: NDArray[Any], checkpoint: Mapping[str, NDArray[Any]]) -> None:
        if self._unsure:
            raise ArchiveError(
                f"a commit to {self.path} did not finish, so this writer does not know how the file stands. "
                "Go on with ArchiveWriter.reopen(path)."
            )
        room = self.capacity - self.committed
        for name, array in (("q", q), ("v", v)):
            if array.ndim != 3 or array.shape[1:] != self._layout.q.shape[1:] or len(array) != len(q):
                raise ArchiveError(
                    f"{name} has shape {array.shape}; expected (k, {self._layout.q.shape[1]}, 3), as many for q as v."
                )
        if len(q) > room:
            raise ArchiveError(f"{len(q)} samples are too many: {self.path} has room for {room} more.")
        _check_checkpoint(checkpoint, self._layout)

    def _lost(self) -> str:
        if self._storage.deleted:
            return (
                f"{self.path} was deleted while the run was writing it. The {self.committed} samples are in the "
                "error's .trajectory until this process ends."
            )
        return (
            f"{self.path} was moved away, or another file took its place, while the run was writing it. Its "
            f"{self.committed} samples are in the error's .trajectory; where the file is now, orbits.resume goes on "
            "with it."
        )

    def _make_room(self, pieces: Sequence[Piece], checkpoint: Mapping[str, NDArray[Any]]) -> None:
        """If there is no room for these states, continue in a larger file."""
        needed = self._kept.rows + sum(len(times) for times, _, _ in pieces)
        places = self._layout.steps
        if places is None and pieces:
            raise ArchiveError(f"{self.path} was created without room for steps; it keeps samples only.")
        if places is None or needed <= places.room:
            return
        if not self.in_place:
            raise StorageError(self._lost())
        old = self._storage
        archive = Archive.after(old, self.path, self._header, self._layout, self._last)
        header = replace(self._header, steps=_room_for(needed, float(pieces[-1][0][-1, 0]), self._header.grid.end))
        with ArchiveWriter._made(self.path, header, checkpoint) as larger:
            _copy(archive, larger, archive.checkpoint())
            take_name(larger._storage, self.path, overwrite=True)
        self._storage, self._header, self._layout = larger._storage, header, larger._layout
        self._last, self._kept = larger._last, larger._kept
        old.close()

    def _write(
        self,
        q: NDArray[Any],
        v: NDArray[Any],
        checkpoint: Mapping[str, NDArray[Any]],
        steps: Iterable[Piece] = (),
    ) -> None:
        """Commit; the caller handles OSError, which leaves the file at the previous commit."""
        self._unsure = True
        kept = self._kept
        if self._layout.steps is not None:
            kept = write_steps(self._storage, self._layout.steps, kept, steps)
            checkpoint = {**checkpoint, KEPT: kept.encoded()}
        commit = self._write_contents(q, v, checkpoint)
        self._storage.sync()
        self._write_row(commit)
        self._storage.sync()
        self._last, self._kept, self._unsure = commit, kept, False

    def _write_contents(self, q: NDArray[Any], v: NDArray[Any], checkpoint: Mapping[str, NDArray[Any]]) -> Commit:
        """Write all data to which the next commit row will refer, without changing those of earlier rows."""
        last, layout = self._last, self._layout
        samples, chunks, chunks_crc = last.samples + len(q), last.chunks, last.chunks_crc
        if len(q):
            for place, array in ((layout.q, q), (layout.v, v)):
                self._storage.write(place.offset + last.samples * place.shape[1] * 24, raw_bytes(array))
            crc = zlib.crc32(raw_bytes(v), zlib.crc32(raw_bytes(q)))
            row = np.array((samples, crc), dtype=CHUNK).tobytes()
            self._storage.write(layout.chunks.offset + chunks * CHUNK.itemsize, row)
            chunks, chunks_crc = chunks + 1, zlib.crc32(row, chunks_crc)
        commit = Commit(last.sequence + 1, samples, chunks, chunks_crc, 0)
        checkpoint_crc = 0
        for name, place in layout.checkpoints[commit.slot].items():
            data = raw_bytes(np.ascontiguousarray(checkpoint[name], dtype=place.dtype))
            if place.size:
                self._storage.write(place.offset, data)
                checkpoint_crc = zlib.crc32(data, checkpoint_crc)
        return Commit(commit.sequence, samples, chunks, chunks_crc, checkpoint_crc)

    def _write_row(self, commit: Commit) -> None:
        self._storage.write(self._layout.commits.offset + commit.slot * ROW.itemsize, commit.encoded())


def _room_for(needed: int, reached: float, end: float) -> int:
    """Return the number of states to make room for, if `needed` lead up to the time `reached` of a run to `end`."""
    most = GROWTH * needed
    expected = SPARE * needed * end / reached if reached else most
    return int(min(max(expected, SPARE * needed), most)) + 1


def extended(archive: Archive, grid: TimeGrid, checkpoint: Mapping[str, NDArray[Any]] | None = None) -> ArchiveWriter:
    """Make room for more samples: copy the archive into a larger one, replace it, and continue with the copy.

    archive : from `Archive.claim`; it is closed afterwards, and its file is kept until the new one is complete
    grid : the unchanged step, and the times of all samples, starting with the existing ones
    checkpoint : the state from which to resume, with all arrays of later ones; by default that of the archive
    Raises ArchiveError if the grid does not continue the existing samples; StorageError if the device has not enough
    space for both files.
    """
    with archive:
        done, place = archive.committed, archive.path
        if grid.clock != archive.grid.clock or not np.array_equal(grid.times[:done], archive.times[:done]):
            raise ArchiveError(
                f"step and times of {place} cannot change: its {done} committed samples have to come first, as they "
                "are."
            )
        header = archive.parts()[1]
        if archive.steps is not None:
            header = replace(header, steps=_room_in(archive.steps, header, grid))
        header = replace(header, grid=grid)
        checkpoint = archive.checkpoint() if checkpoint is None else checkpoint
        with ArchiveWriter._made(place, header, checkpoint) as writer:
            _copy(archive, writer, checkpoint)
            if not archive.parts()[0].is_at(place):
                raise ArchiveError(f"{place} was replaced by another file while it was extended; nothing was changed.")
            take_name(writer._storage, place, overwrite=True)
        return writer


def _room_in(kept: ArchivedSteps, header: Header, grid: TimeGrid) -> int:
    """Return the number of steps to make room for in a run that is extended to another grid."""
    if not grid.clock.changes:
        return grid.whole_steps + 1
    return max(header.steps, _room_for(max(1, len(kept)), header.grid.end, grid.end))


def _copy(archive: Archive, writer: ArchiveWriter, checkpoint: Mapping[str, NDArray[Any]]) -> None:
    """Commit all chunks of an archive unchanged to a new writer, in blocks."""
    per_sample = 48 * archive.layout.q.shape[1]
    step, nothing = max(1, BLOCK // per_sample), archive.q[:0]
    if archive.steps is not None:
        writer._write(nothing, nothing, checkpoint, archive.steps.pieces())
    for first in range(0, max(1, archive.committed), step):
        end = min(first + step, archive.committed)
        writer._write(archive.q[first:end], archive.v[first:end], checkpoint)


def _check_checkpoint(checkpoint: Mapping[str, NDArray[Any]], layout: Layout) -> None:
    places = {name: place for name, place in layout.checkpoints[0].items() if name != KEPT}
    if set(checkpoint) != set(places):
        raise ArchiveError(f"the checkpoint has {sorted(checkpoint)}; expected {sorted(places)}, as at creation.")
    for name, place in places.items():
        array = np.asarray(checkpoint[name])
        if array.shape != place.shape or array.dtype != place.dtype:
            raise ArchiveError(
                f"checkpoint {name!r} is {array.dtype} of shape {array.shape}; expected {place.dtype} of shape "
                f"{place.shape}, as at creation."
            )
