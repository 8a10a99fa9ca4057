"""Constant steps of transformed time: symplectic at equal tau, through near-collisions, for few massive bodies."""

import json

import mpmath
import numpy as np
import pytest
from astropy import units as u

import orbits
from orbits.archive import Archive
from orbits.archive.header import from_items, to_items
from orbits.diagnostics.tangent import symplecticity_defect
from orbits.errors import ArchiveError, ConvergenceError, InputError, SingularityError
from orbits.lagrangians.newtonian import newtonian, parameters
from orbits.marching.clocks.step_times import Place
from orbits.marching.legs.leg import Leg
from orbits.propagation.marchers import bound

from .. import kepler_truth
from ..problems import FIGURE_EIGHT, three_bodies
from .bodies import BURRAU, falling, system

MASSES = np.array([0.7, 0.3])
TT = orbits.TimeTransformed(step=0.3)


def propagate(start, duration, clock=TT, **options):
    return orbits.propagate(start, dt=clock, duration=duration, progress=False, **options)


def pair(e, *, apocentre=False, turned=None):
    """Two bodies on an ellipse of a = 1 and GM = 1, from the pericentre or from the apocentre."""
    r = 1.0 + e if apocentre else 1.0 - e
    x, w = np.array([r, 0, 0]), np.array([0, np.sqrt((2 - r) / r), 0])
    if turned is not None:
        axes = np.linalg.qr(np.random.default_rng(turned).normal(size=(3, 3)))[0]
        x, w = axes @ x, axes @ w
    share = np.array([[-MASSES[1]], [MASSES[0]]])
    return system(MASSES, share * x, share * w)


def truth(start, time):
    """The relative place after a time, from the rounded start, at sixty digits."""
    with mpmath.workdps(kepler_truth.DIGITS):
        q, v = start.values.q, start.values.v
        apart = [[mpmath.mpf(float(b)) - mpmath.mpf(float(a)) for a, b in zip(*x, strict=True)] for x in (q, v)]
        gm = mpmath.mpf(float(start.values.gm[0])) + mpmath.mpf(float(start.values.gm[1]))
        return np.array([float(x) for x in kepler_truth.flow(*apart, gm, mpmath.mpf(float(time)))[0]])


def errors(e, step, orbits_run, **start):
    found = []
    for turned in range(6):
        begin, end = pair(e, turned=turned, **start), 2 * np.pi * orbits_run
        run = propagate(begin, end, orbits.TimeTransformed(step=step), samples=[end])
        found.append(np.linalg.norm(run.q.value[-1, 1] - run.q.value[-1, 0] - truth(begin, end)))
    return np.sqrt(np.mean(np.square(found))), run.statistics.steps / orbits_run


@pytest.mark.parametrize(
    ("e", "step", "steps", "bound"),
    [
        (0.5, 0.276, 24, 3e-13),  # 8e-14; with an E0 in one float 6e-13, with G m m' rounded first 1.8e-13
        (0.9, 0.349, 24, 2e-12),  # 5e-13, 8e-12
        (0.99, 0.715, 16, 1e-11),  # 4e-12, 4e-10
        (0.999, 0.732, 20, 4e-11),  # 9e-12, 9e-9
        (0.9999, 0.498, 36, 8e-11),  # 2e-11, 5e-7
    ],
)
def test_eccentric_orbits_from_the_pericentre_come_out_to_round_off(e, step, steps, bound):
    """A hundred orbits from six rotated starts, RMS; steps are those of an orbit. Without dt: 7e-13 to 2e-7."""
    found, taken = errors(e, step, 100)
    assert found < bound
    assert taken == pytest.approx(steps, abs=0.1)


def test_near_collisions_are_passed_where_steps_of_t_end():
    """Ten orbits with a pericentre of 1e-10: 3e-10 is reached, in 125 steps each; without dt the first is the last."""
    found, taken = errors(1 - 1e-10, 0.3, 10, apocentre=True)
    assert found < 2e-9
    assert taken < 130
    run = propagate(pair(1 - 1e-10, apocentre=True), 20 * np.pi, samples=60)
    assert run.drift().energy.max_fraction < 2e-14  # 1.3e-15 is seen


