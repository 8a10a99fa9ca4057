"""Property tests in two sizes: a few examples in every run, many under the marker `slow`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings


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
