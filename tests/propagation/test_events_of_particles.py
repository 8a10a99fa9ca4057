"""Events of massless bodies: those of bodies with hardly any mass, however the run is sampled, stored or stopped."""

import numpy as np
import pytest
from astropy import units as u

import orbits
from orbits.errors import ArchiveError, ConvergenceError, EventError, InputError, RetiredWarning, SingularityError
from orbits.events import (
    Apocentre,
    CloseApproach,
    CloserThan,
    Conjunction,
    ElementCrossing,
    Event,
    Pericentre,
    WallTimeOver,
)
from orbits.marching.legs import within_step
from orbits.propagation.events import asked
from orbits.propagation.particles_of_run import TOGETHER, ParticlesOfRun
from orbits.propagation.resuming import sample_store
from orbits.terms import Drag, FrameDragging, ZonalHarmonics
from orbits.trajectory.events import NUMBER

from ..coverings import cover, first

BODIES = ["Sun", "Mercury", "Venus", "Earth", "Moon", "Mars", "Jupiter", "Saturn", "Uranus", "Neptune"]
APOPHIS = {
    "primary": "Sun",
    "q": [-0.5594653855, 0.8564756476, 0.3041506622] * u.au,
    "v": [-0.0138183247, -0.0060088276, -0.0025805045] * u.au / u.day,
}
POLE = (0.36, 0.48, 0.8)
STEPS = pytest.mark.parametrize("dt", [None, 0.02], ids=["adaptive", "constant"])
ONE_BY_DEFAULT = pytest.mark.parametrize("dt", first(1, [None, 0.02]), ids=["adaptive", "constant"])

SEVERAL = [
    Pericentre("probe"),
    Apocentre("planet"),
    CloserThan(0.5, "probe", "planet"),
    ElementCrossing("probe", "f", 1.25),
    Conjunction("moon", "planet", observer="probe"),
    Event(lambda t, q, v: q[:, 3, 0] - q[:, 1, 0], name="aligned", bodies="probe"),
]
BOTH = "dust", "probe"
STORED = [*SEVERAL[:-1], Pericentre("dust"), CloseApproach("probe", "dust")]


def system(gm=0.0):
    return orbits.System.from_elements(
        {
            "star": {"gm": 1.0},
            "planet": {"a": 1.0, "e": 0.3, "inc": 0.1, "M": 0.3, "gm": 1e-3},
            "moon": {"a": 2.0, "e": 0.1, "M": 1.0, "gm": 1e-4},
            "probe": {"a": 0.7, "e": 0.4, "inc": 0.2, "M": 2.0, "gm": gm},
            "dust": {"a": 0.55, "e": 0.2, "inc": 0.4, "M": 1.0},
        },
        units=orbits.DIMENSIONLESS,
    )


def sought(events, bodies=None, **options):
    options = {"duration": 15.0, "samples": 6, "check_step": False, **options}
    return orbits.propagate(bodies or system(), events=events, **options)


def listed(events):
    return [(event.kind, event.body, event.other) for event in events]


def same(one, other):
    np.testing.assert_array_equal(one._rows, other._rows)


@pytest.fixture(scope="module")
def solar():
    return orbits.System.solar_system(epoch="2029-01-02 00:51:50.31", bodies=BODIES)


@pytest.mark.parametrize("dt", first(1, [None, 0.05 * u.day]), ids=["adaptive", "constant"])
def test_a_massless_apophis_passes_as_one_with_a_tiny_mass(solar, dt):
    options = {"dt": dt, "until": "2029-06-01", "events": [CloseApproach("Apophis", within=0.1 * u.au)]}
    massless = orbits.propagate(solar.add("Apophis", **APOPHIS), **options).events
    tiny = orbits.propagate(solar.add("Apophis", **APOPHIS, gm=1e-30), **options).events
    assert listed(massless) == listed(tiny) == [("close approach", "Apophis", name) for name in ("Earth", "Moon")]
    # The passage makes 1e-15 au before it 3e-12 d, and less, at the Moon; of the distances 1e-8 km are left.
    np.testing.assert_allclose(massless.time.value, tiny.time.value, rtol=0.0, atol=5e-11)
    np.testing.assert_allclose(massless.distance.to_value(u.km), tiny.distance.to_value(u.km), rtol=0.0, atol=1e-4)
    np.testing.assert_allclose(massless.distance.to_value(u.km), [38_011.5, 95_966.7], rtol=0.0, atol=0.1)
    assert [str(date)[:10] for date in massless.date] == ["2029-04-13", "2029-04-14"]