def test_burraus_problem_comes_out_right_through_its_encounters():
    """5e-7 is reached, in 1,017 steps; REBOUND's IAS15 is 3e-3 off, RMS over rotated starts (docs/benchmarks.md)."""
    start = system([3, 4, 5], [[1, 3, 0], [-2, -1, 0], [1, -1, 0]], np.zeros((3, 3)))
    for step in (0.2, 0.3, 0.4):
        run = propagate(start, 63.0, orbits.TimeTransformed(step=step), samples=2)
        assert np.abs(run.q.value[-1] - BURRAU).max() < 3e-6
    assert run.statistics.steps < 800
    moved = run.drift()
    assert moved.angular_momentum.max_fraction < 1e-14
    assert moved.linear_momentum.max_fraction < 1e-14


def test_a_step_of_bodies_is_symplectic_at_equal_tau():
    """The derivative of the compiled step itself, by differences in all of q and p with E0 fixed; without the term
    with H - E0 the defect is 0.3, and that of a step of the default clock, which depends on the state, 0.1.
    """
    gm, q, v = three_bodies()
    n = len(gm)
    masses = np.repeat(gm, 3)

    def march(z, clock):
        marcher = Leg.of(
            newtonian, orbits.Gauss(stages=8), parameters(gm), gm > 0, z[: 3 * n].reshape(n, 3),
            (z[3 * n :] / masses).reshape(n, 3), clock,
        )  # fmt: skip
        if clock is TT:  # E0 is that of the run, not that of the neighbouring state
            checkpoint = marcher.checkpoint()
            checkpoint["memory"][-1] = known
            marcher.restore(checkpoint)
        marcher.advance(1)
        x, w = marcher.state()
        return np.concatenate([x.ravel(), masses * w.ravel()])

    begun = Leg.of(newtonian, orbits.Gauss(stages=8), parameters(gm), gm > 0, q, v, TT)
    begun.advance(1)
    known = begun.checkpoint()["memory"][-1]
    z = np.concatenate([q.ravel(), masses * v.ravel()])
    scales = np.where(np.arange(6 * n) < 3 * n, 1e-3, 1e-3 * np.tile(masses, 2))
    weights = {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}
    found = []
    for clock in (TT, orbits.Adaptive()):
        columns = [
            sum(w * (march(z + m * d, clock) - march(z - m * d, clock)) for m, w in weights.items()) / d.max()
            for d in np.diag(scales)
        ]
        found.append(symplecticity_defect(np.array(columns).T, np.sqrt(masses)))
    assert found[0] < 1e-9
    assert found[1] > 1e-4


def test_samples_and_blocks_change_no_bit():
    start = system(*three_bodies())
    whole = propagate(start, 30.0, samples=[30.0])
    sampled = propagate(start, 30.0, samples=333)
    assert np.array_equal(whole.q[-1], sampled.q[-1])
    assert whole.statistics.steps == sampled.statistics.steps
    marcher = bound(start, "gauss", TT, 1)
    marcher.block = 7
    marcher.advance_to(Place(0, 30.0))
    assert np.array_equal(marcher.state_at(Place(0, 30.0))[0], whole.q.value[-1])


def test_samples_lie_on_the_orbit_at_their_times():
    """Also where a step is long: 40 samples of an orbit of 24 steps, against the exact one."""
    start = pair(0.9)
    run = propagate(start, 6.0, orbits.TimeTransformed(step=0.349), samples=41)
    exact = [truth(start, t) for t in run.times[1:]]
    off = np.linalg.norm(run.q.value[1:, 1] - run.q.value[1:, 0] - exact, axis=1)
    assert off.max() < 3e-15  # 2e-16


def test_a_run_backwards_leads_back():
    start = system(*three_bodies())
    there = propagate(start, 10.0)
    back = propagate(there[-1], -10.0)
    assert back.times[-1] == -10.0
    assert back.clock.direction == -1.0
    np.testing.assert_allclose(back.q.value[-1], start.q.value, rtol=0, atol=1e-13)


