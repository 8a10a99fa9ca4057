"""Terms of each kind that the package has none of, for tests: what acts with them is known in closed form.

`Heavy` is not linear in velocities, as the kinetic energy of relativity; `Swaying` depends on time, in the forces and
in the momenta.
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


HEAVY = _tag("heavy", heavy_value, heavy_gradients, heavy_hessians, heavy_particle)
SWAYING = _tag("swaying", swaying_value, swaying_gradients, swaying_hessians, swaying_particle)
TRAITS = frozenset({GRADIENTS, MASSLESS_PARTICLES})


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
