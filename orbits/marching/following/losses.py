"""Massless particles that are removed although they can be stepped: by impact, a small pericentre or ejection.

An impact is seen where a particle that takes steps of its own passes a body within its radius, or is still falling
within it when a block ends: so it is seen in the block in which it happens. The step of contact is then sought in the
states at the ends of steps, and the place in it on the motion itself, so that blocks and samples do not change it.
Ejections, and pericentres below a limit, are looked for after every 64th step of a run, whatever its blocks are.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbits.integrators.forms import Array
from orbits.kernels.search.apsides import apsides_of
from orbits.kernels.search.record import LEAST2, MATE, ROW
from orbits.marching.first_passage import Within
from orbits.marching.following.retirement import EJECTED, TOO_CLOSE
from orbits.marching.stepping.failures import last_good
from orbits.marching.watching.passage_list import BlockList

BEYOND = 1.01
"""The part of a step up to which a contact is sought: a partial step of a map ends not quite where the step does."""


class Contact(NamedTuple):
    """Where a particle hits a body, in the order of the kernels: the part of a step after which it does, the time since
    the start of the run, and its state there, (3,) each.
    """

    body: int
    part: float
    time: float
    q: Array
    v: Array


class Suspect(NamedTuple):
    """A particle that may hit a body in a block, if it comes from outside: it is within the radius of the body in this
    step of the block, or at its end, or was before.
    """

    particle: int
    body: int
    step: int


def passages_within(lists: list[BlockList], radii: Array) -> Array:
    """Return the passages of massless particles, (passages, columns), whose pericentres are within bodies; radii :
    (n,), of these.
    """
    rows = np.concatenate([passages[: listed[0]] for passages, listed in lists])
    rows = rows[rows[:, ROW] >= len(radii)]
    within: Array = rows[rows[:, LEAST2] < radii[rows[:, MATE].astype(int)] ** 2]
    return within


def without_dominant(lists: list[BlockList], bodies: int, dominant: int) -> None:
    """Remove the passages of massless particles by the dominant body from lists."""
    for passages, listed in lists:
        rows = passages[: listed[0]]
        kept = rows[(rows[:, ROW] < bodies) | (rows[:, MATE] != dominant)]
        listed -= len(rows) - len(kept)
        passages[: len(kept)] = kept


def falling_within(q: Array, v: Array, bodies: tuple[Array, Array], radii: Array, direction: float) -> Array:
    """Return which particles are within which bodies, and come still closer to them, (m, n) bool.

    q, v : (3, m); bodies : positions and velocities, (3, n) each; radii : (n,); direction : of the march, 1 or -1
    """
    apart, speed = q[:, :, None] - bodies[0][:, None, :], v[:, :, None] - bodies[1][:, None, :]
    falls = (apart * speed).sum(axis=0) * direction < 0.0
    found: Array = ((apart * apart).sum(axis=0) < radii * radii) & falls
    return found


def first_step_within(suspect: Suspect, is_within: Callable[[int], bool]) -> int:
    """Return the step of a block in which a particle comes within a body, and 0 if it was before.

    is_within : tells it for the beginning of a step; it is asked for as few steps as possible
    """
    inside, back = suspect.step, 1
    if inside == 0 or not is_within(inside):
        return inside
    outside = inside - 1
    while outside > 0 and is_within(outside):
        inside, back = outside, 2 * back
        outside = max(inside - back, 0)
    return last_good(lambda step: not is_within(step), inside, outside)


def touching(
    state_after: Callable[[float], tuple[Array, Array]], h: float, radius: float, own: int, body: int
) -> tuple[float, Array, Array] | None:
    """Return the part of a step h after which a particle comes to the distance `radius` from a body, and its state
    there, (3,) each; 0 if it begins within it, None if it passes.

    state_after : returns q and v, (n, 3), after a time, NaN for what is lost; own, body : numbers in these
    """
    within = Within(h, state_after(0.0), state_after(h), lambda part: state_after(part * h))
    q, _ = within.state(0.0)
    part: float | None = 0.0
    if float(np.linalg.norm(q[own] - q[body])) > radius:
        part = within.first_passage(body, own, radius)
        part = within.first_passage(body, own, radius, part=(1.0, BEYOND)) if part is None else part
    if part is None:
        return None
    q, v = within.state(part)
    return part, q[own], v[own]


def departures(
    q: Array, v: Array, centre: tuple[Array, Array], mu: float, ejected_beyond: float | None, lost_within: float | None
) -> tuple[NDArray[np.intp], NDArray[np.int64]]:
    """Return the particles that are ejected, or whose pericentres are too close to the dominant body, and their status.

    q, v : (3, m); centre : position and velocity of the dominant body, (3,) each; mu : its GM
    """
    x, w = q - centre[0][:, None], v - centre[1][:, None]
    r, v2 = np.sqrt((x * x).sum(axis=0)), (w * w).sum(axis=0)
    status = np.zeros(len(r), dtype=np.int64)
    if lost_within is not None:
        status[apsides_of(x.T, w.T, mu).least < lost_within] = TOO_CLOSE
    if ejected_beyond is not None:
        status[(r > ejected_beyond) & (v2 * r > 2.0 * mu)] = EJECTED
    found = np.flatnonzero(status)
    return found, status[found]
