"""Bodies: time and accuracy compared with the peers."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from typing import Any

import numpy as np

import orbits
from benchmarks.problems import AU_KM, YEAR, belt, cluster, heyoka, kernel, ours, rebound, ten_bodies_data
from benchmarks.references import ends, errors, rotated, rotations
from orbits.marching.legs.leg import available_threads

HEYOKA = "heyoka Taylor, tol 2^-52"


def part_ten_bodies(repetitions: int) -> dict[str, Any]:
    """Sun, planets and Pluto as point masses over 1,000 years. A run is a whole call of `propagate`; the kernel is its
    march alone. Errors are those of the positions at the end: each method starts from the same planets, turned in
    several ways and rounded to floats, and is compared with the solution for just these floats in quadruple precision;
    the table has the root mean square. How far point masses are from the real Solar System is [another
    question](model.md#newtonian-point-masses).
    """
    gm, q, v, reference = ten_bodies_data()
    span = 1000 * YEAR
    starts = [rotated(q, v, rotation) for rotation in rotations(max(8, repetitions))]
    truths = ends(gm, q, v, reference["1000"], starts, span)
    names = ("Mercury", "Venus", "Earth-Moon", "Mars", "Jupiter", "Saturn", "Uranus", "Neptune", "Pluto")
    methods: dict[str, Callable[..., tuple[float, np.ndarray]]] = {}
    kernels: dict[str, Callable[..., tuple[float, np.ndarray]]] = {}
    steps = {f"dt {h:g} d": h for h in (6.0, 4.0, 3.0, 2.0)}
    chosen = {f"no dt, tolerance {x:g}": orbits.Adaptive(x) for x in (1e-8, 1e-9)}
    for what, dt in {**steps, **chosen}.items():
        name = f"Gauss(stages=8), {what}"
        methods[name] = lambda q, v, span, dt=dt: ours(orbits.Gauss(stages=8), gm, q, v, dt, span)
        kernels[name] = lambda q, v, span, dt=dt: kernel(orbits.Gauss(stages=8), gm, q, v, dt, span)
    methods["REBOUND ias15"] = lambda q, v, span: rebound("ias15", gm, q, v, 6.0, span)
    methods["REBOUND whfast-corrector17, dt 3 d"] = lambda q, v, span: rebound(
        "whfast-corrector17", gm, q, v, 3.0, span
    )
    taylor, exact = heyoka(gm), heyoka(gm, high_accuracy=True)
    if taylor is not None and exact is not None:
        methods[HEYOKA], methods[f"{HEYOKA}, high accuracy"] = taylor, exact
    seconds: dict[str, list[float]] = {m: [] for m in methods}
    alone: dict[str, list[float]] = {m: [] for m in methods}
    squares: dict[str, list[np.ndarray]] = {m: [] for m in methods}
    for start, truth in zip(starts, truths, strict=True):
        for name, run in methods.items():
            spent, end = run(start.q, start.v, span)
            seconds[name].append(spent)
            squares[name].append(errors(end, start, truth) ** 2)
            if name in kernels:
                alone[name].append(kernels[name](start.q, start.v, span)[0])
    rows = []
    base = {k: statistics.median(s) for k, s in seconds.items()}
    for name in methods:
        error = AU_KM * np.sqrt(np.mean(squares[name], axis=0))[1:]
        rows.append(
            {
                "method": name,
                "run s": base[name],
                "kernel s": statistics.median(alone[name]) if alone[name] else None,
                "times faster than ias15": statistics.median(
                    a / b for a, b in zip(seconds["REBOUND ias15"], seconds[name], strict=True)
                ),
                "times faster than heyoka": statistics.median(
                    a / b for a, b in zip(seconds[HEYOKA], seconds[name], strict=True)
                )
                if taylor is not None
                else None,
                "rms_km": dict(zip(names, error.tolist(), strict=True)),
            }
        )
    return {"starts": len(squares[name]), "rows": rows}


def part_particles(repetitions: int) -> dict[str, Any]:
    """1,000 massless particles and ten bodies for five years. A run is a whole call of `propagate` on one thread; the
    kernel is its march alone. Errors are those of the particles' positions at the end, compared with Gauss in steps of
    a day; the error of this reference is its difference from Gauss with 7 stages in the same steps.
    """
    gm, q, v = belt(1000)
    span = 5 * YEAR
    _, truth = ours(orbits.Gauss(stages=8), gm, q, v, 1.0, span)
    _, check = ours(orbits.Gauss(stages=7), gm, q, v, 1.0, span)
    steps = {f"Gauss(stages=8), dt {h:g} d": h for h in (6.0, 9.0)}
    methods = {name: lambda h=h: ours(orbits.Gauss(stages=8), gm, q, v, h, span) for name, h in steps.items()}
    methods["REBOUND ias15"] = lambda: rebound("ias15", gm, q, v, 6.0, span)
    seconds: dict[str, list[float]] = {m: [] for m in methods}
    alone: dict[str, list[float]] = {m: [] for m in methods}
    error = {}
    for _ in range(repetitions):
        for name, run in methods.items():
            spent, end = run()
            seconds[name].append(spent)
            if name in steps:
                alone[name].append(kernel(orbits.Gauss(stages=8), gm, q, v, steps[name], span)[0])
            miss = AU_KM * np.linalg.norm(end - truth, axis=1)[10:]
            error[name] = {"median_km": float(np.median(miss)), "max_km": float(miss.max())}
    return {
        "reference": "Gauss(stages=8), dt 1 d",
        "reference_error_km": float(AU_KM * np.linalg.norm(check - truth, axis=1)[10:].max()),
        "rows": [
            {
                "method": name,
                "run s per year": statistics.median(seconds[name]) / 5,
                "kernel s per year": statistics.median(alone[name]) / 5 if alone[name] else None,
                "times faster than ias15": statistics.median(
                    a / b for a, b in zip(seconds["REBOUND ias15"], seconds[name], strict=True)
                ),
                **error[name],
            }
            for name in methods
        ],
    }


def part_explicit(repetitions: int) -> dict[str, Any]:
    """A step of Störmer–Verlet, the kernel alone, beside one of REBOUND's leapfrog: of nine bodies, and of 1,000
    massless particles with them.
    """
    rows = []
    for label, particles, steps in (("9 bodies", 0, 100_000), ("9 bodies and 1,000 massless particles", 1000, 4000)):
        gm, q, v = belt(particles)
        keep = np.arange(len(gm)) != 9
        gm, q, v = gm[keep], q[keep], v[keep]
        mine, theirs = [], []
        for _ in range(repetitions):
            mine.append(kernel(orbits.StormerVerlet(), gm, q, v, 1.0, float(steps))[0])
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
    """Runs of 8,000 massless particles on one thread and on all processors: how many times faster, and whether the bits
    are the same.
    """
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
    """Thousands of bodies that attract each other: runs by Störmer–Verlet on one thread and on all processors, beside
    REBOUND's leapfrog. Nanoseconds for each pair of bodies, counted once, and step.
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
    """Motion on Kepler orbits, e up to 0.2: nanoseconds a step for each of 1,024 massless particles, computed eight at
    a time in lanes, and one at a time, beside REBOUND's WHFast, which also changes coordinates in each step.
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