@pytest.mark.parametrize("dt", [None, 1.0], ids=["adaptive", "constant"])
def test_a_massless_body_that_passes_fast_where_there_are_hardly_forces_is_seen(dt):
    """Its dynamical time, 1e12, is long against the time between two samples; a straight line passes all the same."""
    gm, v = [1e-12, 1e-20, 0.0], [[0, 0, 0], [0, 0, 0], [1, 0, 0]]
    for way_over_limit in (1e2, 1e6):  # in a time of 1
        limit = 1.0 / way_over_limit
        q = [[0, 0, 1e4], [0, 0, 0], [-3.3, 0.5 * limit, 0]]
        bodies = orbits.System(["star", "a", "bullet"], gm, q, v, units=orbits.DIMENSIONLESS)
        events = [CloseApproach("bullet", "a"), CloserThan(limit, "bullet", "a")]
        found = sought(events, bodies, dt=dt, duration=8.0, samples=2).events
        assert found.kind.tolist() == [f"closer than {limit:g}", "close approach"]
        np.testing.assert_allclose(found.time.value, [3.3 - np.sqrt(0.75) * limit, 3.3], rtol=0.0, atol=1e-14)


@cover(("dt", "sign"), [None, 0.02], [1, -1], strength=1)
def test_all_kinds_of_events_are_those_of_a_body_with_a_tiny_mass(dt, sign):
    massless = sought(SEVERAL, dt=dt, duration=sign * 15.0).events
    tiny = sought(SEVERAL, system(1e-20), dt=dt, duration=sign * 15.0).events
    assert len(massless) > 15
    assert listed(massless) == listed(tiny)
    np.testing.assert_allclose(massless.time.value, tiny.time.value, rtol=0.0, atol=1e-11)
    assert (np.diff(massless.time.value) * sign > 0.0).all()


@ONE_BY_DEFAULT
def test_events_at_the_times_of_samples_are_found_once(dt):
    whole = sought(SEVERAL, dt=dt)
    times = whole.events.time.value
    samples = np.unique([0.0, *times, *times[::3] + 1e-15, *times[::3] - 1e-15, 15.0])
    again = sought(SEVERAL, dt=dt, samples=samples)
    assert listed(again.events) == listed(whole.events)
    np.testing.assert_allclose(again.events.time.value, times, rtol=0.0, atol=1e-11)


@pytest.mark.parametrize("apart", [-0.011, 0.013])
def test_samples_within_steps_change_no_event(apart):
    """Also just before and after events; of motion that takes whole steps from each sample, half of them are missed."""
    events = [Pericentre("probe"), Apocentre("probe"), CloserThan(0.5, "probe", "planet")]
    options = {"dt": 0.15, "integrator": "stormer-verlet"}
    whole = sought(events, samples=[15.0], **options).events
    some = sought(events, samples=np.append(whole.time.value + apart, 15.0), **options).events
    assert listed(some) == listed(whole)
    assert len(whole) > 8
    np.testing.assert_allclose(some.time.value, whole.time.value, atol=1e-12)


@STEPS
def test_a_zero_exactly_at_the_start_is_no_event(dt):
    q, v = [[0, 0, 0], [9, 0, 0], [1, 0, 0]], [[0, 0, 0], [0, 1 / 3, 0], [0, 0.9, 0]]
    bodies = orbits.System(["star", "planet", "probe"], [1.0, 1e-12, 0.0], q, v, units=orbits.DIMENSIONLESS)
    run = sought(Apocentre("probe"), bodies, dt=dt, duration=30.0)
    period = 2.0 * np.pi * (2.0 - 0.9**2) ** -1.5
    np.testing.assert_allclose(run.events.time.value, period * np.arange(1, 7), rtol=0.0, atol=1e-9)


@STEPS
def test_neither_the_run_nor_other_events_change_by_a_bit(dt):
    alone = sought([Apocentre("planet"), Pericentre("dust")], dt=dt)
    more = sought([Apocentre("planet"), Pericentre("dust"), *SEVERAL], dt=dt)
    plain = sought([], dt=dt)
    for run in (alone, more):
        np.testing.assert_array_equal(run.q.value, plain.q.value)
        np.testing.assert_array_equal(run.v.value, plain.v.value)
    rows = []
    for run in (alone, more):
        row = run.events._rows
        rows.append(np.delete(row[np.isin(row[:, NUMBER], [0, 1])], NUMBER, 1))
    np.testing.assert_array_equal(*rows)


