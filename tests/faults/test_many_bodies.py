"""Answers about many bodies: the work grows with what is asked for, and is done together."""

from __future__ import annotations

import numpy as np
import pytest
from astropy import units as u

import orbits
from orbits.marching.stepping.partial_steps import PartialSteps
from orbits.propagation.results import passage_walks, refinement
from tests.encounters import apophis_2029

ASTRONOMICAL = 1e-15
"""Rounding of positions of 1 au, in au: that of a state which is recorded relative to a body, or marched to again."""


def clones(count: int) -> orbits.Trajectory:
    """Apophis past the Earth, `count` times, 100 m and 1 mm/s apart."""
    nominal = apophis_2029()
    place, random = nominal.index("Apophis"), np.random.default_rng(1)
    q = nominal.values.q[place] + 7e-10 * random.standard_normal((count, 3))
    v = nominal.values.v[place] + 6e-13 * random.standard_normal((count, 3))
    system = nominal.remove("Apophis").add([f"c{k}" for k in range(count)], q=q, v=v)
    return orbits.propagate(system, duration=150 * u.day, samples=2, progress=False)


class Counted:
    """How often bodies are marched again, and partial steps are taken together."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.walks = self.calls = 0
        walk, take = refinement.Walk.__init__, PartialSteps.take

        def walks(*given, **known):
            self.walks += 1
            return walk(*given, **known)

        def takes(*given, **known):
            self.calls += 1
            return take(*given, **known)

        monkeypatch.setattr(passage_walks.Walk, "__init__", walks)
        monkeypatch.setattr(PartialSteps, "take", takes)


@pytest.mark.parametrize("count", [24, pytest.param(1000, marks=pytest.mark.faults)])
def test_the_closest_approaches_of_many_clones_are_refined_together_and_only_those_asked_for(monkeypatch, count):
    run = clones(count)
    counted, approaches = Counted(monkeypatch), run.closest_approaches()
    assert len(approaches) >= 2 * count  # Earth and Moon
    assert (counted.walks, counted.calls) == (0, 0)
    first = [approaches[f"c{k}"][0] for k in range(count)]
    assert {one.other for one in first} == {"Earth"}
    assert counted.walks == 1
    assert counted.calls < 60  # Newton's method: however many clones there are
    seen = run._passages
    dominant = set(seen.closest[seen.closest[:, 0] >= 0, 0].tolist()) - set(seen.flybys)
    assert not dominant & seen.refined
    every = [list(approaches[f"c{k}"]) for k in range(count)]
    assert {rows[-1].other for rows in every} == {"Sun"}
    assert dominant <= seen.refined | set(seen.closest[: -count, 0].tolist())
    assert counted.walks <= 1 + 8 + count // refinement.AT_ONCE
    assert not seen.estimated


def test_approaches_refined_together_are_those_that_are_refined_one_by_one(monkeypatch):
    run = clones(3)
    together = run.closest_approaches()
    found = [one for name in run.names for one in together[name]]
    run._passages = None
    monkeypatch.setattr(refinement, "_steps_follow_from_states", lambda run: False)
    alone = run.closest_approaches()
    expected = [one for name in run.names for one in alone[name]]
    assert [(one.body, one.other) for one in found] == [(one.body, one.other) for one in expected]
    for one, other in zip(found, expected, strict=True):
        assert one.distance.value == pytest.approx(other.distance.value, rel=1e-15, abs=ASTRONOMICAL)
        # Newton's method ends where changes of 1e-11 of a step no longer become smaller; measured 4e-13 au / v.
        assert one.time.value == pytest.approx(other.time.value, abs=1e-12 / one.speed.value)
        assert one.speed.value == pytest.approx(other.speed.value, rel=1e-11)  # measured 2.4e-12
