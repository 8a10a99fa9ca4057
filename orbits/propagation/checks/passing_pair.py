"""Two bodies in a passage: their relative orbit, and their motion through it, exact and by a method.

Two bodies are a pair alone if one of them dominates the system, or they are bound to each other; their exact motion is
a conic. In a flyby of a third body the dominant one takes part: in steps of weeks it bends the way of a comet past a
planet, which no conic about the planet follows. Their exact motion is marched in steps that are chosen one by one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from orbits.elements import elements_from_state
from orbits.elements.two_body import any_two_body
from orbits.errors import InputError
from orbits.integrators.base import Integrator
from orbits.integrators.forms import Array
from orbits.integrators.gauss import Gauss
from orbits.kernels.search.apsides import apsides_of
from orbits.marching.clocks.adaptive import Adaptive
from orbits.marching.clocks.step_times import Place
from orbits.point_masses import PointMasses
from orbits.propagation.marchers import LIGHT, march_of

if TYPE_CHECKING:
    from orbits.marching.clocks.clock import Clock
    from orbits.results.passages import Passage
    from orbits.system import System


METHOD = Gauss(stages=8)
"""The method of exact motions."""

REFERENCE_ANGLE, MOST_STEPS = 0.1, 20_000
"""Angle per step of the reference solution of a softened pair, whose orbits are not conics, and the largest number of
steps of a march, which take some milliseconds."""

MOST_ECCENTRICITY, MOST_ANGLE = 1e8, 1e6
"""Orbits of larger eccentricity are straight lines; passages with a larger angle per step fall into the centre."""

TWO_PI = 2.0 * math.pi


class Orbit(NamedTuple):
    """A conic: eccentricity, pericentre distance and speed, apocentre distance and period (infinite if open)."""

    e: float
    least: float
    speed: float
    farthest: float
    period: float


@dataclass(frozen=True, eq=False)
class Pair:
    """A body and the other body that it passes, at the beginning of a step; floats in one system of units.

    mu : total GM of both; share : the other body's fraction of it
    q, v : (3,) of the body relative to the other
    softening : length
    dominant_gm : GM of the body that dominates the system, 0 if none does
    other_q, other_v : (3,) of the other body relative to the dominant body; zeros if it is the dominant body
    seen : time to the pericentre, distance and speed there, if they were recorded; else they are those of the conic
    """

    mu: float
    share: float
    q: Array
    v: Array
    softening: float = 0.0
    dominant_gm: float = 0.0
    other_q: Array = field(default_factory=lambda: np.zeros(3))
    other_v: Array = field(default_factory=lambda: np.zeros(3))
    seen: tuple[float, float, float] | None = None

    @classmethod
    def of(cls, passage: Passage, system: System, clock: Clock, dominant: int) -> Pair | None:
        """Return the lighter body and the other of a passage; None if the states are not known.

        dominant : number of the body that dominates the system, or -1
        """
        if passage.state is None or passage.about is None:
            return None
        gm, state, about = system.values.gm, passage.state, passage.about
        light, heavy, other = passage.body, passage.other, about - state
        if gm[light] > gm[heavy]:
            light, heavy, state, other = heavy, light, -state, about
        seen = clock.time(passage.steps) - clock.time(passage.step), passage.distance, passage.speed
        return replace(cls._among(system, light, heavy, dominant, state, other), seen=seen)

    @classmethod
    def now(cls, system: System, light: int, heavy: int, dominant: int) -> Pair:
        """Return two bodies of a system; dominant : as for `of`."""
        x = np.concatenate([system.values.q, system.values.v], axis=1)
        return cls._among(system, light, heavy, dominant, x[light] - x[heavy], x[heavy] - x[dominant])

    @classmethod
    def _among(cls, system: System, light: int, heavy: int, dominant: int, state: Array, other: Array) -> Pair:
        """Return two bodies with the state of one relative to the other, and of that relative to the dominant body."""
        gm, alone = system.values.gm, dominant < 0 or heavy == dominant
        mu = float(gm[light] + gm[heavy])
        return cls(
            mu,
            float(gm[heavy]) / mu,
            state[:3],
            state[3:],
            system.values.softening,
            float(gm[dominant]) if dominant >= 0 else 0.0,
            np.zeros(3) if alone else other[:3],
            np.zeros(3) if alone else other[3:],
        )

    def after(self, time: float) -> Pair:
        """Return the pair after a time of either sign, by its exact motion."""
        seen = None if self.seen is None else (self.seen[0] - time, *self.seen[1:])
        if self.is_flyby:
            exactly = Adaptive().towards(1 if time > 0.0 else -1)  # to round-off
            q, v = _marched(METHOD, self._three, exactly, Place(0, time))
            return replace(self, q=q[2] - q[1], v=v[2] - v[1], other_q=q[1] - q[0], other_v=v[1] - v[0], seen=seen)
        q, v = _flow(self.mu, self.softening, self.q, self.v, time)
        if not self.other_q.any():
            return replace(self, q=q, v=v, seen=seen)
        other_q, other_v = any_two_body(self.other_q, self.other_v, self.dominant_gm + self.share * self.mu, time)
        return replace(self, q=q, v=v, other_q=other_q, other_v=other_v, seen=seen)

    @cached_property
    def is_flyby(self) -> bool:
        """Whether the dominant body is a third one, and takes part in the passage."""
        return self.dominant_gm > 0.0 and bool(self.other_q.any()) and not self.is_bound()

    @property
    def _three(self) -> PointMasses:
        """The dominant body, at rest at the origin, the other and the body; a massless one with a mass that moves no
        last bit of them, so that all are one problem.
        """
        body = max((1.0 - self.share) * self.mu, LIGHT * self.mu)
        gm = np.array([self.dominant_gm, max(self.share * self.mu, LIGHT * self.mu), body])
        q = np.array([np.zeros(3), self.other_q, self.other_q + self.q])
        return PointMasses(gm, q, np.array([np.zeros(3), self.other_v, self.other_v + self.v]), self.softening)

    @property
    def about_dominant(self) -> Pair:
        """The body and the dominant one, which is then the other."""
        gm = self.dominant_gm + (1.0 - self.share) * self.mu
        q, v = self.other_q + self.q, self.other_v + self.v
        return Pair(gm, self.dominant_gm / gm, q, v, self.softening, self.dominant_gm)

    def error_after(self, integrator: Integrator, h: float, steps: int, exact: Pair) -> tuple[Array, Array]:
        """Return the errors of q and v after some steps of the method, in a flyby those about the dominant body.

        exact : the pair there
        """
        if self.is_flyby:
            q, v = _marched(integrator, self._three, h, Place(steps, 0.0))
            return q[2] - q[0] - (exact.q + exact.other_q), v[2] - v[0] - (exact.v + exact.other_v)
        end_q, end_v = march_pair(integrator, self.mu, self.softening, self.q, self.v, h, steps)
        return end_q - exact.q, end_v - exact.v

    @cached_property
    def orbit(self) -> Orbit:
        """The relative orbit."""
        if self.seen is not None:
            _, least, speed = self.seen
            square = least * speed * speed / self.mu
            return _orbit(least, speed, abs(square - 1.0), (2.0 - square) / least, self.mu)
        e, least, _, swept2, inverse_a = (float(x) for x in apsides_of(self.q, self.v, self.mu))
        if not (least > 0.0 and math.isfinite(e)):  # into the centre, or beyond the range of floats
            return Orbit(1.0, 0.0, math.inf, math.inf, math.inf)
        return _orbit(least, math.sqrt(swept2) / least, e, inverse_a, self.mu)

    @cached_property
    def ahead(self) -> float:
        """The time to the nearest pericentre; negative if it is past."""
        if self.seen is not None:
            return self.seen[0]
        try:
            return float(elements_from_state(self.q, self.v, self.mu).T)
        except InputError:  # a radial fall, or almost no attraction: in both cases a straight line
            speed2 = float(self.v @ self.v)
            return -float(self.q @ self.v) / speed2 if speed2 > 0.0 else 0.0

    @cached_property
    def speed(self) -> float:
        """The relative speed at the pericentre; for a softened pair from its potential."""
        if self.softening == 0.0 or self.seen is not None:
            return self.orbit.speed
        near = 1.0 / math.hypot(self.orbit.least, self.softening)
        here = 1.0 / math.hypot(float(np.linalg.norm(self.q)), self.softening)
        return math.sqrt(float(self.v @ self.v) + 2.0 * self.mu * max(near - here, 0.0))

    @property
    def rate(self) -> float:
        """Speed / distance at the pericentre, radians per time."""
        softened = math.hypot(self.orbit.least, self.softening)
        return self.speed / softened if softened > 0.0 else math.inf

    def shape(self, h: float) -> tuple[float, float]:
        """Return the eccentricity, and the angle of a step of h at the pericentre, at most 1e6.

        For a softened pair both refer to the softened distance.
        """
        try:
            e, rate = self.orbit.e, self.rate
            if self.softening > 0.0:
                e = max(math.hypot(self.orbit.least, self.softening) * self.speed * self.speed / self.mu - 1.0, 0.0)
        except ArithmeticError:  # beyond the range of floats
            return 1.0, MOST_ANGLE
        return e if e < MOST_ECCENTRICITY else MOST_ECCENTRICITY, min(abs(h) * rate, MOST_ANGLE)

    def is_bound(self) -> bool:
        """Whether the two stay together: on an ellipse, within the Hill radius of the other body if it has one."""
        if not math.isfinite(self.orbit.farthest):
            return False
        if self.dominant_gm == 0.0 or not self.other_q.any():
            return True
        hill = float(np.linalg.norm(self.other_q)) * math.cbrt(self.share * self.mu / (3.0 * self.dominant_gm))
        return self.orbit.farthest < hill


def _orbit(least: float, speed: float, e: float, inverse_a: float, mu: float) -> Orbit:
    if not inverse_a > 0.0:
        return Orbit(e, least, speed, math.inf, math.inf)
    a = 1.0 / inverse_a
    return Orbit(e, least, speed, a * (1.0 + e), TWO_PI * a * math.sqrt(a / mu))


def march_pair(
    integrator: Integrator, mu: float, softening: float, q: Array, v: Array, h: float, steps: int
) -> tuple[Array, Array]:
    """Return the relative state of two bodies, here of equal masses, after some steps of the method."""
    halves = np.array([0.5 * mu, 0.5 * mu]), np.array([-0.5 * q, 0.5 * q]), np.array([-0.5 * v, 0.5 * v])
    end_q, end_v = _marched(integrator, PointMasses(*halves, softening), h, Place(steps, 0.0))
    return end_q[1] - end_q[0], end_v[1] - end_v[0]


def _marched(
    integrator: Integrator, bodies: PointMasses, clock: Clock | float, place: Place
) -> tuple[Array, Array]:
    """Return q and v of bodies to which a march of the method leads; clock : or a step. Raises InputError if it takes
    more steps than any passage.
    """
    marcher = march_of(bodies, integrator, clock)
    while marcher.is_before(place):
        if marcher.step > MOST_STEPS:
            raise InputError("the bodies go round too often to be followed.")
        marcher.approach(place)
    return marcher.state_at(place)


def _flow(mu: float, softening: float, q: Array, v: Array, time: float) -> tuple[Array, Array]:
    """Return the relative state of two bodies after a time: exact, or for a softened pair to round-off."""
    if softening == 0.0:
        return any_two_body(q, v, mu, time)
    steps = abs(time) * Pair(mu, 0.0, q, v, softening).rate / REFERENCE_ANGLE
    if not steps < MOST_STEPS:
        raise InputError("the orbit of a softened pair is too long to be followed.")
    steps = max(1, math.ceil(steps))
    return march_pair(METHOD, mu, softening, q, v, time / steps, steps)
