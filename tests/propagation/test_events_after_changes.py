"""Events of runs whose bodies change, of parts of a run, and of functions that jump."""

import numpy as np
import pytest

import orbits
from orbits.errors import EventWarning

SYSTEM = orbits.System(
    ["s", "p"], gm=[1.0, 1e-3], q=[[0, 0, 0], [1, 0, 0]], v=[[0, 0, 0], [0, 1.2, 0]], units=orbits.DIMENSIONLESS
)


def propagate(duration, *events, samples=6, **options):
    return orbits.propagate(
        SYSTEM, duration=duration, events=list(events), samples=samples, progress=False, **options
    )


def test_a_function_at_an_event_is_given_the_masses_of_now():
    seen = []

    def grow(t, system):
        seen.append(float(system.values.gm[0]))
        return system.replaced(gm=system.gm * [1.05, 1.0])

    run = propagate(30.0, orbits.events.Pericentre("p", then=grow))
    assert seen == [1.0, 1.05]
    assert run[-1].values.gm[0] == 1.05 * 1.05


def test_elements_cross_values_by_the_masses_of_now():
    """With twice the mass from the first apocentre on, e is 0.72, above 0.6 from there on; with the old mass it would
    seem to come to 0.6 on the way.
    """
    heavier = orbits.events.Apocentre("p", then=lambda t, system: system.replaced(gm=[2.0, 1e-3]))
    run = propagate(60.0, heavier, orbits.events.ElementCrossing("p", "e", 0.6))
    (rise,) = run.events.time[run.events.kind != "apocentre"]
    assert rise == run.events.time[0]


def kicked(t, system):
    return system.replaced(v=system.v * [[1.0], [1.1]])


@pytest.mark.parametrize("turned", [1.0, -1.0], ids=["forwards", "backwards"])
def test_what_an_action_takes_through_zero_is_an_event_at_its_time(turned):
    """A kick by a tenth at the pericentre, where e = 0.44 and v = 1.2 become 0.74 and 1.32."""
    function = orbits.events.Event(lambda t, q, v: np.hypot(v[:, 1, 0], v[:, 1, 1]) - 1.3, name="fast")
    crossing = orbits.events.ElementCrossing("p", "e", 0.6)
    kick = orbits.events.Pericentre("p", then=kicked)
    run = propagate(turned * 20.0, kick, crossing, function)
    (pericentre,) = run.events.time[run.events.kind == "pericentre"]
    rises = "e rises above 0.6" if turned > 0.0 else "e falls below 0.6"
    assert run.events.kind.tolist() == ["pericentre", rises, "fast", "fast"]
    assert (run.events.time[:3] == pericentre).all()
    stopped = propagate(turned * 20.0, kick, orbits.events.ElementCrossing("p", "e", 0.6, then="stop"))
    assert stopped.stopped.time == pericentre
    assert float(stopped.stopped.system.elements(primary="s")["p"].e) > 0.7


def test_what_an_action_takes_through_zero_stops_the_run_but_does_not_act():
    """An action on what has just been acted upon is none: the crossing is listed, and a warning says so."""
    acted = []
    kick, stop = orbits.events.Pericentre("p", then=kicked), orbits.events.ElementCrossing("p", "e", 0.55, then="stop")
    acts = orbits.events.ElementCrossing("p", "e", 0.6, then=lambda t, system: acted.append(t) or system)
    with pytest.warns(EventWarning, match=r"'e rises above 0.6' .*came about by what another event did"):
        stopped = propagate(20.0, kick, acts, stop)
    assert stopped.stopped.time == stopped.events.time[0]
    assert acted == []
    assert stopped.events.kind.tolist() == ["pericentre", "e rises above 0.6", "e rises above 0.55"]


@pytest.mark.parametrize("apart", [0.0, 1e-13])
def test_events_of_one_time_all_act_and_are_listed_before_one_of_them_stops_the_run(apart, recwarn):
    """Two pushes, one behind a sample; a stop given before them, and an event that only records, count as at the time
    of the first.
    """

    def at(time, name, push=0.0, then="record"):
        def pushed(t, system):
            return system.replaced(v=system.v.value + np.array([[0.0], [push]]) * [0.0, 0.0, 1.0])

        return orbits.events.Event(lambda t, q, v: t - time, name=name, then=pushed if push else then)

    pushes = at(0.5, "a", 0.1), at(0.5 + apart, "b", 0.2), at(0.5 + 2 * apart, "c")
    run = propagate(1.0, *pushes, samples=[0.5, 1.0])
    assert list(zip(run.events.kind, run.events.time, strict=True)) == [("a", 0.5), ("b", 0.5), ("c", 0.5)]
    np.testing.assert_allclose(run.at(0.5).v[1, 2], 0.3, rtol=1e-15)
    stopped = propagate(1.0, at(0.5, "end", then="stop"), *pushes)
    assert stopped.stopped.reason.startswith("end at")
    np.testing.assert_allclose(stopped.stopped.system.v[1, 2], 0.3, rtol=1e-15)
    assert not recwarn.list


