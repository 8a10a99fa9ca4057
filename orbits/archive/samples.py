"""Samples in a file that behave like an array of shape (samples, bodies, 3), and are read on demand."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbits.archive.chunks import Chunks
from orbits.archive.schema import Place
from orbits.archive.storage import Storage, raw_bytes

Floats = NDArray[np.float64]


class Samples:
    """The committed rows of /q or /v: `samples[10:20]`, `samples[:, massive]`, `samples[-1, 3]` as in NumPy.

    Every access reads from the file into a new array, so the memory is bounded by that of one access. Raises
    ArchiveError if the checksum of a chunk that is read does not match.
    """

    dtype = np.dtype(np.float64)
    ndim = 3

    def __init__(self, storage: Storage, place: Place, chunks: Chunks) -> None:
        self._storage = storage
        self._chunks = chunks
        self._offset = place.offset
        self._row = place.shape[1] * 24
        self.shape = (chunks.samples, *place.shape[1:])

    def __len__(self) -> int:
        return self.shape[0]

    @property
    def size(self) -> int:
        """Number of floats."""
        return self.shape[0] * self.shape[1] * self.shape[2]

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        if copy is False:
            raise ValueError("samples in a file have to be read into a new array; copy=False cannot be had")
        return np.asarray(self[:], dtype=dtype)

    def __getitem__(self, key: Any) -> Any:
        index = key if isinstance(key, tuple) else (key,)
        if any(k is Ellipsis for k in index):
            at = next(i for i, k in enumerate(index) if k is Ellipsis)
            missing = self.ndim - (len(index) - 1)
            index = (*index[:at], *[slice(None)] * missing, *index[at + 1 :])
        index = (*index, *[slice(None)] * (2 - len(index)))
        if any(k is None or np.ndim(k) > 1 for k in index):
            return self._read(np.arange(len(self)), 0, self.shape[1])[key]
        samples, in_samples = _narrowed(index[0], len(self))
        bodies, in_bodies = _narrowed(index[1], self.shape[1])
        first, end = (int(bodies[0]), int(bodies[-1]) + 1) if len(bodies) else (0, 0)
        data = self._read(samples, first, end)
        return data[(in_samples(samples), in_bodies(np.arange(first, end)), *index[2:])]

    def __reduce__(self) -> Any:
        """Copy and pickle as an array."""
        return np.array, (self[:],)

    def mapped(self) -> Floats:
        """Return all samples, checked, as a read-only array that the operating system reads on demand."""
        if not self.size:
            return np.empty(self.shape)
        self._chunks.check(np.arange(len(self)))
        with os.fdopen(os.dup(self._storage.fileno()), "rb") as file:
            pages = np.memmap(file, dtype="<f8", mode="r", offset=self._offset, shape=self.shape)
        return pages.view(np.ndarray)

    def _read(self, samples: NDArray[np.intp], first: int, end: int) -> Floats:
        """Read bodies first ... end - 1 of these samples, which must be in ascending order."""
        out = np.empty((len(samples), end - first, 3), dtype="<f8")
        if out.size:
            self._chunks.check(samples)
            whole_rows = end - first == self.shape[1]
            breaks = np.flatnonzero(np.diff(samples) != 1) + 1 if whole_rows else np.arange(1, len(samples))
            for run_start, run_end in zip([0, *breaks], [*breaks, len(samples)], strict=True):
                offset = self._offset + int(samples[run_start]) * self._row + first * 24
                self._storage.read_into(raw_bytes(out[run_start:run_end]), offset)
        return np.asarray(out, dtype=np.float64)


def _narrowed(key: Any, length: int) -> tuple[NDArray[np.intp], Callable[[NDArray[np.intp]], Any]]:
    """Return which rows of `length` a key asks for, ascending, and how to index an array of ascending rows with it."""
    asked = np.arange(length)[key]
    if np.ndim(asked) == 0:
        return np.atleast_1d(asked), lambda rows: int(np.searchsorted(rows, asked))
    needed = np.unique(asked)
    if not isinstance(key, slice):
        return needed, lambda rows: np.searchsorted(rows, asked)
    backwards = len(asked) > 1 and asked[1] < asked[0]

    def within(rows: NDArray[np.intp]) -> slice:
        step = int(abs(asked[1] - asked[0])) if len(asked) > 1 and len(rows) != len(needed) else 1
        return slice(None, None, -step if backwards else step)

    return needed, within
