"""Collisions of bodies that are small against their way in a step; the long form is in tests/faults."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import orbits
from orbits.events import Collision, Merge
from orbits.kernels.search.collisions import NEVER, fraction_of_contact
from tests.coverings import first
from tests.propagation.meeting import contact, near_a_planet, passing, planetesimals

HOW: Any = pytest.mark.parametrize("dt", [None, 0.3], ids=["adaptive", "constant"])


@HOW
@pytest.mark.parametrize("second", first(1, [1e-13, 0.0]), ids=["massive", "massless"])
def test_all_collisions_of_small_planetesimals_are_found(dt: float | None, second: float) -> None:
    # In a step the way relative to each other is some thousand times the sum of the radii; 0 to 3 were found.
    for then in (Merge(), "record"):
        system = planetesimals(0, 1e-13, second, count=6)
        run = orbits.propagate(system, dt=dt, duration=12.0, events=Collision(then=then), check_step=False)
        assert {f"a{k}" for k in range(6)} == {event.body for event in run.events} - {"star"}


def test_collisions_of_a_pair_that_goes_through_one_point_are_found_where_no_partial_step_leads() -> None:
    """The whole step leaps over it; the search ended the run with a ConvergenceError."""
    run = orbits.propagate(planetesimals(2, 1e-13, 1e-13), dt=0.3, duration=12.0, events=Collision(), check_step=False)
    assert {event.body for event in run.events} == {f"a{k}" for k in range(12)}


@pytest.mark.parametrize("way", [1.0, 1e2, 1e4, 1e6])
def test_bodies_that_pass_within_a_step_touch_when_straight_lines_do(way: float) -> None:
    for phase, then in ((0.1, Merge()), (0.5, "stop"), (0.93, "record"), (0.5, orbits.events.Bounce())):
        system = passing(way, phase, 0.5, (1e-20, 1e-20))
        run = orbits.propagate(system, dt=1.0, duration=6.0, events=Collision(then=then), check_step=False)
        assert len(run.events) == 1, (phase, then)
        # Times near 4 have an ulp of 9e-16; positions near 8 way one of 2e-15 way, on a way of 2 way in a unit of time.
        assert abs(run.events.time[0].value - contact(way, phase, 0.5)) < 1e-14


def test_the_first_contact_of_a_cubic_is_that_of_a_fine_search_and_none_is_passed_over() -> None:
    rng = np.random.default_rng(5)
    s = np.linspace(0.0, 1.0, 5001)[:, None]
    touched = 0
    for _ in range(300):
        x0, x1 = rng.normal(size=(2, 3))
        u0, u1 = rng.normal(size=(2, 3)) * rng.choice([1.0, 5.0])
        a, b = x1 - x0 - u0, u1 - u0
        distance = np.linalg.norm(x0 + s * (u0 + s * ((3.0 * a - b) + s * (b - 2.0 * a))), axis=1)
        reach = float(distance.min()) * rng.choice([0.99, 1.01])
        if np.linalg.norm(x0) <= reach or np.linalg.norm(x1) <= reach:
            continue
        ends = (*x0.tolist(), *u0.tolist()), (*x1.tolist(), *u1.tolist())
        part = fraction_of_contact(*ends, 1.0, reach, 0.0, 0.0)
        inside = np.flatnonzero(distance < reach)
        if len(inside):
            touched += 1
            assert part <= s[inside[0], 0]
            assert fraction_of_contact(*ends, 1.0, reach, 0.1, 0.0) < part
    assert touched > 100
    straight = (-1e6, 1.5, 0.0, 2e6, 0.0, 0.0), (1e6, 1.5, 0.0, 2e6, 0.0, 0.0)
    assert fraction_of_contact(*straight, 1.0, 1.4999, 0.0, 0.0) == NEVER
    assert fraction_of_contact(*straight, 1.0, 1.5001, 0.0, 0.0) == pytest.approx(0.5, abs=1e-8)


@pytest.mark.parametrize("seed", first(2, [18, 167, 180, 182, 193]))
def test_a_collision_near_a_planet_whose_pull_cancels_the_tide_of_the_star_is_found(seed: int) -> None:
    # The cubics are off by 4e3 to 4e5 times the sum of the radii, 1.02 to 2.1 times what their ends alone let expect.
    system, step, time = near_a_planet(seed)
    run = orbits.propagate(system, orbits.Gauss(), dt=step, duration=step, events=Collision(), check_step=False)
    assert [event.body for event in run.events] == ["a"]
    # They touch 1e-8 to 3e-8 earlier on a way of 0.02 to 0.25 in the step: 2e-6 of it at most.
    assert abs(run.events.time[0].value - time) < 2e-6 * step


@pytest.mark.parametrize("then", ["record", Merge()], ids=["record", "merge"])
def test_a_bullet_hits_all_targets_in_one_step_of_theirs(then: Any) -> None:
    # They take steps of 1e7 units of time, and it 1e-5 from one to the next: its steps were too short for theirs.
    q, v = np.zeros((4, 3)), np.zeros((4, 3))
    q[:3, 0], q[3, 1], v[3, 0] = 10.0 * np.arange(1, 4), 9e-6, 1e6
    gm, radii = [1e-12] * 3 + [0.0], [1e-5] * 3 + [0.0]
    system = orbits.System([*"abc", "bullet"], gm=gm, q=q, v=v, radii=radii, units=orbits.DIMENSIONLESS)
    run = orbits.propagate(system, duration=1e-4, events=Collision(then=then))
    expected = 3 if then == "record" else 1
    assert [event.body for event in run.events] == list("abc")[:expected]
    half = np.sqrt(1e-10 - 8.1e-11)
    assert run.events.time.value == pytest.approx(1e-6 * (q[:expected, 0] - half), rel=1e-12)


def test_bodies_side_by_side_do_not_touch_in_partial_steps_of_low_order() -> None:
    # Room for partial steps, which move bodies otherwise than their velocities say, is no contact at the end of a step.
    q, v = [[0, 0, 0], [1, 0, 0], [1.105, 0, 0]], [[0, 0, 0], [0, 1, 0], [0, 1, 0]]
    sizes = {"gm": [1, 1e-14, 0], "radii": [1e-3, 0.05, 0.05]}
    system = orbits.System(list("sab"), q=q, v=v, **sizes, units=orbits.DIMENSIONLESS)
    times: dict[str, Any] = {"duration": 0.9, "samples": 91}
    for method in (orbits.methods.SymplecticEuler(), orbits.StormerVerlet()):
        run = orbits.propagate(system, method, dt=0.3, **times, events=Collision(), check_step=False)
        distance = np.linalg.norm(run.q.value[:, 2] - run.q.value[:, 1], axis=1)
        assert len(run.events) == np.count_nonzero((distance[:-1] > 0.1) & (distance[1:] <= 0.1)) == 0
