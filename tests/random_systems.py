"""A hundred random systems of five kinds, ways to integrate each, and where they really go.

Kinds: Sun and planets, hierarchical triples, eccentric binaries, a small body that meets a planet, and three or four
bodies of comparable masses. The truth is a Taylor series of heyoka in 80-bit floats, or in 128-bit ones for the chaotic
systems: its own errors are 2,000 and 1e18 times smaller. In units with G = 1.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

import orbits
from orbits.elements import state_from_elements

YEAR = 2 * np.pi


class Random(NamedTuple):
    """A system, and how long it is followed."""

    kind: str
    gm: np.ndarray
    q: np.ndarray
    v: np.ndarray
    span: float

    @property
    def system(self) -> orbits.System:
        """As bodies A, B, C, ..."""
        return orbits.System(list("ABCDEFGHIJ"[: len(self.gm)]), self.gm, self.q, self.v, units=orbits.DIMENSIONLESS)


def kepler(rng, mu, a, e, inclination):
    angles = {name: rng.uniform(0, YEAR) for name in ("Omega", "omega", "M")}
    return (np.asarray(x) for x in state_from_elements(mu, a=a, e=e, inc=inclination, **angles))


def centred(kind, gm, q, v, span):
    gm, q, v = np.array(gm), np.array(q), np.array(v)
    share = gm / gm.sum()
    return Random(kind, gm, q - share @ q, v - share @ v, span)


def planetary(rng, particles=0):
    gm, q, v, a = [1.0], [np.zeros(3)], [np.zeros(3)], 1.0
    for _ in range(rng.integers(2, 6)):
        gm.append(10 ** rng.uniform(-7, -3.5))
        for orbit, x in zip((q, v), kepler(rng, 1 + gm[-1], a, rng.uniform(0, 0.15), rng.uniform(0, 0.1)), strict=True):
            orbit.append(x)
        a *= rng.uniform(1.6, 2.3)
    for _ in range(particles):
        gm.append(0.0)
        inside = rng.uniform(0.4, 0.6), rng.uniform(0, 0.3), rng.uniform(0, 0.3)
        for orbit, x in zip((q, v), kepler(rng, 1.0, *inside), strict=True):
            orbit.append(x)
    return centred("particles" if particles else "planetary", gm, q, v, YEAR * 10 ** rng.uniform(0.7, 2.7))


def particles(rng):
    return planetary(rng, particles=3)


def triple(rng):
    m, e = rng.uniform(0.2, 1, 3), rng.uniform(0, 0.6)
    x, w = kepler(rng, m[0] + m[1], 1.0, rng.uniform(0, 0.6), rng.uniform(0, np.pi))
    far, slow = kepler(rng, m.sum(), rng.uniform(5, 12) / (1 - e), e, rng.uniform(0, 0.5))
    f = m[1] / (m[0] + m[1])
    q, v = [-f * x, (1 - f) * x, far], [-f * w, (1 - f) * w, slow]
    return centred("triple", m, q, v, YEAR * 10 ** rng.uniform(1, 2.6))


def binary(rng):
    m = rng.uniform(0.1, 1, 2)
    m /= m.sum()
    x, w = kepler(rng, 1.0, 1.0, 1 - 10 ** rng.uniform(-3.5, -0.3), rng.uniform(0, np.pi))
    return centred("binary", m, [-m[1] * x, m[0] * x], [-m[1] * w, m[0] * w], YEAR * 10 ** rng.uniform(0.3, 2.3))


def encounter(rng):
    """A planet and a small body within its Hill radius, marched back to before the encounter."""
    m, small = 10 ** rng.uniform(-5, -3), 10 ** rng.uniform(-12, -9)
    x, w = kepler(rng, 1 + m, 1.0, rng.uniform(0, 0.1), 0.0)
    apart, faster = rng.normal(size=3), rng.normal(size=3)
    apart *= (m / 3) ** (1 / 3) * 10 ** rng.uniform(-1.5, 0) / np.linalg.norm(apart)
    faster *= rng.uniform(0.1, 0.6) / np.linalg.norm(faster)
    span = rng.uniform(0.5, 4)
    met = centred("encounter", [1.0, m, small], [np.zeros(3), x, x + apart], [np.zeros(3), w, w + faster], span)
    before = orbits.propagate(met.system, duration=-span, samples=[-span])
    after = rng.uniform(1.2, 3.2) if rng.uniform() < 0.5 else 20.0
    return met._replace(q=before.q.value[0], v=before.v.value[0], span=after * span)


def chaotic(rng):
    n = rng.integers(3, 5)
    m = rng.uniform(0.3, 1, n)
    q, v = rng.normal(size=(n, 3)), 0.3 * rng.normal(size=(n, 3))
    return centred("chaotic", m / m.sum(), q, v, 10 ** rng.uniform(0.7, 1.6))


def hundred(seed: int) -> list[Random]:
    """A hundred systems, always the same for a seed."""
    rng = np.random.default_rng(seed)
    kinds = ((planetary, 20), (particles, 10), (triple, 20), (binary, 15), (encounter, 15), (chaotic, 20))
    return [kind(rng) for kind, count in kinds for _ in range(count)]


def ways_of(rng, case: Random) -> Iterator[tuple[Any, Any]]:
    """Yield methods and steps for a system: without dt, unless there are massless particles, and another one."""
    if (case.gm > 0).all():
        yield orbits.Gauss(), orbits.Adaptive()
    period = shortest(case)
    pick = rng.integers(6 if (case.gm > 0).all() else 4)
    if pick == 0:
        yield orbits.Gauss(), period / rng.uniform(12, 30)
    elif pick == 1:
        yield orbits.Gauss(stages=int(rng.integers(2, 6))), period / rng.uniform(15, 60)
    elif pick == 2:
        yield orbits.StormerVerlet(), period / rng.uniform(50, 1000)
    elif pick == 3:
        yield orbits.Composition(order=int(rng.choice([4, 6, 8]))), period / rng.uniform(15, 60)
    elif pick == 4:
        yield orbits.Gauss(), orbits.Adaptive(10 ** rng.uniform(-7, -3))
    else:
        yield orbits.Gauss(stages=int(rng.integers(3, 8))), orbits.Adaptive()


def shortest(case: Random) -> float:
    """The shortest period of two bodies that are bound, or could be where they are."""
    found = []
    for i, j in zip(*np.triu_indices(len(case.gm), 1), strict=True):
        mu, r = case.gm[i] + case.gm[j], np.linalg.norm(case.q[i] - case.q[j])
        if mu > 0:
            a = 1 / (2 / r - np.sum((case.v[i] - case.v[j]) ** 2) / mu)
            found += [YEAR * np.sqrt(x**3 / mu) for x in (a, r) if x > 0]
    return float(min(found))


_TAYLOR: dict[Any, Any] = {}


def truth(case: Random, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return where the bodies are, q and v in turn, as (samples, bodies, 6) and the low part of that."""
    import heyoka as hy

    number, n = hy.real128 if case.kind == "chaotic" else np.longdouble, len(case.gm)
    if (n, number) not in _TAYLOR:
        model = hy.model.nbody(n, masses=[hy.par[i] for i in range(n)], Gconst=1.0)
        start = {"fp_type": number, "compact_mode": True, "pars": [number(1.0)] * n}
        _TAYLOR[n, number] = hy.taylor_adaptive(model, [number(0.0)] * (6 * n), **start)
    taylor = _TAYLOR[n, number]
    for i, gm in enumerate(case.gm):
        taylor.pars[i] = number(float(gm))
    for i, x in enumerate(np.hstack([case.q, case.v]).ravel()):
        taylor.state[i] = number(float(x))
    taylor.time = number(0.0)
    states = np.empty((2, len(times), n, 6))
    for k, t in enumerate(times):
        taylor.propagate_until(number(float(t)))
        high = [float(x) for x in taylor.state]
        low = [float(x - number(y)) for x, y in zip(taylor.state, high, strict=True)]
        states[:, k] = np.reshape([high, low], (2, n, 6))
    return states[0], states[1]
