"""Storage for the samples of a run: in memory, or chunk by chunk in an archive with regular commits."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from orbits.archive.ended import ENDED, Ended
from orbits.archive.pace import PACE, Pace
from orbits.errors import ArchiveError, InputError
from orbits.integrators.forms import Array
from orbits.kernels.gravity.terms_and_forces import FIGURES
from orbits.marching.legs.march import March
from orbits.propagation.checks.available_memory import MEMORY_SHARE, memory

if TYPE_CHECKING:
    from orbits.archive import Archive, ArchiveWriter
    from orbits.propagation.events.seeking import Seeking
    from orbits.propagation.resuming.step_store import StepStore


CHUNK_BYTES = 16 * 1024 * 1024
"""Samples kept in memory before they are written."""

COMMIT_SECONDS = 10.0
"""The longest time between commits of an archive, and so the most that is lost when a machine fails."""

FIRST_COMMIT_SECONDS = 0.25
"""Time from the start of a run into an archive to its first commit."""

ACCOUNTS = "accounts"
"""The array of a checkpoint with the time integrals of the forces up to each sample."""

COMMIT_SHARE = 0.25
"""Commits become rarer during a run, up to `COMMIT_SECONDS`: a failing machine loses this share of the computation."""


class SampleStore:
    """Collects samples and passes them to an archive chunk by chunk, or keeps them all if there is none.

    bodies : number of bodies in each sample; room : number of samples to expect
    accounts : (samples, forces, 7 + most internal variables), work, torque and impulse of forces up to each sample of
        the run, and their internal variables there, known up to the next sample
    events : those that are sought; steps : what keeps the steps of the run for dense output, or None
    pace : when the run was begun or resumed, and where; None to commit nothing of it

    ended : how the run ended, for the last commit
    """

    def __init__(
        self,
        bodies: int,
        room: int,
        writer: ArchiveWriter | None,
        accounts: Array,
        events: Seeking,
        steps: StepStore | None = None,
        pace: Pace | None = None,
    ) -> None:
        self._writer, self._accounts, self._events, self.steps = writer, accounts, events, steps
        self._pace, self.ended = pace, Ended()
        self._next = len(accounts) - room
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
        """Whether a commit is needed before the next sample: one is due soon after the start, and then more and more
        rarely, but before samples, or steps kept for dense output, fill their memory.
        """
        if self._writer is None:
            return False
        if self._count == len(self._q) or (self.steps is not None and self.steps.full):
            return True
        elapsed = self._committed_at - self._begun
        pause = min(COMMIT_SECONDS, max(FIRST_COMMIT_SECONDS, COMMIT_SHARE * elapsed))
        return time.perf_counter() - self._committed_at > pause

    @property
    def room(self) -> int:
        """The most samples that can be added before a commit."""
        return len(self._q) - self._count

    def add(self, q: Array, v: Array, accounts: Array) -> None:
        """Add samples: q and v, each (m, n, 3), and the time integrals of the forces up to them, and their internal
        variables there.
        """
        count = len(q)
        self._accounts[self._next : self._next + count] = accounts
        self._q[self._count : self._count + count], self._v[self._count : self._count + count] = q, v
        self._count += count
        self._next += count

    def commit(self, marcher: March) -> None:
        """Write all samples so far, and the state to continue from, durably to the archive."""
        if self._writer is not None:
            self._events.complete()
            pace = None if self._pace is None else self._pace.now(marcher.time)
            checkpoint = checkpoint_of(marcher, self._accounts, self._events, pace, self.ended)
            new = self._q[: self._count], self._v[: self._count], checkpoint
            if self.steps is None:
                self._writer.commit(*new)
            else:
                self._writer.commit(*new, self.steps.kept.pieces())
                self.steps.kept.clear()
            self._count = 0
            self._committed_at = time.perf_counter()

    def arrays(self) -> tuple[Array, Array, Array]:
        """Return q, v and the accounts of the samples in memory."""
        return self._q[: self._count], self._v[: self._count], self._accounts[: self._next]


def checkpoint_of(
    marcher: March, accounts: Array, events: Seeking, pace: Pace | None, ended: Ended | None = None
) -> dict[str, NDArray[np.generic]]:
    """Return the state from which to resume, with the time integrals of forces, if any, up to each sample, with the
    events found so far, with its pace, if it is given, and with how the run ended, if it did.
    """
    known: dict[str, NDArray[np.generic]] = {ENDED: (Ended() if ended is None else ended).encoded()}
    known |= {} if pace is None else {PACE: pace.encoded()}
    known |= {ACCOUNTS: accounts.copy()} if accounts.size else {}
    return {**marcher.checkpoint(), **known, **events.checkpoint()}


def no_accounts(samples: int, forces: int, inner: int = 0) -> Array:
    """Return zeros, (samples, forces, 7 + inner), for the time integrals of the forces up to each sample.

    inner : the most internal variables of a force
    """
    return np.zeros((samples, forces, FIGURES + inner))


def accounts_in(archive: Archive, samples: int, forces: int, inner: int = 0) -> Array:
    """Return what `no_accounts` has room for, up to each committed sample of an archive, with room for all samples.

    Raises ArchiveError if its checkpoint does not have them.
    """
    out = no_accounts(samples, forces, inner)
    if forces:
        found = archive.checkpoint().get(ACCOUNTS, np.zeros(0))
        fits = found.shape[1:] == out.shape[1:] and len(found) >= archive.committed and found.dtype == out.dtype
        if not fits or not np.isfinite(found).all():
            raise ArchiveError(f"{archive.path} is damaged: its checkpoint does not tell what forces did in the run.")
        out[: archive.committed] = found[: archive.committed]
    return out
