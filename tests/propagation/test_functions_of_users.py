"""Functions of users at events and samples: what they raise, in copies of runs, and when a run is resumed."""

from __future__ import annotations

import copy
import functools
import pickle
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import orbits
from orbits.errors import ArchiveError, InputError
from orbits.events import Event, Pericentre
from orbits.propagation.events.functions import description

SYSTEM = orbits.System(
    ["star", "ship"], gm=[1.0, 1e-30], q=[[0, 0, 0], [1, 0, 0]], v=[[0, 0, 0], [0, 1.1, 0]], units=orbits.DIMENSIONLESS
)


class OwnError(Exception):
    """Of a user."""


def faster(t: Any, system: orbits.System) -> orbits.System:
    return system.replaced(v=system.v.value * [[1.0], [1.02]])


def failing(t: Any, system: orbits.System) -> orbits.System:
    if t.value > 20.0:
        raise OwnError("no fuel")
    return faster(t, system)


def x_of_ship(t: np.ndarray, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    return q[:, 1, 0]


@pytest.mark.parametrize("dt", [None, 0.1], ids=["adaptive", "constant"])
def test_what_an_acting_function_raises_has_the_run_before_it_and_a_resumed_run_acts_there(
    dt: float | None, tmp_path: Path
) -> None:
    path, events = tmp_path / "run.h5", Pericentre("ship", then=failing)
    with pytest.raises(OwnError, match="no fuel") as caught:
        orbits.propagate(SYSTEM, dt=dt, duration=60.0, samples=61, events=events, archive=path)
    assert "then=failing, at 'pericentre', t = " in caught.value.__notes__[0]
    before = caught.value.trajectory
    whole = orbits.propagate(SYSTEM, dt=dt, duration=60.0, samples=61, events=Pericentre("ship", then=faster))
    assert 20 <= len(before) < 61
    assert np.array_equal(before.q, whole.q[: len(before)])
    assert len(before.events) == int((whole.events.time.value < 20.0).sum())  # those at which the function acted
    before.close()
    # As if it had never failed: the event at which it failed is not taken for done.
    mended = Pericentre("ship", then=faster)
    resumed = orbits.resume(path, events=mended, same_bits=False)
    assert np.array_equal(resumed.q, whole.q)
    assert np.array_equal(resumed.events.time, whole.events.time)


@pytest.mark.parametrize("answer", ["x", OwnError("full disk")], ids=["another answer", "exception"])
def test_what_a_callback_raises_has_the_samples_so_far(answer: Any, tmp_path: Path) -> None:
    def callback(t: Any, system: orbits.System) -> Any:
        if t.value < 3.0:
            return None
        if isinstance(answer, Exception):
            raise answer
        return answer

    path = tmp_path / "run.h5"
    with pytest.raises((OwnError, InputError)) as caught:
        orbits.propagate(SYSTEM, duration=10.0, samples=11, callback=callback, archive=path)
    assert caught.value.trajectory.t.value.tolist() == [0.0, 1.0, 2.0, 3.0]
    caught.value.trajectory.close()
    assert len(orbits.resume(path)) == 11


def test_a_run_whose_event_function_raises_keeps_its_samples_and_cannot_be_resumed(tmp_path: Path) -> None:
    def crossing(t: np.ndarray, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        if (t > 5.0).any():
            raise OwnError("beyond the table")
        return q[:, 1, 1]

    path = tmp_path / "run.h5"
    event = Event(crossing, name="crossing")
    with pytest.raises(OwnError, match="beyond the table") as caught:
        orbits.propagate(SYSTEM, duration=40.0, samples=11, events=event, archive=path)
    assert "the function of 'crossing'" in caught.value.__notes__[0]
    assert len(caught.value.trajectory)
    caught.value.trajectory.close()
    # Its list of events ends at an unknown time: it would lack some.
    with pytest.raises(ArchiveError, match="the search for its events failed"):
        orbits.resume(path, until=50.0, events=event)


@pytest.mark.parametrize("function", [lambda t, q, v: q[:, 1, 0], x_of_ship], ids=["lambda", "named"])
def test_a_run_that_an_own_event_stopped_can_be_pickled_and_copied(function: Any) -> None:
    run = orbits.propagate(SYSTEM, duration=10.0, events=Event(function, name="noon", then="stop"))
    for again in (pickle.loads(pickle.dumps(run)), copy.deepcopy(run), copy.copy(run)):
        assert np.array_equal(again.q, run.q)
        assert again.events.time == run.events.time
        assert (again.stopped.reason, again.stopped.time) == (run.stopped.reason, run.stopped.time)
        assert again.stopped.condition.name == "noon"
    assert copy.deepcopy(run).stopped.condition == run.stopped.condition
    kept = pickle.loads(pickle.dumps(run)).stopped.condition
    if function is x_of_ship:
        assert kept == run.stopped.condition
    else:
        with pytest.raises(InputError, match=r"<lambda> is not in the pickle"):
            orbits.propagate(SYSTEM, duration=10.0, events=kept)


def test_events_that_act_can_be_pickled() -> None:
    event = pickle.loads(pickle.dumps(Pericentre("ship", then=lambda t, system: None)))
    with pytest.raises(InputError, match=r"<lambda> is not in the pickle"):
        orbits.propagate(SYSTEM, duration=20.0, events=event)
    assert pickle.loads(pickle.dumps(Pericentre("ship", then=faster))).then.function is faster


def test_a_resumed_run_refuses_a_function_of_other_code_and_takes_the_same_code_made_again(tmp_path: Path) -> None:
    def event(by: float) -> Pericentre:
        return Pericentre("ship", then=lambda t, system: system.replaced(v=system.v.value * [[1.0], [by]]))

    path = tmp_path / "run.h5"
    orbits.propagate(SYSTEM, duration=20.0, samples=21, events=event(1.02), archive=path).close()
    # Two lambdas of one name: that of the run, and one that burns longer.
    with pytest.raises(InputError, match=r"<lambda> of events=\.\.\. is not as in the run .* same_bits=False"):
        orbits.resume(path, until=40.0, events=event(1.05))
    resumed = orbits.resume(path, until=40.0, events=event(1.02))
    whole = orbits.propagate(SYSTEM, duration=40.0, samples=41, events=event(1.02))
    assert np.array_equal(resumed.q[-1], whole.q[-1])


def test_the_function_of_an_event_and_its_bodies_are_compared_too(tmp_path: Path) -> None:
    def noon(name: str, bodies: Any = ()) -> Event:
        return Event(lambda t, q, v: q[:, 1, 0 if name == "x" else 1], name="noon", bodies=bodies)

    path = tmp_path / "run.h5"
    orbits.propagate(SYSTEM, duration=20.0, events=noon("x"), archive=path).close()
    with pytest.raises(InputError, match=r"<lambda> of events=\.\.\. is not as in the run"):
        orbits.resume(path, until=40.0, events=noon("y"))
    with pytest.raises(InputError, match="events are not those of the run"):
        orbits.resume(path, until=40.0, events=noon("x", "ship"))
    assert len(orbits.resume(path, until=40.0, events=noon("x")).events) > 0


class Burn:
    """A function of a user, with a number of its own."""

    def __init__(self, by: float) -> None:
        self.by = by

    def __call__(self, t: Any, system: orbits.System) -> orbits.System:
        return system.replaced(v=system.v.value * [[1.0], [self.by]])

    def method(self, t: Any, system: orbits.System) -> orbits.System:
        return self(t, system)


def burned(by: float, t: Any, system: orbits.System) -> orbits.System:
    return Burn(by)(t, system)


def around(by: Any) -> Any:
    return lambda t, system: by


PAIRS = {
    "numbers in code": (lambda t, s: 1.0, lambda t, s: 2.0),
    "operations": (lambda t, s: t + 1, lambda t, s: t - 1),
    "defaults": (lambda t, s, k=1: k, lambda t, s, k=2: k),
    "values around": (around(1.0), around(2.0)),
    "arrays around": (around(np.array([1.0])), around(np.array([2.0]))),
    "functions within": (lambda t, s: (lambda: 1)(), lambda t, s: (lambda: 2)()),
    "objects": (Burn(1.0), Burn(2.0)),
    "methods": (Burn(1.0).method, Burn(2.0).method),
    "partial": (functools.partial(burned, 1.0), functools.partial(burned, 2.0)),
}


@pytest.mark.parametrize("case", PAIRS)
def test_functions_that_differ_have_descriptions_that_differ(case: str) -> None:
    one, two = (description(function) for function in PAIRS[case])
    assert one["code"] != two["code"]
    assert one["name"] == two["name"]
    assert "0x" not in str(one)


@pytest.mark.nightly
def test_a_description_is_the_same_in_another_process() -> None:
    code = "from tests.propagation.test_functions_of_users import *; print([*map(description, (faster, Burn(2.0)))])"
    other = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert other.strip() == str([description(f) for f in (faster, Burn(2.0))])
