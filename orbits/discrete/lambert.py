"""The exact discrete Lagrangian of the Kepler problem, by Lambert's theorem in universal form.

With r0, r1 the distances, c the chord, 2 s = r0 + r1 + c, and lambda = +- sqrt(1 - c/s), > 0 if the transfer angle is
below 180 degrees, every property of an arc of less than one revolution is a function of psi, half the difference of the
eccentric anomalies, or rather of u = psi^2: > 0 on an ellipse, 0 on a parabola, < 0 on a hyperbola:

    eta^2 = 1 - 2 lambda cos psi + lambda^2 = (1 - lambda)^2 + 4 lambda sin^2(psi/2)
    sqrt(2 mu / s^3) h = T(u) = eta^3 (psi - sin psi cos psi)/sin^3 psi + 2 lambda eta
    L_d = sqrt(2 mu s) [3/2 eta psi/sin psi + 1/2 eta cos psi - lambda sin^2(psi)/eta]
    v0 = k (q1 - q0 + s eta^2 q0/r0),   v1 = k (q1 - q0 - s eta^2 q1/r1),   k = sqrt(mu/2)/(lambda s^{3/2} eta)

This is alpha - beta = 2 psi in Lagrange's form of the theorem, and L_d = sqrt(mu a) [(alpha + sin alpha) - (beta + sin
beta)] + mu h/(2a), without 0/0 at the parabola. On hyperbolas of the long way terms cancel, but not in

    T(u) = eta {(1 + lambda)^2 (psi - sin psi cos psi) - 2 lambda (1 + cos psi) (psi - sin psi)}/sin^3 psi
    L_d = sqrt(2 mu s) [3/2 eta psi/sin psi + {(1 + lambda^2)/2 cos psi - lambda}/eta]

T increases from 0 to infinity with u, so there is one arc of less than one revolution for each way round. At 180
degrees lambda = 0: the plane of the orbit is not determined, and L_d is not differentiable.

Source: Battin (1999), sec. 6.6-7.1; Izzo (2015) for x = (cos psi - lambda)/eta, y = eta + lambda x.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from orbits.checks import is_one_of, positive_number
from orbits.discrete.base import Array, DiscreteLagrangian, Mechanics
from orbits.errors import ConvergenceError, InputError
from orbits.lagrangians.base import show

Way = Literal["short", "long"]

SERIES_BELOW = 4.0
SERIES_TERMS = 22
ALIGNED = 1e-10
"""At transfer angles nearer than this to 180 or 360 degrees the plane of the orbit has no digit left."""


def stumpff(z: float) -> tuple[float, float, float, float, float, float]:
    """Return Stumpff's functions c0 ... c5 of z, of either sign: c_k(z) = 1/k! - z/(k+2)! + z^2/(k+4)! - ..."""
    if abs(z) < SERIES_BELOW:
        c4 = c5 = 1.0
        for k in range(SERIES_TERMS, 0, -1):
            c4 = 1.0 - z / ((2 * k + 3) * (2 * k + 4)) * c4
            c5 = 1.0 - z / ((2 * k + 4) * (2 * k + 5)) * c5
        c4, c5 = c4 / 24.0, c5 / 120.0
        c2, c3 = 0.5 - z * c4, 1.0 / 6.0 - z * c5
        return 1.0 - z * c2, 1.0 - z * c3, c2, c3, c4, c5
    x = math.sqrt(abs(z))
    if z > 0.0:
        c0, c1, c2, c3 = math.cos(x), math.sin(x) / x, 2.0 * math.sin(0.5 * x) ** 2 / z, (x - math.sin(x)) / (z * x)
    else:
        c0, c1, c2, c3 = (
            math.cosh(x),
            math.sinh(x) / x,
            -2.0 * math.sinh(0.5 * x) ** 2 / z,
            (x - math.sinh(x)) / (z * x),
        )
    return c0, c1, c2, c3, (0.5 - c2) / z, (1.0 / 6.0 - c3) / z


