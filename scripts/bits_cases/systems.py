"""The bodies of the cases."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from astropy import units as u

import orbits
from bits_cases.facts import Skipped


@cache
def planets() -> Any:
    """Return the bundled Solar System at the epoch of the bundled asteroids."""
    return orbits.System.solar_system("2022-08-09")


@cache
def asteroids(count: int = 37) -> Any:
    """Return the Solar System with massless asteroids: some registers of eight, the last one not full."""
    return planets().add_particles(orbits.asteroids(count))


@cache
def mixed() -> Any:
    """Return a star with planets and massless particles in no order, softened, without units."""
    rng = np.random.default_rng(5)
    gm = np.where(rng.random(31) < 0.2, 1e-4 * rng.random(31), 0.0)
    gm[7] = 1.0
    return ring(gm, 7, rng, softening=0.01)


@cache
def star_alone() -> Any:
    """Return one massive body, and eleven massless particles around it."""
    return ring(np.append(np.zeros(11), 1.0), 11, np.random.default_rng(6))


@cache
def many_bodies() -> Any:
    """Return 1,100 massive bodies, whose forces threads share, and nine massless ones."""
    rng = np.random.default_rng(7)
    gm = np.append(1e-7 * (1.0 + rng.random(1100)), np.zeros(9))
    gm[0] = 1.0
    return ring(gm, 0, rng, softening=0.003)


@cache
def pythagorean(softening: float) -> Any:
    """Return Burrau's three bodies, which fall from rest into close encounters, and four massless ones."""
    q = [[1, 3, 0], [-2, -1, 0], [1, -1, 0], [4, 1, 0.5], [-1, 1, 0.5], [3, -2, 0.125], [4, 2, 0.25]]
    v = np.zeros((7, 3))
    v[3:, 1] = 0.5
    gm, names = [3, 4, 5, 0, 0, 0, 0], ["A", "B", "C", "a", "b", "c", "d"]
    return orbits.System(names, gm, q, v, units=orbits.DIMENSIONLESS, softening=softening)


@cache
def jupiter_crossers() -> Any:
    """Return the giant planets and massless particles on orbits about that of Jupiter, with close flybys."""
    giants = orbits.System.solar_system("2022-08-09", ["Sun", "Jupiter", "Saturn"])
    count = 19
    return giants.add(
        [f"crosser {k}" for k in range(count)],
        primary="Jupiter",
        q=np.linspace(0.15, 0.6, count)[:, None] * np.array([1.0, 0.3, 0.05]) * u.au,
        v=np.linspace(-0.004, 0.002, count)[:, None] * np.array([0.9, 0.4, 0.1]) * u.au / u.day,
    )


def ring(gm: np.ndarray, centre: int, rng: np.random.Generator, softening: float = 0.0) -> Any:
    """Return bodies on nearly circular orbits about the one at `centre`, without units."""
    n = len(gm)
    a, angle = rng.uniform(1.0, 5.0, n), rng.uniform(0.0, 2.0 * np.pi, n)
    q = np.stack([a * np.cos(angle), a * np.sin(angle), 0.1 * rng.normal(size=n)], axis=1)
    v = np.stack([-np.sin(angle), np.cos(angle), 0.1 * rng.normal(size=n)], axis=1) / np.sqrt(a)[:, None]
    q[centre] = v[centre] = 0.0
    names = [f"body {k}" for k in range(n)]
    return orbits.System(names, gm, q, v, units=orbits.DIMENSIONLESS, softening=softening)


@cache
def eccentric() -> Any:
    """Return two bodies of comparable mass on an orbit of e = 0.9, and a third one far away."""
    q, v = [[0.4, 0, 0], [-0.6, 0, 0], [0, 9, 1]], [[0, 0.28, 0], [0, -0.42, 0.01], [0.3, 0, 0]]
    return orbits.System(["A", "B", "C"], [0.6, 0.4, 0.05], q, v, units=orbits.DIMENSIONLESS).barycentric()


@cache
def satellites() -> Any:
    """Return a planet with two massive satellites and two massless ones, on eccentric, inclined orbits."""
    q = [[0, 0, 0], [1, 0, 0.2], [-2, 0.5, 0], [0, 1.4, 0.1], [0.5, -1.6, -0.3]]
    v = [[0, 0, 0], [0, 0.9, 0.3], [-0.1, -0.6, 0.3], [-0.8, 0, 0.1], [0.5, 0.3, 0.2]]
    names = ["planet", "inner", "outer", "p", "s"]
    return orbits.System(names, [1.0, 0.01, 0.002, 0.0, 0.0], q, v, units=orbits.DIMENSIONLESS)


@cache
def disc() -> Any:
    """Return a star, planetesimals with inflated radii that collide, and massless bodies that hit them."""
    rng, count = np.random.default_rng(1), 14
    star = orbits.System.from_elements({"star": {"gm": 1.0, "radius": 0.01}}, units=orbits.DIMENSIONLESS)
    return star.add(
        [f"p{k}" for k in range(count)],
        primary="star",
        gm=np.where(np.arange(count) < 9, rng.uniform(0.5e-5, 1.5e-5, count), 0.0),
        radius=0.05,
        a=rng.uniform(0.8, 1.2, count),
        e=rng.uniform(0.0, 0.03, count),
        inc=rng.uniform(0.0, 0.005, count),
        pomega=rng.uniform(0.0, 2.0 * np.pi, count),
        Omega=rng.uniform(0.0, 2.0 * np.pi, count),
        l=2.0 * np.pi * rng.permutation(count) / count,
    )


