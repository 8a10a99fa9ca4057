"""A run goes on to its end, wherever its samples are; and it answers for all times up to which it was marched."""

from __future__ import annotations

import copy
import os
import pickle
import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import orbits
from orbits.errors import EventError, InputError, Interrupted

from ..coverings import cover

SYSTEM = orbits.System(
    ["star", "p", "r"],
    gm=[1.0, 1e-3, 1e-4],
    q=[[0, 0, 0], [1, 0, 0], [3, 0, 0]],
    v=[[0, 0, 0], [0, 1.1, 0], [0, 0.57, 0]],
    units=orbits.DIMENSIONLESS,
)
WITH_PARTICLE = SYSTEM.add("grain", primary="star", a=2.0, e=0.3)
PERICENTRES = orbits.events.Pericentre("p", "star")

STEPS = pytest.mark.parametrize("dt", [None, 0.07], ids=["adaptive", "constant"])
DIRECTION = pytest.mark.parametrize("duration", [40.0, -40.0], ids=["forwards", "backwards"])


@cover(("dt", "duration"), [None, 0.07], [40.0, -40.0], strength=1)
def test_a_run_with_early_samples_goes_on_to_its_end(dt: float | None, duration: float) -> None:
    samples = [duration / 40, duration / 20]
    run = orbits.propagate(SYSTEM, dt=dt, duration=duration, samples=samples, events=PERICENTRES)
    whole = orbits.propagate(SYSTEM, dt=dt, duration=duration, events=PERICENTRES)
    assert run.times.tolist() == samples
    assert run.complete
    assert len(run.events) == len(whole.events) == 4
    assert np.array_equal(run.events.time, whole.events.time)
    assert len(run.closest_approaches()) == len(whole.closest_approaches())
    assert run.statistics.steps == whole.statistics.steps


@STEPS
def test_a_run_answers_before_its_first_sample_and_after_its_last_one(dt: float | None) -> None:
    run = orbits.propagate(SYSTEM, dt=dt, duration=40.0, samples=[10.0, 20.0])
    whole = orbits.propagate(SYSTEM, dt=dt, duration=40.0, samples=[0.0, 3.3, 10.0, 20.0, 30.0, 40.0])
    # One march from the start or from the sample, not the whole run: 4e-15 where reached.
    assert np.abs(run.at([0.0, 3.3, 30.0, 40.0]).q.value - whole.q.value[[0, 1, 4, 5]]).max() < 2e-14
    assert np.array_equal(run.at(0.0).q, SYSTEM.q)
    for outside in (-0.1, 40.1):
        with pytest.raises(InputError, match=r"lies outside the run, 0 \.\.\. 40$"):
            run.at(outside)
    with pytest.raises(InputError, match=r"lies outside the samples, 10 \.\.\. 20$"):
        run[:].at(30.0)
    assert "2 samples, t = 10 ... 20 of a run to 40;" in repr(run)


@STEPS
def test_events_of_particles_and_collisions_after_the_last_sample_are_found(dt: float | None) -> None:
    options: dict[str, Any] = {"dt": dt, "duration": 40.0, "events": orbits.events.Apocentre("grain", "star")}
    run = orbits.propagate(WITH_PARTICLE, samples=[1.0, 2.0], **options)
    times = orbits.propagate(WITH_PARTICLE, samples=[1.0, 2.0, 40.0], **options).events.time
    assert len(run.events) == 2
    assert np.array_equal(run.events.time, times)
    q, v = [[0, 0, 0], [1, 0, 0]], [[0, 0, 0], [0, 0.1, 0]]
    touching = orbits.System(["a", "b"], [1, 1e-3], q, v, radii=[0.05, 0.05], units=orbits.DIMENSIONLESS)
    merge = orbits.events.Collision(then=orbits.events.Merge())
    dt = dt and 0.01
    merged = orbits.propagate(touching, dt=dt, duration=3.0, samples=[0.1], events=merge, check_step=False)
    assert merged.events.kind.tolist() == ["merger"]
    assert merged.at(2.0).names == ("a",)
    assert merged.at(0.5).names == ("a", "b")


