"""What cannot be sought, and what fails on the way: said clearly, with all before it kept."""

import numpy as np
import pytest
from astropy import units as u
from numba import njit

import orbits
from orbits.errors import EventError, EventWarning, InputError, UnknownNameError
from orbits.events import (
    Apocentre,
    CloseApproach,
    CloserThan,
    Collision,
    Conjunction,
    Ejection,
    ElementCrossing,
    EnergyErrorAbove,
    Event,
    FartherThan,
    NodeCrossing,
    Occultation,
    Pericentre,
    PlaneCrossing,
    Transit,
)
from orbits.trajectory import events as tables

from ..coverings import each


def pair(**changes):
    bodies = {"star": {"gm": 1.0}, "planet": {"a": 1.0, "e": 0.3, "M": 0.3, "gm": 1e-9}}
    return orbits.System.from_elements(bodies, units=orbits.DIMENSIONLESS).replaced(**changes)


def sought(*events, **options):
    return orbits.propagate(pair(), duration=6.0, events=list(events), **options)


REFUSED = [
    (lambda: sought("pericentre"), "expected events such as"),
    (lambda: orbits.propagate(pair(), duration=1.0, events=7), "expected events such as"),
    (lambda: sought(CloseApproach("planet", "comet")), "there is no body 'comet'"),
    (lambda: sought(Pericentre("star", "star")), "'star' twice; expected two bodies"),
    (lambda: sought(CloserThan(0.1, "planet", "planet")), "'planet' twice"),
    (lambda: CloseApproach("planet", within=-1.0), "expected a finite number above 0"),
    (lambda: CloseApproach(3), "expected the name of a body, or None"),
    (lambda: NodeCrossing("planet", direction=2), "direction is 2; expected 1"),
    (lambda: NodeCrossing("planet", frame="galactic"), "there is no frame"),
    (lambda: PlaneCrossing("planet", [0.0, 0.0, 0.0]), "needs a direction"),
    (lambda: Pericentre("planet", then="halt"), "then = 'halt'; expected 'record', 'stop'"),
    (lambda: ElementCrossing("planet", "z", 1.0), "expected one of a, q, Q, P, e, inc"),
    (lambda: sought(ElementCrossing("planet", "P", -1.0)), "P = -1.0 is of no orbit"),
    (lambda: sought(ElementCrossing("planet", "e", -0.3)), "e = -0.3 is of no orbit"),
    (lambda: sought(ElementCrossing("planet", "inc", -5 * u.deg)), "inc = -5.0 deg is of no orbit"),
    (lambda: sought(ElementCrossing("planet", "inc", 4.0)), "inc = 4.0 is of no orbit"),
    (lambda: Transit("planet", 3, observer="star"), "expected names, as in Transit"),
    (lambda: Transit("planet", "star"), r"and 'star' has no observer; expected .* at infinity: .*along\("),
    (lambda: Occultation("planet", "star", observer=[0, 1, 1]), r"observer is \[0, 1, 1\]; .*along\("),
    (lambda: Conjunction("planet", "star", observer=np.ones(3)), r"has observer=.*; expected .*along\("),
    (
        lambda: sought(Transit("planet", "star", observer="Earth")),
        r"Transit.observer: there is no body 'Earth'.* at infinity: .*along\(",
    ),
    (lambda: sought(Conjunction("planet", "star", observer="star")), "'star' twice; expected three bodies"),
    (lambda: sought(Ejection(-2.0)), "expected a finite number above 0"),
    (lambda: Event(3), "expected a function of t, q and v, or a SymPy expression"),
    (lambda: sought(Event(lambda t, q: t)), "fails at the start of the run: TypeError"),
    (lambda: sought(Event(lambda t, q, v: q)), r"returned shape \(2, 2, 3\)"),
    (lambda: sought(Event(lambda t, q, v: np.nan * t)), "is nan at the start of the run"),
    (lambda: sought(Event(lambda t, q, v: t, bodies=("planet", "planet"))), "'planet' twice"),
    (lambda: orbits.propagate(pair(), duration=1.0, stop=CloserThan(0.1, then="stop")), "give it in events="),
]


