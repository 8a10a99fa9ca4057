"""The collisions of a massless particle in a step of massive bodies that it covers by steps of its own.

They are sought in its own steps, each of which resolves its motion; in the whole step it may have gone round a body
many times. It is marched again, alone among the bodies, by steps of all that end where its own do.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbits.marching.clocks.adaptive import FIRST_THETA, THETA
from orbits.marching.clocks.step_times import Place
from orbits.marching.clocks.variable_steps import ending
from orbits.marching.following.own_clocks import BEFORE, NEXT, SHORTEST, STRETCH
from orbits.marching.legs.excursions.planet_excursions import Legs
from orbits.propagation.collisions.impact import Impact, State, Step, impacts
from orbits.propagation.collisions.of_a_run import Collisions
from orbits.propagation.events.base import RECORD

Array = NDArray[np.float64]
Checkpoint = dict[str, NDArray[Any]]

WHOLE = 0.99
"""The fraction of a part of a step that the particle's last step covers if it is the only one in it."""


def alone(checkpoint: Checkpoint, fresh: Checkpoint, particle: int) -> Checkpoint:
    """Return the checkpoint of a march of several particles as that of a march of one of them among the same bodies.

    fresh : a checkpoint of that march; particle : the number of the one among the particles
    """
    out = dict(fresh)
    for name in ("counts", "q", "q_lo", "v", "v_lo", "memory", "clock"):
        out[name] = checkpoint[name]
    for name in ("particle_q", "particle_q_lo", "particle_v", "particle_v_lo"):
        out[name] = fresh[name].copy()
        out[name][:, 0] = checkpoint[name][:, particle]
    for name in ("particle_memory", "particle_clock", "retired"):
        out[name] = checkpoint[name][particle : particle + 1]
    return out


def own_steps(march: Legs, particle: int, end: float) -> Iterator[Step]:
    """Yield the steps that a particle takes on its own, up to the end of a step of the bodies or where it is lost.

    march : of the bodies and this particle alone, at the beginning of the step; it is moved. The states are of these.
    particle : its number among them
    """
    direction, theta = march.clock.direction, march.checkpoint()["clock"][THETA]
    while (end - march.time) * direction > 0.0:
        begin, before = march.time, march.state()
        here = march.checkpoint()
        here["clock"][THETA] = theta  # the bodies take steps far shorter than they could
        goal = _one_step(march, particle, here, end)
        if goal is None:
            return
        there, after = march.checkpoint(), march.state()
        march.restore(here)

        def at(time: float) -> State:
            return march.state_at(Place(0, time))

        bodies = np.delete(np.arange(len(before[0])), particle)
        yield Step(begin, goal, before, after, at, bodies, march.problem.strength[: 1 + len(bodies)])
        march.restore(there)


def own_impacts(
    march: Legs, particle: int, there: NDArray[np.bool_], end: float, radii: Array, collisions: Collisions
) -> list[Impact]:
    """Return the collisions of a particle up to the end of a step of the bodies, in the order of time, up to the first
    after which it does not go on as before.

    march, end : as of `own_steps`, of the bodies that are `there`, (n,); particle : its number among all n
    radii : (n,); collisions : those that are sought
    """
    numbers, found = np.flatnonzero(there), list[Impact]()

    def whole(state: State) -> State:
        q, v = np.full((2, len(there), 3), np.nan)
        q[there], v[there] = state
        return q, v

    def seeks(i: int, j: int) -> bool:
        return particle in (i, j) and collisions.seeks(i, j)

    for step in [] if march.retired() else own_steps(march, int(there[:particle].sum()), end):
        at = partial(_whole_at, whole, step.at)
        massive = numbers[step.massive]
        step_of_all = step._replace(before=whole(step.before), after=whole(step.after), at=at, massive=massive)
        for impact in impacts(step_of_all, radii, seeks, march.problem.integrator.order):
            found.append(impact)
            rule = collisions.rule(impact.first, impact.second)
            if rule is not None and rule.then != RECORD:
                return found
    return found


def _whole_at(whole: Callable[[State], State], at: Callable[[float], State], time: float) -> State:
    return whole(at(time))


def _one_step(march: Legs, particle: int, here: Checkpoint, end: float) -> float | None:
    """March from a checkpoint by one step of the particle, not beyond a time; return its end, or None if it is lost."""
    begin, direction = march.time, march.clock.direction
    length = float(here["particle_clock"][0, NEXT]) or _first_length(march, particle)
    while length > SHORTEST * abs(begin):  # the step of the bodies may be longer by more than 2^52
        goal = end if STRETCH * length >= abs(end - begin) else begin + direction * length
        march.restore(ending(here))
        march.advance_to(Place(0, goal))
        covered = abs(march.checkpoint()["particle_clock"][0, BEFORE])
        if not march.retired() and covered >= WHOLE * abs(goal - begin):
            return goal
        length = 0.5 * min(length, abs(goal - begin))
    return None


def _first_length(march: Legs, particle: int) -> float:
    """Return the length of the first step of a particle, from its dynamical time; infinite if nothing attracts it."""
    q, _ = march.state()
    bodies = np.delete(q, particle, axis=0)
    gm = march.problem.gm[: len(bodies)]
    rate = float((gm / np.linalg.norm(bodies - q[particle], axis=1) ** 3).sum())
    return FIRST_THETA / math.sqrt(rate) if rate > 0.0 else math.inf
