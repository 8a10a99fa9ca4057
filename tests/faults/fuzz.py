"""A seeded fuzz of the public interface: calls with good arguments of which some are replaced by anything at all.

What a call may do: return finite numbers, or raise an error of this package. What it may not: hand back NaN, raise
anything else, or not come back.
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import math
import random
import time
import traceback
import warnings
from collections.abc import Callable
from typing import Any

import mpmath
import numpy as np
from astropy import units as u
from astropy.time import Time

import orbits
from orbits import diagnostics, elements
from orbits.errors import Interrupted, OrbitsError, shown
from orbits.methods import RungeKutta4
from orbits.system import OrbitalElements
from tests.campaigns import ODDITIES
from tests.catalogue.lines import CERES, VESTA
from tests.faults.alarm import Hang, at_most
from tests.faults.calls import calls

SECONDS = 20
"""That a call may take; all kernels are compiled before."""

NUMBERS = [
    0, -0.0, 1, -1, 2, 3, 0.5, 1e-3, np.nan, np.inf, -np.inf, 1e308, -1e308, 1e300, 1e200, 1e155, 1e-155, 1e-200,
    1e-300, 5e-324, 2**53, 2**63, 2**64, 10**400, True, False, None, 1j, "1", "1 d", "P/20", "1 " + "x" * 100_000, "",
    "\x00", "nan", b"1", 1 * u.au, 1 * u.day, np.nan * u.day, 1e300 * u.km, -1 * u.yr, [1 * u.au] * 3, u.au,
    Time("J2000.0"),
]  # fmt: skip
TEXTS = ["", "a", "b", "Sun", "sun", "Jupiter", "rock", "\x00", "\ud800", "x" * 100_000, "gauss", "ecliptic", "icrf"]
ARRAYS = [
    np.zeros(0), np.zeros(3), np.zeros((3, 3)), np.full((3, 3), np.nan), np.full((3, 3), np.inf),
    np.full((3, 3), 1e308), np.full((3, 3), 1e-320), np.eye(3) * 1e200, np.eye(3) * 1e-200, np.eye(3) * 1e155,
    np.ones((2, 3, 3)), np.ones((3, 2)), np.eye(3), [[1, 2, 3]] * 3, [[1, 2], [3]], [["a"] * 3] * 3, np.eye(3) * u.au,
    np.ma.masked_array(np.eye(3), np.eye(3)), np.eye(3).astype(complex), np.eye(3, dtype=np.float32),
    np.eye(3).astype(object), np.array("x"), [], [[]], ((),) * 3,
]  # fmt: skip


def anything(rng: random.Random) -> Any:
    return rng.choice(rng.choice([NUMBERS, NUMBERS, TEXTS, ARRAYS, ODDITIES]))


Q = np.array([[0.0, 0, 0], [1, 0, 0], [0, 2, 0.1]])
V = np.array([[0.0, 0, 0], [0, 1, 0], [-0.7, 0, 0]])
GM = np.array([1.0, 1e-3, 0.0])
NAMES = ["Sun", "Jupiter", "rock"]
THREE = orbits.System(NAMES, GM, Q, V, units=orbits.DIMENSIONLESS)
REAL = orbits.System(NAMES, GM * orbits.SOLAR.G, Q, V * 0.017, epoch="J2000", units=orbits.SOLAR)
PENDULUM = orbits.lagrangians.pendulum
METHODS = [
    orbits.StormerVerlet(), orbits.Gauss(stages=2), orbits.Gauss(stages=8), orbits.methods.SymplecticEuler(),
    RungeKutta4(), orbits.methods.LobattoIIIAB(stages=3), orbits.methods.Composition(orbits.StormerVerlet(), order=4),
]  # fmt: skip
RUN = orbits.propagate(THREE, METHODS[0], dt=0.01, duration=1.0, samples=5)
DATES = orbits.propagate(REAL, METHODS[0], dt=1.0, duration=20.0, samples=5)


def mutated(rng: random.Random) -> Any:
    text = list(rng.choice([CERES, VESTA, f"{CERES}\n{VESTA}"]))
    for _ in range(rng.randrange(4)):
        k = rng.randrange(len(text))
        text[k : k + rng.randrange(3)] = rng.choice(["", " ", "\n", "x", "9", "\x00", "é"])
    return "".join(text)[: rng.choice([None, rng.randrange(210)])]


def methods(rng: random.Random) -> Any:
    return rng.choice(METHODS)


Maker = Callable[[random.Random], Any]


def one_of(*values: Any) -> Maker:
    return lambda rng: rng.choice(values)


STATE = {"gm": one_of(GM), "q": one_of(Q), "v": one_of(V)}
ONE = {"gm": one_of(1.0), "q": one_of(Q[1], Q[1:]), "v": one_of(V[1], V[1:])}
FEW = one_of(1, 2, 5)
PLACES = [  # of an orbit
    "a",
    "e",
    "inc",
    "Omega",
    "omega",
    "pomega",
    "M",
    "f",
    "E",
    "u",
    "l",
    "q",
    "n",
    "P",
    "T",
    "h",
    "k",
    "ix",
    "iy",
]


def some_elements(rng: random.Random) -> dict[str, Any]:
    chosen = rng.sample(PLACES, rng.randrange(1, 5))
    return {key: rng.choice([0.1, 0.5, 1.0, 3.0, anything(rng)]) for key in chosen}


def body(rng: random.Random, system: orbits.System) -> Any:
    given = some_elements(rng) if rng.random() < 0.7 else {"a": 1.0, "e": anything(rng)}
    return system.add("new", primary=rng.choice(["Sun", "jacobi", "barycentre", anything(rng)]), **given)


def scale(rng: random.Random) -> float:
    """A number of any size, of its own unit as often as not."""
    return float(rng.choice([1.0, 10.0 ** rng.uniform(-320, 308)]))


def any_scale(rng: random.Random) -> orbits.System:
    apart = Q.copy()
    if rng.random() < 0.3:
        apart[2] = apart[1] * (1.0 + 10.0 ** rng.uniform(-17, 0))
    gm = GM * scale(rng) if rng.random() < 0.7 else np.array([scale(rng), scale(rng), scale(rng)])
    softening = rng.choice([0.0, 0.0, scale(rng)])
    q, v = apart * scale(rng), V * scale(rng)
    return orbits.System(NAMES, gm, q, v, units=orbits.DIMENSIONLESS, softening=softening)


def questions(rng: random.Random, system: orbits.System) -> Any:
    kind = rng.randrange(6)
    if kind == 0:
        energy = float(system.energy().value)
        exact = exact_energy(system)
        # Half a unit in the last place is promised; a subnormal one has few digits.
        if abs(energy - exact) > 1e-15 * abs(exact) + 1e-320:
            return f"the energy {energy!r} in place of {mpmath.nstr(exact, 17)}"
        return energy
    ask: Any = (
        system.angular_momentum, system.linear_momentum, system.centre_of_mass, system.barycentric,
        lambda: system.elements("Sun"),
    )[kind - 1]  # fmt: skip
    return ask()


def exact_energy(system: orbits.System) -> Any:
    gm, q, v, softening = system.values
    with mpmath.workdps(60):
        m, x, w = ([[mpmath.mpf(float(a)) for a in np.atleast_1d(row)] for row in rows] for rows in (gm, q, v))
        total = sum(m[i][0] * a * a / 2 for i in range(3) for a in w[i])
        for i, j in ((0, 1), (0, 2), (1, 2)):
            if m[i][0] and m[j][0]:
                r2 = sum((a - b) ** 2 for a, b in zip(x[i], x[j], strict=True)) + mpmath.mpf(float(softening)) ** 2
                total -= m[i][0] * m[j][0] / mpmath.sqrt(r2)
        return total


def run_questions(rng: random.Random, system: orbits.System) -> Any:
    run = orbits.propagate(system, methods(rng), dt=scale(rng), duration=scale(rng) * 3.0, samples=3, stop=few_steps())
    if not len(run):
        return run
    if rng.random() < 0.5:
        kept = run.drift()
        parts = (kept.energy, kept.angular_momentum, kept.linear_momentum, kept.centre_of_mass)
        if any(math.isnan(part.max_fraction) for part in parts):  # an infinite one may be true
            return "a drift of NaN"
    return [run, run.at(float(run.times[len(run) // 2]))]


def few_steps() -> Any:
    return orbits.events.WallTimeOver(0.2)


# Each call: what it is called with, by name, and how. Good values are drawn for each argument, and some are replaced.
CALLS: dict[str, tuple[Callable[..., Any], dict[str, Maker]]] = {
    "System": (
        orbits.System,
        {
            "names": one_of(NAMES),
            **STATE,
            "epoch": one_of(None, "J2000"),
            "softening": one_of(0.0, 0.1),
            "units": one_of(orbits.DIMENSIONLESS, orbits.SOLAR),
            "radii": one_of(None, [0.1, 0.1, 0.0]),
        },
    ),
    "System.replaced": (THREE.replaced, {"q": one_of(Q), "v": one_of(V), "gm": one_of(GM), "softening": one_of(0.1)}),
    "System.from_elements": (
        orbits.System.from_elements,
        {
            "bodies": one_of({"Sun": {"gm": 1.0}, "p": {"a": 1.0, "e": 0.1}}),
            "units": one_of(orbits.DIMENSIONLESS),
            "epoch": one_of(None, "J2000"),
            "softening": one_of(0.0),
        },
    ),
    "System.solar_system": (
        orbits.System.solar_system,
        {"epoch": one_of("2022-08-09"), "bodies": one_of(["Sun", "Mars"])},
    ),
    "System.index": (THREE.index, {"name": one_of(*NAMES)}),
    "System.elements": (THREE.elements, {"primary": one_of("Sun", "jacobi"), "frame": one_of(None, "icrf")}),
    "UnitSystem": (
        orbits.UnitSystem,
        {
            "name": one_of("own"),
            "length": one_of(u.au),
            "time": one_of(u.day),
            "mass": one_of(u.M_sun),
            "G": one_of(None),
        },
    ),
    "SOLAR.length_value": (orbits.SOLAR.length_value, {"x": one_of(1.0, 3 * u.km)}),
    "SOLAR.gm_value": (orbits.SOLAR.gm_value, {"x": one_of(1.0)}),
    "propagate": (
        orbits.propagate,
        {
            "system": one_of(THREE),
            "integrator": methods,
            "dt": one_of(0.1, "P/20"),
            "duration": one_of(0.5, -0.5),
            "samples": one_of(3, [0.1, 0.2]),
            "threads": one_of(None, 1, 2),
            "stop": one_of(()),
            "progress": one_of(False),
        },
    ),
    "run.at": (RUN.at, {"t": one_of(0.0, 0.35, 1.0)}),
    "run.at (dates)": (DATES.at, {"t": one_of(3.0, 3 * u.day)}),
    "run[]": (RUN.__getitem__, {"key": one_of(0, -1, "Sun")}),
    "run.elements": (RUN.elements, {"primary": one_of("Sun"), "frame": one_of(None)}),
    "run.to_table": (RUN.to_table, {"bodies": one_of(None, ["Sun"])}),
    "march": (
        orbits.march,
        {
            "lagrangian": one_of(PENDULUM),
            "integrator": methods,
            "q": one_of([0.5]),
            "v": one_of([0.1]),
            "dt": one_of(0.1),
            "steps": FEW,
            "every": one_of(1),
        },
    ),
    "kepler_flow": (orbits.kepler_flow, {**ONE, "dt": one_of(0.1, 1e3)}),
    "elements_from_state": (elements.elements_from_state, {**ONE, "t": one_of(0.0), "names": one_of(None)}),
    "two_body": (elements.two_body, {**ONE, "dt": one_of(0.3), "names": one_of(None)}),
    "icrf_to_ecliptic": (elements.icrf_to_ecliptic, {"x": one_of(Q)}),
    "diagnostics.energy": (diagnostics.energy, {**STATE, "softening": one_of(0.0, 0.1)}),
    "diagnostics.linear_momentum": (diagnostics.linear_momentum, {"gm": one_of(GM), "v": one_of(V)}),
    "diagnostics.angular_momentum": (diagnostics.angular_momentum, STATE),
    "diagnostics.noether_charges": (diagnostics.noether_charges, STATE),
    "diagnostics.centre_of_mass": (diagnostics.centre_of_mass, {"gm": one_of(GM), "q": one_of(Q)}),
    "diagnostics.centre_of_mass_drift": (
        diagnostics.centre_of_mass_drift,
        {"gm": one_of(GM), "t": one_of([0.0]), "q": one_of(Q[None]), "v": one_of(V)},
    ),
    "diagnostics.drift": (diagnostics.drift, {"series": one_of([1.0, 2.0], Q), "scale": one_of(1.0)}),
    "diagnostics.reversibility": (
        diagnostics.reversibility,
        {**STATE, "integrator": methods, "dt": one_of(0.1), "steps": FEW, "softening": one_of(0.0)},
    ),
    "diagnostics.symplecticity": (
        diagnostics.symplecticity,
        {**STATE, "integrator": one_of(METHODS[0], METHODS[1]), "dt": one_of(0.1), "softening": one_of(0.0)},
    ),
    "diagnostics.order": (
        diagnostics.order,
        {**STATE, "integrator": one_of(METHODS[0]), "dt": one_of(0.1), "steps": one_of(2), "halvings": one_of(2)},
    ),
    "diagnostics.convergence": (
        diagnostics.convergence,
        {"h": one_of([1.0, 0.5, 0.25, 0.1]), "errors": one_of([1.0, 0.2, 0.06, 0.01])},
    ),
    "diagnostics.growth": (
        diagnostics.growth,
        {"t": one_of([1.0, 2, 4, 8]), "errors": one_of(np.arange(1.0, 41).reshape(10, 4))},
    ),
    "asteroids": (
        orbits.asteroids,
        {
            "count": one_of(3, 10),
            "names": one_of(None, ["Ceres"]),
            "classes": one_of(None, "belt"),
            "brighter_than": one_of(None, 8.0),
        },
    ),
    "read_mpcorb": (
        orbits.read_mpcorb,
        {"source": mutated, "errors": one_of("raise", "skip"), "count": one_of(None, 1)},
    ),
    "read_sbdb": (orbits.read_sbdb, {"source": one_of("full_name,a,e,i\n1 Ceres,2.7,0.1,10\n", CERES, "{}")}),
    "Gauss": (orbits.Gauss, {"stages": one_of(2, 3)}),
    "Composition": (orbits.methods.Composition, {"base": methods, "order": one_of(4), "scheme": one_of(None)}),
    "VPRK": (orbits.methods.VPRK, {"a": one_of([[0.5]]), "b": one_of([1.0])}),
    "SymplecticEuler": (orbits.methods.SymplecticEuler, {"variant": one_of("kick-drift")}),
    "CloserThan": (orbits.events.CloserThan, {"distance": one_of(0.1), "body": one_of("Sun"), "other": one_of(None)}),
    "FartherThan": (orbits.events.FartherThan, {"distance": one_of(9.0), "body": one_of("Sun"), "other": one_of(None)}),
    "EnergyErrorAbove": (orbits.events.EnergyErrorAbove, {"fraction": one_of(0.1)}),
    "WallTimeOver": (orbits.events.WallTimeOver, {"duration": one_of(1.0)}),
    "Trajectory": (
        orbits.Trajectory,
        {
            "system": one_of(THREE),
            "times": one_of([0.0]),
            "q": one_of(Q[None]),
            "v": one_of(V[None]),
            "step": one_of(0.1),
            "integrator": methods,
        },
    ),
    "Trajectory.open": (orbits.Trajectory.open, {"path": one_of("/no/such/file")}),
    "resume": (orbits.resume, {"path": one_of("/no/such/file")}),
    "to_rebound": (orbits.rebound.to_rebound, {"system": one_of(THREE, RUN), "sample": one_of(-1)}),
    "System.remove": (THREE.remove, {"name": one_of("rock")}),
    "add_particles": (
        REAL.add_particles,
        {"catalogue": one_of(orbits.read_mpcorb(CERES)), "propagate_to_epoch": one_of(True), "massive": one_of(False)},
    ),
}

MORE = calls(THREE, REAL, RUN)
CALLS |= {
    name: (function, {key: one_of(*values) for key, values in given.items()})
    for name, (function, given) in MORE.items()
}

WHOLE: dict[str, Callable[[random.Random], Any]] = {
    "System.add": lambda rng: body(rng, THREE),
    "state_from_elements": lambda rng: elements.state_from_elements(scale(rng), **some_elements(rng)),
    "a system of any scale": lambda rng: questions(rng, any_scale(rng)),
    "a run of any scale": lambda rng: run_questions(rng, any_scale(rng)),
}
"""Calls that draw all of their arguments themselves."""


CONVERSIONS = ("SOLAR.length_value", "SOLAR.gm_value", "icrf_to_ecliptic")
"""Calls that hand on what they are given in another unit or in other axes, a NaN too."""


@dataclasses.dataclass
class Found:
    """What came of a fuzz: how many calls returned, were refused, and those that did neither as they should."""

    returned: int = 0
    refused: int = 0
    wrong: list[str] = dataclasses.field(default_factory=list)
    slowest: tuple[float, str] = (0.0, "")

    @property
    def calls(self) -> int:
        return self.returned + self.refused + len(self.wrong)


@functools.cache
def compile_kernels() -> None:
    """Do with each method what the calls do, so that a slow machine with an empty cache does not look like a hang."""
    state = {"gm": GM, "q": Q, "v": V}
    for method in METHODS:
        run = orbits.propagate(THREE, method, dt=0.1, duration=0.5, samples=[0.12, 0.3])
        run.at(0.25)
        run.drift()
        orbits.march(PENDULUM, method, q=[0.5], v=[0.1], dt=0.1, steps=2)
        diagnostics.reversibility(**state, integrator=method, dt=0.1, steps=2)
    for method in METHODS[:2]:
        diagnostics.symplecticity(**state, integrator=method, dt=0.1)
    orbits.kepler_flow(Q[1], V[1], gm=1.0, dt=0.1)
    for function, given in MORE.values():
        with contextlib.suppress(OrbitsError):
            function(**{key: values[0] for key, values in given.items()})


def fuzz(seed: int, count: int) -> Found:
    """Make so many calls."""
    rng, found = random.Random(seed), Found()
    names = [*CALLS, *WHOLE]
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        compile_kernels()
        for _ in range(count):
            name = rng.choice(names)
            state = rng.getstate()
            began = time.perf_counter()
            try:
                with at_most(SECONDS):
                    result = call(name, rng)
                    bad = "" if name in CONVERSIONS else nonsense(result)
            except (OrbitsError, Interrupted):
                found.refused += 1
            except Hang:
                found.wrong.append(f"{name}: took more than {SECONDS} s; {told(name, state)}")
            except BaseException as error:
                last = traceback.extract_tb(error.__traceback__)[-1]
                where = f"{last.filename.rpartition('/')[2]}:{last.lineno}"
                found.wrong.append(f"{name}: {type(error).__name__}: {str(error)[:90]} at {where}; {told(name, state)}")
            else:
                if bad:
                    found.wrong.append(f"{name}: returned {bad}; {told(name, state)}")
                else:
                    found.returned += 1
            found.slowest = max(found.slowest, (time.perf_counter() - began, name))
    return found


def arguments(name: str, rng: random.Random) -> dict[str, Any]:
    makers = CALLS[name][1]
    given = {key: maker(rng) for key, maker in makers.items()}
    for key in rng.sample(list(given), min(len(given), rng.choice([0, 0, 1, 1, 2]))):
        given[key] = anything(rng)
    return given


def call(name: str, rng: random.Random) -> Any:
    if name in WHOLE:
        return WHOLE[name](rng)
    given = arguments(name, rng)
    if name in ("run[]", "System.index", "System.remove", "icrf_to_ecliptic", "Composition"):
        first, *rest = given
        return CALLS[name][0](given[first], **{key: given[key] for key in rest})
    return CALLS[name][0](**given)


def told(name: str, state: Any) -> str:
    """The arguments of a call, drawn once more."""
    rng = random.Random()
    rng.setstate(state)
    if name in WHOLE:
        return "drawn by itself"
    return ", ".join(f"{key}={shown(value)[:60]}" for key, value in arguments(name, rng).items())


def nonsense(value: Any, *, infinite: bool = False) -> str:
    """Return what of a result is no number, in words; nothing where all is well."""
    if isinstance(value, diagnostics.Convergence | orbits.Flow):  # NaN is documented: no part of the curve is straight
        return ""
    if isinstance(value, orbits.System):
        return nonsense(list(value.values))
    if isinstance(value, orbits.Trajectory):
        # A particle that cannot be stepped, such as one in the place of a planet, is NaN from there on, and listed.
        kept = [k for k, name in enumerate(value.names) if name not in value.retired.names]
        return nonsense([value.times, value.q[:, kept], value.v[:, kept]])
    if isinstance(value, OrbitalElements | elements.Elements):  # a parabola has an infinite semi-major axis
        return nonsense([getattr(value, key) for key in value.keys()], infinite=True)  # noqa: SIM118 - no mapping
    if isinstance(value, str):  # a question that finds its own answer wrong says so
        return value
    if isinstance(value, u.Quantity):
        value = value.value
    if isinstance(value, float | np.ndarray | np.floating) and np.asarray(value).dtype.kind == "f":
        good = ~np.isnan(value) if infinite else np.isfinite(value)
        return "" if np.all(good) else f"{value!r}"[:80]
    if isinstance(value, list | tuple):
        return next((bad for bad in (nonsense(x, infinite=infinite) for x in value) if bad), "")
    return ""
