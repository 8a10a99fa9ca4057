"""Events of runs against what is known of them: Kepler's orbits, almanacs, and the states of the runs themselves."""

import numpy as np
import pytest
from astropy import units as u
from astropy.time import Time

import orbits
from orbits.events import (
    Apocentre,
    CloseApproach,
    CloserThan,
    Conjunction,
    Ejection,
    ElementCrossing,
    Event,
    FartherThan,
    NodeCrossing,
    Occultation,
    Opposition,
    Pericentre,
    PlaneCrossing,
    Transit,
)

from ..coverings import cover, first

GM = 1e-9
PERIOD = 2.0 * np.pi / np.sqrt(1.0 + GM)
LATE = 0.3 / (2.0 * np.pi)
"""The fraction of a period since the pericentre at which the planet starts."""


def pair(e=0.3, inc=0.0):
    """A star and a planet with a = 1, 0.3 radians of mean anomaly after its pericentre."""
    elements = {"a": 1.0, "e": e, "inc": inc, "Omega": 0.4, "omega": 0.9, "M": 0.3, "gm": GM}
    return orbits.System.from_elements({"star": {"gm": 1.0}, "planet": elements}, units=orbits.DIMENSIONLESS)


def times(run, kind):
    return run.events.time.value[run.events.kind == kind]


APSIDES = [Pericentre("planet"), Apocentre("planet")]


# Seen: 1.4e-12, as r.v and so an apocentre is known to 1e-16 / e; 4.4e-13; and 2.9e-12, the phase of such an orbit.
@cover(("case", "direction"), [(0.1, 4e-12), (0.9, 1e-12), (0.99, 6e-12)], [1, -1], strength=1)
def test_pericentres_and_apocentres_are_those_of_kepler(case, direction):
    e, bound = case
    run = orbits.propagate(pair(e), duration=direction * 20 * PERIOD, events=APSIDES)
    turns = np.arange(1, 21) if direction > 0 else -np.arange(20)
    np.testing.assert_allclose(times(run, "pericentre"), (turns - LATE) * PERIOD, rtol=0.0, atol=bound)
    np.testing.assert_allclose(times(run, "apocentre"), (turns - 0.5 - LATE) * PERIOD, rtol=0.0, atol=bound)
    near = run.events.distance.value[run.events.kind == "pericentre"]
    np.testing.assert_allclose(near, 1.0 - e, rtol=0.0, atol=1e-14)
    assert (np.diff(run.events.time.value) * direction > 0.0).all()


@pytest.mark.parametrize(
    ("method", "dt", "bound"),
    [("gauss", PERIOD / 6, 1e-12), ("gauss(stages=4)", PERIOD / 40, 4e-15), ("stormer-verlet", PERIOD / 200, 1e-12)],
)
def test_the_times_of_events_are_those_of_the_methods_own_partial_steps_also_where_no_polynomial_is_good(
    method, dt, bound
):
    run = orbits.propagate(pair(), method, dt=dt, duration=10 * PERIOD, samples=2, events=APSIDES, check_step=False)
    assert len(run.events) == 20
    states = run.at(run.events.time)
    q, v = ((x[:, 1] - x[:, 0]).value for x in (states.q, states.v))
    # r.v at these times; it changes by about 0.3 in a time of 1.
    assert abs((q * v).sum(axis=1)).max() < bound


@pytest.mark.parametrize("e", [0.3, 0.9])
def test_events_in_transformed_time_are_those_of_kepler(e):
    """Its method has no polynomial: the states are steps of its clock, and the last step of a run has no length."""
    bodies = {"star": {"gm": 1.0}, "planet": {"a": 1.0, "e": e, "M": 0.3, "gm": 0.5}}
    system, period = orbits.System.from_elements(bodies, units=orbits.DIMENSIONLESS), 2.0 * np.pi / np.sqrt(1.5)
    events = [Pericentre("planet", "star"), Apocentre("planet", "star")]
    run = orbits.propagate(system, dt=orbits.TimeTransformed(step=0.3), duration=5.4 * period, events=events)
    turns = np.arange(1, 6) - LATE
    # 1.8e-14 and 4.3e-14 seen.
    np.testing.assert_allclose(times(run, "pericentre"), turns * period, rtol=0.0, atol=1e-13)
    np.testing.assert_allclose(times(run, "apocentre"), (turns - 0.5) * period, rtol=0.0, atol=1e-13)


