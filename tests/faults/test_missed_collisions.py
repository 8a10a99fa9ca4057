"""Collisions of bodies that are small against their way in a step: none may be missed, by any method and action."""

from itertools import combinations
from typing import Any

import numpy as np
import pytest

import orbits
from orbits.errors import ConvergenceError
from orbits.events import Collision, Merge
from orbits.methods import Composition
from tests.propagation.meeting import contact, near_a_planet, passing, planetesimals

METHODS: list[Any] = [
    orbits.Gauss(stages=8), orbits.Gauss(stages=2), orbits.methods.ImplicitMidpoint(), orbits.StormerVerlet(),
    Composition(orbits.StormerVerlet(), order=4), orbits.methods.SymplecticEuler(), orbits.methods.RungeKutta4(),
]  # fmt: skip


@pytest.mark.faults
@pytest.mark.parametrize("method", METHODS, ids=repr)
@pytest.mark.parametrize("second", [1e-20, 0.0], ids=["massive", "massless"])
def test_bodies_that_pass_within_a_step_touch_when_straight_lines_do(method, second):
    for exponent in range(7):
        for phase in (0.03, 0.5, 0.97):
            for then in (Merge(), "stop", "record"):
                system = passing(10.0**exponent, phase, 0.7, (1e-20, second))
                run = orbits.propagate(
                    system, method, dt=1.0, duration=6.0, events=Collision(then=then), check_step=False
                )
                assert len(run.events) == 1, (exponent, phase, then)
                assert abs(run.events.time[0].value - contact(10.0**exponent, phase, 0.7)) < 1e-13


@pytest.mark.faults
@pytest.mark.parametrize("dt", [None, 0.3, 0.05], ids=str)
@pytest.mark.parametrize("seed", range(5))
def test_all_collisions_of_small_planetesimals_are_found(dt, seed):
    for gm in (1e-16, 1e-13):
        for second in (gm, 0.0):
            for then in (Merge(), "record", orbits.events.Bounce()) if second else (Merge(), "record"):
                system = planetesimals(seed, gm, second)
                run = orbits.propagate(system, dt=dt, duration=12.0, events=Collision(then=then), check_step=False)
                assert {f"a{k}" for k in range(12)} == {event.body for event in run.events} - {"star"}


@pytest.mark.faults
@pytest.mark.parametrize("method", [*METHODS[3:6], METHODS[0]], ids=repr)
def test_contacts_in_partial_steps_are_those_of_samples_between(method):
    # A step of 0.3 radians, 100 samples in each: chords shorter than that of a spacing, 0.003, are not seen in samples.
    system = planetesimals(0, 1e-13, 0.0, radius=0.02)
    samples = np.linspace(0.0, 6.0, 2001)
    times: dict[str, Any] = {"duration": 6.0, "samples": samples}
    run = orbits.propagate(system, method, dt=0.3, **times, events=Collision(), check_step=False)
    q, massive, reach = run.q.value, system.massive, np.add.outer(system.radii.value, system.radii.value)
    for i, j in combinations(range(len(system)), 2):
        outside = np.linalg.norm(q[:, i] - q[:, j], axis=1) > reach[i, j]
        entered = np.flatnonzero(outside[:-1] & ~outside[1:]) if massive[i] or massive[j] else np.array([])
        pair = {system.names[i], system.names[j]}
        times = [event.time.value for event in run.events if {event.body, event.other} == pair]
        assert all(any(samples[k] <= t <= samples[k + 1] for t in times) for k in entered)
        for t in times:
            k = int(np.searchsorted(samples, t))
            near = np.linalg.norm(q[k - 1 : k + 1, i] - q[k - 1 : k + 1, j], axis=1)
            assert near.min() < reach[i, j] + 0.01


@pytest.mark.faults
def test_all_collisions_of_small_bodies_near_a_planet_are_found():
    met = 0
    for seed in range(150):
        system, step, time = near_a_planet(seed)
        how: dict[str, Any] = {"dt": step, "samples": [0.0, time, step], "check_step": False}
        try:
            run = orbits.propagate(system, orbits.Gauss(), duration=step, events=Collision(), **how)
        except ConvergenceError:  # the following step, after which one falls to the planet, is too long
            continue
        apart = float(np.linalg.norm(run.q.value[1, 3] - run.q.value[1, 2]))
        if apart < 2e-8:  # the step is short enough for the passage of the planet
            met += 1
            assert len(run.events) == 1, seed
    assert met > 130
