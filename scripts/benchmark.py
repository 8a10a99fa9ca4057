"""Measure speed, accuracy, start-up and memory; write JSON and the Markdown tables of docs/benchmarks.md.

    make bench                                     all of it, about four minutes
    python scripts/benchmark.py ten_bodies         one part; --help lists them

Peers run in the same process, alternating with ours, one core unless said; compile time is measured apart. The figure
is the median over the repetitions, the accuracy the root mean square over rotated starts against a quadruple-precision
reference.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import orbits
from orbits.integrators.marcher import Marcher, available_threads
from orbits.kernels.compile import cpu_features, cpu_name
from orbits.lagrangians.newtonian import newtonian, parameters
from orbits.regression import peers
from orbits.resources import data_path

AU_KM = 149597870.7
ROOT = Path(__file__).resolve().parent.parent
YEAR = 365.25
BY_HAND = "## How close to the machine"
"""The heading in docs/benchmarks.md from which on the page is not written by this script."""


def ten_bodies_data() -> tuple[np.ndarray, np.ndarray, np.ndarray, dict[str, np.ndarray]]:
    """GM, q, v of Sun, planets and Pluto at J2000, and where quadruple precision puts them after some years."""
    data = json.loads(data_path("solar_system_10body.json").read_text())
    reference = {
        years: np.array([[float(x) for x in row] for row in rows])[:, :3]
        for years, rows in data["reference_years"].items()
    }
    return np.array(data["gm_au3_d2"]), np.array(data["q"]), np.array(data["v"]), reference


def rotations(count: int) -> list[np.ndarray]:
    """Random rotations, uniformly distributed, always the same."""
    rng = np.random.default_rng(20000101)
    out = [np.eye(3)]
    for _ in range(count - 1):
        matrix, upper = np.linalg.qr(rng.normal(size=(3, 3)))
        matrix = matrix * np.sign(np.diag(upper))
        out.append(matrix if np.linalg.det(matrix) > 0 else -matrix)
    return out


def marcher(method: Any, gm: np.ndarray, q: np.ndarray, v: np.ndarray, h: float, threads: int = 1) -> Marcher:
    """A system of floats bound to a method."""
    massive = gm > 0
    return Marcher(newtonian, method, parameters(gm[massive]), massive, q, v, h, threads=threads)


def ours(method: Any, gm: np.ndarray, q: np.ndarray, v: np.ndarray, h: float, span: float, threads: int = 1):
    """Return (seconds, positions at `span`) of one run, compiled before the clock starts."""
    run = marcher(method, gm, q, v, h, threads)
    run.compile()
    steps = int(span // h)
    begun = time.perf_counter()
    run.advance(steps)
    seconds = time.perf_counter() - begun
    end, _ = run.state_after(span - steps * h)
    run.close()
    return seconds, end


def rebound(name: str, gm: np.ndarray, q: np.ndarray, v: np.ndarray, dt: float, span: float):
    """Return (seconds, positions at `span`) of a REBOUND run."""
    run = peers.run(name, gm, q, v, times=np.array([span]), dt=dt)
    return run.wall_s, run.q[-1]


def heyoka(gm: np.ndarray) -> Callable[..., tuple[float, np.ndarray]] | None:
    """Return a runner of heyoka's Taylor integrator for these masses, compiled; None where heyoka is not installed."""
    try:
        import heyoka as hy
    except ImportError:
        return None
    model = hy.model.nbody(len(gm), masses=list(gm / gm[0]), Gconst=gm[0])
    integrator = hy.taylor_adaptive(model, state=np.zeros(6 * len(gm)), tol=2.0**-52)

    def run(gm: np.ndarray, q: np.ndarray, v: np.ndarray, dt: float, span: float) -> tuple[float, np.ndarray]:
        integrator.time = 0.0
        integrator.state[:] = np.hstack([q, v]).ravel()
        begun = time.perf_counter()
        integrator.propagate_until(span)
        return time.perf_counter() - begun, integrator.state.reshape(-1, 6)[:, :3].copy()

    return run


