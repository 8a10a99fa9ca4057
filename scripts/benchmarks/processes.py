"""Whole processes and calls: start, memory, compilation, scenarios, overhead."""

from __future__ import annotations

import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

import orbits
from benchmarks.encounters import apophis
from benchmarks.problems import belt, kernel, ours, ten_bodies_data
from orbits.kernels.compile import cpu_name
from orbits.point_masses import PointMasses
from orbits.regression import peers

FIRST_STEP = """
import orbits
from astropy import units as u
s = orbits.System.solar_system()
orbits.propagate(s, orbits.Gauss(stages=8), dt=6 * u.day, duration=6 * u.day, samples=2, progress=False)
"""


FIRST_STEP_WITH_PARTICLES = """
import orbits
from astropy import units as u
s = orbits.System.solar_system().add_particles(orbits.asteroids(37), propagate_to_epoch=True)
orbits.propagate(s, orbits.StormerVerlet(), dt=1 * u.day, duration=1 * u.day, samples=2, progress=False)
"""

FOUNDATIONS = "import numba, astropy.units, astropy.time"


def _whole_process(code: str, environment: dict[str, str] | None = None) -> float:
    # An installed package has its bytecode on disk; where Python is told not to keep it, all is parsed in each process.
    inherited = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    begun = time.perf_counter()
    subprocess.run([sys.executable, "-c", code], check=True, env={**inherited, **(environment or {})})
    return time.perf_counter() - begun


def part_start(repetitions: int) -> dict[str, Any]:
    """Seconds of whole processes, the least of several in turn: imports, and the first step of a run, with kernels from
    the cache (warm) and compiled for it (cold).
    """
    warm = {
        "python alone": "pass",
        "import orbits": "import orbits",
        FOUNDATIONS: FOUNDATIONS,
        "first step, warm cache": FIRST_STEP,
        "first step of Verlet with particles, warm cache": FIRST_STEP_WITH_PARTICLES,
    }
    for code in warm.values():
        _whole_process(code)
    spent: dict[str, list[float]] = {what: [] for what in warm}
    for _ in range(repetitions):
        for what, code in warm.items():
            spent[what].append(_whole_process(code))
    rows = {what: min(seconds) for what, seconds in spent.items()}
    for what in list(warm)[3:]:
        with tempfile.TemporaryDirectory() as folder:
            rows[what.replace("warm", "cold")] = _whole_process(warm[what], {"NUMBA_CACHE_DIR": folder})
    return {"rows": [{"what": what, "seconds": seconds} for what, seconds in rows.items()]}


MEMORY_RUN = """
import sys, numpy as np, orbits
from astropy import units as u
s = orbits.System.solar_system()
n = 10_000
rng = np.random.default_rng(1)
a, f = rng.uniform(2.1, 3.3, n), rng.uniform(0, 2 * np.pi, n)
speed = np.sqrt(orbits.SOLAR.G / a)
q = np.column_stack([a * np.cos(f), a * np.sin(f), 0 * a])
v = np.column_stack([-speed * np.sin(f), speed * np.cos(f), 0 * a])
x = s.values
big = orbits.System(
    [*s.names, *(f"p{k}" for k in range(n))], np.append(x.gm, np.zeros(n)), np.vstack([x.q, q]), np.vstack([x.v, v]),
    epoch=s.epoch, units=orbits.SOLAR)
run = orbits.propagate(big, orbits.Gauss(stages=8), dt=6 * u.day, duration=6 * 9999 * u.day, samples=10_000,
                       archive=sys.argv[1], progress=False)
drift = run.energy()
print(len(run))
"""


