"""The motion within recorded steps, held against partial steps of the same method."""

from typing import ClassVar

import numpy as np
import pytest

import orbits
from orbits.integrators.kicks_and_drifts.splitting import Splitting
from orbits.integrators.stormer_verlet import kick_drift_kick
from orbits.marching.clocks.adaptive import Adaptive
from orbits.marching.clocks.step_times import Place
from orbits.propagation.marchers import bound, march_of
from orbits.system.model import model

from ..acting import Swaying
from ..contracts.problems import methods
from ..coverings import STANDARD, at, first, only
from ..problems import three_bodies
from ..propagation.bodies import DRAG, FLAT, SPIN, three

ALL = [*methods(), orbits.Gauss(stages=12), orbits.methods.Composition(base=orbits.Gauss(stages=2), order=6)]
FORCED = [orbits.Gauss(stages=8), orbits.Gauss(stages=2), orbits.methods.LobattoIIIAB(stages=3), ALL[-1]]
STEPS = 40

# The polynomial has degree s + 1. Where it resolves the motion, only round-off of Mercury's position, 0.3 au, is left.
CASES = [
    ("adaptive", Adaptive(), orbits.Gauss(stages=8), 1e-14),  # 3.9e-15 reached
    ("two-registers", 2.0, orbits.Gauss(stages=12), 4e-16),  # 1.7e-16
    ("four-stages", 0.5, orbits.Gauss(stages=4), 2e-14),  # 7.8e-15
    ("backwards", -2.0, orbits.Gauss(stages=8), 4e-16),  # 1.7e-16
]


@pytest.mark.parametrize(("clock", "method", "bound"), at((0, 2, 3), [c[1:] for c in CASES]), ids=[c[0] for c in CASES])
def test_the_motion_within_a_step_is_that_of_partial_steps(clock, method, bound):
    system = orbits.System.solar_system()
    marcher, again = (march_of(system.values, method, clock, model(system), dense=dense) for dense in (True, False))
    marcher.advance(STEPS)
    motion = marcher.motion()
    assert len(motion) == STEPS
    assert motion.times[-1] == pytest.approx(marcher.time, rel=1e-15)
    rng = np.random.default_rng(1)
    steps, fractions = np.sort(rng.integers(0, STEPS, 60)), rng.random(60)
    q, v = motion.at(steps, fractions)
    times = motion.times[steps] + fractions * np.diff(motion.times)[steps]
    mercury = system.names.index("Mercury")
    for k in np.argsort(times * again.clock.direction):
        place = again.clock.place(times[k])
        again.advance_to(place)
        expected_q, expected_v = again.state_at(place)
        assert abs(q[k] - expected_q)[mercury].max() <= bound
        assert abs(v[k] - expected_v).max() <= 20 * bound
    ends, _ = motion.at(np.arange(STEPS), np.ones(STEPS))
    recorded = motion.path[1:, 0, : 3 * len(system)].reshape(STEPS, 3, -1).transpose(0, 2, 1)
    assert abs(ends - recorded).max() <= 8e-15  # one unit in the last place of Pluto's 30 au


H = 0.15  # of three bodies, as in the tests of what methods declare


def worst_against_partial_steps(system, method, h, steps=25, speeds=1.0):
    marcher, again = (march_of(system.values, method, h, model(system), dense=dense) for dense in (True, False))
    marcher.advance(steps)
    rng = np.random.default_rng(2)
    which, fractions = np.sort(rng.integers(0, steps, 40)), rng.random(40)
    motion, worst = marcher.motion(), 0.0
    for k, theta, q, v in zip(which, fractions, *motion.at(which, fractions), strict=True):
        place = Place(int(k), theta * h)
        again.advance_to(place)
        expected = again.state_at(place)
        worst = max(worst, abs(q - expected[0]).max(), abs(v - expected[1]).max() / speeds)
    return worst


@pytest.mark.parametrize("method", only([*STANDARD, "RungeKutta4()"], ALL), ids=[m.label for m in ALL])
def test_the_motion_of_every_method_is_that_of_its_partial_steps(method):
    """Also of those that do not resolve it at all: half a step of explicit Euler is a step of explicit Euler."""
    system = orbits.System(["a", "b", "c"], *three_bodies(), units=orbits.DIMENSIONLESS)
    # The states in which partial steps begin are rounded; 4.4e-16 was reached. A polynomial serves where it leaves
    # 2e-14 of a position and, as it is once less integrated, 1e-12 of a velocity; 2e-15 and 8e-14 were reached.
    polynomial = method == orbits.Gauss(stages=8)
    bound, speeds = (4e-15, 50.0) if polynomial else (1e-15, 1.0)
    if method.follows_kepler:  # the corrector has 32 stages, there and back; 1.7e-15
        bound = 4e-15
    assert worst_against_partial_steps(system, method, H, speeds=speeds) < bound