ONE_BODY_TWICE = [
    lambda: Collision("a", "a"),
    lambda: CloseApproach("a", "a"),
    lambda: CloserThan(0.1, "a", "a"),
    lambda: FartherThan(0.1, "a", "a"),
    lambda: Pericentre("a", "a"),
    lambda: NodeCrossing("a", "a"),
    lambda: PlaneCrossing("a", about="a"),
    lambda: ElementCrossing("a", "e", 0.1, "a"),
    lambda: Conjunction("b", "a", observer="a"),
    lambda: Transit("a", "a", observer="b"),
    lambda: Event(lambda t, q, v: t, bodies=("a", "a")),
]


@each("call", ONE_BODY_TWICE)
def test_an_event_of_one_body_twice_is_refused_when_it_is_made(call):
    with pytest.raises(InputError, match=r"'a' twice; expected (two|three) bodies"):
        call()


@each(("call", "message"), REFUSED)
def test_what_cannot_be_sought_is_refused(call, message):
    with pytest.raises(InputError, match=message):
        call()


def test_a_transit_without_radii_is_refused_with_the_remedy():
    system = pair().add("moon", primary="star", a=2.0, gm=1e-9)
    event = Transit("planet", "star", observer="moon")
    with pytest.raises(InputError, match=r"Transit needs the radius of planet; expected radii in the system"):
        orbits.propagate(system, duration=1.0, events=event)
    with pytest.raises(InputError, match="needs the radius of star"):
        orbits.propagate(system.replaced(radii=[0.0, 0.1, 0.0]), duration=1.0, events=event)
    apparent = Conjunction("planet", "star", observer="moon", apparent=True)
    with pytest.raises(InputError, match="apparent positions need physical units"):
        orbits.propagate(system, duration=1.0, events=apparent)


def test_a_primary_is_needed_where_no_body_has_nearly_all_the_mass():
    system = orbits.System(["a", "b"], [1.0, 0.5], [[0, 0, 0], [1, 0, 0]], [[0, 0, 0], [0, 1, 0]],
                           units=orbits.DIMENSIONLESS)  # fmt: skip
    with pytest.raises(InputError, match="Pericentre: no body has nearly all the mass; name the primary"):
        orbits.propagate(system, duration=1.0, events=Pericentre("b"))
    assert orbits.propagate(system, duration=1.0, events=Pericentre("b", "a")).complete


def failing(t, q, v):
    return np.where(t > 3.0, np.inf, 1.0)


def test_a_function_that_is_not_finite_ends_the_run_with_all_before_it(tmp_path):
    events = [Apocentre("planet"), Event(failing, name="mine")]
    for path in (None, tmp_path / "run.h5"):
        with pytest.raises(EventError, match=r"'mine' is inf at t = 3\.\d+; expected finite numbers") as caught:
            sought(*events, archive=path)
        run = caught.value.trajectory
        assert 3.0 < caught.value.time < 3.5
        assert len(run) > 0
        assert run.events.kind.tolist() == ["apocentre"]  # at 2.84, in the same stretch
        run.close()
    again = orbits.Trajectory.open(tmp_path / "run.h5")
    assert again.events.kind.tolist() == ["apocentre"]
    again.close()


def test_what_happens_in_every_step_ends_at_a_bound_on_the_rows(monkeypatch, tmp_path):
    events = "orbits.propagation.events"
    for module in ("orbits.trajectory.events", f"{events}.log", f"{events}.search.along_motion"):
        monkeypatch.setattr(f"{module}.MOST_EVENTS", 50)
    event = Event(lambda t, q, v: np.sin(300.0 * t), name="wave")
    with pytest.raises(EventError, match=r"more than 50 events by t = 1\.\d+, 50 of them 'wave'\. Seek") as e:
        sought(event, archive=tmp_path / "run.h5")
    assert len(e.value.trajectory.events) == 50
    e.value.trajectory.close()


