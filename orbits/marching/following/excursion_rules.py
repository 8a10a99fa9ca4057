"""What lets massless particles leave a map: the passages that it cannot follow, and the memory that this takes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbits.integrators.canonical.bodies import CanonicalBodies
from orbits.integrators.collocation.form import Collocation
from orbits.integrators.forms import Array, Form, coefficients_of, padded
from orbits.integrators.gauss import Gauss
from orbits.kernels.clocks import FIRST, LENGTH
from orbits.kernels.lanes import WIDTH
from orbits.kernels.maps.jacobi_particles import ELSEWHERE, NUMBER
from orbits.kernels.state import Columns
from orbits.lagrangians.base import NEWTONIAN, Lagrangian
from orbits.marching.clocks.adaptive import Adaptive
from orbits.marching.clocks.clock import OWN, SHARED, Clock
from orbits.marching.following.alone_in_map import Lone
from orbits.marching.following.contract import Block, Room
from orbits.marching.following.follower import Follower
from orbits.marching.following.in_lanes import GROUP
from orbits.marching.following.losses import Contact
from orbits.marching.following.lost_particles import Reached, State, hit_by, seen_of, write_lost
from orbits.marching.following.own_clocks import COLUMNS
from orbits.marching.following.own_memory import ByOwnSteps, OwnMemory
from orbits.marching.following.particle_excursions import (
    EXCURSIONS,
    MORE_ROWS,
    PART,
    Excursions,
    FieldOfPlanets,
    parts_taken,
)
from orbits.marching.following.retirement import Lost
from orbits.marching.stepping.alignment import aligned
from orbits.marching.stepping.choice_of_form import form_of_bodies
from orbits.marching.stepping.pool import Helpers
from orbits.marching.watching.kepler_passages import near_planets
from orbits.marching.watching.leg_observers import Observers
from orbits.marching.watching.passage_list import BlockList

METHOD = Gauss(stages=8)
"""The method of a particle's own steps."""


