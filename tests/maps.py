"""Planets and particles for Wisdom–Holman maps, and how tests march them."""

import json

import numpy as np

import orbits
from orbits.elements import state_from_elements
from orbits.lagrangians.newtonian import newtonian, parameters
from orbits.marching.legs.leg import Leg
from orbits.resources import data_path

KM = 149597870.7

_BOUNDS = json.loads(data_path("rebound_test_bounds.json").read_text())
BOUNDS = {row["name"]: row["asserts"] for row in _BOUNDS["tests"]}
REACHED = _BOUNDS["reached"]
"""What REBOUND's own tests assert, and what it reached in them."""

EVERYWHERE = {  # semi-major axis, eccentricity: the number of planets inside it
    (1.3, 0.1): 3,
    (2.7, 0.15): 4,
    (2.8, 0.5): 3,
    (7.0, 0.05): 5,
    (17.8, 0.967): 1,
    (45.0, 0.05): 8,
    (-20.0, 1.1): 4,
}
"""Orbits among the planets; the comet and the unbound body pass their pericentres in 500 days."""


def among_planets(orbits_of=EVERYWHERE):
    """The Sun and eight planets, in au and days, with massless particles."""
    solar = orbits.System.solar_system().remove("Pluto")
    gm, q, v = solar.values.gm, solar.values.q, solar.values.v
    rng = np.random.default_rng(4)
    for a, e in orbits_of:
        angles = dict(zip(("inc", "Omega", "omega"), np.radians(rng.uniform([0, 0, 0], [15, 360, 360])), strict=True))
        when = {"M": rng.uniform(0, 2 * np.pi)} if e < 0.9 else {"T": 500.0, "t": 0.0}
        x, w = state_from_elements(gm[0], a=a, e=e, **angles, **when)
        q, v = np.vstack([q, x + q[0]]), np.vstack([v, w + v[0]])
    return np.append(gm, np.zeros(len(orbits_of))), q, v


def marcher(method, gm, q, v, h, **options):
    return Leg.of(newtonian, method, parameters(gm[gm > 0]), gm > 0, q, v, h, **options)


def marched(method, gm, q, v, h, steps, **options):
    run = marcher(method, gm, q, v, h, **options)
    run.advance(steps)
    return run.state()


def system(orbits_of=EVERYWHERE):
    gm, q, v = among_planets(orbits_of)
    solar = orbits.System.solar_system().remove("Pluto")
    names = [*solar.names, *(f"p{k}" for k in range(len(orbits_of)))]
    return orbits.System.from_states(names, gm, q, v, units=solar.units, epoch=solar.epoch)


def solar_system(count=9):
    """GM, q, v of the Sun and the first planets, and where the ten bodies are after 1000 years."""
    data = json.loads(data_path("solar_system_10body.json").read_text())
    gm, q, v = (np.array(data[name])[: count + 1] for name in ("gm_au3_d2", "q", "v"))
    return gm, q, v, np.array(data["reference_years"]["1000"], dtype=float)[:, :3]


def energies(method, start, h, steps):
    """The energy at 40 times of a run, and at its end."""
    run = Leg.of(newtonian, method, parameters(start.gm), start.gm > 0, start.q, start.v, h)
    found = []
    for _ in range(40):
        found.append(newtonian_energy(start.gm, *run.state()))
        run.advance(steps // 40)
    run.advance(steps - steps // 40 * 40)
    return np.array([*found, newtonian_energy(start.gm, *run.state())])


def newtonian_energy(gm, q, v):
    i, j = np.triu_indices(len(gm), 1)
    apart = np.linalg.norm(q[i] - q[j], axis=1)
    return 0.5 * (gm * (v**2).sum(axis=1)).sum() - (gm[i] * gm[j] / apart).sum()
