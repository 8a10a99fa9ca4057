"""The memory of particles with steps of their own."""

from __future__ import annotations

import numpy as np

from orbits.integrators.canonical.bodies import CanonicalBodies
from orbits.integrators.collocation.form import Collocation
from orbits.integrators.forms import Array, Form, padded
from orbits.kernels.lanes import WIDTH
from orbits.marching.following.bodies_between import PLACES, chart
from orbits.marching.following.own_clocks import ABSENT
from orbits.marching.following.own_steps_log import BESIDES
from orbits.marching.stepping.alignment import aligned


class OwnClocks:
    """The memory of a task that marches particles with clocks of their own; see `march_own_clocks`.

    table : the coefficients of a step of a particle; field, shared : the arrays of a `Field` and of a `Shared` that
        belong to the task
    log, arrays : the arrays of a `Log`, and those of its context; order : of the bodies, one of them
    """

    def __init__(self, form: Form, coefficients: Array, n: int, steps: int) -> None:
        entries, rows, stride = steps + BESIDES, form.stages_shape(3 * n)[0], padded(3 * n)
        self.table, modes, room, shared = aligned(
            coefficients.shape,
            (steps, 3 * n, 2 * WIDTH),
            (PLACES + rows + 3 * stride, WIDTH),
            (steps, *coefficients.shape[1:]),
        )
        self.table[...], shared[...] = coefficients, coefficients
        self.shared = shared, np.zeros(steps), np.full((steps + 1, 6, padded(n)), ABSENT)
        assert isinstance(form, Collocation | CanonicalBodies)
        self.field = chart(form.tableau), modes, np.zeros(steps, dtype=np.bool_), room
        path, times, track = np.zeros(2 * entries * stride), np.zeros(entries), np.full((6 * entries, WIDTH), np.nan)
        self.arrays = {"path": path, "times": times}
        counts, found = np.zeros(2, dtype=np.int64), np.zeros(1, dtype=np.int64)
        self.order = np.arange(n)
        seen = self.order, np.zeros(padded(n)), np.zeros((2, stride))
        self.log = counts, np.zeros((entries, 2)), times, path, track, found, *seen
