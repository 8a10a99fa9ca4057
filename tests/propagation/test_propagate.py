"""The loop from sample to sample: the grid of steps, sampling, direction, threads, failure."""

from itertools import pairwise

import numpy as np
import pytest
from astropy import units as u

import orbits
from orbits.elements import two_body
from orbits.errors import ConvergenceError, InputError, SingularityError
from orbits.marching.clocks.constant import ConstantSteps
from orbits.time_grid import rounded_step

from ..coverings import each
from ..problems import belt

METHODS = [orbits.StormerVerlet(), orbits.Gauss(stages=4), orbits.methods.ExplicitEuler(), orbits.methods.RungeKutta4()]
IDS = [m.label for m in METHODS]


def binary(e=0.3, particle=True):
    names, gm = ["star", "planet"], [1.0, 1e-3]
    q = [[0, 0, 0], [1 - e, 0, 0]]
    v = [[0, 0, 0], [0, np.sqrt(1.001 * (1 + e) / (1 - e)), 0]]
    if particle:
        names, gm = [*names, "dust"], [*gm, 0.0]
        q, v = [*q, [0, 3.0, 0.1]], [*v, [-0.55, 0, 0.02]]
    return orbits.System(names, gm, q, v, units=orbits.DIMENSIONLESS)


@pytest.mark.parametrize("method", METHODS, ids=IDS)
def test_sampling_does_not_change_the_run(method):
    few = orbits.propagate(binary(), method, dt=0.03, duration=3.0, samples=2)
    many = orbits.propagate(binary(), method, dt=0.03, duration=3.0, samples=[0.0, 0.011, 1.7, 2.0, 2.0000001, 3.0])
    assert np.array_equal(few.q[-1], many.q[-1])
    assert np.array_equal(few.v[-1], many.v[-1])


@pytest.mark.parametrize("method", [orbits.StormerVerlet(), orbits.Gauss(stages=4)], ids=lambda m: m.label)
def test_a_sample_off_the_grid_is_a_partial_step(method):
    """At t = k dt + r the sample is the result of k steps of dt and one step of r."""
    run = orbits.propagate(binary(), method, dt=0.125, duration=1.0, samples=[0.8])
    start = orbits.propagate(binary(), method, dt=0.125, duration=0.75, samples=[0.75])
    rest = orbits.propagate(start[-1], method, dt=0.8 - 0.75, duration=0.8 - 0.75, samples=2)
    assert np.abs(run.q[0] - rest.q[-1]).max() < 4e-16  # the low parts are lost in between
    assert np.array_equal(orbits.propagate(binary(), method, dt=0.125, duration=1.0, samples=[0.75]).q[0], start.q[-1])


@pytest.mark.parametrize("duration", [7.3, -7.3])
def test_forwards_and_backwards_follow_the_exact_orbit(duration):
    system = binary(particle=False)
    run = orbits.propagate(system, orbits.Gauss(stages=8), dt=0.2, duration=duration, samples=12)
    x = system.values
    for t, q in zip(run.times, run.q.value, strict=True):
        relative, _ = two_body(x.q[1] - x.q[0], x.v[1] - x.v[0], 1.001, t)
        assert np.abs(q[1] - q[0] - relative).max() < 1e-14  # 4.1e-15 was reached: rounded starts, seven radians on
    assert np.sign(run.times[-1]) == np.sign(duration)
    assert run.dt.value > 0


def test_there_and_back_again_returns_to_round_off():
    system = binary()
    there = orbits.propagate(system, orbits.Gauss(stages=8), dt=0.1, duration=20.0, samples=2)
    back = orbits.propagate(there[-1], orbits.Gauss(stages=8), dt=0.1, duration=-20.0, samples=2)
    assert np.abs(back.q[-1] - system.q).max() < 1e-14  # the low parts are dropped at the turn; 3.8e-15 was reached


def test_the_step_is_rounded_to_24_bits_and_its_multiples_are_exact():
    from fractions import Fraction

    h = rounded_step(0.1)
    assert abs(h / 0.1 - 1) < 2.0**-24
    for k in (1, 3, 10**8 + 1, 2**29 - 1):
        assert Fraction(k * h) == k * Fraction(h)
    assert orbits.propagate(binary(), METHODS[0], dt=0.1, duration=1.0).dt.value == h
    assert rounded_step(6.0) == 6.0