def test_an_interrupted_and_an_extended_run_have_the_bits_of_a_whole_one(tmp_path):
    start, path, other = system(*three_bodies()), tmp_path / "run.h5", tmp_path / "other.h5"
    whole, seen = propagate(start, 20.0, samples=41), []

    def stop(t, state):
        seen.append(t)
        return len(seen) == 17

    propagate(start, 20.0, samples=41, archive=path, callback=stop)
    again = orbits.resume(path, progress=False)
    assert np.array_equal(again.q, whole.q)
    assert again.clock == TT
    assert "0.3 in transformed time" in repr(again)
    propagate(start, 10.0, samples=21, archive=other)
    assert np.array_equal(orbits.resume(other, until=20.0, progress=False).v, whole.v)


def test_states_between_samples_are_those_of_the_orbit():
    start = system(*three_bodies())
    run = propagate(start, 10.0, samples=11)
    direct = propagate(start, 10.0, samples=[3.3, 7.7])
    np.testing.assert_allclose(run.at([7.7, 3.3]).q.value[::-1], direct.q.value, rtol=0, atol=1e-14)


def test_close_approaches_and_conditions_are_found_to_the_precision_of_the_orbit():
    """A pair on an ellipse of a = 0.5025..., pericentre from the conserved quantities."""
    start, a = falling(0.1), 1 / (1 - 0.2**2 / 2)
    run = propagate(start, 6.0)
    approach = run.closest_approaches()["b0"][0]
    assert approach.distance.value == pytest.approx(2 * a - 2, rel=1e-12)
    assert approach.time.value == pytest.approx(np.pi * np.sqrt(a**3 / 2), rel=1e-14)
    stopped = propagate(start, 6.0, stop=orbits.events.CloserThan(0.5, "b0", "b1")).stopped
    met = stopped.system.q.value
    assert np.linalg.norm(met[0] - met[1]) == pytest.approx(0.5, rel=1e-12)
    assert stopped.time.value < np.pi * np.sqrt(a**3 / 2)


def test_conditions_are_looked_at_up_to_the_end_of_the_run():
    """The last step of the march leads beyond the end: what is met before it is told all the same."""
    whole = propagate(falling(0.3), 6.0, stop=orbits.events.CloserThan(1.0, "b0", "b1")).stopped
    stop = orbits.events.CloserThan(1.0, "b0", "b1")
    for duration in np.linspace(float(whole.time.value) * (1 + 1e-9), 3.0, 5):
        assert propagate(falling(0.3), duration, stop=stop).stopped is not None
    assert propagate(falling(0.3), 1.0, stop=stop).stopped is None


def test_a_collision_ends_the_run_and_keeps_what_was_before():
    """The steps shrink with the distance down to 1e-18 of it, so that the time is exact."""
    with pytest.raises(SingularityError, match=r"b0 and b1 meet.*Use softening") as caught:
        propagate(falling(0.0), 10.0, samples=11)
    assert caught.value.time == pytest.approx(np.pi / 2 * np.sqrt(2), rel=1e-15)
    assert tuple(caught.value.bodies) == ("b0", "b1")
    assert caught.value.trajectory.times.tolist() == [0.0, 1.0, 2.0]


def test_a_softened_collision_is_passed_through():
    start = system([1.0, 1.0], [[-1, 0, 0], [1, 0, 0]], np.zeros((2, 3)), softening=1e-3)
    run = propagate(start, 10.0)
    assert run.drift().energy.max_fraction < 1e-14
    other = orbits.propagate(start, duration=10.0, progress=False)
    np.testing.assert_allclose(run.q.value, other.q.value, rtol=0, atol=1e-10)


def test_every_variational_runge_kutta_method_keeps_its_order():
    """The error of the samples falls with the order of the method, their times included."""
    start, end = pair(0.6), 5.0
    for method in (orbits.methods.LobattoIIIAB(stages=3), orbits.Gauss(stages=2), orbits.methods.VPRK()):
        off = []
        for step in (0.1, 0.05):
            run = propagate(start, end, orbits.TimeTransformed(step=step), integrator=method, samples=[end])
            off.append(np.linalg.norm(run.q.value[-1, 1] - run.q.value[-1, 0] - truth(start, end)))
        assert np.log2(off[0] / off[1]) == pytest.approx(method.order, abs=0.4), method.label


def test_a_step_that_is_too_long_is_said_with_the_remedy():
    start = system([3, 4, 5], [[1, 3, 0], [-2, -1, 0], [1, -1, 0]], np.zeros((3, 3)))
    with pytest.raises(ConvergenceError, match=r"did not converge.*smaller step than 2: dt=orbits.TimeTransformed"):
        propagate(start, 63.0, orbits.TimeTransformed(step=2.0))