class _Arc(NamedTuple):
    """The functions of u at one arc: eta, T, L_d / sqrt(2 mu s), and derivatives."""

    eta: float
    time: float
    action: float
    eta_u: float
    time_u: float
    eta_lambda: float
    time_lambda: float


def _arc(u: float, way: float, gap: float, eta2: float | None = None) -> _Arc:
    """Return the functions of u; way is lambda, gap is 1 - |lambda|, small for short arcs."""
    cos, ratio1, c2, c3, c4, c5 = stumpff(u)
    _, _, _, wide3, wide4, wide5 = stumpff(4.0 * u)
    if eta2 is None:  # 4 lambda sin^2(psi/2), or for the long way 4 |lambda| cos^2(psi/2)
        eta2 = gap * gap + (2.0 * way * u * c2 if way >= 0.0 else -2.0 * way * (1.0 + cos))
    if not eta2 > 0.0:
        return _Arc(0.0, 0.0, 0.0, math.inf, math.inf, 0.0, 0.0)
    eta = math.sqrt(eta2)
    # K = (psi - sin cos)/sin^3 and its derivative: c1' = (c3 - c2)/2, c3' = (3 c5 - c4)/2. T = eta B.
    K = 4.0 * wide3 / ratio1**3
    K_u = 8.0 * (3.0 * wide5 - wide4) / ratio1**3 - 1.5 * K * (c3 - c2) / ratio1
    if way >= 0.0:
        B, B_u = eta2 * K + 2.0 * way, way * ratio1 * K + eta2 * K_u
        B_lambda = 2.0 * (way - cos) * K + 2.0
    else:  # W = (1 + cos)(psi - sin)/sin^3
        W = (1.0 + cos) * c3 / ratio1**3
        W_u = ((1.0 + cos) * (1.5 * c5 - 0.5 * c4) - 0.5 * ratio1 * c3) / ratio1**3 - 1.5 * W * (c3 - c2) / ratio1
        B, B_u = gap * gap * K - 2.0 * way * W, gap * gap * K_u - 2.0 * way * W_u
        B_lambda = 2.0 * gap * K - 2.0 * W
    if way < 0.0 and u < 0.0:
        rest = (0.5 * (1.0 + way * way) * cos - way) / eta
    else:
        rest = 0.5 * eta * cos - way * u * ratio1 * ratio1 / eta
    eta_u = 0.5 * way * ratio1 / eta
    eta_lambda = (way - cos) / eta
    return _Arc(
        eta,
        eta * B,
        1.5 * eta / ratio1 + rest,
        eta_u,
        eta_u * B + eta * B_u,
        eta_lambda,
        eta_lambda * B + eta * B_lambda,
    )


def _hyperbola(eta: float, way: float, gap: float) -> _Arc:
    """Return the same functions of eta < gap on the short way: a fast hyperbola, where eta^2(u) would cancel."""
    half = math.asinh(math.sqrt((gap - eta) * (gap + eta) / (4.0 * way)))
    return _arc(-4.0 * half * half, way, gap, eta * eta)


def _solved(time: float, way: float, gap: float) -> _Arc:
    """Return the arc with T = time."""
    parabola = _arc(0.0, way, gap)
    if way > 0.0 and time < parabola.time:

        def by_eta(eta: float) -> tuple[float, float]:
            at = _hyperbola(eta, way, gap)
            return at.time, at.time_u / at.eta_u

        return _hyperbola(_root(by_eta, time, 0.0, gap, gap * time / parabola.time, gap), way, gap)

    def by_u(u: float) -> tuple[float, float]:
        at = _arc(u, way, gap)
        return at.time, at.time_u

    low, high = 0.0, math.pi**2
    if time < parabola.time:
        low, high = -1.0, 0.0
        while by_u(low)[0] > time:
            low, high = 2.0 * low, low
            if low < -1e5:
                raise OverflowError
    return _arc(_root(by_u, time, low, high, 0.5 * (low + high), gap * gap), way, gap)


