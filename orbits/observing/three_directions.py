"""Orbits from three directions, by the method of Gauss.

The two-body motion between the three times is then made exact by repetition, with the Lagrange coefficients of the
orbit found.
Sources: Escobal (1965), Methods of Orbit Determination, 7.3; Curtis (2020), Orbital Mechanics for Engineering
Students, algorithms 5.5 and 5.6.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from orbits.elements.two_body import any_two_body
from orbits.errors import OrbitsError
from orbits.observing.light import C
from orbits.units import GM_SUN

Array = NDArray[np.float64]

NEAREST, FARTHEST = 0.005, 1000.0
"""Distances from the Sun of roots that are tried, au."""

MOST_ROUNDS, CLOSE = 50, 1e-11


def orbits_of(times: Array, sun: Array, direction: Array) -> list[Array]:
    """Return heliocentric states at the second of three times, (6,) each, au and au/d: one for each root, 0 to 3, of
    the equation of degree eight for the distance from the Sun.

    times : (3,), days; sun : from the Sun to the observers, au, (3, 3); direction : towards the body, (3, 3)
    """
    t1, t3 = times[0] - times[1], times[2] - times[1]
    span = t3 - t1
    cross = np.array([np.cross(direction[1], direction[2]), np.cross(direction[0], direction[2]),
                      np.cross(direction[0], direction[1])])  # fmt: skip
    D0 = float(direction[0] @ cross[0])
    if abs(D0) < 1e-14:
        return []  # the three directions are in one plane
    D = sun @ cross.T
    A = (-D[0, 1] * t3 / span + D[1, 1] + D[2, 1] * t1 / span) / D0
    B = (D[0, 1] * (t3**2 - span**2) * t3 / span + D[2, 1] * (span**2 - t1**2) * t1 / span) / (6.0 * D0)
    E, R2 = float(sun[1] @ direction[1]), float(sun[1] @ sun[1])
    mu = GM_SUN
    equation = np.zeros(9)
    equation[[0, 2, 5, 8]] = 1.0, -(A**2 + 2.0 * A * E + R2), -2.0 * mu * B * (A + E), -((mu * B) ** 2)
    roots = np.roots(equation)
    real = roots[(np.abs(roots.imag) < 1e-10) & (roots.real > NEAREST) & (roots.real < FARTHEST)].real
    found = [_state(float(r), t1, t3, sun, direction, D0, D) for r in np.sort(real)]
    return [state for state in found if state is not None]


def _state(r: float, t1: float, t3: float, sun: Array, direction: Array, D0: float, D: Array) -> Array | None:
    """Return the state at the second time that belongs to a root, or None if there is none in front of the observer."""
    mu = GM_SUN / r**3
    f1, f3 = 1.0 - 0.5 * mu * t1**2, 1.0 - 0.5 * mu * t3**2
    g1, g3 = t1 - mu * t1**3 / 6.0, t3 - mu * t3**3 / 6.0
    best: Array | None = None
    for _ in range(MOST_ROUNDS):
        whole = f1 * g3 - f3 * g1
        if not abs(whole) > 0.0:
            return best
        c1, c3 = g3 / whole, -g1 / whole
        rho = np.array(
            [
                (-D[0, 0] + D[1, 0] / c1 - D[2, 0] * c3 / c1) / D0,
                (-c1 * D[0, 1] + D[1, 1] - c3 * D[2, 1]) / D0,
                (-D[0, 2] * c1 / c3 + D[1, 2] / c3 - D[2, 2]) / D0,
            ]
        )
        if not np.isfinite(rho).all() or rho[1] <= 0.0 or np.abs(rho).max() > FARTHEST:
            return best
        q = sun + rho[:, None] * direction
        state = np.concatenate([q[1], (-f3 * q[0] + f1 * q[2]) / whole])
        if best is not None and np.abs(state - best).max() < CLOSE:
            return state
        best = state
        # Light left the body earlier, by another time at each.
        away = rho / C
        d1, d3 = t1 - away[0] + away[1], t3 - away[2] + away[1]
        try:
            (one, _), (three, _) = (_coefficients(state, d) for d in (d1, d3))
        except OrbitsError:
            return best
        # Slowly, as the repetition may leap from one side of the solution to the other.
        f1, g1 = 0.5 * (f1 + one[0]), 0.5 * (g1 + one[1])
        f3, g3 = 0.5 * (f3 + three[0]), 0.5 * (g3 + three[1])
    return best


def orbits_at(distances: Array, times: Array, sun: Array, direction: Array) -> list[Array]:
    """Return heliocentric states at the second of three times, (6,) each, au and au/d: for each distance from the
    observer, au, the one whose velocity leads nearest to the other two directions.

    They are for arcs so short that Gauss's equation, which errors of the directions change, may lack the root that is
    sought. times, sun, direction : as of `orbits_of`
    """
    found = []
    for distance in distances.tolist():
        q = sun[1] + distance * direction[1]
        mu = GM_SUN / float(np.linalg.norm(q)) ** 3
        left, right = [], []
        for k in (0, 2):
            t = times[k] - times[1]
            f, g = 1.0 - 0.5 * mu * t**2, t - mu * t**3 / 6.0
            across = np.eye(3) - np.outer(direction[k], direction[k])
            left.append(g * across)
            right.append(across @ (sun[k] - f * q))
        v, *_ = np.linalg.lstsq(np.concatenate(left), np.concatenate(right), rcond=None)
        if np.linalg.norm(v) < np.sqrt(2.0 * GM_SUN / np.linalg.norm(q)):
            found.append(np.concatenate([q, v]))
    return found


def _coefficients(state: Array, dt: float) -> tuple[tuple[float, float], Array]:
    """Return Lagrange's f and g: the position after dt is f q + g v."""
    q, v = state[:3], state[3:]
    later, _ = any_two_body(q, v, GM_SUN, dt)
    (f, g), *_ = np.linalg.lstsq(np.stack([q, v], axis=1), later, rcond=None)
    return (float(f), float(g)), later


def triples(days: Array, share: float = 0.5, most: int = 24) -> Iterator[tuple[int, int, int]]:
    """Yield the numbers of three observations each, the most promising ones first.

    Those on three nights within some weeks, about evenly spaced, are best: a longer arc is no longer the beginning of a
    series in time, and on a shorter one errors of the directions count for more.

    share : of each night, after which its observation is taken: 0 for the first one, 1 for the last
    """
    _, order = np.unique(days, return_index=True)
    groups = np.split(order, np.flatnonzero(np.diff(days[order]) > 0.4) + 1)
    if len(groups) < 3:
        groups = [order[[k]] for k in np.unique(np.linspace(0, len(order) - 1, 7).astype(int))]
    nights = [int(group[int(np.ceil(share * (len(group) - 1)))]) for group in groups]
    t = days[nights]
    rated: list[tuple[float, tuple[int, int, int]]] = []
    for ideal in (30.0, 12.0, 60.0, 5.0, 120.0):
        for middle in np.unique(np.linspace(1, len(t) - 2, 40).astype(int)).tolist():
            i = int(np.argmin(np.abs(t[:middle] - (t[middle] - ideal / 2.0))))
            k = middle + 1 + int(np.argmin(np.abs(t[middle + 1 :] - (t[middle] + ideal / 2.0))))
            a, b = t[middle] - t[i], t[k] - t[middle]
            crooked = abs(np.log(a / b)) + abs(np.log((a + b) / ideal)) + (0.0 if ideal == 30.0 else 0.3)
            rated.append((crooked, (nights[i], nights[middle], nights[k])))
    yield from list(dict.fromkeys(three for _, three in sorted(rated)))[:most]
