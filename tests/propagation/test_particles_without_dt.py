"""Massless particles in runs without dt: shared steps, clocks of their own, and no effect on anything else."""

import json
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from astropy import units as u

import orbits
from orbits import kepler_flow
from orbits.errors import IntegrationError, RetiredWarning
from orbits.events import CloserThan
from orbits.lagrangians.newtonian import newtonian, parameters
from orbits.marching.clocks.step_times import Place
from orbits.marching.legs.leg import Leg
from orbits.propagation.marchers import bound
from orbits.regression import peers
from orbits.terms import ZonalHarmonics

from ..coverings import first
from ..encounters import APOPHIS_MISS, apophis_2029, comet
from ..problems import belt, three_bodies
from .bodies import falling_particles

AU_KM = 149597870.7
FLYBYS = json.loads((Path(__file__).parent / "flybys_of_small_bodies.json").read_text())


def system(gm, q, v, **options):
    return orbits.System([f"b{i}" for i in range(len(gm))], gm=gm, q=q, v=v, units=orbits.DIMENSIONLESS, **options)


def propagate(start, duration, **options):
    return orbits.propagate(start, duration=duration, progress=False, **options)


def as_light_body(start, name):
    """The same system with a massless body as a massive one that nothing feels."""
    gm = start.values.gm.copy()
    gm[start.names.index(name)] = 1e-30 * gm.max()
    return start.replaced(gm=gm)


def crowd():
    """Three bodies and twenty particles, some of them in encounters."""
    return system(*three_bodies(particles=20))


def crossers(which=range(50)):
    """Sun, Jupiter, Saturn, and particles that cross Jupiter's orbit, or some of the fifty."""
    start = orbits.System.solar_system("2022-08-09", bodies=["Sun", "Jupiter", "Saturn"])
    a, M = np.linspace(4.5, 6, 50), np.linspace(0, 6, 50)
    for k in which:
        start = start.add(f"p{k}", primary="Sun", a=a[k] * u.au, e=0.3, M=M[k] * u.rad)
    return start


@pytest.mark.parametrize(("e", "bound"), [(0.3, 2e-13), (0.9, 3e-12), (0.99, 1e-10), (0.9999, 3e-7)])
def test_eccentric_orbits_about_a_star_come_out_to_round_off(e, bound):
    """Twenty orbits from the apocentre and the pericentre. Over rotated starts, the latter are off by 5e-11, 1e-9 and
    6e-8 (RMS) of the semi-major axis for e = 0.99, 0.999 and 0.9999, at most by 1.4e-7; the former by a hundredth.
    """
    speed = np.sqrt((1 - e) / (1 + e))
    q = [[0, 0, 0], [1 + e, 0, 0], [0, e - 1, 0]]
    v = [[0, 0, 0], [0, speed * 0.8, speed * 0.6], [1 / speed, 0, 0]]
    start, end = system([1.0, 0, 0], q, v), 40 * np.pi
    run = propagate(start, end, samples=[end])
    for body in (1, 2):
        x, _ = kepler_flow(start.values.q[body], start.values.v[body], 1.0, end)
        assert np.linalg.norm(run.q.value[-1, body] - x) < bound


@pytest.mark.parametrize("case", FLYBYS["cases"], ids=lambda case: f"GM {case['gm'][1]:g} at {case['distance']:g} au")
def test_flybys_of_small_bodies_within_one_long_step_are_seen(case):
    """Errors of 2e-8 to 1.4e-7 km, where IAS15 with its default epsilon misses the flybys by up to 800 km: the error
    signal and the way relative to the body tell, and the bodies are placed to round-off within their long steps.
    """
    start = orbits.System(["Sun", "rock", "stone"], gm=case["gm"], q=case["q"], v=case["v"], units=orbits.SOLAR)
    run = propagate(start, FLYBYS["duration"], samples=2)
    assert run.statistics.steps < 10
    assert np.linalg.norm(run.q.value[-1, 2] - case["end"]) * AU_KM < 5e-7
    (passage,) = (a for a in run.closest_approaches()["stone"] if a.other == "rock")
    assert passage.distance.value == pytest.approx(case["distance"], rel=1e-10)
    assert passage.time.value == pytest.approx(300.0, abs=1e-8)


