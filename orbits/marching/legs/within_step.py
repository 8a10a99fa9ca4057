"""What lies between the whole steps of a leg: computed on copies, so that the leg does not change."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from orbits.errors import IntegrationError
from orbits.integrators.forms import Array
from orbits.kernels.steps import NOWHERE
from orbits.marching.clocks.step_times import Place
from orbits.marching.following.retirement import Retirement
from orbits.marching.legs.problem import NO_ENDS, Ends, Problem
from orbits.marching.stepping.motion import Motion

if TYPE_CHECKING:
    from orbits.marching.legs.excursions.planet_excursions import Legs
    from orbits.marching.legs.leg import Leg

States = tuple[Array, Array]


def state_at(leg: Leg, place: Place) -> States:
    """Return (q, v), each (n, 3), at a place up to which a leg has advanced: after a partial step of constant steps,
    which has a cold start, or after the steps that the clock chooses up to there.
    """
    if leg.times.is_at(place):
        return leg.state()
    stepper, retired = leg.stepper, leg.losses.retired
    counts = stepper.counts()
    retired.begin()
    try:
        copy = leg.times.copy_at(leg, place)
        lost = retired.lost()
        failure = None if lost is None or leg.problem.retire else leg.losses.lose(leg, lost, leg.step, {}, {})
        if failure is not None:
            raise failure
    finally:
        stepper.evaluations, stepper.particle_evaluations = counts
    leg.shown = [copy]
    return stepper.gather(copy, retired.gone())


def ended_at(leg: Leg, time: float) -> Leg:
    """Return a leg that has marched on from here to end exactly at a time less than a step ahead, with all that looks
    at it. Of constant steps, it is a partial step from here, and its readings and its record are of that alone.
    """
    q, v = leg.state()
    gone = leg.problem.particles[leg.losses.retired.gone()]
    q[gone], v[gone] = NOWHERE, 0.0
    way = leg.times.way(time)
    ends = Ends(energy_bound=leg.problem.ends.energy_bound)
    end = type(leg)(_like(leg, clock=way.clock, start=way.start, ends=ends), q, v)
    if leg.energy is not None and end.energy is not None:
        end.energy.start = leg.energy.start
    leg.times.hand_on(leg, end)
    end.advance_to(way.place)
    return end


def end_at(leg: Leg, time: float) -> None:
    """March a leg of chosen steps on to end exactly at a time less than a step ahead, from which it cannot go on; one
    of constant steps stays where it is. No more states are passed on. Raises what `Leg.advance` raises.
    """
    leg.loop.listeners.clear()
    leg.times.end_exactly()
    leg.advance_to(Place(0, time))


def towards(leg: Leg, time: float) -> tuple[Leg, Place]:
    """Return a leg of the massive bodies from here that ends exactly at a time less than a step ahead, with dense
    output, and the place of that time in it.
    """
    seen, bodies, way = leg.as_seen(), leg.problem.bodies, leg.times.way(time)
    q, v = (seen[name][: 3 * len(bodies)].reshape(3, -1).T for name in "qv")
    names, surfaces = leg.problem.names, leg.problem.surfaces
    of_bodies: dict[str, Any] = {
        "massive": np.ones(len(bodies), dtype=bool),
        "names": [names[body] for body in bodies.tolist()] if names else (),
        "surfaces": None if surfaces is None else surfaces[bodies],
    }
    end = type(leg)(_like(leg, clock=way.clock, start=way.start, dense=True, **of_bodies), q, v)
    for name in way.continued:
        end.stepper.state[name][...] = leg.stepper.state[name]
    end.times.end_exactly()
    return end, way.place


def stretches(march: Legs, place: Place) -> Iterator[tuple[Motion, bool]]:
    """Yield the motion up to a place, block by block, and whether each is the last one. Raises what `approach` raises,
    after the steps before the one that failed.
    """
    while march.is_before(place):
        try:
            march.approach(place)
        except IntegrationError:
            yield march.last.motion(), False
            raise
        yield march.last.motion(), not march.is_before(place)


def retired_by(leg: Leg, time: float) -> list[Retirement]:
    """Return the particles that are retired, or cannot be followed up to a time less than a step ahead, in the order of
    the caller's bodies. The leg does not change: its next step may lose them a rounding error away.
    """
    known = {one.body: one for one in leg.retired()}
    lost = (
        one._replace(step=leg.step, reading=leg.times.reading_in_part(one.reading, time))
        for one in ended_at(leg, time).retired()
    )
    return [known.get(one.body, one) for one in lost]


def _like(leg: Leg, **changes: Any) -> Problem:
    """Return the problem of a leg with its forces as they are now, by one thread, without what may end it."""
    plain: dict[str, Any] = {"threads": 1, "ends": NO_ENDS, "dense": False, "underway": False}
    return leg.problem.but(**{**plain, "forces": leg.stepper.forces_now(), **changes})
