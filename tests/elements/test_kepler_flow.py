"""`orbits.kepler_flow`: units, shapes, what it refuses, and the bounds that REBOUND's own tests set for its solver."""

from __future__ import annotations

from typing import Any

import mpmath as mp
import numpy as np
import pytest
from astropy import constants
from astropy import units as u

import orbits
from orbits import kepler_flow
from orbits.elements import state_from_elements
from orbits.errors import InputError

from ..coverings import each
from ..kepler_truth import flow

TURN = 2.0 * np.pi


def energy(q: Any, v: Any, gm: float = 1.0) -> Any:
    return np.sum(v * v, axis=-1) / 2 - gm / np.linalg.norm(q, axis=-1)


def test_plain_numbers_in_any_consistent_units_give_plain_arrays() -> None:
    q, v = kepler_flow([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], 1.0, TURN / 4)
    assert type(q) is type(v) is np.ndarray
    assert np.max(np.abs(q - [0, 1, 0])) <= 2e-16
    assert np.max(np.abs(v - [-1, 0, 0])) <= 2e-16


def test_quantities_give_quantities_in_the_units_of_q_and_v() -> None:
    q, v = [1.0, 0.1, 0.2] * u.au, [5.0, 25.0, -3.0] * (u.km / u.s)
    new_q, new_v = kepler_flow(q, v, constants.GM_sun, 1.5 * u.yr)
    assert new_q.unit == u.au
    assert new_v.unit == u.km / u.s
    plain = kepler_flow(q.to_value(u.m), v.to_value(u.m / u.s), constants.GM_sun.value, (1.5 * u.yr).to_value(u.s))
    # The conversions round, a year and a half magnifies that some tens of times.
    assert np.max(np.abs(new_q.to_value(u.m) / plain[0] - 1)) <= 1e-13
    assert np.max(np.abs(new_v.to_value(u.m / u.s) / plain[1] - 1)) <= 1e-13
    (x, _, _), _ = kepler_flow([1 * u.au, 0 * u.au, 0 * u.au], v, constants.GM_sun, 0 * u.s)
    assert x == 1 * u.au


def test_everything_broadcasts() -> None:
    q, v = np.ones((4, 1, 3)), np.array([0.0, 0.1, 0.5])
    for gm, dt, shape in (
        (1.0, 0.1, (4, 1)),
        (np.ones((4, 1)), np.linspace(0, 1, 5), (4, 5)),
        (1.0, np.ones(0), (4, 0)),
    ):
        new_q, new_v = kepler_flow(q, v, gm, dt)
        assert new_q.shape == new_v.shape == (*shape, 3)
    many = kepler_flow(q, v, 1.0, np.linspace(0.0, 1.0, 5))
    one = kepler_flow([1.0, 1.0, 1.0], v, 1.0, 0.75)
    assert np.array_equal(many[0][2, 3], one[0])
    assert np.array_equal(many[1][2, 3], one[1])


def test_units_of_any_size_give_the_same_digits() -> None:
    q, v = np.array([1.0, 0.3, -0.2]), np.array([0.1, 1.1, 0.4])
    plain = kepler_flow(q, v, 1.0, 40.0)
    for length, time in ((2.0**300, 2.0**200), (2.0**-300, 2.0**-310), (2.0**150, 2.0**-100)):
        new_q, new_v = kepler_flow(q * length, v * (length / time), length**3 / time**2, 40.0 * time)
        assert np.array_equal(new_q / length, plain[0])
        assert np.array_equal(new_v / (length / time), plain[1])


