"""The motion of massive bodies within recorded steps: dense output."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from orbits.integrators.forms import Array, Form
from orbits.kernels.dense import motion_within


class Motion:
    """The motion of n massive bodies within consecutive steps of a march.

    form : the form that took the steps
    times : (steps + 1,), at which they begin and the last one ends, since the start of the run
    path : (steps + 1, 2, padded), q and v at these times, all x first; kicks : (steps, rows, 8), the carry after each

    The arrays may be those of the march, which its next block overwrites.
    """

    def __init__(self, form: Form, n: int, times: Array, path: Array, kicks: Array) -> None:
        self._form, self._n = form, n
        self._coefficients: Any = form.coefficients(1.0, 1.0)
        self.times, self.path, self.kicks = times, path, kicks

    def __len__(self) -> int:
        """Return the number of steps."""
        return len(self.times) - 1

    def at(self, steps: ArrayLike, fractions: ArrayLike) -> tuple[Array, Array]:
        """Return q and v, (m, n, 3), at fractions of steps, both (m,)."""
        which: NDArray[np.int64] = np.ascontiguousarray(steps, dtype=np.int64)
        parts: Array = np.ascontiguousarray(fractions, dtype=np.float64)
        q, v = np.empty((2, len(which), 3 * self._n))
        arrays = (self.times, self.path, self.kicks, which, parts, q, v)
        motion_within(self._form.tag, self._coefficients, *arrays)
        shape = (len(which), 3, self._n)
        return q.reshape(shape).transpose(0, 2, 1), v.reshape(shape).transpose(0, 2, 1)
