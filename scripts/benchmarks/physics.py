"""What physics beyond Newton costs: forces in lanes, marches with relativity, the models of the Solar System."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

import orbits
from benchmarks.planets import CHUNK as MAP_CHUNK
from benchmarks.planets import OURS as MAPS
from benchmarks.planets import H
from benchmarks.problems import ten_bodies_data
from orbits.kernels.binding import accelerate, first_term
from orbits.kernels.compile import kernel
from orbits.kernels.gravity.terms_and_forces import add_terms
from orbits.kernels.lanes import WIDTH, full, load, store
from orbits.marching.legs.leg import Leg
from orbits.marching.stepping.alignment import aligned
from orbits.system.model import model
from orbits.system.solar.building import APART

CHUNKS = 60
"""How many times forces and steps are timed for each repetition: the least is taken, of many short times."""

FORCES, STEPS = 500, 100
"""Evaluations, and steps of Gauss, that are timed at once: about a millisecond."""

YEARS = 30

GAUSS = orbits.Gauss(stages=8)


@kernel
def _newton(tag, parameters, Q, out, count):
    for _ in range(count):
        accelerate(tag, parameters, Q, out)


@kernel
def _with_terms(tag, parameters, hours, Q, V, out, F, S, count):
    for _ in range(count):
        accelerate(first_term(tag), parameters[0], Q, out)
        for k in range(Q.shape[0]):
            store(F, k, full(0.0))
            store(S, k, full(0.0))
        add_terms(tag, parameters, load(hours, 0), Q, V, F, S)


def part_physics(repetitions: int) -> dict[str, Any]:
    """What relativity costs: `PostNewtonian()` of all bodies beside Newton alone, the least of many short pieces in
    turn. First the forces at eight stages in lanes, and whole steps of 3 days by `Gauss(stages=8)`, per sweep over the
    stages: of ten bodies, Sun and planets with their moons and Pluto, and of twelve, Sun, planets, Moon, Pluto and
    Ceres. Then the processor time of whole runs of `System.solar_system(model=...)` over thirty years without the check
    of the step, beside the same eleven bodies as Newtonian point masses. Last, a step of 3 days of Sun and eight
    planets by Wisdom–Holman maps, with `PostNewtonian(sources=["Sun"])`.
    """
    rows = []
    for system in (_ten(), _twelve()):
        rows += _forces(system, repetitions)
    return {"rows": [*rows, *_thirty_years(repetitions), *_maps(repetitions)]}


def _ten(count: int = 10) -> orbits.System:
    gm, q, v, _ = ten_bodies_data()
    names = ["Sun", *(f"planet {k}" for k in range(1, count))]
    return orbits.System(names=names, gm=gm[:count], q=q[:count], v=v[:count], units=orbits.units.SOLAR)


def _twelve() -> orbits.System:
    every = orbits.System.solar_system(epoch="2000-01-01", model="full")
    some = [every.index(name) for name in (*APART, "Ceres")]
    gm, q, v = (np.asarray(x)[some] for x in every.values[:3])
    return orbits.System(names=[*APART, "Ceres"], gm=gm, q=q, v=v, units=every.units)


def _marcher(system: orbits.System, method: Any) -> Leg:
    acting, values = model(system), system.values
    made = Leg.of(acting.lagrangian, method, acting.vectors, system.massive, values.q, values.v, H)
    made.compile()
    return made


def _row(what: str, newton: float | None, more: float) -> dict[str, Any]:
    ratio = None if newton is None else more / newton
    return {"what": what, "Newton alone": newton, "with relativity": more, "ratio": ratio}


def _forces(system: orbits.System, repetitions: int) -> list[dict[str, Any]]:
    """Return rows of the forces, and of the march."""
    relativistic = system.with_terms(orbits.terms.PostNewtonian())
    bodies, (_, q, v, _) = len(system.names), system.values
    newton, more = model(system), model(relativistic)
    Q, V, hours, *out = aligned(*[(3 * bodies, WIDTH)] * 6)
    # Stages at eight times along the velocities, so that lanes differ.
    Q[...] = q.T.ravel()[:, None] + v.T.ravel()[:, None] * np.linspace(0.0, H, WIDTH)
    V[...] = v.T.ravel()[:, None]
    marches = {"Newton": _marcher(system, GAUSS), "relativity": _marcher(relativistic, GAUSS)}
    evaluate: dict[str, Callable[[int], None]] = {
        "Newton": lambda count: _newton(newton.lagrangian.tag, newton.vectors, Q, out[0], count),
        "relativity": lambda count: _with_terms(more.lagrangian.tag, more.vectors, hours, Q, V, *out, count),
    }
    least = {(name, what): np.inf for name in marches for what in ("force", "march")}
    sweeps: dict[str, list[int]] = {name: [] for name in marches}
    for name, run in marches.items():
        evaluate[name](1)
        run.advance(STEPS)
    for _ in range(CHUNKS * repetitions):
        for name, run in marches.items():
            least[name, "force"] = min(least[name, "force"], _timed(evaluate[name], FORCES) / FORCES)
            before = run.stepper.counts()[0]
            seconds = _timed(run.advance, STEPS)
            sweeps[name].append(run.stepper.counts()[0] - before)
            least[name, "march"] = min(least[name, "march"], seconds / sweeps[name][-1])
    for run in marches.values():
        run.close()

    def microseconds(what: str) -> list[float]:
        return [1e6 * least[name, what] for name in marches]

    return [
        _row(f"forces of {bodies} bodies at eight stages in lanes, µs", *microseconds("force")),
        _row(f"march of {bodies} bodies, µs a sweep", *microseconds("march")),
        _row(f"march of {bodies} bodies, sweeps a step", *(float(np.mean(sweeps[name])) / STEPS for name in marches)),
    ]


def _thirty_years(repetitions: int) -> list[dict[str, Any]]:
    """Return rows of the models; the full one, which takes seconds, is run a third as often."""
    start = {"epoch": "2000-01-01"}
    systems = {
        "newtonian": orbits.System.solar_system(**start, bodies=APART),
        "relativistic": orbits.System.solar_system(**start, model="relativistic"),
        "full": orbits.System.solar_system(**start, model="full"),
    }
    least = dict.fromkeys(systems, np.inf)
    for system in systems.values():
        _run(system, "0.1 yr")
    for k in range(repetitions):
        for name, system in systems.items():
            if name != "full" or k % 3 == 0:
                least[name] = min(least[name], _run(system, f"{YEARS} yr"))
    newton, relativistic, whole = least.values()
    return [
        _row(f"model relativistic, {YEARS} years, s", newton, relativistic),
        _row(f"model full, {YEARS} years, s", None, whole),
    ]


def _run(system: orbits.System, duration: str) -> float:
    """Return the processor time of a run."""
    begun = time.process_time()
    orbits.propagate(system, GAUSS, dt=f"{H} d", duration=duration, samples=2, progress=False, check_step=False)
    return time.process_time() - begun


def _maps(repetitions: int) -> list[dict[str, Any]]:
    """Return rows of Wisdom–Holman maps."""
    plain = _ten(9)
    by_sun = plain.with_terms(orbits.terms.PostNewtonian(sources=["Sun"]))
    rows = []
    for name in ("WisdomHolman, standard, no corrector", "WisdomHolman, lazy kick, corrector 17"):
        runs = [_marcher(system, MAPS[name]) for system in (plain, by_sun)]
        least = [np.inf, np.inf]
        for _ in range(CHUNKS * repetitions):
            for k, run in enumerate(runs):
                least[k] = min(least[k], 1e9 * _timed(run.advance, MAP_CHUNK) / MAP_CHUNK)
        for run in runs:
            run.close()
        rows.append(_row(f"{name}, Sun and eight planets, ns a step", *least))
    return rows


def _timed(function: Callable[[int], None], count: int) -> float:
    begun = time.perf_counter()
    function(count)
    return time.perf_counter() - begun
