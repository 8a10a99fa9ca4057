"""The benchmark problems, and runs of them by this package and by the peers."""

from __future__ import annotations

import json
import time
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np

import orbits
from benchmarks.references import Exact, exact
from orbits.lagrangians.newtonian import newtonian, parameters
from orbits.marching.clocks.clock import Clock
from orbits.marching.legs.leg import Leg
from orbits.point_masses import PointMasses
from orbits.regression import peers
from orbits.resources import data_path

AU_KM = 149597870.7


YEAR = 365.25


def ten_bodies_data() -> tuple[np.ndarray, np.ndarray, np.ndarray, dict[str, Exact]]:
    """GM, q, v of Sun, planets and Pluto at J2000, and where quadruple precision puts them after some years."""
    data = json.loads(data_path("solar_system_10body.json").read_text())
    reference = {years: exact(rows)[:, :3] for years, rows in data["reference_years"].items()}
    return np.array(data["gm_au3_d2"]), np.array(data["q"]), np.array(data["v"]), reference


def marcher(
    method: Any, gm: np.ndarray, q: np.ndarray, v: np.ndarray, h: Clock | float, threads: int = 1, **options: Any
) -> Leg:
    """A system of floats bound to a method; options : those of `Leg`."""
    massive = gm > 0
    return Leg.of(newtonian, method, parameters(gm[massive]), massive, q, v, h, threads=threads, **options)


_COMPILED: set[tuple[Any, ...]] = set()
"""The runs that `ours` has compiled."""


def ours(
    method: Any,
    gm: np.ndarray,
    q: np.ndarray,
    v: np.ndarray,
    dt: Clock | float,
    span: float,
    threads: int = 1,
    samples: int = 2,
) -> tuple[float, np.ndarray]:
    """Return (seconds, positions at `span`) of one run, as a user has it: a call of `propagate`, all checks on. The
    first one of its kind is repeated, as it compiles.
    """
    system = orbits.System([f"body {k}" for k in range(len(gm))], gm, q, v, units=orbits.DIMENSIONLESS)
    kind = method, type(dt), len(gm), int(system.massive.sum()), threads
    for _ in range(1 if kind in _COMPILED else 2):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", orbits.errors.OrbitsWarning)
            begun = time.perf_counter()
            run = orbits.propagate(
                system, method, dt=dt, duration=span, samples=samples, threads=threads, progress=False
            )
            seconds = time.perf_counter() - begun
    _COMPILED.add(kind)
    return seconds, run.q.value[-1]


def kernel(
    method: Any, gm: np.ndarray, q: np.ndarray, v: np.ndarray, h: Clock | float, span: float, threads: int = 1
) -> tuple[float, np.ndarray]:
    """Return (seconds, positions at `span`) of the march of a run alone, without what `propagate` does around it:
    compiled before the clock starts.
    """
    run = marcher(method, gm, q, v, h, threads, retire=True, approaches=method.looks_for_approaches)
    run.compile()
    place = run.clock.place(span)
    begun = time.perf_counter()
    run.advance_to(place)
    seconds = time.perf_counter() - begun
    end, _ = run.state_at(place)
    run.close()
    return seconds, end


def rebound(name: str, gm: np.ndarray, q: np.ndarray, v: np.ndarray, dt: float, span: float):
    """Return (seconds, positions at `span`) of a REBOUND run."""
    run = peers.run(name, PointMasses(gm, q, v), times=np.array([span]), dt=dt)
    return run.wall_s, run.q[-1]


def heyoka(
    gm: np.ndarray, tolerance: float = 2.0**-52, *, high_accuracy: bool = False, compact: bool = False
) -> Callable[..., tuple[float, np.ndarray]] | None:
    """Return a runner of heyoka's Taylor integrator for these masses, compiled; None where heyoka is not installed.
    Massless bodies come last.

    high_accuracy : whether it sums its series in compensated arithmetic; compact : whether it compiles a small program
    """
    try:
        import heyoka as hy
    except ImportError:
        return None
    model = hy.model.nbody(len(gm), masses=list(gm[gm > 0.0] / gm[0]), Gconst=gm[0])
    integrator = hy.taylor_adaptive(
        model, state=np.zeros(6 * len(gm)), tol=tolerance, high_accuracy=high_accuracy, compact_mode=compact
    )

    def run(q: np.ndarray, v: np.ndarray, span: float) -> tuple[float, np.ndarray]:
        integrator.time = 0.0
        integrator.state[:] = np.hstack([q, v]).ravel()
        begun = time.perf_counter()
        integrator.propagate_until(span)
        return time.perf_counter() - begun, integrator.state.reshape(-1, 6)[:, :3].copy()

    return run


def belt(count: int, seed: int = 1) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The ten bodies, and massless particles on orbits as in the asteroid belt."""
    gm, q, v, _ = ten_bodies_data()
    rng = np.random.default_rng(seed)
    a, e = rng.uniform(2.1, 3.3, count), rng.uniform(0.0, 0.2, count)
    angle, inclination = rng.uniform(0, 2 * np.pi, count), rng.uniform(0, 0.3, count)
    r, speed = a * (1 - e), np.sqrt(gm[0] / a * (1 + e) / (1 - e))
    radial = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(count)])
    across = np.column_stack(
        [-np.sin(angle) * np.cos(inclination), np.cos(angle) * np.cos(inclination), np.sin(inclination)]
    )
    return (
        np.append(gm, np.zeros(count)),
        np.vstack([q, q[0] + r[:, None] * radial]),
        np.vstack([v, v[0] + speed[:, None] * across]),
    )


def cluster(count: int, seed: int = 1) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A ball of equal bodies, total GM = 1, in slow random motion."""
    rng = np.random.default_rng(seed)
    return np.full(count, 1.0 / count), rng.normal(size=(count, 3)), 0.4 * rng.normal(size=(count, 3))
