"""Bodies: time and accuracy compared with the peers."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from typing import Any

import numpy as np

import orbits
from benchmarks.problems import AU_KM, YEAR, belt, cluster, heyoka, ours, rebound, ten_bodies_data
from benchmarks.references import ends, errors, rotated, rotations
from orbits.marching.legs.leg import available_threads


def part_ten_bodies(repetitions: int) -> dict[str, Any]:
    """Sun, planets and Pluto, Newtonian point masses, over 1,000 years: time, and RMS position error over rotated
    initial states, each compared with the solution for exactly its rounded floats. The deviation of the model from the
    real Solar System is [another matter](model.md#newtonian-point-masses).
    """
    gm, q, v, reference = ten_bodies_data()
    span = 1000 * YEAR
    starts = [rotated(q, v, rotation) for rotation in rotations(max(8, repetitions))]
    truths = ends(gm, q, v, reference["1000"], starts, span)
    names = ("Mercury", "Venus", "Earth-Moon", "Mars", "Jupiter", "Saturn", "Uranus", "Neptune", "Pluto")
    methods: dict[str, Callable[..., tuple[float, np.ndarray]]] = {}
    for h in (6.0, 4.0, 3.0, 2.0):
        methods[f"Gauss(stages=8), dt {h:g} d"] = lambda gm, q, v, dt, span, h=h: ours(
            orbits.Gauss(stages=8), gm, q, v, h, span
        )
    for tolerance in (1e-8, 1e-9):
        methods[f"Gauss(stages=8), no dt, tolerance {tolerance:g}"] = lambda gm, q, v, dt, span, x=tolerance: ours(
            orbits.Gauss(stages=8), gm, q, v, orbits.Adaptive(x), span
        )
    methods["REBOUND ias15"] = lambda *a: rebound("ias15", *a)
    methods["REBOUND whfast-corrector17, dt 3 d"] = lambda gm, q, v, dt, span: rebound(
        "whfast-corrector17", gm, q, v, 3.0, span
    )
    taylor = heyoka(gm)
    if taylor is not None:
        methods["heyoka Taylor, tol 2^-52"] = taylor
    seconds: dict[str, list[float]] = {m: [] for m in methods}
    squares: dict[str, list[np.ndarray]] = {m: [] for m in methods}
    for start, truth in zip(starts, truths, strict=True):
        for name, run in methods.items():
            spent, end = run(gm, start.q, start.v, 6.0, span)
            seconds[name].append(spent)
            squares[name].append(errors(end, start, truth) ** 2)
    rows = []
    base = {k: statistics.median(s) for k, s in seconds.items()}
    for name in methods:
        error = AU_KM * np.sqrt(np.mean(squares[name], axis=0))[1:]
        rows.append(
            {
                "method": name,
                "seconds": base[name],
                "times faster than ias15": statistics.median(
                    a / b for a, b in zip(seconds["REBOUND ias15"], seconds[name], strict=True)
                ),
                "times faster than heyoka": statistics.median(
                    a / b for a, b in zip(seconds["heyoka Taylor, tol 2^-52"], seconds[name], strict=True)
                )
                if taylor is not None
                else None,
                "rms_km": dict(zip(names, error.tolist(), strict=True)),
            }
        )
    return {"starts": len(squares[name]), "rows": rows}


def part_particles(repetitions: int) -> dict[str, Any]:
    """1,000 massless particles and ten bodies for five years: time, and error against Gauss with steps of one day,
    whose own error is its difference from Gauss with 7 stages.
    """
    gm, q, v = belt(1000)
    span = 5 * YEAR
    _, truth = ours(orbits.Gauss(stages=8), gm, q, v, 1.0, span)
    _, check = ours(orbits.Gauss(stages=7), gm, q, v, 1.0, span)
    methods = {
        f"Gauss(stages=8), dt {h:g} d": lambda h=h: ours(orbits.Gauss(stages=8), gm, q, v, h, span) for h in (6.0, 9.0)
    }
    methods["REBOUND ias15"] = lambda: rebound("ias15", gm, q, v, 6.0, span)
    seconds: dict[str, list[float]] = {m: [] for m in methods}
    error = {}
    for _ in range(repetitions):
        for name, run in methods.items():
            spent, end = run()
            seconds[name].append(spent)
            miss = AU_KM * np.linalg.norm(end - truth, axis=1)[10:]
            error[name] = {"median_km": float(np.median(miss)), "max_km": float(miss.max())}
    return {
        "reference": "Gauss(stages=8), dt 1 d",
        "reference_error_km": float(AU_KM * np.linalg.norm(check - truth, axis=1)[10:].max()),
        "rows": [
            {
                "method": name,
                "seconds_per_year": statistics.median(seconds[name]) / 5,
                "times faster than ias15": statistics.median(
                    a / b for a, b in zip(seconds["REBOUND ias15"], seconds[name], strict=True)
                ),
                **error[name],
            }
            for name in methods
        ],
    }


def part_explicit(repetitions: int) -> dict[str, Any]:
    """Störmer–Verlet beside REBOUND's leapfrog: nine bodies alone, and 1,000 massless particles."""
    rows = []
    for label, particles, steps in (("9 bodies", 0, 100_000), ("9 bodies and 1,000 massless particles", 1000, 4000)):
        gm, q, v = belt(particles)
        keep = np.arange(len(gm)) != 9
        gm, q, v = gm[keep], q[keep], v[keep]
        mine, theirs = [], []
        for _ in range(repetitions):
            mine.append(ours(orbits.StormerVerlet(), gm, q, v, 1.0, float(steps))[0])
            theirs.append(rebound("leapfrog", gm, q, v, 1.0, float(steps))[0])
        per = 1e9 / steps / max(1, particles)
        rows.append(
            {
                "problem": label,
                "Störmer–Verlet ns": statistics.median(mine) * per,
                "leapfrog ns": statistics.median(theirs) * per,
                "times faster than leapfrog": statistics.median(a / b for a, b in zip(theirs, mine, strict=True)),
                "per": "particle and step" if particles else "step",
            }
        )
    return {"rows": rows}


def part_threads(repetitions: int) -> dict[str, Any]:
    """8,000 massless particles on one thread and on all of this machine's processors; the same bits."""
    gm, q, v = belt(8000)
    count = available_threads()
    rows = []
    for method, h, steps in ((orbits.Gauss(stages=8), 6.0, 200), (orbits.StormerVerlet(), 1.0, 4000)):
        one, many, same = [], [], True
        for _ in range(repetitions):
            spent, alone = ours(method, gm, q, v, h, h * steps)
            one.append(spent)
            spent, shared = ours(method, gm, q, v, h, h * steps, count)
            many.append(spent)
            same = same and bool(np.array_equal(alone, shared))
        rows.append(
            {
                "method": method.label,
                "threads": count,
                "speed_up": statistics.median(a / b for a, b in zip(one, many, strict=True)),
                "same_bits": same,
            }
        )
    return {"rows": rows}


def part_large(repetitions: int) -> dict[str, Any]:
    """Thousands of mutually attracting bodies: Störmer–Verlet on one thread and on all processors, beside
    REBOUND's leapfrog; nanoseconds for each pair i < j and step, closest approaches recorded on the way.
    """
    count = available_threads()
    rows = []
    for bodies, steps in ((1000, 512), (4000, 48)):
        gm, q, v = cluster(bodies)
        one, many, theirs, same = [], [], [], True
        for _ in range(repetitions):
            spent, alone = ours(orbits.StormerVerlet(), gm, q, v, 2.0**-10, steps * 2.0**-10)
            one.append(spent)
            spent, shared = ours(orbits.StormerVerlet(), gm, q, v, 2.0**-10, steps * 2.0**-10, count)
            many.append(spent)
            same = same and bool(np.array_equal(alone, shared))
            theirs.append(rebound("leapfrog", gm, q, v, 2.0**-10, steps * 2.0**-10)[0])
        per = 1e9 / steps / (bodies * (bodies - 1) / 2)
        rows.append(
            {
                "bodies": bodies,
                "one thread ns": statistics.median(one) * per,
                "leapfrog ns": statistics.median(theirs) * per,
                "times faster than leapfrog": statistics.median(a / b for a, b in zip(theirs, one, strict=True)),
                "threads": count,
                "speed_up": statistics.median(a / b for a, b in zip(one, many, strict=True)),
                "same_bits": same,
            }
        )
    return {"rows": rows}


def part_kepler(repetitions: int) -> dict[str, Any]:
    """The Kepler flow of 1,024 massless particles about one star, e up to 0.2: numbers and lanes beside WHFast, which
    adds its change of coordinates; nanoseconds a particle and step.
    """
    from orbits.kernels.compile import kernel
    from orbits.kernels.kepler.flow import kepler_flow, kepler_increments

    @kernel
    def lanes(state, gm, dt, steps):
        for _ in range(steps):
            kepler_flow(state, gm, dt)

    @kernel
    def numbers(state, gm, dt, steps):
        for _ in range(steps):
            for p in range(state.shape[1]):
                x, y, z, u, v, w = state[0, p], state[1, p], state[2, p], state[3, p], state[4, p], state[5, p]
                dx, dy, dz, du, dv, dw = kepler_increments(x, y, z, u, v, w, gm[p], dt[p])
                state[0, p], state[1, p], state[2, p] = x + dx, y + dy, z + dz
                state[3, p], state[4, p], state[5, p] = u + du, v + dv, w + dw

    count, steps, rows = 1024, 200, []
    gm, q, v = belt(count)
    keep = np.r_[0, 10 : 10 + count]
    gm, q, v = gm[keep], q[keep] - q[0], v[keep] - v[0]
    strength = np.full(count, gm[0])
    start = np.vstack([q[1:].T, v[1:].T])
    for h in (10.0, 60.0):
        dt, spent = np.full(count, h), {"lanes": [], "numbers": [], "whfast": []}
        for compiled in (lanes, numbers):
            compiled(start.copy(), strength, dt, 1)
        for _ in range(repetitions):
            for name, compiled in (("lanes", lanes), ("numbers", numbers)):
                state = start.copy()
                begun = time.perf_counter()
                compiled(state, strength, dt, steps)
                spent[name].append(time.perf_counter() - begun)
            spent["whfast"].append(rebound("whfast", gm, q, v, h, h * steps)[0])
        per = 1e9 / steps / count
        rows.append(
            {
                "dt": f"{h:g} d",
                "lanes ns": statistics.median(spent["lanes"]) * per,
                "numbers ns": statistics.median(spent["numbers"]) * per,
                "WHFast ns": statistics.median(spent["whfast"]) * per,
                "times faster than WHFast": statistics.median(
                    a / b for a, b in zip(spent["whfast"], spent["lanes"], strict=True)
                ),
            }
        )
    return {"rows": rows}
