"""Work against precision of compositions, beside Störmer–Verlet and Gauss: the tables of docs/compositions.md.

    python scripts/work_precision.py           both problems, about a minute

For each method the step is shortened down to round-off; force evaluations and time for a given error are interpolated
between the runs, in logarithms. The error is the largest error of a coordinate at the end, relative to the size of the
orbit.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

import orbits
from orbits.errors import IntegrationError
from orbits.integrators.base import Integrator
from orbits.lagrangians.newtonian import newtonian, parameters
from orbits.marching.legs.leg import Leg
from orbits.resources import data_path

TARGETS = (1e-3, 1e-5, 1e-7, 1e-9, 1e-11, 1e-13)
VERLET = orbits.StormerVerlet()


@dataclass(frozen=True)
class Problem:
    """Bodies and how long they move; `orbits` is that time in periods of the fastest, `end` where they should be."""

    name: str
    gm: np.ndarray
    q: np.ndarray
    v: np.ndarray
    duration: float
    orbits: int
    end: np.ndarray

    def run(self, method: Integrator, steps: int) -> tuple[float, int, float]:
        """Return the error, the evaluations of the forces, and the seconds; the best of five runs."""
        seconds = math.inf
        for _ in range(5):
            massive = np.ones(len(self.gm), dtype=bool)
            run = Leg.of(newtonian, method, parameters(self.gm), massive, self.q, self.v, self.duration / steps)
            begun = time.perf_counter()
            run.advance(steps)
            seconds = min(seconds, time.perf_counter() - begun)
        error = np.max(np.abs(run.state()[0] - self.end) / np.max(np.abs(self.end), axis=1, keepdims=True))
        stages = 8 * math.ceil(method.stages / 8) if isinstance(method, orbits.Gauss) else 1
        return float(error), run.stepper.counts()[0] * stages, seconds


def kepler() -> Problem:
    """Two equal bodies on an orbit with e = 0.6, twenty times around: they come back to where they started."""
    e, turns = 0.6, 20
    gm = np.array([0.5, 0.5])
    q = np.array([[-0.5 * (1 - e), 0.0, 0.0], [0.5 * (1 - e), 0.0, 0.0]])
    w = math.sqrt((1 + e) / (1 - e))
    v = np.array([[0.0, -0.5 * w, 0.0], [0.0, 0.5 * w, 0.0]])
    return Problem("Kepler's problem, e = 0.6", gm, q, v, 2 * math.pi * turns, turns, q)


def outer_solar_system() -> Problem:
    """The outer Solar System of Hairer, Lubich & Wanner, 20 periods of Jupiter, against short steps of Gauss."""
    data = json.loads(data_path("hlw_outer_solar_system.json").read_text())
    masses = [1 / 1.3e8 if m == "1/1.3e8" else float(m) for m in data["m"]]
    gm = data["G"] * np.array(masses)
    q, v = np.array(data["q"], dtype=float), np.array(data["v"], dtype=float)
    for x in (q, v):
        x -= gm @ x / gm.sum()
    turns, period = 20, 4332.6
    problem = Problem("Outer Solar System", gm, q, v, turns * period, turns, q)
    truth = Leg.of(newtonian, orbits.Gauss(stages=8), parameters(gm), np.ones(6, dtype=bool), q, v, period / 100)
    truth.advance(100 * turns)
    return Problem(problem.name, gm, q, v, problem.duration, turns, truth.state()[0])


def methods() -> Iterator[Integrator]:
    """Störmer–Verlet, every scheme for it that takes fewer than 100 steps, and Gauss."""
    yield VERLET
    for order in (4, 6, 8, 10):
        for name in orbits.Composition.schemes(VERLET, order):
            method = orbits.Composition(VERLET, order=order, scheme=name)
            if method.substeps < 100:
                yield method
    for stages in (2, 4, 6, 8, 16):
        yield orbits.Gauss(stages=stages)


def study(problem: Problem, method: Integrator) -> list[tuple[float, float, float]]:
    """Return (error, evaluations and microseconds per orbit) for shorter and shorter steps, down to round-off."""
    cost = method.substeps if isinstance(method, orbits.Composition) else 1
    found: list[tuple[float, float, float]] = []
    for k in range(60):
        per_orbit = round(max(3, 24 / cost) * 2 ** (k / 3))
        if per_orbit * cost > 60_000:
            break
        try:
            error, evaluations, seconds = problem.run(method, per_orbit * problem.orbits)
        except IntegrationError:
            continue  # a step that is far too long is refused
        found.append((error, evaluations / problem.orbits, 1e6 * seconds / problem.orbits))
        if error < 2e-15 or (len(found) > 4 and error < 1e-11 and error > 0.5 * found[-3][0]):
            break
    return found


def needed(found: list[tuple[float, float, float]], target: float, column: int) -> float:
    """Return the work from which on the error stays below `target`; NaN where it does not get there."""
    above = [k for k, row in enumerate(found) if row[0] > target]
    last = above[-1] if above else -1
    if last == len(found) - 1:
        return math.nan
    if last < 0:
        return found[0][column]
    (e0, *_), (e1, *_) = found[last], found[last + 1]
    share = math.log(e0 / target) / math.log(e0 / e1)
    return math.exp((1 - share) * math.log(found[last][column]) + share * math.log(found[last + 1][column]))


def main() -> None:
    """Print, for each problem, the evaluations that every method needs and the time that the chosen ones take."""
    for problem in (kepler(), outer_solar_system()):
        found = {method: study(problem, method) for method in methods()}
        table(f"{problem.name}: evaluations of the forces per orbit", found, 1, "{:.0f}")
        chosen = {m: rows for m, rows in found.items() if not isinstance(m, orbits.Composition) or is_default(m)}
        table(f"{problem.name}: microseconds per orbit", chosen, 2, "{:.3g}")


def is_default(method: orbits.Composition) -> bool:
    """Whether this is the scheme that is taken where none is asked for."""
    return method == orbits.Composition(method.base, order=method.order)


def table(title: str, found: dict[Integrator, list[tuple[float, float, float]]], column: int, form: str) -> None:
    """Print one table."""
    print(f"\n### {title}\n")
    print("| order | method | drifts a step | " + " | ".join(f"{t:.0e}" for t in TARGETS) + " |")
    print("| --- " * (3 + len(TARGETS)) + "|")
    for method, rows in found.items():
        composed = isinstance(method, orbits.Composition)
        work = [needed(rows, target, column) for target in TARGETS]
        cells = ["" if math.isnan(w) else form.format(w) for w in work]
        name, drifts = (method.scheme, method.substeps) if composed else (method.label, "")
        print(f"| {method.order} | {name} | {drifts} | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
