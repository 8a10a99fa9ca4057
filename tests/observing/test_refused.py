"""What `run.ephemeris` refuses, and what it says."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from astropy import units as u
from astropy.coordinates import EarthLocation

import orbits
from orbits.errors import EpochError, InputError, UnknownNameError
from tests.observing.skies import begun

from ..coverings import each


@each(
    ("given", "error", "message"),
    [
        ({"bodies": "Marz"}, UnknownNameError, "there is no body 'Marz'.*Did you mean 'Mars'"),
        ({"bodies": "Earth"}, InputError, "'Earth' is where the observer is; expected other bodies"),
        ({"bodies": ["Mars", "mars"]}, InputError, "both called 'Mars'"),
        ({"observer": "I4"}, UnknownNameError, "no observer 'I4'; expected .*'568'.*EarthLocation.from_geodetic"),
        ({"observer": "250"}, InputError, "observatory 250 Hubble Space Telescope has no place on the Earth"),
        ({"observer": (10, 20)}, InputError, r"observer is \(10, 20\); expected a name"),
        ({"observer": EarthLocation([0, 1] * u.m, [0, 1] * u.m, [1, 1] * u.m)}, InputError, "single, finite EarthLoc"),
        ({"times": 10 * u.day}, InputError, r"= 10 lies outside the run, 0 \.\.\. 0.0006944"),
        ({"times": "2026-11-21"}, InputError, r"= -1 lies outside the run"),
        ({"times": np.zeros((2, 2))}, InputError, r"times has shape \(2, 2\); expected one time, or several in a row"),
        ({"bodies": "Mars", "H": 10.0}, InputError, "H is given without G for Mars.* the MPC and JPL take G=0.15"),
        ({"bodies": "Mars", "G": 0.1}, InputError, "G is given without H"),
        ({"H": 10.0, "G": 0.1}, InputError, r"H is 10.0 for 9 bodies; expected numbers by name, such as H=\{'Mercury'"),
        ({"bodies": "Sun", "H": -26.7, "G": 0.1}, InputError, "H is -26.7, but no observed body has a known distance"),
        ({"H": {"Mars": 1.0}, "G": {"Venus": 0.1}}, InputError, "H is given without G for Mars"),
        ({"H": {"Vulcan": 1.0}, "G": {"Vulcan": 0.1}}, UnknownNameError, "^H: there is no body 'Vulcan'"),
        ({"bodies": "Mars", "H": "bright", "G": 0.1}, InputError, "H\\['Mars'\\]|H.* must be a real number"),
    ],
)
def test_what_cannot_be_meant_is_refused(given: dict[str, Any], error: type, message: str) -> None:
    with pytest.raises(error, match=message):
        begun("2026-11-22").ephemeris(**{"times": 0.0, **given})


def test_a_system_without_units_or_an_epoch_is_seen_from_nowhere():
    pair = orbits.System(["a", "b"], [1, 1], [[0, 0, 0], [1, 0, 0]], [[0, 0, 0], [0, 1, 0]], units=orbits.DIMENSIONLESS)
    with pytest.raises(InputError, match=r"needs physical units and an epoch; the system is in DIMENSIONLESS"):
        orbits.propagate(pair, duration=0.1).ephemeris("a", observer="b")
    timeless = orbits.System.from_elements({"Sun": {"mass": u.M_sun}, "p": {"a": 1 * u.au}})
    with pytest.raises(InputError, match="the system has no epoch"):
        orbits.propagate(timeless, duration=1 * u.day).ephemeris("p", observer="Sun")


def test_the_earth_is_not_seen_from_where_it_is_not_known():
    stars = orbits.System.from_elements({"A": {"mass": u.M_sun}, "b": {"a": 1 * u.au}}, epoch="2026-01-01")
    run = orbits.propagate(stars, duration=1 * u.day)
    with pytest.raises(InputError, match="no body of DE440 that tells where it is in the Solar System"):
        run.ephemeris("b")
    seen = run.ephemeris("b", observer="A", times=0.5 * u.day)
    assert abs(seen.distance[0] - 1 * u.au) < 1e-4 * u.au
    assert (seen.elongation, seen.V) == (None, None)
    with pytest.raises(InputError, match=r"H is 3.0, but no observed body has a known distance from the Sun"):
        run.ephemeris("b", observer="A", times=0.5 * u.day, H=3.0, G=0.15)
    late = orbits.System.solar_system("2026-01-01").replaced(epoch="3026-01-01")
    with pytest.raises(EpochError, match="outside DE440, which covers 1549-"):
        orbits.propagate(late, duration=1 * u.day).ephemeris("Mars")


def test_samples_alone_cannot_be_looked_at_without_a_method():
    run = begun("2026-11-22")
    bare = orbits.Trajectory(run.system, run.times, run.q.value, run.v.value, step=1.0, integrator=Label())
    with pytest.raises(InputError, match=r"run.ephemeris integrates from sample to sample"):
        bare.ephemeris("Mars")


class Label:
    label = "somebody else's"
