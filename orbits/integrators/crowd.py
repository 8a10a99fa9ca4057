"""Thousands of bodies: the march of a method of kicks and drifts, its force evaluations shared among threads.

The bits are those of the method's own compiled loop, whatever the number of threads: a body's acceleration does not
depend on the share that it is in.
"""

from __future__ import annotations

from collections.abc import Iterable
from concurrent.futures import Executor
from itertools import pairwise
from typing import cast

import numpy as np

from orbits.integrators.base import NOT_FINITE, OK, Array, Integrator
from orbits.kernels.binding import Tag, accelerate_some
from orbits.kernels.compile import kernel
from orbits.kernels.lanes import WIDTH
from orbits.kernels.paths import record_state
from orbits.kernels.state import all_finite, drift, kick

LEAST_CROWD = 1000
"""Bodies from which on a force evaluation outlasts the handing out of shares by far."""


@kernel
def accelerate_share(tag, parameters, q, out, start, stop):
    """Write the accelerations of bodies start ... stop - 1."""
    accelerate_some(tag, parameters, q, out, start, stop)


class Crowd:
    """Marches as `integrator.advance` does, for a method of kicks and drifts.

    bodies : how many; threads, pool : how many work, and who; no pool for one alone
    """

    def __init__(self, integrator: Integrator, bodies: int, threads: int, pool: Executor | None) -> None:
        self._integrator = integrator
        self._shares = shares(bodies, threads)
        self._pool = pool
        self._size = 3 * bodies
        self._at = np.zeros(0)

    @staticmethod
    def serves(integrator: Integrator, tag: Tag, bodies: int) -> bool:
        """Whether the bodies are that many, and method and Lagrangian can be shared out."""
        return (
            bodies >= LEAST_CROWD and tag.provides("accelerate_some") and integrator.kicks_and_drifts(1.0) is not None
        )

    def advance(
        self,
        tag: Tag,
        parameters: Array,
        coefficients: Array,
        h: float,
        q: Array,
        q_lo: Array,
        v: Array,
        v_lo: Array,
        memory: Array,
        work: Array,
        field_record: Array,
        path: Array,
        steps: int,
    ) -> tuple[int, int, int, int]:
        """March the bodies by `steps` steps of h. Returns (status, steps done, body, evaluations)."""
        size, g = self._size, work[0]
        kicks, drifts = cast(tuple[Array, Array], self._integrator.kicks_and_drifts(h))
        evaluations = 0
        if kicks[0] != 0.0 and not np.array_equal(q[:size], self._at):
            self._accelerate(tag, parameters, q, g)
        for step in range(steps):
            record_state(path, step, q, v, size)
            record = field_record[step % field_record.shape[0]]
            record[0, :size] = q[:size]
            if kicks[0] != 0.0:
                kick(v, v_lo, kicks[0], g, size)
            for i, length in enumerate(drifts):
                drift(q, q_lo, length, v, v_lo, size)
                record[i + 1, :size] = q[:size]
                if kicks[i + 1] != 0.0:
                    self._accelerate(tag, parameters, q, g)
                    kick(v, v_lo, kicks[i + 1], g, size)
                    evaluations += 1
        return (OK if all_finite(q, v, size) else NOT_FINITE), steps, 0, evaluations

    def _accelerate(self, tag: Tag, parameters: Array, q: Array, g: Array) -> None:
        def share(edges: tuple[int, int]) -> None:
            accelerate_share(tag, parameters, q, g, *edges)

        done: Iterable[None] = self._pool.map(share, self._shares) if self._pool else map(share, self._shares)
        for _ in done:
            pass  # an exception of a thread is raised here
        self._at = q[: self._size].copy()


def shares(bodies: int, threads: int) -> list[tuple[int, int]]:
    """Split bodies or particles into contiguous shares of whole lanes, a few for each thread."""
    groups = (bodies + WIDTH - 1) // WIDTH
    count = min(groups, 4 * threads if threads > 1 else 1)
    edges = [WIDTH * (groups * k // count) for k in range(count + 1)] if count else [0]
    return [(a, min(b, bodies)) for a, b in pairwise(edges)]
