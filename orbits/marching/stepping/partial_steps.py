"""Partial steps from recorded states of massive bodies, by the method's own kernels: dense output of any method."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbits.integrators.forms import Array, Form, coefficients_of, padded
from orbits.kernels.binding import Tag
from orbits.kernels.dense import Parts, partial_steps
from orbits.kernels.lanes import WIDTH
from orbits.kernels.steps import OK, Share, State, Storage
from orbits.marching.stepping.alignment import aligned


class PartialSteps:
    """What takes partial steps of n massive bodies.

    form : of the method; tag, vectors : of what acts on the bodies, and its parameters
    failure : returns the error for a status and a time

    unit : the coefficients of a step of unit length
    weights : those of the stages in the polynomial of a step at fractions of it, kept by the bytes of these
    """

    def __init__(self, form: Form, tag: Tag, vectors: Any, n: int, failure: Callable[[int, float], Exception]) -> None:
        self._form, self._tag, self._vectors, self._failure = form, tag, vectors, failure
        self.size = 3 * n
        self._stretches = "stretch" in form.own_kernels()
        self.unit = coefficients_of(form, 1.0)
        self._own = self.unit
        if self._stretches:  # written anew for each step
            self._own = self.unit.copy() if isinstance(self.unit, np.ndarray) else form.coefficients(1.0, 1.0)
        own = (form.carry_rows(self.size), WIDTH), form.scratch_shape(self.size), form.stages_shape(self.size)
        self.weights: dict[bytes, tuple[Array, Array]] = {}
        *state, carry, scratch, stages = aligned(*[(padded(self.size),)] * 4, *own)
        self._state = State(*state)
        self._storage = Storage(carry, scratch, stages, Share(0, self.size, None))

    def take(
        self,
        path: Array,
        starts: NDArray[np.int64],
        times: Array,
        parts: Array,
        missing: NDArray[np.bool_],
        q: Array,
        v: Array,
        carries: Array | None = None,
    ) -> None:
        """Write the states after steps of `parts` from the states `starts` of `path`, (states, 2, padded), or (states,
        4, padded) with low parts, which are at `times`, into those rows of q and v, (m, 3n), that are `missing`.

        carries : (m, rows, 8), the carry with which each begins, replaced by that after it; None for zeros

        Raises an IntegrationError if a partial step fails.
        """
        known = self._storage.carry[None][:0] if carries is None else carries
        if self._stretches:
            self._run(self._own, self.unit, path, Parts(starts, times, parts, missing), q, v, known)
            return
        for k in np.flatnonzero(missing):  # a method whose coefficients are made in Python, for each length
            one = slice(k, k + 1)
            own = self._form.coefficients(parts[k], parts[k]) if parts[k] else self.unit
            which = Parts(starts[one], times[one], parts[one], missing[one])
            self._run(own, own, path, which, q[one], v[one], known[one])

    def _run(self, own: Any, unit: Any, path: Array, parts: Parts, q: Array, v: Array, known: Array) -> None:
        failed, status = partial_steps(
            self._form.tag, own, unit, self._tag, self._vectors, path, parts, q, v, known, self._state, self._storage
        )
        if status != OK:
            raise self._failure(status, float(parts.times[failed]))