@pytest.mark.nightly
def test_a_resumed_run_lists_what_an_action_takes_through_zero_once(tmp_path):
    events = orbits.events.Pericentre("p", then=kicked), orbits.events.ElementCrossing("p", "e", 0.6)
    whole = propagate(20.0, *events)
    (when,) = whole.events.time[whole.events.kind == "pericentre"].value
    for end in (0.9 * when, 1.0001 * when):
        path = tmp_path / f"{end:.3f}.h5"
        propagate(end, *events, archive=path).close()
        resumed = orbits.resume(path, until=20.0, events=list(events), progress=False)
        assert resumed.events.kind.tolist() == whole.events.kind.tolist()
        assert (resumed.events.time == whole.events.time).all()
        resumed.close()


@pytest.mark.parametrize("beyond", [1e-13, 1e-9, 1e-6])
def test_what_acts_just_before_the_end_acts_once(beyond, recwarn):
    times = []

    def burn(t, system):
        times.append(float(t.value))
        return system.replaced(v=system.v.value * [[1.0], [1.05]])

    end = 14.928269695716267 + beyond
    run = propagate(end, orbits.events.Pericentre("p", then=burn), samples=[end - 1.0, end])
    assert len(times) == 1
    assert len(run.events) == 1
    assert not recwarn.list  # what changes little in a tiny part of a step is no round-off


def test_parts_of_a_run_have_the_events_of_their_time():
    run = propagate(30.0, orbits.events.Pericentre("p"), samples=16)
    assert len(run.events) == 2
    assert len(run[:10].events) == 1
    assert len(run.at([10.0, 20.0]).events) == 1


def test_the_zeros_of_a_function_that_jumps_are_those_of_its_sign():
    smooth = propagate(40.0, orbits.events.Event(lambda t, q, v: q[:, 1, 0], name="x")).events.time.value
    jumps = propagate(40.0, orbits.events.Event(lambda t, q, v: np.sign(q[:, 1, 0]), name="side")).events.time.value
    assert len(smooth) == 5
    assert np.abs(jumps - smooth).max() < 1e-12


@pytest.mark.parametrize("archive", [None, "run.h5"])
def test_the_events_before_a_function_fails_are_kept(tmp_path, archive):
    fails = orbits.events.Event(lambda t, q, v: np.where(t > 20.0, np.nan, q[:, 1, 0]), name="x")
    where = None if archive is None else tmp_path / archive
    with pytest.raises(orbits.errors.EventError, match="is nan at t = 20") as caught:
        propagate(40.0, fails, archive=where)
    assert len(caught.value.trajectory.events) == 3  # at 1.7, 13.2 and 16.6
    if where is not None:
        assert len(orbits.Trajectory.open(where).events) == 3


def test_error_bars_that_a_run_cannot_have_are_told_of():
    def burn(t, system):
        return system.replaced(v=system.v.value * [[1.0], [1.05]])

    with pytest.warns(orbits.errors.OrbitsWarning, match="no error bars, as bodies merged, bounced or were changed"):
        run = propagate(20.0, orbits.events.Pericentre("p", then=burn), error_estimate=True)
    with pytest.raises(orbits.errors.InputError, match="merge, bounce, or are changed at events"):
        run.error_estimate()


def test_after_a_push_on_a_massless_body_nothing_answers_from_the_last_part_of_the_run_alone(tmp_path):
    """In memory and from an archive, which had answered with the particle's closest approach since its last push."""
    system = SYSTEM.add("c", primary="s", a=2.0, e=0.1)

    def push(t, now):
        return now.replaced(v=now.v.value * [[1.0], [1.0], [1.05]])

    events = orbits.events.Pericentre("p", then=push)
    options = {"duration": 20.0, "events": events, "samples": 6, "progress": False}
    where = tmp_path / "run.h5"
    orbits.propagate(system, archive=where, **options).close()
    for run in (orbits.propagate(system, **options), orbits.Trajectory.open(where)):
        for question in (run.closest_approaches, run.unresolved, run.error_estimate):
            with pytest.raises(orbits.errors.InputError, match="merge, bounce, or are changed at events"):
                question()
        run.close()
