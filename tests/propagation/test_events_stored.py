"""Events in archives: read again, resumed, extended, interrupted, damaged."""

import json

import h5py
import numpy as np
import pytest
from astropy import units as u

import orbits
from orbits.trajectory.events import MOST_EVENTS

from ..coverings import first

PERIOD = 2.0 * np.pi
EVENTS = [
    orbits.events.Pericentre("planet"),
    orbits.events.Apocentre("planet"),
    orbits.events.CloserThan(0.9, "planet", "star"),
    orbits.events.NodeCrossing("planet", direction=1),
    orbits.events.PlaneCrossing("planet", [1.0, 0.0, 0.3], about="star", offset=0.1),
    orbits.events.ElementCrossing("planet", "f", 1.25),
    orbits.events.Conjunction("planet", "moon", observer="star"),
    orbits.events.Transit("planet", "star", observer="moon"),
]


def system():
    bodies = {
        "star": {"gm": 1.0, "radius": 0.4},
        "planet": {"a": 1.0, "e": 0.3, "inc": 0.1, "M": 0.3, "gm": 1e-9, "radius": 0.1},
        "moon": {"a": 2.0, "e": 0.1, "M": 1.0, "gm": 1e-9, "radius": 0.1},
    }
    return orbits.System.from_elements(bodies, units=orbits.DIMENSIONLESS)


def same(one, other):
    assert one._words == other._words
    np.testing.assert_array_equal(one._rows, other._rows)


class Halted(Exception):
    """Ends a run from within."""


@pytest.mark.parametrize("dt", first(1, [None, PERIOD / 50]), ids=["adaptive", "constant"])
def test_an_interrupted_and_resumed_run_has_the_same_table(tmp_path, dt):
    options = {"dt": dt, "duration": 6 * PERIOD, "samples": 13, "events": EVENTS, "check_step": False}
    whole = orbits.propagate(system(), **options)
    assert len(whole.events) > 40
    path = tmp_path / "run.h5"

    def halt(t, state):
        if t.value > 2.7 * PERIOD:
            raise Halted

    import orbits.propagation.resuming.sample_store as stores

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(stores, "FIRST_COMMIT_SECONDS", 0.0)  # a commit after each block
        patch.setattr(stores, "COMMIT_SHARE", 0.0)
        with pytest.raises(Halted):
            orbits.propagate(system(), archive=path, callback=halt, **options)
    early = orbits.Trajectory.open(path)
    assert 0 < len(early.events) < len(whole.events)
    np.testing.assert_array_equal(early.events._rows, whole.events._rows[: len(early.events)])
    early.close()
    run = orbits.resume(path)
    same(run.events, whole.events)
    run.close()
    again = orbits.Trajectory.open(path)
    same(again.events, whole.events)
    again.close()


@pytest.mark.parametrize("dt", [None, 0.13], ids=["adaptive", "constant"])
def test_an_extended_run_has_the_events_of_the_part_of_a_step_at_its_former_end_once(tmp_path, dt):
    path = tmp_path / "run.h5"
    at = 2.0 * PERIOD - 0.3 + 1e-4  # just behind a pericentre and a conjunction, within a step
    run = orbits.propagate(system(), dt=dt, duration=at, samples=2, archive=path, events=EVENTS, check_step=False)
    assert at - run.events.time.value[run.events.kind == "pericentre"][-1] < 2e-4
    run.close()
    extended = orbits.resume(path, until=4 * PERIOD)
    whole = orbits.propagate(system(), dt=dt, duration=4 * PERIOD, samples=2, events=EVENTS, check_step=False)
    assert extended.events.kind.tolist() == whole.events.kind.tolist()
    np.testing.assert_allclose(extended.events.time.value, whole.events.time.value, rtol=0.0, atol=1e-12)
    extended.close()


def test_a_run_that_an_event_stopped_is_resumed_past_it_up_to_the_next_one(tmp_path):
    path = tmp_path / "run.h5"
    events = [orbits.events.Pericentre("planet"), orbits.events.Apocentre("planet", then="stop")]
    run = orbits.propagate(system(), duration=4 * PERIOD, archive=path, events=events)
    kinds = [run.events.kind.tolist()]
    run.close()
    for _ in range(3):
        run = orbits.resume(path)
        kinds.append(run.events.kind.tolist())
        assert run.stopped.condition == events[1]
        run.close()
    whole = orbits.propagate(system(), duration=4 * PERIOD, events=events[0])
    assert kinds[0] == ["apocentre"]
    assert kinds[-1] == ["apocentre", "pericentre"] * 3 + ["apocentre"]
    last = orbits.resume(path)
    assert last.complete
    np.testing.assert_array_equal(
        last.events.time.value[last.events.kind == "pericentre"], whole.events.time.value
    )
    last.close()


