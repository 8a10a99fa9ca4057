"""Tolerances are understood or refused before anything runs, and judge what they say."""

from __future__ import annotations

import math

import pytest
from astropy import units as u

from orbits.errors import InputError, UnknownNameError
from orbits.regression.tolerances import Bounds, parse
from orbits.units import DIMENSIONLESS, SOLAR

from ..coverings import each

KM = 149597870.7
METHODS = [("gauss", "Gauss(stages=8)"), ("stormer-verlet", "StormerVerlet()")]


def parsed(tolerances, units=SOLAR):
    return parse(
        tolerances,
        methods=METHODS,
        names=["Sun", "Earth", "Ceres"],
        massive=["Sun", "Earth"],
        units=units,
        unit_of_report=KM if units is SOLAR else 1.0,
    )


def test_general_bounds_hold_for_every_method_and_special_ones_go_before():
    gauss, verlet = parsed({"energy": 1e-9, "angular_momentum": 1e-14, "gauss": {"energy": 1e-13}})
    assert gauss.scalars == {"energy": 1e-13, "angular_momentum": 1e-14}
    assert verlet.scalars == {"energy": 1e-9, "angular_momentum": 1e-14}
    gauss, verlet = parsed({"StormerVerlet()": {"energy": 1e-3}})
    assert not gauss
    assert verlet.scalars == {"energy": 1e-3}


def test_of_two_bounds_on_positions_the_smaller_one_holds_and_those_of_a_method_replace_both():
    bounds = parsed({"position_km": {"Earth": 1.0}, "position": 1.0})[0]
    assert bounds.positions == {"Sun": KM, "Earth": 1.0, "Ceres": KM}
    gauss, verlet = parsed({"position": 1.0, "gauss": {"position_km": 0.01}})
    assert set(gauss.positions.values()) == {0.01}
    assert set(verlet.positions.values()) == {KM}


def test_positions_are_bounded_in_km_whatever_they_were_given_in():
    assert parsed({"position_km": 2.0})[0].positions == {"Sun": 2.0, "Earth": 2.0, "Ceres": 2.0}
    assert parsed({"position": 2 * u.km})[0].positions["Earth"] == pytest.approx(2.0, rel=1e-15)
    assert parsed({"position_km": 3 * u.m})[0].positions["Earth"] == pytest.approx(0.003, rel=1e-15)
    assert parsed({"position": 1e-6})[0].positions["Earth"] == 1e-6 * KM  # a plain number is in au
    assert parsed({"position": 1e-6}, DIMENSIONLESS)[0].positions["Earth"] == 1e-6


def test_the_case_of_names_of_bodies_and_methods_does_not_matter():
    assert parsed({"position_km": {"EARTH": 1.0}})[0].positions == {"Earth": 1.0}
    gauss, verlet = parsed({"Gauss": {"energy": 1e-13}, "stormerverlet()": {"energy": 1e-3}})
    assert (gauss.scalars, verlet.scalars) == ({"energy": 1e-13}, {"energy": 1e-3})


def test_bodies_go_before_groups():
    bounds = parsed({"position_km": {"Earth": 1.0, "massive": 5.0, "particles": 100.0}})[0]
    assert bounds.positions == {"Earth": 1.0, "Sun": 5.0, "Ceres": 100.0}


def test_a_bound_is_exceeded_by_more_by_nan_and_by_nothing_measured():
    bounds = Bounds({"energy": 1e-12}, {"Earth": 1.0})
    assert bounds.failures({"energy": 1e-12}, {"Earth": 1.0}, {}, " km") == ()
    assert len(bounds.failures({"energy": 1.01e-12}, {"Earth": 1.01}, {}, " km")) == 2
    assert len(bounds.failures({"energy": math.nan}, {"Earth": math.nan}, {}, " km")) == 2
    assert len(bounds.failures({}, {}, {}, " km")) == 2


def test_a_reference_solution_worse_than_the_bound_cannot_vouch_for_it():
    (failure,) = Bounds({}, {"Earth": 1.0}).failures({}, {"Earth": 0.5}, {"Earth": 2.0}, " km")
    assert "reference solution's own error" in failure


@each(
    ("tolerances", "units", "error", "message"),
    [
        ({"enrgy": 1e-12}, SOLAR, UnknownNameError, "Did you mean 'energy'"),
        ({"gauss": {"enrgy": 1.0}}, SOLAR, UnknownNameError, "Did you mean 'energy'"),
        ({"gauss": 1.0}, SOLAR, InputError, "must be a mapping"),
        ({"leapfrog": {"energy": 1.0}}, SOLAR, UnknownNameError, "no key 'leapfrog'"),
        ({"position_km": {"Eart": 1.0}}, SOLAR, UnknownNameError, "Did you mean 'Earth'"),
        ({"energy": -1.0}, SOLAR, InputError, ">= 0"),
        ({"energy": math.nan}, SOLAR, InputError, "finite"),
        ({"energy": "small"}, SOLAR, InputError, "must be a real number"),
        ({"position_km": [1.0, 2.0]}, SOLAR, InputError, "position_km"),
        ({"position": 1 * u.day}, SOLAR, InputError, "position"),
        ({"position_km": 1.0}, DIMENSIONLESS, InputError, "use 'position'"),
        ([1e-12], SOLAR, InputError, "mapping"),
    ],
)
def test_what_makes_no_sense_is_refused_in_words(tolerances, units, error, message):
    with pytest.raises(error, match=message):
        parsed(tolerances, units)