def test_nodes_alternate_and_lie_in_the_plane():
    run = orbits.propagate(pair(inc=0.7), duration=10 * PERIOD, events=NodeCrossing("planet"))
    assert run.events.kind.tolist() == ["ascending node", "descending node"] * 10 or run.events.kind.tolist() == [
        "descending node",
        "ascending node",
    ] * 10
    states = run.at(run.events.time)
    q, v = ((x[:, 1] - x[:, 0]).value for x in (states.q, states.v))
    assert abs(q[:, 2]).max() < 1e-14
    assert ((v[:, 2] > 0.0) == (run.events.kind == "ascending node")).all()
    up = orbits.propagate(pair(inc=0.7), duration=10 * PERIOD, events=NodeCrossing("planet", direction=1))
    np.testing.assert_array_equal(up.events.time.value, times(run, "ascending node"))


def test_a_plane_through_another_body_moves_with_it():
    normal = [1.0, 2.0, 0.5]
    event = PlaneCrossing("planet", normal, about="star", offset=0.2, direction=-1)
    run = orbits.propagate(pair(inc=0.7), duration=5 * PERIOD, events=event)
    assert len(run.events) == 5
    states = run.at(run.events.time)
    q = (states.q[:, 1] - states.q[:, 0]).value
    np.testing.assert_allclose(q @ normal / np.linalg.norm(normal), 0.2, rtol=0.0, atol=1e-14)


def test_a_distance_is_crossed_both_ways_once_an_orbit():
    events = [CloserThan(0.9, "planet", "star"), FartherThan(0.9, "planet", "star")]
    run = orbits.propagate(pair(), duration=5 * PERIOD, events=events)
    assert run.events.kind.tolist() == ["farther than 0.9", "closer than 0.9"] * 5
    np.testing.assert_allclose(run.events.distance.value, 0.9, rtol=0.0, atol=1e-14)


def test_a_close_approach_counts_only_within_the_distance_and_agrees_with_closest_approaches():
    system = orbits.System.solar_system(bodies=["Sun", "Venus", "Earth", "Moon", "Mars", "Jupiter"])
    events = [CloseApproach("Earth", "Venus", within=0.28 * u.au), CloseApproach("Earth", "Venus")]
    run = orbits.propagate(system, duration=10 * u.yr, events=events[0])
    found = run.closest_approaches()["Venus"][0]
    nearest = run.events[int(np.argmin(run.events.distance))]
    assert {nearest.body, nearest.other} == {found.body, found.other}
    assert abs(nearest.distance - found.distance) < 1e-12 * u.au
    # At a minimum of the distance its time is known to the square root of what the distance is known to.
    assert abs(nearest.time - found.time) < 1e-5 * u.day
    every = orbits.propagate(system, duration=10 * u.yr, events=events[1])
    np.testing.assert_array_equal(
        every.events.time[every.events.distance < 0.28 * u.au].value, run.events.time.value
    )
    assert len(every.events) > len(run.events) > 1


