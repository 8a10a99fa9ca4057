"""The motion of massive bodies within recorded steps: dense output."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from orbits.integrators.forms import Array, Form, padded
from orbits.kernels.dense import motion_at_checks, motion_within
from orbits.kernels.lanes import WIDTH
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

    def at_checks(self, steps: slice, checks: Array, bodies: NDArray[np.int64], rows: NDArray[np.int64], n: int) -> Any:
        """Return what `roughly_at` returns for some bodies at the same fractions of all of these steps.

        checks : (fractions,); bodies : their numbers; rows, n : their places among n bodies; nothing is written for others
        Returns q and v, (steps * fractions, n, 3), all fractions of a step in turn.
        """
        lengths = self._lengths[steps]
        count, each = len(lengths), len(checks)
        if not len(self.kicks):
            which = np.arange(len(self))[steps]
            found = self.roughly_at(np.repeat(which, each), np.tile(checks, count))
            q, v = np.empty((2, count * each, n, 3))
            q[:, rows], v[:, rows] = found[0][:, bodies], found[1][:, bodies]
            return q, v
        q, v = np.empty((2, 3 * n, count, each))
        axes, size = np.arange(3)[:, None], self._partial.size // 3
        places = (axes * size + bodies).ravel(), (axes * n + rows).ravel()
        once, twice = self._weights(checks)
        path, kicks = self.path[steps.start : steps.stop + 1], self.kicks[steps]
        motion_at_checks(once, twice, checks, lengths, path, kicks, *places, q, v)
        shape = (3, n, count * each)
        return q.reshape(shape).transpose(2, 1, 0), v.reshape(shape).transpose(2, 1, 0)

    def _weights(self, checks: Array) -> tuple[Array, Array]:
        """Return the weights of the stages in velocities and positions at fractions of a step, (stages, fractions)."""
        registers = self.kicks.shape[1] // padded(self._partial.size)
        stages, each = WIDTH * registers, len(checks)
        kicks = np.zeros((stages, registers, WIDTH))
        kicks.reshape(stages, stages)[...] = np.eye(stages)
        nothing, out = np.zeros((stages + 1, 2, 1)), np.empty((2, stages * each, 1))
        which, fractions = np.repeat(np.arange(stages), each), np.tile(checks, stages)
        done = np.ones(len(which), dtype=bool)
        unit = np.ones(stages)
        motion_within(
            self._form.tag, self._partial.unit, unit, nothing, kicks, which, fractions, out[0], out[1], done
        )
        return out[1].reshape(stages, each), out[0].reshape(stages, each)

    def _shaped(self, q: Array, v: Array) -> tuple[Array, Array]:
        shape = (len(q), 3, -1)
        return q.reshape(shape).transpose(0, 2, 1), v.reshape(shape).transpose(0, 2, 1)

    def _within(self, steps: ArrayLike, fractions: ArrayLike, rough: bool) -> tuple[Array, Array]:
        which: NDArray[np.int64] = np.ascontiguousarray(steps, dtype=np.int64)
        parts: Array = np.ascontiguousarray(fractions, dtype=np.float64)
        q, v = np.empty((2, len(which), self._partial.size))
        done = np.full(len(which), rough)
        if len(self.kicks):
            unit = self._partial.unit
            motion_within(self._form.tag, unit, self._lengths, self.path, self.kicks, which, parts, q, v, done)
        if not done.all():
            missing, lengths = ~done, parts * self._lengths[which]
            self._partial.take(self.path, which, self.times[which], lengths, missing, q, v)
        return self._shaped(q, v)