def part_memory(repetitions: int) -> dict[str, Any]:
    """10,000 particles, 10,000 samples into an archive, energies read back: peak memory of the whole process."""
    with tempfile.TemporaryDirectory(dir=Path(__file__).parent) as folder:
        path = str(Path(folder) / "run.h5")
        begun = time.perf_counter()
        subprocess.run([sys.executable, "-c", MEMORY_RUN, path], check=True, stdout=subprocess.DEVNULL)
        seconds = time.perf_counter() - begun
        size = os.path.getsize(path)
    peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss * 1024
    return {"rows": [{"peak_memory_MB": peak / 1e6, "archive_GB": size / 1e9, "seconds": seconds}]}


def part_lagrangians(repetitions: int) -> dict[str, Any]:
    """Kepler's problem by Gauss(stages=8) in steps of 0.2: a Lagrangian written in SymPy beside the hand-written code
    for gravitating bodies; nanoseconds a step, and evaluations of the forces at all stages in a step.
    """
    from orbits.lagrangians.newtonian import n_body
    from orbits.marching.flow import Flow

    kepler, two = orbits.lagrangians.kepler, n_body([0.999, 0.001])
    x, v = np.array([1.3, 0.0]), np.array([0.0, 0.8])
    space, speed = np.array([1.3, 0.0, 0.0]), np.array([0.0, 0.8, 0.0])
    bodies = np.concatenate([-0.001 * space, 0.999 * space])
    momenta = two.momentum(bodies, np.concatenate([-0.001 * speed, 0.999 * speed]))
    method, steps = orbits.Gauss(stages=8), 20_000
    runs = {
        "two bodies, by hand": (Flow(two, method, 0.2), bodies, momenta),
        "Kepler, from SymPy": (Flow(kepler, method, 0.2), x, v),
        "Kepler, from SymPy, canonical form": (Flow(kepler, method, 0.2, canonical=True), x, v),
    }
    spent: dict[str, list[float]] = {what: [] for what in runs}
    evaluations = {}
    for flow, q, p in runs.values():
        flow.march(q, p, 100, every=100)
    for _ in range(repetitions):
        for what, (flow, q, p) in runs.items():
            begun = time.perf_counter()
            path = flow.march(q, p, steps, every=steps)
            spent[what].append((time.perf_counter() - begun) / steps * 1e9)
            evaluations[what] = path.evaluations / steps
    hand = statistics.median(spent["two bodies, by hand"])
    return {
        "rows": [
            {
                "problem": what,
                "ns per step": statistics.median(times),
                "evaluations": evaluations[what],
                "times the hand-written one": statistics.median(times) / hand,
            }
            for what, times in spent.items()
        ]
    }


SYMBOLIC = """
import sys, time
import numpy as np, orbits
from orbits.marching.flow import Flow
import sympy
L = orbits.lagrangians.registry()[sys.argv[1]]
begun = time.perf_counter()
L.traits
made = time.perf_counter()
e = L.example
L.value(e.q, e.v), L.gradients(e.q, e.v), L.hessians(e.q, e.v)
compiled = time.perf_counter()
orbits.march(L, orbits.Gauss(stages=8), dt=e.dt, steps=1)
print(made - begun, compiled - made, time.perf_counter() - compiled)
"""


def part_symbolic(repetitions: int) -> dict[str, Any]:
    """From a formula to the first step, in a process with an empty cache: seconds for the derivatives by SymPy, for
    compiling them, and for compiling a step of Gauss with them; then all three again in a second process, which finds
    them in the cache.
    """
    rows = []
    for name in sorted(orbits.lagrangians.registry()):
        with tempfile.TemporaryDirectory() as folder:
            command = [sys.executable, "-c", SYMBOLIC, name]
            environment = {**os.environ, "NUMBA_CACHE_DIR": folder}
            cold, warm = (
                [
                    float(x)
                    for x in subprocess.run(command, check=True, env=environment, capture_output=True).stdout.split()
                ]
                for _ in range(2)
            )
        rows.append(
            {
                "lagrangian": name,
                "SymPy s": cold[0],
                "kernels s": cold[1],
                "step s": cold[2],
                "again, all s": sum(warm),
            }
        )
    return {"rows": rows}


