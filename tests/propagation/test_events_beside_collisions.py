"""Events of other kinds in runs whose bodies collide: found in each leg on its own motion, none twice, none lost."""

from __future__ import annotations

import functools
import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from astropy import units as u

import orbits
from orbits.errors import EventError, EventWarning, InputError
from orbits.events import (
    Bounce,
    CloseApproach,
    CloserThan,
    Collision,
    Event,
    Merge,
    NodeCrossing,
    Pericentre,
    PlaneCrossing,
)

from ..coverings import at, cover

D = orbits.DIMENSIONLESS
MERGE = Collision(then=Merge())
STEPS = pytest.mark.parametrize("dt", [None, 0.02], ids=["adaptive", "constant"])
FALL = 2.5295467297684264  # when a and b touch


def three(side: float = 0.0) -> orbits.System:
    """Two bodies that fall onto one another, or with `side` past one another, and a planet about them."""
    q = [[-1, 0, 0], [1, 0, 0], [0, 5, 0.1]]
    v = [[0, -side, 0], [0, side, 0], [0.6, 0, 0.02]]
    return orbits.System(["a", "b", "p"], [1.0, 0.5, 1e-3], q, v, radii=[0.1, 0.1, 0.01], units=D).barycentric()


def disc(count: int = 40) -> orbits.System:
    """A star and a disc of bodies with inflated radii, on orbits that are not round."""
    rng = np.random.default_rng(3)
    angles = {name: rng.uniform(0.0, 2.0 * np.pi, count) for name in ("pomega", "Omega")}
    angles["l"] = 2.0 * np.pi * rng.permutation(count) / count
    system = orbits.System.from_elements({"star": {"gm": 1.0, "radius": 0.01}}, units=D)
    return system.add(
        [f"p{i}" for i in range(count)],
        primary="star",
        gm=rng.uniform(0.5e-7, 1.5e-7, count),
        radius=0.012,
        a=rng.uniform(0.9, 1.1, count),
        e=rng.uniform(0.02, 0.05, count),
        inc=rng.uniform(0.005, 0.01, count),
        **angles,
    ).barycentric()


def propagate(system: orbits.System, events: Any, **options: Any) -> orbits.Trajectory:
    return orbits.propagate(system, events=events, check_step=False, progress=False, **options)


def rows(run: orbits.Trajectory) -> list[tuple[str, str | None, str | None, float]]:
    return [(e.kind, e.body, e.other, float(e.time.value)) for e in run.events]


SOUGHT = [
    MERGE,
    Pericentre(),
    CloseApproach(within=0.05),
    orbits.events.NodeCrossing(primary="star"),
    orbits.events.Conjunction("p1", "p2", observer="star"),
]


def test_the_events_of_each_leg_are_those_of_a_run_of_the_bodies_that_are_left() -> None:
    """The run is cut at its mergers, and each part is a run of its own, without collisions, from the bodies there."""
    run = propagate(disc(), SOUGHT, duration=6.0, samples=9)
    mergers = [e for e in run.events if e.kind == "merger"]
    assert len(mergers) >= 5
    begins = [0.0, *(float(e.time.value) for e in mergers)]
    found = []
    for begin, end in zip(begins, [*begins[1:], 6.0], strict=True):
        left = run.at([begin])[0]
        events = [event for event in SOUGHT[1:] if {event.body, getattr(event, "other", None)} <= {*left.names, None}]
        part = propagate(left, events, duration=end - begin, samples=2)
        found += [(kind, body, other, begin + t) for kind, body, other, t in rows(part)]
    here = [row for row in rows(run) if row[0] != "merger" and row[3] not in begins]
    assert len(here) > 100
    assert [row[:3] for row in here] == [row[:3] for row in found]
    # Merged bodies are kicked by one another soon, and the order of steps is another one: 2e-12 was seen.
    assert np.abs(np.array([row[3] for row in here]) - [row[3] for row in found]).max() < 1e-10
    times = run.events.time.value
    assert (np.diff(times) >= 0.0).all()