# The cubic between the states of Verlet's method is 5e-8 from its partial steps, in which the top is sought again.
@pytest.mark.parametrize(
    ("method", "least", "way"),
    first(3, [
        ("stormer-verlet", 1e-10, 1.0),
        ("gauss(stages=4)", 1e-10, -1.0),
        ("gauss(stages=8)", 1e-12, 1.0),
        ("runge-kutta-4", 1e-10, 1.0),
        ("stormer-verlet", 1e-10, -1.0),
        ("gauss(stages=8)", 1e-12, -1.0),
    ]),
)
def test_two_crossings_of_a_plane_within_one_step_are_found_with_and_without_a_polynomial(method, least, way):
    """A body that only just rises above a plane, between two checks of one step."""
    system, dt = pair(), 0.025
    run = orbits.propagate(system, method, dt=dt, duration=way * PERIOD, samples=2, check_step=False)
    when, apart = 0.5 * PERIOD, 0.5 * PERIOD
    for _ in range(5):  # closer and closer to the top
        times = np.clip(when + apart * np.linspace(-1.0, 1.0, 401), 0.0, PERIOD)
        fine = run.at(way * times)
        x = (fine.q[:, 1, 0] - fine.q[:, 0, 0]).value
        top = int(np.argmax(x))
        when, apart = times[top], apart / 50.0
    for depth in (1e-4, 1e-6, least):
        event = PlaneCrossing("planet", [1.0, 0.0, 0.0], about="star", offset=x[top] - depth)
        found = orbits.propagate(
            system, method, dt=dt, duration=way * PERIOD, samples=2, events=event, check_step=False
        ).events
        assert len(found) == 2
        states = run.at(found.time)
        np.testing.assert_allclose(
            (states.q[:, 1, 0] - states.q[:, 0, 0]).value, x[top] - depth, rtol=0.0, atol=4e-15
        )


@pytest.mark.parametrize("phase", [0.3, 0.5, 0.9])
def test_bodies_that_come_within_a_distance_below_the_difference_of_a_long_step_from_its_cubic_are_found(phase):
    """The cubic of Verlet's step is 1e-3 from its partial steps, in which the pair comes to 4e-4."""
    method, dt = "stormer-verlet", 0.2
    q, v = [[0, 0, 0], [1, 0, 0], [1, 0, 1e-5]], [[0, 0, 0], [0, 1, 0], [0.3, 0.8, 0]]
    met = orbits.System(["star", "a", "b"], [1.0, 1e-18, 1e-18], q, v, units=orbits.DIMENSIONLESS)
    ago = -(1.0 + phase) * dt
    back = orbits.propagate(met, dt=0.01, duration=ago, samples=[ago], check_step=False)
    start, options = met.replaced(q=back.q[-1], v=back.v[-1]), {"dt": dt, "duration": 4 * dt, "samples": 2}
    least = orbits.propagate(start, method, events=CloseApproach("a", "b"), check_step=False, **options).events
    assert 2e-4 < least.distance[0].value < 5e-4
    bound = 1.25 * least.distance[0].value
    events = [CloserThan(bound, "a", "b"), FartherThan(bound, "a", "b")]
    run = orbits.propagate(start, method, events=events, check_step=False, **options)
    assert [kind.split()[0] for kind in run.events.kind] == ["closer", "farther"]
    np.testing.assert_allclose(run.events.distance.value, bound, rtol=0.0, atol=1e-14)


@pytest.fixture(scope="module")
def year_2012():
    names = ["Sun", "Mercury", "Venus", "Earth", "Moon", "Mars", "Jupiter", "Saturn"]
    radii = [695_700.0, 2439.7, 6051.8, 6371.0, 1737.4, 3389.5, 69_911.0, 58_232.0] * u.km
    system = orbits.System.solar_system("2012-01-01", bodies=names).replaced(radii=radii)
    from_earth = {"observer": "Earth", "apparent": True}
    events = [
        Transit("Venus", "Sun", **from_earth),
        Conjunction("Venus", "Sun", **from_earth),
        Opposition("Mars", "Sun", **from_earth),
        Transit("Moon", "Sun", **from_earth),
        Occultation("Sun", "Moon", **from_earth),
    ]
    return orbits.propagate(system, duration=1 * u.yr, events=events)


# Geocentric, UT: F. Espenak, "2012 Transit of Venus", NASA GSFC; with other radii, for 5 to 13 s at the contacts.
VENUS = {
    "transit, contact 1": ("2012-06-05T22:09:38", 15.0),
    "transit, contact 2": ("2012-06-05T22:27:34", 15.0),
    "transit, closest": ("2012-06-06T01:29:36", 3.0),
    "transit, contact 3": ("2012-06-06T04:31:39", 15.0),
    "transit, contact 4": ("2012-06-06T04:49:35", 15.0),
}


