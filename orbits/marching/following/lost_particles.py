"""What becomes of massless particles that are lost in a block, which a leg asks its follower.

In the steps of the bodies they are lost between two of them. By clocks of their own, and in encounters that a map does
not follow, they take steps of their own, are lost within a step of the bodies, and may hit a body on the way: these
followers override what is different.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbits.integrators.forms import Array
from orbits.marching.following.losses import Contact
from orbits.marching.following.retirement import HIT, Lost, kind_of
from orbits.marching.watching.leg_observers import Observers
from orbits.marching.watching.passage_list import BlockList

State = dict[str, Array]
"""The arrays of the state of a leg."""

Reached = dict[str, Any]
"""Arrays of the state of lost particles."""


class LostParticles:
    """What becomes of lost particles that take the steps of the bodies; of a leg without particles, of none."""

    def sees_falls(self, radius: float) -> bool:
        """Return whether passages of the dominant body, of this radius, are listed only to see who falls on it."""
        return False

    def ended_by(self, lost: Lost, count: int) -> int:
        """Return after how many of the `count` steps of a block lost particles are retired: those before the step in
        which they are lost.
        """
        return lost.steps

    def alone(self, state: State) -> NDArray[np.bool_]:
        """Return which particles take steps of their own at a state, (particles,)."""
        return np.zeros(len(state["particle_memory"]), dtype=bool)

    def lists(self, observers: Observers) -> list[BlockList]:
        """Return the lists of passages by steps of their own."""
        return []

    def reached(self, state: State, lost: Lost) -> Reached:
        """Return where lost particles have got to by steps of their own, within a step of the bodies."""
        return {}

    def put(
        self, state: State, seen: State, lost: Lost, reached: Reached, contacts: Mapping[int, Contact]
    ) -> None:
        """Write where lost particles are seen, or have got to, into the state of a leg: by default they stay in it.

        seen : the state as it is seen; contacts : of those that hit a body
        """

    def losing_by(self, leg: Any, time: float) -> Any:
        """Return a leg that has lost what is lost by a time in the next step: here nothing more, as all particles take
        whole steps.
        """
        return leg

    def stop(self, state: State, particles: NDArray[np.intp], time: float) -> None:
        """Note the time at which particles were lost, if they have clocks."""

    def places(self, state: State) -> tuple[Array | None, Array | None]:
        """Return the clocks of lost particles, and the parts of a step that they have taken; see `retirements`."""
        return None, None


def seen_of(seen: State, lost: Lost) -> Reached:
    """Return positions and velocities of lost particles as they are seen, and an empty memory: what is left of those
    that marched other variables.
    """
    places = {f"particle_{name}": seen[f"particle_{name}"][:, lost.particles] for name in ("q", "v")}
    return {**places, "particle_memory": np.zeros_like(seen["particle_memory"][lost.particles])}


def hit_by(lost: Lost, contacts: Mapping[int, Contact]) -> dict[int, Contact]:
    """Return the contacts of lost particles that hit a body, by their place among these."""
    return {
        k: contacts[particle]
        for k, particle in enumerate(lost.particles.tolist())
        if particle in contacts and kind_of(lost.status[k]) == HIT
    }


def write_lost(state: State, lost: Lost, arrays: Mapping[str, Array]) -> None:
    """Write arrays of lost particles into the state of a leg."""
    for name, values in arrays.items():
        if name in ("particle_clock", "particle_memory"):
            state[name][lost.particles] = values
        else:
            state[name][:, lost.particles] = values