@pytest.mark.parametrize("h", [0.1, -0.1, 6.0, 1 / 3])
def test_times_split_exactly_into_steps_and_rest(h):
    from fractions import Fraction

    times = np.copysign(np.concatenate([np.random.default_rng(0).uniform(0, 1e6, 100), [0.0, 12 * abs(h)]]), h)
    for t, k, r in zip(times, *ConstantSteps(h).places(times), strict=True):
        assert Fraction(t) == int(k) * Fraction(h) + Fraction(r)
        assert 0 <= r / h < 1


def test_the_result_does_not_depend_on_the_number_of_threads():
    system = belt(60)
    runs = [
        orbits.propagate(system, m, dt=4 * u.day, duration=200 * u.day, samples=3, threads=t)
        for m in (orbits.Gauss(stages=8), orbits.StormerVerlet())
        for t in (1, 2, 3)
    ]
    for a, b in pairwise(runs):
        if a.integrator == b.integrator:
            assert np.array_equal(a.q, b.q)
            assert np.array_equal(a.v, b.v)


def test_bodies_stay_in_the_order_they_were_given():
    system = binary()
    order = [2, 0, 1]
    x = system.values
    shuffled = orbits.System(
        [system.names[i] for i in order], x.gm[order], x.q[order], x.v[order], units=orbits.DIMENSIONLESS
    )
    a = orbits.propagate(system, METHODS[1], dt=0.1, duration=2.0, samples=3)
    b = orbits.propagate(shuffled, METHODS[1], dt=0.1, duration=2.0, samples=3)
    assert np.array_equal(a["dust"].q, b["dust"].q)
    assert b.names == ("dust", "star", "planet")


def test_the_state_at_any_time_is_the_methods_own():
    run = orbits.propagate(binary(), orbits.Gauss(stages=8), dt=0.1, duration=4.0, samples=5)
    direct = orbits.propagate(binary(), orbits.Gauss(stages=8), dt=0.1, duration=4.0, samples=[2.345])
    assert np.abs(run.at(2.345).q - direct.q[0]).max() < 1e-15  # starts from a sample, without its low part
    assert np.array_equal(run.at(run.t[2]).q, run.q[2])
    with pytest.raises(InputError, match="outside"):
        run.at(4.1)


def test_units_are_those_of_the_system_and_can_be_any():
    si = orbits.UnitSystem("SI", length=u.m, time=u.s, mass=u.kg)
    solar = orbits.System.solar_system(bodies=["Sun", "Jupiter"])
    metres = orbits.System(
        solar.names, solar.gm.to(u.m**3 / u.s**2), solar.q.to(u.m), solar.v.to(u.m / u.s), epoch=solar.epoch, units=si
    )
    a = orbits.propagate(solar, orbits.Gauss(stages=8), dt=40 * u.day, duration=1000 * u.day, samples=2)
    b = orbits.propagate(metres, orbits.Gauss(stages=8), dt=40 * u.day, duration=1000 * u.day, samples=2)
    assert (
        np.abs((a.q[-1] - b.q[-1]).to_value(u.au)).max() < 5e-15
    )  # the start was rounded in other units; 8.9e-16 was reached
    assert b.q.unit == u.m


def test_a_step_that_does_not_converge_is_an_error_with_body_step_and_time_and_the_samples_before_it():
    """A hyperbolic passage that 8 stages cannot resolve."""
    system = orbits.System(
        ["sun", "comet"], [1.0, 1e-9], [[0, 0, 0], [10, 0.02, 0]], [[0, 0, 0], [-1.0, 0, 0]], units=orbits.DIMENSIONLESS
    )
    with pytest.raises(ConvergenceError, match=r"did not converge for comet, sun;.*Use a smaller dt") as caught:
        orbits.propagate(system, orbits.Gauss(stages=8), dt=0.7, duration=20.0, samples=41)
    error = caught.value
    assert "comet" in error.bodies
    assert 5.0 < error.time < 10.0
    assert error.step == round(error.time / 0.7)
    kept = error.trajectory
    assert 10 < len(kept) < 41
    assert not kept.complete
    assert np.isfinite(kept.q.value).all()