DENSE = {"duration": 6.0, "samples": 101}


def one_by_one(patch):
    """Seek events from each sample to the next, whatever the motion through several of them excludes."""
    patch.setattr("orbits.propagation.particles_of_run.TOGETHER", 1)


@ONE_BY_DEFAULT
def test_what_is_sought_between_few_of_many_samples_is_all_that_there_is_to_the_bit(dt, monkeypatch):
    sought_between, real = [], ParticlesOfRun._one
    monkeypatch.setattr(ParticlesOfRun, "_one", lambda *given: sought_between.append(0) or real(*given))
    times = sought(SEVERAL, dt=dt, **DENSE).events.time.value
    assert len(times) > 5
    # A third: all in steps with zeros, those that are no events as well. Constant steps, rounded to 24 bits, end a bit
    # before samples: what is left there is less than rounding errors of positions.
    assert len(sought_between) < 0.5 * 100
    even = np.linspace(0.0, 6.0, 61)
    options = {"dt": dt, "duration": 6.0, "samples": np.unique([*even, *times, *times - 1e-15, *times + 1e-9])}
    together = sought(SEVERAL, **options).events
    one_by_one(monkeypatch)
    same(together, sought(SEVERAL, **options).events)


@pytest.mark.parametrize("method", first(1, ["stormer-verlet", "gauss", "runge-kutta-4"]))
def test_many_samples_in_a_step_are_looked_at_together_to_the_bit(method, monkeypatch):
    # All samples that wait may lie in the part of a step that is left: it ended in an error of NumPy.
    options = {"dt": 0.4, "integrator": method, "duration": 4.0, "samples": np.linspace(4.0 / 640, 4.0, 640)}
    events = [Pericentre("probe"), Apocentre("planet"), CloserThan(0.5, "probe", "planet")]
    together = sought(events, **options).events
    one_by_one(monkeypatch)
    same(together, sought(events, **options).events)
    assert len(together) > 0


@pytest.mark.parametrize("within", [0.3, 0.4])
def test_ways_on_which_bodies_stay_apart_are_left_out_and_no_approach_is(within, monkeypatch):
    options = {"events": CloseApproach("probe", within=within), "duration": 60.0, "samples": 1501}
    sought_between, real = [], ParticlesOfRun._one
    monkeypatch.setattr(ParticlesOfRun, "_one", lambda *given: sought_between.append(0) or real(*given))
    found = sought(**options).events
    ways = len(sought_between)
    one_by_one(monkeypatch)
    same(found, sought(**options).events)
    assert len(found) > 1
    assert ways < 0.1 * 1500


@pytest.mark.parametrize("direction", [1.0, -1.0], ids=["forwards", "backwards"])
def test_a_fast_passage_far_closer_than_bodies_move_between_two_checks_is_not_left_out(direction, monkeypatch):
    """Past a light body, at 1e-3 of the way between two checks far from it; from 0.7 before that."""
    bodies, past = system().remove("probe", "dust"), np.array([0.3, -0.2, 3.0])
    q, v = bodies["moon"].q.value + np.array([2e-4, 0.0, -2e-5]), bodies["moon"].v.value + past
    there = bodies.add("bullet", q=q, v=v)
    bodies = orbits.propagate(there, duration=-0.7 * direction, samples=2, check_step=False)[-1]
    options = {"duration": 1.5 * direction, "samples": 301}
    near = sought(CloseApproach("bullet", "moon"), bodies, **options).events
    close = CloseApproach("bullet", "moon", within=1.0001 * near[0].distance.value)
    assert near[0].distance.value < 3e-4
    found = sought(close, bodies, **options).events
    same(near, found)
    one_by_one(monkeypatch)
    same(found, sought(close, bodies, **options).events)


