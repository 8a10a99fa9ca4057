"""Runs that are disturbed at a sample."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from orbits.marching.legs.samples import SamplesOfLeg
from orbits.propagation import loop
from orbits.propagation.resuming import sample_store


def after_samples(patch: pytest.MonkeyPatch, count: int | None, act: Callable[[], Any]) -> None:
    """Have runs take their samples one by one, as those do that are looked at each, and call `act` once the first
    `count` have been added, or for None after each.
    """
    add, taken = sample_store.SampleStore.add, []

    def add_and_act(self: Any, q: Any, v: Any, accounts: Any) -> None:
        add(self, q, v, accounts)
        taken.extend(q)
        if count in (None, len(taken)):
            act()

    patch.setattr(SamplesOfLeg, "together", lambda samples, places: 1)
    patch.setattr(loop, "AT_ONCE", 1)
    patch.setattr(sample_store.SampleStore, "add", add_and_act)