def test_the_transit_of_venus_of_2012_is_that_of_the_almanac(year_2012):
    seen = year_2012.events["Venus"]
    found = {event.kind: event.date for event in seen if event.kind.startswith("transit")}
    assert list(found) == list(VENUS)
    for kind, (date, bound) in VENUS.items():
        assert abs((found[kind] - Time(date, scale="utc")).to_value(u.s)) < bound
    closest = next(event for event in seen if event.kind == "transit, closest")
    assert abs(closest.angle.to_value(u.arcsec) - 554.4) < 0.5  # as there


def test_oppositions_and_conjunctions_are_those_of_the_almanac(year_2012):
    (mars,) = [event for event in year_2012.events if event.kind == "opposition"]
    (venus,) = [event for event in year_2012.events if event.kind == "conjunction"]
    # The Astronomical Almanac gives hours: Mars 2012 March 3 20h, Venus 2012 June 6 01h.
    assert abs(mars.date - Time("2012-03-03T20:00", scale="utc")) < 30 * u.min
    assert abs(venus.date - Time("2012-06-06T01:00", scale="utc")) < 30 * u.min


def test_an_occultation_of_the_sun_by_the_moon_is_a_transit_of_the_moon_over_the_sun(year_2012):
    events = year_2012.events
    transits = [event for event in events["Moon"] if event.kind.startswith("transit")]
    hidden = [event for event in events["Moon"] if event.kind.startswith("occultation")]
    assert len(transits) == len(hidden) == 6
    for one, other in zip(transits, hidden, strict=True):
        # The same function but for its rounding: an angle of 0.5 degrees to 1e-16, at 0.5 degrees an hour.
        assert abs(one.time - other.time) < 1e-9 * u.day
    dates = {event.date.iso[:10] for event in transits}
    assert dates == {"2012-05-20", "2012-05-21", "2012-11-13"}  # the solar eclipses of that year


def test_elements_cross_a_value_where_the_states_say_so():
    system = orbits.System.solar_system(bodies=["Sun", "Mercury", "Jupiter", "Saturn"])
    run = orbits.propagate(system, duration=30 * u.yr, samples=2001)
    series = run.elements("Sun")
    for name in ("a", "e", "q", "Q", "P", "inc", "Omega"):
        of_saturn = series.a[:, 2] * (1 + series.e[:, 2]) if name == "Q" else getattr(series, name)[:, 2]
        value = 0.5 * (of_saturn.min() + of_saturn.max())
        found = orbits.propagate(system, duration=30 * u.yr, events=ElementCrossing("Saturn", name, value))
        crossings = np.flatnonzero(np.diff(np.sign((of_saturn - value).value)))
        assert len(found.events) == len(crossings) > 0, name
        at = found.at(found.events.time).elements("Sun")
        there = at.a[:, 2] * (1 + at.e[:, 2]) if name == "Q" else getattr(at, name)[:, 2]
        # Relative to the value; the elements of a state have some roundings.
        np.testing.assert_allclose(there.value, value.value, rtol=3e-13)
        rises = [event.kind.split(" ")[1] == "rises" for event in found.events]
        assert rises == (np.diff(of_saturn.value)[crossings] > 0.0).tolist()


def test_negative_apocentre_distances_of_hyperbolas_rise_and_fall_as_those_of_ellipses_do():
    comet, planet = {"q": 1.0, "e": 1.5, "inc": 0.4, "f": -2.0}, {"a": 1.6, "gm": 0.05}
    bodies = {"star": {"gm": 1.0}, "comet": comet, "planet": planet}
    system = orbits.System.from_elements(bodies, units=orbits.DIMENSIONLESS)
    series = orbits.propagate(system, duration=20.0, samples=201).elements("star")
    Q = (series.a * (1 + series.e))[:, 0].value
    value = 0.5 * (Q[0] + Q[-1])
    run = orbits.propagate(system, duration=20.0, events=ElementCrossing("comet", "Q", value))
    crossings = np.flatnonzero(np.diff(np.sign(Q - value)))
    assert [event.kind.split(" ")[1] == "rises" for event in run.events] == (np.diff(Q)[crossings] > 0.0).tolist()
    assert len(crossings) == 3