def _root(
    function: Callable[[float], tuple[float, float]], time: float, low: float, high: float, x: float, size: float
) -> float:
    """Return x with T(x) = time for an increasing T: Newton's method on ln T in a bracket, to the round-off floor.

    size : the scale of changes of x that matter, as x itself may be 0
    """
    last = math.inf
    for _ in range(200):
        value, slope = function(x)
        if value > time:
            high = x
        else:
            low = x
        change = -value * math.log(value / time) / slope if value > 0.0 and slope > 0.0 else math.inf
        # At the floor, changes are rounding noise: they no longer shrink, and may point out of the bracket.
        if abs(change) <= 1e-16 * abs(x) or (
            abs(change) >= 0.5 * last and abs(change) <= 1e-11 * max(abs(x), 1e-4 * size)
        ):
            return x
        last = abs(change)
        moved = x + change
        if not low <= moved <= high:
            moved = 0.5 * (low + high)
            if moved in (low, high):
                return x
        x = moved
    raise OverflowError


class _Transfer(NamedTuple):
    """The arc between two points, with the geometry for its derivatives."""

    sign: float
    r0: float
    r1: float
    c: float
    s: float
    way: float
    at: _Arc


@dataclass(frozen=True, eq=False, repr=False)
class ExactKepler(DiscreteLagrangian):
    """mass times the exact discrete Lagrangian of |v|^2/2 + gm/|q|, in the plane or in space; see `exact_kepler`."""

    name: str
    lagrangian: Mechanics | None
    gm: float
    mass: float
    way: Way

    def _first(self, q0: Array, q1: Array, h: float, t: float) -> tuple[float, Array, Array]:
        arc = self._transfer(q0, q1, h)
        at, s = arc.at, arc.s
        k, y = self._speed(arc), s * at.eta * at.eta
        dq = q1 - q0
        v0, v1 = k * (dq + y / arc.r0 * q0), k * (dq - y / arc.r1 * q1)
        m = self.mass * arc.sign
        return m * math.sqrt(2.0 * self.gm * s) * at.action, -m * v0, m * v1

    def _second(self, q0: Array, q1: Array, h: float, t: float) -> tuple[Array, Array, Array]:
        arc = self._transfer(q0, q1, h)
        sign, r0, r1, c, s, way, at = arc
        dq, one = q1 - q0, np.eye(q0.size)
        e0, e1, chord = q0 / r0, q1 / r1, dq / c
        k, y = self._speed(arc), s * at.eta * at.eta
        # Gradients by (q0, q1) of s, then of lambda s = sqrt((r0 r1 + q0.q1)/2), lambda, u at fixed h, eta.
        ds = np.concatenate([0.5 * (e0 - chord), 0.5 * (e1 + chord)])
        product = np.concatenate([r1 * e0 + q1, r0 * e1 + q0]) / (4.0 * way * s)
        dway = (product - way * ds) / s
        du = -(1.5 * at.time / s * ds + at.time_lambda * dway) / at.time_u
        deta = at.eta_u * du + at.eta_lambda * dway
        # v = k (dq + ...), ln k = - ln(lambda s) - ln(s)/2 - ln(eta)
        dlnk = -product / (way * s) - 0.5 * ds / s - deta / at.eta
        dy = at.eta * at.eta * ds + 2.0 * s * at.eta * deta
        v0, v1 = dq + y * e0, dq - y * e1
        bend0, bend1 = (one - np.outer(e0, e0)) * (y / r0), (one - np.outer(e1, e1)) * (y / r1)
        d = q0.size
        dv0 = np.outer(v0, dlnk) + np.outer(e0, dy) + np.hstack([bend0 - one, one])
        dv1 = np.outer(v1, dlnk) - np.outer(e1, dy) + np.hstack([-one, one - bend1])
        m = self.mass * sign * k
        return -m * dv0[:, :d], -m * dv0[:, d:], m * dv1[:, d:]

    def guess(self, q: Array, p: Array, h: float, t: float) -> Array:
        """Return a first guess of q1, by leapfrog steps. Raises InputError for one revolution or more."""
        v, r = p / self.mass, float(np.sqrt(q @ q))
        binding = 2.0 * self.gm / r - float(v @ v)
        if binding > 0.0 and abs(h) >= 2.0 * math.pi * self.gm / binding**1.5:
            raise InputError(
                f"{self.name}: h = {h:.6g} is one revolution or more (the period is "
                f"{2.0 * math.pi * self.gm / binding**1.5:.6g}): the exact L_d is defined by an arc of less than one "
                "revolution, and (q, p) determine no such arc. Use a smaller h."
            )
        x, steps = q.copy(), 64
        for _ in range(steps):
            x = x + 0.5 * h / steps * v
            v = v - h / steps * self.gm * x / float(x @ x) ** 1.5
            x = x + 0.5 * h / steps * v
        return x

    def _speed(self, arc: _Transfer) -> float:
        return math.sqrt(0.5 * self.gm / arc.s) / (arc.way * arc.s * arc.at.eta)

    def _transfer(self, q0: Array, q1: Array, h: float) -> _Transfer:
        ends = f"from q0 = {show(q0)} to q1 = {show(q1)} in h = {h:.6g}"
        if q0.size not in (2, 3):
            raise InputError(f"{self.name}: the Kepler problem has 2 or 3 coordinates; got points with {q0.size}")
        r0, r1, c = (math.sqrt(float(x @ x)) for x in (q0, q1, q1 - q0))
        if r0 == 0.0 or r1 == 0.0:
            raise InputError(f"{self.name}: {ends}: a point lies in the centre of force. Choose points away from it.")
        if c == 0.0:
            raise InputError(
                f"{self.name}: {ends}: the points coincide, a transfer by 0 or 360 degrees, which does not determine "
                "the plane of the orbit. Use points that differ."
            )
        s = 0.5 * (r0 + r1 + c)
        half = q0 / r0 + q1 / r1  # 2 cos(angle/2) long, without cancellation near 180 degrees
        cosine = 0.5 * math.sqrt(float(half @ half))
        apart = q1 / r1 - q0 / r0
        sine = 0.5 * math.sqrt(float(apart @ apart))
        if cosine < ALIGNED or (self.way == "long" and sine < ALIGNED):
            raise InputError(
                f"{self.name}: {ends}: a transfer by {180 if cosine < ALIGNED else 360} degrees does not determine the "
                "plane of the orbit, and the exact L_d has no derivative there. Split the arc: use a smaller h."
            )
        size = math.sqrt(r0 * r1) * cosine / s
        gap = c / s / (1.0 + size)
        way = size if self.way == "short" else -size
        time = math.sqrt(2.0 * self.gm / s) / s * abs(h)
        try:
            at = _solved(time, way, gap)
        except OverflowError:
            raise ConvergenceError(
                f"{self.name}: {ends}: Lambert's equation has no solution in the range of floats (the arc is nearly a "
                "straight line through the centre of force, or h is far too long or too short). Choose other points or "
                "another h.",
            ) from None
        return _Transfer(math.copysign(1.0, h), r0, r1, c, s, way, at)


def exact_kepler(
    gm: float, way: Way = "short", *, mass: float = 1.0, lagrangian: Mechanics | None = None
) -> ExactKepler:
    """Return the exact discrete Lagrangian of L = mass (|v|^2/2 + gm/|q|), by Lambert's theorem.

    gm : > 0, length^3 / time^2; points have shape (2,) or (3,)
    way : "short" for transfer angles below 180 degrees, "long" for those above; always less than one revolution
    lagrangian : the same Lagrangian as a value, needed wherever velocities are given

    Valid for ellipses, parabolas and hyperbolas, and either sign of h. D1 = -mass v0 and D2 = mass v1 lose digits near
    transfers by 180 degrees, where the plane of the orbit is not determined, and near 0 and 360 degrees, where the
    points coincide. Those angles raise InputError, except 0 on the short way, a rise or fall along a straight line.
    """
    if not is_one_of(way, ("short", "long")):
        raise InputError(f"way must be 'short' (below 180 degrees) or 'long' (above); got {way!r}")
    strength, m = positive_number(gm, "gm"), positive_number(mass, "mass")
    return ExactKepler("exact-kepler" if way == "short" else "exact-kepler-long", lagrangian, strength, m, way)
