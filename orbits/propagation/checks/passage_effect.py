"""The effect of a close passage on the rest of a run.

The bodies of the passage are marched through it, with the method, step and phase of the run, and compared with the
exact motion, from the start of the run at the earliest: one that starts near a pericentre keeps the error of half a
passage. The difference is propagated along the orbit about the primary to the end of the run: a passage is judged
by the position error that it causes there. The primary is the other body if the two are bound to each other, else the
body that dominates the system.

Not included are what other bodies do meanwhile, and the growth of the error in later encounters; and errors of several
passages may cancel. Where one passage dominates, the effect was 0.85 to 1.2 times the error of the run in all runs that
were tried: flybys of Venus, the Earth and Jupiter and pericentres, errors of 1 to 1e9 km, methods of orders 2 to 16.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from orbits.elements import state_from_elements
from orbits.elements.two_body import any_two_body
from orbits.errors import InputError, IntegrationError
from orbits.integrators.base import Integrator
from orbits.integrators.forms import Array
from orbits.propagation.checks.passing_pair import Pair, march_pair

SPOILT = 100.0
"""A passage spoils a run if its error exceeds this many times the error on an unperturbed orbit."""

NEGLIGIBLE = 1e-9
"""Errors below this fraction of the distance to the primary are not reported."""

GROWTH = 6.0
"""A velocity error displaces a body by at most this factor times the error times the remaining time."""

RADIANS = 10.0
"""Length of the march on each side of the pericentre, in units of distance / speed there; at most half an ellipse."""

FINE = 0.01
"""Passages with smaller angles per step are marched in steps of this angle, and the error is scaled by the order."""

NOT_FOLLOWED = (InputError, IntegrationError, ArithmeticError, ValueError)
"""Errors raised where orbits leave the range of floats, or are too long."""

CIRCLE = 20.0
"""Length of the march on an unperturbed orbit, in radians."""

GRID = 8
"""Angles and eccentricities are rounded up to this many values per octave, so that results can be cached."""

LINEAR = 1e-6
"""Smaller errors, relative to the state, are scaled up to this before they are propagated along an orbit, and scaled
down afterwards: otherwise rounding would dominate the difference of two orbits."""


class Effect(NamedTuple):
    """The effect of a passage on a run.

    error : the position error of the body at the end of the run that the passage causes
    usual : the method's error on an unperturbed orbit over the whole run; infinite if there is no primary
    distance : from the primary, at the end of the run
    passages : how many such passages cause the error together
    """

    error: float
    usual: float
    distance: float
    passages: int = 1

    @property
    def spoils(self) -> bool:
        """Whether the passage spoils the rest of the run."""
        return self.error > self.limit

    @property
    def limit(self) -> float:
        """The largest error that does not spoil a run."""
        return max(SPOILT * self.usual, self.noticeable)

    @property
    def noticeable(self) -> float:
        """The smallest error that is reported."""
        return NEGLIGIBLE * self.distance


def effect(
    integrator: Integrator, h: float, pair: Pair, left: float, span: float, begun: float | None = None
) -> Effect:
    """Return the effect of a passage on a run with steps of h.

    pair : at the beginning of the step that contains the pericentre
    left, span : time from there to the end of the run, and length of the whole run; signs as h
    begun : time from the start of the run to there; by default span - left
    If the orbits cannot be followed, `error` and `usual` are both infinite: nothing is known.
    """
    try:
        with np.errstate(all="ignore"):
            return _effect(integrator, h, pair, left, span, span - left if begun is None else begun)
    except NOT_FOLLOWED:
        return Effect(math.inf, math.inf, 0.0)


def _effect(integrator: Integrator, h: float, pair: Pair, left: float, span: float, begun: float) -> Effect:
    rate, period = pair.rate, pair.orbit.period
    angle = abs(h) * rate
    scale = 1.0
    if angle < FINE:
        scale, h = (angle / FINE) ** integrator.order, h * FINE / angle
    half = min(RADIANS / rate, 0.5 * period) if rate > 0.0 else abs(h)
    steps = max(2, math.ceil(half / abs(h)))
    after = steps + 1
    if left * h > 0.0:  # not beyond the end of the run, nor before its start
        after = max(1, min(after, math.ceil(left / h)))
        steps = max(0, min(steps, round(begun / h)))
    end = after * h
    exact = pair.after(end)
    try:
        start, count = pair.after(-steps * h), steps + after
        dq, dv = start.error_after(integrator, h, count, exact)
        if pair.is_flyby:  # without what the method gets wrong on the orbit about the dominant body alone
            alone = start.about_dominant
            usual_dq, usual_dv = alone.error_after(integrator, h, count, alone.after(count * h))
            dq, dv = dq - usual_dq, dv - usual_dv
        dq, dv = scale * dq, scale * dv
    except IntegrationError:
        dq, dv = np.zeros(3), -2.0 * exact.v  # the largest possible error
    rest = left - end if (left - end) * h > 0.0 else 0.0
    error, distance, axis, mu = _carried(exact, dq, dv, rest)
    usual = math.inf
    if mu > 0.0:
        usual = axis * _undisturbed(integrator, abs(h), math.sqrt(mu / axis) / axis, abs(span))
    return Effect(error, usual, distance)


def _carried(exact: Pair, dq: Array, dv: Array, rest: float) -> tuple[float, float, float, float]:
    """Return the body's position error and distance from the primary after `rest`, and the orbit's axis and GM.

    exact, dq, dv : the pair after its passage, and its error, in a flyby that of the body about the dominant one
    The axis is the semi-major axis, or the distance for open orbits; GM is 0 without a primary.
    """
    q, v = exact.q, exact.v
    if exact.is_bound():
        mu, share = exact.mu, exact.share
    elif exact.dominant_gm > 0.0:
        mu, share = exact.dominant_gm + (1.0 - exact.share) * exact.mu, 1.0
        q, v = q + exact.other_q, v + exact.other_v
        if not exact.is_flyby:
            dq, dv = exact.share * dq, exact.share * dv
    else:
        mu, share = 0.0, exact.share
    size = max(_ratio(dq, q), _ratio(dv, v))
    boost = LINEAR / size if 0.0 < size < LINEAR else 1.0
    ends, _ = any_two_body(np.array([q, q + boost * dq]), np.array([v, v + boost * dv]), mu, rest)
    distance = float(np.linalg.norm(ends[0]))
    axis = float(np.linalg.norm(q))
    if mu > 0.0:
        inverse = 2.0 / axis - float(v @ v) / mu
        axis = 1.0 / inverse if inverse > 0.0 else axis
    return share * float(np.linalg.norm(ends[1] - ends[0])) / boost, distance, axis, mu


def _undisturbed(integrator: Integrator, h: float, motion: float, span: float) -> float:
    """Return the method's phase error on a circle after `span`, including round-off, in radians."""
    angle = h * motion
    rounded = max(FINE, 2.0 ** (math.ceil(GRID * math.log2(angle)) / GRID))
    try:
        rate = _circle(integrator, rounded)
    except TypeError:  # a method whose fields cannot be hashed
        rate = _circle.__wrapped__(integrator, rounded)
    turned = motion * span
    return turned * (rate * min(angle / FINE, 1.0) ** integrator.order + 2.0**-53 * math.sqrt(span / h))


@lru_cache(maxsize=1024)
def _circle(integrator: Integrator, angle: float) -> float:
    """Return the error per radian of a circle of radius 1 marched in steps of `angle`; at most 1."""
    steps = max(2, math.ceil(CIRCLE / angle))
    q, v = state_from_elements(1.0, a=1.0, M=np.array([0.0, steps * angle]))
    try:
        end, _ = march_pair(integrator, 1.0, 0.0, q[0], v[0], angle, steps)
    except IntegrationError:
        return 1.0
    return min(float(np.linalg.norm(end - q[1])) / (steps * angle), 1.0)


def _ratio(dx: Array, x: Array) -> float:
    size = float(np.linalg.norm(x))
    return float(np.linalg.norm(dx)) / size if size > 0.0 else math.inf