@cache
def crossing_planets() -> Any:
    """Return a star with three planets that meet, and three massless bodies."""
    star = orbits.System.from_elements({"star": {"gm": 1.0}}, units=orbits.DIMENSIONLESS)
    return star.add(
        ["a", "b", "c", "p", "s", "w"],
        primary="star",
        gm=[1e-4, 1e-4, 1e-5, 0.0, 0.0, 0.0],
        a=[1.0, 1.08, 2.0, 1.5, 0.6, 2.9],
        e=[0.02, 0.03, 0.1, 0.2, 0.1, 0.3],
        l=[0.0, 0.35, 2.0, 4.0, 1.0, 5.0],
    )


@cache
def random_system(seed: int) -> Any:
    """Return a star, two to four planets close to each other, and three massless bodies between them."""
    rng = np.random.default_rng(seed)
    planets, particles = int(rng.integers(2, 5)), 3
    n = planets + particles
    return orbits.System.from_elements({"star": {"gm": 1.0}}, units=orbits.DIMENSIONLESS).add(
        [*(f"planet {k}" for k in range(planets)), *(f"particle {k}" for k in range(particles))],
        primary="star",
        gm=np.append(10.0 ** rng.uniform(-6.0, -3.0, planets), np.zeros(particles)),
        a=np.append(1.3 ** np.arange(planets), rng.uniform(0.8, 2.0, particles)),
        e=rng.uniform(0.0, 0.3, n),
        inc=rng.uniform(0.0, 0.1, n),
        omega=rng.uniform(0.0, 2.0 * np.pi, n),
        Omega=rng.uniform(0.0, 2.0 * np.pi, n),
        M=rng.uniform(0.0, 2.0 * np.pi, n),
    )


def passing(way: float, phase: float) -> Any:
    """Return two light bodies that touch after three steps and a part, with a star far away.

    way : of the second one in a step of 1, as a multiple of the sum of their radii; phase : part of the fourth step
    """
    q = [[0.0, 0.0, 0.0], [-2.0 * way * (3.0 + phase), 1.0, 0.0], [0.0, 0.0, 1e9]]
    v = [[0.0, 0.0, 0.0], [2.0 * way, 0.0, 0.0], [0.0, 0.0, 0.0]]
    radii, gm = [1.0, 1.0, 0.0], [1e-20, 1e-20, 1.0]
    return orbits.System(["a", "b", "star"], gm, q, v, radii=radii, units=orbits.DIMENSIONLESS)


@cache
def bullet() -> Any:
    """Return six bodies in a row that hardly move, and a massless one that hits all of them in one step of theirs."""
    q, v = np.zeros((7, 3)), np.zeros((7, 3))
    q[:6, 0], q[6, 1], v[6, 0] = 10.0 * np.arange(1, 7), 9e-6, 1e6
    gm, radii = [1e-12] * 6 + [0.0], [1e-5] * 6 + [0.0]
    return orbits.System([*"abcdef", "bullet"], gm, q, v, radii=radii, units=orbits.DIMENSIONLESS)


@cache
def moons() -> Any:
    """Return Saturn as an oblate rigid body, Titan, Hyperion as a triaxial massless one, and a rock."""
    bodies = {
        "Saturn": {"mass": 5.683e26 * u.kg},
        "Titan": {"a": 1.2219e6 * u.km, "e": 0.0288, "mass": 1.345e23 * u.kg},
        "Hyperion": {"a": 1.4811e6 * u.km, "e": 0.1},
        "rock": {"a": 1.6e6 * u.km, "e": 0.01, "M": 1.0},
    }
    oblate = orbits.RigidBody(A=0.21, B=0.2102, C=0.23, radius=60268 * u.km, spin=812 * u.deg / u.day)
    triaxial = orbits.RigidBody(shape=(180, 133, 103) * u.km, attitude="Saturn", spin=16 * u.deg / u.day)
    system = orbits.System.from_elements(bodies, frame="ecliptic")
    return system.with_rigid({"Saturn": oblate, "Hyperion": triaxial})


@cache
def in_ephemeris(asteroids: int) -> Any:
    """Return small bodies in the field of DE440, with asteroids of a package, which may be missing."""
    try:
        field = orbits.System.in_ephemeris("de440", epoch="2022-08-09", asteroids=asteroids)
    except orbits.errors.InputError as error:
        if "is not installed" in str(error):
            raise Skipped(str(error)) from error
        raise
    return field.add_particles(orbits.asteroids(5))


def perturbed(number: int, massive: bool) -> Any:
    """Return a star with two planets, and two massless bodies unless all are massive; other orbits for each number."""
    names = ["b", "c", "p", "s"] if not massive else ["b", "c"]
    n = len(names)
    return orbits.System.from_elements({"star": {"gm": 1.0}}, units=orbits.DIMENSIONLESS).add(
        names,
        primary="star",
        gm=[1e-4, 1e-5, 0.0, 0.0][:n],
        a=np.array([1.0, 1.6, 1.3, 2.2])[:n] * (1.0 + 1e-3 * number),
        e=[0.02, 0.1, 0.2, 0.05][:n],
        inc=[0.0, 0.05, 0.1, 0.02][:n],
        l=np.array([0.0, 2.0, 4.0, 1.0])[:n] + 0.1 * number,
    )
