"""The passages that a method cannot follow which moves bodies on Kepler orbits about a dominant one.

Within three Hill radii of a planet, a body is not near a Kepler orbit about the dominant one; steps that do not resolve
a pericentre are in resonance with it; and the kicks on the way past a planet, at `ways` times the way in a step, add up
to its attraction but for a fraction exp(-2 pi ways): of a retrograde particle at a few Hill radii, to nothing like it.

Source: Rauch & Holman (1999), AJ 117, 1087; Wisdom (2015), AJ 150, 127.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbits.integrators.forms import Array
from orbits.kernels.maps.nearest import HILL_RADII as HILL_RADII
from orbits.kernels.search.record import ABOUT, FASTEST2, LEAST2, MATE, ROW, STEP
from orbits.kernels.steps import NEAR_A_PLANET, NOT_RESOLVED
from orbits.marching.following.retirement import Lost
from orbits.marching.watching.passage_list import BlockList

FOLLOWED = 4.0
"""Hill radii of a planet within which massless particles take steps of their own, if they are followed. At 4 instead of
3, positions after encounters with Jupiter in steps of 100 d have a fourth of the error."""

PLANET_WAYS = 1.0
"""Of the way in a step of two planets relative to each other, the multiple within which a passage is an encounter."""

FLYBY = 16.0
"""The angle of a step, times the steps in a full turn that resolve a pericentre, above which it does not resolve the
flyby of a planet by a massless particle: a passage at less than the way in a step, where there are 16 of these."""

SPARED = 1e-12
"""The error of the attraction by a planet on the way past it, as a fraction of that by the dominant body, up to which
the map takes a particle past it."""


def reach(about: Array, gm: Array, dominant: float) -> Array:
    """Return the distances within which bodies that are at `about`, (..., 3), from the dominant one come too close.

    gm : (...,), of both bodies; dominant : GM of the dominant one
    """
    near: Array = HILL_RADII * np.linalg.norm(about, axis=-1) * np.cbrt(gm / (3.0 * dominant))
    return near


def near_a_planet(q: Array, planets: Array, gm: Array, dominant: float) -> NDArray[np.intp]:
    """Return of each particle the number of a planet within whose reach it is, the deepest; -1 if there is none.

    q, planets : (m, 3) and (p, 3), relative to the dominant body; gm : (p,), of the planets; dominant : its GM
    """
    found, share = np.full(len(q), -1), np.ones(len(q))
    for k, (place, near) in enumerate(zip(planets, reach(planets, gm, dominant), strict=True)):
        with np.errstate(over="ignore"):  # the square of a distance beyond 1e154
            depth = np.linalg.norm(q - place, axis=1) / near
        deeper = depth < share
        found[deeper], share[deeper] = k, depth[deeper]
    return found


def near_planets(gm: Array, dominant: int) -> Array:
    """Return what decides which passages of planets massless particles take by steps of their own, (2, n): see
    `orbits.kernels.search.encounters_of_particles.Rules`. The kicks on the way past a planet of mass m, at `ways` times
    the way in a step, add up to its attraction but for `SPARED` of that of the dominant body.
    """
    share = gm / gm[dominant]
    near: Array = np.array([(FOLLOWED * np.cbrt(share / 3.0)) ** 2, ways_to_spare(share) ** 2])
    near[:, dominant] = 0.0
    return near


def ways_to_spare(share: Any) -> Any:
    """Return at how many ways in a step a particle passes a planet without harm, numbers or arrays; 0 for a planet that
    is too light to do any.

    share : the mass of the planet, as a fraction of that of the dominant body
    """
    return np.log(np.maximum(share / SPARED, 1.0)) / (2.0 * math.pi)


def near_each_other(gm: Array, dominant: int) -> Array:
    """Return what decides which passages of planets by each other the map cannot follow, (n, 2, n): see
    `orbits.kernels.search.encounters_of_planets`. Each pair stands once, with the planet of the larger number as the
    one that is passed.
    """
    n = len(gm)
    share = (gm[:, None] + gm[None, :]) / gm[dominant]
    near = np.zeros((n, 2, n))
    near[:, 0] = (FOLLOWED * np.cbrt(share / 3.0)) ** 2
    near[:, 1] = PLANET_WAYS**2
    near[:, :, dominant] = near[dominant] = 0.0
    near *= np.triu(np.ones((n, n)), 1)[:, None, :]
    return near


def is_unresolved(h: float, distance: Any, speed: Any, enough: int) -> Any:
    """Return whether steps of h are fewer than `enough` in a full turn at passages of the dominant body, numbers or
    arrays.
    """
    return abs(h) * speed > 2.0 * math.pi / enough * distance


def ways_too_fast(share: Any, enough: int) -> Any:
    """Return within how many of its ways in a step a massless particle passes a planet too fast, numbers or arrays.

    share : as in `ways_to_spare`; enough : the steps in a full turn that resolve a passage of the dominant body
    """
    return np.minimum(enough / FLYBY, ways_to_spare(share))


class Meeting(NamedTuple):
    """Two planets that come too close to each other: before which step of a block, which rows, and their distance."""

    steps: int
    pair: tuple[int, int]
    distance: float


def first_meeting(listed: BlockList, gm: Array, dominant: int, begun: int) -> Meeting | None:
    """Return the first passage of two planets within `HILL_RADII` mutual Hill radii in the list of the massive bodies
    of a block; gm : (n,); begun : the number of steps before the block
    """
    rows = listed.passages[: listed.listed[0]]
    row, mate, least = rows[:, ROW].astype(int), rows[:, MATE].astype(int), np.sqrt(rows[:, LEAST2])
    near = reach(rows[:, ABOUT : ABOUT + 3], gm[row] + gm[mate], gm[dominant])
    close = (row != dominant) & (mate != dominant) & (least < near)
    if not close.any():
        return None
    first = min(np.flatnonzero(close), key=lambda k: rows[k, STEP])
    return Meeting(int(rows[first, STEP]) - begun, (int(row[first]), int(mate[first])), float(least[first]))


def lost_in(
    lists: list[BlockList], gm: Array, massive: int, dominant: int, h: float, begun: int, enough: int
) -> Lost | None:
    """Return the massless particles that come first, of those in the lists of a block, to a passage that the method
    cannot follow, and before which step of the block; None if none does.

    gm : (rows,), of the massive bodies, then of the particles; begun : the number of steps before the block
    enough : the steps in a full turn that resolve a passage of the dominant body
    """
    rows = np.concatenate([passages[: listed[0]] for passages, listed in lists])
    rows = rows[rows[:, ROW] >= massive]  # the row of a particle is the first one of the two
    if not len(rows):
        return None
    mate, least = rows[:, MATE].astype(int), np.sqrt(rows[:, LEAST2])
    central, speed = mate == dominant, np.sqrt(rows[:, FASTEST2])
    near = least < reach(rows[:, ABOUT : ABOUT + 3], gm[mate], gm[dominant])
    fast = least < abs(h) * speed * ways_too_fast(gm[mate] / gm[dominant], enough)
    close = ~central & (near | fast)
    sharp = central & is_unresolved(h, least, speed, enough)
    rows, close = rows[close | sharp], close[close | sharp]
    if not len(rows):
        return None
    steps = rows[:, STEP].astype(int) - begun
    now = steps == steps.min()
    particles, first = np.unique(rows[now, ROW].astype(int) - massive, return_index=True)
    return Lost(int(steps.min()), particles, np.where(close[now][first], NEAR_A_PLANET, NOT_RESOLVED))