def test_apophis_passes_the_earth_where_it_does_as_a_massive_body():
    """2e-5 km apart after a year; the Earth magnifies a rounding error of the start a thousand times. The bodies take
    70 steps of their own, and 276 with Apophis among them.
    """
    start = apophis_2029()
    run = propagate(start, 365 * u.day, samples=2)
    light = propagate(as_light_body(start, "Apophis"), 365 * u.day, samples=2)
    assert np.linalg.norm(run.q.value[-1, -1] - light.q.value[-1, -1]) * AU_KM < 2e-4
    assert run.statistics.steps < 0.8 * light.statistics.steps
    miss = next(a for a in run.closest_approaches()["Apophis"] if a.other == "Earth")
    assert miss.distance.to_value(u.km) == pytest.approx(APOPHIS_MISS, abs=0.01)  # printed to 0.01 km
    assert miss.date.isot.startswith("2029-04-13T21:46")
    assert run.unresolved() == []


def test_jupiter_crossers_are_as_exact_as_by_ias15():
    """Over a hundred years both are off by rounding errors, here of 4e-6 to 5e-5 km for particles that never come close
    to Jupiter: the difference of both is as large.
    """
    start = crossers((17, 21, 35, 42))
    run = propagate(start, 100 * u.yr, samples=[100 * u.yr])
    times = np.array([36525.0])
    expected = peers.run("ias15", start.values, times=times, dt=1.0).q[-1]
    off = np.linalg.norm(run.q.value[-1] - expected, axis=1) * AU_KM
    assert off.max() < 3e-4


@pytest.mark.slow
def test_jupiter_crossers_last_two_thousand_years():
    run = propagate(crossers(), 2000 * u.yr, samples=11)
    assert run.complete
    lost = np.isnan(run.q.value[-1]).any(axis=1)
    assert {run.names[k] for k in np.flatnonzero(lost)} == set(run.retired.names)


def test_quiet_asteroids_take_the_steps_of_the_planets():
    """Four evaluations a step or so, and the same orbits as with constant steps of half a day: 2e-7 km in ten years."""
    start = belt(20)
    run = propagate(start, 10 * u.yr, samples=2)
    fine = orbits.propagate(start, "gauss", dt=0.5 * u.day, duration=10 * u.yr, samples=2, progress=False)
    off = np.linalg.norm(run.q.value[-1] - fine.q.value[-1], axis=1) * AU_KM
    particles = ~start.massive
    assert off[particles].max() < 5e-6
    assert run.statistics.particle_evaluations < 6.0 * run.statistics.steps * particles.sum()


def test_no_particle_changes_another_or_a_body_by_a_bit():
    start = crowd()
    whole = propagate(start, 30.0, samples=[15.0, 30.0])
    bodies = propagate(system(*three_bodies()), 30.0, samples=[15.0, 30.0])
    assert np.array_equal(whole.q[:, :3], bodies.q)
    assert whole.statistics.steps == bodies.statistics.steps
    for one in (4, 11, 22):
        alone = start.remove(*(name for k, name in enumerate(start.names) if k >= 3 and k != one))
        assert np.array_equal(propagate(alone, 30.0, samples=[15.0, 30.0]).q[:, 3], whole.q[:, one])
    gm, q, v, _ = start.values
    order = np.concatenate([np.arange(3), np.random.default_rng(2).permutation(np.arange(3, 23))])
    mixed = propagate(system(gm[order], q[order], v[order]), 30.0, samples=[15.0, 30.0])
    assert np.array_equal(mixed.q, whole.q[:, order])


@pytest.mark.parametrize("threads", first(1, [2, 5]))
def test_threads_samples_and_blocks_change_no_bit(threads):
    start = crowd()
    whole = propagate(start, 30.0, samples=[30.0], threads=1)
    assert np.array_equal(propagate(start, 30.0, samples=100, threads=threads).q[-1], whole.q[-1])
    marcher = bound(start, "gauss", orbits.Adaptive(), threads)
    marcher.block = threads
    marcher.advance_to(Place(0, 30.0))
    assert np.array_equal(marcher.state_at(Place(0, 30.0))[0], whole.q.value[-1])
    marcher.close()


