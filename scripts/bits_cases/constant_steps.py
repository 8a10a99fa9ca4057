"""Every method with constant steps: massive bodies, few and many, particles, Lagrangians, archives, encounters."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
from astropy import units as u

import orbits
from bits_cases.facts import Case, approaches, states
from bits_cases.systems import asteroids, jupiter_crossers, many_bodies, mixed, planets, pythagorean, star_alone
from bits_cases.ways import QUIET
from orbits.events import CloserThan, EnergyErrorAbove, FartherThan
from orbits.methods import VPRK, Composition, ImplicitMidpoint, LobattoIIIAB, LobattoIIIBA, RungeKutta4

ORDERS = (4, 6, 8, 10)


def methods() -> list[Any]:
    """Return the examples of every registered method, in the order of their names."""
    return [method for _, cls in sorted(orbits.integrators.registry().items()) for method in cls.examples()]


def wide() -> list[Any]:
    """Return methods whose stages fill more than eight lanes."""
    return [orbits.Gauss(stages=stages) for stages in (12, 16, 24)]


def chains() -> list[Any]:
    """Return Störmer–Verlet with every scheme of every order."""
    base = orbits.StormerVerlet()
    return [Composition(base, n, name) for n in ORDERS for name in Composition.schemes(base, n)]


def default_chains() -> list[Any]:
    """Return Störmer–Verlet with the default scheme of every order."""
    return [Composition(order=order) for order in ORDERS]


def composed() -> list[Any]:
    """Return compositions of methods other than Störmer–Verlet."""
    of_midpoint = [Composition(ImplicitMidpoint(), order) for order in ORDERS]
    symmetric = [method for method in VPRK.examples() if "symmetric" in method.declares]
    of_pairs = [Composition(method, order, "suzuki") for method in symmetric for order in (4, 6)]
    fourth = [orbits.Gauss(stages=2), LobattoIIIAB(stages=3), LobattoIIIBA(stages=3)]
    of_fourth = [Composition(base, 6, name) for base in fourth for name in ("suzuki", "triple-jump")]
    return [*of_midpoint, *of_pairs, *of_fourth]


def every_kind() -> list[Any]:
    """Return all of these, of the compositions of Störmer–Verlet those with default schemes, each once."""
    return distinct(methods(), wide(), default_chains(), composed())


def distinct(*groups: list[Any]) -> list[Any]:
    """Return methods of several lists, each once."""
    return list({method.label: method for group in groups for method in group}.values())


def explicit() -> list[Any]:
    """Return the methods that march thousands of bodies here."""
    names = ("explicit-euler", "runge-kutta-4", "stormer-verlet", "symplectic-euler")
    return [m for m in methods() if m.name in names] + [m for m in methods() if m.name == "composition"]


# --------------------------------------------------------------------------------------------------------- quantities


def propagated(
    system: Any, method: Any, *, also: tuple[Callable[..., dict[str, Any]], ...] = (), **options: Any
) -> Any:
    """Return the quantities of one run."""
    options = {"threads": 1, "approaches": approaches in also, **QUIET, **options}
    run = orbits.propagate(system, method, **options)
    found = states(run)
    for more in also:
        found |= more(run)
    return found


def between(run: Any) -> dict[str, Any]:
    """Return states between the samples, some of them before others, as `run.at` gives them."""
    low, high = sorted(run.t.value[[0, -1]])
    later = run.at(low + (high - low) * np.array([0.123, 0.871, 0.872, 0.5]))
    return {"q at": later.q.value, "v at": later.v.value}


def interrupted(system: Any, method: Any, **options: Any) -> dict[str, Any]:
    """Return samples of a run into an archive that is ended, resumed and extended; and whether that shows in no bit."""
    options = {"threads": 1, **QUIET, **options}
    whole = orbits.propagate(system, method, **options)
    longer = whole.t.value[-1] * 1.5
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.h5"
        early = count(1)
        orbits.propagate(system, method, archive=path, callback=lambda t, now: next(early) == 4, **options).close()
        resumed = orbits.resume(path, threads=2, progress=False)
        found = states(resumed)
        same = [np.array_equal(getattr(whole, x).value, getattr(resumed, x).value) for x in ("t", "q", "v")]
        resumed.close()
        found["as without interruption"] = str(all(same))
        extended = orbits.resume(path, until=longer, threads=1, progress=False)
        found |= {f"extended {name}": value for name, value in states(extended).items()}
        extended.close()
    return found


def stopped_and_resumed(system: Any, method: Any, **options: Any) -> dict[str, Any]:
    """Return the samples of a run that a condition ended and that went on from its archive."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.h5"
        first = orbits.propagate(system, method, archive=path, threads=1, **QUIET, **options)
        found = states(first)
        first.close()
        resumed = orbits.resume(path, threads=1, progress=False)
        found |= {f"resumed {name}": value for name, value in states(resumed).items()}
        resumed.close()
    return found


def marched(lagrangian: Any, method: Any, canonical: bool) -> dict[str, Any]:
    """Return marches of a Lagrangian's example: each state recorded, each seventh, and backwards."""
    motion = lagrangian.example
    p = lagrangian.momentum(motion.q, motion.v, 0.25)
    found: dict[str, Any] = {}
    for label, every, dt in (("", 1, motion.dt), (" every 7", 7, motion.dt), (" backwards", 1, -motion.dt)):
        if canonical:
            flow = orbits.Flow(lagrangian, method, dt, t=0.25, canonical=True)
            path = flow.march(motion.q, p, 42, every=every, v=motion.v)
        else:
            path = orbits.march(lagrangian, method, dt=dt, steps=42, t=0.25, every=every)
        found |= {f"t{label}": path.t, f"q{label}": path.q, f"p{label}": path.p}
        found[f"evaluations{label}"] = path.evaluations
    return found