def test_the_argument_of_pericentre_and_the_true_anomaly_cross_an_angle():
    system = pair(e=0.4, inc=0.5)
    run = orbits.propagate(system, duration=3 * PERIOD, events=ElementCrossing("planet", "f", 2.0))
    assert len(run.events) == 3
    found = run.at(run.events.time).elements("star")
    # 3.5e-13 seen: the states of another march.
    np.testing.assert_allclose(found.f[:, 0].to_value(u.rad), 2.0, rtol=0.0, atol=1e-12)
    at = ElementCrossing("planet", "omega", 0.9 + 1e-3)
    assert len(orbits.propagate(system, duration=3 * PERIOD, events=at).events) == 0  # Kepler's ellipse stands still


def test_a_body_is_ejected_once_and_only_with_energy_to_leave():
    q = [[-0.5, 0, 0], [0.5, 0, 0], [0, 5, 0], [0, 0, 5]]
    v = [[0, -0.7, 0], [0, 0.7, 0], [0, 1.5, 0], [0, 0, 0.8]]
    system = orbits.System(["a", "b", "fast", "slow"], [1.0, 1.0, 1e-6, 1e-6], q, v, units=orbits.DIMENSIONLESS)
    run = orbits.propagate(system, duration=20.0, events=Ejection(8.0))
    (event,) = run.events
    assert (event.kind, event.body) == ("ejection", "fast")
    assert event.distance.value == pytest.approx(8.0, abs=1e-12)
    assert float(np.linalg.norm(run.q[-1, 3].value)) > 8.0  # the slow one is beyond as well, but will come back


def own(t, q, v):
    return q[:, 1, 0] - q[:, 0, 0] - 0.1 * np.sin(t)


def test_a_function_in_numpy_compiled_and_of_sympy_give_the_same_events():
    import math

    import sympy
    from numba import njit

    @njit
    def compiled(t, q, v):
        return q[1, 0] - q[0, 0] - 0.1 * math.sin(t)

    x, x0 = Event.symbols("planet")[0], Event.symbols("star")[0]
    expression = x - x0 - sympy.sin(sympy.Symbol("t")) / 10
    rows = []
    for function in (own, compiled, expression):
        event = Event(function, name="mine", bodies=("planet", "star"))
        rows.append(orbits.propagate(pair(), duration=5 * PERIOD, events=event).events)
    assert len(rows[0]) == 10
    assert rows[0][0].kind == "mine"
    assert (rows[0][0].body, rows[0][0].other) == ("planet", "star")
    for other in rows[1:]:
        np.testing.assert_allclose(other.time.value, rows[0].time.value, rtol=0.0, atol=2e-14)


def test_events_that_only_record_change_no_bit_of_the_run():
    plain = orbits.propagate(pair(0.9), duration=5 * PERIOD, samples=37)
    watched = orbits.propagate(pair(0.9), duration=5 * PERIOD, samples=37, events=[*APSIDES, Event(own)])
    np.testing.assert_array_equal(plain.q, watched.q)
    np.testing.assert_array_equal(plain.v, watched.v)
    assert len(watched.events) > 10


def test_the_samples_of_a_run_do_not_change_a_bit_of_its_events():
    tables = [
        orbits.propagate(
            pair(0.9), dt=dt, duration=5 * PERIOD, samples=samples, events=APSIDES, check_step=False
        ).events
        for dt in (None, PERIOD / 64)
        for samples in (2, 37, 1000)
    ]
    for few in (tables[:3], tables[3:]):
        assert len(few[0]) == 10
        for other in few[1:]:
            np.testing.assert_array_equal(other._rows, few[0]._rows)


def test_a_run_stops_at_an_event_with_the_state_there():
    event = Apocentre("planet", then="stop")
    run = orbits.propagate(pair(), duration=5 * PERIOD, samples=101, events=[Pericentre("planet"), event])
    at = (0.5 - LATE) * PERIOD
    assert run.stopped.condition == event
    assert run.stopped.time.value == pytest.approx(at, abs=4e-13)
    assert "planet and star: apocentre at t = 2.84" in run.stopped.reason
    assert run.times[-1] <= at < run.times[-1] + 5 * PERIOD / 100
    way = np.diff(run.stopped.system.q.value, axis=0)[0]
    assert np.linalg.norm(way) == pytest.approx(1.3, abs=1e-14)
    assert run.events.kind.tolist() == ["apocentre"]
    assert not run.complete