def test_stopped_and_extended_runs_have_the_bits_of_a_whole_one(tmp_path):
    start, path = crowd(), tmp_path / "run.h5"
    whole, seen = propagate(start, 10.0, samples=41), []

    def stop(t, state):
        seen.append(t)
        return len(seen) == 9

    propagate(start, 5.0, samples=21, archive=path, callback=stop)
    orbits.resume(path, progress=False).archive.close()
    longer = orbits.resume(path, until=10.0, progress=False)
    assert np.array_equal(longer.q, whole.q)
    assert np.array_equal(longer.v, whole.v)
    with closing(orbits.Trajectory.open(path)) as opened:
        assert np.array_equal(opened.q, whole.q)


def test_states_between_samples_and_backward_runs():
    start = crowd()
    run = propagate(start, 10.0, samples=11)
    direct = propagate(start, 10.0, samples=[3.3, 7.7])
    found = run.at([7.7, 3.3])
    np.testing.assert_allclose(found.q.value[::-1], direct.q.value, rtol=0, atol=2e-14)
    back = propagate(run[-1], -10.0)
    np.testing.assert_allclose(back.q.value[-1], start.q.value, rtol=0, atol=5e-14)


def test_a_particle_that_hits_a_point_is_retired_where_and_when_it_does(tmp_path):
    start, path = falling_particles(), tmp_path / "run.h5"
    with pytest.warns(RetiredWarning, match=r"adaptive steps.*2 massless(?s:.*)near: t = 0.79(?s:.*)soft"):
        run = propagate(start, 6.0, samples=61, archive=path)
    assert run.retired.names == ("near", "far")
    for one, height in zip(run.retired, (0.8, 2.0), strict=True):
        assert one.time.value == pytest.approx(np.pi * (height / 2) ** 1.5, rel=1e-8)  # the planet changes 1e-9
        assert np.linalg.norm(one.q.value) < 1e-6
        assert one.reason == "no step is short enough to go on"
        column, after = run.names.index(one.name), run.times > one.time.value
        assert np.isnan(run.q.value[after, column]).all()
        assert np.isfinite(run.q.value[~after, column]).all()
    others = propagate(start.remove("near", "far"), 6.0, samples=61)
    assert np.array_equal(run.q[:, :3], others.q)
    between = run.at([0.75, 0.79, 0.8, 3.1, 3.15])
    assert np.isnan(between.q.value[:, 3]).any(axis=1).tolist() == [False, False, True, True, True]
    assert np.isnan(between.q.value[:, 4]).any(axis=1).tolist() == [False, False, False, False, True]
    with closing(orbits.Trajectory.open(path)) as opened:
        assert opened.retired.to_records() == run.retired.to_records()


@pytest.mark.filterwarnings("ignore::orbits.errors.OrbitsWarning")
def test_a_run_resumed_after_a_retirement_has_its_bits(tmp_path):
    start, path, seen = falling_particles(), tmp_path / "run.h5", []
    whole = propagate(start, 6.0, samples=25)
    propagate(start, 6.0, samples=25, archive=path, callback=lambda t, state: seen.append(t) or len(seen) == 8)
    done = orbits.resume(path, progress=False)
    assert np.array_equal(done.q.value, whole.q.value, equal_nan=True)
    assert done.retired.to_records() == whole.retired.to_records()


def test_a_march_that_does_not_retire_particles_raises():
    gm, q, v, _ = falling_particles().values
    march = Leg.of(newtonian, orbits.Gauss(8), parameters(gm[:2]), gm > 0, q, v, orbits.Adaptive())
    with pytest.raises(IntegrationError):
        march.advance_to(Place(0, 6.0))