def test_two_events_that_act_on_one_body_at_once_are_refused():
    calls = []
    events = [
        Pericentre("planet", then=lambda t, system: calls.append(t)),
        CloseApproach("planet", "star", then=lambda t, system: calls.append(t)),
    ]
    with pytest.raises(EventError, match=r"'pericentre' and 'close approach' both act on (planet|star) at t"):
        sought(*events)
    assert not calls
    with pytest.raises(EventError):
        sought(*events[::-1])
    one = [events[0], CloseApproach("planet", "star")]
    assert len(sought(*one).events) == 2


def test_actions_on_massless_bodies_are_refused_with_a_remedy():
    system = pair().add("probe", primary="star", a=2.0)
    event = Pericentre("probe", then=lambda t, bodies: None)
    with pytest.raises(InputError, match=r"probe is a massless particle.*Give it a small mass"):
        orbits.propagate(system, dt=0.05, duration=1.0, events=event)
    run = orbits.propagate(system, dt=0.05, duration=6.0, events=Pericentre("planet"))
    assert run.events.kind.tolist() == ["pericentre"]


def test_an_expression_of_other_symbols_is_refused():
    import sympy

    with pytest.raises(InputError, match=r"expected t, and symbols of orbits\.events\.Event\.symbols"):
        sought(Event(sympy.Symbol("a") - 1))
    with pytest.raises(UnknownNameError, match="there is no body 'comet'"):
        sought(Event(Event.symbols("comet")[0] - 1))


def test_a_quantity_of_the_wrong_kind_is_refused():
    system = orbits.System.solar_system(bodies=["Sun", "Jupiter"])
    with pytest.raises(InputError, match="length"):
        orbits.propagate(system, duration=1 * u.yr, events=CloseApproach("Jupiter", "Sun", within=1 * u.s))
    assert tables.MOST_EVENTS == 32_768


def test_a_function_at_an_event_that_returns_something_else_ends_the_run():
    with pytest.raises(EventError, match=r"returned 3 at t = 5.98.*; expected a System, or None") as caught:
        sought(Pericentre("planet", then=lambda t, system: 3))
    assert len(caught.value.trajectory) > 90


def warned(system, event, duration=100.0, **options):
    with pytest.warns(EventWarning) as caught:
        run = orbits.propagate(system, duration=duration, samples=2, events=event, **options)
    return run, str(caught[0].message)


@pytest.mark.parametrize(
    ("elements", "event"),
    [
        ({"e": 0.0}, Pericentre("planet")),
        ({"e": 0.0}, CloserThan(1.0, "planet", "star")),
        ({"e": 0.0}, Event(lambda t, q, v: ((q[:, 1] - q[:, 0]) * (v[:, 1] - v[:, 0])).sum(axis=1))),
        ({"e": 0.1, "inc": 1e-15}, NodeCrossing("planet")),
        ({"e": 0.1, "inc": 0.3}, ElementCrossing("planet", "a", 1.0)),
        ({"e": 0.1, "inc": 0.3}, ElementCrossing("planet", "inc", 0.3)),
    ],
)
def test_zeros_of_a_function_that_is_round_off_are_left_out_and_said(elements, event):
    """Before, the apsides of a circular orbit filled the table: 800 in 32 revolutions."""
    bodies = {"star": {"gm": 1.0}, "planet": {"a": 1.0, "M": 0.3, "Omega": 0.4, "gm": 1e-9, **elements}}
    system = orbits.System.from_elements(bodies, units=orbits.DIMENSIONLESS)
    run, text = warned(system, event)
    assert len(run.events) == 0
    assert f"{type(event).__name__}(" in text
    assert "nothing but round-off" in text


