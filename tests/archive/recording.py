"""Record every write of a run and play any part of it back into a file."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from orbits.archive import Archive, ArchiveWriter
from orbits.archive.storage import Storage
from orbits.errors import ArchiveError

from . import runs


@dataclass
class Recording:
    """The writes to the file, in order.

    writes : (offset, bytes), or (size, None) where the size of the file was set
    acknowledged : for each commit that returned, the number of writes up to then
    barriers : after how many writes the device was waited for
    created : how many writes there were when the file took its name
    """

    writes: list[tuple[int, bytes | None]] = field(default_factory=list)
    acknowledged: list[int] = field(default_factory=list)
    barriers: list[int] = field(default_factory=list)
    created: int = 0

    def image(self, kept: Iterator[int] | range, start: bytes = b"") -> bytes:
        """Return the file after these writes."""
        data = bytearray(start)
        for k in kept:
            offset, content = self.writes[k]
            if content is None:
                data[offset:] = bytes(max(0, offset - len(data)))
            else:
                apply(data, offset, content)
        return bytes(data)


def apply(data: bytearray, offset: int, content: bytes) -> None:
    data.extend(bytes(max(0, offset + len(content) - len(data))))
    data[offset : offset + len(content)] = content


def record(path: Path, chunks: list[int], monkeypatch: pytest.MonkeyPatch) -> Recording:
    """Create an archive and commit `chunks` samples at a time (0: a checkpoint alone), recording every write."""
    recording = Recording()
    real_write, real_resize, real_sync = Storage._write_some, Storage.resize, Storage.sync

    def resize(self: Storage, size: int) -> None:
        recording.writes.append((size, None))
        real_resize(self, size)

    def write(self: Storage, offset: int, data: memoryview) -> int:
        count = real_write(self, offset, data)
        recording.writes.append((offset, bytes(data[:count])))
        return count

    def sync(self: Storage) -> None:
        real_sync(self)
        recording.barriers.append(len(recording.writes))

    with monkeypatch.context() as patch:
        patch.setattr(Storage, "resize", resize)
        patch.setattr(Storage, "_write_some", write)
        patch.setattr(Storage, "sync", sync)
        q, v = runs.samples(sum(chunks))
        with runs.create(path, sum(chunks)) as writer:
            recording.created = len(recording.writes)
            done = 0
            for number, count in enumerate(chunks, start=1):
                writer.commit(q[done : done + count], v[done : done + count], runs.checkpoint(number))
                recording.acknowledged.append(len(recording.writes))
                done += count
    assert recording.image(range(len(recording.writes))) == path.read_bytes(), "the recording misses something"
    return recording


def trouble(path: Path, image: bytes, chunks: list[int], promised: int) -> str | None:
    """Return the fault of a file after a stop, or None.

    promised : commits that had returned, or -1 before the file took its name. The file must open with these or more,
    hold exactly what they held, and go on to a whole run from there; or refuse in words where nothing was promised.
    """
    path.write_bytes(image)
    q, v = runs.samples(sum(chunks))
    try:
        with Archive.open(path) as archive:
            # The first commit, at creation, is the start.
            commits, done = archive.last.sequence - 1, archive.committed
            if commits < promised:
                return f"{commits} commits, {promised} were promised"
            if done != sum(chunks[:commits]) or archive.complete != (done == sum(chunks)):
                return f"{done} samples after commit {commits}"
            if not (np.array_equal(archive.q, q[:done]) and np.array_equal(archive.v, v[:done])):
                return "wrong samples"
            if not runs.same_checkpoint(archive.checkpoint(), runs.checkpoint(commits)):
                return "wrong checkpoint"
            archive.verify()
        with ArchiveWriter.reopen(path) as writer:
            for number, count in enumerate(chunks[commits:], start=commits + 1):
                first = writer.committed
                writer.commit(q[first : first + count], v[first : first + count], runs.checkpoint(number))
        runs.assert_whole(path, sum(chunks))
    except ArchiveError as error:
        return str(error) if promised >= 0 else None
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    return None


def promised(recording: Recording, done: int) -> int:
    """Return the number of commits that had returned after `done` writes; -1 before the file took its name."""
    return -1 if done < recording.created else sum(done >= end for end in recording.acknowledged)
