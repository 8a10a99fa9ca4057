"""What round-off does to the energy of a Wisdom–Holman map in a hundred million steps."""

import importlib
from pathlib import Path

import numpy as np
import pytest

SCRIPTS = Path(__file__).resolve().parents[2] / "scripts"


@pytest.fixture
def study(monkeypatch):
    monkeypatch.syspath_prepend(str(SCRIPTS))
    return importlib.import_module("benchmarks.energy")


@pytest.mark.slow
def test_the_energy_of_the_planets_walks_at_random_over_a_million_years(study):
    """8.5e-15 over a hundred million steps and a power of 0.53 in a run of a thousand million, whose largest error is
    2.7e-14; a drift, as of a division rounded to one side, would have a power near 1.
    """
    found = study.part_energy(1, steps=100_000_000)
    assert found["largest_error"] < 3e-14
    assert 0.35 < found["growth_with_steps_to_the_power"] < 0.7


def test_a_walk_and_a_drift_are_told_apart(study):
    steps = np.random.default_rng(1).normal(size=5001)
    walk, drift = 1e-16 * np.cumsum(steps), 1e-16 * np.cumsum(steps + 1.0)
    powers = [study.told(errors, 1.0)["growth_with_steps_to_the_power"] for errors in (walk, drift)]
    assert powers == pytest.approx([0.5, 1.0], abs=0.12)


def test_energies_count_the_low_parts_of_a_state(study):
    """A rounding of Mercury's place by 1e-17 au would be seen."""
    gm, q = np.array([1.0, 1e-3]), np.array([0.0, 1.0, 0.0, 0.0, 0.0, 0.0])
    state = {"q": q, "q_lo": np.zeros(6), "v": q[::-1].copy(), "v_lo": np.zeros(6)}
    moved = {**state, "q_lo": np.array([0.0, 1e-17, 0.0, 0.0, 0.0, 0.0])}
    before, after = (study.energy(gm, one) for one in (state, moved))
    assert float((after - before) / 1e-3) == pytest.approx(1e-17, rel=0.1)