@pytest.mark.nightly
def test_events_on_a_rough_motion_do_not_depend_on_when_an_archive_is_written(tmp_path, monkeypatch):
    """Elements along kicks and drifts turn with the phase of the step, from sample to sample of another one."""
    bodies = orbits.System(
        ["S", "J"], [1.0, 1e-3], [[0, 0, 0], [5.0, 0, 0]], [[0, 0, 0], [0, 0.447, 0]], units=orbits.DIMENSIONLESS
    ).add("p", primary="S", a=2.0, e=0.1, M=0.3)
    crossing, options = ElementCrossing("p", "a", 2.002, primary="S"), {"dt": 0.3, "duration": 200.0, "samples": 201}
    whole = sought([crossing], bodies, integrator=orbits.StormerVerlet(), **options).events
    monkeypatch.setattr(sample_store, "FIRST_COMMIT_SECONDS", 0.0)
    monkeypatch.setattr(sample_store, "COMMIT_SHARE", 0.0)
    stored = sought([crossing], bodies, integrator=orbits.StormerVerlet(), archive=tmp_path / "a.h5", **options)
    assert len(whole) > 4
    same(whole, stored.events)
    stored.close()


@pytest.mark.parametrize("off", [-1e-9, 1e-9, 0.05])
def test_a_motion_through_many_samples_that_is_off_hides_no_event(off, monkeypatch):
    """Far off, as in chaos; or a little, so that the event is before the last of these samples on one of the two."""
    real, time = ParticlesOfRun._motions, sought(Pericentre("dust")).events.time.value[0]

    def astray(self, number, time, end):
        known = self._last
        if time - known.time > 1.0:
            self._last = known._replace(q=(1.0 + off) * known.q)
        try:
            yield from real(self, number, time, end)
        finally:
            self._last = known

    monkeypatch.setattr(ParticlesOfRun, "_motions", astray)
    for apart in (-1e-10, 1e-10):
        before = np.linspace(0.0, time, TOGETHER - 1, endpoint=False)
        samples = [*before, time + apart, *np.linspace(time + 0.1, 6.0, 9)]
        found = sought(Pericentre("dust"), duration=6.0, samples=samples).events.time.value
        assert len(found) == 2
        assert found[0] == pytest.approx(time, rel=0.0, abs=1e-12)


class Halted(Exception):
    """Ends a run from within."""


@ONE_BY_DEFAULT
def test_an_interrupted_and_resumed_run_has_the_same_table(tmp_path, dt):
    whole = sought(STORED, dt=dt)
    path = tmp_path / "run.h5"

    def halt(t, state):
        if t.value > 8.0:
            raise Halted

    import orbits.propagation.resuming.sample_store as stores

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(stores, "FIRST_COMMIT_SECONDS", 0.0)  # a commit after each block
        patch.setattr(stores, "COMMIT_SHARE", 0.0)
        with pytest.raises(Halted):
            sought(STORED, dt=dt, archive=path, callback=halt)
    early = orbits.Trajectory.open(path)
    assert 0 < len(early.events["probe"]) < len(whole.events["probe"])
    early.close()
    run = orbits.resume(path)
    same(run.events, whole.events)
    run.close()
    again = orbits.Trajectory.open(path)
    same(again.events, whole.events)
    again.close()


@ONE_BY_DEFAULT
def test_a_run_that_ends_between_samples_looked_at_together_has_their_events_and_goes_on(dt, tmp_path):
    def halt(t, state):
        if t.value > 4.0:
            raise Halted

    whole, path = sought(STORED, dt=dt, **DENSE).events, tmp_path / "run.h5"
    with pytest.raises(Halted):
        sought(STORED, dt=dt, archive=path, callback=halt, **DENSE)
    early = orbits.Trajectory.open(path)
    before = whole.time.value < early.times[-1]
    assert 3 < len(early.events) < len(whole)
    np.testing.assert_array_equal(early.events._rows, whole._rows[before])
    early.close()
    run = orbits.resume(path)
    same(run.events, whole)
    run.close()


@pytest.mark.parametrize("way", ["not finite", "too many"])
def test_a_search_that_fails_has_all_events_before_and_its_archive_does_not_go_on(tmp_path, monkeypatch, way):
    """Samples beyond may have been stored by then."""
    mine = Event(lambda t, q, v: np.where(t < 5.0, q[:, 3, 0], np.inf), name="mine", bodies="probe")
    events = [Pericentre("dust"), CloseApproach("probe"), mine]
    if way == "too many":
        events = events[:2]
        for module in ("trajectory.events", "propagation.events.log", "propagation.events.seeking"):
            monkeypatch.setattr(f"orbits.{module}.MOST_EVENTS", 3)
        monkeypatch.setattr("orbits.propagation.particles_of_run.MOST_EVENTS", 3)
    runs = []
    for name in ("together.h5", "one.h5"):
        with pytest.raises(EventError, match=r"'mine' is inf|more than 3 events of massless") as error:
            sought(events, archive=tmp_path / name, **DENSE)
        runs.append(error.value.trajectory)
        with pytest.raises(ArchiveError, match="the search for its events failed"):
            orbits.resume(tmp_path / name, events=events)
        one_by_one(monkeypatch)
    same(*(run.events for run in runs))
    assert len(runs[0].events) > 2
    for run in runs:
        run.close()


