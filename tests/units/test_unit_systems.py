"""Unit systems: quantities become the right floats, and a wrong one is refused in words."""

from __future__ import annotations

import json
import math
import pickle
from typing import Any

import numpy as np
import pytest
from astropy import constants
from astropy import units as u
from astropy.table import Column
from astropy.utils.masked import Masked
from hypothesis import given
from hypothesis import strategies as st

from orbits import DIMENSIONLESS, SOLAR, UnitSystem
from orbits.errors import InputError
from orbits.resources import data_path
from orbits.units import quantity_from_text

SI = UnitSystem("SI", u.m, u.s, u.kg)


def test_G_of_the_solar_units_is_gm_of_the_sun_in_de440() -> None:
    table = json.loads(data_path("gm_de440.json").read_text(encoding="utf-8"))["au3_d2"]
    assert table["GMS"] == SOLAR.G


def test_a_body_with_the_suns_gm_has_one_solar_mass() -> None:
    # astropy's solar mass is IAU's nominal GM over G, 3e-10 from DE440's: energies in joules are that good, and G
    # itself is known to 2e-5 only.
    mass = (SOLAR.G * SOLAR.gm / constants.G).to_value(u.M_sun)
    assert mass == pytest.approx(1.0, rel=4e-10)


def test_G_left_out_is_that_of_nature() -> None:
    assert constants.G.si.value == SI.G
    km = UnitSystem("km", u.km, u.day, u.M_earth)
    assert constants.GM_earth.to_value(km.gm) == pytest.approx(km.G, rel=1e-15)  # one rounding for each factor


def test_derived_units() -> None:
    assert SI.speed == u.m / u.s
    assert SI.gm == u.m**3 / u.s**2
    assert SI.energy == u.J
    assert SI.momentum == u.N * u.s
    assert SI.angular_momentum == u.J * u.s
    for unit in (DIMENSIONLESS.speed, DIMENSIONLESS.gm, DIMENSIONLESS.energy, DIMENSIONLESS.angular_momentum):
        assert unit == u.dimensionless_unscaled


@pytest.mark.parametrize("system", [SOLAR, DIMENSIONLESS, SI])
def test_a_unit_system_is_a_hashable_picklable_value(system: UnitSystem) -> None:
    copy = pickle.loads(pickle.dumps(system))
    assert copy == system
    assert hash(copy) == hash(system)
    assert len({SOLAR, DIMENSIONLESS, SI}) == 3


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_numbers_in_the_systems_own_unit_keep_every_bit(x: float) -> None:
    for given_ in (x, x * u.au, [x] * u.AU, np.array(x)):
        value = SOLAR.length_value(given_)
        assert value.dtype == np.float64
        assert (value == x).all()
    assert SOLAR.speed_value(x * (u.au / u.day)) == x
    assert SOLAR.gm_value(x * (u.au**3 / u.d**2)) == x
    assert DIMENSIONLESS.time_value(u.Quantity(x)) == x


def test_quantities_are_converted() -> None:
    # The factor is rounded, and the product.
    assert SOLAR.length_value(149597870.7 * u.km) == pytest.approx(1.0, rel=2.0**-52)
    assert SOLAR.time_value(1000 * u.yr) == 365250.0
    assert SOLAR.angle_value(180 * u.deg) == math.pi
    assert SOLAR.angle_value(1.5) == 1.5
    assert SOLAR.pure_value(50 * u.percent) == 0.5
    assert SOLAR.mass_value(1 * u.M_sun) == 1.0
    assert DIMENSIONLESS.angle_value(180 * u.deg) == math.pi


def test_integers_short_floats_and_lists_of_quantities_are_numbers_too() -> None:
    assert SOLAR.length_value([1, 2]).tolist() == [1.0, 2.0]
    assert SOLAR.length_value(np.float32(0.5)) == 0.5
    assert SOLAR.length_value([1 * u.au, 2e6 * u.m]).tolist() == [1.0, (2e6 * u.m).to_value(u.au)]
    assert SOLAR.length_value([[1 * u.au], [2 * u.au]]).tolist() == [[1.0], [2.0]]