def test_apsides_and_nodes_that_are_above_round_off_are_all_found_without_a_warning(recwarn):
    bodies = {"star": {"gm": 1.0}, "planet": {"a": 1.0, "e": 1e-9, "inc": 1e-9, "M": 0.3, "gm": 1e-9}}
    system = orbits.System.from_elements(bodies, units=orbits.DIMENSIONLESS)
    events = [Pericentre("planet"), NodeCrossing("planet", direction=1)]
    run = orbits.propagate(system, duration=2.0 * np.pi * 20, events=events)
    assert [run.events.kind.tolist().count(kind) for kind in ("pericentre", "ascending node")] == [20, 20]
    assert not [w for w in recwarn if issubclass(w.category, EventWarning)]


def test_a_run_does_not_stop_at_round_off():
    system = orbits.System.from_elements(
        {"star": {"gm": 1.0}, "planet": {"a": 1.0, "e": 0.0, "gm": 1e-9}}, units=orbits.DIMENSIONLESS
    )
    run, _ = warned(system, Pericentre("planet", then="stop"), 20.0)
    assert run.complete


def test_what_happens_in_every_step_is_said():
    run, text = warned(pair(), Event(lambda t, q, v: np.sin(60.0 * t), name="wave"))
    assert "Event(wave): 'wave' in every one of many steps" in text
    assert len(run.events) > 1000


@pytest.mark.parametrize(("rate", "duration", "said"), [(60.0, 5.0, True), (1.0, 30.0, False)])
def test_what_acts_in_every_step_is_said_too(rate, duration, said, recwarn):
    seen = []
    wave = Event(lambda t, q, v: np.sin(rate * t), name="wave", then=lambda t, system: seen.append(t))
    orbits.propagate(pair(), duration=duration, events=wave)
    warnings = [str(w.message) for w in recwarn if issubclass(w.category, EventWarning)]
    assert len(seen) > 8
    assert any("'wave' in every one of many steps" in text for text in warnings) == said


def test_a_condition_that_is_no_event_is_refused_with_its_place():
    with pytest.raises(InputError, match="EnergyErrorAbove ends a run after a whole step: give it as stop="):
        orbits.propagate(pair(), duration=1.0, events=[EnergyErrorAbove(1e-9)])


def test_a_warning_about_events_that_is_raised_keeps_the_run():
    import warnings

    with warnings.catch_warnings():
        warnings.simplefilter("error", EventWarning)
        with pytest.raises(EventWarning) as caught:
            orbits.propagate(pair(), duration=100.0, events=Event(lambda t, q, v: np.sin(60.0 * t)))
    assert caught.value.trajectory.complete


@pytest.mark.parametrize(
    ("late", "message"),
    [
        (lambda t: np.array(["a"] * len(t)), "could not convert string to float"),
        (lambda t: np.zeros((len(t), 2)), "it returned shape"),
        (lambda t: 1j * t, "complex numbers"),
    ],
)
def test_a_function_that_returns_no_numbers_on_the_way_ends_the_run_with_all_before_it(late, message):
    event = Event(lambda t, q, v: late(t) if t.max() > 5.0 else t + 1.0, name="mine")
    with pytest.raises(EventError, match=f"Event 'mine' fails between .*{message}.*all before") as caught:
        orbits.propagate(pair(), duration=6.0, events=[event])
    assert len(caught.value.trajectory) > 50


def test_a_function_that_changes_its_arguments_changes_nothing_else():
    def spoils(t, q, v):
        t += 1.0
        q[:], v[:] = 0.0, 0.0
        return np.ones(len(t))

    clean = orbits.propagate(pair(), duration=20.0, events=[ElementCrossing("planet", "f", 1.0)])
    spoilt = orbits.propagate(
        pair(), duration=20.0, events=[Event(spoils), ElementCrossing("planet", "f", 1.0)]
    )
    assert len(clean.events) == 4
    assert spoilt.events.time.value.tolist() == clean.events.time.value.tolist()


