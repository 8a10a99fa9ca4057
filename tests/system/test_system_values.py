"""A System is a value: it keeps every bit, cannot be changed, and is equal to its copies."""

from __future__ import annotations

import copy
import pickle
from typing import Any

import numpy as np
import pytest
from astropy import units as u
from astropy.time import Time

from orbits import DIMENSIONLESS, SOLAR, System, UnitSystem
from orbits.errors import UnknownNameError

SI = UnitSystem("SI", u.m, u.s, u.kg)


@pytest.fixture
def system() -> System:
    rng = np.random.default_rng(1)
    return System(
        names=["star", "planet", "dust"],
        gm=[SOLAR.G, 1e-7, 0.0],
        q=rng.normal(size=(3, 3)),
        v=rng.normal(size=(3, 3)),
        epoch=Time(2451545.0, 1e-9, format="jd", scale="tdb"),
        radii=[0.005, 0.0, 0.0],
        softening=1e-4,
    )


def test_states_come_back_as_they_went_in_to_the_last_bit() -> None:
    rng = np.random.default_rng(2)
    gm, q, v = rng.random(3), rng.normal(size=(3, 3)), rng.normal(size=(3, 3))
    q[0, 0] = -0.0
    for units in (SOLAR, DIMENSIONLESS, SI):
        made = System(list("abc"), gm * units.gm, q * units.length, v * units.speed, units=units)
        for value, given in zip((made.gm, made.q, made.v), (gm, q, v), strict=True):
            assert value.value.tobytes() == given.tobytes()
        assert (made.gm.unit, made.q.unit, made.v.unit) == (units.gm, units.length, units.speed)
        assert made == System(list("abc"), gm, q, v, units=units)


def test_values_for_lower_machinery_are_read_only_contiguous_float64(system: System) -> None:
    gm, q, v, softening = system.values
    assert (gm.shape, q.shape, v.shape) == ((3,), (3, 3), (3, 3))
    for array in (gm, q, v):
        assert array.dtype == np.float64
        assert array.flags.c_contiguous
        assert not array.flags.writeable
    assert type(softening) is float


def test_the_callers_arrays_are_copied() -> None:
    q = np.array([[0.0, 0, 0], [1, 0, 0]], order="F")
    made = System(["a", "b"], [1, 0], q, np.zeros((2, 3)), units=DIMENSIONLESS)
    q[1, 0] = 7.0
    assert made.values.q[1, 0] == 1.0


def test_quantities_are_converted_to_the_systems_units() -> None:
    made = System(
        ["a"], [1] * u.km**3 / u.s**2, [[1, 2, 3]] * u.km, [[1, 2, 3]] * u.km / u.hr, units=SI, softening=1 * u.cm
    )
    # One rounding of the factor and one of the product.
    np.testing.assert_allclose(made.values.gm, 1e9, rtol=2.0**-52)
    np.testing.assert_allclose(made.values.q, [[1e3, 2e3, 3e3]], rtol=2.0**-52)
    np.testing.assert_allclose(made.values.v, np.array([[1, 2, 3]]) / 3.6, rtol=2.0**-52)
    assert made.softening == 1 * u.cm


@pytest.mark.parametrize("attribute", ["gm", "q", "v", "radii"])
def test_nothing_can_be_changed_in_place(system: System, attribute: str) -> None:
    before = pickle.dumps(system)
    with pytest.raises(ValueError, match="read-only"):
        getattr(system, attribute)[0] = 0.0 * getattr(system, attribute).unit
    with pytest.raises(AttributeError, match=f"'{attribute}' cannot be set. Use system.replaced"):
        setattr(system, attribute, None)
    with pytest.raises(AttributeError):
        system.something = 1  # type: ignore[attr-defined]
    with pytest.raises(AttributeError):
        del system._values
    assert system.epoch is not None
    system.epoch.format = "mjd"  # a copy of the caller's own
    assert pickle.dumps(system) == before


def test_copies_and_pickles_are_equal_and_still_read_only(system: System) -> None:
    for twin in (pickle.loads(pickle.dumps(system)), copy.copy(system), copy.deepcopy(system)):
        assert twin == system
        assert twin.values.q.tobytes() == system.values.q.tobytes()
        assert not twin.values.q.flags.writeable
        assert (twin.epoch - system.epoch).sec == 0.0


@pytest.mark.parametrize(
    "changes",
    [
        {"names": ["star", "planet", "gas"]},
        {"gm": [SOLAR.G, 1e-7, 1e-30]},
        {"q": np.eye(3)},
        {"v": np.eye(3)},
        {"epoch": None},
        {"epoch": "J2000"},
        {"radii": None},
        {"softening": 0.0},
    ],
)
def test_systems_that_differ_in_one_value_are_not_equal(system: System, changes: dict[str, Any]) -> None:
    other = system.replaced(**changes)
    assert other != system
    assert system != other
    assert other == system.replaced(**changes)