def part_pendulum(repetitions: int) -> dict[str, Any]:
    """The pendulum scenario as a whole process, drawing included: 200 orbits of 2,000 steps in each panel, and more."""
    with tempfile.TemporaryDirectory() as folder:
        program = "from orbits.cli import main; main()"
        command = [sys.executable, "-c", program, "run", "pendulum", "--out", folder]
        seconds = []
        for _ in range(3):
            begun = time.perf_counter()
            subprocess.run(command, check=True, capture_output=True)
            seconds.append(time.perf_counter() - begun)
    return {"rows": [{"what": "orbits run pendulum", "seconds": statistics.median(seconds)}]}


def part_calls(repetitions: int) -> dict[str, Any]:
    """Short runs, as in a fit of orbits: the ten bodies by Gauss in steps of 6 d and without dt, Apophis among them
    without dt, and Sun and eight planets by a map in steps of 3 d. A run is a call of `propagate` with two samples and
    all checks; the kernel is the march in it, and the overhead is the rest.
    """
    gm, q, v, _ = ten_bodies_data()
    planets, stone, adaptive = slice(9), apophis(365.25), orbits.Adaptive()
    gauss, the_map = orbits.Gauss(stages=8), orbits.WisdomHolman()
    runs = {
        "ten bodies, 100 steps of 6 d": (gauss, gm, q, v, 6.0, 600.0),
        "ten bodies, a year without dt": (gauss, gm, q, v, adaptive, 365.25),
        "Apophis, a year without dt": (gauss, stone.gm, stone.q, stone.v, adaptive, stone.span),
        "Sun and eight, 200 steps of a map": (the_map, gm[planets], q[planets], v[planets], 3.0, 600.0),
    }
    rows = []
    for name, arguments in runs.items():
        spent = [(ours(*arguments)[0], kernel(*arguments)[0]) for _ in range(100 * repetitions)]
        whole, march = (1e6 * statistics.median(seconds) for seconds in zip(*spent, strict=True))
        rows.append({"run": name, "run us": whole, "kernel us": march, "overhead us": whole - march})
    return {"rows": rows}


def part_samples(repetitions: int) -> dict[str, Any]:
    """Massless bodies at ever more samples, by calls of `propagate` with all checks, in turn with REBOUND led to the
    same times, medians: Apophis among ten bodies for a year without dt, beside IAS15; asteroids among the Sun and eight
    planets in 4,000 steps of 3 d of a map with its corrector, beside WHFast with the same. Those samples lie within
    steps, where both take a part of a step, and the corrector there and back. They end no block of steps.
    """
    stone, (gm, q, v), step = apophis(365.25), belt(100), 3.0
    alone = PointMasses(stone.gm, stone.q, stone.v)
    runs = [("Apophis", "ias15", alone, orbits.Gauss(), orbits.Adaptive(), stone.span)]
    for name, last in (("an asteroid, map", 11), ("100 asteroids, map", 110)):
        those = [*range(9), *range(10, last)]
        bodies = PointMasses(gm[those], q[those], v[those])
        runs.append((name, "whfast:kernel=modifiedkick,corrector=17", bodies, orbits.WisdomHolman(), step, 4000 * step))
    rows = []
    for name, peer, bodies, method, dt, span in runs:
        for samples in (2, 101, 1001):
            times = np.linspace(0.0, span, samples)[1:]
            spent: list[tuple[float, float]] = []
            for _ in range(10 * repetitions):
                mine, _ = ours(method, *bodies[:3], dt, span, samples=samples)
                spent.append((mine, peers.run(peer, bodies, times=times, dt=step).wall_s))
            mine, theirs = (1e3 * statistics.median(seconds) for seconds in zip(*spent, strict=True))
            row = {"run": name, "samples": samples, "ours ms": mine, "REBOUND ms": theirs}
            rows.append({**row, "times faster": theirs / mine})
    return {"rows": rows, "processor": cpu_name()}
