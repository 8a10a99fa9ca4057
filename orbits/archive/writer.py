"""Writing an archive so that it survives being stopped anywhere.

Creation happens under another name and ends in a rename. After it a commit writes, in this order: the new samples and
their row in the table of chunks, the checkpoint into the slot that the last commit did not use; then waits until the
device has them; then the commit row; then waits again. Whatever part of this has happened when the machine stops, the
row of the last finished commit and all that it stands for are whole.
"""

from __future__ import annotations

import os
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from orbits.archive import schema
from orbits.archive.commits import CHUNK, ROW, Commit
from orbits.archive.creation import built, busy, check_target, discarded_on_failure, partial_path, take_name
from orbits.archive.header import Header
from orbits.archive.reader import Archive, Checkpoint, opened
from orbits.archive.schema import Layout
from orbits.archive.storage import BLOCK, Storage, raw_bytes
from orbits.errors import ArchiveError, StorageError
from orbits.system import System


class ArchiveWriter:
    """An archive that grows, commit by commit. Made by `create`, `reopen` or `extended`; close it when done.

    path : where it is
    committed : samples that are safe; capacity : samples that there is room for
    """

    def __init__(self, storage: Storage, path: Path, layout: Layout, commit: Commit) -> None:
        self._storage = storage
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
        dt: float,
        times: ArrayLike,
        checkpoint: Mapping[str, NDArray[Any]],
        provenance: Mapping[str, str],
        certificate: str = "",
        overwrite: bool = False,
    ) -> Self:
        """Create the file, with all of its room on the device, ready for the first commit.

        integrator : {"name": ..., "parameters": {...}}; dt : the step, in the system's unit of time
        times : (samples,) times of all samples to come, in the same unit; fixes the room
        checkpoint : arrays of the names, shapes and types that commits will have; their values are not stored yet
        provenance : versions and processor, as words
        certificate : what was measured of the integrator before the run, as JSON
        overwrite : whether a file at `path` may be replaced; it stays until the new one is whole

        Raises ArchiveError for a path that exists, or that cannot be written, or that another run is writing;
        StorageError, naming what is needed and what is free, where the device has no room.
        """
        times = np.array(times, dtype=np.float64)
        if times.ndim != 1 or not times.size or not np.isfinite(times).all():
            raise ArchiveError(f"times have shape {times.shape}; expected at least one time, all finite.")
        header = Header(system, dict(integrator), float(dt), times, dict(provenance), certificate)
        place = schema.resolved(path)
        check_target(place, overwrite)
        storage, layout = built(place, header, checkpoint)
        with discarded_on_failure(storage, partial_path(place)):
            take_name(storage, place, overwrite)
        return cls(storage, place, layout, Commit(0, 0, 0, 0, 0))

    @classmethod
    def reopen(cls, path: str | os.PathLike[str]) -> Self:
        """Open an archive to go on after its last commit.

        Raises ArchiveError as `Archive.open` does, and where another run is writing the file.
        """
        place = schema.resolved(path)
        storage, archive = _opened_for_writing(place)
        return cls(storage, place, archive.layout, _commit_of(archive))

    @property
    def committed(self) -> int:
        """Samples that are safe in the file."""
        return self._last.samples

    def commit(self, q: ArrayLike, v: ArrayLike, checkpoint: Mapping[str, NDArray[Any]]) -> None:
        """Add the next k samples, k >= 0, and the state to go on from; on return they survive any stop.

        q, v : (k, bodies, 3) float64; checkpoint : names, shapes and types as at creation
        Raises ArchiveError for what does not fit, StorageError where the device does not take it: all that was
        committed before stays readable then, and `reopen` goes on from there.
        """
        q_new, v_new = (np.ascontiguousarray(x, dtype="<f8") for x in (q, v))
        self._check(q_new, v_new, checkpoint)
        self._unsure = True
        try:
            commit = self._write_contents(q_new, v_new, checkpoint)
            self._storage.sync()
            self._write_row(commit)
            self._storage.sync()
        except OSError as error:
            raise StorageError(
                f"{self.path} could not be written ({error.strerror}); its {self.committed} committed samples stay "
                "readable. Make room or mend the device, then go on with orbits.resume."
            ) from error
        self._last, self._unsure = commit, False

    def close(self) -> None:
        """Give the file back. Nothing is pending: what was committed is safe, the rest was never promised."""
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

    def _write_contents(self, q: NDArray[Any], v: NDArray[Any], checkpoint: Mapping[str, NDArray[Any]]) -> Commit:
        """Write all that the next commit row will stand for, where no earlier row stands for anything."""
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


def extended(path: str | os.PathLike[str], times: ArrayLike) -> ArchiveWriter:
    """Make room for more samples: copy the archive into a larger one, put it in its place, and open it to go on.

    times : (samples,) times of all samples, those that are there first and unchanged
    The copy is checked chunk by chunk; the old file stays until the new one is whole.
    Raises ArchiveError where `times` does not go on from the samples that are there, and as `reopen`; StorageError
    where the device has no room for both files.
    """
    times = np.array(times, dtype=np.float64)
    place = schema.resolved(path)
    source, archive = _opened_for_writing(place)
    try:
        done = archive.committed
        if times.ndim != 1 or len(times) < done or not np.array_equal(times[:done], archive.times[:done]):
            raise ArchiveError(
                f"the times of {place} cannot change: its {done} committed samples have to come first, as they are."
            )
        archive.verify()
        header = Header(
            archive.system, archive.integrator, archive.dt, times, archive.provenance, archive.certificate_text
        )
        checkpoint = archive.checkpoint()
        storage, layout = built(place, header, checkpoint)
        with discarded_on_failure(storage, partial_path(place)):
            writer = ArchiveWriter(storage, place, layout, Commit(0, 0, 0, 0, 0))
            _copy(archive, writer, checkpoint)
            take_name(storage, place, overwrite=True)
        return writer
    finally:
        source.close()


def _copy(archive: Archive, writer: ArchiveWriter, checkpoint: Checkpoint) -> None:
    """Commit all chunks of an archive to a new writer as they were, in blocks."""
    per_sample = 48 * archive.layout.q.shape[1]
    step = max(1, BLOCK // per_sample)
    for first in range(0, archive.committed, step):
        end = min(first + step, archive.committed)
        writer.commit(archive.q[first:end], archive.v[first:end], checkpoint)
    if not archive.committed:
        writer.commit(archive.q[:], archive.v[:], checkpoint)


def _opened_for_writing(path: Path) -> tuple[Storage, Archive]:
    storage = opened(path, os.O_RDWR)
    try:
        if not storage.lock():
            raise busy(path)
        return storage, Archive._of(storage, path)
    except BaseException:
        storage.close()
        raise


def _commit_of(archive: Archive) -> Commit:
    """Return the commit that an open archive stands at."""
    chunks = archive.chunks
    return Commit(archive.sequence, archive.committed, len(chunks), zlib.crc32(chunks.tobytes()), 0)


def _check_checkpoint(checkpoint: Mapping[str, NDArray[Any]], layout: Layout) -> None:
    places = layout.checkpoints[0]
    if set(checkpoint) != set(places):
        raise ArchiveError(f"the checkpoint has {sorted(checkpoint)}; expected {sorted(places)}, as at creation.")
    for name, place in places.items():
        array = np.asarray(checkpoint[name])
        if array.shape != place.shape or array.dtype != place.dtype:
            raise ArchiveError(
                f"checkpoint {name!r} is {array.dtype} of shape {array.shape}; expected {place.dtype} of shape "
                f"{place.shape}, as at creation."
            )
