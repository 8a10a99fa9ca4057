"""Conditions and callbacks that end a run, through `propagate`."""

import dataclasses

import numpy as np
import pytest
from astropy import units as u

import orbits

from ..coverings import each
from ..problems import belt

GAUSS = orbits.Gauss(stages=8)


@pytest.fixture(scope="module")
def system():
    return belt(3)


def test_a_run_ends_where_two_bodies_are_close_and_says_so(system):
    stop = orbits.events.CloserThan(0.3 * u.au, "Venus", "Earth-Moon barycenter")
    run = orbits.propagate(system, GAUSS, dt=6 * u.day, duration=20 * u.yr, samples=[3000.0, 7000.0], stop=stop)
    assert run.stopped.condition is stop
    assert run.stopped.reason.startswith("Venus and Earth-Moon barycenter: closer than 0.3 AU at t = ")
    assert not run.complete
    assert len(run) == 0
    at = run.stopped.system
    apart = np.linalg.norm(at.q[at.names.index("Venus")] - at.q[at.names.index("Earth-Moon barycenter")])
    assert apart.to_value(u.au) == pytest.approx(0.3, rel=1e-14)  # about the rounding of positions of 1 au
    assert at.epoch == system.epoch + run.stopped.time
    plain = orbits.propagate(system, GAUSS, dt=6 * u.day, duration=run.stopped.time, samples=2)
    assert np.array_equal(plain.q[-1], at.q)  # to the last bit


def test_a_stopped_archive_goes_on_to_the_bits_of_a_run_that_was_not_stopped(system, tmp_path):
    options = {"dt": 6 * u.day, "duration": 3 * u.yr, "samples": 7}
    stop = [orbits.events.FartherThan(2.95 * u.au, "Ceres", "Sun"), orbits.events.EnergyErrorAbove(1e-3)]
    run = orbits.propagate(system, GAUSS, archive=tmp_path / "stopped.h5", stop=stop, **options)
    assert run.stopped.condition is stop[0]
    assert 0 < len(run) < 7
    resumed = orbits.resume(tmp_path / "stopped.h5")
    straight = orbits.propagate(system, GAUSS, **options)
    assert resumed.complete
    assert np.array_equal(resumed.q, straight.q)


def test_a_bound_of_the_energy_error_is_kept_by_an_archive_until_it_has_ended_the_run(system, tmp_path):
    # A run that was resumed before it went on past the bound, without a word.
    options = {"dt": 6 * u.day, "duration": 600 * u.day, "stop": orbits.events.EnergyErrorAbove(1e-6)}
    method, path = orbits.methods.RungeKutta4(), tmp_path / "run.h5"
    straight = orbits.propagate(system, method, **options)
    orbits.propagate(system, method, archive=path, callback=lambda t, now: t > 10 * u.day, **options).close()
    resumed = orbits.resume(path)
    assert resumed.stopped.reason == straight.stopped.reason
    assert resumed.stopped.condition == options["stop"]
    assert np.array_equal(resumed.q, straight.q)
    resumed.close()
    assert orbits.resume(path).complete


def test_any_pair_will_do(system):
    run = orbits.propagate(
        system, GAUSS, dt=6 * u.day, duration=3 * u.yr, samples=2, stop=orbits.events.CloserThan(0.3075 * u.au)
    )
    assert run.stopped.reason.startswith("Mercury and Venus: closer than 0.3075 AU")


def test_a_run_ends_when_its_energy_error_exceeds_a_bound(system):
    run = orbits.propagate(
        system, orbits.methods.RungeKutta4(), dt=6 * u.day, duration=9 * u.yr, stop=orbits.events.EnergyErrorAbove(1e-6)
    )
    assert run.stopped.reason.startswith("the energy error exceeded 1e-06")
    change = abs(run.stopped.system.energy() / system.energy() - 1)
    assert 1e-6 < change < 1.2e-6


