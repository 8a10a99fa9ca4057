"""The energy of planets that scatter each other, by maps that all bodies leave for encounters, and by peers."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

import orbits
from orbits.elements import state_from_elements
from orbits.integrators.wisdom_holman import COORDINATES
from orbits.marching.clocks.adaptive import Adaptive
from orbits.marching.clocks.constant import ConstantSteps
from orbits.point_masses import PointMasses
from orbits.propagation.marchers import march_of

Array = NDArray[np.float64]

SUN, YEAR = 0.00029591220828, 365.25

STARTS, LOOKS = 10, 20

PROBLEMS = {
    "three Jupiters": (1e-3, (5.2, 6.3, 7.9), 0.05, 100.0, 2000.0),
    "two Neptunes": (5.15e-5, (5.0, 5.3), 0.08, 100.0, 2000.0),
    "two Earths": (3e-6, (1.0, 1.05), 0.05, 8.0, 500.0),
}
"""The planets' masses, semi-major axes in au and eccentricity, the step in days and the years."""


PEERS = "mercurius", "trace", "ias15"


def part_scattering(repetitions: int) -> dict[str, Any]:
    """Planets about a star of one solar mass that cross each other's orbits, from ten starts: three Jupiters at 5.2,
    6.3 and 7.9 au and two Neptunes at 5 and 5.3 au for 2,000 years, and two Earths at 1 and 1.05 au for 500 years. The
    maps, WisdomHolman(encounters="follow") in both coordinates, MERCURIUS and TRACE, take steps of 100 d, for the
    Earths of 8 d; Gauss and IAS15 choose theirs. The table has the largest relative error of the energy at 20 times,
    the median and the largest of the starts; seconds for each start; and how often all bodies left the map for steps of
    Gauss.
    """
    rows = []
    for problem, (mass, sizes, e, h, years) in PROBLEMS.items():
        for method in ("jacobi", "democratic-heliocentric", "gauss", "mercurius", "trace", "ias15"):
            errors, seconds, left = [], 0.0, 0
            march = _theirs if method in PEERS else _ours
            list(march(method, *planets(STARTS, mass, sizes, e), h, years / 10.0))  # what is compiled
            for seed in range(STARTS):
                gm, q, v = planets(seed, mass, sizes, e)
                begun, first, worst = time.perf_counter(), energy(gm, q, v), 0.0
                for x, w, count in march(method, gm, q, v, h, years):
                    worst, left = max(worst, abs(energy(gm, x, w) / first - 1.0)), left + count
                seconds += time.perf_counter() - begun
                errors.append(worst)
            name = f"wisdom-holman, {method}" if method in COORDINATES else method
            row = {"problem": problem, "method": name, "median": float(np.median(errors)), "largest": max(errors)}
            rows.append({**row, "seconds": seconds / STARTS, "excursions": left / STARTS if left else ""})
    return {"rows": rows}


def planets(seed: int, mass: float, sizes: tuple[float, ...], e: float) -> tuple[Array, Array, Array]:
    """Return GM, q and v of a star and planets of this fraction of its mass, with angles drawn at random."""
    rng = np.random.default_rng(seed)
    gm = np.array([SUN] + [mass * SUN] * len(sizes))
    q, v = np.zeros((2, len(gm), 3))
    for k, a in enumerate(sizes, 1):
        node, peri, anomaly = rng.uniform(0.0, 2.0 * np.pi, 3)
        tilt = rng.uniform(0.0, 0.03)
        q[k], v[k] = state_from_elements(
            (1.0 + mass) * SUN, a=a, e=e, inc=tilt, Omega=node, omega=peri, M=anomaly
        )
    return gm, q - gm @ q / gm.sum(), v - gm @ v / gm.sum()


def energy(gm: Array, q: Array, v: Array) -> float:
    """Return the energy, times G."""
    i, j = np.triu_indices(len(gm), 1)
    pairs = gm[i] * gm[j] / np.linalg.norm(q[i] - q[j], axis=1)
    return float(0.5 * (gm * (v * v).sum(axis=1)).sum() - pairs.sum())


def _ours(
    coordinates: str, gm: Array, q: Array, v: Array, h: float, years: float
) -> Iterator[tuple[Array, Array, int]]:
    bodies, clock, method = PointMasses(gm, q, v), ConstantSteps(h), orbits.Gauss(stages=8)
    if coordinates in COORDINATES:
        method = orbits.WisdomHolman(coordinates=coordinates, encounters="follow")
    else:
        clock = Adaptive()
    march = march_of(bodies, method, clock)
    for k in range(1, LOOKS + 1):
        place = clock.place(round(k * years * YEAR / LOOKS / h) * h)
        march.advance_to(place)
        yield *march.state_at(place), march.excursions()[1] if k == LOOKS and coordinates in COORDINATES else 0


def _theirs(name: str, gm: Array, q: Array, v: Array, h: float, years: float) -> Iterator[tuple[Array, Array, int]]:
    from orbits.regression.peers import simulation

    simulated = simulation(PointMasses(gm, q, v))
    simulated.integrator, simulated.dt = name, h
    for k in range(1, LOOKS + 1):
        simulated.integrate(k * years * YEAR / LOOKS, exact_finish_time=0)
        x, w = np.empty_like(q), np.empty_like(v)
        simulated.serialize_particle_data(xyz=x, vxvyvz=w)
        yield x, w, 0