def test_the_table_says_what_was_sought_and_never_happened():
    events = [Pericentre("planet"), CloserThan(0.1, "planet", "star")]
    assert repr(sought(*events).events).startswith("1 event; never: closer than 0.1")
    assert repr(sought(events[1]).events) == "no events; never: closer than 0.1"
    assert repr(sought(events[0]).events).startswith("1 event\n")
    assert repr(sought().events) == "no events"
    assert repr(sought(*events).events[:0]) == "no events"  # a part says nothing about the whole


def test_a_word_that_was_met_is_not_said_to_be_missing():
    events = [Event(lambda t, q, v: t - 2.0, name="z"), Event(lambda t, q, v: t - 3.0, name="z", then="stop")]
    assert repr(sought(events[0]).events).startswith("1 event\n")
    assert repr(sought(*events).events).startswith("2 events\n")


def with_a_comet():
    return pair().add("comet", primary="star", a=2.0, e=0.1)


@pytest.mark.parametrize(
    "function",
    [
        Event.symbols("comet")[0],
        lambda t, q, v: q[:, 2, 0],
        lambda t, q, v: np.where(q[:, 2, 0] > 0.0, 1.0, -1.0),  # of NaN a number
    ],
    ids=["symbols", "function", "sign"],
)
def test_a_function_of_a_massless_body_that_the_event_is_not_about_is_told_the_remedy(function):
    with pytest.raises(InputError, match=r"NaN in .* as comet here: give Event\(..., bodies=\('comet',\)\)"):
        orbits.propagate(with_a_comet(), duration=6.0, events=Event(function, name="x"))
    found = orbits.propagate(with_a_comet(), duration=6.0, events=Event(function, name="x", bodies=("comet",)))
    assert len(found.events) == 1


def of_finite_numbers(t, q, v):
    if np.isinf(q).any():
        raise ValueError("not a place")
    return q[:, 1, 0]


def of_calls(t, q, v):
    of_calls.number = getattr(of_calls, "number", 0) + 1
    return q[:, 1, 0] + 1e-12 * of_calls.number


@pytest.mark.parametrize("function", [of_finite_numbers, of_calls])
def test_a_function_that_infinity_or_the_number_of_calls_matters_to_needs_no_massless_bodies(function):
    assert len(orbits.propagate(with_a_comet(), duration=6.0, events=Event(function, name="x")).events) == 2


def test_a_function_that_returns_booleans_is_refused():
    with pytest.raises(InputError, match=r"'x' fails .* returned booleans, which do not cross zero; expected numbers"):
        sought(Event(lambda t, q, v: q[:, 1, 0] > 0.0, name="x"))
    with pytest.raises(InputError, match=r"'x' fails .* returned booleans.* of one t, and of q and v \(bodies, 3\)"):
        sought(Event(njit(lambda t, q, v: q[1, 0] > 0.0), name="x"))


def test_a_compiled_function_of_many_times_is_told_that_it_gets_one():
    with pytest.raises(InputError, match=r"^[^\n]* of one t, and of q and v \(bodies, 3\), that returns a number"):
        sought(Event(njit(lambda t, q, v: q[:, 1, 0]), name="x"))


def test_times_in_messages_about_functions_have_their_unit():
    system = orbits.System.solar_system(bodies=["Sun", "Jupiter"])
    changed = Event(lambda t, q, v: t - 20.0, name="x", then=lambda t, system: system.replaced(softening=0.1))
    with pytest.raises(EventError, match="x at t = 20 d: the function changed something besides"):
        orbits.propagate(system, duration=100 * u.day, events=changed)
    late = Event(lambda t, q, v: np.zeros((len(t), 2)) if t.max() > 50.0 else t + 1.0, name="x")
    with pytest.raises(EventError, match=r"Event 'x' fails between t = .* and [\d.]+ d: it returned shape"):
        orbits.propagate(system, duration=100 * u.day, events=late)
