"""Massless particles that stay within the reach of a planet: each passage is listed, though distances hardly change."""

import numpy as np

import orbits
from orbits.elements import state_from_elements
from orbits.kernels.search.record import MATE, ROW, STEP
from orbits.lagrangians.newtonian import newtonian, parameters
from orbits.marching.legs.leg import Leg

from ..coverings import cover

METHODS = {
    "map": (orbits.WisdomHolman(kernel="standard", corrector=0), 0.1),
    "kicks and drifts": (orbits.StormerVerlet(), 0.02),
}


def around_a_planet(rng: np.random.Generator) -> tuple[np.ndarray, ...]:
    """A star, a planet, and massless particles at similar distances that begin near it."""
    planet = state_from_elements(1.001, a=1.0, e=0.05, inc=0.0, Omega=0.0, omega=0.0, M=0.0)
    states = [np.zeros((2, 3)), np.array(planet)]
    for _ in range(60):
        shape = {"a": rng.uniform(0.93, 1.07), "e": rng.uniform(0.0, 0.08), "inc": 0.03 * rng.random()}
        angles = {"Omega": 0.0, "omega": rng.uniform(-3.0, 3.0)}
        angles["M"] = rng.uniform(-0.35, 0.35) - angles["omega"]
        states.append(np.array(state_from_elements(1.0, **shape, **angles)))
    q, v = np.array(states).transpose(1, 0, 2)
    return np.array([1.0, 1e-3] + [0.0] * 60), q, v


@cover(("name", "looks"), METHODS, [True, False], strength=1)
def test_every_passage_of_particles_within_the_reach_of_a_planet_is_listed(name, looks):
    (method, h), found = METHODS[name], 0
    for seed in range(3):
        gm, q, v = around_a_planet(np.random.default_rng(seed))
        march, whole = (
            Leg.of(newtonian, method, parameters(gm[:2]), gm > 0, q, v, h, approaches=looks) for _ in range(2)
        )
        steps = round(6.0 / h)
        states = [march.state()]
        for _ in range(steps):
            march.advance(1)
            states.append(march.state())
        whole.advance(steps)
        listed = {(int(row[ROW]), int(row[MATE]), int(row[STEP])) for row in whole.listing.passages.passages}
        x, u = (np.array(part) - np.array(part)[:, 1:2] for part in zip(*states, strict=True))
        opening, distance = (x * u).sum(axis=2), np.linalg.norm(x, axis=2)
        free = 0.5 * (u * u).sum(axis=2)[:, 2:] > 1e-3 / distance[:, 2:]
        turned = (opening[:-1, 2:] < 0.0) & (opening[1:, 2:] >= 0.0) & free[:-1]
        near = np.maximum(distance[:-1], distance[1:])[:, 2:] < 0.95 * whole.observers.listed_within[1]
        for k, particle in np.argwhere(turned & near):
            assert (particle + 2, 1, k) in listed
            found += 1
    assert found > 50