def mine(t, q, v):
    return q[:, 1, 0] - 0.2


def test_events_with_quantities_are_known_to_an_archive(tmp_path):
    sky = orbits.System.solar_system("2026-01-01", bodies=["Sun", "Mercury", "Venus"])
    events = [
        orbits.events.CloseApproach("Mercury", "Venus", within=0.9 * u.au),
        orbits.events.CloserThan(70e6 * u.km, "Mercury", "Venus"),
        orbits.events.FartherThan(0.4 * u.au, "Mercury", "Sun"),
        orbits.events.Ejection(1e3 * u.au, "Venus"),
        orbits.events.ElementCrossing("Mercury", "f", 30 * u.deg),
        orbits.events.PlaneCrossing("Mercury", np.array([0.0, 0.1, 1.0]), about="Sun", offset=1e6 * u.km),
    ]
    path = tmp_path / "run.h5"
    orbits.propagate(sky, duration=100 * u.day, samples=6, events=events, archive=path).close()
    whole = orbits.propagate(sky, duration=200 * u.day, samples=11, events=events)
    resumed = orbits.resume(path, until=200 * u.day)
    same(resumed.events, whole.events)
    assert len(set(whole.events.kind)) >= 5  # nothing is ejected
    resumed.close()


def test_a_function_has_to_be_given_again_and_the_same_one(tmp_path):
    path = tmp_path / "run.h5"
    event = orbits.events.Event(mine, name="mine")
    run = orbits.propagate(system(), duration=2 * PERIOD, archive=path, events=event)
    count = len(run.events)
    assert run.events.kind.tolist() == ["mine"] * count
    run.close()
    with pytest.raises(orbits.errors.InputError, match=r"Event, with a function .* give the same events again"):
        orbits.resume(path, until=4 * PERIOD)
    with pytest.raises(orbits.errors.InputError, match="events are not those of the run"):
        orbits.resume(path, until=4 * PERIOD, events=orbits.events.Event(mine, name="other"))
    run = orbits.resume(path, until=4 * PERIOD, events=event)
    assert len(run.events) > count
    run.close()


def test_a_run_without_events_cannot_get_any_later(tmp_path):
    path = tmp_path / "run.h5"
    orbits.propagate(system(), duration=1.0, archive=path).close()
    with pytest.raises(orbits.errors.InputError, match="sought no events"):
        orbits.resume(path, until=2.0, events=EVENTS)
    run = orbits.Trajectory.open(path)
    assert len(run.events) == 0
    run.close()


def test_the_description_in_a_file_is_readable_by_others(tmp_path):
    path = tmp_path / "run.h5"
    orbits.propagate(system(), duration=PERIOD, archive=path, events=EVENTS).close()
    with h5py.File(path) as file:
        known = json.loads(file.attrs["events"])
        counts = file["checkpoints/1/event_counts"][...], file["checkpoints/0/event_counts"][...]
        rows = file["checkpoints/0/events"]
        assert rows.shape == (MOST_EVENTS, 8)
    assert [event["kind"] for event in known] == [type(event).__name__ for event in EVENTS]
    assert known[0]["words"] == [[None, "pericentre"]]
    assert max(int(count[0]) for count in counts) > 0


@pytest.mark.parametrize(("column", "value"), [(1, 99.0), (2, 0.5), (3, 7.0), (0, np.nan)])
def test_impossible_rows_are_refused(tmp_path, column, value):
    from orbits.propagation.events import log

    run = orbits.propagate(system(), duration=PERIOD, events=EVENTS)
    rows = np.zeros((MOST_EVENTS, 8))
    count = len(run.events)
    rows[:count] = run.events._rows
    checkpoint = {"events": rows, "event_counts": np.array([count, count])}
    log.firm_rows(checkpoint, log.EVENTS, len(run.events._words), 3, "run.h5")
    rows[count // 2, column] = value
    with pytest.raises(orbits.errors.ArchiveError, match=r"run.h5 is damaged: the list of events"):
        log.firm_rows(checkpoint, log.EVENTS, len(run.events._words), 3, "run.h5")


def test_a_copy_of_a_run_keeps_its_events(tmp_path):
    import copy
    import pickle

    for path in (None, tmp_path / "run.h5"):
        run = orbits.propagate(system(), duration=PERIOD, archive=path, events=EVENTS[:2])
        for made in (copy.copy(run), pickle.loads(pickle.dumps(run))):
            same(made.events, run.events)
            made.close()
        run.close()