def test_what_cannot_be_marched_in_transformed_time_is_refused_with_the_remedy(tmp_path):
    start = system(*three_bodies())
    with pytest.raises(InputError, match=r"massless particles.*leave dt out"):
        propagate(system(*three_bodies(particles=2)), 1.0)
    with pytest.raises(InputError, match=r"Mercury is too light for transformed time.*Leave dt out"):
        propagate(orbits.System.solar_system(), 10.0)
    with pytest.raises(InputError, match=r"this system has 1\. Leave dt out"):
        propagate(system([1.0], [[0, 0, 0]], [[0, 0, 0]]), 1.0)
    with pytest.raises(InputError, match=r"not with the force of drag.*Give dt=\.\.\. a length"):
        propagate(start.with_forces(orbits.terms.Drag(rate=1e-3)), 1.0)
    with pytest.raises(InputError, match=r"StormerVerlet\(\) cannot march in transformed time.*Gauss\(stages=8\)"):
        propagate(start, 1.0, integrator="stormer-verlet")
    with pytest.raises(InputError, match=r"Gauss\(stages=12\) cannot march in transformed time"):
        propagate(start, 1.0, integrator=orbits.Gauss(stages=12))
    with pytest.raises(InputError, match=r"expected dt=orbits.TimeTransformed\(step=0.3\)"):
        propagate(start, 1.0, orbits.TimeTransformed)
    for step in (0.0, -0.1, 3.0, float("nan"), "0.3", True, None, 0.3 * u.day):
        with pytest.raises(InputError, match="step is"):
            orbits.TimeTransformed(step=step)
    with pytest.raises(InputError, match=r"took steps of 0\.3 in transformed time, so it has no dt"):
        _ = propagate(start, 1.0).dt


def test_a_star_and_giant_planets_are_not_too_light():
    giants = orbits.System.solar_system(bodies=["Sun", "Jupiter", "Saturn"])
    run = propagate(giants, 30 * u.yr, samples=2)
    other = orbits.propagate(giants, duration=30 * u.yr, samples=2, progress=False)
    np.testing.assert_allclose(run.q.value[-1], other.q.value[-1], rtol=0, atol=2e-13)


@pytest.mark.parametrize("offset", [0.0, 1e-16, 1e-12])
def test_forces_that_cancel_make_no_body_too_light(offset):
    """The middle one of the figure eight begins where the attractions of the others cancel."""
    q = FIGURE_EIGHT.values.q.copy()
    q[2, 0] = offset
    run = propagate(FIGURE_EIGHT.replaced(q=q), 6.32591398, samples=2)
    np.testing.assert_allclose(run.q.value[-1], q, rtol=0, atol=1e-7)  # start and period are rounded to 8 digits


@pytest.mark.nightly
def test_a_run_in_transformed_time_has_a_certificate(tmp_path):
    assert propagate(system(*three_bodies()), 1.0, archive=tmp_path / "run.h5", certificate=True).certificate.ok


def test_a_clock_that_no_run_has_is_refused_by_the_archive(tmp_path):
    path = tmp_path / "run.h5"
    propagate(system(*three_bodies()), 1.0, archive=path)
    items = to_items(Archive.open(path).parts()[1])
    good = json.loads(items["@clock"])
    assert from_items(items).grid.clock == TT
    for change in ({"kind": "adaptive"}, {"direction": 0.5}, {"step": -1}, {"more": 1}, {"kind": ["transformed time"]}):
        with pytest.raises(ArchiveError):
            from_items({**items, "@clock": json.dumps({**good, **change})})


def test_kept_steps_give_states_at_any_time():
    """Partial steps from the kept states, of tau, with their time found: the orbit to round-off, 5e-16 is seen."""
    start, times = pair(0.9), np.linspace(0.01, 6.2, 50)
    run = propagate(start, 6.25, orbits.TimeTransformed(step=0.349), samples=2, dense=True)
    found = run.at(times).q.value
    exact = [truth(start, t) for t in times]
    off = np.linalg.norm(found[:, 1] - found[:, 0] - exact, axis=1)
    assert off.max() < 2e-14
