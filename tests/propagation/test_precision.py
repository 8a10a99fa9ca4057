"""What the digits of float64, and a tolerance, leave of a run: far from the origin, and with loose tolerances."""

import warnings

import numpy as np
import pytest
from astropy import units as u

import orbits
from orbits.errors import InputError, OrbitsWarning, StepWarning
from orbits.propagation.checks.precision import warn_if_far

from ..coverings import cover
from ..problems import kepler, three_bodies
from .bodies import system

PLACE = np.array([1.0, 0.3, 0.7])


def propagate(start, duration, **options):
    return orbits.propagate(start, duration=duration, progress=False, **options)


def moved(start, distance):
    """Return a system far from the origin, and the same bodies, as rounded there, brought back exactly."""
    far = start.replaced(q=start.q.value + distance * PLACE)
    return far, start.replaced(q=far.q.value - distance * PLACE)


@pytest.mark.filterwarnings("ignore::orbits.errors.OrbitsWarning")
@cover(("masses", "distance"), ["pair", "planets"], [1e6, 1e8, 1e10], strength=1)
def test_the_steps_of_bodies_far_from_the_origin_are_those_near_it(masses, distance):
    """The same number to 2 %, and separations to the rounding of their samples; a lost low part cost ten thousand times
    as many steps at 1e7.
    """
    start = system(*kepler(0.5)) if masses == "pair" else system(*giants())
    far, near = moved(start, distance)
    there, here = propagate(far, 20.0, samples=5), propagate(near, 20.0, samples=5)
    assert there.statistics.steps == pytest.approx(here.statistics.steps, rel=0.02)
    apart = [run.q.value[:, 1:] - run.q.value[:, :1] for run in (there, here)]
    assert np.abs(apart[0] - apart[1]).max() <= 2.0 * np.spacing(distance)


def giants():
    """Return a star with five planets, the inner one light: more bodies than have all pairs in doubled precision."""
    a, angle = np.array([1.0, 2.1, 3.7, 5.5, 9.0]), np.array([0.0, 2.0, 4.0, 1.0, 3.0])
    q, v = np.zeros((6, 3)), np.zeros((6, 3))
    q[1:, 0], q[1:, 1] = a * np.cos(angle), a * np.sin(angle)
    v[1:, 0], v[1:, 1] = -np.sin(angle) / np.sqrt(a), np.cos(angle) / np.sqrt(a)
    return np.array([1.0, 1e-6, 1e-3, 3e-4, 5e-5, 4e-5]), q, v


@pytest.mark.parametrize("start", ["far", "fast"])
def test_few_digits_of_separations_are_said_before_the_run(start):
    gm, q, v = kepler(0.5)
    bodies = system(gm, q + 1e9 * PLACE, v) if start == "far" else system(gm, q, v + 1e9 * PLACE)
    with pytest.warns(OrbitsWarning, match=r"1e\+09 from the origin.* rounded to 6e-08: .* 6 digits .*barycentric"):
        propagate(bodies, 1.0, samples=2)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        propagate(bodies.barycentric(), 1.0, samples=2)
        propagate(bodies, 1.0, samples=2, check_step=False)
        propagate(system(gm, q + 1e5 * PLACE, v), 1.0, samples=2)  # 11 digits


def test_a_close_pair_among_others_is_no_matter_of_the_origin():
    """Two bodies 1e-9 apart at a distance of 1, which no other origin would serve better."""
    gm, q = [1.0, 1e-12, 1e-12], np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1e-9, 0.0]])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        propagate(system(gm, q, np.array([[0.0, 0, 0], [0, 1, 0], [0, 1, 0.045]])), 1e-6, samples=2)


@pytest.mark.parametrize("tolerance", [0.1, 3e-3])
def test_tolerances_that_lead_to_wrong_orbits_are_refused_with_the_error(tolerance):
    with pytest.raises(InputError, match=r"expected 1e-12 ... 0.001. It is not the error of the run: .* by 3 %"):
        orbits.Adaptive(tolerance=tolerance)


def test_a_tolerance_below_round_off_is_refused_with_what_is_reachable():
    with pytest.raises(InputError, match=r"it is round-off that would be resolved. With 8 stages 1e-9 leaves nothing"):
        orbits.Adaptive(tolerance=9e-13)


def test_the_tightest_tolerance_gets_through_close_encounters():
    """Burrau's problem: with 1e-13, steps collapse in the encounter at t = 1.9, as its forces have 13 digits."""
    start = system([3, 4, 5], [[1, 3, 0], [-2, -1, 0], [1, -1, 0]], np.zeros((3, 3)))
    run = propagate(start, 63.0, dt=orbits.Adaptive(tolerance=1e-12), samples=2)
    assert run.statistics.steps < 20_000  # 8,000
    assert run.drift().energy.max_fraction < 1e-13  # 2e-14


def test_an_energy_that_is_more_wrong_than_the_tolerance_is_said_after_the_run():
    """1.6e-3 is the error with the largest tolerance after a hundred turns of e = 0.9, 2e-6 with a tenth of it."""
    start = system(*kepler(0.9))
    with pytest.warns(StepWarning, match=r"tolerance of 0.001, the energy is wrong by 0.00.* default, 1e-09") as caught:
        run = propagate(start, 200 * np.pi, dt=orbits.Adaptive(tolerance=1e-3))
    assert f"{run.drift().energy.last_fraction:.2g}" in str(caught[0].message)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        propagate(start, 200 * np.pi, dt=orbits.Adaptive(tolerance=1e-4))
        propagate(system(*three_bodies()), 20.0, dt=orbits.Adaptive(tolerance=1e-3), check_step=False)


def test_a_warning_of_energy_that_is_an_error_has_the_run():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(StepWarning) as caught:
            propagate(system(*kepler(0.9)), 200 * np.pi, dt=orbits.Adaptive(tolerance=1e-3))
    assert len(caught.value.trajectory) == 101


def test_a_run_so_long_that_rounding_errors_spoil_the_phase_says_so():
    start = system(*kepler(0.9))
    with pytest.warns(OrbitsWarning, match=r"about 2e\+11 turns .* leave nothing of its phase"):
        propagate(start, 1e12, callback=lambda t, state: True)
    with pytest.warns(OrbitsWarning, match=r"its phase wrong by about 0.4 rad .* shape of its orbit is not concerned"):
        propagate(start, 1e11, callback=lambda t, state: True)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        propagate(start, 1e9, callback=lambda t, state: True)


def test_units_are_named_in_the_message_about_the_origin():
    sun = orbits.System.solar_system("2022-08-09", bodies=["Sun", "Jupiter"])
    far = sun.replaced(q=sun.q + 8.0 * u.kpc)
    with pytest.warns(OrbitsWarning, match=r"AU from the origin"):
        propagate(far, 1.0 * u.day, samples=2)


def test_a_separation_that_is_nothing_beside_rounding_has_no_digits():
    """Their ratio underflowed, and its logarithm ended the run with an error of Python."""
    q, v = [[1e300, 0, 0], [1e300, 5e-324, 0]], [[0, 0, 0], [0, 1, 0]]
    far = orbits.System(["a", "b"], [1.0, 0.5], q, v, units=orbits.DIMENSIONLESS)
    with pytest.warns(OrbitsWarning, match="has 0 digits at the start"):
        warn_if_far(far, 1.0)