# -------------------------------------------------------------------------------------------------------------- cases


def cases() -> Iterator[Case]:
    """Yield all cases, those of a kind one after the other; the kind is the name up to the first slash."""
    yield from massive_cases()
    yield from particle_cases()
    yield from many_body_cases()
    yield from march_cases()
    yield from archive_cases()
    yield from encounter_cases()


def massive_cases() -> Iterator[Case]:
    """Massive bodies alone, there and back, samples on and off the grid of steps; long runs; steps that fail."""
    of_wide = [Composition(orbits.Gauss(stages=12), 26, "suzuki")]
    for method in distinct(every_kind(), chains(), of_wide):
        for way, sign in (("forwards", 1), ("backwards", -1)):
            days = sign * np.array([0.0, 4.0, 13.7, 29.999, 30.0, 61.3])
            options: dict[str, Any] = {"dt": 4 * u.day, "duration": sign * 61.3 * u.day, "samples": days * u.day}
            yield f"massive/{method.label} {way}", partial(propagated, planets(), method, also=(between,), **options)
    massive_three = pythagorean(0.0).remove("a", "b", "c", "d")
    for method in every_kind():
        options = {"dt": 4 * u.day, "duration": 1000 * u.day, "samples": 11}
        yield f"massive/{method.label} 250 steps", partial(propagated, planets(), method, also=(approaches,), **options)
        failing: dict[str, Any] = {"dt": 0.5, "duration": 40.0, "samples": 9}
        yield f"massive/{method.label} long steps", partial(propagated, massive_three, method, **failing)


def particle_cases() -> Iterator[Case]:
    """Massless particles, by one, two and three threads; among massive ones in no order; about a single body."""
    for method in every_kind():
        for threads in (1, 2, 3):
            options: dict[str, Any] = {"dt": 4 * u.day, "duration": -400 * u.day, "samples": 9, "threads": threads}
            name = f"particles/{method.label} [threads={threads}]"
            yield name, partial(propagated, asteroids(), method, also=(approaches,), **options)
        for kind, system in (("no order", mixed()), ("about one body", star_alone())):
            options = {"dt": 0.03, "duration": 3.1, "samples": [0.0, 0.5, 1.23, 3.1]}
            yield f"particles/{method.label} {kind}", partial(propagated, system, method, also=(between,), **options)


def many_body_cases() -> Iterator[Case]:
    """A thousand massive bodies, by one thread and two."""
    for method in distinct(explicit(), default_chains()):
        for threads in (1, 2):
            options: dict[str, Any] = {"dt": 0.01, "duration": 0.055, "samples": [0.0, 0.02, 0.055], "threads": threads}
            name = f"many bodies/{method.label} [threads={threads}]"
            yield name, partial(propagated, many_bodies(), method, **options)


def march_cases() -> Iterator[Case]:
    """Every registered Lagrangian, as `orbits.march` takes it and in canonical form."""
    pairs = [method for method in composed() if method.order <= 6]
    some = distinct(methods(), [orbits.Gauss(stages=12), Composition(order=8)], pairs)
    for form in ("march", "canonical"):
        for name, lagrangian in sorted(orbits.lagrangians.registry().items()):
            for method in some:
                label = f"{form}/{name}, {method.label}"
                yield label, partial(marched, lagrangian, method, canonical=form == "canonical")


def archive_cases() -> Iterator[Case]:
    """Runs into archives, ended early, resumed and extended."""
    for method in every_kind():
        options: dict[str, Any] = {"dt": 4 * u.day, "duration": 130 * u.day, "samples": 12}
        yield f"archive/{method.label}", partial(interrupted, asteroids(), method, **options)


def encounter_cases() -> Iterator[Case]:
    """Close encounters, softened and not, and the conditions that end a run."""
    for method in every_kind():
        for softening in (0.0, 0.05):
            options: dict[str, Any] = {"dt": 1 / 128, "duration": 1.75, "samples": 9}
            name = f"encounters/{method.label} softening {softening:g}"
            yield name, partial(propagated, pythagorean(softening), method, also=(approaches,), **options)
        for threads in (1, 3):
            options = {"dt": 1 * u.day, "duration": 60 * u.day, "samples": 4, "threads": threads}
            name = f"encounters/{method.label} flybys [threads={threads}]"
            yield name, partial(propagated, jupiter_crossers(), method, also=(approaches,), **options)
    conditions: dict[str, Any] = {
        "several": [CloserThan(0.1), FartherThan(3.2), EnergyErrorAbove(1e-4)],
        "closer": CloserThan(0.4),
        "closer by name": CloserThan(0.9, "a", "C"),
        "farther": FartherThan(5.2),
        "farther by name": FartherThan(2.5, "b", "B"),
        "energy": EnergyErrorAbove(1e-9),
    }
    few = [orbits.StormerVerlet(), orbits.Gauss(stages=4), Composition(order=6), RungeKutta4()]
    for word, stop in conditions.items():
        for method in every_kind() if word == "several" else few:
            options = {"dt": 1 / 128, "duration": 1.75, "samples": [0.1, 0.7, 1.515, 1.75], "stop": stop}
            yield f"stop/{method.label} {word}", partial(stopped_and_resumed, pythagorean(0.05), method, **options)
