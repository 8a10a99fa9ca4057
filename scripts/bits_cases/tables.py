"""Tables of systems, methods and options that are run in all the ways of `ways`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from astropy import units as u

import orbits
from bits_cases import systems
from bits_cases.facts import Case, Facts
from bits_cases.ways import QUIET, compared, facts, in_all_ways
from orbits.events import (
    Apocentre,
    Bounce,
    CloseApproach,
    CloserThan,
    Collision,
    Conjunction,
    Ejection,
    ElementCrossing,
    EnergyErrorAbove,
    Event,
    FartherThan,
    Merge,
    NodeCrossing,
    Pericentre,
    PlaneCrossing,
)
from orbits.integrators.maps.encounters import Encounters
from orbits.methods import Composition, ImplicitMidpoint, LobattoIIIAB
from orbits.terms import (
    Damping,
    DegreeTwo,
    Drag,
    FrameDragging,
    GasDrag,
    MassLoss,
    MinorBodies,
    NobiliRoxburgh,
    NonGravitational,
    PostNewtonian,
    RadiationPressure,
    Tides,
    ZonalHarmonics,
)

GAUSS, VERLET, CHAIN = orbits.Gauss(stages=8), orbits.StormerVerlet(), Composition(order=6)
MAP, PLAIN = orbits.WisdomHolman(), orbits.WisdomHolman(kernel="standard", corrector=0)
HELIOCENTRIC, SABA = orbits.WisdomHolman(coordinates="democratic-heliocentric"), orbits.methods.SABA()
METHODS = {"Gauss": GAUSS, "kicks": VERLET, "chain": CHAIN, "map": MAP, "SABA": SABA}
MERGE, BOUNCE = Collision(then=Merge()), Collision(then=Bounce(0.8))
POLE = (0.36, 0.48, 0.8)

Options = dict[str, Any]


def cases() -> Iterator[Case]:
    """Yield the cases of all tables, and those that are not runs of one system."""
    rows = [clocks, events, acting, collisions, long_steps, maps, terms, forces, figures, ephemeris]
    for table in rows:
        for name, system, method, options in table():
            yield f"{table.__name__}/{name}", partial(run_of, system, method, options)
    for seed in range(100):
        yield f"random/{seed}", partial(random_run, seed)
    yield from tangents()
    yield from lists()


def run_of(system: Any, method: Any, options: Options) -> Facts:
    """Return the facts of a row: of a system, and a method or a function that makes it and may refuse to."""
    return in_all_ways(system(), method() if isinstance(method, partial) else method, **options)


Row = tuple[str, Any, Any, Options]


# ---------------------------------------------------------------------------------------------------------------- runs


def clocks() -> Iterator[Row]:
    """Steps chosen one by one, for massive bodies, and for particles by clocks of their own; transformed time."""
    for stages in (3, 5, 8):
        method = orbits.Gauss(stages=stages)
        for way, duration in (("forwards", 1.75), ("backwards", -1.75)):
            yield f"adaptive, {stages} stages, {way}", partial(systems.pythagorean, 0.0), method, {"duration": duration}
        for name, tolerance in (("planets", None), ("planets, 1e-6", 1e-6)):
            options: Options = {"dt": orbits.Adaptive(tolerance), "duration": 400 * u.day}
            yield f"adaptive, {stages} stages, {name}", partial(systems.asteroids, 11), method, options
    yield "adaptive, flybys", systems.jupiter_crossers, GAUSS, {"duration": 60 * u.day}
    yield "adaptive, softened", partial(systems.pythagorean, 0.05), GAUSS, {"duration": 1.75}
    for method in (GAUSS, orbits.Gauss(stages=2), LobattoIIIAB(stages=3), ImplicitMidpoint(), VERLET):
        for way, duration in (("forwards", 20.0), ("backwards", -20.0)):
            options = {"dt": orbits.TimeTransformed(0.3), "duration": duration}
            yield f"transformed, {method.label}, {way}", systems.eccentric, method, options
    yield "transformed, particles", systems.satellites, GAUSS, {"dt": orbits.TimeTransformed(0.3), "duration": 5.0}


def alignment(t: Any, q: Any, v: Any) -> Any:
    """Return a function that is zero when the two satellites are side by side."""
    return q[:, 1, 0] - q[:, 2, 0]


EVENTS = {
    "pericentre": Pericentre("p"),
    "apocentre": Apocentre("inner"),
    "node": NodeCrossing("s"),
    "plane": PlaneCrossing("outer", POLE, about="planet"),
    "approach": CloseApproach("p"),
    "closer": CloserThan(1.1, "p", "planet"),
    "farther": FartherThan(1.9, "s", "planet"),
    "element": ElementCrossing("p", "f", 1.0),
    "ejection": Ejection(3.0),
    "conjunction": Conjunction("inner", "outer", observer="planet"),
    "own": Event(alignment, name="alignment"),
}


def events() -> Iterator[Row]:
    """Each kind of event, recorded and as a stop, by constant and chosen steps and a map; conditions that end a run."""
    for word, event in EVENTS.items():
        for label, method, dt in (("constant", GAUSS, 1 / 8), ("adaptive", GAUSS, None), ("map", PLAIN, 1 / 16)):
            options: Options = {"dt": dt, "duration": 12.5, "events": event}
            yield f"{word}, {label}", systems.satellites, method, options
        options = {"dt": 1 / 8, "duration": 12.5, "events": replace(event, then="stop")}
        yield f"{word}, stop", systems.satellites, GAUSS, options
    for word, method in METHODS.items():
        options = {"dt": 1 / 16, "duration": 12.5, "events": [*EVENTS.values()]}
        yield f"all kinds, {word}", systems.satellites, method, options
    for word, stop in {"closer": CloserThan(0.4), "energy": EnergyErrorAbove(1e-13)}.items():
        for label, dt in (("constant", 1 / 128), ("adaptive", None)):
            options = {"dt": dt, "duration": 1.25, "stop": stop, "killed": False}
            yield f"stop={word}, {label}", partial(systems.pythagorean, 0.0), GAUSS, options


def kick(t: Any, system: Any) -> Any:
    """Return a system whose second body is faster."""
    factors = np.where(np.arange(len(system.names)) == 1, 1.02, 1.0)
    return system.replaced(v=system.v.value * factors[:, None])


def push(t: Any, system: Any) -> Any:
    """Return a system in which a massless body is faster."""
    factors = np.where(np.array(system.names) == "p", 1.02, 1.0)
    return system.replaced(v=system.v.value * factors[:, None])


def grow(t: Any, system: Any) -> Any:
    """Return a system whose first body is heavier."""
    return system.replaced(gm=np.append(1.01 * system.values.gm[0], system.values.gm[1:]))


def remove(t: Any, system: Any) -> Any:
    """Return a system without a body."""
    return system.remove("s")


def acting() -> Iterator[Row]:
    """Events at which functions change velocities and masses, and remove a body."""
    ways = (("constant", GAUSS, 1 / 8), ("adaptive", GAUSS, None), ("map", PLAIN, 1 / 16))
    for function in (kick, push, grow):
        for word in ("apocentre", "own"):
            acts = replace(EVENTS[word], then=function)
            for label, method, dt in ways:
                options: Options = {"dt": dt, "duration": 12.5, "events": [acts, EVENTS["plane"]]}
                yield f"{function.__name__} at {word}, {label}", systems.satellites, method, options
    removes: Options = {"dt": None, "duration": 12.5, "events": replace(EVENTS["own"], then=remove)}
    yield "remove at own, adaptive", systems.satellites, GAUSS, removes
    refused: Options = {"dt": 1 / 8, "duration": 12.5, "events": replace(EVENTS["pericentre"], then=push)}
    yield "push of a massless body, constant", systems.satellites, GAUSS, refused
    yield "node of a massless body, constant", systems.satellites, GAUSS, {**refused, "events": [acts, EVENTS["node"]]}


def collisions() -> Iterator[Row]:
    """Bodies that merge, bounce, stop a run and pass through each other."""
    for label, event in COLLISIONS.items():
        for way, method, dt in (("constant", GAUSS, 1 / 32), ("adaptive", GAUSS, None), ("kicks", VERLET, 1 / 128)):
            options: Options = {"dt": dt, "duration": 6.25, "events": event}
            yield f"disc, {label}, {way}", systems.disc, method, options
            several = {**options, "events": [event, NodeCrossing("p0"), CloseApproach(within=0.1)]}
            yield f"disc, {label}, with events, {way}", systems.disc, method, several
    yield "disc, merge, map", systems.disc, MAP, {"dt": 1 / 32, "duration": 6.25, "events": MERGE}


COLLISIONS = {"merge": MERGE, "bounce": BOUNCE, "stop": Collision(then="stop"), "record": Collision()}


def long_steps() -> Iterator[Row]:
    """Bodies that are small against their way in a step."""
    for way in (1.0, 1e2, 1e4, 1e6):
        for (label, event), phase in zip(COLLISIONS.items(), (0.1, 0.5, 0.5, 0.93), strict=True):
            options: Options = {"dt": 1.0, "duration": 10.0, "events": event}
            yield f"way {way:g}, {label}", partial(systems.passing, way, phase), GAUSS, options
    for label, event in COLLISIONS.items():
        if label != "bounce":
            yield f"bullet, {label}", systems.bullet, GAUSS, {"duration": 1e-4, "events": event}


def maps() -> Iterator[Row]:
    """Maps whose particles and planets leave them for close encounters, or are retired, or refused."""
    for word, kind in {"map": MAP, "plain": PLAIN, "heliocentric": HELIOCENTRIC, "SABA": SABA}.items():
        for encounters in ("warn", "follow", "retire"):
            for planets in ("warn", "follow", "refuse") if kind is not SABA else ("warn",):
                method = partial(replace, kind, encounters=str(Encounters(encounters, planets)))  # may be refused
                label = f"{word}, encounters={encounters}, planets={planets}"
                if planets == "warn":
                    days: Options = {"dt": 1 * u.day, "duration": 60 * u.day}
                    yield f"flybys, {label}", systems.jupiter_crossers, method, days
                numbers: Options = {"dt": 1 / 16, "duration": 25.0}
                yield f"crossing, {label}", systems.crossing_planets, method, numbers
    follow = replace(MAP, encounters="follow")
    seen: Options = {"dt": 1 / 16, "duration": 12.5, "events": [Pericentre("p"), CloseApproach("a", "b")]}
    yield "crossing, events, followed", systems.crossing_planets, follow, seen
    acts = [Pericentre("p", then=kick)]
    yield "crossing, acting, followed", systems.crossing_planets, follow, {**seen, "events": acts}
    lost = replace(MAP, ejected_beyond=2.5, lost_within=0.7)
    yield "crossing, lost", systems.crossing_planets, lost, {"dt": 1 / 16, "duration": 25.0}


TERMS = {
    "relativity": [PostNewtonian(c=30.0)],
    "relativity of one": [PostNewtonian(sources=["planet"], c=30.0)],
    "precession": [NobiliRoxburgh("planet", c=30.0)],
    "J2": [ZonalHarmonics("planet", J2=0.02, radius=0.5, pole=POLE)],
    "J2 to J4": [ZonalHarmonics("planet", J2=0.02, J3=1e-3, J4=1e-3, radius=0.5, pole=POLE)],
    "C22": [DegreeTwo("planet", J2=0.02, C22=0.005, radius=0.5, pole=POLE, attitude="inner")],
    "spin": [FrameDragging("planet", spin=0.1, pole=POLE, c=3.0)],
    "minor bodies": [MinorBodies(bodies=["inner", "outer"])],
}
TERMS["all"] = [*TERMS["relativity of one"], *TERMS["J2"], *TERMS["spin"]]

FORCES = {
    "drag": Drag(rate=1e-2, velocity=(0.05, 0.0, -0.02)),
    "gas": GasDrag(per_length=1e-3, r0=1.0, slope=2.5, eta=0.01, pole=POLE),
    "light": RadiationPressure(beta=0.05, bodies=["p", "s"], c=100.0),
    "outgassing": NonGravitational(A1=1e-4, A2=1e-5, A3=1e-6, r0=1.0, bodies=["p", "inner"]),
    "damping": Damping(tau_a=300.0, tau_e=50.0, tau_i=100.0, pole=POLE),
    "mass loss": MassLoss(fraction=-1e-3),
    "tides": Tides("planet", k2=0.3, radius=0.3, lag=0.05, inertia=0.33, spin=0.5, pole=POLE, bodies=["inner"]),
}


def beyond_gravity() -> Iterator[tuple[str, Any, Options]]:
    """Yield methods and steps for terms and forces."""
    for label, method, dt in (
        ("constant", GAUSS, 1 / 8),
        ("adaptive", GAUSS, None),
        ("kicks", CHAIN, 1 / 16),
        ("map", MAP, 1 / 16),
        ("SABA", SABA, 1 / 16),
    ):
        yield label, method, {"dt": dt, "duration": 6.25}


def terms() -> Iterator[Row]:
    """Terms of the Lagrangian, each with methods of all families."""
    for word, given in TERMS.items():
        for label, method, options in beyond_gravity():
            yield f"{word}, {label}", lambda given=given: systems.satellites().with_terms(*given), method, options


def forces() -> Iterator[Row]:
    """Forces without a Lagrangian, each with methods of all families, and with terms and events."""
    for word, given in FORCES.items():
        for label, method, options in beyond_gravity():
            yield f"{word}, {label}", lambda given=given: systems.satellites().with_forces(given), method, options
    for label, method, options in beyond_gravity():
        yield f"with terms, {label}", with_terms_and_forces, method, options
        seen = {**options, "events": EVENTS["pericentre"]}
        yield f"with terms and events, {label}", with_terms_and_forces, method, seen


def with_terms() -> Any:
    """Return satellites with terms."""
    return systems.satellites().with_terms(*TERMS["all"])


def with_terms_and_forces() -> Any:
    """Return satellites with terms and forces."""
    return with_terms().with_forces(FORCES["drag"], FORCES["outgassing"])


def figures() -> Iterator[Row]:
    """Rigid bodies."""
    for label, method in (("default", None), ("kicks", VERLET), ("adaptive", GAUSS)):
        dt = None if method is GAUSS else 1 / 24 * u.day
        yield f"moons, {label}", systems.moons, method, {"dt": dt, "duration": 10 * u.day}
    several: Options = {"dt": 1 / 24 * u.day, "duration": 10 * u.day, "events": CloseApproach("rock", "Titan")}
    yield "moons, events", systems.moons, None, several


def ephemeris() -> Iterator[Row]:
    """Small bodies in the field of an ephemeris."""
    for count in (0, 16):
        for label, method, dt in (("constant", GAUSS, 2 * u.day), ("adaptive", GAUSS, None)):
            for way, sign in (("forwards", 1), ("backwards", -1)):
                options: Options = {"dt": dt, "duration": sign * 200 * u.day}
                yield f"{count} asteroids, {label}, {way}", partial(systems.in_ephemeris, count), method, options


# -------------------------------------------------------------------------------------------------------------- others


def random_run(seed: int) -> Facts:
    """Return all that happened in a run of random bodies by one of several methods, with several kinds of events."""
    methods: list[tuple[Any, Any]] = [
        (GAUSS, None),
        (GAUSS, 1 / 16),
        (VERLET, 1 / 128),
        (CHAIN, 1 / 32),
        (PLAIN, 1 / 16),
        (replace(MAP, encounters="follow"), 1 / 16),
        (replace(MAP, encounters="retire"), 1 / 16),
        (SABA, 1 / 16),
    ]
    method, dt = methods[seed % len(methods)]
    sought = [
        Pericentre(),
        NodeCrossing("planet 1"),
        CloseApproach(within=0.1),
        FartherThan(1.5, "particle 0", "star"),
        ElementCrossing("particle 1", "f", 2.0),
        Conjunction("planet 0", "planet 1", observer="star"),
    ]
    return in_all_ways(systems.random_system(seed), method, dt=dt, duration=12.5, events=sought, killed=seed < 16)


def tangents() -> Iterator[Case]:
    """State-transition matrices and MEGNO, by one thread and three."""
    bodies = {"satellites": systems.satellites, "terms": with_terms}
    for word, system in bodies.items():
        for label, method, options in beyond_gravity():
            for coupled in (False, True):
                for threads in (1, 3):
                    given = {**options, "coupled": coupled, "threads": threads, "check_step": False}
                    name = f"{word}, {label}, coupled={coupled} [threads={threads}]"
                    yield f"tangents/matrix, {name}", partial(matrix, system, method, given)
                    yield f"tangents/MEGNO, {name}", partial(growth, system, method, given)


def matrix(system: Any, method: Any, options: Options) -> Facts:
    """Return state-transition matrices."""
    return {"matrix": orbits.state_transition(system(), method, samples=4, **options).matrix}


def growth(system: Any, method: Any, options: Options) -> Facts:
    """Return MEGNO and Lyapunov exponents."""
    found = orbits.megno(system(), method, samples=5, **options)
    parts = {"massive": found.massive, **{name: found[name] for name in found.names}}
    return {f"{name} MEGNO": part.megno for name, part in parts.items()} | {
        f"{name} Lyapunov": part.lyapunov.value for name, part in parts.items()
    }


def lists() -> Iterator[Case]:
    """Lists of systems, each as it is alone, by one thread and three."""
    for label, method, dt in (
        ("constant", GAUSS, 1 / 8),
        ("adaptive", GAUSS, None),
        ("kicks", CHAIN, 1 / 16),
        ("map", MAP, 1 / 16),
        ("plain map", PLAIN, 1 / 16),
        ("map that follows", replace(MAP, encounters="follow"), 1 / 16),
        ("SABA", SABA, 1 / 16),
    ):
        for word, count in (("planets", 1), ("particles", 0)):
            for threads in (1, 3):
                name = f"lists/{label}, {word} [threads={threads}]"
                yield name, partial(listed, method, dt, count == 1, threads)


def listed(method: Any, dt: Any, massive: bool, threads: int) -> Facts:
    """Return the facts of eleven systems that are propagated as a list, and whether each is as it is alone."""
    bodies = [systems.perturbed(k, massive) for k in range(11)]
    options: Options = {"dt": dt, "duration": 6.25, "samples": 6, "approaches": True, **QUIET}
    found: Facts = {}
    for k, run in enumerate(orbits.propagate(bodies, method, threads=threads, **options)):
        alone = facts(orbits.propagate(bodies[k], method, threads=1, **options))
        found |= {f"{k} {name}": run_value for name, run_value in facts(run).items()}
        found[f"{k} alone"] = compared(alone, partial(facts, run))
    return found
