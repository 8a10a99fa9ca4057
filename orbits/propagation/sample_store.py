"""Where the samples of a run are kept: in memory, or chunk by chunk in an archive, committed now and then."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from orbits.errors import InputError
from orbits.propagation.available_memory import MEMORY_SHARE, memory

if TYPE_CHECKING:
    from orbits.archive import ArchiveWriter
    from orbits.marching.marcher import Marcher

Array = NDArray[np.float64]

CHUNK_BYTES = 16 * 1024 * 1024
"""Samples kept in memory before they are written."""

COMMIT_SECONDS = 10.0
"""An archive is committed at least this often: a lost machine costs no more than this."""

FIRST_COMMIT_SECONDS = 0.25
"""How long a run into an archive marches before its first commit after the start."""

COMMIT_SHARE = 0.25
"""Commits grow rarer with a run, up to `COMMIT_SECONDS`: a lost machine costs this share of what was computed."""


class SampleStore:
    """Collects samples; hands them to the archive chunk by chunk, or keeps them all when there is none.

    bodies : in each sample; room : how many samples are to come
    """

    def __init__(self, bodies: int, room: int, writer: ArchiveWriter | None) -> None:
        self._writer = writer
        if writer is not None:
            room = min(room, max(1, CHUNK_BYTES // (48 * bodies)))
        needed = 48 * room * bodies
        if needed > MEMORY_SHARE * memory():
            raise InputError(
                f"{room} samples of {bodies} bodies need {needed / 2**30:.1f} GiB of memory, more than this machine "
                "has to give; take fewer samples, or give archive=... to write them to a file as they come"
            )
        self._q = np.empty((room, bodies, 3))
        self._v = np.empty((room, bodies, 3))
        self._count = 0
        self._begun = self._committed_at = time.perf_counter()

    @property
    def full(self) -> bool:
        """Whether there is no room for another sample before a commit."""
        return self._writer is not None and (self._count == len(self._q) or self.overdue)

    @property
    def overdue(self) -> bool:
        """Whether the archive should be brought up to date: soon after the start, and then ever more rarely."""
        if self._writer is None:
            return False
        elapsed = self._committed_at - self._begun
        pause = min(COMMIT_SECONDS, max(FIRST_COMMIT_SECONDS, COMMIT_SHARE * elapsed))
        return time.perf_counter() - self._committed_at > pause

    def add(self, q: Array, v: Array) -> None:
        """Take one more sample."""
        self._q[self._count], self._v[self._count] = q, v
        self._count += 1

    def commit(self, marcher: Marcher) -> None:
        """Make everything taken so far durable, together with the state to go on from."""
        if self._writer is not None:
            self._writer.commit(self._q[: self._count], self._v[: self._count], marcher.checkpoint())
            self._count = 0
            self._committed_at = time.perf_counter()

    def arrays(self) -> tuple[Array, Array]:
        """Return what was kept."""
        return self._q[: self._count], self._v[: self._count]