def test_a_state_that_is_no_longer_finite_is_an_error():
    system = orbits.System(
        ["a", "b"], [2.0, 2.0], [[-1, 0, 0], [1, 0, 0]], [[0, 0, 0], [0, 0, 0]], units=orbits.DIMENSIONLESS
    )
    with pytest.raises(SingularityError, match="no longer finite"):
        # Half a kick of 1/2 and a drift of 2 bring both bodies to the origin, exactly.
        orbits.propagate(system, orbits.StormerVerlet(), dt=2.0, duration=100.0, samples=2)


def test_a_particle_at_a_singularity_is_retired_with_a_warning_that_names_it_and_not_a_silent_nan():
    """At rest at distance 1 of GM = 2, dt = 1: half a kick of 1 and a drift put the particle onto the star, exactly."""
    system = orbits.System(
        ["star", "dust", "far"],
        [2.0, 0.0, 0.0],
        [[0, 0, 0], [1, 0, 0], [50, 0, 0]],
        [[0, 0, 0], [0, 0, 0], [0, 0.1, 0]],
        units=orbits.DIMENSIONLESS,
    )
    with pytest.warns(orbits.errors.RetiredWarning, match="dust: .*the state is no longer finite"):
        run = orbits.propagate(system, orbits.StormerVerlet(), dt=1.0, duration=8.0, samples=9)
    assert run.retired.names == ("dust",)
    assert run.retired[0].step == 0
    assert run[-1].names == ("star", "far")


@pytest.mark.parametrize("method", [orbits.methods.RungeKutta4(), orbits.methods.ExplicitEuler()], ids=["rk4", "euler"])
def test_a_particle_that_meets_a_body_is_retired_by_every_explicit_method(method):
    """One unit a step towards a star of next to no mass, which it meets after three steps."""
    system = orbits.System(
        ["star", "dust"], [1e-300, 0.0], [[0, 0, 0], [3, 0, 0]], [[0, 0, 0], [-1, 0, 0]], units=orbits.DIMENSIONLESS
    )
    with pytest.warns(orbits.errors.RetiredWarning, match="dust"):
        run = orbits.propagate(system, method, dt=1.0, duration=100.0, samples=101)
    assert run.retired["dust"].step in (2, 3)


def test_the_step_and_the_bodies_of_a_meeting_are_the_true_ones_however_long_the_block():
    """Two bodies approach by exactly two units a step and meet in step 1,000; a third one is far away."""
    system = orbits.System(
        ["a", "b", "c"],
        [1e-300, 1e-300, 1e-300],
        [[-1000, 0, 0], [1000, 0, 0], [0, 1e6, 0]],
        [[1, 0, 0], [-1, 0, 0], [0, 0, 0]],
        units=orbits.DIMENSIONLESS,
    )
    with pytest.raises(SingularityError, match="the state of a, b is no longer finite") as caught:
        orbits.propagate(system, orbits.StormerVerlet(), dt=1.0, duration=1e5, samples=101)
    assert caught.value.step == 999
    assert caught.value.time == 999.0
    assert set(caught.value.bodies) == {"a", "b"}
    assert len(caught.value.trajectory) == 1


def test_a_first_step_that_fails_leaves_the_first_sample(tmp_path):
    with pytest.raises(ConvergenceError) as caught:
        orbits.propagate(
            binary(), orbits.Gauss(stages=8), dt=8.0, duration=50.0, samples=2, archive=tmp_path / "run.h5"
        )
    assert len(caught.value.trajectory) == 1
    assert len(orbits.Trajectory.open(tmp_path / "run.h5")) == 1


def test_the_centre_of_mass_of_a_single_moving_body_does_not_drift_infinitely():
    system = orbits.System(["s"], [1.0], [[0.1, 0.2, 0.3]], [[0.3, 0.1, 0.7]], units=orbits.DIMENSIONLESS)
    drift = orbits.propagate(system, orbits.Gauss(), dt=0.1, duration=1000.0).drift()
    assert drift.centre_of_mass.max_fraction < 1e-15


