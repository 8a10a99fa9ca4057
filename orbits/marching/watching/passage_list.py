"""The list of the passages of a march: those listed by the kernels in each block, filtered, sorted and bounded."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbits.errors import InputError
from orbits.integrators.forms import Array
from orbits.kernels.search.apsides import apsides_of
from orbits.kernels.search.record import ABOUT, COLUMNS, FASTEST2, LEAST2, MATE, ROW, STATE, STEP, WHEN
from orbits.marching.clocks.clock import Clock

BLOCK_ROOM = 8192
"""The most passages that are listed in a block, by all calls of kernels together. Each call has room for all of them,
so that the list does not depend on the number of threads."""

ROOM, ROOM_PER_BODY = 256, 2
"""The number of passages of each kind, revolutions and flybys, that are kept: those of the largest angle in a step."""

PENDING_BLOCKS = 64
"""The most blocks whose passages wait to be merged with the list: that takes the longer the longer the list is."""

UNKNOWN = -1
"""The number of passages left out of a list that begins in the middle of a march."""


class BlockList(NamedTuple):
    """A kernel's list of the passages of a block, (BLOCK_ROOM, COLUMNS), and how many it listed and found."""

    passages: Array
    listed: NDArray[np.int64]

    @classmethod
    def empty(cls, listed: NDArray[np.int64]) -> BlockList:
        """Return an empty list, whose counts are in `listed`."""
        return cls(np.empty((BLOCK_ROOM, COLUMNS)), listed)


class Kept(NamedTuple):
    """What a list had at a time: its passages in the order of time, how many were left out, and those of the last
    blocks as kernels listed them.
    """

    passages: Array
    left_out: int
    pending: tuple[Array, ...]