def test_systems_in_different_units_are_not_equal_and_no_system_equals_something_else(system: System) -> None:
    numbers = {"names": ["a"], "gm": [1.0], "q": np.zeros((1, 3)), "v": np.zeros((1, 3))}
    assert System(**numbers, units=SI) != System(**numbers, units=SOLAR)
    assert system != "system"
    with pytest.raises(TypeError, match="unhashable"):
        hash(system)


def test_replacing_nothing_changes_nothing(system: System) -> None:
    assert system.replaced() == system


def test_bodies_are_found_by_name(system: System) -> None:
    assert [system.index(name) for name in system.names] == [0, 1, 2]
    assert "dust" in system
    assert "ice" not in system
    assert system.massive.tolist() == [True, True, False]
    with pytest.raises(UnknownNameError, match=r"there is no body 'Planett'; expected one of star.*Did you mean"):
        system.index("Planett")


def test_names_may_be_of_any_script_and_length_up_to_128() -> None:
    names = ["Солнце", "地球", "x" * 128]
    made = System(np.array(names), [1, 0, 0], np.eye(3), np.eye(3), units=DIMENSIONLESS)
    assert made.names == tuple(names)
    assert all(type(name) is str for name in made.names)


def test_the_repr_says_how_many_of_what_when_and_in_which_units(system: System) -> None:
    assert repr(system) == (
        "System(star, planet, dust; 2 massive, 1 massless; epoch 2000-01-01T12:00:00.000 TDB; units SOLAR)"
    )
    big = System(
        [f"p{i}" for i in range(20)], np.ones(20), np.arange(60).reshape(20, 3), np.zeros((20, 3)), units=DIMENSIONLESS
    )
    assert repr(big) == (
        "System(p0, p1, p2, p3, p4, p5, p6, p7, p8, p9, p10, p11 and 8 more; 20 massive; no epoch; units DIMENSIONLESS)"
    )


def test_conserved_quantities_are_those_of_the_massive_bodies_with_units() -> None:
    # Two equal masses on a circle of diameter 2 with G = 1 and m = 4: v^2/r = Gm/4 gives v = 1.
    pair = System(
        ["a", "b", "dust"],
        gm=[4, 4, 0],
        q=[[1, 0, 0], [-1, 0, 0], [0, 5, 0]],
        v=[[0, 1, 0], [0, -1, 0], [9, 9, 9]],
        units=DIMENSIONLESS,
    )
    assert pair.energy() == 4.0 - 8.0
    assert pair.angular_momentum().value.tolist() == [0, 0, 8]
    assert pair.linear_momentum().value.tolist() == [0, 0, 0]
    assert pair.centre_of_mass().value.tolist() == [0, 0, 0]
    softened = pair.replaced(softening=np.sqrt(12.0))  # r^2 + eps^2 = 16; the root is rounded
    assert softened.energy().value == pytest.approx(4.0 - 4.0, abs=4 * 2.0**-52)

    # The Earth's share of the energy of two bodies is that of the textbook, in joules.
    mass, speed, distance = 5.972e24 * u.kg, 29.78 * u.km / u.s, 1.0 * u.au
    real = System(
        ["Sun", "Earth"],
        u.Quantity([SI.G * 1.989e30, SI.G * 5.972e24], SI.gm),
        u.Quantity([[0, 0, 0], [1, 0, 0]], u.au),
        u.Quantity([[0, 0, 0], [0, 29.78, 0]], u.km / u.s),
        units=SI,
    )
    kinetic = 0.5 * mass * speed**2
    potential = -SI.G * SI.gm / u.kg * 1.989e30 * u.kg * mass / distance
    assert real.energy().to_value(u.J) == pytest.approx((kinetic + potential).to_value(u.J), rel=2e-15)
    assert real.linear_momentum()[1].to_value(u.kg * u.m / u.s) == pytest.approx(5.972e24 * 29780, rel=1e-15)
    assert real.angular_momentum()[2].to_value(u.J * u.s) == pytest.approx(
        5.972e24 * 29780 * distance.to_value(u.m), rel=1e-15
    )


def test_barycentric_puts_the_massive_bodies_centre_at_rest_at_the_origin(system: System) -> None:
    moved = system.barycentric()
    # gm-weighted sums of numbers near 1: a few units of 2^-53 relative to the largest term.
    assert np.abs(moved.centre_of_mass().value).max() < 4e-16
    assert np.abs(moved.linear_momentum().value).max() < 4e-16
    shift = system.values.q - moved.values.q
    np.testing.assert_allclose(shift, np.broadcast_to(shift[0], (3, 3)), rtol=0, atol=4e-16)
    assert moved.replaced(q=system.q, v=system.v) == system


def test_adding_and_removing_keep_the_others_as_they_are(system: System) -> None:
    more = system.add("moon", primary="planet", a=1e-3, radius=1 * u.km)
    assert more.names == ("star", "planet", "dust", "moon")
    assert more.values.q[:3].tobytes() == system.values.q.tobytes()
    assert more.radii is not None
    assert more.radii[3].to_value(u.km) == pytest.approx(1.0, rel=2.0**-51)
    assert more.softening == system.softening
    assert more.remove("moon") == system
    assert more.remove("star", "dust").names == ("planet", "moon")
    assert system.names == ("star", "planet", "dust")