@cover(
    ("dt", "samples", "apart"),
    [None, 0.02],
    [[3.0], [FALL - 1e-3, FALL - 1e-5, FALL + 1e-5, FALL + 1e-3]],
    [-1e-3, -1e-6, -1e-12, 0.0, 1e-12, 1e-9, 1e-6, 1e-3],
    strength=1,
)
def test_a_zero_near_a_collision_is_found_once(apart: float, dt: float | None, samples: list[float]) -> None:
    at = FALL + apart
    clock = Event(lambda t, q, v: t - at, name="clock")
    run = propagate(three(), [clock, MERGE], dt=dt, duration=3.0, samples=samples)
    kinds = run.events.kind.tolist()
    assert kinds.count("clock") == kinds.count("merger") == 1
    # The time of a function of time alone, to its last digits.
    assert abs(run.events.time.value[kinds.index("clock")] - at) < 1e-14
    order = np.sign(kinds.index("clock") - kinds.index("merger"))
    assert abs(apart) < 1e-11 or order == np.sign(apart)


@cover(("dt", "then"), [None, 0.02], [Merge(), Bounce(0.9), "record"], strength=1)
def test_events_that_record_change_no_bit_of_a_run_with_collisions(dt: float | None, then: Any) -> None:
    options: dict[str, Any] = {"dt": dt, "duration": 4.0, "samples": 17}
    alone = propagate(three(0.15), Collision(then=then), **options)
    beside = propagate(three(0.15), [Pericentre("p", "a"), CloseApproach(), Collision(then=then)], **options)
    assert np.array_equal(alone.q, beside.q, equal_nan=True)
    assert np.array_equal(alone.v, beside.v, equal_nan=True)
    words = {"merger", "bounce", "collision"}
    assert [t for *_, t in rows(alone)] == [row[3] for row in rows(beside) if row[0] in words]


@STEPS
def test_nothing_more_is_said_of_a_body_that_is_gone(dt: float | None) -> None:
    seen = orbits.events.Conjunction("a", "p", observer="b")
    events = [MERGE, CloserThan(1.9, "a", "b"), seen, PlaneCrossing("p"), orbits.events.Ejection(0.1)]
    run = propagate(three(), events, dt=dt, duration=60.0)
    gone = run.events.kind.tolist().index("merger")
    assert "b" in {e.body for e in run.events[: gone + 1]} | {e.other for e in run.events[: gone + 1]}
    after = run.events[gone + 1 :]
    assert len(after) >= 1
    assert {name for e in after for name in (e.body, e.other)} <= {"a", "p", None}


@STEPS
def test_a_function_that_needs_a_body_that_is_gone_is_over_and_a_warning_says_so(dt: float | None) -> None:
    def height(t: Any, q: Any, v: Any) -> Any:
        return q[:, :, 1].sum(axis=1) * np.cos(3.0 * t + 0.1)

    def height_of_those_there(t: Any, q: Any, v: Any) -> Any:
        return np.nansum(q[:, :, 1], axis=1) * np.cos(3.0 * t + 0.1)

    events = [MERGE, Event(height, name="all"), Event(height_of_those_there, name="there")]
    with pytest.warns(EventWarning, match=r"'all' is not sought after t = 2\.529546\d+, as its function is not finite"):
        run = propagate(three(), events, dt=dt, duration=8.0)
    times = {name: run.events.time.value[run.events.kind == name] for name in ("all", "there")}
    assert len(times["all"]) == 2
    assert times["all"].max() < FALL
    assert np.array_equal(times["all"], times["there"][:2])
    assert np.abs(times["there"] - ((np.arange(8) + 0.5) * np.pi - 0.1) / 3.0).max() < 1e-13


