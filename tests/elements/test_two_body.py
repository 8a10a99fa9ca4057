"""The two-body flow is exact: to the floor that the rounding of its inputs sets, for every conic."""

from __future__ import annotations

from typing import Any

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from orbits.elements import elements_from_state, state_from_elements, two_body
from orbits.errors import InputError

from ..coverings import first

TURN = 2.0 * np.pi


def error(got: np.ndarray, expected: np.ndarray) -> np.ndarray:
    return np.linalg.norm(got - expected, axis=-1) / np.linalg.norm(expected, axis=-1)


CONICS = {
    "nearly circular": lambda rng: 10.0 ** rng.uniform(-16, -3),
    "ellipses": lambda rng: rng.uniform(0.0, 0.9),
    "thin ellipses": lambda rng: 1.0 - 10.0 ** rng.uniform(-4, -1),
    "nearly parabolic": lambda rng: 1.0 + rng.choice([-1, 1]) * 10.0 ** rng.uniform(-12, -5),
    "hyperbolas": lambda rng: 1.0 + 10.0 ** rng.uniform(-4, 3.4),
}


@pytest.mark.parametrize("count", first(1, [3, 25]))
@pytest.mark.parametrize("conic", CONICS)
def test_flow_is_at_the_floor_of_its_inputs_rounding(conic: str, count: int, oracle: Any) -> None:
    rng = np.random.default_rng(4)
    for _ in range(count):
        e = CONICS[conic](rng)
        f = rng.uniform(-1, 1) * (np.pi if e < 1 else 0.97 * np.arccos(-1 / e))
        q, v = state_from_elements(1.0, q=1.0, e=e, inc=rng.uniform(0, 3.1), Omega=1.0, omega=2.0, f=f)
        # From a billionth of the time in which the body covers its own distance to a hundred times that, both ways.
        dt = rng.choice([-1, 1]) * 10.0 ** rng.uniform(-9, 2) * np.linalg.norm(q) / np.linalg.norm(v)
        floor = oracle.two_body_floor(q, v, 1.0, dt)
        exact = oracle.two_body(q, v, 1.0, dt)
        # Over 2,000 random orbits the error was at most 3.1 times what half an ulp in every input does.
        for got, true, least in zip(two_body(q, v, 1.0, dt), exact, floor, strict=True):
            assert oracle.relative_error(got, true) <= 4.0 * least


@pytest.mark.parametrize("e", [3.0, 2e3])
def test_a_flyby_is_followed_from_where_its_pericentre_is_a_billionth_of_the_distance(e: float, oracle: Any) -> None:
    """The first anomaly tried passed for the right one, with an end a tenth to hundreds of distances off."""
    here = state_from_elements(1.0, q=1.0, e=e, inc=1.0, Omega=1.0, omega=2.0, f=0.0)
    for T in (1e8, -1e9):
        q, v = two_body(*here, 1.0, -T)
        for dt in (T, 2.5 * T):
            floor, exact = oracle.two_body_floor(q, v, 1.0, dt), oracle.two_body(q, v, 1.0, dt)
            # At the pericentre some roundings of the time show, not only that of dt: 9.3 times were seen.
            for got, true, least in zip(two_body(q, v, 1.0, dt), exact, floor, strict=True):
                assert oracle.relative_error(got, true) <= 12.0 * least


@pytest.mark.parametrize("count", first(1, [3, 25]))
def test_speeds_a_few_roundings_off_the_escape_velocity_are_no_special_case(count: int, oracle: Any) -> None:
    rng = np.random.default_rng(9)
    for _ in range(count):
        q, u = rng.normal(size=3), rng.normal(size=3)
        escape = np.sqrt(2.0 / np.linalg.norm(q)) / np.linalg.norm(u)
        v = u * escape * (1.0 + rng.choice([-1, 1]) * 10.0 ** rng.uniform(-16, -10))
        dt = rng.choice([-1, 1]) * 10.0 ** rng.uniform(-8, 5)
        floor = oracle.two_body_floor(q, v, 1.0, dt)
        exact = oracle.two_body(q, v, 1.0, dt)
        # 0.7 was reached.
        for got, true, least in zip(two_body(q, v, 1.0, dt), exact, floor, strict=True):
            assert oracle.relative_error(got, true) <= 1.5 * least


@pytest.mark.parametrize("dt", [1e-9, 1e-3, 0.5, 10.0, -300.0, 1e6])
def test_exact_parabola_is_followed_too(dt: float, oracle: Any) -> None:
    q, v = [1.0, 0.0, 0.0], [0.0, 1.0, 1.0]
    got, exact = two_body(q, v, 1.0, dt), oracle.two_body(q, v, 1.0, dt)
    # The parabola's start is exact up to rounding; what is left was below 6e-16.
    assert max(oracle.relative_error(a, b) for a, b in zip(got, exact, strict=True)) <= 1e-15


def test_no_time_changes_no_bit_and_a_short_time_keeps_the_increment() -> None:
    rng = np.random.default_rng(6)
    q, v = rng.normal(size=(100, 3)), rng.normal(size=(100, 3))
    still = two_body(q, v, 1.0, 0.0)
    assert np.array_equal(still[0], q)
    assert np.array_equal(still[1], v)
    dt = 1e-10
    moved = two_body(q, v, 1.0, dt)
    kick = -q / np.linalg.norm(q, axis=-1)[:, None] ** 3
    # To first order q + v dt; the next orders are below 1e-19 of the state here.
    assert np.max(np.abs(moved[0] - (q + dt * v))) <= 5e-16
    assert np.max(np.abs(moved[1] - (v + dt * kick))) <= 5e-16


