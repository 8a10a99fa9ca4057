"""Pairs of bodies that are known to collide, and when: on straight lines, and on orbits run back from there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

import orbits

Array = NDArray[np.float64]


def passing(way: float, phase: float, miss: float, gm: tuple[float, float], step: float = 1.0) -> orbits.System:
    """Two light bodies that meet after three steps and a part, with a reach of 2; a star is far away.

    way : of the second one in a step, as a multiple of their reach; phase : the part of the fourth step that has passed
    miss : the distance at which they would pass, as a fraction of the reach
    """
    speed = 2.0 * way / step
    q = [[0.0, 0.0, 0.0], [-speed * (3.0 + phase) * step, 2.0 * miss, 0.0], [0.0, 0.0, 1e9 * step]]
    v = [[0.0, 0.0, 0.0], [speed, 0.0, 0.0], [0.0, 0.0, 0.0]]
    return orbits.System(
        ["a", "b", "star"], gm=[*gm, 1.0], q=q, v=v, radii=[1.0, 1.0, 0.0], units=orbits.DIMENSIONLESS
    )


def contact(way: float, phase: float, miss: float, step: float = 1.0) -> float:
    """The time of the contact of `passing`, on straight lines."""
    speed = 2.0 * way / step
    return (3.0 + phase) * step - 2.0 * float(np.sqrt(1.0 - miss * miss)) / speed


def _on_orbit(x: Array, v: Array, t: float) -> tuple[Array, Array]:
    """Return position and velocity after t on an elliptic orbit with GM = 1, by Kepler's equation."""
    r = float(np.linalg.norm(x))
    a = 1.0 / (2.0 / r - float(v @ v))
    c0, s0, E = 1.0 - r / a, float(x @ v) / np.sqrt(a), t * a**-1.5
    for _ in range(80):
        miss = E - c0 * np.sin(E) + s0 * (1.0 - np.cos(E)) - t * a**-1.5
        E -= float(np.clip(miss / (1.0 - c0 * np.cos(E) + s0 * np.sin(E)), -0.5, 0.5))
    c, s = float(np.cos(E)), float(np.sin(E))
    now = a * (1.0 - c0 * c + s0 * s)
    f, g = 1.0 - a / r * (1.0 - c), t - (E - s) * a**1.5
    return f * x + g * v, -np.sqrt(a) * s / (now * r) * x + (1.0 - a / now * (1.0 - c)) * v


def planetesimals(seed: int, gm: float, second: float, radius: float = 1e-5, count: int = 12) -> orbits.System:
    """A star and pairs of planetesimals on orbits of about size 1, each of which collides between t = 1 and 11.

    gm, second : of the first and the second one of each pair
    """
    rng = np.random.default_rng(seed)

    def direction(across: Array | None = None) -> Array:
        d = rng.normal(size=3)
        d = d if across is None else np.cross(across, d)
        return np.asarray(d / np.linalg.norm(d))

    names, gms, q, v = ["star"], [1.0], [np.zeros(3)], [np.zeros(3)]
    for k in range(count):
        place = rng.uniform(0.8, 1.3) * direction()
        speeds = (direction(place) + 0.06 * rng.normal(size=(2, 3))) / np.sqrt(np.linalg.norm(place))
        beside = rng.uniform(0.0, 1.6) * radius * direction(speeds[1] - speeds[0])
        time = rng.uniform(1.0, 11.0)
        for name, own, at, speed in (("a", gm, place, speeds[0]), ("b", second, place + beside, speeds[1])):
            start = _on_orbit(at, speed, -time)
            names.append(f"{name}{k}")
            gms.append(own)
            q.append(start[0])
            v.append(start[1])
    radii = [1e-3, *[radius] * (2 * count)]
    return orbits.System(names, gm=gms, q=q, v=v, radii=radii, units=orbits.DIMENSIONLESS)


def near_a_planet(seed: int) -> tuple[orbits.System, float, float]:
    """A star, a planet, and two small bodies that meet near the planet within a step from the start; the length of that
    step, 0.3 to 1 radians where they meet, and the time at which they are half the sum of their radii apart.
    """
    rng = np.random.default_rng(seed)

    def direction() -> Array:
        d = rng.normal(size=3)
        return np.asarray(d / np.linalg.norm(d))

    planet, moving = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
    distance = 0.07 * 10.0 ** rng.uniform(-0.5, 0.7)
    place = planet + distance * direction()
    speed = np.sqrt(1e-3 / distance) + distance
    speeds = [moving + rng.uniform(0.0, 3.0) * speed * direction() for _ in range(2)]
    step = rng.uniform(0.3, 1.0) / np.sqrt(1.0 / np.linalg.norm(place) ** 3 + 1e-3 / distance**3)
    time = rng.uniform(0.2, 0.8) * step
    there = orbits.System(
        ["star", "planet", "a", "b"],
        gm=[1.0, 1e-3, 0.0, 0.0],
        q=[np.zeros(3), planet, place, place + 1e-8 * direction()],
        v=[np.zeros(3), moving, *speeds],
        radii=[0.0, 0.0, 1e-8, 1e-8],
        units=orbits.DIMENSIONLESS,
    )
    start = orbits.propagate(there, dt=time / 8.0, duration=-time, check_step=False)[-1]
    return start.replaced(gm=[1.0, 1e-3, 1e-20, 0.0]), step, time
