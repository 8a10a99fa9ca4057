"""Elements to states and back: against 50 digits and each other, in every degenerate case, and by REBOUND's names."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import rebound
from hypothesis import given
from hypothesis import strategies as st

from orbits.elements import Elements, elements_from_state, state_from_elements
from orbits.errors import InputError

from ..coverings import each

TURN = 2.0 * np.pi
angle = st.floats(0.0, TURN)


def error(got: np.ndarray, expected: np.ndarray) -> np.ndarray:
    return np.linalg.norm(got - expected, axis=-1) / np.linalg.norm(expected, axis=-1)


def angle_error(got: Any, expected: Any) -> float:
    return float(np.max(np.abs((np.asarray(got) - expected + np.pi) % TURN - np.pi)))


# Bounds are twice what hundreds of random orbits reached. M from l, and f from theta, is a difference of angles up to
# 2 pi, rounded to 4e-16, and moves the state by dE/dM or dr/df times that, which grow as a power of 1/(1 - e); so does
# the rounding of M itself.
RANGES = [
    # e from, to; M, E, f; l, theta
    (0.0, 0.5, 1.0e-15, 4e-15),
    (0.5, 0.9, 1.5e-15, 2e-14),
    (0.9, 0.99, 4e-15, 1e-12),
    (0.999, 0.9999, 4e-14, 1e-9),
    (1.0001, 1.01, 1.5e-15, 1e-9),
    (1.01, 2.0, 1.5e-15, 2e-14),
    (2.0, 3000.0, 4e-15, 1e-14),
]


@pytest.mark.parametrize(("low", "high", "bound", "bound_longitude"), RANGES)
@pytest.mark.parametrize("kind", ["M", "E", "f", "l", "theta"])
def test_state_from_elements_agrees_with_50_digits(
    kind: str, low: float, high: float, bound: float, bound_longitude: float, oracle: Any
) -> None:
    rng = np.random.default_rng(5)
    for e in rng.uniform(low, high, 12):
        inc, Omega, omega = rng.uniform(0, np.pi / 2), *rng.uniform(0, TURN / 2, 2)
        a = 1.5 if e < 1.0 else -1.5
        limit = np.pi if e < 1.0 else 0.95 * np.arccos(-1.0 / e)
        where = rng.uniform(-1, 1) * (4.0 if kind in ("M", "E", "l") else limit)
        if kind in ("l", "theta"):
            where += Omega + omega
        q, v = state_from_elements(1.3, a=a, e=e, inc=inc, Omega=Omega, omega=omega, **{kind: where})
        Q, V = oracle.state_from_elements(1.3, a, e, inc, Omega, omega, kind, where)
        limit = bound_longitude if kind in ("l", "theta") else bound
        assert oracle.relative_error(q, Q) <= limit
        assert oracle.relative_error(v, V) <= limit


@given(
    e=st.floats(0.0, 0.95) | st.floats(1.05, 100.0),
    inc=st.floats(0.0, np.pi), Omega=angle, omega=angle, place=st.floats(-0.95, 0.95),
    a=st.floats(1e-3, 1e4), gm=st.floats(1e-12, 1e6), pericentre=st.sampled_from(["omega", "pomega"]),
    kind=st.sampled_from(["M", "E", "f", "l", "theta"]),
)  # fmt: skip
def test_round_trip_holds_for_any_orbit_and_every_way_to_say_it(
    e: float, inc: float, Omega: float, omega: float, place: float, a: float, gm: float, pericentre: str, kind: str
) -> None:
    f = place * (np.pi if e < 1.0 else np.arccos(-1.0 / e))
    q, v = state_from_elements(gm, a=a if e < 1.0 else -a, e=e, inc=inc, Omega=Omega, omega=omega, f=f)
    elements = elements_from_state(q, v, gm)
    got = state_from_elements(
        gm, a=elements.a, e=elements.e, inc=elements.inc, Omega=elements.Omega,
        **{pericentre: elements[pericentre], kind: elements[kind]})  # fmt: skip
    # The longitudes are differences of angles: see RANGES, for (1 - e) = 0.05 and an asymptote 5 % away.
    bound = 1e-12 if kind in ("l", "theta") else 2e-14
    assert error(got[0], q) <= bound
    assert error(got[1], v) <= bound


def test_elements_come_back_as_they_were_given() -> None:
    rng = np.random.default_rng(3)
    n = 2000
    e = np.concatenate([rng.uniform(0.1, 0.9, n), rng.uniform(1.1, 5.0, n)])
    given = {
        "a": np.where(e < 1.0, 1.0, -1.0) * rng.uniform(0.5, 40, 2 * n), "e": e, "inc": rng.uniform(0.1, 3.0, 2 * n),
        "Omega": rng.uniform(0, TURN, 2 * n), "omega": rng.uniform(0, TURN, 2 * n), "M": rng.uniform(-2, 2, 2 * n),
    }  # fmt: skip
    got = elements_from_state(*state_from_elements(2.5, **given), 2.5, t=7.0)
    # 1/e and 1/sin(inc) amplify the rounding of the state tenfold; a few roundings each.
    assert np.max(np.abs(got.a / given["a"] - 1)) <= 1e-13
    assert np.max(np.abs(got.e / given["e"] - 1)) <= 2e-14
    assert np.max(np.abs(got.inc - given["inc"])) <= 5e-15
    for key in ("Omega", "omega"):
        assert angle_error(got[key], given[key]) <= 1e-13, key
    assert np.max(np.abs(got.M - given["M"])) <= 2e-13
    assert np.allclose(got.T, 7.0 - got.M / got.n, rtol=1e-15, atol=0)
    assert np.allclose(got.q, got.a * (1 - got.e), rtol=2e-15, atol=0)
    assert np.all(np.isinf(got.P[n:]))
    assert np.allclose(got.P[:n], TURN * np.sqrt(got.a[:n] ** 3 / 2.5), rtol=1e-15, atol=0)


@each("inc", [0.0, 0.4, np.pi / 2 - 1e-9, np.pi / 2 + 1e-9, 2.5, np.pi])
@each("e", [0.2, 1.7])
def test_names_mean_what_they_mean_in_rebound_retrograde_too(e: float, inc: float) -> None:
    given = {
        "a": 2.0 if e < 1 else -2.0,
        "e": e,
        "inc": inc,
        "Omega": 1.1 if 0 < inc < np.pi else 0.0,
        "omega": 2.2,
        "f": -0.7,
    }
    simulation = rebound.Simulation()
    simulation.add(m=1.0)
    simulation.add(**given)
    particle = simulation.particles[1]
    q, v = state_from_elements(1.0, **given)
    # REBOUND multiplies by the sine and cosine of the same angles; a handful of roundings apart.
    assert error(q, np.array(particle.xyz)) <= 2e-15
    assert error(v, np.array(particle.vxyz)) <= 2e-15
    theirs = particle.orbit(primary=simulation.particles[0])
    ours = elements_from_state(particle.xyz, particle.vxyz, 1.0)
    # Through acos and eccentricity vectors, theirs are good to some 1e-13.
    for key in ("Omega", "omega", "pomega", "f", "M", "l", "theta"):
        assert angle_error(ours[key], getattr(theirs, key)) <= 1e-12, key
    assert ours.a == pytest.approx(theirs.a, rel=1e-14)
    # pomega, l and theta mean the same on the way in.
    for kind in ("l", "theta"):
        again = state_from_elements(
            1.0, a=ours.a, e=e, inc=inc, Omega=ours.Omega, pomega=ours.pomega, **{kind: ours[kind]}
        )
        assert error(again[0], q) <= 2e-14


def test_circle_has_omega_0_and_anomalies_from_the_node() -> None:
    q, v = state_from_elements(1.0, a=1.0, e=0.0, inc=0.6, Omega=2.0, f=0.5)
    elements = elements_from_state(q, v, 1.0)
    assert elements.e <= 1e-15
    assert elements.omega == 0.0
    assert elements.pomega == pytest.approx(2.0, abs=1e-15)
    for key in ("M", "E", "f"):
        assert elements[key] == pytest.approx(0.5, abs=2e-15), key
    assert elements.theta == pytest.approx(2.5, abs=2e-15)


@pytest.mark.parametrize(("inc", "longitude"), [(0.0, 1.7), (np.pi, TURN - 1.7)])
def test_orbit_in_the_reference_plane_has_Omega_0_and_omega_from_the_x_axis(inc: float, longitude: float) -> None:
    q, v = state_from_elements(1.0, a=1.0, e=0.3, inc=inc, Omega=0.0, omega=1.7, f=0.4)
    elements = elements_from_state(q, v, 1.0)
    assert elements.Omega == 0.0
    assert elements.inc == pytest.approx(inc, abs=2e-16)
    assert elements.omega == pytest.approx(1.7, abs=3e-15)
    assert elements.pomega == pytest.approx(longitude, abs=3e-15)


def test_exact_circle_on_the_x_axis_has_nothing_but_zeros() -> None:
    elements = elements_from_state([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], 1.0)
    for key in ("e", "inc", "Omega", "omega", "pomega", "M", "E", "f", "l", "theta", "T"):
        assert elements[key] == 0.0, key
    assert (elements.a, elements.q, elements.n) == (1.0, 1.0, 1.0)


def test_small_eccentricity_and_inclination_keep_their_digits() -> None:
    small = 10.0 ** -np.arange(1.0, 13.0)
    q, v = state_from_elements(1.0, a=1.0, e=small, inc=small, Omega=1.0, omega=1.0, f=2.0)
    elements = elements_from_state(q, v, 1.0)
    # Both are differences from 1, or components next to 1: an absolute few 1e-16.
    assert np.max(np.abs(elements.e - small)) <= 1e-15
    assert np.max(np.abs(elements.inc - small)) <= 5e-16
    # The inclination also keeps its relative digits, as z and vz do.
    assert np.max(np.abs(elements.inc / small - 1.0)) <= 1e-14


@pytest.mark.parametrize(("kind", "value"), [("a", 4.0), ("P", TURN * 4.0), ("n", 0.25), ("q", 3.0)])
def test_size_may_be_said_in_four_ways(kind: str, value: float) -> None:
    expected = state_from_elements(4.0, a=4.0, e=0.25, f=1.0)
    assert np.allclose(state_from_elements(4.0, e=0.25, f=1.0, **{kind: value}), expected, rtol=2e-15, atol=0)


def test_time_of_pericentre_gives_the_place_on_the_orbit() -> None:
    expected = state_from_elements(1.0, a=[4.0, -4.0], e=[0.5, 1.5], M=0.25)
    got = state_from_elements(1.0, a=[4.0, -4.0], e=[0.5, 1.5], T=10.0, t=12.0)
    assert np.allclose(got, expected, rtol=1e-15, atol=1e-300)


def test_arrays_broadcast_and_scalars_give_vectors() -> None:
    q, v = state_from_elements(1.0, a=np.ones((4, 1)), e=0.1, M=np.linspace(0, 1, 5))
    assert q.shape == v.shape == (4, 5, 3)
    assert elements_from_state(q, v, np.ones(5)).a.shape == (4, 5)
    assert state_from_elements(1.0, a=1.0)[0].tolist() == [1.0, 0.0, 0.0]


def test_elements_are_a_frozen_mapping() -> None:
    elements = elements_from_state([1.0, 0.2, 0.1], [0.0, 1.0, 0.1], 1.0)
    assert isinstance(elements, Elements)
    assert dict(elements)["a"] is elements.a
    assert list(elements) == list(elements.keys())
    with pytest.raises(ValueError, match="read-only"):
        elements.a[...] = 2.0
    with pytest.raises(KeyError, match="'b'"):
        elements["b"]


REFUSED_ELEMENTS = [
    ({"a": 1.0, "e": -0.1}, r"Ceres: .*e = -0.1; expected >= 0"),
    ({"a": 1.0, "e": 1.0}, r"Ceres: e = 1 exactly: a parabola has no.*Give its pericentre distance q"),
    ({"P": 1.0, "e": 1.0}, r"Ceres: e = 1 exactly: a parabola has no.*period"),
    ({"a": 1.0, "e": 1.5}, r"Ceres: a = 1.0 with e = 1.5; expected a < 0"),
    ({"a": -1.0, "e": 0.5}, r"Ceres: a = -1.0 with e = 0.5; expected a > 0"),
    ({"a": 0.0}, r"Ceres: a = 0.0"),
    ({"a": np.nan}, r"Ceres: a is nan; expected a finite number"),
    ({"a": 1.0, "M": np.inf}, r"Ceres: M is inf"),
    ({"P": -1.0}, r"Ceres: period P = -1.0; expected > 0"),
    ({"P": 1.0, "e": 2.0}, r"Ceres: .*a hyperbola has no period"),
    ({"q": 0.0}, r"Ceres: pericentre distance q = 0.0; expected > 0"),
    ({"a": 1.0, "inc": -0.1}, r"Ceres: inc = -0.1 rad; expected 0 ... pi"),
    ({"a": 1.0, "inc": 3.2}, r"Ceres: inc = 3.2 rad"),
    ({"a": -1.0, "e": 2.0, "f": 2.5}, r"Ceres: true anomaly f = 2.5 rad with e = 2.0 lies beyond the asymptote"),
    ({}, r"Ceres: the size of the orbit is given by nothing; expected exactly one of a, P, n, q"),
    ({"a": 1.0, "P": 1.0}, r"given by a and P; expected exactly one"),
    ({"a": 1.0, "P": 1.0, "q": 1.0}, r"given by a, P and q; expected exactly one .* or q with a or P instead of e"),
    ({"n": 1.0, "q": 1.0}, r"given by n and q.*an ellipse and a hyperbola: give one of them with e, or a and q"),
    ({"a": 2.0, "q": 1.0, "e": 0.5}, r"a and q and e are given together, .* determine the eccentricity, 1 - q/a"),
    ({"a": 1.0, "q": 2.0}, r"Ceres: q = 2.0 is greater than a = 1.0; expected q <= a for an ellipse, a < 0"),
    ({"a": 0.0, "q": 2.0}, r"Ceres: a = 0.0 with q = 2.0"),
    ({"a": np.inf}, r"Ceres: a is inf; expected a finite number"),
    ({"a": 1e308, "q": 1e-300}, r"Ceres: .*q/a is beyond the range of floats"),
    ({"n": 0.0}, r"Ceres: mean motion n = 0.0; expected > 0"),
    ({"a": 1.0, "e": 0.1, "h": 0.1}, r"h \(Pal's elements\) and e are given together; .* position .* is given by l"),
    ({"a": 1.0, "k": 0.1, "ix": 0.1, "M": 0.0}, r"k and ix \(Pal's elements\) and M are given together"),
    ({"a": 1.0, "q": 0.5, "k": 0.1}, r"a and q and k are given together"),
    ({"a": 1.0, "h": 0.8, "k": 0.6}, r"Ceres: h = 0.8, k = 0.6 make e = 1.0; expected h\^2 \+ k\^2 < 1"),
    ({"a": 1.0, "ix": 2.0, "iy": 0.1}, r"Ceres: ix = 2.0, iy = 0.1; expected ix\^2 \+ iy\^2 <= 4"),
    ({"a": 1.0, "u": 0.0, "theta": 0.0}, r"given by u and theta; expected at most one"),
    ({"q": 1e305, "e": 0.9999}, r"Ceres: a of this orbit would be inf, beyond the range of floats"),
    ({"a": -1.0, "e": 2.0, "E": 1e3}, r"Ceres: the position of this orbit would be (inf|nan), beyond the range"),
    ({"a": "1.5"}, r"a is '1.5'; expected a number .*got text"),
    ({"a": 1.0 + 0j}, r"a is \(1\+0j\); expected a number"),
    ({"a": True}, r"a is True; expected a number"),
    ({"a": [1.0, None]}, r"a is \[1.0, None\]; expected a number"),
    ({"a": 10**400}, r"a is 1000.*; expected a number"),
    ({"a": 1.0, "M": 0.0, "f": 0.0}, r"given by M and f; expected at most one"),
    ({"a": 1.0, "omega": 0.0, "pomega": 0.0}, r"given by omega and pomega"),
    ({"a": 1.0, "gm": 0.0}, r"Ceres: gm = 0.0 of the attracting body; expected > 0"),
    ({"a": "far"}, r"a is 'far'; expected a number"),
    ({"a": [1.0, 2.0], "e": [0.1, 0.2, 0.3]}, r"shapes do not fit together: a \(2,\), e \(3,\)"),
]


@each(("given", "message"), REFUSED_ELEMENTS)
def test_elements_that_are_no_orbit_are_refused_by_name_and_value(given: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        state_from_elements(given.pop("gm", 1.0) if "gm" in given else 1.0, names=["Ceres"], **given)


REFUSED_STATES = [
    ([1, 0, 0], [1, 0, 0], 1.0, r"Pallas: the motion is straight .* Give it some transverse velocity"),
    ([1, 0, 0], [0, 0, 0], 1.0, r"Pallas: the motion is straight"),
    ([1, 0, 0], [1, 1e-16, 0], 1.0, r"Pallas: the motion is straight"),
    ([1, 0, 0], [0, 1e100, 0], 1.0, r"Pallas: the speed is 2\^333 times the local circular velocity.* Check the units"),
    ([0, 0, 0], [0, 1, 0], 1.0, r"Pallas: the position is that of the attracting body"),
    ([1, 0, np.nan], [0, 1, 0], 1.0, r"Pallas: position is \[1.0, 0.0, nan\]; expected finite"),
    ([1, 0, 0], [0, np.inf, 0], 1.0, r"Pallas: velocity is"),
    ([1, 0, 0], [0, 1, 0], -1.0, r"Pallas: gm = -1.0"),
]


@pytest.mark.parametrize(("q", "v", "gm", "message"), REFUSED_STATES, ids=[row[3] for row in REFUSED_STATES])
def test_states_without_elements_are_refused_by_name(q: Any, v: Any, gm: float, message: str) -> None:
    good = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
    with pytest.raises(InputError, match=message):
        elements_from_state([good[0], q], [good[1], v], [1.0, gm], names=["Ceres", "Pallas"])


def test_vectors_of_the_wrong_shape_are_refused() -> None:
    with pytest.raises(InputError, match=r"position has shape \(2,\); expected \(..., 3\)"):
        elements_from_state([1.0, 2.0], [0.0, 1.0, 0.0], 1.0)