@given(
    e=st.floats(0.0, 0.98) | st.floats(1.02, 50.0), place=st.floats(-0.9, 0.9), inc=st.floats(0, np.pi),
    dt=st.floats(-40.0, 40.0), gm=st.floats(1e-6, 1e6),
)  # fmt: skip
def test_there_and_back_and_in_two_parts(e: float, place: float, inc: float, dt: float, gm: float) -> None:
    limit = np.pi if e < 1 else np.arccos(-1 / e)
    q, v = state_from_elements(gm, q=1.0, e=e, inc=inc, Omega=0.3, omega=1.0, f=place * limit)
    dt /= np.sqrt(gm)
    there = two_body(q, v, gm, dt)
    back = two_body(*there, gm, -dt)
    parts = two_body(*two_body(q, v, gm, 0.3 * dt), gm, 0.7 * dt)
    # There, the state is rounded relative to its own size; a hyperbola that comes back from 100 times its pericentre
    # magnifies that by as much. 200,000 random orbits reached 5.4e-13, 2.2e-13, 3.4e-13 and 2.2e-13.
    assert error(back[0], q) <= 1e-12
    assert error(back[1], v) <= 4e-13
    assert error(parts[0], there[0]) <= 7e-13
    assert error(parts[1], there[1]) <= 4e-13


def test_only_the_mean_anomaly_moves() -> None:
    q, v = state_from_elements(1.0, a=[1.0, -2.0], e=[0.6, 1.5], inc=[0.3, 2.5], Omega=1.0, omega=2.0, M=[-0.4, -3.0])
    before, after = elements_from_state(q, v, 1.0), elements_from_state(*two_body(q, v, 1.0, 2.0), 1.0)
    for key in ("a", "e", "inc", "Omega", "omega"):
        # A few roundings of the state, magnified by 1/(1 - e) and 1/e.
        assert np.allclose(after[key], before[key], rtol=5e-15, atol=0), key
    assert np.allclose(after.M - before.M, 2.0 * before.n, rtol=5e-15, atol=0)


def test_a_thousand_periods_drift_by_no_more_than_the_rounding_of_the_period() -> None:
    q, v = state_from_elements(1.0, a=1.0, e=0.3, f=1.0)
    with mp.workdps(30):
        energy = sum(mp.mpf(x) ** 2 for x in v) / 2 - 1 / mp.sqrt(sum(mp.mpf(x) ** 2 for x in q))
        period = float(2 * mp.pi * (-2 * energy) ** mp.mpf(-1.5))
    got = two_body(q, v, 1.0, 1000.0 * period)
    # 1,000 periods of 2 pi, half an ulp each in energy (times 3/2) and in dt: 1e-12.
    assert error(got[0], q) <= 2e-12


def test_no_orbit_defeats_the_iteration() -> None:
    rng = np.random.default_rng(8)
    n = 20000
    e = np.concatenate([rng.uniform(0, 1, n), 1 - 10.0 ** rng.uniform(-15, 0, n), 1 + 10.0 ** rng.uniform(-15, 3.5, n)])
    e = np.where(e == 1.0, 0.5, e)
    f = rng.uniform(-1, 1, 3 * n) * np.where(e < 1, np.pi, 0.9 * np.arccos(-1 / np.maximum(e, 1.0)))
    q, v = state_from_elements(1.0, q=1.0, e=e, inc=rng.uniform(0, np.pi, 3 * n), f=f)
    dt = rng.choice([-1, 1], 3 * n) * 10.0 ** rng.uniform(-12, 9, 3 * n)
    Q, V = two_body(q, v, 1.0, dt)
    r0, r = np.linalg.norm(q, axis=-1), np.linalg.norm(Q, axis=-1)
    before, after = np.sum(v * v, axis=-1) / 2 - 1 / r0, np.sum(V * V, axis=-1) / 2 - 1 / r
    # Relative to the larger kinetic energy on the way, at pericentre; a rounding of dt moves nothing off the orbit.
    assert np.max(np.abs(after - before) / ((1 + e) / 2)) <= 1e-13


def test_one_state_and_many_times_give_an_orbit() -> None:
    q, v = two_body([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], 1.0, np.linspace(0.0, TURN, 5))
    assert q.shape == v.shape == (5, 3)
    expected = np.array([[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0], [1, 0, 0]], dtype=float)
    assert np.max(np.abs(q - expected)) <= 1e-15


@pytest.mark.parametrize(
    ("q", "v", "gm", "dt", "message"),
    [
        ([1, 0, 0], [1, 0, 0], 1.0, 1.0, "Juno: the motion is straight towards"),
        ([0, 0, 0], [1, 0, 0], 1.0, 1.0, "Juno: the position is that of the attracting body"),
        ([1, 0, 0], [0, 1, 0], 0.0, 1.0, "Juno: gm = 0.0"),
        ([1, 0, 0], [0, 1, 0], 1.0, np.nan, "Juno: dt is nan"),
        ([1, np.inf, 0], [0, 1, 0], 1.0, 1.0, "Juno: position is"),
    ],
)
def test_motion_that_is_no_orbit_is_refused_by_name(q: Any, v: Any, gm: float, dt: float, message: str) -> None:
    with pytest.raises(InputError, match=message):
        two_body(q, v, gm, dt, names=["Juno"])
    with pytest.raises(InputError, match=f"^{message.removeprefix('Juno: ')}"):  # a sentence without a name, too
        two_body(q, v, gm, dt)