def test_a_sign_that_changes_through_a_collision_is_an_event_at_its_time() -> None:
    bounce = Collision(then=Bounce(1.0))
    run = propagate(three(), [bounce, CloseApproach("a", "b")], duration=4.0)
    assert [e.kind for e in run.events] == ["bounce", "close approach"]
    assert run.events.time[0] == run.events.time[1]
    assert run.events.distance.value[1] == pytest.approx(0.2, rel=1e-13)
    backwards = propagate(three(), [bounce, CloseApproach("a", "b")], duration=-4.0)
    assert [e.kind for e in backwards.events] == ["bounce", "close approach"]


class Halted(Exception):
    """Ends a run from within."""


@pytest.mark.parametrize(("dt", "at"), at((1, 8), itertools.product([None, 0.02], [1.0, 2.4, 2.53, 2.6, 5.0])))
def test_a_run_killed_anywhere_goes_on_to_the_same_bits_and_the_same_table(
    dt: float | None, at: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import orbits.propagation.resuming.sample_store as stores

    samples = [0.5, 1.0, 2.4, 2.525, 2.5294, 2.5296, 2.53, 2.535, 2.6, 3.0, 5.0, 20.0]
    events = [MERGE, Pericentre("p", "a"), CloserThan(1.0, "a", "b"), CloseApproach(), PlaneCrossing("p", [1.0, 0, 0])]
    options: dict[str, Any] = {"dt": dt, "duration": 20.0, "samples": samples}
    whole = propagate(three(), events, **options)
    path = tmp_path / "run.h5"

    def halt(t: u.Quantity, state: orbits.System) -> None:
        if t.value >= at:
            raise Halted

    with monkeypatch.context() as patch:
        patch.setattr(stores, "FIRST_COMMIT_SECONDS", 0.0)  # a commit after each block
        patch.setattr(stores, "COMMIT_SHARE", 0.0)
        with pytest.raises(Halted):
            propagate(three(), events, archive=path, callback=halt, **options)
    resumed = orbits.resume(path)
    assert np.array_equal(resumed.events._rows, whole.events._rows, equal_nan=True)
    assert np.array_equal(resumed.q, whole.q, equal_nan=True)
    assert np.array_equal(resumed.v, whole.v, equal_nan=True)
    resumed.close()
    opened = orbits.Trajectory.open(path)
    assert rows(opened) == rows(whole)
    assert opened.events._words == whole.events._words
    opened.close()


@STEPS
def test_a_collision_that_is_listed_before_the_events_of_its_step_hides_none_of_them_from_a_run_that_is_resumed(
    dt: float | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Before a sample the step that leads beyond it is searched for collisions, but not yet for other events."""
    import orbits.propagation.resuming.sample_store as stores

    fall = fall_of(dt)
    events = [Collision(), *(PlaneCrossing("p", [0, 1, 0], offset=y, direction=-1) for y in heights(dt, fall))]
    options: dict[str, Any] = {"dt": dt, "duration": 3.0, "samples": [fall + 1e-5, fall + 2e-5, 3.0]}
    whole = propagate(three(0.15), events, **options)
    assert len(whole.events) == 4
    path = tmp_path / "run.h5"

    def halt(t: u.Quantity, state: orbits.System) -> None:
        if t.value > fall + 1.5e-5:
            raise Halted

    with monkeypatch.context() as patch:
        patch.setattr(stores, "FIRST_COMMIT_SECONDS", 0.0)  # a commit after each block, and each sample
        patch.setattr(stores, "COMMIT_SHARE", 0.0)
        with pytest.raises(Halted):
            propagate(three(0.15), events, archive=path, callback=halt, **options)
    resumed = orbits.resume(path)
    assert rows(resumed) == rows(whole)
    resumed.close()


def test_no_event_is_lost_in_steps_that_are_searched_ahead_of_a_sample(monkeypatch: pytest.MonkeyPatch) -> None:
    """As after a step that the clock tried and did not take: here all up to the merger are searched in this way."""
    from orbits.propagation.chain_of_legs import ChainOfLegs

    options: dict[str, Any] = {"duration": 3.0, "samples": [3.0]}
    events = [MERGE, CloserThan(1.5, "a", "b"), CloserThan(0.3, "a", "b"), CloseApproach("p")]
    whole = propagate(three(), events, **options)
    assert len(whole.events) == 5
    usual = ChainOfLegs._steps_before

    def after_a_change(self: ChainOfLegs, place: Any) -> bool:
        return len(self.bodies.changes) > 0 and usual(self, place)

    monkeypatch.setattr(ChainOfLegs, "_steps_before", after_a_change)
    assert [row[:3] for row in rows(propagate(three(), events, **options))] == [row[:3] for row in rows(whole)]


@functools.cache
def fall_of(dt: float | None) -> float:
    """The time at which the bodies of `three` with a speed to the side touch."""
    return float(propagate(three(0.15), MERGE, dt=dt, duration=3.0).events.time.value[0])


def heights(dt: float | None, fall: float) -> list[float]:
    """Heights of the planet just before the fall, and just after it."""
    times = [fall - 1e-4, fall - 1e-6, fall + 1e-4]
    return propagate(three(0.15), (), dt=dt, duration=3.0, samples=times).q.value[:, 2, 1].tolist()


@STEPS
def test_a_run_that_ends_at_a_collision_has_the_events_before_it_and_resumed_those_after_it(
    dt: float | None, tmp_path: Path
) -> None:
    fall = fall_of(dt)
    clocks = [Event(lambda t, q, v, at=fall + d: t - at, name=f"{d:g}") for d in (-1e-3, -1e-6, 1e-6, 1e-3)]
    events = [CloserThan(1.0, "a", "b"), *clocks]
    options: dict[str, Any] = {"dt": dt, "duration": 3.0, "samples": 5}
    path = tmp_path / "run.h5"
    stopped = propagate(three(0.15), [Collision(then="stop"), *events], archive=path, **options)
    assert stopped.events.kind.tolist() == ["closer than 1", "-0.001", "-1e-06", "collision"]
    assert stopped.stopped.time.value == fall
    stopped.close()
    passed = propagate(three(0.15), [Collision(), *events], **options)
    resumed = orbits.resume(path, events=[Collision(then="stop"), *events])
    assert rows(resumed) == rows(passed)
    assert np.array_equal(resumed.q, passed.q)
    resumed.close()


def of_clock(at: float, then: str = "stop") -> Event:
    return Event(lambda t, q, v: t - at, name="clock", then=then)


@cover(
    ("dt", "then", "apart", "samples"),
    [None, 0.02],
    [Merge(), Bounce(0.9), "record", "stop"],
    [-0.3, -1e-3, -1e-6, 1e-6, 1e-3, 0.2],
    [[3.0], [2.53, 3.0]],
    strength=1,
)
def test_a_run_that_an_event_stops_near_a_collision_ends_there_and_goes_on_to_the_same(
    dt: float | None, then: Any, apart: float, samples: list[float], tmp_path: Path
) -> None:
    options: dict[str, Any] = {"dt": dt, "duration": 3.0, "samples": samples}
    fall = fall_of(dt)
    beside = [CloserThan(1.0, "a", "b"), CloseApproach("p"), PlaneCrossing("a")]
    path = tmp_path / "run.h5"
    events = [Collision(then=then), *beside, of_clock(fall + apart)]
    stopped = propagate(three(0.15), events, archive=path, **options)
    through = Collision(then="record" if then == "stop" else then)
    recorded = propagate(three(0.15), [through, *beside, of_clock(fall + apart, "record")], **options)
    if then == "stop" and apart > 0.0:
        assert stopped.events.kind[-1] == "collision"
        stopped.close()
        stopped = orbits.resume(path, events=events)
    assert stopped.events.kind[-1] == "clock"
    assert abs(stopped.events.time.value[-1] - fall - apart) < 2e-14
    assert rows(stopped) == rows(recorded)[: len(stopped.events)]
    at = stopped.stopped
    if at is not None:
        assert at.time == stopped.events.time[-1]
        assert at.system.names == (("a", "p") if then == Merge() and apart > 0.0 else ("a", "b", "p"))
        assert np.abs(at.system.q.value - recorded.at([at.time.value])[0].q.value).max() < 1e-13
    stopped.close()
    if then == "stop":
        return
    resumed = orbits.resume(path, events=events)
    assert rows(resumed) == rows(recorded)
    assert np.array_equal(resumed.q, recorded.q, equal_nan=True)
    resumed.close()


@STEPS
def test_a_sign_that_changes_through_a_collision_may_stop_the_run(dt: float | None, tmp_path: Path) -> None:
    events = [Collision(then=Bounce(1.0)), CloseApproach("a", "b", then="stop"), CloserThan(0.5, "a", "b")]
    path = tmp_path / "run.h5"
    run = propagate(three(), events, dt=dt, duration=9.0, archive=path)
    assert run.events.kind.tolist() == ["closer than 0.5", "bounce", "close approach"]
    assert run.stopped.time == run.events.time[-1]
    run.close()
    whole = propagate(three(), [events[0], CloseApproach("a", "b"), events[2]], dt=dt, duration=9.0)
    resumed = orbits.resume(path)
    assert rows(resumed) == rows(whole)[: len(resumed.events)]
    assert len(resumed.events) > 3
    resumed.close()


def test_a_function_that_fails_after_a_collision_keeps_what_was_found_before() -> None:
    fails = Event(lambda t, q, v: np.where(t > FALL + 1e-4, np.nan, 1.0), name="x")
    with pytest.raises(EventError, match=r"'x' is nan at t = 2\.5") as caught:
        propagate(three(), [MERGE, CloserThan(1.0, "a", "b"), fails], duration=4.0)
    assert caught.value.trajectory.events.kind.tolist() == ["closer than 1", "merger"]


@pytest.mark.nightly
def test_events_go_on_after_a_body_with_a_term_of_its_own_is_gone() -> None:
    flat = orbits.terms.ZonalHarmonics("b", radius=0.05, J2=1e-3, pole=[0, 0, 1])
    events = [MERGE, CloserThan(1.0, "a", "b"), CloseApproach("p")]
    run = propagate(three().replaced(terms=[flat]), events, duration=4.0)
    assert [e.kind for e in run.events] == ["close approach", "closer than 1", "merger", "close approach"]


def test_events_of_massless_bodies_beside_collisions_are_refused() -> None:
    system = three().add("grain", q=[3, 0, 0], v=[0, 0.7, 0], gm=0.0)
    with pytest.raises(InputError, match="grain is a massless particle, whose events are not sought in a run whose"):
        propagate(system, [MERGE, Pericentre("grain", "a")], duration=1.0)


def test_events_are_the_same_to_the_bit_wherever_a_run_is_ended_and_resumed(tmp_path: Path) -> None:
    """Bodies touch in the first step of a block, so that it ends before that, without a step. If an archive was stored
    there, events since it was stored before were sought on cubics, not on the polynomials of steps: 2e-12 off in time.
    """
    bodies = {"a": [1.0, 1.06], "e": [0.02, 0.0], "inc": [0.01, 0.0], "l": [0.0, 0.25]}
    star = orbits.System.from_elements({"star": {"gm": 1.0, "radius": 0.01}}, units=D)
    start = star.add(["a", "b"], primary="star", gm=1e-5, radius=0.05, **bodies)
    sought = {"events": [Collision(), NodeCrossing("a"), CloseApproach()], "duration": 6.25, "samples": 32}

    def ends_at(time: float) -> Any:
        return lambda t, now: t.value >= time

    def figures(run: orbits.Trajectory) -> list[tuple[Any, ...]]:
        return [(e.kind, e.time.value, e.distance.value, e.speed.value) for e in run.events]

    run = propagate(start, **sought)
    whole = figures(run)
    assert len(whole) == 4
    for end in range(17, 21):
        path = tmp_path / f"{end}.h5"
        propagate(start, archive=path, callback=ends_at(run.times[end]), **sought).close()
        resumed = orbits.resume(path, progress=False)
        assert figures(resumed) == whole, end
        resumed.close()
