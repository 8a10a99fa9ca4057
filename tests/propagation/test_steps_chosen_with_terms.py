"""Runs without dt with terms that depend on velocities and with forces: bodies, and massless particles with clocks of
their own.

Two sets of what acts, so that little is compiled: `lit` with relativity, a flattening and light; `swayed` with a spin,
a flattening, a term that depends on time in its momenta and drag.
"""

import numpy as np
import pytest
from astropy import units as u

import orbits
from orbits.errors import InputError, SingularityError

from .. import extrapolated
from ..acting import Heavy, Swaying
from .test_all_terms_and_forces import DRAG, FLAT, PARTICLE, SPIN, three

C, J2, R, BETA = 1000.0, 1e-3, 0.005, 0.1
SWAY = Swaying(rate=1.3)
GRAINS = {
    "grain": (0.0, [0.3, 0.0, 0.05], [0.0, 1.75, 0.2]),
    "far": (0.0, [-3.0, 1.0, 0.2], [-0.2, -0.5, 0.1]),
    "falling": (0.0, [1.2, 0.4, 0.3], [-0.02, 0.25, 0.05]),
}


def propagate(start, duration, **options):
    return orbits.propagate(start, duration=duration, progress=False, **options)


def swayed(**more):
    return three(**more).with_terms(SPIN, FLAT, SWAY).with_forces(DRAG)


def lit(start, *lighted, source="planet", beta=BETA):
    """A system with relativity, a flattening and light on some bodies."""
    flat = orbits.ZonalHarmonics(source, J2=J2, radius=R, pole=(0.0, 0.0, 1.0))
    light = orbits.RadiationPressure(bodies=list(lighted), beta=beta, source=source, c=C)
    return start.with_terms(orbits.PostNewtonian(sources=[source], c=C), flat).with_forces(light)


def eccentric(mass, beta=BETA, e=0.99):
    """A body about a planet, from its apocentre."""
    speed = np.sqrt((1 - e) / (1 + e))
    q, v = np.array([1 + e, 0.0, 0.0]), speed * np.array([0.0, 0.8, 0.6])
    body = np.zeros(3)
    start = orbits.System(["planet", "body"], [1.0, mass], [body, q], [body, v], units=orbits.DIMENSIONLESS)
    return lit(start, "body", beta=beta), q, v


@pytest.mark.parametrize("mass", [1e-25, 0.0], ids=["massive", "massless"])
def test_an_orbit_of_e_099_with_relativity_flattening_and_light_comes_out_to_round_off(mass):
    """An orbit through its pericentre at 0.01: both are 1e-14 off; Newton's orbit would be 0.2 off."""
    start, q, v = eccentric(mass)
    end = 2 * np.pi
    found = propagate(start, end, samples=[end])
    x, w = extrapolated.motion(extrapolated.acceleration(1.0, C, J2, R, BETA), 1.0, q, v, end, 0.2)
    print(np.abs(found.q[-1, 1] - x).max(), np.abs(found.v[-1, 1] - w).max())
    assert np.abs(found.q[-1, 1] - x).max() < 1e-12
    assert np.abs(found.v[-1, 1] - w).max() < 1e-12


def test_mercury_with_relativity_goes_as_with_a_short_dt():
    """A year; both methods leave round-off."""
    start = orbits.System.solar_system("2020-01-01", bodies=["Sun", "Mercury", "Venus", "Jupiter"])
    flat = orbits.ZonalHarmonics("Sun", J2=2.2e-7, radius=696000 * u.km, pole=(286.13, 63.87) * u.deg)
    light = orbits.RadiationPressure(bodies=["Venus"], beta=1e-9, source="Sun")
    start = start.with_terms(orbits.PostNewtonian(sources=["Sun"]), flat).with_forces(light)
    chosen = propagate(start, 1 * u.yr, samples=5)
    fixed = propagate(start, 1 * u.yr, samples=5, dt=0.5 * u.day, integrator=orbits.Gauss(stages=8))
    off = np.abs((chosen.q - fixed.q).to_value(u.m))[-1]
    print(off.max(axis=1), chosen.statistics.steps)
    assert off.max() < 1e-3


@pytest.mark.parametrize("stages", [4, 8])
def test_the_error_signal_is_of_the_order_of_the_last_coefficient(stages):
    method, factor = orbits.Gauss(stages=stages), 3.0 ** (stages - 1)
    loose = 1e-4 if stages == 4 else 1e-6
    runs = [
        propagate(swayed(), 20.0, integrator=method, dt=orbits.Adaptive(tolerance=t))
        for t in (loose, loose / factor)
    ]
    steps = [run.statistics.steps for run in runs]
    print(steps)
    assert steps[1] == pytest.approx(3.0 * steps[0], rel=0.06)


def test_bodies_and_particles_go_as_with_a_short_dt():
    chosen = propagate(swayed(**GRAINS), 10.0)
    fixed = propagate(swayed(**GRAINS), 10.0, dt=1 / 256, integrator=orbits.Gauss(stages=8))
    off = np.abs(chosen.q[-1] - fixed.q[-1]).max(axis=1)
    print(off)
    assert off[:3].max() < 2e-15
    assert off[3:].max() < 5e-14
    tiny = propagate(swayed(**{name: (1e-22, *state[1:]) for name, state in GRAINS.items()}), 10.0)
    print(np.abs(chosen.q[-1] - tiny.q[-1]).max(axis=1))
    assert np.abs(chosen.q[-1] - tiny.q[-1]).max() < 5e-14


