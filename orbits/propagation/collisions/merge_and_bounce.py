"""What happens when bodies collide: `Merge` and `Bounce`, and the changes that they make, in floats."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from orbits.checks import finite_number
from orbits.errors import InputError
from orbits.integrators.forms import Array
from orbits.propagation.events.base import Action, Sought

if TYPE_CHECKING:
    from orbits.system import System


class OfTwo(Action):
    """An action on two bodies that collide, by the march itself."""

    def check(self, event: Sought, system: System) -> None:
        """Raise InputError for any event but a collision."""
        if not event.collides:
            raise InputError(
                f"{type(event).__name__}(then={self!r}): only bodies that collide can do that; expected "
                f"orbits.events.Collision(then={self!r})."
            )


@dataclass(frozen=True)
class Merge(OfTwo):
    """Two bodies that collide become one: the heavier one stays, with its name, and the other is gone.

    GM and volumes add up; mass, momentum and centre of mass are kept to round-off. The energy that is lost, and the
    angular momentum that becomes a spin, are listed in `run.events`. A massless body vanishes and changes nothing. Of
    equal masses the body that comes first in the system stays. A body that the grown one then overlaps merges at the
    same instant.
    """


@dataclass(frozen=True)
class Bounce(OfTwo):
    """Two bodies that collide bounce off one another, without friction.

    restitution : the speed at which they part as a fraction of that at which they met, along the line of their centres;
        1 keeps the energy, 0 leaves none of it

    Momentum and angular momentum are kept to round-off. Bodies in contact at the same instant bounce one pair after the
    other, in the order of the system. Bodies that come to rest on one another end the run with a SingularityError, as
    their bounces would follow one another without end. Raises InputError for a restitution that is not 0 ... 1.
    """

    restitution: float = 1.0

    def __post_init__(self) -> None:
        value = finite_number(self.restitution, "restitution")
        if not 0.0 <= value <= 1.0:
            raise InputError(f"restitution is {value:g}; expected 0 (no rebound) ... 1 (no loss of energy).")
        object.__setattr__(self, "restitution", value)


class State(NamedTuple):
    """Bodies at a time: GM, radii (n,), q and v (n, 3)."""

    gm: Array
    radii: Array
    q: Array
    v: Array


def heavier_first(gm: Array, i: int, j: int) -> tuple[int, int]:
    """Return two bodies, the heavier one first; of equal ones the one that comes first."""
    i, j = min(i, j), max(i, j)
    return (i, j) if gm[i] >= gm[j] else (j, i)


def merged(state: State, first: int, second: int) -> State:
    """Return the bodies with `second` merged into `first`: its GM is then 0, its position and velocity NaN."""
    gm, radii, q, v = (x.copy() for x in state)
    if gm[second] > 0.0:
        total = gm[first] + gm[second]
        share = gm[second] / total
        # Differences first: positions are O(1 au), radii O(1e-4 au).
        q[first] += share * (q[second] - q[first])
        v[first] += share * (v[second] - v[first])
        gm[first], gm[second] = total, 0.0
        radii[first] = _sphere_of_both(float(radii[first]), float(radii[second]))
    q[second] = v[second] = np.nan
    return State(gm, radii, q, v)


def bounced(state: State, first: int, second: int, restitution: float) -> State:
    """Return the bodies after an impulse along the line of the centres of two of them."""
    gm, radii, q, v = state
    v = v.copy()
    total = gm[first] + gm[second]
    normal = q[second] - q[first]
    normal = normal / math.sqrt(float(normal @ normal))
    kick = (1.0 + restitution) * float((v[second] - v[first]) @ normal) * normal
    v[first] += (gm[second] / total) * kick
    v[second] -= (gm[first] / total) * kick
    return State(gm, radii, q, v)


def approaching(state: State, i: int, j: int) -> bool:
    """Return whether two bodies come closer to each other, forwards in time."""
    return float((state.q[j] - state.q[i]) @ (state.v[j] - state.v[i])) < 0.0


def _sphere_of_both(one: float, other: float) -> float:
    """Return the radius of a sphere with the volume of two."""
    larger, smaller = max(one, other), min(one, other)
    return larger * math.cbrt(1.0 + (smaller / larger) ** 3) if larger > 0.0 else 0.0
