"""The exact two-body flow on arrays of floats: checks, an exact scaling, and the kernel of `orbits.kernels.kepler`.

Lengths and times are scaled by powers of two, which changes no digit, so that the kernel sees distances and GM of about
1 and no square over- or underflows.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from orbits.elements.invariants import INDISTINCT, Exponents, scaled
from orbits.elements.kepler_equation import Floats
from orbits.elements.refusals import NO_DISTANCE, NO_MASS, RECTILINEAR, broadcast, finite, named, refuse, vectors

TOO_LARGE = "{what} after dt would be beyond the range of floats. Choose units of its own size, or a shorter dt"
NEGATIVE_MASS = "gm = {gm} of the attracting body; expected >= 0"
# Stands for an infinite time, as an exponent of 2: beyond that of any ratio of floats.
NEVER = 10_000


class _Step(NamedTuple):
    """Arrays of one shape (...), in units of 2^length and 2^time."""

    q: Floats  # (..., 3)
    v: Floats  # (..., 3)
    gm: Floats
    dt: Floats
    length: Exponents
    time: Exponents


def two_body(
    q: ArrayLike, v: ArrayLike, gm: ArrayLike, dt: ArrayLike, *, names: Sequence[str] | None = None
) -> tuple[Floats, Floats]:
    """Return position and velocity after the time dt, of bodies that feel one attracting body alone.

    q, v : (..., 3), relative to the attracting body
    gm : (...), G times the mass of both bodies together, consistent units, > 0
    dt : (...), either sign; many periods are reduced to less than one
    names : names of the bodies, for error messages
    All broadcast: one state and an array of dt give an orbit. dt = 0 returns the state itself.

    Raises InputError for non-finite input, gm <= 0, q = 0, and for rectilinear motion, which ends in a collision.
    """
    step = _checked(q, v, gm, dt, named(names))
    refuse(step.gm <= 0.0, NO_MASS, names, gm=scaled(step.gm, 3 * step.length - 2 * step.time))
    h = np.linalg.norm(np.cross(step.q, step.v), axis=-1)
    straight = h <= INDISTINCT * np.linalg.norm(step.q, axis=-1) * np.linalg.norm(step.v, axis=-1)
    refuse(straight, RECTILINEAR, names, h=scaled(h, 2 * step.length - step.time))
    return _moved(step, names)


def any_two_body(q: ArrayLike, v: ArrayLike, gm: ArrayLike, dt: ArrayLike) -> tuple[Floats, Floats]:
    """Return what `two_body` returns, also for gm = 0 and for motion along a line through the centre.

    Without mass motion is straight. Along a line through the centre it is the limit of ever narrower orbits: it comes
    back out of a collision the way it went in. Raises InputError for non-finite input, gm < 0 and q = 0.
    """
    step = _checked(q, v, gm, dt, None)
    refuse(step.gm < 0.0, NEGATIVE_MASS, None, gm=scaled(step.gm, 3 * step.length - 2 * step.time))
    return _moved(step, None)


def _checked(q: ArrayLike, v: ArrayLike, gm: ArrayLike, dt: ArrayLike, names: Sequence[str] | None) -> _Step:
    q, v = vectors("position", q, names), vectors("velocity", v, names)
    gm, dt = finite("gm", gm, names), finite("dt", dt, names)
    first, _, gm, dt = broadcast(names, q=q[..., 0], v=v[..., 0], gm=gm, dt=dt)
    q, v = np.broadcast_to(q, (*first.shape, 3)), np.broadcast_to(v, (*first.shape, 3))
    distance, speed = np.max(np.abs(q), axis=-1), np.max(np.abs(v), axis=-1)
    refuse(distance == 0.0, NO_DISTANCE, names)
    length = np.frexp(distance)[1]
    # The shorter of the times in which gravity and the velocity change the position: gm and v are then about 1 at most.
    fall = np.where(gm != 0.0, (3 * length - np.frexp(gm)[1]) // 2, NEVER)
    flight = np.where(speed != 0.0, length - np.frexp(speed)[1], NEVER)
    time = np.minimum(fall, flight)
    time = np.where(time == NEVER, 0, time)
    return _Step(
        scaled(q, -length[..., None]),
        scaled(v, (time - length)[..., None]),
        scaled(gm, 2 * time - 3 * length),
        scaled(dt, -time),
        length,
        time,
    )


def _moved(step: _Step, names: Sequence[str] | None) -> tuple[Floats, Floats]:
    from orbits.kernels.kepler import kepler_flow  # compiling is for those who move something
    from orbits.kernels.lanes import WIDTH

    count = step.gm.size
    state = np.zeros((6, count + -count % WIDTH))
    state[0], state[4] = 1.0, 1.0  # a circle fills what is left of the last lanes
    gm, dt = np.ones(state.shape[1]), np.zeros(state.shape[1])
    state[:3, :count], state[3:, :count] = step.q.reshape(count, 3).T, step.v.reshape(count, 3).T
    gm[:count], dt[:count] = step.gm.ravel(), step.dt.ravel()
    kepler_flow(state, gm, dt)
    moved = (
        scaled(state[:3, :count].T.reshape(step.q.shape), step.length[..., None]),
        scaled(state[3:, :count].T.reshape(step.v.shape), (step.length - step.time)[..., None]),
    )
    for what, vector in zip(("position", "velocity"), moved, strict=True):
        size = np.max(np.abs(vector), axis=-1)
        refuse(~np.isfinite(size), TOO_LARGE, names, what="the " + what)
    return moved
