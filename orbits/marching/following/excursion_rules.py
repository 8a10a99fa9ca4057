"""What lets massless particles leave a map: the passages that it cannot follow, and the memory that this takes."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbits.integrators.canonical.bodies import CanonicalBodies
from orbits.integrators.collocation.form import Collocation
from orbits.integrators.forms import Array, Form, coefficients_of, padded
from orbits.integrators.gauss import Gauss
from orbits.integrators.maps.on_kepler_orbits import in_order
from orbits.kernels.lanes import WIDTH
from orbits.lagrangians.base import NEWTONIAN, Lagrangian
from orbits.marching.clocks.adaptive import Adaptive
from orbits.marching.following.own_clocks import COLUMNS
from orbits.marching.following.own_memory import OwnClocks
from orbits.marching.following.particle_excursions import GROUP, MORE_ROWS, march_handing_over
from orbits.marching.stepping.alignment import aligned
from orbits.marching.stepping.choice_of_form import form_of_bodies
from orbits.marching.watching.kepler_passages import near_planets
from orbits.marching.watching.watcher import Watcher

METHOD = Gauss(stages=8)
"""The method of a particle's own steps."""


class OwnSteps(NamedTuple):
    """The passages of massless particles that a map leaves to steps of their own.

    near : (2, n), see `orbits.kernels.search.encounters_of_particles.Rules`; limits : (3,), see `march_handing_over`
    form : that of their own steps; radii : (n,), of the bodies, or None
    """

    near: Array
    limits: Array
    form: Collocation | CanonicalBodies
    radii: Array | None

    @classmethod
    def of(cls, lagrangian: Lagrangian, gm: Array, dominant: int, radii: Array | None, least_steps: int) -> OwnSteps:
        """Return those among massive bodies, one of which dominates the others; gm, radii : (n,); least_steps : a
        pericentre is resolved by the map if a revolution of its circle takes so many.

        Raises InputError if particles cannot take steps of their own in this problem.
        """
        form = form_of_bodies(METHOD, lagrangian, Adaptive(), with_particles=True)
        assert isinstance(form, Collocation | CanonicalBodies)
        # About a single body, which nothing disturbs, the map is exact whatever the step; but impacts on its surface
        # are looked for in own steps alone.
        exact = len(gm) == 1 and NEWTONIAN in lagrangian.traits and not (radii is not None and radii[dominant] > 0.0)
        angle = np.inf if exact else 2.0 * np.pi / least_steps
        limits = np.array([dominant, gm[dominant], angle])
        return cls(near_planets(gm, dominant), limits, form, radii)


class HandOver:
    """The memory of the tasks that march particles which may leave the map.

    form : of the map; n : the number of massive bodies; steps : the most in a block; tasks : their number
    """

    def __init__(self, form: Form, followed: OwnSteps, n: int, steps: int, tasks: int) -> None:
        self._followed = followed
        self._numbers = Adaptive().numbers_for(METHOD)
        self._tasks = [_Task(form, followed.form, n, steps) for _ in range(tasks)]
        self._now: tuple[Any, ...] = ()

    def prepare(
        self,
        state: dict[str, Array],
        path: Array,
        carries: Array,
        bound: tuple[Any, ...],
        begun: Array,
        watcher: Watcher | None,
        count: int,
    ) -> None:
        """Prepare for a block of `count` steps that the planets have just taken, recorded in `path` and `carries`.

        bound : the first arguments of `march_handing_over`; begun : the carry of the planets before the block
        """
        width, numbers = len(state["q"]), bound[5]
        path[2 * count * width : 2 * count * width + width] = state["q"]
        path[2 * count * width + width : 2 * (count + 1) * width] = state["v"]
        h, order = float(numbers[2]), in_order(begun, len(self._followed.near[0]))
        for task in self._tasks:
            task.own.order[:] = order
        own = coefficients_of(self._followed.form, h), _ordered(bound[3], order)
        self._now = begun, carries, path, own
        if watcher is not None:
            arrays = [task.own.arrays for task in self._tasks]
            watcher.follow_own_steps(arrays, (round(numbers[1]), h), self._followed.radii)

    def march(self, block: tuple[Any, ...], task: int, context: int) -> int:
        """March the particles of a task; block : the arguments of `march_particles`; context : of their own steps."""
        mine, (begun, carries, path, bodies_in_order) = self._tasks[task], self._now
        near, limits, form, _ = self._followed
        chart, *field = mine.own.field
        bodies = begun, carries, path, near, mine.extent, limits
        steps = self._numbers, mine.times, *mine.steps
        own = form.tag, mine.own.table, *bodies_in_order, *steps, chart, *field, *mine.own.shared
        log = mine.reached, context, *mine.own.log
        return int(march_handing_over(*block, *bodies, *mine.of_map, *own, *mine.ways, *log))


def _ordered(parameters: Any, order: NDArray[np.int64]) -> Any:
    """Return the parameters of what acts on the bodies for the bodies in another order, (n,) int64."""
    newton, *terms = parameters if isinstance(parameters, tuple) else (parameters,)
    strength = np.append(newton[0], newton[1:][order])
    if not isinstance(parameters, tuple):
        return strength
    place = {body: k for k, body in enumerate(order.tolist())}
    return strength, *(np.append(place[int(own[0])], own[1:]) for own in terms)


class _Task:
    """The memory of a task; see `march_handing_over`."""

    def __init__(self, form: Form, own: Collocation | CanonicalBodies, n: int, steps: int) -> None:
        size, rows = 3 * n, own.stages_shape(3 * n)
        tables, carry, memory = form.stages_shape(size), form.carry_rows(size), form.particle_carry_rows
        kept, mine, table, columns, room, bodies, planets, scratch, stages, kicks, ways, ordered = aligned(
            (GROUP, memory + MORE_ROWS, WIDTH),
            (1, memory, WIDTH),
            tables,
            (4, 3, 2 * WIDTH),
            (2 * WIDTH, WIDTH),
            (4, padded(size)),
            (carry, WIDTH),
            own.scratch_shape(size),
            (steps, *rows),
            (steps, own.carry_rows(size), WIDTH),
            (own.particle_carry_rows, WIDTH),
            (4, padded(size)),
        )
        none = np.zeros((2 * WIDTH, 2), dtype=np.int64)
        self.extent = np.zeros((3, n))
        self.of_map = kept, mine, table, columns, none, room, bodies, planets
        self.own = OwnClocks(own, coefficients_of(own, 1.0), n, steps)
        path = np.zeros(2 * (steps + 1) * padded(size))
        # As the workspace of a clock whose steps differ: see `orbits.marching.following.bodies_between.length_of`.
        self.times = np.zeros(3 * (steps + 1) + 1 + 2 * stages.shape[1] + WIDTH * kicks.shape[1])
        self.steps = scratch, stages, path, kicks
        self.ways = ways, np.zeros(COLUMNS), ordered
        self.reached = np.zeros(steps, dtype=np.bool_)
