"""Bad input in bulk: property tests in two sizes, a few examples in every run and many under the marker `slow`."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from astropy import units as u
from astropy.time import Time
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from orbits.errors import OrbitsError


def campaign(few: int, many: int, **strategies: Any) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Make a test of a property: `few` examples of the strategies, the same ones in every run, or `many` new ones."""

    def test_of(check: Callable[..., None]) -> Callable[..., None]:
        @pytest.mark.parametrize("examples", [few, pytest.param(many, marks=pytest.mark.slow)])
        def test(examples: int) -> None:
            size = settings(
                max_examples=examples,
                deadline=None,
                derandomize=examples == few,
                database=None,
                suppress_health_check=list(HealthCheck),
            )
            size(given(**strategies)(check))()

        test.__doc__ = check.__doc__
        return test

    return test_of


def works_or_says_why(use: Callable[[], Any]) -> None:
    """Call what is to be tested: it may raise errors of this package, in a few lines of words, and nothing else."""
    with contextlib.suppress(OrbitsError):
        use()


class Odd:
    """No number, no text, nothing that anything could be made of."""


ODDITIES = [
    Odd(), object(), int, len, slice(1), range(3), b"Sun", {"a": 1}, 2**63, 10**400, 10**5000, -1, 0, 1, 1.5,
    np.nan, np.inf, 1e308, 5e-324, 1j, "NaN", "Sun", "J2000", "9999-99-99", "2000-01-01T00:00:61", "\ud800", "\x00",
    "../x", np.datetime64("2000-01-01"), np.timedelta64(3, "D"), np.float32(3), np.array("x"), np.zeros((3, 3)),
    np.zeros(0), np.ones((3, 3, 3)), np.array([object()]), np.zeros(3, dtype=[("a", "f8")]),
    np.ma.masked_array([1.0, 2], [0, 1]), 3 * u.au, 3 * u.kg, np.nan * u.day, [1, 2] * u.km, u.au,
    Time("J2000.0"), Time(["J2000.0", "J2001.0"]),
]  # fmt: skip

junk = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.complex_numbers() | st.text(max_size=6)
    | st.integers(0, len(ODDITIES) - 1).map(lambda i: ODDITIES[i]),
    lambda x: st.lists(x, max_size=4) | st.tuples(x, x, x) | st.dictionaries(st.text(max_size=3), x, max_size=2),
    max_leaves=6,
)  # fmt: skip
"""Anything that somebody might hand over, in lists, tuples and dicts too."""
