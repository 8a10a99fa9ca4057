"""Runs without dt beside REBOUND's IAS15: encounters and eccentric orbits."""

from __future__ import annotations

import statistics
import time
from collections.abc import Iterator
from typing import Any, NamedTuple

import mpmath
import numpy as np
from astropy.time import Time
from numpy.typing import NDArray

import orbits
from benchmarks.problems import AU_KM, rebound, ten_bodies_data
from benchmarks.references import rotated, rotations
from orbits.lagrangians.newtonian import newtonian, parameters
from orbits.marching.clocks import Place
from orbits.marching.marcher import Marcher

Array = NDArray[np.float64]

TOLERANCES = (1e-8, 1e-9)


class Problem(NamedTuple):
    """Bodies, how far they go, in which unit errors are told and of which body; all if None."""

    name: str
    gm: Array
    q: Array
    v: Array
    span: float
    unit: float = 1.0
    body: int | None = None


def part_adaptive(repetitions: int) -> dict[str, Any]:
    """Steps chosen one by one, Gauss with 8 stages: time from the start to the end, and the position error there, RMS
    over six rotated starts, each against where that very start leads: Kepler's orbits in 40 digits, Burrau's problem by
    a Taylor series in 128-bit floats, others in 80-bit floats. Errors in km among planets, else in units of the
    problem; what is light has a mass of 1e-30 of the Sun's.
    """
    rows = []
    for problem in _problems():
        seconds: dict[str, list[float]] = {}
        squares: dict[str, list[float]] = {}
        for rotation in rotations(6):
            start = rotated(problem.q, problem.v, rotation)
            solve = _kepler if len(problem.gm) == 2 else _taylor
            truth = solve(problem.gm, start.q, start.v, problem.span)
            for name in ("ias15", *TOLERANCES):
                best = np.inf
                for _ in range(max(1, min(repetitions, 3))):
                    if name == "ias15":
                        spent, end = rebound("ias15", problem.gm, start.q, start.v, 1e-3 * problem.span, problem.span)
                    else:
                        spent, end = _ours(problem, start.q, start.v, float(name))
                    best = min(best, spent)
                seconds.setdefault(str(name), []).append(best)
                if truth is not None:
                    off = np.linalg.norm(end - truth, axis=1) * problem.unit
                    squares.setdefault(str(name), []).append(
                        float(off.max() if problem.body is None else off[problem.body]) ** 2
                    )
        row: dict[str, Any] = {"problem": problem.name, "IAS15 ms": 1e3 * statistics.median(seconds["ias15"])}
        row["IAS15 error"] = _rms(squares.get("ias15"))
        for tolerance in TOLERANCES:
            name = str(tolerance)
            row[f"{tolerance:g} ms"] = 1e3 * statistics.median(seconds[name])
            row[f"{tolerance:g} error"] = _rms(squares.get(name))
            ratios = [a / b for a, b in zip(seconds["ias15"], seconds[name], strict=True)]
            row[f"{tolerance:g} times faster"] = statistics.median(ratios)
        rows.append(row)
    return {"rows": rows}


def _rms(squares: list[float] | None) -> float | None:
    return None if squares is None else float(np.sqrt(np.mean(squares)))


def _ours(problem: Problem, q: Array, v: Array, tolerance: float) -> tuple[float, Array]:
    """Return (seconds, positions at the end) of one run, compiled before the clock starts."""
    massive, clock = np.ones(len(problem.gm), dtype=bool), orbits.Adaptive(tolerance)
    march = Marcher(newtonian, orbits.Gauss(stages=8), parameters(problem.gm), massive, q, v, clock)
    march.compile()
    place = Place(0, problem.span)
    begun = time.perf_counter()
    march.advance_to(place)
    end, _ = march.state_at(place)
    return time.perf_counter() - begun, end


def _kepler(gm: Array, q: Array, v: Array, span: float) -> Array:
    """Return where two bodies on an ellipse are after `span`, by Kepler's equation in 40 digits."""
    with mpmath.workdps(40):
        m, t = [mpmath.mpf(float(x)) for x in gm], mpmath.mpf(float(span))
        x, w = ([[mpmath.mpf(float(c)) for c in row] for row in rows] for rows in (q, v))
        mu, r, u = m[0] + m[1], [b - a for a, b in zip(*x, strict=True)], [b - a for a, b in zip(*w, strict=True)]
        size, speed2, fall = mpmath.sqrt(mpmath.fdot(r, r)), mpmath.fdot(u, u), mpmath.fdot(r, u)
        a = 1 / (2 / size - speed2 / mu)
        n, cosine, sine = mpmath.sqrt(mu / a**3), 1 - size / a, fall / mpmath.sqrt(mu * a)
        turn = mpmath.fmod(n * t, 2 * mpmath.pi)
        d = mpmath.findroot(
            lambda d: d - cosine * mpmath.sin(d) + sine * (1 - mpmath.cos(d)) - turn,
            (-mpmath.pi / 10, 2 * mpmath.pi + mpmath.pi / 10),
            solver="anderson",
        )
        f = 1 - a / size * (1 - mpmath.cos(d))
        g = turn / n - (d - mpmath.sin(d)) / n
        lines = zip(x[0], w[0], x[1], w[1], strict=True)
        centre = [(m[0] * (x0 + w0 * t) + m[1] * (x1 + w1 * t)) / mu for x0, w0, x1, w1 in lines]
        apart = [f * a + g * b for a, b in zip(r, u, strict=True)]
        share = (-m[1] / mu, m[0] / mu)
        return np.array([[float(c + s * p) for c, p in zip(centre, apart, strict=True)] for s in share])