def test_a_run_stops_at_an_event_between_its_last_step_and_a_sample():
    """Off the grid of long steps, samples, the end of the run and events all lie within one step."""
    event = Apocentre("planet", then="stop")
    for samples in ([0.0, 1.0, 2.84, 2.85, 2.95], [0.0, 2.95]):
        run = orbits.propagate(pair(), dt=1.0, duration=2.95, samples=samples, events=event, check_step=False)
        assert run.stopped.time.value == pytest.approx(2.8416, abs=1e-3)  # the orbit of a step that is far too long
        assert run.times.tolist() == [t for t in samples if t < 2.845]
        assert len(run.events) == 1


def test_a_function_is_called_at_an_event_and_the_run_goes_on():
    seen = []
    event = Pericentre("planet", then=lambda t, system: seen.append((t.value, system)))
    run = orbits.propagate(pair(), duration=3 * PERIOD, events=event)
    assert [t for t, _ in seen] == run.events.time.value.tolist()
    assert len(seen) == 3
    for _, system in seen:
        q, v = (np.diff(x.value, axis=0)[0] for x in (system.q, system.v))
        assert abs(q @ v) < 3e-13  # 8e-14 seen: the velocity of the polynomial, and that of a step to this time
    plain = orbits.propagate(pair(), duration=3 * PERIOD)
    np.testing.assert_array_equal(plain.q, run.q)


def test_the_table_has_dates_units_and_names():
    system = orbits.System.solar_system(bodies=["Sun", "Venus", "Earth", "Moon", "Mars", "Jupiter"])
    run = orbits.propagate(system, duration=1 * u.yr, events=[Pericentre("Earth"), NodeCrossing("Mars")])
    table = run.events.to_table()
    assert table.colnames == ["date", "time", "kind", "body", "other", "distance", "speed"]
    assert table["time"].unit == u.day
    assert table["distance"].unit == u.au
    np.testing.assert_allclose((table["date"] - system.epoch).to_value(u.day), table["time"].value, rtol=1e-12)
    frame = run.events.to_pandas()
    assert frame.attrs["units"]["distance"] == "AU"
    assert list(frame["body"]) == list(table["body"])
    assert abs(frame["date"][0] - np.datetime64(run.events[0].date.iso)) < np.timedelta64(2, "ms")
    assert "pericentre      Earth  Sun" in repr(run.events)
    assert "<table>" in run.events._repr_html_()
    assert len(run.events["Earth"]) + len(run.events["Mars"]) == len(run.events)
    assert run.events[-1].time == run.events.time[-1]
    assert "pericentre of Earth and Sun" in str(run.events["Earth"][0])


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_the_argument_of_pericentre_in_the_reference_plane_is_that_of_elements(way):
    """There Omega is 0: the node is no direction of its own."""
    system = orbits.System.from_elements(
        {"star": {"gm": 1.0}, "giant": {"gm": 1e-2, "a": 5.0}, "b": {"gm": 0.0, "a": 1.0, "e": 0.2}},
        units=orbits.DIMENSIONLESS,
    )
    system = system.replaced(v=system.v * [[1.0], [1.0], [way]])
    found = orbits.propagate(system, duration=20.0, events=ElementCrossing("b", "omega", 1e-3)).events
    run = orbits.propagate(system, duration=20.0, samples=2001)
    off = np.sin(run.elements(primary="star")["b"].omega.to_value(u.rad) - 1e-3)
    before = np.flatnonzero(off[:-1] * off[1:] < 0.0)
    assert len(found) == len(before) > 0
    assert np.all(np.abs(found.time - run.t[before] - 0.005) <= 0.005)


def test_a_run_without_events_and_one_in_which_none_happens_have_an_empty_table():
    run = orbits.propagate(pair(), duration=1.0)
    assert len(run.events) == 0
    assert repr(run.events) == "no events"
    never = orbits.propagate(pair(), duration=1.0, events=CloserThan(0.01, "planet", "star"))
    assert len(never.events) == 0
    assert len(never.events.to_table()) == 0
    assert never.complete
