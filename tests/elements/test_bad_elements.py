"""Whatever is given for elements and states: an orbit, or an InputError that says why not. Nothing else, ever."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from astropy import units as u
from astropy.utils.masked import Masked
from hypothesis import given
from hypothesis import strategies as st

import orbits
from orbits.elements import elements_from_state, from_frame, state_from_elements, two_body
from orbits.errors import InputError

KEYS = ("a", "P", "n", "q", "e", "inc", "Omega", "omega", "pomega", "M", "f", "E", "u", "l", "theta", "T",
        "h", "k", "ix", "iy")  # fmt: skip

sound = st.floats(-3.0, 3.0) | st.sampled_from([0.0, 0.5, 1.0, 2.0, np.pi])
number = sound | st.floats() | st.integers(-(10**400), 10**400)
junk = (
    st.sampled_from([
        "far", "1.0", "", b"1", True, None, 1j, 1.0 + 0j, object(), {}, {"a": 1.0}, {1.0}, (), [], [[]], [None], ["1"],
        [1.0, [2.0]], np.array([1j]), np.array(["x"]), np.array(None), np.ma.masked_array([1.0], mask=[True]),
        Masked(np.ones(1), mask=True), Masked([1.0] * u.au, mask=True),
        np.datetime64("2000-01-01"), 1.0 * u.km, 1.0 * u.rad, u.au, [1.0 * u.au], np.nan, np.inf, -np.inf, int, len,
    ])
    | st.text(max_size=3)
    | st.lists(number, max_size=3)
)  # fmt: skip
# Mostly sound, so that one thing at a time is wrong, and a good part is no error at all.
anything = st.integers(0, 19).flatmap(lambda i: junk if i == 0 else number if i == 1 else sound)
attraction = st.integers(0, 4).flatmap(lambda i: anything if i == 0 else st.floats(1e-3, 1e3))


@st.composite
def ways(draw: Any, values: Any) -> dict[str, Any]:
    """Mostly a way to say an orbit, with any values; sometimes any keys at all."""
    if draw(st.integers(0, 3)) == 0:
        return draw(st.dictionaries(st.sampled_from(KEYS), values, min_size=1, max_size=5))
    size = draw(st.sampled_from(["a", "P", "n", "q"]))
    keys = draw(st.sampled_from([("e",), ("e", "omega"), ("inc", "Omega", "pomega"), ("h", "k", "ix", "iy", "l")]))
    place = (
        () if "h" in keys else draw(st.sampled_from([(), ("M",), ("f",), ("E",), ("u",), ("l",), ("theta",), ("T",)]))
    )
    return {key: draw(values) for key in (size, *keys, *place)}


def refused(error: Exception) -> None:
    """Every refusal has something to say."""
    assert len(str(error)) > 20


@given(gm=attraction, elements=ways(anything), t=anything)
def test_elements_make_a_finite_state_or_an_InputError(gm: Any, elements: dict[str, Any], t: Any) -> None:
    try:
        q, v = state_from_elements(gm, **elements, t=t)
    except InputError as error:
        refused(error)
        return
    assert q.shape == v.shape
    assert np.isfinite(q).all()
    assert np.isfinite(v).all()


vector = st.integers(0, 9).flatmap(
    lambda i: anything if i == 0 else st.lists(st.floats() if i == 1 else anything, min_size=3, max_size=3)
)


@given(q=vector, v=vector, gm=attraction, t=anything)
def test_states_make_elements_without_nan_and_move_to_finite_states_or_an_InputError(
    q: Any, v: Any, gm: Any, t: Any
) -> None:
    try:
        elements = elements_from_state(q, v, gm, t=t)
        assert not any(np.isnan(elements[key]).any() for key in elements)
    except InputError as error:
        refused(error)
    try:
        moved = two_body(q, v, gm, t)
        assert all(np.isfinite(x).all() for x in moved)
    except (InputError, orbits.errors.ConvergenceError) as error:
        refused(error)
    try:
        from_frame(q, "ecliptic")
    except InputError as error:
        refused(error)


SUN = orbits.System.from_elements({"Sun": {"mass": u.M_sun}}, epoch="J2000")
quantity = st.sampled_from([2.0 * u.au, 1.0 * u.yr, 30.0 * u.deg, 0.1 * u.one, u.au, u.deg, 1.0 * u.deg / u.day, u.kg,
                            1.0 / u.day, "2000-02-01", 2451545.0])  # fmt: skip


@given(
    orbit=ways(quantity | anything), body=st.dictionaries(st.sampled_from(["gm", "mass", "v", "radius"]),
                                                          quantity | anything, max_size=2),
    primary=st.sampled_from([None, "Sun", "jacobi", "Barycentre", "Io", 3, ["Sun"]]),
    frame=st.sampled_from([None, None, "icrf", 7]),
)  # fmt: skip
def test_a_system_takes_a_body_or_says_why_not(
    orbit: dict[str, Any], body: dict[str, Any], primary: Any, frame: Any
) -> None:
    try:
        system = SUN.add("rock", primary=primary, frame=frame, **orbit, **body)
    except InputError as error:
        refused(error)
        return
    assert np.isfinite(system.values.q).all()


@pytest.mark.parametrize(
    ("elements", "message"),
    [
        ({"a": 1 * u.day}, r"a of rock is in d; expected length"),
        ({"a": 1, "n": 1 / u.day}, r"n of rock is in 1 / d; expected angle per time"),
        ({"a": 1, "h": 0.1 * u.deg}, r"h of rock is in deg; expected no unit"),
        ({"a": 1, "u": 3 * u.au}, r"u of rock is in AU; expected angle"),
        ({"a": 1, "h": 0.1, "M": 0.0}, r"rock: h \(Pal's elements\) and M are given together"),
        ({"q": 1, "a": 2, "e": 0.5}, r"rock: a and q and e are given together"),
        ({"e": 1.0, "P": 3.0}, r"rock: e = 1 exactly: a parabola has no"),
        ({"mass": u.km, "a": 1}, r"mass of rock is in km; expected mass"),
    ],
)
def test_a_system_names_the_element_its_unit_and_the_remedy(elements: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        SUN.add("rock", **elements)


@pytest.mark.parametrize("e", [Masked(np.array([0.1, 0.2]), mask=[True, False]), np.ma.array([0.1, 0.2], mask=[0, 1])])
def test_masked_elements_are_refused(e: Any) -> None:
    with pytest.raises(InputError, match=r"e is .*masked"):
        state_from_elements(1.0, a=1.0, e=e)


@pytest.mark.parametrize("names", [3.0, "Ceres", [1], {"a": 1}, np.array(3.0)])
def test_names_that_are_no_list_of_texts_are_refused(names: Any) -> None:
    q, v = np.array([1.0, 0, 0]), np.array([0.0, 1, 0])
    calls = (
        lambda: state_from_elements(1.0, a=-1.0, e=0.5, names=names),
        lambda: elements_from_state(q, v, -1.0, names=names),
        lambda: two_body(q, v, -1.0, 1.0, names=names),
    )
    for call in calls:
        with pytest.raises(InputError, match="expected a list of names"):
            call()