def _taylor(gm: Array, q: Array, v: Array, span: float) -> Array | None:
    """Return where a start leads by a Taylor series in more digits; None where heyoka is not installed."""
    try:
        import heyoka as hy
    except ImportError:
        return None
    number = hy.real128 if not v.any() else np.longdouble
    model = hy.model.nbody(len(gm), masses=[number(float(m)) for m in gm], Gconst=number(1.0))
    state = [number(float(x)) for row in np.hstack([q, v]) for x in row]
    taylor = hy.taylor_adaptive(model, state, fp_type=number, compact_mode=True)
    taylor.propagate_until(number(float(span)))
    return np.array([float(x) for x in taylor.state]).reshape(-1, 6)[:, :3]


def _problems() -> Iterator[Problem]:
    for e in (0.9, 0.99, 0.999, 0.9999):
        for where, side in (("apocentre", -1.0), ("pericentre", 1.0)):
            gm, r, speed = np.array([0.7, 0.3]), 1 - side * e, np.sqrt((1 + side * e) / (1 - side * e))
            q, v = np.array([[-0.3 * r, 0, 0], [0.7 * r, 0, 0]]), np.array([[0, -0.3 * speed, 0], [0, 0.7 * speed, 0]])
            yield Problem(f"e = {e}, 100 orbits from {where}", gm, q, v, 200 * np.pi)
    yield Problem(
        "Burrau's problem to t = 63",
        np.array([3.0, 4.0, 5.0]),
        np.array([[1.0, 3, 0], [-2, -1, 0], [1, -1, 0]]),
        np.zeros((3, 3)),
        63.0,
    )
    yield _triple()
    yield _apophis()
    yield _comet()


def _triple() -> Problem:
    """An inner pair and a third body on an inclined orbit, both at apocentre."""
    gm, tilt = np.array([0.6, 0.4, 0.5]), np.radians(75.0)
    inner, outer = np.array([-1.1, 0, 0]), np.array([-15.0, 0, 0])
    slow = np.sqrt(1.0 * (1 - 0.1) / (1 + 0.1)) * np.array([0, -1.0, 0])
    far = np.sqrt(1.5 / 10.0 * (1 - 0.5) / (1 + 0.5)) * np.array([0, -np.cos(tilt), -np.sin(tilt)])
    states = []
    for pair, third in ((inner, outer), (slow, far)):
        centre = -third / 3.0
        states.append(np.array([centre - 0.4 * pair, centre + 0.6 * pair, centre + third]))
    return Problem("hierarchical triple to t = 10,000", gm, *states, 1e4)


def _apophis() -> Problem:
    """Apophis past the Earth in 2029, from a hundred days before to 265 days after."""
    massive = ["Sun", "Mercury", "Venus", "Earth", "Moon", "Mars", "Jupiter", "Saturn", "Uranus", "Neptune"]
    epoch = Time(2462138.5359989386, format="jd", scale="tdb")
    start = orbits.System.solar_system(epoch=epoch, bodies=massive)
    gm, q, v, _ = start.values
    place = np.array([-0.5594653855048851, 0.8564756475757451, 0.30415066217102493])
    speed = np.array([-0.013818324735921638, -0.006008827559793919, -0.0025805044631309632])
    return Problem(
        "Apophis 2029, 365 d",
        np.append(gm, 1e-30 * gm[0]),
        np.vstack([q, q[0] + place]),
        np.vstack([v, v[0] + speed]),
        365.0,
        AU_KM,
        len(gm),
    )


def _comet() -> Problem:
    """A comet with a perihelion of 0.02 au among the planets, from a year before it."""
    gm, q, v, _ = ten_bodies_data()
    a, e = 200.0, 0.9999
    anomaly = -np.sqrt(gm[0] / a**3) * 365.25
    eccentric = -0.2
    for _ in range(60):
        eccentric -= (eccentric - e * np.sin(eccentric) - anomaly) / (1 - e * np.cos(eccentric))
    c, s, r = np.cos(eccentric), np.sin(eccentric), a * (1 - e * np.cos(eccentric))
    flat = a * (c - e), a * np.sqrt(1 - e * e) * s
    moving = -np.sqrt(gm[0] * a) / r * s, np.sqrt(gm[0] * a * (1 - e * e)) / r * c
    node, peri, tilt = 0.4, 1.0, 0.5
    p = np.array(
        [
            np.cos(peri) * np.cos(node) - np.sin(peri) * np.sin(node) * np.cos(tilt),
            np.cos(peri) * np.sin(node) + np.sin(peri) * np.cos(node) * np.cos(tilt),
            np.sin(peri) * np.sin(tilt),
        ]
    )
    w = np.array(
        [
            -np.sin(peri) * np.cos(node) - np.cos(peri) * np.sin(node) * np.cos(tilt),
            -np.sin(peri) * np.sin(node) + np.cos(peri) * np.cos(node) * np.cos(tilt),
            np.cos(peri) * np.sin(tilt),
        ]
    )
    return Problem(
        "comet, q = 0.02 au, e = 0.9999, 2 yr",
        np.append(gm, 1e-30 * gm[0]),
        np.vstack([q, q[0] + flat[0] * p + flat[1] * w]),
        np.vstack([v, v[0] + moving[0] * p + moving[1] * w]),
        730.5,
        AU_KM,
        len(gm),
    )
