"""What observes: each kind of instrument for itself, and several kinds together."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Instrument(Protocol):
    """What m observations are of; days : when light or echo was received, since the epoch, (m,)."""

    days: Array

    def seen(self, q: Array, v: Array, delay: Array) -> Any:
        """Return what is computed, with its `delay`, for a body that is at q, v so many days before each time."""

    def residuals(self, seen: Any) -> Array:
        """Return measured less computed, (m, 2): arcseconds, or microseconds or Hz and 0."""

    def derivatives(self, seen: Any, of_state: Array) -> Array:
        """Return the derivatives of what is computed, (m, 2, n), by what the states depend on, (m, 6, n)."""


class Seen(NamedTuple):
    """What several instruments compute; delay : days, (m,)."""

    delay: Array
    each: list[Any]


class Together:
    """Several instruments; rows : the numbers of the observations of each."""

    def __init__(self, instruments: Sequence[Instrument], rows: Sequence[NDArray[np.intp]]) -> None:
        self.parts = tuple(zip(instruments, rows, strict=True))
        self.days = self._joined([one.days for one in instruments])

    def seen(self, q: Array, v: Array, delay: Array) -> Seen:
        """As an Instrument."""
        each = [one.seen(q[rows], v[rows], delay[rows]) for one, rows in self.parts]
        return Seen(self._joined([x.delay for x in each]), each)

    def residuals(self, seen: Seen) -> Array:
        """As an Instrument."""
        return self._joined([one.residuals(x) for (one, _), x in zip(self.parts, seen.each, strict=True)])

    def derivatives(self, seen: Seen, of_state: Array) -> Array:
        """As an Instrument."""
        pairs = zip(self.parts, seen.each, strict=True)
        return self._joined([one.derivatives(x, of_state[rows]) for (one, rows), x in pairs])

    def _joined(self, each: Sequence[Array]) -> Array:
        rows = np.concatenate([rows for _, rows in self.parts])
        return np.asarray(np.concatenate(each)[np.argsort(rows)])