def test_an_energy_error_at_the_end_of_a_run_within_a_step_is_told():
    bodies = [[0.0, 0.0, 0.0], [0.5, 0.0, 0.0]], [[0.0, 0.0, 0.0], [0.0, 3.0**0.5, 0.0]]
    pair = orbits.System(["a", "b"], [1.0, 1e-3], *bodies, units=orbits.DIMENSIONLESS).barycentric()
    options = {"dt": 0.04, "duration": 0.47, "samples": [0.0, 0.44, 0.47], "check_step": False}
    _, step, end = abs(orbits.propagate(pair, orbits.StormerVerlet(), **options).energy() / pair.energy() - 1)
    assert step < 0.99 * end  # which the condition tells apart
    for bound, met in (((step + end) / 2, True), (1.01 * end, False)):
        run = orbits.propagate(pair, orbits.StormerVerlet(), stop=orbits.events.EnergyErrorAbove(bound), **options)
        assert (run.stopped is not None) == met
        assert not met or run.stopped.time == run.times[-1] == 0.47
        assert not met or np.array_equal(run.stopped.system.q, run.q[-1])


def test_a_run_ends_when_the_clock_says_so(system):
    run = orbits.propagate(
        system, GAUSS, dt=6 * u.day, duration=1e6 * u.yr, samples=2, stop=orbits.events.WallTimeOver(0.05 * u.s)
    )
    assert run.stopped.reason.startswith("it took longer than 0.05 s")


def test_the_callback_sees_every_sample_and_may_end_the_run(system):
    seen = []

    def watch(t, state):
        seen.append((t, state))
        return len(seen) == 3

    run = orbits.propagate(system, GAUSS, dt=6 * u.day, duration=300 * u.day, samples=11, callback=watch)
    assert [t.to_value(u.day) for t, _ in seen] == [0.0, 30.0, 60.0]
    assert np.array_equal(seen[2][1].q, run.q[2])
    assert seen[2][1].epoch == system.epoch + 60 * u.day
    assert len(run) == 3
    assert run.stopped.reason.startswith("the callback ended the run at t = 60")
    assert run.stopped.condition is None


@pytest.mark.parametrize(
    ("stop", "message"),
    [
        ("soon", "expected conditions"),
        ([1], "expected conditions"),
        (orbits.events.CloserThan(1 * u.kg), "length in AU"),
        (orbits.events.CloserThan(0.1, "Vulcan"), "Vulcan"),
        (orbits.events.CloserThan(0.1, "Venus", "venus"), "two bodies"),
        (orbits.events.CloserThan(9 * u.au, "Venus", "Sun"), "at the start already"),
        (orbits.events.FartherThan(0.1 * u.au, "Venus", "Sun"), "at the start already"),
        ([orbits.events.EnergyErrorAbove(1e-3), orbits.events.EnergyErrorAbove(1e-2)], "at most one"),
    ],
)
def test_what_cannot_end_a_run_is_refused(system, stop, message):
    with pytest.raises(orbits.errors.InputError, match=message):
        orbits.propagate(system, GAUSS, dt=6 * u.day, duration=1 * u.yr, stop=stop)


@pytest.mark.parametrize(
    "bound", [orbits.events.CloserThan(9 * u.au, "Venus", "Sun"), orbits.events.FartherThan(0.1 * u.au, "Venus", "Sun")]
)
def test_a_bound_passed_at_the_start_is_refused_for_events_that_stop_as_for_conditions(system, bound):
    options = {"dt": 6 * u.day, "duration": 100 * u.day, "check_step": False}
    stops = dataclasses.replace(bound, then="stop")
    with pytest.raises(orbits.errors.InputError, match=r"Venus and Sun are .* apart at the start already"):
        orbits.propagate(system, GAUSS, events=stops, **options)
    assert orbits.propagate(system, GAUSS, events=bound, **options).complete  # it records when they get there again


def test_a_callback_must_be_a_function(system):
    with pytest.raises(orbits.errors.InputError, match="callback"):
        orbits.propagate(system, GAUSS, dt=6 * u.day, duration=1 * u.yr, callback=3)