BAD_VALUES: list[tuple[str, Any, str]] = [
    ("length_value", 1 * u.kg, r"x is in kg; expected length in AU"),
    ("length_value", u.Quantity(1.0), r"x is in no unit; expected length in AU"),
    ("time_value", 6 * u.au, r"x is in AU; expected time in d"),
    ("speed_value", 6 * u.km, r"x is in km; expected velocity in AU / d"),
    ("gm_value", 1 * u.M_jup, r"x is in jupiterMass; expected GM.*This is a mass: use mass="),
    ("mass_value", constants.GM_sun, r"x is in m3 / s2; expected mass in solMass"),
    ("angle_value", 1 * u.m, r"x is in m; expected angle in rad"),
    ("pure_value", 1 * u.rad, r"x is in rad; expected no unit"),
    ("length_value", "1 au", r"x is '1 au'; expected real numbers.*got text"),
    ("length_value", None, r"x is None; expected real numbers.*got objects"),
    ("length_value", True, r"x is True; expected real numbers.*got true or false"),
    ("length_value", 1j, r"x is 1j; expected real numbers.*got complex numbers"),
    ("length_value", [1.0, [2.0]], r"expected real numbers"),
    ("length_value", [1 * u.au, 2.0], r"expected real numbers"),
    ("length_value", 10**400, r"expected real numbers"),
    ("length_value", {"a": 1}, r"expected real numbers"),
    ("length_value", np.ma.array([1.0, 2.0], mask=[True, False]), r"x is a masked array"),
    ("length_value", Masked([1.0, 2.0] * u.au, mask=[True, False]), r"x is .*masked values are undefined"),
    ("length_value", [1 * u.au, Masked(2.0 * u.au, mask=True)], r"x is .*masked values are undefined"),
    ("length_value", Masked(np.ones(2), mask=[True, False]), r"x is .*masked values are undefined"),
]


@pytest.mark.parametrize(("method", "value", "message"), BAD_VALUES)
def test_what_is_no_such_quantity_is_refused_by_name(method: str, value: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        getattr(SOLAR, method)(value, "x")


def test_columns_of_tables_without_masked_values_are_arrays() -> None:
    assert SOLAR.length_value(Masked([1.0, 2.0] * u.km)).tolist() == SOLAR.length_value([1.0, 2.0] * u.km).tolist()


def test_columns_of_tables_have_their_units() -> None:
    """Those of a `Table` are no quantities: degrees were taken for radians, without a word."""
    km, bare, wrong = (Column([1.0, 2.0], unit=unit) for unit in (u.km, None, u.deg))
    assert SOLAR.length_value(km).tolist() == SOLAR.length_value([1.0, 2.0] * u.km).tolist()
    assert SOLAR.length_value([km, km]).tolist() == [SOLAR.length_value(km).tolist()] * 2
    assert SOLAR.length_value(bare).tolist() == [1.0, 2.0]
    with pytest.raises(InputError, match=r"x is in deg; expected length in AU"):
        SOLAR.length_value(wrong, "x")


def test_a_unit_where_there_are_none_is_refused() -> None:
    with pytest.raises(InputError, match="x is in AU; expected a plain number, as DIMENSIONLESS has no units"):
        DIMENSIONLESS.length_value(1 * u.au, "x")


BAD_SYSTEMS: list[tuple[tuple[Any, ...], str]] = [
    (("", u.m, u.s, u.kg), "the name of a unit system is ''"),
    (("x", u.m, u.s, u.m), "has length m, time s, mass m; expected units of length, time and mass"),
    (("x", u.m, u.s, u.dimensionless_unscaled), "mass dimensionless; expected"),
    (("x", "furlong_", u.s, u.kg), "the unit of length of 'x' is 'furlong_'"),
    (("x", u.m, u.s, u.kg, 1.0), "G = 1.0, but G is 6.6743e-11"),
    (("x", u.m, u.s, u.kg, -6.6743e-11), "expected a finite number > 0"),
    (("x", u.m, u.s, u.kg, math.inf), "expected a finite number > 0"),
    (("x", "", "", ""), "has no physical units; give G"),
    (("x", "", "", "", 0.0), "expected a finite number > 0"),
    (("x", "", "", "", "one"), "G = 'one'; expected a number"),
]


@pytest.mark.parametrize(("arguments", "message"), BAD_SYSTEMS)
def test_units_that_do_not_belong_together_are_refused(arguments: tuple[Any, ...], message: str) -> None:
    with pytest.raises(InputError, match=message):
        UnitSystem(*arguments)


def test_a_G_that_is_no_number_is_not_one_left_out() -> None:
    for units in ((u.au, u.day, u.M_sun), (u.dimensionless_unscaled,) * 3):
        with pytest.raises(InputError, match="G = nan; expected a finite number > 0"):
            UnitSystem("own", *units, G=math.nan)
    assert UnitSystem("SI", u.m, u.s, u.kg, G=None) == SI  # type: ignore[arg-type]


@pytest.mark.parametrize("size", [1e-200, 1e-60, 1e60, 1e200])
def test_units_of_which_no_power_is_a_float_are_refused(size: float) -> None:
    for k, unit in enumerate((u.m, u.s, u.kg)):
        units = [u.m, u.s, u.kg]
        units[k] = u.Unit(size * unit)
        with pytest.raises(InputError, match=r"expected 1e-50 to 1e\+50"):
            UnitSystem("own", *units)


def test_a_long_text_is_no_quantity_and_is_refused_before_it_is_searched_for_units(monkeypatch) -> None:
    """Astropy looks for the unit that was meant in quadratic time: 70 s for this one."""
    text = "1 " + "x" * 100_000
    monkeypatch.setattr(u, "Quantity", None)
    for refused in (lambda: quantity_from_text(text, "dt", "a time"), lambda: UnitSystem("own", text, u.s, u.kg)):
        with pytest.raises(InputError, match="a text of 100,002 characters"):
            refused()