@ONE_BY_DEFAULT
def test_an_extended_run_has_the_events_of_one_run(tmp_path, dt):
    path = tmp_path / "run.h5"
    sought(STORED, dt=dt, duration=6.0, samples=3, archive=path).close()
    extended = orbits.resume(path, until=15.0)
    same(extended.events, sought(STORED, dt=dt).events)
    extended.close()


@ONE_BY_DEFAULT
def test_a_run_ends_at_an_event_and_goes_on_past_it(tmp_path, dt):
    path = tmp_path / "run.h5"
    stop = Apocentre("probe", then="stop")
    events = [Apocentre("planet"), Pericentre("probe"), stop, Pericentre("dust")]
    how = {"dt": dt, "duration": 9.0, "samples": 4}
    whole = sought([Apocentre("planet"), Pericentre("probe"), Apocentre("probe")], **how)
    plain = sought([], **how)
    run = sought(events, archive=path, **how)
    times = [event.time.value for event in whole.events["probe"] if event.kind == "apocentre"]
    for time in times:
        assert run.stopped.condition == stop
        assert run.stopped.reason.startswith("probe and star: apocentre at t = ")
        assert run.stopped.time.value == pytest.approx(time, rel=0.0, abs=1e-12)
        assert run.times[-1] < run.stopped.time.value
        there = plain.at(run.stopped.time).q.value
        np.testing.assert_allclose(run.stopped.system.q.value, there, rtol=0.0, atol=1e-12)
        assert run.events.time.value[-1] == run.stopped.time.value
        before = whole.events.time.value <= run.stopped.time.value + 1e-12
        mine = [row for row in listed(run.events) if row[1] != "dust"]
        assert mine == [row for row, one in zip(listed(whole.events), before, strict=True) if one]
        run.close()
        opened = orbits.Trajectory.open(path)
        same(opened.events, run.events)
        opened.close()
        run = orbits.resume(path)
    assert run.complete
    assert run.stopped is None
    assert [row for row in listed(run.events) if row[1] != "dust"] == listed(whole.events)
    run.close()


def test_a_run_that_is_stopped_before_a_sample_has_all_events_before():
    events = [Pericentre("dust"), Apocentre("dust"), Pericentre("probe"), Apocentre("probe")]
    whole = sought(events, samples=[15.0]).events
    run = sought(events, samples=[15.0], stop=orbits.events.FartherThan(2.9, "planet", "moon"))
    before = whole.time.value < run.stopped.time.value
    expected = [row for row, is_before in zip(listed(whole), before, strict=True) if is_before]
    assert listed(run.events) == [*expected, ("farther than 2.9", "planet", "moon")]
    assert {row[:2] for row in expected} == {(kind, b) for kind in ("pericentre", "apocentre") for b in BOTH}
    np.testing.assert_allclose(run.events.time.value[:-1], whole.time.value[before], rtol=0.0, atol=1e-11)


def test_the_first_of_several_reasons_ends_a_run():
    mine, planet = Apocentre("probe", then="stop"), Apocentre("planet", then="stop")
    ends = [sought([event]).stopped.time.value for event in (mine, planet)]
    both = sought([planet, mine, Pericentre("dust")])
    assert both.stopped.condition == (mine, planet)[int(np.argmin(ends))]
    assert both.stopped.time.value == pytest.approx(min(ends), rel=0.0, abs=1e-13)
    assert both.events.time.value[-1] == both.stopped.time.value
    late = sought([Pericentre("probe")], stop=WallTimeOver(1e6), callback=lambda t, state: t.value > 8.0)
    assert late.events.time.value[-1] <= late.stopped.time.value


def falling():
    """A star, a planet, a particle on an orbit, and one that falls into the star."""
    q = [[0, 0, 0], [9, 0, 0], [0, 1.0, 0], [0, 0, 0.8]]
    v = [[0, 0, 0], [0, 1 / 3, 0], [-1.1, 0, 0], [0, 0, 0]]
    return orbits.System(["star", "planet", "probe", "stone"], [1.0, 1e-9, 0, 0], q, v, units=orbits.DIMENSIONLESS)


