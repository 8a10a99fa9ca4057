"""Runs without dt beside REBOUND's IAS15 and heyoka: encounters, eccentric orbits, light bodies."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

import orbits
from benchmarks.encounters import Problem, crossers, flybys, problems, taylor, truth_of
from benchmarks.native import Native, ias15, peer
from benchmarks.precision_picture import draw
from benchmarks.problems import heyoka, kernel, marcher, ours, ten_bodies_data
from benchmarks.references import rotated, rotations
from orbits.marching.clocks.step_times import Place

Array = NDArray[np.float64]

TOLERANCES = (1e-8, 1e-9)

GAUSS = orbits.Gauss(stages=8)


def part_adaptive(repetitions: int) -> dict[str, Any]:
    """Runs without dt by Gauss with 8 stages and two tolerances, beside REBOUND's IAS15 with its default epsilon, from
    its wheel and as built on this machine (-O3 -march=native). A run is a whole call of `propagate`; the kernel is its
    march alone. Apophis and the comet are massless, and test particles in REBOUND. The error is that of the position at
    the end, the root mean square over six starts: the problem turned and rounded to floats, each compared with the
    solution for just these floats, in 40 digits for two bodies and by a Taylor series in 128-bit or 80-bit floats for
    more. It is in km among planets, and else in units of the problem.
    """
    rows, native = [], Native.start()
    for problem in problems():
        seconds: dict[str, list[float]] = {}
        squares: dict[str, list[float]] = {}
        for rotation in rotations(6):
            start = rotated(problem.q, problem.v, rotation)
            truth = truth_of(problem, start.q, start.v)
            for name in ("ias15", *([] if native is None else ["native"]), *TOLERANCES):
                best = np.inf
                for _ in range(max(1, min(repetitions, 3))):
                    if name == "ias15":
                        spent, end, _ = ias15(problem.gm, start.q, start.v, problem.span)
                    elif name == "native":
                        assert native is not None
                        spent, end, _ = native("ias15", problem.gm, start.q, start.v, problem.span)
                    else:
                        arguments = GAUSS, problem.gm, start.q, start.v, orbits.Adaptive(float(name)), problem.span
                        spent, end = ours(*arguments)
                        seconds.setdefault(f"{name} kernel", []).append(kernel(*arguments)[0])
                    best = min(best, spent)
                seconds.setdefault(str(name), []).append(best)
                if truth is not None:
                    squares.setdefault(str(name), []).append(_off(problem, end, truth) ** 2)
        row: dict[str, Any] = {"problem": problem.name, "IAS15 ms": 1e3 * statistics.median(seconds["ias15"])}
        row["built here ms"] = 1e3 * statistics.median(seconds["native"]) if native else None
        row["IAS15 error"] = _rms(squares.get("ias15"))
        for tolerance in TOLERANCES:
            name = str(tolerance)
            row[f"{tolerance:g} run ms"] = 1e3 * statistics.median(seconds[name])
            row[f"{tolerance:g} kernel ms"] = 1e3 * statistics.median(seconds[f"{name} kernel"])
            row[f"{tolerance:g} error"] = _rms(squares.get(name))
            ratios = [a / b for a, b in zip(seconds["ias15"], seconds[name], strict=True)]
            row[f"{tolerance:g} times faster"] = statistics.median(ratios)
        rows.append(row)
    if native is not None:
        native.close()
    return {"rows": rows}


def part_light_bodies(repetitions: int) -> dict[str, Any]:
    """A massless stone that passes a light body, such as an asteroid of 3e-10 or 3e-7 solar masses, in the middle of
    600 days: its position error at the end, and the time of the whole run. First as both programs do it by default;
    then IAS15 with the largest epsilon tried for which it is as accurate as ours, or with the best one if none is.
    """
    rows = []
    for problem in flybys():
        truth = truth_of(problem, problem.q, problem.v)
        assert truth is not None
        row: dict[str, Any] = {"flyby": problem.name}
        tried = []
        for epsilon in (None, 1e-10, 1e-11, 1e-12, 1e-13, 1e-14, 1e-15, 1e-16):
            runs = (ias15(problem.gm, problem.q, problem.v, problem.span, epsilon) for _ in range(5))
            spent, end, _ = min(runs, key=_first)
            tried.append((_off(problem, end, truth), spent, epsilon))
        arguments = GAUSS, problem.gm, problem.q, problem.v, orbits.Adaptive(), problem.span
        spent, end = min((ours(*arguments) for _ in range(max(5, repetitions))), key=_first)
        row["ours km"], row["ours ms"] = _off(problem, end, truth), 1e3 * spent
        row["IAS15 km"], row["IAS15 ms"] = tried[0][0], 1e3 * tried[0][1]
        good = [entry for entry in tried[1:] if entry[0] <= row["ours km"]] or [min(tried[1:])]
        row["with epsilon"], row["then km"], row["then ms"] = good[0][2], good[0][0], 1e3 * good[0][1]
        rows.append(row)
    return {"rows": rows}


def part_crossers(repetitions: int) -> dict[str, Any]:
    """Fifty massless particles that cross Jupiter's orbit, among Sun, Jupiter and Saturn: seconds of whole runs of
    2,000 years on one core, how many particles came to the end and how many were retired on the way; and the median and
    the largest position error after 100 years, compared with a Taylor series in 80-bit floats. MERCURIUS and TRACE take
    steps of a twentieth of Jupiter's year, WisdomHolman(encounters="follow") steps of 100 days.
    """
    long, short = crossers(2000 * 365.25), crossers(100 * 365.25)
    truth = taylor(short.gm, short.q, short.v, short.span)
    rows = []
    seconds: dict[str, list[float]] = {}
    names = ("no dt", "wisdom-holman", "ias15", "mercurius", "trace")
    errors: dict[str, Array] = {}
    finished: dict[str, int] = {}
    for turn in range(max(1, min(repetitions, 3))):
        for name in names:
            spent, end = _crossed(name, long)
            seconds.setdefault(name, []).append(spent)
            finished[name] = int(np.isfinite(end[3:]).all(axis=1).sum())
            if turn == 0 and truth is not None:
                end = _crossed(name, short)[1]
                errors[name] = np.linalg.norm((end - truth)[3:], axis=1) * short.unit
    for name in names:
        off = errors.get(name)
        ratios = [a / b for a, b in zip(seconds["ias15"], seconds[name], strict=True)]
        row: dict[str, Any] = {"method": name, "seconds": statistics.median(seconds[name])}
        row["times faster than IAS15"] = statistics.median(ratios)
        row["finished"], row["retired"] = finished[name], len(long.gm) - 3 - finished[name]
        row["median km"] = None if off is None else float(np.nanmedian(off))
        row["largest km"] = None if off is None else float(np.nanmax(off))
        rows.append(row)
    return {"rows": rows}


def part_drift(repetitions: int) -> dict[str, Any]:
    """The relative energy error of two bodies with e = 0.9 without dt, from the apocentre on: mean and root mean square
    over rotated starts. If it is a random walk of rounding errors, the mean stays near 0, and the root mean square
    grows with the square root of the number of orbits. A drift would show in the mean: over 24 starts it is 2.8e-14
    after 100,000 orbits, seven million steps, with a standard error of 1.0e-14; with a tolerance of 3e-10 it is
    0.8e-14, with a standard error of 0.9e-14. The seconds are those of the march alone.
    """
    problem = next(p for p in problems() if p.name.startswith("e = 0.9,"))
    errors: dict[int, list[float]] = {}
    seconds: dict[int, list[float]] = {}
    for rotation in rotations(max(3, repetitions)):
        start = rotated(problem.q, problem.v, rotation)
        run = marcher(GAUSS, problem.gm, start.q, start.v, orbits.Adaptive())
        run.compile()
        first, begun = _energy(problem.gm, start.q, start.v), time.perf_counter()
        for orbits_done in (1_000, 10_000, 100_000):
            run.advance_to(Place(0, 2 * np.pi * orbits_done))
            errors.setdefault(orbits_done, []).append(_energy(problem.gm, *run.state()) / first - 1.0)
            seconds.setdefault(orbits_done, []).append(time.perf_counter() - begun)
    return {
        "rows": [
            {
                "orbits": orbits_done,
                "mean": float(np.mean(errors[orbits_done])),
                "RMS": float(np.sqrt(np.mean(np.square(errors[orbits_done])))),
                "seconds": statistics.median(seconds[orbits_done]),
            }
            for orbits_done in errors
        ]
    }


def part_precision(repetitions: int) -> dict[str, Any]:
    """How much time buys how much accuracy, without dt: the median time of whole runs in ms, and the root mean square
    of the position error at the end, over six rotated starts, for several tolerances of each method. They are Gauss
    with 8 stages, REBOUND's IAS15, and heyoka's Taylor method, plain and with `high_accuracy=True`, which sums its
    series in compensated arithmetic (in its compact mode for more than three bodies).
    """
    rows = []
    for problem in _curves():
        starts = [rotated(problem.q, problem.v, rotation) for rotation in rotations(6)]
        truths = [truth_of(problem, start.q, start.v) for start in starts]
        if truths[0] is None:
            continue
        for k in range(8):
            row: dict[str, Any] = {"problem": problem.name}
            tolerance, epsilon, order = 10.0 ** (-3 - k), 10.0 ** (-6 - k), 10.0 ** (-2 - 2 * k)
            runs: dict[str, Callable[[Array, Array], Any]] = {
                f"tolerance {tolerance:g}": lambda q, v, problem=problem, x=tolerance: ours(
                    GAUSS, problem.gm, q, v, orbits.Adaptive(x), problem.span
                ),
                f"epsilon {epsilon:g}": lambda q, v, problem=problem, x=epsilon: ias15(
                    problem.gm, q, v, problem.span, x
                ),
            }
            for peer_name, exact in (("heyoka", False), ("heyoka-exact", True)) if k in (3, 5, 7) else ():
                compact, limit = len(problem.gm) > 3, max(order, 2.0**-52)
                series = heyoka(problem.gm, limit, high_accuracy=exact, compact=compact)
                if series is not None:
                    runs[f"{peer_name} {order:g}"] = lambda q, v, run=series, span=problem.span: run(q, v, span)
            for name, run in runs.items():
                spent, squares = [], []
                for start, truth in zip(starts, truths, strict=True):
                    taken = (run(start.q, start.v) for _ in range(max(1, min(repetitions, 3))))
                    seconds, end, *_ = min(taken, key=_first)
                    spent.append(seconds)
                    squares.append(_off(problem, end, truth) ** 2)
                kind, value = name.split()
                row |= {kind: value, f"{kind} ms": 1e3 * statistics.median(spent), f"{kind} error": _rms(squares)}
            rows.append(row)
    return {"rows": rows, "picture": draw}


def _curves() -> list[Problem]:
    gm, q, v, _ = ten_bodies_data()
    names = ("e = 0.9, 100 orbits from pericentre", "Burrau's problem to t = 63", "Apophis 2029, 365 d")
    ten = Problem("Sun and nine, 20 yr", gm, q, v, 20 * 365.25, 149597870.7)
    return [*(p for p in problems() if p.name in names), ten]


def _first(result: tuple[Any, ...]) -> float:
    return float(result[0])


def _rms(squares: list[float] | None) -> float | None:
    return None if squares is None else float(np.sqrt(np.mean(squares)))


def _off(problem: Problem, end: Array, truth: Array) -> float:
    """Return the largest position error, or that of the body that the problem is about, in its unit."""
    off = np.linalg.norm(end - truth, axis=1) * problem.unit
    return float(off.max() if problem.body is None else off[problem.body])


def _crossed(name: str, problem: Problem) -> tuple[float, Array]:
    start = problem.gm, problem.q, problem.v
    if name == "no dt":
        return ours(GAUSS, *start, orbits.Adaptive(), problem.span)
    if name == "wisdom-holman":
        return ours(orbits.WisdomHolman(encounters="follow"), *start, 100.0, problem.span)
    dt = 365.25 * 11.86 / 20
    return peer(name, problem.gm, problem.q, problem.v, problem.span, None, dt)[:2]


def _energy(gm: Array, q: Array, v: Array) -> float:
    apart = np.linalg.norm(q[1] - q[0])
    return float(0.5 * (gm * (v * v).sum(axis=1)).sum() - gm[0] * gm[1] / apart)