@each(
    ("q", "v", "gm", "dt", "message"),
    [
        ([0, 0, 0], [1, 0, 0], 1.0, 1.0, "the position is that of the attracting body"),
        ([1, 0, 0], [0, 1, 0], -1.0, 1.0, r"gm = -1.0 .* expected >= 0"),
        ([1, 0, 0], [0, 1, 0], 1.0, np.nan, "dt is nan"),
        ([1, 0, 0], [0, 1, 0], np.inf, 1.0, "gm is inf"),
        ([1, np.nan, 0], [0, 1, 0], 1.0, 1.0, "position is"),
        ([1, 0], [0, 1, 0], 1.0, 1.0, r"shape \(2,\)"),
        ([[1, 0, 0], [2, 0, 0]], [0, 1, 0], [1.0, 1.0, 1.0], 1.0, "shapes do not fit"),
        ([1, 0, 0], [0, 1, 0], "one", 1.0, "gm is 'one'"),
        ([1, 0, 0], [0, 1j, 0], 1.0, 1.0, "v is .*got complex numbers"),
        ([1, 0, 0] * u.au, [0, 1, 0], 1.0, 1.0, "v has no unit, but q is in AU"),
        ([1, 0, 0], [0, 1, 0], 1.0, 1.0 * u.day, "q has no unit, but dt is in d"),
        ([1, 0, 0] * u.au, [0, 1, 0] * u.km, 1 * u.au**3 / u.day**2, 1 * u.day, "v is in km; expected velocity"),
        ([1, 0, 0] * u.au, [0, 1, 0] * u.km / u.s, 1 * u.kg, 1 * u.day, "gm is in kg; expected GM"),
        ([1, 0, 0] * u.day, [0, 1, 0] * u.km / u.s, 1 * u.kg, 1 * u.day, "q is in d; expected length, such as u.AU"),
        ([1, 0, 0] * u.au, [0, 1, 0] * u.km / u.s, 1 * u.kg, 1 * u.m, "dt is in m; expected time, such as u.d"),
        ("x", [0, 1, 0], 1.0, 1.0, r"q is 'x'; expected numbers or a quantity, of shape \(..., 3\) \(got text\)"),
        ([1, 0, 0], [0, 1e200, 0], 1.0, 1e200, "would be beyond the range of floats"),
        ([1e-30, 0, 0], [0, 1e15, 0], 1.0, 1e300, "would be beyond the range of floats"),
        ([1, 0, 0], [0, 1e300, 0], 1.0, 1e300, "beyond the range of floats"),
    ],
)
def test_bad_input_is_refused_with_what_is_wrong(q: Any, v: Any, gm: Any, dt: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        kepler_flow(q, v, gm, dt)


def test_one_step_of_a_very_fast_flyby_is_right_to_the_last_digit() -> None:
    q, v, dt = [1.0, 0.0, 0.0], [0.0, 1e5, 0.0], 1.234567
    (_, y, _), _ = kepler_flow(q, v, 1.0, dt)
    with mp.workdps(40):
        (_, exact, _), _, _ = flow(q, v, 1.0, dt)
        # REBOUND's bound, but against the true y, which is 1e-10 short of the straight line's.
        assert abs(float(y / exact - 1)) < 1e-15


def test_a_circle_in_steps_of_four_and_a_half_periods_comes_back_after_a_thousand() -> None:
    q, v = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
    for _ in range(219):
        q, v = kepler_flow(q, v, 1.0, 4.56 * TURN)
    q, v = kepler_flow(q, v, 1.0, 1000.0 * TURN - 219 * 4.56 * TURN)
    assert abs(q[0] - 1.0) < 1e-11  # REBOUND's bound
    # The phase is off by what 220 energy errors of some 3 x 2^-53 add up to over a thousand periods: 4e-11 is expected
    # of a random walk, 6e-11 was reached.
    assert abs(q[1]) < 2e-10


def test_energy_of_a_hyperbola_in_long_steps_keeps_to_its_rounding() -> None:
    q, v = state_from_elements(1.001, a=-1.0, e=2.5)
    before = worst = energy(q, v, 1.001)
    for _ in range(219):
        q, v = kepler_flow(q, v, 1.001, 4.56 * TURN)
        worst = max(worst, energy(q, v, 1.001), key=lambda E: abs(E - before))
    assert abs(worst - before) < 1e-14  # REBOUND's bound; 5e-16 was reached


@pytest.mark.parametrize(
    ("orbit", "bound"),
    [({"a": -1.0, "e": 2.5}, 1e-14), ({"a": 1.4, "e": 0.0125, "omega": 0.3, "Omega": 0.4, "inc": 0.1}, 1e-13)],
    ids=["hyperbola", "ellipse"],
)
def test_a_hundred_steps_there_and_back_lead_to_the_start(orbit: dict[str, float], bound: float) -> None:
    gm = 1.001
    start = state_from_elements(gm, **orbit)
    q, v = start
    dt = 0.0512 * TURN * np.sqrt(abs(orbit["a"]) ** 3 / gm)
    for h in [dt] * 100 + [-dt] * 100:
        q, v = kepler_flow(q, v, gm, h)
    # REBOUND's bounds.
    assert abs(energy(q, v, gm) / energy(*start, gm) - 1) < bound
    assert abs(q[0] / start[0][0] - 1) < bound
    assert abs(v[0] - start[1][0]) / np.linalg.norm(v) < bound


def test_it_is_a_public_name() -> None:
    assert orbits.kepler_flow is kepler_flow
