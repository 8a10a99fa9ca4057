"""Storage for the samples of a run: in memory, or chunk by chunk in an archive with regular commits."""

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
"""The longest time between commits of an archive, and so the most that is lost when a machine fails."""

FIRST_COMMIT_SECONDS = 0.25
"""Time from the start of a run into an archive to its first commit."""

COMMIT_SHARE = 0.25
"""Commits become rarer during a run, up to `COMMIT_SECONDS`: a failing machine loses this share of the computation."""


class SampleStore:
    """Collects samples and passes them to an archive chunk by chunk, or keeps them all if there is none.

    bodies : number of bodies in each sample; room : number of samples to expect
    """

    def __init__(self, bodies: int, room: int, writer: ArchiveWriter | None) -> None:
        self._writer = writer
        if writer is not None:
            room = min(room, max(1, CHUNK_BYTES // (48 * bodies)))
        needed = 48 * room * bodies
        if needed > MEMORY_SHARE * memory():
            raise InputError(
                f"{room} samples of {bodies} bodies need {needed / 2**30:.1f} GiB of memory, more than this machine "
                "has available; take fewer samples, or use archive=... to write them to a file during the run"
            )
        self._q = np.empty((room, bodies, 3))
        self._v = np.empty((room, bodies, 3))
        self._count = 0
        self._begun = self._committed_at = time.perf_counter()

    @property
    def full(self) -> bool:
        """Whether a commit is needed before the next sample."""
        return self._writer is not None and (self._count == len(self._q) or self.overdue)

    @property
    def overdue(self) -> bool:
        """Whether the archive is due for a commit: soon after the start, and then more and more rarely."""
        if self._writer is None:
            return False
        elapsed = self._committed_at - self._begun
        pause = min(COMMIT_SECONDS, max(FIRST_COMMIT_SECONDS, COMMIT_SHARE * elapsed))
        return time.perf_counter() - self._committed_at > pause

    def add(self, q: Array, v: Array) -> None:
        """Add a sample."""
        self._q[self._count], self._v[self._count] = q, v
        self._count += 1

    def commit(self, marcher: Marcher) -> None:
        """Write all samples so far, and the state to continue from, durably to the archive."""
        if self._writer is not None:
            self._writer.commit(self._q[: self._count], self._v[: self._count], marcher.checkpoint())
            self._count = 0
            self._committed_at = time.perf_counter()

    def arrays(self) -> tuple[Array, Array]:
        """Return q and v of the samples in memory."""
        return self._q[: self._count], self._v[: self._count]