class PassageList:
    """The passages of a march so far; `add` replaces arrays and never changes them.

    gm : (rows,), of the massive bodies, then of the massless particles
    dominant : the row of the body that dominates the others, or -1
    passage_angle : angle of a step above which revolutions are listed
    clock : of the march; steps and times in the list are its readings

    Revolutions of a moon are kept only if a step covers more than `passage_angle`; flybys and pericentres about the
    dominant body are always kept. If there are more than there is room for, those with the largest speed / distance of
    each kind are kept, however the march was divided into blocks.
    """

    def __init__(self, gm: Array, dominant: int, passage_angle: float, clock: Clock) -> None:
        rate = clock.rate(passage_angle)
        self._gm, self._dominant, self._rate2, self._clock = gm, dominant, rate * rate, clock
        self._room = ROOM + ROOM_PER_BODY * len(gm)
        self._known = Kept(np.empty((0, COLUMNS)), 0, ())

    @property
    def passages(self) -> Array:
        """The passages so far, in the order of time, (passages, COLUMNS)."""
        self._merge()
        return self._known.passages

    @property
    def left_out(self) -> int:
        """How many passages were found for which there is no room; -1 if that is not known."""
        self._merge()
        return self._known.left_out

    def keep(self) -> Kept:
        """Return what is in the list now, for `put_back`."""
        return self._known

    def put_back(self, kept: Kept) -> None:
        """Return to what was in the list before."""
        self._known = kept

    def add(self, blocks: list[BlockList]) -> None:
        """Add the lists of a block and empty them; passages that did not fit into them are counted."""
        new, missed = [], 0
        for passages, listed in blocks:
            if listed[1]:
                new.append(passages[: listed[0]].copy())
                missed += int(listed[1] - listed[0])
                listed[:] = 0
        if not new:
            return
        passages, left_out, pending = self._known
        self._known = Kept(passages, _more(left_out, missed), (*pending, *new))
        if len(pending) >= PENDING_BLOCKS or 2 * sum(map(len, self._known.pending)) > self._room:
            self._merge()

    def _merge(self) -> None:
        """Merge the passages of the last blocks with the list, but for slow revolutions, and leave out those for which
        there is no room.
        """
        passages, left_out, pending = self._known
        if not pending:
            return
        new = np.concatenate(pending)
        # The kernel has already chosen among those by the dominant body.
        listed = self._is_central(new) | self._is_fast(new)
        if not listed.all():
            listed[~listed] = ~self._is_revolution(new[~listed])
        known = kept = np.concatenate([passages, new[listed]])
        if len(known) > self._room:
            revolution = self._is_revolution(known)
            kept = np.concatenate([self._worst(known[kind]) for kind in (revolution, ~revolution)])
        in_order = kept[np.lexsort((kept[:, MATE], kept[:, ROW], np.abs(kept[:, WHEN])))]
        self._known = Kept(in_order, _more(left_out, len(known) - len(kept)), ())

    @staticmethod
    def overflows(blocks: list[BlockList]) -> bool:
        """Return whether a block had more passages than could be listed."""
        noted = seen = 0
        for _, listed in blocks:
            noted += int(listed[0])
            seen += int(listed[1])
        return seen > min(BLOCK_ROOM, noted)

    def checkpoint(self) -> dict[str, NDArray[np.generic]]:
        """Return the list as arrays of a fixed shape; {} for a march that began without one."""
        if self.left_out == UNKNOWN:
            return {}
        passages, padded = self.passages, np.zeros((2 * self._room, COLUMNS))
        padded[: len(passages)] = passages
        return {"passages": padded, "passage_counts": np.array([len(passages), self.left_out], dtype=np.int64)}

    def restore(self, checkpoint: Mapping[str, NDArray[np.generic]]) -> None:
        """Restore a checkpoint; those of earlier versions have no list. Raises InputError for an invalid list."""
        if "passages" not in checkpoint:
            self._known = Kept(np.empty((0, COLUMNS)), UNKNOWN, ())
            return
        count, left_out = (int(x) for x in checkpoint["passage_counts"])
        passages, steps = np.array(checkpoint["passages"][: max(count, 0)], dtype=np.float64), checkpoint["counts"][0]
        bodies, when, step = passages[:, [ROW, MATE]], passages[:, WHEN], passages[:, STEP]
        fits = count == len(passages) and left_out >= UNKNOWN and bool(np.isfinite(passages).all())
        fits = fits and bool(((bodies == np.floor(bodies)) & (bodies >= 0) & (bodies < len(self._gm))).all())
        fits = fits and self._clock.are_readings(step, when, int(steps))
        if not fits or (passages[:, [LEAST2, FASTEST2]] < 0.0).any():
            raise InputError("the list of passages in its checkpoint has impossible bodies, steps or numbers.")
        self._known = Kept(passages, left_out, ())

    def _is_revolution(self, passages: Array) -> NDArray[np.bool_]:
        """Return which passages are of two bound bodies: about the dominant body, or on an ellipse within its Hill
        sphere.
        """
        row, mate = passages[:, ROW].astype(np.intp), passages[:, MATE].astype(np.intp)
        state, about = passages[:, STATE : STATE + 6], passages[:, ABOUT : ABOUT + 6]
        orbit = apsides_of(state[:, :3], state[:, 3:], self._gm[row] + self._gm[mate])
        bound = orbit.inverse_a > 0.0
        with np.errstate(all="ignore"):
            if self._dominant < 0:
                return np.asarray(bound)
            lighter = self._gm[row] <= self._gm[mate]
            heavier = np.where(lighter[:, None], about - state, about)[:, :3]
            share = np.maximum(self._gm[row], self._gm[mate]) / (3.0 * self._gm[self._dominant])
            stays = bound & (orbit.largest < np.linalg.norm(heavier, axis=1) * np.cbrt(share))
        return np.asarray(stays | self._is_central(passages))

    def _is_central(self, passages: Array) -> NDArray[np.bool_]:
        return np.asarray((passages[:, ROW] == self._dominant) | (passages[:, MATE] == self._dominant))

    def _is_fast(self, passages: Array) -> NDArray[np.bool_]:
        return np.asarray(passages[:, FASTEST2] > self._rate2 * passages[:, LEAST2])

    def _worst(self, passages: Array) -> Array:
        if len(passages) <= self._room:
            return passages
        with np.errstate(all="ignore"):
            rate = passages[:, FASTEST2] / passages[:, LEAST2]
        order = np.lexsort((passages[:, MATE], passages[:, ROW], np.abs(passages[:, WHEN]), -rate))
        return passages[order[: self._room]]


def _more(left_out: int, missed: int) -> int:
    return left_out if left_out == UNKNOWN else left_out + missed
