"""Constructors and questions about runs for `fuzz`: what is called, and good values of each argument."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from astropy import units as u

import orbits
from orbits import ensemble
from orbits.forces.base import Force

Calls = dict[str, tuple[Callable[..., Any], dict[str, tuple[Any, ...]]]]

POLE, WHAT = ((0.0, 0.0, 1.0), (10 * u.deg, 80 * u.deg)), ("record", "stop")
SHORT = np.eye(6) * 1e-12


def acting(kind: type, system: orbits.System) -> Callable[..., Any]:
    """Return a function that adds a term or a force with some parameters to a system, where its numbers are read."""
    add = system.with_forces if issubclass(kind, Force) else system.with_terms
    return lambda **given: add(kind(**given))


def of_events(kind: Callable[..., Any], system: orbits.System) -> Callable[..., Any]:
    """Return a function that seeks an event with some parameters in a short run."""
    return lambda **given: orbits.propagate(
        system, "stormer-verlet", dt=0.1, duration=0.2, samples=2, events=kind(**given)
    ).events


def calls(system: orbits.System, real: orbits.System, run: orbits.Trajectory) -> Calls:
    """Return calls about a system of "Sun", "Jupiter" and the massless "rock" in pure numbers, the same with units, and
    a run of the first.
    """
    three = {"body": ("Jupiter",), "primary": ("Sun",), "then": WHAT}
    pair = {"body": ("Jupiter",), "other": ("Sun",), "then": WHAT}
    frame = {"frame": (None, "icrf")}
    seen = {"body": ("Jupiter",), "other": ("rock",), "observer": ("Sun",), "apparent": (False,), **frame}
    whom, source = {"bodies": (None, ["rock"])}, {"source": ("Sun",)}
    terms: dict[Any, dict[str, tuple[Any, ...]]] = {
        orbits.terms.ZonalHarmonics: {
            "body": ("Sun",), "J2": (1e-3,), "J3": (0.0,), "J4": (0.0,), "radius": (0.1,), "pole": POLE,
        },
        orbits.terms.DegreeTwo: {
            "body": ("Sun",), "J2": (1e-3,), "C22": (1e-4,), "radius": (0.1,), "pole": POLE,
            "attitude": ("Jupiter", None),
        },
        orbits.terms.FrameDragging: {"body": ("Sun",), "spin": (1e-3,), "pole": POLE, "c": (1e3,)},
        orbits.terms.NobiliRoxburgh: {"body": ("Sun",), "c": (1e3,)},
        orbits.terms.PostNewtonian: {"body": (None, "Sun"), "sources": (None,), "c": (1e3,)},
        orbits.terms.MinorBodies: {"bodies": (["Jupiter"],)},
        orbits.terms.Damping: {**whom, **source, "tau_a": (1e3,), "tau_e": (1e3,), "tau_i": (1e3,), "pole": POLE},
        orbits.terms.Drag: {**whom, "rate": (1e-3,), "velocity": ((0.0, 0.0, 0.0),)},
        orbits.terms.GasDrag: {
            **whom, **source, "per_length": (1e-3,), "r0": (1.0,), "slope": (1.0,), "eta": (0.01,), "pole": POLE,
        },
        orbits.terms.MassLoss: {**whom, **source, "fraction": (1e-6,), "since": (0.0,)},
        orbits.terms.NonGravitational: {
            **whom, **source, "A1": (1e-9,), "A2": (1e-9,), "r0": (1.0,), "m": (2.0,), "k": (4.0,),
        },
        orbits.terms.RadiationPressure: {**whom, **source, "beta": (0.1,), "c": (1e3,)},
        orbits.terms.Tides: {
            "source": ("Sun",), "k2": (0.1,), "radius": (0.1,), "lag": (0.1,), "inertia": (0.3,), "spin": (1.0,),
            "pole": POLE, **whom,
        },
    }  # fmt: skip
    events: dict[Any, dict[str, tuple[Any, ...]]] = {
        orbits.events.Apocentre: three,
        orbits.events.Pericentre: three,
        orbits.events.CloseApproach: {**pair, "within": (None, 0.5)},
        orbits.events.CloserThan: {**pair, "distance": (0.1,)},
        orbits.events.FartherThan: {**pair, "distance": (9.0,)},
        orbits.events.Ejection: {"distance": (9.0,), "body": (None, "rock"), "then": WHAT},
        orbits.events.ElementCrossing: {
            "body": ("rock",), "element": ("a", "inc"), "value": (1.0,), "primary": ("Sun",), "direction": (0, 1),
            **frame,
        },
        orbits.events.NodeCrossing: {**three, "direction": (0, 1), **frame},
        orbits.events.PlaneCrossing: {
            "body": ("rock",), "normal": ((0.0, 0.0, 1.0),), "about": (None, "Sun"), "offset": (0.0,),
            "direction": (0,), **frame,
        },
        orbits.events.Conjunction: seen,
        orbits.events.Opposition: seen,
    }  # fmt: skip
    return {
        **{kind.__name__: (acting(kind, system), given) for kind, given in terms.items()},
        **{kind.__name__: (of_events(kind, system), given) for kind, given in events.items()},
        "Bounce": (orbits.events.Bounce, {"restitution": (0.5,)}),
        "Adaptive": (orbits.Adaptive, {"tolerance": (None, 1e-9)}),
        "TimeTransformed": (orbits.TimeTransformed, {"step": (0.3,)}),
        "LobattoIIIAB": (orbits.methods.LobattoIIIAB, {"stages": (3,)}),
        "WisdomHolman": (
            orbits.WisdomHolman,
            {
                "coordinates": ("jacobi",), "kernel": (None, "lazy"), "corrector": (None, 17), "corrector2": (False,),
                "encounters": ("warn",), "planets": ("warn",), "ejected_beyond": (None, 9.0),
                "lost_within": (None, 0.1),
            },
        ),
        "SABA": (orbits.methods.SABA, {"first": (10,), "second": (None,), "third": (None,), "encounters": ("warn",)}),
        "RigidBody": (
            lambda **given: system.with_rigid({"Jupiter": orbits.RigidBody(**given)}),
            {
                "A": (0.3,), "B": (0.35,), "C": (0.4,), "radius": (0.1,), "attitude": (None, (1.0, 0, 0, 0)),
                "spin": ((0.0, 0.0, 1.0),),
            },
        ),
        "Option": (
            orbits.scenarios.Option,
            {"name": ("count",), "default": (3,), "help": ("how many",), "least": (None, 1), "most": (None, 9)},
        ),
        "Scenario": (
            orbits.scenarios.Scenario,
            {
                "name": ("s",), "title": ("A scenario",), "system": (system,), "integrators": (["gauss"],),
                "dt": (0.1,), "duration": (1.0,), "samples": (3,), "approaches": (None, True), "against": ((),),
                "tolerances": ({},),
            },
        ),
        "Heartbeat": (orbits.Heartbeat, {"every": (60.0,)}),
        "solar_model": (orbits.solar_model, {"name": ("full",)}),
        "System.in_ephemeris": (
            orbits.System.in_ephemeris,
            {"kernel": ("de440",), "epoch": ("2022-01-01",), "asteroids": (0,), "bodies": (["Sun", "Mars"],)},
        ),
        "megno": (
            orbits.megno,
            {
                "system": (system,), "integrator": ("stormer-verlet",), "dt": (0.1,), "duration": (0.3,),
                "samples": (2,), "vectors": (1, 2), "seed": (0,), "coupled": (False,), "threads": (1,),
            },
        ),
        "state_transition": (
            orbits.state_transition,
            {"system": (system,), "integrator": ("stormer-verlet",), "dt": (0.1,), "duration": (0.3,), "samples": (2,)},
        ),
        "ensemble.clones": (
            ensemble.clones,
            {"system": (system,), "body": ("rock", "Jupiter"), "covariance": (SHORT,), "count": (3,), "seed": (0,)},
        ),
        "ensemble.grid": (
            ensemble.grid, {"what": (system,), "primary": ("Sun",), "a": ([1.0, 2.0],), "e": (0.1, [0.2])},
        ),
        "ensemble.particles": (
            ensemble.particles,
            {"bodies": (system,), "members": ({"q": 3 + np.eye(3), "v": np.eye(3)},), "propagate_to_epoch": (False,)},
        ),
        "ensemble.systems": (ensemble.systems, {"members": ([system],), "names": (None, ["a"])}),
        "catalogue[]": (lambda key: orbits.asteroids(5)[key], {"key": (0, -1, "Ceres", [0, 1], slice(2))}),
        "system[]": (lambda key: system[key], {"key": (0, -1, "Sun")}),
        "run.events[]": (lambda key: run.events[key], {"key": (slice(2), "Sun")}),
        "run.retired[]": (lambda key: run.retired[key], {"key": (slice(2),)}),
        "run.excursions[]": (lambda key: run.excursions[key], {"key": (slice(2),)}),
        "run.elements[]": (lambda name: run.elements("Sun")[name], {"name": ("rock",)}),
        "closest_approaches[]": (
            lambda name, key: run.closest_approaches()[name][key], {"name": ("Sun", "rock"), "key": (slice(2),)},
        ),
        "closest_approaches.to_table": (
            lambda **given: run.closest_approaches().to_table(**given),
            {"bodies": (None, ["rock"]), "within": (None, 9.0), "order": ("distance", "time")},
        ),
        "run.to_pandas": (run.to_pandas, {"bodies": (None, ["Sun"])}),
        "run.rotation.spin": (run.rotation.spin, {"body": ("Sun",)}),
        "run.rotation.obliquity": (run.rotation.obliquity, {"body": ("Sun",), "about": (None,)}),
        "System.solar_system (model)": (
            orbits.System.solar_system,
            {"epoch": ("2022-08-09",), "bodies": (["Sun", "Mars"],), "origin": ("ssb",), "model": ("newtonian",)},
        ),
        "System.add (units)": (
            real.add,
            {"name": ("new", ["x", "y"]), "primary": ("Sun",), "a": (1.5, 2.5 * u.au), "T": (0.0, "2001-01-01")},
        ),
    }  # fmt: skip
