"""Massless particles that are lost though they can be stepped: those that hit a body, fall close to the dominant one or
are ejected.

An impact is seen where a particle that takes steps of its own passes a body within its radius: the list of these
passages has the orbits about the body, which give the times of contact, and these are refined on the motion itself.
Ejections, and pericentres below a limit, are looked for after every 64th step of a run, whatever its blocks are.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbits.integrators.forms import Array
from orbits.kernels.encounters import FASTEST2, LEAST2, MATE, ROW, WHEN
from orbits.marching.passage_list import BlockList
from orbits.marching.retirement import EJECTED, TOO_CLOSE, Lost, hit

TOUCHING, TRIES = 1e-9, 20
"""The distance from a surface, as a fraction of the radius, at which a contact is found; and the most attempts."""


class Contact(NamedTuple):
    """The body that a particle hits, in the order of the kernels, and about when, in steps."""

    body: int
    reading: float


def impacts(
    lists: list[BlockList], radii: Array, gm: Array, h: float, begun: float
) -> tuple[Lost | None, dict[int, Contact]]:
    """Return the particles that first hit a body in a block, and their contacts; None and {} if none does.

    lists : passages of particles at steps of their own; radii, gm : (n,), of the bodies
    begun : the number of steps before the block, or the time, in units of |h|
    """
    rows = np.concatenate([passages[: listed[0]] for passages, listed in lists])
    mates = rows[:, MATE].astype(int)
    rows = rows[rows[:, LEAST2] < radii[mates] ** 2]
    found: dict[int, Contact] = {}
    for row in rows:
        body = int(row[MATE])
        falls = time_from_pericentre(radii[body], math.sqrt(row[LEAST2]), row[FASTEST2], gm[body])
        contact = Contact(body, max(row[WHEN] - falls / abs(h), float(begun)))
        particle = int(row[ROW]) - len(gm)
        if particle not in found or contact.reading < found[particle].reading:
            found[particle] = contact
    if not found:
        return None, {}
    first = min(int(contact.reading) for contact in found.values())
    now = {particle: contact for particle, contact in found.items() if int(contact.reading) == first}
    status = np.array([hit(now[particle].body) for particle in sorted(now)])
    return Lost(first - int(begun), np.array(sorted(now)), status), now


def touching(
    state_after: Callable[[float], tuple[Array, Array]], h: float, part: float, radius: float, own: int, body: int
) -> tuple[float, Array, Array]:
    """Return the part of a time h after which a particle comes to the distance `radius` from a body, and its state
    there, (3,) each.

    state_after : returns q and v, (n, 3), after a time; part : about when; own, body : numbers in these
    """
    q, v = state_after(part * h)
    for _ in range(TRIES):
        apart, speed = q[own] - q[body], v[own] - v[body]
        distance = float(np.linalg.norm(apart))
        fall = float(apart @ speed) / distance
        if not fall * h < 0.0 or abs(distance - radius) <= TOUCHING * radius:
            break
        after = min(max(part - (distance - radius) / (fall * h), 0.0), 1.0)
        if after == part:
            break
        part = after
        q, v = state_after(part * h)
    return part, q[own], v[own]


def time_from_pericentre(r: float, least: float, fastest2: float, mu: float) -> float:
    """Return the time from the pericentre of a Kepler orbit to the distance r, with the distance and the squared speed
    there; to the apocentre, if it is closer.
    """
    e, inverse_a = least * fastest2 / mu - 1.0, 2.0 / least - fastest2 / mu
    if abs(inverse_a) * least < 1e-6:
        d = math.sqrt(max(r / least - 1.0, 0.0))
        return math.sqrt(2.0 * least**3 / mu) * (d + d**3 / 3.0)
    a = abs(1.0 / inverse_a)
    if inverse_a < 0.0:
        H = math.acosh(max((1.0 + r / a) / e, 1.0))
        return math.sqrt(a**3 / mu) * (e * math.sinh(H) - H)
    E = math.acos(min(max((1.0 - r / a) / max(e, 1e-300), -1.0), 1.0))
    return math.sqrt(a**3 / mu) * (E - e * math.sin(E))


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
        swept2 = v2 * r * r - (x * w).sum(axis=0) ** 2
        e2 = 1.0 + swept2 / mu * (v2 / mu - 2.0 / r)
        status[swept2 / mu < lost_within * (1.0 + np.sqrt(np.maximum(e2, 0.0)))] = TOO_CLOSE
    if ejected_beyond is not None:
        status[(r > ejected_beyond) & (v2 * r > 2.0 * mu)] = EJECTED
    found = np.flatnonzero(status)
    return found, status[found]