def part_ten_bodies(repetitions: int) -> dict[str, Any]:
    """Sun, planets and Pluto over 1,000 years: time, and RMS position error over rotated starts."""
    gm, q, v, reference = ten_bodies_data()
    span = 1000 * YEAR
    names = ("Mercury", "Venus", "Earth-Moon", "Mars", "Jupiter", "Saturn", "Uranus", "Neptune", "Pluto")
    methods: dict[str, Callable[..., tuple[float, np.ndarray]]] = {}
    for h in (6.0, 4.0, 3.0, 2.0):
        methods[f"Gauss(stages=8), dt {h:g} d"] = lambda gm, q, v, dt, span, h=h: ours(
            orbits.Gauss(stages=8), gm, q, v, h, span
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
    for rotation in rotations(max(8, repetitions)):
        for name, run in methods.items():
            spent, end = run(gm, q @ rotation.T, v @ rotation.T, 6.0, span)
            seconds[name].append(spent)
            squares[name].append(np.sum((end - reference["1000"] @ rotation.T) ** 2, axis=1))
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


def part_particles(repetitions: int) -> dict[str, Any]:
    """1,000 massless particles and ten bodies for five years: time, and error against a run with a quarter of the
    step.
    """
    gm, q, v = belt(1000)
    span = 5 * YEAR
    _, truth = ours(orbits.Gauss(stages=8), gm, q, v, 1.5, span)
    _, check = ours(orbits.Gauss(stages=8), gm, q, v, 1.0, span)
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
        "yardstick": "Gauss(stages=8), dt 1.5 d",
        "yardstick_error_km": float(AU_KM * np.linalg.norm(check - truth, axis=1)[10:].max()),
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
    for label, particles, steps in (("9 bodies", 0, 100_000), ("9 bodies and 1,000 massless particles", 1000, 1000)):
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


def cluster(count: int, seed: int = 1) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A ball of equal bodies, total GM = 1, in slow random motion."""
    rng = np.random.default_rng(seed)
    return np.full(count, 1.0 / count), rng.normal(size=(count, 3)), 0.4 * rng.normal(size=(count, 3))


def part_large(repetitions: int) -> dict[str, Any]:
    """Thousands of mutually attracting bodies: Störmer–Verlet on one thread and on all processors, beside
    REBOUND's leapfrog; nanoseconds for each pair i < j and step, closest approaches recorded on the way.
    """
    count = available_threads()
    rows = []
    for bodies, steps in ((1000, 128), (4000, 16)):
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


FIRST_STEP = """
import orbits
from astropy import units as u
s = orbits.System.solar_system()
orbits.propagate(s, orbits.Gauss(stages=8), dt=6 * u.day, duration=6 * u.day, samples=2, progress=False)
"""


def _whole_process(code: str, environment: dict[str, str] | None = None) -> float:
    begun = time.perf_counter()
    subprocess.run([sys.executable, "-c", code], check=True, env={**os.environ, **(environment or {})})
    return time.perf_counter() - begun


def part_start(repetitions: int) -> dict[str, Any]:
    """Whole processes: the import, the first step with a warm cache, and what compiling on a cold one adds."""
    _whole_process(FIRST_STEP)
    rows = {
        "python alone": statistics.median(_whole_process("pass") for _ in range(repetitions)),
        "import orbits": statistics.median(_whole_process("import orbits") for _ in range(repetitions)),
        "first step, warm cache": statistics.median(_whole_process(FIRST_STEP) for _ in range(repetitions)),
    }
    with tempfile.TemporaryDirectory() as folder:
        rows["first step, cold cache"] = _whole_process(FIRST_STEP, {"NUMBA_CACHE_DIR": folder})
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
big = orbits.System.from_states(
    [*s.names, *(f"p{k}" for k in range(n))], np.append(x.gm, np.zeros(n)), np.vstack([x.q, q]), np.vstack([x.v, v]),
    epoch=s.epoch, units=orbits.SOLAR)
run = orbits.propagate(big, orbits.Gauss(stages=8), dt=6 * u.day, duration=6 * 9999 * u.day, samples=10_000,
                       archive=sys.argv[1], progress=False)
drift = run.energy()
print(len(run))
"""


def part_memory(repetitions: int) -> dict[str, Any]:
    """10,000 particles, 10,000 samples into an archive, energies read back: peak memory of the whole process."""
    with tempfile.TemporaryDirectory(dir=ROOT) as folder:
        path = str(Path(folder) / "run.h5")
        begun = time.perf_counter()
        subprocess.run([sys.executable, "-c", MEMORY_RUN, path], check=True, stdout=subprocess.DEVNULL)
        seconds = time.perf_counter() - begun
        size = os.path.getsize(path)
    peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss * 1024
    return {"rows": [{"peak_memory_MB": peak / 1e6, "archive_GB": size / 1e9, "seconds": seconds}]}


def part_lagrangians(repetitions: int) -> dict[str, Any]:
    """Kepler's problem with Gauss(stages=8), 0.2 a step: a Lagrangian from SymPy beside the hand-written N-body path
    for two bodies; nanoseconds a step, and force evaluations of all stages.
    """
    from orbits.integrators.flow import Flow
    from orbits.lagrangians.newtonian import n_body

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


def part_kepler(repetitions: int) -> dict[str, Any]:
    """The Kepler flow of 1,024 massless particles about one star, e up to 0.2: numbers and lanes beside WHFast, which
    adds its change of coordinates; nanoseconds a particle and step.
    """
    from orbits.kernels.compile import kernel
    from orbits.kernels.kepler import kepler_flow, kepler_increments

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


SYMBOLIC = """
import sys, time
import numpy as np, orbits
from orbits.integrators.flow import Flow
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
    """Each Lagrangian from nothing, in a process with an empty cache: derivatives and source by SymPy, kernels
    compiled, the step of Gauss compiled for it; then all three again in a second process.
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


PARTS = {
    "ten_bodies": part_ten_bodies,
    "particles": part_particles,
    "explicit": part_explicit,
    "threads": part_threads,
    "large": part_large,
    "start": part_start,
    "memory": part_memory,
    "kepler": part_kepler,
    "lagrangians": part_lagrangians,
    "symbolic": part_symbolic,
    "pendulum": part_pendulum,
}


def machine() -> dict[str, Any]:
    """What was measured on."""
    import numba

    versions = {"python": platform.python_version(), "numba": numba.__version__, "numpy": np.__version__}
    for name in ("rebound", "heyoka"):
        try:
            versions[name] = str(__import__(name).__version__)
        except ImportError:
            versions[name] = "not installed"
    lanes = "AVX-512" if "avx512f" in cpu_features() else "no AVX-512"
    return {
        "processor": f"{cpu_name()}, {lanes}, {available_threads()} cores",
        "orbits": orbits.__version__,
        **versions,
    }


def _cell(value: Any) -> str:
    if isinstance(value, bool) or value is None:
        return {True: "yes", False: "no", None: "-"}[value]
    if isinstance(value, float):
        return f"{value:.3g}"
    return str(value)


def markdown(results: dict[str, Any]) -> str:
    """Return the results as a page of tables."""
    facts = ", ".join(f"{k} {v}" for k, v in results["machine"].items() if k != "processor")
    lines = ["# Benchmarks", "", f"Made by `make bench` on {results['machine']['processor']}; {facts}.", ""]
    for name, part in results["parts"].items():
        lines += [f"## {name.replace('_', ' ').capitalize()}", "", " ".join(str(PARTS[name].__doc__).split()), ""]
        rows = [
            {
                **{k: x for k, x in row.items() if k != "rms_km"},
                **{f"{k} km": x for k, x in row.get("rms_km", {}).items()},
            }
            for row in part["rows"]
        ]
        head = list(rows[0])
        lines += ["| " + " | ".join(h.replace("_", " ") for h in head) + " |", "|" + " --- |" * len(head)]
        lines += ["| " + " | ".join(_cell(row.get(h)) for h in head) + " |" for row in rows]
        notes = {k: x for k, x in part.items() if k != "rows"}
        if notes:
            lines += ["", "; ".join(f"{k.replace('_', ' ')}: {_cell(x)}" for k, x in notes.items()) + "."]
        lines.append("")
    return "\n".join(lines)


def main() -> None:
    """Run the parts asked for and write what they gave."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parts", nargs="*", choices=[[], *PARTS], help="which parts; all of them when none is named")
    parser.add_argument("--repetitions", type=int, default=7, help="at least 5 for figures to be quoted")
    parser.add_argument("--docs", action="store_true", help="write the tables to docs/benchmarks.md as well")
    parser.add_argument("--out", type=Path, default=ROOT / "results" / "benchmark", help="folder for JSON and Markdown")
    options = parser.parse_args()
    results: dict[str, Any] = {"machine": machine(), "parts": {}}
    for name in options.parts or PARTS:
        print(f"{name} ...", file=sys.stderr, flush=True)
        results["parts"][name] = PARTS[name](options.repetitions)
    options.out.mkdir(parents=True, exist_ok=True)
    (options.out / "benchmark.json").write_text(json.dumps(results, indent=1) + "\n")
    page = markdown(results)
    (options.out / "benchmark.md").write_text(page)
    if options.docs:
        target = ROOT / "docs" / "benchmarks.md"
        _, heading, by_hand = target.read_text().partition(BY_HAND)
        target.write_text(page + heading + by_hand)
    print(page)


if __name__ == "__main__":
    main()