@cover(("dt", "system"), [None, 0.07], [SYSTEM, WITH_PARTICLE], strength=1)
def test_an_archive_goes_on_to_the_end_of_the_run_after_an_interruption(
    dt: float | None, system: orbits.System, tmp_path: Path
) -> None:
    calls: list[float] = []

    def interrupt(t: Any, now: orbits.System) -> None:
        calls.append(float(t.value))
        if len(calls) == 2:
            os.kill(os.getpid(), signal.SIGTERM)

    path, body = tmp_path / "run.h5", "grain" if system is WITH_PARTICLE else "p"
    options: dict[str, Any] = {"dt": dt, "duration": 40.0, "samples": [1.0, 2.0]}
    events = [orbits.events.Pericentre(body, "star")]
    whole = orbits.propagate(system, events=events, **options)
    with pytest.raises(Interrupted):
        orbits.propagate(system, events=events, archive=path, callback=interrupt, **options)
    half = orbits.Trajectory.open(path)
    assert len(half) == 2
    assert not half.complete
    assert half._reached < 40.0
    half.close()
    resumed = orbits.resume(path)
    assert resumed.complete
    assert np.array_equal(resumed.q, whole.q)
    assert np.array_equal(resumed.events.time, whole.events.time)
    assert len(resumed.events) > 1
    assert np.array_equal(resumed.at(33.3).q, whole.at(33.3).q)
    resumed.close()
    again = orbits.resume(path)  # nothing is left to do
    assert again.statistics is None
    assert again._reached == 40.0
    assert np.array_equal(again.events.time, whole.events.time)


@STEPS
def test_an_archive_that_ends_after_its_last_sample_is_extended_from_its_end(dt: float | None, tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    orbits.propagate(
        SYSTEM, dt=dt, duration=20.0, samples=[5.0, 10.0], events=PERICENTRES, archive=path, dense=True
    ).close()
    run = orbits.resume(path, until=40.0)
    whole = orbits.propagate(SYSTEM, dt=dt, duration=40.0, samples=[*run.times], events=PERICENTRES)
    assert run.times.tolist() == [5.0, 10.0, 25.0, 30.0, 35.0, 40.0]
    assert np.array_equal(run.q, whole.q)
    assert np.array_equal(run.events.time, whole.events.time)
    # A partial step from the kept one before; the other run marches from its sample at 10.
    assert np.abs(run.at(17.7).q.value - whole.at(17.7).q.value).max() < 1e-14


@cover(("dt", "dense", "samples"), [None, 0.07], [False, True], [101, [20.0, 30.0]], strength=1)
def test_the_time_of_an_event_that_stops_a_run_can_be_asked_for(
    dt: float | None, dense: bool, samples: Any, tmp_path: Path
) -> None:
    stop = orbits.events.Pericentre("p", "star", then="stop")
    path = tmp_path / "run.h5"
    events = [stop, orbits.events.Apocentre("p", "star")]
    run = orbits.propagate(SYSTEM, dt=dt, duration=40.0, samples=samples, events=events, archive=path, dense=dense)
    copies = run, copy.deepcopy(run), pickle.loads(pickle.dumps(run)), orbits.Trajectory.open(path)
    for each in copies:
        found = each.at(each.events.time)
        # That of `stopped` is a step of the march itself; this one is marched again from a sample.
        assert np.abs(found.q.value[-1] - run.stopped.system.q.value).max() < 2e-14
        assert each.at(each.stopped.time).names == SYSTEM.names
        assert each.stopped.reason == "p and star: pericentre at t = " + f"{run.events.time[-1]:.10g}"
        assert each.stopped.time == run.events.time[-1]
        assert np.abs(each.stopped.system.q.value - run.stopped.system.q.value).max() < 2e-14
    with pytest.raises(InputError, match="outside the run"):
        run.at(run.stopped.time * 1.01)


def test_why_a_run_stopped_is_in_its_archive_until_it_goes_on(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    orbits.propagate(SYSTEM, duration=40.0, archive=path, stop=orbits.events.FartherThan(1.2, "p", "star")).close()
    with orbits.Archive.open(path) as archive:
        assert archive.ended.how == "stopped"
    stopped = orbits.Trajectory.open(path).stopped
    assert stopped.reason.startswith("p and star: farther than 1.2")
    assert np.linalg.norm((stopped.system["p"].q - stopped.system["star"].q).value) == pytest.approx(1.2, rel=1e-13)
    done = orbits.resume(path)
    while not done.complete:  # it stops again in each revolution
        assert done.stopped.time > stopped.time
        done.close()
        done = orbits.resume(path)
    assert done.stopped is None
    done.close()
    assert orbits.Trajectory.open(path).stopped is None


def test_a_failed_run_answers_up_to_the_step_that_failed() -> None:
    def crossing(t: np.ndarray, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        return np.where(t < 25.0, q[:, 1, 1], np.nan)

    with pytest.raises(EventError) as caught:
        orbits.propagate(SYSTEM, dt=0.07, duration=40.0, samples=[1.0], events=orbits.events.Event(crossing))
    run = caught.value.trajectory
    assert len(run.events)
    assert run.at(run.events.time).q.shape == (len(run.events), 3, 3)


def test_samples_beyond_the_end_of_a_run_are_refused() -> None:
    with pytest.raises(InputError, match=r"samples\[1\] = 50 lies outside the run from 0 to 40"):
        orbits.propagate(SYSTEM, duration=40.0, samples=[1.0, 50.0])
