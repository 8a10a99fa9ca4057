"""The motion of massive bodies within recorded steps: dense output."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from orbits.integrators.forms import Array, Form
from orbits.kernels.dense import motion_within
from orbits.marching.partial_steps import PartialSteps


class Motion:
    """The motion of n massive bodies within consecutive steps of a march.

    form : the form that took the steps
    times : (steps + 1,), at which they begin and the last one ends, since the start of the run
    lengths : (steps,), which late in a run have more digits than the differences of the times
    path : (steps + 1, 2, padded), q and v at these times, all x first; kicks : (steps, rows, 8), the carry after each,
        or none for a method without a polynomial through its stages
    partial : takes partial steps where no polynomial resolves the motion

    The arrays may be those of the march, which its next block overwrites.
    """

    def __init__(
        self, form: Form, times: Array, lengths: Array, path: Array, kicks: Array, partial: PartialSteps
    ) -> None:
        self._form, self._partial = form, partial
        self._lengths = lengths
        self.times, self.path, self.kicks = times, path, kicks

    def __len__(self) -> int:
        """Return the number of steps."""
        return len(self.times) - 1

    def at(self, steps: ArrayLike, fractions: ArrayLike) -> tuple[Array, Array]:
        """Return q and v, (m, n, 3), at fractions of steps, both (m,).

        They are as good as partial steps of the method: from the polynomial through the forces at the stages where it
        leaves no more than 2e-14 of the position of a body and 1e-12 of its velocity, otherwise from partial steps.
        Raises an IntegrationError if a partial step fails.
        """
        which: NDArray[np.int64] = np.ascontiguousarray(steps, dtype=np.int64)
        parts: Array = np.ascontiguousarray(fractions, dtype=np.float64)
        q, v = np.empty((2, len(which), self._partial.size))
        done = np.zeros(len(which), dtype=bool)
        if len(self.kicks):
            coefficients: Any = self._form.coefficients(1.0, 1.0)
            motion_within(
                self._form.tag, coefficients, self._lengths, self.path, self.kicks, which, parts, q, v, done
            )
        if not done.all():
            missing, lengths = ~done, parts * self._lengths[which]
            self._partial.take(self.path, which, self.times[which], lengths, missing, q, v)
        shape = (len(which), 3, -1)
        return q.reshape(shape).transpose(0, 2, 1), v.reshape(shape).transpose(0, 2, 1)