def test_particles_are_retired_and_the_others_change_no_bit():
    falls = {"falls": (0.0, [0.5, 0.5, 0.0], [0.0, 0.0, 0.0])}
    start = three(**PARTICLE, **falls).with_terms(SPIN, FLAT, SWAY).with_forces(DRAG)
    run = propagate(start, 10.0, samples=3)
    print(run.retired)
    without = propagate(swayed(**PARTICLE), 10.0, samples=3)
    assert np.array_equal(run.q[:, :4], without.q)


def test_work_torque_and_impulse_are_those_of_the_steps_that_were_taken():
    """At every sample, within steps too, through steps that were repeated."""
    start, _, _ = eccentric(1e-3, beta=1e-3)
    run = propagate(start, 15.0, samples=40)
    given = run.work()[0]
    energy = run.drift()
    print(energy)
    system = [run[k] for k in range(len(run))]
    spent = np.array([one.energy().value for one in system])
    off = (spent - spent[0]) - (given.work - given.work[0])
    print(np.abs(off).max(), np.abs(spent - spent[0]).max())
    assert np.abs(spent - spent[0]).max() > 1e-7
    assert np.abs(off).max() < 1e-15


def test_samples_blocks_and_threads_change_no_bit():
    start = swayed(**GRAINS)
    few, many = propagate(start, 6.0, samples=3, threads=1), propagate(start, 6.0, samples=61, threads=2)
    assert np.array_equal(few.q, many.q[::30])
    assert np.array_equal(few.v, many.v[::30])
    for one, other in zip(few.work(), many.work(), strict=True):
        assert np.array_equal(one.work, other.work[::30])


@pytest.mark.parametrize("particles", [{}, GRAINS], ids=["bodies", "particles"])
def test_an_interrupted_run_is_resumed_to_the_same_bits(tmp_path, particles):
    start, path, seen = lit(three(**particles), "inner", *particles), tmp_path / "run.h5", []
    whole = propagate(start, 8.0, samples=41)

    def stop(t, state):
        seen.append(t)
        return len(seen) == 17

    propagate(start, 8.0, samples=41, archive=path, callback=stop)
    again = orbits.resume(path, progress=False)
    assert np.array_equal(again.q, whole.q)
    assert np.array_equal(again.work()[0].work, whole.work()[0].work)


def test_a_run_backwards_leads_back():
    start = swayed(**GRAINS)
    end = propagate(start, 5.0, samples=[5.0])
    back = propagate(end[-1], -5.0, samples=[-5.0])
    print(np.abs(back.q[-1] - start.values.q).max())
    assert np.abs(back.q[-1] - start.values.q).max() < 1e-13


@pytest.mark.parametrize("dense", [False, True])
def test_states_between_samples_are_those_of_the_motion(dense):
    """They know the time that a term depends on, in a march that starts from a sample too."""
    start = swayed(**GRAINS)
    run = propagate(start, 8.0, samples=5, dense=dense)
    times = [1.3, 3.7, 7.9]
    direct = propagate(start, 8.0, samples=times)
    found = run.at(times)
    print(np.abs(found.q - direct.q).max())
    assert np.abs(found.q - direct.q).max() < 3e-14
    assert np.abs(found.v - direct.v).max() < 1e-13


def test_events_are_found_on_the_motion_of_bodies_and_particles():
    start = swayed(**GRAINS)
    events = [orbits.Pericentre("inner", "planet"), orbits.Pericentre("grain", "planet")]
    run = propagate(start, 8.0, samples=5, events=events)
    print(run.events)
    assert len(run.events) > 4
    for event in run.events:
        state = propagate(start, float(event.time), samples=[float(event.time)])
        body = run.names.index(event.body)
        q, v = state.q[-1, body] - state.q[-1, 0], state.v[-1, body] - state.v[-1, 0]
        print(q @ v)
        assert abs(q @ v) < 1e-12


def test_a_body_alone_under_a_force_takes_steps_that_resolve_it():
    start = orbits.System(["body"], [1.0], [[0.0, 0, 0]], [[1.0, 0, 0]], units=orbits.DIMENSIONLESS)
    run = propagate(start.with_forces(orbits.Drag(rate=0.1)), 300.0, samples=[50.0, 300.0])
    times = np.array([50.0, 300.0])
    np.testing.assert_allclose(run.v[:, 0, 0], np.exp(-0.1 * times), rtol=1e-12)
    np.testing.assert_allclose(run.q[:, 0, 0], 10 * (1 - np.exp(-0.1 * times)), rtol=1e-12)


def test_velocities_that_momenta_do_not_determine_end_the_run_with_the_reason():
    with pytest.raises(SingularityError, match="adds as much as m v to the momenta"):
        propagate(three().with_terms(SPIN, FLAT, Heavy(excess=30.0)).with_forces(DRAG), 5.0)


def test_transformed_time_is_still_for_attractions_alone():
    with pytest.raises(InputError, match="nothing else, so far, not with"):
        propagate(swayed(), 1.0, dt=orbits.TimeTransformed(0.3))


def test_the_error_bars_of_a_run_are_those_of_round_off():
    run = propagate(swayed(**GRAINS), 5.0, samples=3)
    print(run.error_estimate())
