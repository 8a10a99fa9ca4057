"""Functions of one's own that change the bodies of a run at an event."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from astropy import units as u

import orbits
from orbits.errors import EventError

from ..coverings import first

STEPS = pytest.mark.parametrize("dt", [None, 0.1], ids=["adaptive", "constant"])

SYSTEM = orbits.System(
    ["star", "ship"], gm=[1.0, 1e-30], q=[[0, 0, 0], [1, 0, 0]], v=[[0, 0, 0], [0, 1.1, 0]], units=orbits.DIMENSIONLESS
)


def burn(t: u.Quantity, system: orbits.System) -> orbits.System | None:
    """Make the ship 5 % faster, up to an apocentre of about 11."""
    v = system.v.value.copy()
    v[1] *= 1.05
    return system.replaced(v=v) if np.linalg.norm(v[1]) < 1.3 else None


BURN = orbits.events.Pericentre("ship", then=burn)


@STEPS
def test_a_ship_that_burns_at_each_pericentre_comes_back_at_the_times_of_kepler(dt: float | None) -> None:
    run = orbits.propagate(SYSTEM, dt=dt, duration=120.0, samples=61, events=BURN)
    times, speed, t = [], 1.1, 0.0
    while t < 120.0:
        t += 2.0 * math.pi * (2.0 - speed**2) ** -1.5
        times.append(t)
        speed = speed * 1.05 if speed * 1.05 < 1.3 else speed
    assert len(run.events) == len(times) - 1
    # The time of a pericentre is found to the round-off of q.v; a burn at a wrong time changes the next by more.
    assert np.abs(run.events.time.value - times[:-1]).max() < 2e-12
    assert len(run.changes) == 3
    assert len(run.legs) == 1  # masses stay


@pytest.mark.parametrize("dt", first(1, [0.1, None]), ids=["constant", "adaptive"])
def test_samples_elsewhere_and_resumption_change_no_bit_of_a_run_with_burns(dt: float | None, tmp_path: Path) -> None:
    options = {"dt": dt, "duration": 60.0, "events": BURN}
    whole = orbits.propagate(SYSTEM, samples=61, **options)
    few = orbits.propagate(SYSTEM, samples=[17.77, 60.0], **options)
    assert np.array_equal(whole.q[-1], few.q[-1])
    assert np.array_equal(whole.events.time, few.events.time)
    seen: list[int] = []
    path = tmp_path / "run.h5"
    half = orbits.propagate(
        SYSTEM, samples=61, archive=path, callback=lambda t, s: bool(seen.append(1)) or len(seen) == 22, **options
    )
    half.close()
    resumed = orbits.resume(path, events=BURN)
    assert np.array_equal(whole.q, resumed.q)
    assert np.array_equal(whole.events.time, resumed.events.time)
    resumed.close()


def test_masses_can_change_and_the_run_knows_them_at_each_time() -> None:
    def lighter(t: u.Quantity, system: orbits.System) -> orbits.System:
        return system.replaced(gm=[0.9, 1e-30])

    once = orbits.events.Pericentre("ship", then=lighter)
    run = orbits.propagate(SYSTEM, duration=12.0, samples=13, events=once)
    assert run[0].gm[0].value == 1.0
    assert run[-1].gm[0].value == 0.9
    assert [leg.gm[0].value for leg in run.legs] == [1.0, 0.9]
    assert run.at(11.5).gm[0].value == 0.9


def test_the_momentum_of_a_push_is_accounted_for() -> None:
    def push(t: u.Quantity, system: orbits.System) -> orbits.System:
        return system.replaced(v=system.v.value + np.array([0.0, 0.0, 0.25]))

    two = SYSTEM.replaced(gm=[1.0, 0.5]).barycentric()
    run = orbits.propagate(two, duration=12.0, samples=13, events=orbits.events.Pericentre("ship", "star", then=push))
    assert len(run.events) >= 1
    drift = run.drift()
    assert drift.linear_momentum.max_fraction < 1e-15
    assert drift.energy.max_fraction < 3e-15
    assert math.isnan(drift.centre_of_mass.max_fraction)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t, s: s.remove("ship"), "returned other bodies"),
        (lambda t, s: s.replaced(gm=[1.0, 0.0]), "took all of it"),
        (lambda t, s: s.replaced(softening=0.1), "changed something besides q, v, gm and radii"),
    ],
)
def test_other_changes_are_refused_and_all_before_is_kept(change: object, message: str) -> None:
    with pytest.raises(EventError, match=message) as raised:
        orbits.propagate(SYSTEM, duration=20.0, samples=21, events=orbits.events.Pericentre("ship", then=change))
    assert len(raised.value.trajectory) == 9


@pytest.mark.parametrize("dt", first(1, [0.1, None]), ids=["constant", "adaptive"])
def test_a_dense_run_whose_bodies_change_says_that_it_keeps_no_steps_and_can_be_resumed(
    dt: float | None, tmp_path: Path
) -> None:
    path, times = tmp_path / "run.h5", np.linspace(0.0, 120.0, 25)
    whole = orbits.propagate(SYSTEM, dt=dt, duration=120.0, samples=61, events=BURN)
    with pytest.warns(orbits.errors.OrbitsWarning, match="dense=True: no steps are kept"):
        half = orbits.propagate(SYSTEM, dt=dt, duration=60.0, samples=31, events=BURN, dense=True, archive=path)
    assert half._kept is None
    half.close()
    run = orbits.resume(path, until=120.0, events=BURN)
    assert run._kept is None
    assert np.array_equal(run.q, whole.q)
    assert np.array_equal(run.at(times).q, whole.at(times).q)
    run.close()
    assert orbits.Trajectory.open(path)._kept is None


def test_a_dense_run_whose_functions_change_nothing_keeps_its_steps(tmp_path: Path) -> None:
    seen: list[float] = []
    look = orbits.events.Pericentre("ship", then=lambda t, system: seen.append(float(t.value)))
    run = orbits.propagate(SYSTEM, duration=60.0, events=look, dense=True)
    assert len(seen) == len(run.events) > 1
    assert len(run._kept) > run.statistics.steps // 2