def satellite():
    """A massless satellite on an eccentric orbit about the Earth, with ten revolutions in two days."""
    start = apophis_2029()
    gm, q, v = start.values.gm, start.values.q.copy(), start.values.v.copy()
    earth = start.names.index("Earth")
    pericentre = 7000.0 / AU_KM
    speed = np.sqrt(gm[earth] * 1.5 / pericentre)
    q[-1], v[-1] = q[earth] + [pericentre, 0, 0], v[earth] + [0, 0.8 * speed, 0.6 * speed]
    return start.replaced(q=q, v=v)


def test_pericentres_within_a_step_of_the_bodies_are_found():
    start = satellite()
    run = propagate(start, 2 * u.day, samples=2)
    light = propagate(as_light_body(start, "Apophis"), 2 * u.day, samples=2)
    assert run.statistics.steps < 10 < light.statistics.steps / 10
    assert np.linalg.norm(run.q.value[-1, -1] - light.q.value[-1, -1]) * AU_KM < 1e-6
    found, expected = (
        min((a for a in r.closest_approaches()["Apophis"] if a.other == "Earth"), key=lambda a: a.distance)
        for r in (run, light)
    )
    assert found.distance.to_value(u.km) == pytest.approx(expected.distance.to_value(u.km), abs=1e-5)


def test_conditions_hold_for_passages_within_a_step():
    start = apophis_2029()
    near = propagate(start, 150 * u.day, stop=CloserThan(39_000 * u.km, "Apophis", "Earth"))
    assert near.stopped is not None
    body, earth = (near.stopped.system[name].q for name in ("Apophis", "Earth"))
    assert np.linalg.norm((body - earth).to_value(u.km)) == pytest.approx(39_000, abs=1e-4)  # of 1e-15 au in each
    far = propagate(start, 150 * u.day, stop=CloserThan(38_000 * u.km, "Apophis", "Earth"))
    assert far.stopped is None


def test_a_comet_among_no_planets_needs_no_steps_of_the_sun():
    start = comet(0.1, 0.99)
    run = propagate(start, 600 * u.day, samples=601)
    gm, q, v, _ = start.values
    for k in (100, 203, 204, 600):
        x, _ = kepler_flow(q[1] - q[0], v[1] - v[0], gm[0], float(run.times[k]))
        assert np.linalg.norm(run.q.value[k, 1] - run.q.value[k, 0] - x) < 1e-13  # 1e-14 au is seen
    perihelion = run.closest_approaches()["comet"][0]
    assert perihelion.distance.value == pytest.approx(0.1, rel=1e-12)
    assert perihelion.time.value == pytest.approx(203.3, abs=1e-9)


def test_a_particle_where_attractions_cancel_stays_there():
    """Between two equal bodies that circle each other, the force is round-off: no clock follows that."""
    start = system([1, 1, 0], [[-1, 0, 0], [1, 0, 0], [0, 0, 0]], [[0, -0.5, 0], [0, 0.5, 0], [0, 0, 0]])
    run = propagate(start, 10.0, samples=2)
    assert np.abs(run.q.value[-1, 2]).max() < 1e-11  # 1e-13: it is not stable there
    assert run.statistics.particle_evaluations < 50 * run.statistics.steps


@pytest.mark.parametrize("stages", [3, 5, 7])
def test_fewer_stages_reach_round_off_too(stages):
    start = crowd()
    best = propagate(start, 5.0, samples=[5.0])
    run = propagate(start, 5.0, samples=[5.0], integrator=orbits.Gauss(stages=stages))
    np.testing.assert_allclose(run.q.value, best.q.value, rtol=0, atol=2e-12)


@pytest.mark.nightly
def test_terms_of_positions_act_on_particles_too():
    bodies = orbits.System.solar_system(bodies=["Sun", "Jupiter"])
    flattened = bodies.add("stone", primary="Sun", a=0.3 * u.au, e=0.5).with_terms(
        ZonalHarmonics("Sun", J2=1e-3, radius=696000 * u.km, pole=(286.13, 63.87) * u.deg)
    )
    run = propagate(flattened, 400 * u.day, samples=2)
    fixed = orbits.propagate(flattened, "gauss", dt=0.25 * u.day, duration=400 * u.day, samples=2, progress=False)
    np.testing.assert_allclose(run.q.value[-1], fixed.q.value[-1], rtol=0, atol=5e-13)
