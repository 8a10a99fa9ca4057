"""The exact two-body flow on arrays of floats: checks, an exact scaling, and the kernel of
`orbits.kernels.kepler.flow`.

Lengths and times are scaled by powers of two, which is exact, so that distances and GM are about 1 in the kernel and no
square over- or underflows.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from orbits.elements.invariants import INDISTINCT, Exponents, scaled
from orbits.elements.kepler_equation import Floats
from orbits.elements.refusals import NO_DISTANCE, NO_MASS, RECTILINEAR, broadcast, finite, named, refuse, vectors

TOO_LARGE = "{what} after dt would be beyond the range of floats. Choose units of similar size, or a shorter dt"
NEGATIVE_MASS = "gm = {gm} of the attracting body; expected >= 0"
# The exponent of 2 that means an infinite time: beyond the exponent of any ratio of floats.
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
    """Return position and velocity after the time dt, for bodies that move about one attracting body.

    q, v : (..., 3), relative to the attracting body
    gm : (...), G times the total mass of both bodies, in consistent units, > 0
    dt : (...), of either sign; any number of periods
    names : names of the bodies, for error messages
    All arguments broadcast: one state and an array of dt give an orbit. dt = 0 returns the state itself.

    Raises InputError for input that is not finite, gm <= 0, q = 0, and rectilinear motion, which ends in a collision.
    """
    step = _checked(q, v, gm, dt, named(names))
    refuse(step.gm <= 0.0, NO_MASS, names, gm=scaled(step.gm, 3 * step.length - 2 * step.time))
    h = np.linalg.norm(np.cross(step.q, step.v), axis=-1)
    straight = h <= INDISTINCT * np.linalg.norm(step.q, axis=-1) * np.linalg.norm(step.v, axis=-1)
    refuse(straight, RECTILINEAR, names, h=scaled(h, 2 * step.length - step.time))
    return _moved(step, names)


def any_two_body(q: ArrayLike, v: ArrayLike, gm: ArrayLike, dt: ArrayLike) -> tuple[Floats, Floats]:
    """Return what `two_body` returns, also for gm = 0 and for motion along a line through the centre.

    With gm = 0 the motion is straight. Along a line through the centre it is the limit of ever narrower orbits: after a
    collision it returns the way it came. Raises InputError for input that is not finite, gm < 0 and q = 0.
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
    # The shorter of the times in which gravity and velocity change the position: gm and v are then at most about 1.
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
    from orbits.kernels.kepler.flow import kepler_flow  # imported late: it loads Numba
    from orbits.kernels.lanes import WIDTH

    count = step.gm.size
    state = np.zeros((6, count + -count % WIDTH))
    state[0], state[4] = 1.0, 1.0  # circular orbits fill the unused lanes
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