TABLE = [
    ({"dt": 0}, "dt must be finite and not zero"),
    ({"dt": np.nan}, "dt must be finite"),
    ({"dt": -np.inf}, "dt must be finite"),
    ({"dt": 3 * u.day}, "dt"),
    ({"dt": [0.1, 0.2]}, "dt must be a single number"),
    ({"dt": "fast"}, "dt"),
    ({"dt": 1e-320}, "floats|9.0e15"),
    ({"duration": 0}, "duration is 0"),
    ({"duration": np.inf}, "duration must be finite"),
    ({"duration": np.nan}, "duration must be finite"),
    ({"duration": 1e30}, "steps; at most"),
    ({"duration": 5 * u.km}, "duration"),
    ({"samples": 1}, "at least 2"),
    ({"samples": 0}, "at least 2"),
    ({"samples": True}, "samples must be a whole number"),
    ({"samples": 2.5}, "samples must be a whole number"),
    ({"samples": []}, "samples"),
    ({"samples": [0.0, np.nan]}, "must be finite"),
    ({"samples": [0.0, 2.0]}, "outside the run"),
    ({"samples": [-0.1]}, "outside the run"),
    ({"samples": [0.5, 0.2]}, "sort the times"),
    ({"samples": [0.5, 0.5]}, "sort the times"),
    ({"samples": [[0.1, 0.2]]}, "one-dimensional"),
    ({"samples": 10**13}, "at most 1e"),
    ({"threads": 0}, "threads, if given, must be a whole number >= 1"),
    ({"threads": 1.5}, "threads, if given, must be a whole number >= 1"),
    ({"integrator": "verlet"}, "no integrator is called 'verlet'; did you mean stormer-verlet"),
    ({"integrator": 8}, "integrator must be a method"),
    ({"integrator": orbits.Gauss}, "integrator must be a method"),
    ({"system": {"gm": 1}}, "system must be an orbits.System"),
]


@each(("wrong", "message"), TABLE)
def test_what_cannot_be_run_is_refused_in_words(wrong, message):
    arguments = {"system": binary(), "integrator": METHODS[0], "dt": 0.1, "duration": 1.0, **wrong}
    with pytest.raises(InputError, match=message):
        orbits.propagate(arguments.pop("system"), arguments.pop("integrator"), **arguments)


def test_more_samples_than_memory_holds_are_refused_before_they_are_computed(monkeypatch):
    from orbits.propagation.resuming import sample_store

    monkeypatch.setattr(sample_store, "memory", lambda: 1e6)
    with pytest.raises(InputError, match=r"GiB of memory.*archive="):
        orbits.propagate(binary(), METHODS[0], dt=0.1, duration=1.0, samples=10_000)


@pytest.mark.parametrize("stages", [0, 33, 2.0, "8", True, None])
def test_gauss_has_one_to_32_stages(stages):
    with pytest.raises(InputError, match="between 1 and 32"):
        orbits.Gauss(stages=stages)


@each(
    ("text", "expected"),
    [
        ("gauss", orbits.Gauss()),
        ("Gauss(stages=4)", orbits.Gauss(stages=4)),
        ("stormer-verlet", orbits.StormerVerlet()),
        ("StormerVerlet()", orbits.StormerVerlet()),
        ("runge_kutta_4", orbits.methods.RungeKutta4()),
        ("wisdom-holman(kernel=lazy, corrector=11)", orbits.WisdomHolman(kernel="lazy", corrector=11)),
        ("WisdomHolman(democratic-heliocentric)", orbits.WisdomHolman("democratic-heliocentric")),
        ("wisdom-holman(encounters='follow planets')", orbits.WisdomHolman(encounters="follow planets")),
        ("composition(stormer-verlet, order=4)", orbits.methods.Composition(orbits.StormerVerlet(), order=4)),
    ],
)
def test_integrators_are_read_as_people_type_them(text, expected):
    from orbits import integrators

    assert integrators.parse(text) == expected
    assert integrators.build(integrators.describe(expected)) == expected


@each(
    ("text", "message"),
    [
        ("gaus", "did you mean gauss"),
        ("gauss(steps=3)", "it knows: stages"),
        ("gauss(0)", "needs a whole number of stages between 1 and 32, got 0"),
        ("wisdom-holman(kernel=idle)", "kernel is 'idle'; expected 'modified-kick', 'lazy' or 'standard'"),
        ("composition(verle)", "did you mean stormer-verlet"),
        ("gauss(stages=__import__('os'))", "no integrator is called '__import__'"),
        ("", "cannot read"),
        ("(" * 500, "cannot read"),
        ("gauss(stages={[]: 1})", "cannot read"),
        ("euler(", "cannot read"),
    ],
)
def test_unreadable_integrators_are_refused_in_words(text, message):
    from orbits import integrators

    with pytest.raises(InputError, match=message):
        integrators.parse(text)