@pytest.mark.parametrize("kind", [orbits.events.CloserThan, orbits.events.FartherThan])
def test_pairs_of_many_bodies_that_are_not_looked_at_could_not_have_met(kind):
    """A hundred bodies, of which most pairs are too far from the bound to be followed, or too close to it."""
    rng, n = np.random.default_rng(5), 100
    q, v = rng.normal(size=(n, 3)), 0.5 * rng.normal(size=(n, 3))
    names = [f"b{k}" for k in range(n)]
    ball = orbits.System(names, gm=np.full(n, 1 / n), q=q, v=v, units=orbits.DIMENSIONLESS, softening=0.05)
    options = {"dt": 2**-8, "check_step": False}
    path = orbits.propagate(ball, orbits.StormerVerlet(), duration=1.0, samples=257, **options).q
    apart = np.linalg.norm(path[:, :, None] - path[:, None], axis=-1)[:, ~np.eye(n, dtype=bool)]
    extreme = apart.min(axis=1) if kind is orbits.events.CloserThan else -apart.max(axis=1)
    bound = abs(extreme[1:].min()) * (1 + 1e-12 if kind is orbits.events.CloserThan else 1 - 1e-12)
    first = int(np.argmax(np.abs(extreme) < bound if kind is orbits.events.CloserThan else np.abs(extreme) > bound))
    run = orbits.propagate(ball, orbits.StormerVerlet(), duration=1.0, samples=2, stop=kind(bound), **options)
    assert (first - 1) * 2**-8 <= run.stopped.time <= first * 2**-8


def test_distances_may_be_texts(system):
    stop = orbits.events.CloserThan("0.3 AU", "Venus", "Earth-Moon barycenter")
    run = orbits.propagate(system, GAUSS, dt=6 * u.day, duration=20 * u.yr, samples=2, stop=stop)
    assert "closer than 0.3 AU" in run.stopped.reason


@each(
    ("condition", "given", "message"),
    [
        (orbits.events.CloserThan, (0.0, "Venus"), "above 0"),
        (orbits.events.CloserThan, (np.nan * u.au,), "above 0"),
        (orbits.events.FartherThan, (-1.0 * u.au,), "above 0"),
        (orbits.events.FartherThan, (np.inf,), "above 0"),
        (orbits.events.CloserThan, ([1.0, 2.0] * u.au,), "an array of shape"),
        (orbits.events.CloserThan, ("near",), "text with a unit"),
        (orbits.events.CloserThan, (None,), "real number|above 0"),
        (orbits.events.CloserThan, (0.1, 3), "name of a body"),
        (orbits.events.FartherThan, (0.1, "Venus", ["Sun"]), "name of a body"),
        (orbits.events.EnergyErrorAbove, (-1.0,), "above 0"),
        (orbits.events.EnergyErrorAbove, (np.inf,), "above 0"),
        (orbits.events.EnergyErrorAbove, ("little",), "real number"),
        (orbits.events.WallTimeOver, (0.0,), "above 0"),
        (orbits.events.WallTimeOver, (1 * u.au,), "expected a time"),
    ],
)
def test_a_condition_that_cannot_hold_is_refused_where_it_is_made(condition, given, message):
    with pytest.raises(orbits.errors.InputError, match=message):
        condition(*given)


@pytest.mark.parametrize("callback", [lambda: None, lambda t: None, lambda t, state, more: None, lambda *, t: None])
def test_a_callback_of_other_than_two_arguments_is_refused_before_the_run(system, callback):
    with pytest.raises(orbits.errors.InputError, match="expected a function of the time and the system"):
        orbits.propagate(system, GAUSS, dt=6 * u.day, duration=1 * u.yr, callback=callback)


@pytest.mark.parametrize("answer", [np.ones(3), "no", 1])
def test_a_callback_that_answers_neither_yes_nor_no_is_refused(system, answer):
    with pytest.raises(orbits.errors.InputError, match=r"callback returned .* expected True, False or None"):
        orbits.propagate(system, GAUSS, dt=6 * u.day, duration=1 * u.yr, callback=lambda t, state: answer)


def test_what_a_callback_raises_passes_through(system):
    def broken(t, state):
        raise TypeError("of the callback's own")

    with pytest.raises(TypeError, match="of the callback's own"):
        orbits.propagate(system, GAUSS, dt=6 * u.day, duration=1 * u.yr, callback=broken)
    run = orbits.propagate(system, GAUSS, dt=6 * u.day, duration=1 * u.yr, callback=lambda *given: np.bool_(True))
    assert len(run) == 1
