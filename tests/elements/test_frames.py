"""The ecliptic of J2000 and the ICRF differ by a rotation about the equinox through 84381.448 arcseconds."""

from __future__ import annotations

import numpy as np
import pytest

from orbits.elements import ecliptic_to_icrf, from_frame, icrf_to_ecliptic, to_frame
from orbits.errors import InputError, UnknownNameError


def test_north_pole_of_the_ecliptic_is_where_the_almanacs_have_it() -> None:
    x, y, z = ecliptic_to_icrf([0.0, 0.0, 1.0])
    # Right ascension 18 h, declination 90 degrees less the obliquity of 23 deg 26' 21.448".
    assert np.degrees(np.arctan2(y, x)) == pytest.approx(-90.0, abs=1e-13)
    assert np.degrees(np.arcsin(z)) == pytest.approx(90.0 - (23 + 26 / 60 + 21.448 / 3600), abs=1e-13)


def test_there_and_back_is_the_identity_to_an_ulp() -> None:
    x = np.random.default_rng(1).normal(size=(50, 4, 3))
    assert np.max(np.abs(icrf_to_ecliptic(ecliptic_to_icrf(x)) - x)) <= 2e-15
    assert np.array_equal(ecliptic_to_icrf([1.0, 0.0, 0.0]), [1.0, 0.0, 0.0])


def test_frames_go_by_name() -> None:
    x = np.array([[1.0, 2.0, 3.0]])
    assert np.array_equal(to_frame(x, "ecliptic"), icrf_to_ecliptic(x))
    assert np.array_equal(from_frame(x, "Ecliptic"), ecliptic_to_icrf(x))
    same = to_frame(x, "icrf")
    assert np.array_equal(same, x)
    assert same is not x
    assert np.array_equal(from_frame(x, "icrf"), x)


def test_unknown_frames_and_shapes_are_refused() -> None:
    with pytest.raises(UnknownNameError, match="no frame 'galactic'; expected one of 'ecliptic', 'icrf', 'system'"):
        to_frame([1.0, 0.0, 0.0], "galactic")
    with pytest.raises(InputError, match=r"shape \(2,\); expected \(..., 3\)"):
        ecliptic_to_icrf([1.0, 0.0])
