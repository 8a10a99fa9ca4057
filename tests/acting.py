"""Terms of each kind that the package has none of, for tests: what acts with them is known in closed form.

`Turning` is linear in velocities, as a magnetic field; `Heavy` is not, as the kinetic energy of relativity; `Swaying`
depends on time, in the forces and in the momenta.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from orbits.kernels.binding import Tag
from orbits.kernels.compile import kernel
from orbits.kernels.lanes import get, put
from orbits.kernels.lanes.functions import cos, sin
from orbits.lagrangians.base import GRADIENTS, MASSLESS_PARTICLES, TIME_DEPENDENT
from orbits.lagrangians.terms.base import Summand, Term


@kernel(inline=True)
def _from(q, i, b, n):
    return get(q, i) - get(q, b), get(q, n + i) - get(q, n + b), get(q, 2 * n + i) - get(q, 2 * n + b)


@kernel(inline=True)
def _cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@kernel(inline=True)
def _half(own):
    return 0.5 * own[1], 0.5 * own[2], 0.5 * own[3]


@kernel
def turning_value(strength, own, t, q, v):
    n, b = strength.shape[0] - 1, int(own[0])
    total, B = get(q, 0) * 0.0, _half(own)
    for i in range(n):
        turned = _cross(_from(q, i, b, n), _from(v, i, b, n))
        total = total + strength[1 + i] * (B[0] * turned[0] + B[1] * turned[1] + B[2] * turned[2])
    return total


@kernel
def turning_gradients(strength, own, t, q, v, f, p):
    n, b = strength.shape[0] - 1, int(own[0])
    B = _half(own)
    for i in range(n):
        df, dp = _cross(_from(v, i, b, n), B), _cross(B, _from(q, i, b, n))
        for a in range(3):
            m, at, back = strength[1 + i], a * n + i, a * n + b
            put(f, at, get(f, at) + m * df[a])
            put(f, back, get(f, back) - m * df[a])
            put(p, at, get(p, at) + m * dp[a])
            put(p, back, get(p, back) - m * dp[a])


@kernel
def turning_hessians(strength, own, t, q, v, out):
    n, b = strength.shape[0] - 1, int(own[0])
    d, B = 3 * n, _half(own)
    for i in range(n):
        for a in range(3):
            for c in range(3):
                if a != c:
                    # Of w x B, the component a by the velocity c.
                    turn = B[3 - a - c] if (a + 1) % 3 == c else -B[3 - a - c]
                    turn = strength[1 + i] * turn
                    for k, x in ((i, 1.0), (b, -1.0)):
                        for m, y in ((i, 1.0), (b, -1.0)):
                            at = d * d + (a * n + k) * d + c * n + m
                            put(out, at, get(out, at) + x * y * turn)


@kernel
def turning_particle(strength, own, t, sources, speeds, place, velocity):
    n, b = strength.shape[0] - 1, int(own[0])
    B = _half(own)
    r = place[0] - get(sources, b), place[1] - get(sources, n + b), place[2] - get(sources, 2 * n + b)
    w = velocity[0] - get(speeds, b), velocity[1] - get(speeds, n + b), velocity[2] - get(speeds, 2 * n + b)
    f, p = _cross(w, B), _cross(B, r)
    return f[0], f[1], f[2], p[0], p[1], p[2]


@kernel
def heavy_value(strength, own, t, q, v):
    n = strength.shape[0] - 1
    total = get(q, 0) * 0.0
    for i in range(n):
        w2 = get(v, i) * get(v, i) + get(v, n + i) * get(v, n + i) + get(v, 2 * n + i) * get(v, 2 * n + i)
        total = total + strength[1 + i] * own[0] * 0.125 * w2 * w2
    return total


@kernel
def heavy_gradients(strength, own, t, q, v, f, p):
    n = strength.shape[0] - 1
    for i in range(n):
        w2 = get(v, i) * get(v, i) + get(v, n + i) * get(v, n + i) + get(v, 2 * n + i) * get(v, 2 * n + i)
        for k in range(i, 3 * n, n):
            put(p, k, get(p, k) + strength[1 + i] * own[0] * 0.5 * w2 * get(v, k))


@kernel
def heavy_hessians(strength, own, t, q, v, out):
    n = strength.shape[0] - 1
    d = 3 * n
    for i in range(n):
        w2 = get(v, i) * get(v, i) + get(v, n + i) * get(v, n + i) + get(v, 2 * n + i) * get(v, 2 * n + i)
        for j in range(i, d, n):
            for k in range(i, d, n):
                at = 2 * d * d + j * d + k
                bent = get(v, j) * get(v, k) + (0.5 * w2 if j == k else 0.0 * w2)
                put(out, at, get(out, at) + strength[1 + i] * own[0] * bent)


@kernel
def heavy_particle(strength, own, t, sources, speeds, place, velocity):
    x, y, z = velocity
    heavier = own[0] * 0.5 * (x * x + y * y + z * z)
    return x * 0.0, x * 0.0, x * 0.0, heavier * x, heavier * y, heavier * z


@kernel
def swaying_value(strength, own, t, q, v):
    n, angle = strength.shape[0] - 1, own[0] * t + own[1]
    total = get(q, 0) * 0.0
    for k in range(3 * n):
        a = k // n
        pull = own[2 + a] * cos(angle) * get(q, k) + own[5 + a] * sin(angle) * get(v, k)
        total = total + strength[1 + k % n] * pull
    return total


@kernel
def swaying_gradients(strength, own, t, q, v, f, p):
    n, angle = strength.shape[0] - 1, own[0] * t + own[1]
    for k in range(3 * n):
        a = k // n
        put(f, k, get(f, k) + strength[1 + k % n] * own[2 + a] * cos(angle))
        put(p, k, get(p, k) + strength[1 + k % n] * own[5 + a] * sin(angle))


@kernel
def swaying_hessians(strength, own, t, q, v, out):
    return


@kernel
def swaying_particle(strength, own, t, sources, speeds, place, velocity):
    angle, zero = own[0] * t + own[1], place[0] * 0.0
    c, s = cos(angle) + zero, sin(angle) + zero
    return own[2] * c, own[3] * c, own[4] * c, own[5] * s, own[6] * s, own[7] * s


def _tag(name: str, value: Any, gradients: Any, hessians: Any, particle: Any) -> Tag:
    kernels = {"value": value, "gradients": gradients, "hessians": hessians, "particle_gradients": particle}
    return Tag(f"test-{name}", kernels)


TURNING = _tag("turning", turning_value, turning_gradients, turning_hessians, turning_particle)
HEAVY = _tag("heavy", heavy_value, heavy_gradients, heavy_hessians, heavy_particle)
SWAYING = _tag("swaying", swaying_value, swaying_gradients, swaying_hessians, swaying_particle)
TRAITS = frozenset({GRADIENTS, MASSLESS_PARTICLES})


@dataclass(frozen=True)
class Turning(Term):
    """(1/2) sum m B . (r x w), r and w relative to the body: an acceleration w x B, with its reaction."""

    kind: ClassVar[str] = "test-turning"
    B: tuple[float, float, float] = (0.0, 0.0, 1.0)

    def in_units(self, units):
        return self

    def summand(self, row, units):
        B = np.array(self.B)
        axis = tuple((B / np.linalg.norm(B)).tolist())
        return Summand("turning", "m B . (r x w) / 2", TURNING, np.array([row, *self.B]), TRAITS, axis)


@dataclass(frozen=True)
class Heavy(Term):
    """sum m excess |v|^4 / 8: momenta that grow faster than velocities."""

    kind: ClassVar[str] = "test-heavy"
    excess: float = 0.1

    def in_units(self, units):
        return self

    def summand(self, row, units):
        return Summand("heavy", "m excess v^4 / 8", HEAVY, np.array([self.excess]), TRAITS, None)


@dataclass(frozen=True)
class Swaying(Term):
    """sum m (A . q cos(rate t + phase) + C . v sin(rate t + phase)): an acceleration (A - rate C) cos(rate t + phase)
    of everything.
    """

    kind: ClassVar[str] = "test-swaying"
    rate: float = 1.3
    phase: float = 0.0
    A: tuple[float, float, float] = (0.2, -0.1, 0.05)
    C: tuple[float, float, float] = (0.0, 0.3, 0.1)

    def in_units(self, units):
        return self

    def summand(self, row, units):
        own = np.array([self.rate, self.phase, *self.A, *self.C])
        return Summand("swaying", "m A . q cos + m C . v sin", SWAYING, own, TRAITS | {TIME_DEPENDENT}, None)

    def later(self, time):
        return replace(self, phase=self.phase + self.rate * float(time.value))

    def displacement(self, t):
        """How far all is moved after the time t, and how fast, from the start of the run."""
        push = np.array(self.A) - self.rate * np.array(self.C)
        angle, start = self.rate * t + self.phase, self.phase
        x = (np.cos(start) - np.cos(angle)) / self.rate**2 - np.sin(start) * t / self.rate
        return push * x, push * (np.sin(angle) - np.sin(start)) / self.rate