def test_a_retired_body_has_the_events_before_it_is_lost_and_none_after():
    events = [CloserThan(0.2, "stone", "star"), Pericentre("stone"), Pericentre("probe")]
    with pytest.warns(RetiredWarning):
        run = sought(events, falling(), duration=30.0)
    assert run.retired.names == ("stone",)
    assert run.events["stone"].kind.tolist() == ["closer than 0.2"]
    assert run.events["stone"].time.value[0] < run.retired[0].time.value
    assert len(run.events["probe"]) == 3
    np.testing.assert_array_equal(
        run.events["probe"].time.value, sought(events[2], falling().remove("stone"), duration=30.0).events.time.value
    )


def test_a_motion_that_no_step_resolves_is_said_so_and_what_was_before_is_kept(monkeypatch):
    real = within_step.stretches

    def failing(march, place):
        if march.problem.start > 10.0:
            raise ConvergenceError("the stages did not converge", step=1, time=0.0)
        return real(march, place)

    monkeypatch.setattr(within_step, "stretches", failing)
    with pytest.raises(EventError, match=r"of probe cannot be sought from t = 9 to 12: .*smaller dt") as error:
        sought(Pericentre("probe"), dt=0.02)
    run = error.value.trajectory
    assert run.times.tolist() == [0.0, 3.0, 6.0, 9.0, 12.0]
    assert len(run.events) == 3  # the last one in the steps before that one


@pytest.mark.nightly
def test_terms_and_forces_act_on_what_is_followed():
    dressed = system().with_terms(
        ZonalHarmonics("star", J2=0.05, radius=0.3, pole=POLE),
        FrameDragging("star", spin=0.05, pole=POLE, c=3.0),
    )
    dressed = dressed.with_forces(Drag(rate=1e-3, bodies=["planet", "probe"]))
    events = sought(Pericentre("probe"), dressed, dt=0.02, duration=10.0, samples=3).events
    assert len(events) == 3
    fine = sought([], dressed, dt=0.01, duration=10.0, samples=[0.0, *events.time.value, 10.0])
    q, v = (x.value[1:-1, 3] - x.value[1:-1, 0] for x in (fine.q, fine.v))
    np.testing.assert_allclose(np.sum(q * v, axis=1), 0.0, atol=2e-14)
    np.testing.assert_allclose(np.linalg.norm(q, axis=1), events.distance.value, rtol=0.0, atol=2e-15)


def test_what_cannot_be_sought_is_refused_with_a_remedy(monkeypatch):
    with pytest.raises(InputError, match=r"Pericentre: probe is a massless particle, on which nothing acts"):
        sought(Pericentre("probe", then=lambda t, state: None))
    acting = Pericentre("planet", then=lambda t, state: None)
    with pytest.raises(InputError, match=r"whose events are not sought in a run whose bodies may be changed"):
        sought([acting, Pericentre("probe")])
    with pytest.raises(InputError, match=r"dense=True .* leave one of the two out"):
        sought(Pericentre("probe", then="stop"), dense=True)
    monkeypatch.setattr(asked, "MOST_PARTICLES", 1)
    with pytest.raises(InputError, match=r"events of 2 massless bodies; at most 1 are followed"):
        sought([Pericentre("probe"), Pericentre("dust")])


def test_dense_output_and_events_of_massless_bodies_go_together():
    run = sought(Pericentre("probe"), dense=True)
    same(run.events, sought(Pericentre("probe")).events)


def test_a_march_that_fails_after_a_search_that_failed_tells_both():
    position = [[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 30.0, 0.0]]
    system = orbits.System(
        ["a", "b", "dust"], [1.0, 1.0, 0.0], position, np.zeros((3, 3)), units=orbits.DIMENSIONLESS
    )
    broken = Event(lambda t, q, v: np.where(t < 0.25, q[:, 2, 0], np.nan), name="mine", bodies="dust")
    options = {"duration": 5.0, "samples": 101, "check_step": False}
    with pytest.raises(SingularityError, match="a and b meet there") as caught:
        orbits.propagate(system, **options, events=broken)
    assert "the search for events had ended before: the function of 'mine' is nan" in caught.value.__notes__[0]