class OwnSteps(NamedTuple):
    """The passages of massless particles that a map leaves to steps of their own.

    near : (2, n), see `orbits.kernels.search.encounters_of_particles.Rules`; limits : (3,), see `Excursions`
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


class WithExcursions(Follower):
    """Massless particles that leave a map for steps of their own where it cannot follow them; see
    `orbits.marching.following.particle_excursions`.

    form : of the map; followed : the passages; the other arguments are those of `Follower`
    """

    reads_path = True

    def __init__(
        self,
        form: Form,
        n: int,
        steps: int,
        helpers: Helpers,
        coefficients: Any,
        followed: OwnSteps,
        parameters: Any,
    ) -> None:
        super().__init__(form, n, steps, helpers, coefficients)
        self.following = EXCURSIONS
        self._followed, self._own_form = followed, followed.form.tag
        # Written anew for each block, in which the bodies may be in another order.
        self._coefficients = np.array(coefficients_of(followed.form, 1.0))
        self._parameters = _ordered(parameters, np.arange(n))
        self._memories = [_Memory(form, followed.form, n, steps) for _ in range(helpers.members)]

    @staticmethod
    def memory_rows(form: Form) -> int:
        """Return the number of rows of eight that each particle keeps from block to block."""
        return form.particle_carry_rows + MORE_ROWS

    def alone(self, state: State) -> NDArray[np.bool_]:
        """Return which particles are away from the map."""
        return np.asarray(state["particle_memory"][:, 0, NUMBER] == ELSEWHERE)

    def lists(self, observers: Observers) -> list[BlockList]:
        """Return the lists of passages by steps of their own."""
        return observers.own_lists

    def reached(self, state: State, lost: Lost) -> Reached:
        """Return where lost particles that are away have got to."""
        away = lost.particles[self.alone(state)[lost.particles]]
        places = {name: state[f"particle_{name}"][:, away] for name in ("q", "v")}
        return {"away": away, **places, "memory": state["particle_memory"][away]}

    def put(
        self, state: State, seen: State, lost: Lost, reached: Reached, contacts: Mapping[int, Contact]
    ) -> None:
        """Write where lost particles are seen, or have got to, and their part of a step, into the state of a leg."""
        out, hit, away = seen_of(seen, lost), hit_by(lost, contacts), list(reached["away"].tolist())
        for k, particle in enumerate(lost.particles.tolist()):
            if k in hit:
                part, place = hit[k].part, (hit[k].q, hit[k].v)
            elif particle in away:
                at = away.index(particle)
                part, place = reached["memory"][at, 0, PART], (reached["q"][:, at], reached["v"][:, at])
            else:
                continue
            out["particle_memory"][k, 0, [NUMBER, PART]] = ELSEWHERE, part
            out["particle_q"][:, k], out["particle_v"][:, k] = place
        write_lost(state, lost, out)

    def places(self, state: State) -> tuple[Array | None, Array | None]:
        """Return the parts of a step that lost particles have taken."""
        return None, parts_taken(state["particle_memory"])

    def _prepare(self, block: Block, watcher: Observers | None, steps: int) -> None:
        from orbits.integrators.maps.on_kepler_orbits import in_order

        h, order = float(block.numbers[LENGTH]), in_order(block.begun, len(self._followed.near[0]))
        self._coefficients[...] = coefficients_of(self._followed.form, h)
        now = _ordered(block.parameters, order)
        for mine, values in zip(*map(_as_tuple, (self._parameters, now)), strict=True):
            mine[...] = values
        for memory in self._memories:
            memory.own.order[:] = order
        if watcher is not None:
            arrays = [memory.own.arrays for memory in self._memories]
            watcher.follow_own_steps(arrays, (round(block.numbers[FIRST]), h), self._followed.radii)

    def _own(self, member: int, block: Block, watcher: Observers | None) -> tuple[Room, Excursions]:
        room, memory = self._room(member, watcher), self._memories[member]
        context = 0 if watcher is None else watcher.own_steps.addresses[member]
        stepping = memory.own.stepping(memory.numbers, memory.steps, block.path, (room.observer, context))
        bodies = FieldOfPlanets(self._parameters, self._coefficients, *memory.of_bodies)
        near, limits, _, _ = self._followed
        return room, Excursions(near, memory.extent, limits, memory.kept, memory.lone, bodies, stepping)


def follower_of(
    clock: Clock,
    form: Form,
    n: int,
    steps: int,
    helpers: Helpers,
    coefficients: Array,
    parameters: Any,
    followed: OwnSteps | None,
) -> Follower:
    """Return what marches the massless particles of a march.

    clock : of the march; parameters : of what acts on the bodies
    followed : the passages that a map leaves to steps of their own, or None; the others are those of `Follower`
    """
    if followed is not None:
        return WithExcursions(form, n, steps, helpers, coefficients, followed, parameters)
    return {SHARED: Follower, OWN: ByOwnSteps}[clock.particle_steps](form, n, steps, helpers, coefficients)


def _as_tuple(parameters: Any) -> tuple[Any, ...]:
    return parameters if isinstance(parameters, tuple) else (parameters,)


def _ordered(parameters: Any, order: NDArray[np.int64]) -> Any:
    """Return the parameters of what acts on the bodies for the bodies in another order, (n,) int64."""
    newton, *terms = parameters if isinstance(parameters, tuple) else (parameters,)
    strength = np.append(newton[0], newton[1:][order])
    if not isinstance(parameters, tuple):
        return strength
    place = {body: k for k, body in enumerate(order.tolist())}
    return strength, *(np.append(place[int(own[0])], own[1:]) for own in terms)


class _Memory:
    """The memory of a thread; see `Excursions`."""

    def __init__(self, form: Form, own: Collocation | CanonicalBodies, n: int, steps: int) -> None:
        size, rows = 3 * n, own.stages_shape(3 * n)
        self.kept, mine, tables, columns, room, state, planets, scratch, stages, kicks, carry, ordered = aligned(
            (GROUP, WithExcursions.memory_rows(form), WIDTH),
            (1, form.particle_carry_rows, WIDTH),
            form.stages_shape(size),
            (4, 3, 2 * WIDTH),
            (2 * WIDTH, WIDTH),
            (4, padded(size)),
            (form.carry_rows(size), WIDTH),
            own.scratch_shape(size),
            (steps, *rows),
            (steps, own.carry_rows(size), WIDTH),
            (own.particle_carry_rows, WIDTH),
            (4, padded(size)),
        )
        none = np.zeros((2 * WIDTH, 2), dtype=np.int64)
        self.lone = Lone(mine, tables, Columns(*columns), none, room, state, planets)
        self.extent, self.numbers = np.zeros((3, n)), Adaptive().numbers_for(METHOD)
        self.own = OwnMemory(own, coefficients_of(own, 1.0), n, steps)
        # As the workspace of a clock whose steps differ: see `orbits.marching.following.bodies_between.length_of`.
        times = np.zeros(3 * (steps + 1) + 1 + 2 * stages.shape[1] + WIDTH * kicks.shape[1])
        self.steps = times, stages, np.zeros(2 * (steps + 1) * padded(size)), kicks
        self.of_bodies = scratch, carry, np.zeros(COLUMNS), np.zeros(steps, dtype=np.bool_), ordered
