"""The motion of massive bodies within recorded steps: dense output."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from orbits.integrators.forms import Array, Form, padded
from orbits.kernels.dense import motion_at_checks, motion_within
from orbits.kernels.lanes import WIDTH
from orbits.marching.stepping.partial_steps import PartialSteps


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
        self.times, self.lengths, self.path, self.kicks = times, lengths, path, kicks

    def __len__(self) -> int:
        """Return the number of steps."""
        return len(self.times) - 1

    def end_in(self, q: Array, v: Array) -> None:
        """Let it end exactly in a state, (n, 3) each, so that no zero falls between it and the motion from there on."""
        self.path[-1, :, : self._partial.size] = q.T.ravel(), v.T.ravel()

    def with_steps(self, times: Array, path: Array, kicks: Array, lengths: Array) -> Motion:
        """Return the motion within other steps of the march."""
        return Motion(self._form, times, lengths, path, kicks if len(self.kicks) else self.kicks, self._partial)

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
        h = self.lengths[k][:, None]
        q, v = self.path[k, :, : self._partial.size].swapaxes(0, 1)
        bend, twist = np.moveaxis(self._bends(k), -1, 0)
        found = q + h * x * (v + x * (bend + x * twist)), v + x * (2.0 * bend + 3.0 * x * twist)
        return self._shaped(*found)

    def _bends(self, steps: Any) -> Array:
        """Return the last two coefficients of the cubics through the states at the ends of steps, (m, 3n, 2)."""
        size, h = self._partial.size, self.lengths[steps][:, None]
        (q, v), (q1, v1) = self._ends_of(steps)
        way = np.divide(q1 - q, h, out=v.copy(), where=h != 0.0)  # a march may end with a step of no length
        return np.stack([3.0 * way - 2.0 * v - v1, v + v1 - 2.0 * way], axis=-1)[:, :size]

    def _ends_of(self, steps: Any) -> Array:
        """Return the states at both ends of steps, (2, 2, m, 3n): begin and end; q and v."""
        path = self.path[:, :, : self._partial.size]
        return np.stack([path[:-1][steps], path[1:][steps]]).swapaxes(1, 2)

    def at_checks(self, steps: slice, checks: Array, bodies: NDArray[np.int64], rows: NDArray[np.int64], n: int) -> Any:
        """Return what `roughly_at` returns for some bodies at the same fractions of all of these steps.

        checks : (fractions,)
        bodies : their numbers; rows, n : their places among n bodies; nothing is written for others
        Returns q and v, (steps * fractions, n, 3), all fractions of a step in turn.
        """
        lengths = self.lengths[steps]
        count, each = len(lengths), len(checks)
        q, v = np.empty((2, 3 * n, count, each))
        axes, size = np.arange(3)[:, None], self._partial.size // 3
        places = (axes * size + bodies).ravel(), (axes * n + rows).ravel()
        path, kicks, once, twice = self.polynomials(steps, checks)
        motion_at_checks(once, twice, checks, lengths, path, kicks, *places, q, v)
        shape = (3, n, count * each)
        return q.reshape(shape).transpose(2, 1, 0), v.reshape(shape).transpose(2, 1, 0)

    def polynomials(self, steps: slice, checks: Array) -> tuple[Array, Array, Array, Array]:
        """Return the states at the ends of these steps, what their polynomials are made of, and the weights of that in
        velocities and positions at fractions of a step, (stages, fractions); see `motion_at_checks`.
        """
        path = self.path[steps.start : steps.stop + 1]
        if not len(self.kicks):
            return path, self._bends(steps), np.stack([2.0 * checks, 3.0 * checks**2]), np.stack([checks**2, checks**3])
        known, key = self._partial.weights, checks.tobytes()
        if key not in known:
            known[key] = self._weights(checks)
        return path, self.kicks[steps], *known[key]

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
        shape = len(q), 3, self._partial.size // 3
        return q.reshape(shape).transpose(0, 2, 1), v.reshape(shape).transpose(0, 2, 1)

    def _within(self, steps: ArrayLike, fractions: ArrayLike, rough: bool) -> tuple[Array, Array]:
        which: NDArray[np.int64] = np.ascontiguousarray(steps, dtype=np.int64)
        parts: Array = np.ascontiguousarray(fractions, dtype=np.float64)
        q, v = np.empty((2, len(which), self._partial.size))
        done = np.full(len(which), rough)
        if len(self.kicks):
            unit = self._partial.unit
            motion_within(self._form.tag, unit, self.lengths, self.path, self.kicks, which, parts, q, v, done)
        if not done.all():
            missing, lengths = ~done, parts * self.lengths[which]
            self._partial.take(self.path, which, self.times[which], lengths, missing, q, v)
        return self._shaped(q, v)


class Collected:
    """The motion within the steps of several blocks of a march, copied: a room that is used again and again.

    most : the most steps
    """

    def __init__(self, most: int) -> None:
        self._most, self._count = most, 0
        self._room: list[Array] = []
        self._like: Motion | None = None

    def __len__(self) -> int:
        """Return the number of steps."""
        return self._count

    def takes(self, motion: Motion) -> bool:
        """Return whether there is room for the steps of a block, by the method of those before, and add them if so."""
        count, now = len(motion), self._count
        if not count:  # without a step, it does not tell whether steps have polynomials
            return True
        arrays = motion.times, motion.path, motion.kicks, motion.lengths
        other = self._like is not None and self._like._form != motion._form
        if now + count > self._most or (other and now):
            return False
        if not self._room or other:
            self._room = [np.empty((self._most + 1, *array.shape[1:])) for array in arrays]
        for room, array in zip(self._room, arrays, strict=True):
            room[now : now + len(array)] = array
        self._like, self._count = motion, now + count
        return True

    def emptied(self) -> Motion:
        """Return all that was added, in arrays that what is added next overwrites."""
        assert self._like is not None
        count, self._count = self._count, 0
        times, path, kicks, lengths = self._room
        return self._like.with_steps(times[: count + 1], path[: count + 1], kicks[:count], lengths[:count])
