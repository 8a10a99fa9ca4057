"""Closest approaches of a run that an event ended reach up to its end, wherever the samples are."""

import numpy as np
import pytest

import orbits

from ..coverings import first

SYSTEM = orbits.System(
    ["planet", "inner", "outer", "p"],
    [1.0, 0.01, 0.002, 0.0],
    [[0, 0, 0], [1, 0, 0.2], [-2, 0.5, 0], [0, 1.4, 0.1]],
    [[0, 0, 0], [0, 0.9, 0.3], [-0.1, -0.6, 0.3], [-0.8, 0, 0.1]],
    units=orbits.DIMENSIONLESS,
)
QUIET = {"check_step": False, "progress": False, "approaches": True}
METHODS = [
    (orbits.Gauss(stages=8), 1 / 8),
    (orbits.Gauss(stages=8), None),
    (orbits.WisdomHolman(), 1 / 16),
    (orbits.StormerVerlet(), 1 / 64),
]


@pytest.mark.parametrize(("method", "dt"), first(1, METHODS))
@pytest.mark.parametrize(
    "event",
    [
        orbits.events.Pericentre("p", then="stop"),
        orbits.events.Apocentre("inner", then="stop"),
        orbits.events.CloserThan(2.5, "outer", "inner", then="stop"),
    ],
    ids=["of a particle", "of a massive body", "a distance"],
)
def test_they_reach_up_to_where_the_run_was_stopped(method, dt, event, tmp_path):
    """Bodies move away from each other or towards each other at the end, where their distances are those of the end."""
    for samples in ([12.5], 101, 11):
        options = {"dt": dt, "duration": 12.5, "samples": samples, "events": event, **QUIET}
        run = orbits.propagate(SYSTEM, method, **options)
        end = run.stopped.time
        whole = orbits.propagate(SYSTEM, method, dt=dt, duration=end, samples=2, **QUIET).closest_approaches()
        found = run.closest_approaches()
        # The last partial step begins from other roundings where samples lie elsewhere.
        assert np.allclose(found.distance.value, whole.distance.value, rtol=1e-14, atol=0.0, equal_nan=True)
    orbits.propagate(SYSTEM, method, archive=tmp_path / "a.h5", **options).close()
    stored = orbits.Trajectory.open(tmp_path / "a.h5")
    assert np.array_equal(stored.closest_approaches().distance, found.distance, equal_nan=True)
    stored.close()
