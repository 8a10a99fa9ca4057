"""How massless particles of a leg go on, as far as those that are lost are concerned.

In lanes, they take the steps of the bodies. By clocks of their own, and in encounters that a map does not follow, they
take steps of their own, are lost within a step of the bodies, and may hit a body on the way.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from orbits.integrators.forms import Array, Form
from orbits.kernels.maps.jacobi_particles import ELSEWHERE, NUMBER
from orbits.marching.clocks.constant import Clock
from orbits.marching.following.losses import Contact
from orbits.marching.following.own_clocks import REACHED
from orbits.marching.following.particle_excursions import PART, parts_taken
from orbits.marching.following.retirement import HIT, Lost, kind_of
from orbits.marching.legs import within_step
from orbits.marching.watching.leg_observers import Observers
from orbits.marching.watching.passage_list import BlockList

if TYPE_CHECKING:
    from orbits.marching.legs.excursions.planet_excursions import Legs
    from orbits.marching.legs.leg import Leg
    from orbits.marching.legs.stepper import State

Reached = dict[str, Any]
"""Arrays of the state of lost particles."""


class InLanes:
    """Particles that take the steps of the bodies.

    within : whether the step in which particles are lost is taken by the others before they are retired
    pericentres : whether passages of the dominant body are listed only to see who falls on it
    """

    within = pericentres = False

    def alone(self, state: State) -> NDArray[np.bool_]:
        """Return which particles take steps of their own at a state, (particles,)."""
        return np.zeros(len(state["particle_memory"]), dtype=bool)

    def lists(self, observers: Observers) -> list[BlockList]:
        """Return the lists of passages by steps of their own."""
        return []

    def reached(self, state: State, lost: Lost) -> Reached:
        """Return where lost particles have got to by steps of their own, within a step of the bodies."""
        return {}

    def put(self, leg: Leg, lost: Lost, reached: Reached, contacts: Mapping[int, Contact]) -> None:
        """Write where lost particles have got to into the state of a leg; contacts : of those that hit a body."""
        _write(leg.stepper.state, lost, reached)

    def losing_by(self, leg: Legs, time: float) -> Legs:
        """Return a leg that has lost what is lost by a time in the next step: here nothing more, as all particles take
        whole steps.
        """
        return leg

    def stop(self, state: State, particles: NDArray[np.intp], time: float) -> None:
        """Note the time at which particles were lost, if they have clocks."""

    def places(self, state: State) -> tuple[Array | None, Array | None]:
        """Return the clocks of lost particles, and the parts of a step that they have taken; see `retirements`."""
        return None, None


class InMap(InLanes):
    """Particles of a map that marches other variables than those seen: what is left of them is what is seen.

    follows : whether they take steps of their own in encounters that it does not follow
    """

    def __init__(self, follows: bool) -> None:
        self._follows = follows

    def alone(self, state: State) -> NDArray[np.bool_]:
        """Return which particles are away from the map."""
        return np.asarray(state["particle_memory"][:, 0, NUMBER] == ELSEWHERE)

    def lists(self, observers: Observers) -> list[BlockList]:
        """Return the lists of passages by steps of their own."""
        return observers.own_lists

    def reached(self, state: State, lost: Lost) -> Reached:
        """Return where lost particles that are away have got to."""
        if not self._follows:
            return {}
        away = lost.particles[self.alone(state)[lost.particles]]
        places = {name: state[f"particle_{name}"][:, away] for name in ("q", "v")}
        return {"away": away, **places, "memory": state["particle_memory"][away]}

    def put(self, leg: Leg, lost: Lost, reached: Reached, contacts: Mapping[int, Contact]) -> None:
        """Write where lost particles are seen, or have got to, and their part of a step, into the state of a leg."""
        state, seen = leg.stepper.state, leg.as_seen(lost.particles)
        out = {f"particle_{name}": seen[f"particle_{name}"][:, lost.particles] for name in ("q", "v")}
        away = list(reached.get("away", np.zeros(0)).tolist())
        for k, particle in enumerate(lost.particles.tolist()):
            memory, part = state["particle_memory"][particle], None
            if particle in contacts and kind_of(lost.status[k]) == HIT:
                contact = contacts[particle]
                part, place = contact.part, (contact.q, contact.v)
            elif particle in away:
                at = away.index(particle)
                part, place = reached["memory"][at, 0, PART], (reached["q"][:, at], reached["v"][:, at])
            memory[:] = 0.0
            if part is not None:
                memory[0, NUMBER], memory[0, PART] = ELSEWHERE, part
                out["particle_q"][:, k], out["particle_v"][:, k] = place
        _write(state, lost, out)

    def places(self, state: State) -> tuple[Array | None, Array | None]:
        """Return the parts of a step that lost particles have taken."""
        return None, parts_taken(state["particle_memory"]) if self._follows else None


class ByOwnClocks(InLanes):
    """Particles with clocks of their own, which all take steps of their own."""

    within = pericentres = True

    def alone(self, state: State) -> NDArray[np.bool_]:
        """Return all."""
        return np.ones(len(state["particle_memory"]), dtype=bool)

    def lists(self, observers: Observers) -> list[BlockList]:
        """Return the lists of passages, all by steps of their own."""
        return observers.lists

    def reached(self, state: State, lost: Lost) -> Reached:
        """Return where lost particles have got to."""
        columns = (f"particle_{name}" for name in ("q", "q_lo", "v", "v_lo"))
        places = {name: state[name][:, lost.particles] for name in columns}
        return {**places, "particle_clock": state["particle_clock"][lost.particles]}

    def put(self, leg: Leg, lost: Lost, reached: Reached, contacts: Mapping[int, Contact]) -> None:
        """Write where lost particles have got to, and when, into the state of a leg."""
        for k, particle in enumerate(lost.particles.tolist()):
            if particle in contacts and kind_of(lost.status[k]) == HIT:
                one = contacts[particle]
                reached["particle_q"][:, k], reached["particle_v"][:, k] = one.q, one.v
                reached["particle_q_lo"][:, k] = reached["particle_v_lo"][:, k] = 0.0
                reached["particle_clock"][k, REACHED] = one.time
        _write(leg.stepper.state, lost, reached)

    def losing_by(self, leg: Legs, time: float) -> Legs:
        """Return a leg that has lost those that are lost by a time in the next step, and no others of this step."""
        return within_step.ended_at(leg.home, time)

    def stop(self, state: State, particles: NDArray[np.intp], time: float) -> None:
        """Note the time at which particles were lost."""
        state["particle_clock"][particles, REACHED] = time

    def places(self, state: State) -> tuple[Array | None, Array | None]:
        """Return the clocks of lost particles."""
        return state.get("particle_clock"), None


def _write(state: State, lost: Lost, arrays: Mapping[str, Array]) -> None:
    for name, values in arrays.items():
        if name == "particle_clock":
            state[name][lost.particles] = values
        else:
            state[name][:, lost.particles] = values


def way_of(clock: Clock, form: Form, particles: bool, follows: bool) -> InLanes:
    """Return the way of particles on a clock, if there are any, by the form of a method; follows : see `InMap`."""
    if clock.lets_particles_choose and particles:
        return ByOwnClocks()
    return InMap(follows) if form.transforms else InLanes()