def test_where_no_polynomial_is_recorded_the_rough_motion_goes_through_both_ends_of_each_step():
    """Searches that only exclude look at a cubic through the states at the ends."""
    system = orbits.System(["a", "b", "c"], *three_bodies(), units=orbits.DIMENSIONLESS)
    marcher = march_of(system.values, orbits.StormerVerlet(), H, model(system), dense=True)
    marcher.advance(STEPS)
    motion, steps = marcher.motion(), np.arange(STEPS)
    states = motion.path[:, :, :9].reshape(STEPS + 1, 2, 3, 3).swapaxes(2, 3)
    for fraction, ends in ((0.0, states[:-1]), (1.0, states[1:])):
        q, v = motion.roughly_at(steps, np.full(STEPS, fraction))
        assert abs(q - ends[:, 0]).max() <= 1e-15  # 1.1e-16 reached
        assert abs(v - ends[:, 1]).max() <= 5e-15  # 7.8e-16, of differences of positions by h


@pytest.mark.parametrize("method", first(1, FORCED), ids=[m.label for m in FORCED])
def test_the_motion_under_forces_and_terms_that_depend_on_velocities_is_that_of_partial_steps(method):
    gm, q, v = three_bodies()
    system = orbits.System(["planet", "b", "c"], gm, q, v, units=orbits.DIMENSIONLESS)
    system = system.with_terms(SPIN, FLAT, Swaying()).with_forces(DRAG)
    assert worst_against_partial_steps(system, method, 0.05) < 1e-15  # 2.2e-16


def test_a_method_whose_coefficients_are_made_in_python_has_the_same_motion():
    class Unstretched(Splitting):
        kernels: ClassVar = {name: kernel for name, kernel in Splitting.kernels.items() if name != "stretch"}

    class Verlet(orbits.StormerVerlet):
        @property
        def second_order(self):
            return Unstretched(kick_drift_kick, drifts=1)

    system = orbits.System(["a", "b", "c"], *three_bodies(), units=orbits.DIMENSIONLESS)
    assert worst_against_partial_steps(system, Verlet(), H) < 1e-15  # 2.4e-16, as with stretched coefficients


def test_steps_a_thousand_years_on_are_as_exact_as_the_first():
    """The times of the steps are then rounded to 3 microseconds, in which Mercury moves 0.2 metres."""
    system = orbits.System.solar_system()
    marcher = march_of(system.values, orbits.Gauss(stages=8), Adaptive(), model(system), dense=True, start=0.0)
    early = march_of(system.values, orbits.Gauss(stages=8), Adaptive(), model(system), dense=True)
    marcher.stepper.state["clock"][0] = marcher.stepper.state["clock"][10] = 365250.0
    for one in (marcher, early):
        one.advance(20)
    fractions = np.full(20, 0.6)
    late, first = (one.motion().at(np.arange(20), fractions) for one in (marcher, early))
    assert np.array_equal(late[0], first[0])


@pytest.mark.nightly
def test_terms_that_depend_on_time_see_the_time_of_the_run_in_a_leg_that_begins_later():
    system = three().with_terms(SPIN, FLAT, Swaying()).with_forces(DRAG)
    start, how = 2.3, (orbits.Gauss(stages=8), Adaptive(tolerance=1e-3))

    def leg():
        return bound(system, *how, threads=1, start=start, dense=True)

    marched = leg()
    marched.approach(marched.clock.place(6.0))
    motion = marched.motion()
    q, v = motion.at([0, 1], [0.43, 0.43])
    for k in range(2):
        place = marched.clock.place(float(motion.times[k] + 0.43 * motion.lengths[k]) - start)
        again = leg()
        again.advance_to(place)
        there = again.state_at(place)
        # 3e-14 of a velocity, by a polynomial, was reached; without the time before the leg, 3e-3 and 5e-2 of q.
        assert np.allclose([q[k], v[k]], there, rtol=0, atol=1e-13)
