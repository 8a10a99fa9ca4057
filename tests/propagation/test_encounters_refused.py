"""Target planes, places of entry, passages and clones: other units, and what is refused because its answer would be
wrong.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from astropy import units as u

import orbits
from orbits.errors import InputError

C = np.diag([1e-8] * 3 + [1e-10] * 3) ** 2
"""Of a state, au and au/d: 1.5 km and 0.2 mm/s."""


@cache
def falling() -> orbits.System:
    """A body a day before it falls on the Earth."""
    system = orbits.System.solar_system("2020-01-01", bodies=["Sun", "Earth", "Moon"])
    earth = system["Earth"]
    q, v = earth.q + [1e6, 2000.0, 3000.0] * u.km, earth.v + [-12.0, 0.0, 0.0] * u.km / u.s
    return system.add("rock", q=q, v=v)


@cache
def fall() -> orbits.Trajectory:
    return orbits.propagate(falling(), duration=2 * u.day, samples=2)


def test_an_ellipse_on_the_ground_is_the_same_in_all_units() -> None:
    units = orbits.UnitSystem("km and s", length=u.km, time=u.s, mass=u.kg)
    one = falling()
    other = orbits.System(
        names=one.names, gm=one.gm, q=one.q, v=one.v, epoch=one.epoch, units=units,
    )  # fmt: skip
    scale = np.repeat([u.au.to(u.km), (u.au / u.day).to(u.km / u.s)], 3)
    known = orbits.entry(fall(), covariance=C)
    found = orbits.entry(orbits.propagate(other, duration=2 * u.day, samples=2), covariance=C * np.outer(scale, scale))
    for x, y in zip(found.ellipse(), known.ellipse(), strict=True):
        assert x.value == pytest.approx(y.value, rel=1e-6)
    assert known.ellipse()[0] < 1000 * u.km
