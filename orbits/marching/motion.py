"""The motion of massive bodies within recorded steps: dense output."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from orbits.integrators.forms import Array, Form
from orbits.kernels.dense import motion_within
from orbits.marching.partial_steps import PartialSteps


class Motion:
    """The motion of n massive bodies within consecutive steps of a march.

    form : the form that took the steps
    begun, after : the time at which the first step begins, since the start of the run, and the times after that,
        (steps + 1,), at which the steps begin and the last one ends
    path : (steps + 1, 2, padded), q and v at these times, all x first; kicks : (steps, rows, 8), the carry after each,
        or none for a method without a polynomial through its stages
    partial : takes partial steps where no polynomial resolves the motion

    times : (steps + 1,), at which the steps begin and the last one ends, since the start of the run
    The arrays may be those of the march, which its next block overwrites.
    """

    def __init__(
        self, form: Form, begun: float, after: Array, path: Array, kicks: Array, partial: PartialSteps
    ) -> None:
        self._form, self._partial = form, partial
        self._lengths = np.diff(after)
        self.times, self.path, self.kicks = begun + after, path, kicks

    def __len__(self) -> int:
        """Return the number of steps."""
        return len(self.times) - 1

    @classmethod
    def joined(cls, parts: Sequence[Motion]) -> Motion:
        """Return the motion within all steps of consecutive parts of a march, as copies."""
        one, last = parts[0], parts[-1]
        path = np.concatenate([*(part.path[:-1] for part in parts), last.path[-1:]])
        kicks = np.concatenate([part.kicks for part in parts])
        whole = cls(one._form, 0.0, np.zeros(1), path, kicks, one._partial)
        whole._lengths = np.concatenate([part._lengths for part in parts])
        whole.times = np.concatenate([*(part.times[:-1] for part in parts), last.times[-1:]])
        return whole

    def at(self, steps: ArrayLike, fractions: ArrayLike) -> tuple[Array, Array]:
        """Return q and v, (m, n, 3), at fractions of steps, both (m,).

        They are as good as partial steps of the method: from the polynomial through the forces at the stages where it
        leaves no more than 2e-14 of the position of a body and 1e-12 of its velocity, otherwise from partial steps.
        Raises an IntegrationError if a partial step fails.
        """
        return self._within(steps, fractions, False)

    def roughly_at(self, steps: ArrayLike, fractions: ArrayLike) -> tuple[Array, Array]:
        """Return what `at` returns from the polynomial of each step, or for a method without one from the cubic through
        the states at its ends: cheap, to see where something happens.
        """
        if len(self.kicks):
            return self._within(steps, fractions, True)
        k, x = np.asarray(steps, dtype=np.int64), np.asarray(fractions, dtype=np.float64)[:, None]
        h = self._lengths[k][:, None]
        path = self.path[:, :, : self._partial.size]
        (q, v), (q1, v1) = path[k].swapaxes(0, 1), path[k + 1].swapaxes(0, 1)
        way, slope, slope1 = q1 - q, h * v, h * v1
        bend, twist = 3.0 * way - 2.0 * slope - slope1, slope + slope1 - 2.0 * way
        found = q + x * (slope + x * (bend + x * twist)), v + x * (2.0 * bend + 3.0 * x * twist) / h
        return self._shaped(*found)

    def _shaped(self, q: Array, v: Array) -> tuple[Array, Array]:
        shape = (len(q), 3, -1)
        return q.reshape(shape).transpose(0, 2, 1), v.reshape(shape).transpose(0, 2, 1)

    def _within(self, steps: ArrayLike, fractions: ArrayLike, rough: bool) -> tuple[Array, Array]:
        which: NDArray[np.int64] = np.ascontiguousarray(steps, dtype=np.int64)
        parts: Array = np.ascontiguousarray(fractions, dtype=np.float64)
        q, v = np.empty((2, len(which), self._partial.size))
        done = np.full(len(which), rough)
        if len(self.kicks):
            coefficients: Any = self._form.coefficients(1.0, 1.0)
            motion_within(
                self._form.tag, coefficients, self._lengths, self.path, self.kicks, which, parts, q, v, done
            )
        if not done.all():
            missing, lengths = ~done, parts * self._lengths[which]
            self._partial.take(self.path, which, self.times[which], lengths, missing, q, v)
        return self._shaped(q, v)
