"""Runs without dt with terms that depend on velocities and with forces: bodies, and massless particles with clocks of
their own.

Two sets of what acts, so that little is compiled: `swayed` with a spin, a flattening, a term that depends on time in
its momenta and drag; at night also `lit` with relativity, a flattening and light.
"""

import numpy as np
import pytest
from astropy import units as u

import orbits
from orbits.errors import InputError
from orbits.kernels.steps import TOO_SHORT
from orbits.marching.stepping.failures import failure_of_bodies

from .. import extrapolated
from ..acting import Swaying
from ..coverings import at, first
from .bodies import BURRAU, DRAG, FLAT, PARTICLE, SPIN, system, three

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
    flat = orbits.terms.ZonalHarmonics(source, J2=J2, radius=R, pole=(0.0, 0.0, 1.0))
    light = orbits.terms.RadiationPressure(bodies=list(lighted), beta=beta, source=source, c=C)
    return start.with_terms(orbits.terms.PostNewtonian(sources=[source], c=C), flat).with_forces(light)


def eccentric(mass, beta=BETA, e=0.99):
    """A body about a planet, from its apocentre."""
    speed = np.sqrt((1 - e) / (1 + e))
    q, v = np.array([1 + e, 0.0, 0.0]), speed * np.array([0.0, 0.8, 0.6])
    body = np.zeros(3)
    start = orbits.System(["planet", "body"], [1.0, mass], [body, q], [body, v], units=orbits.DIMENSIONLESS)
    return lit(start, "body", beta=beta), q, v


@pytest.mark.nightly
@pytest.mark.parametrize("mass", [1e-25, 0.0], ids=["massive", "massless"])
def test_an_orbit_of_e_099_with_relativity_flattening_and_light_comes_out_to_round_off(mass):
    """An orbit through its pericentre at 0.01: both are 1e-14 off; Newton's orbit would be 0.2 off."""
    start, q, v = eccentric(mass)
    end = 2 * np.pi
    found = propagate(start, end, samples=[end])
    x, w = extrapolated.motion(extrapolated.acceleration(1.0, C, J2, R, BETA), 1.0, q, v, end, 0.2)
    assert np.abs(found.q[-1, 1] - x).max() < 1e-12
    assert np.abs(found.v[-1, 1] - w).max() < 1e-12


@pytest.mark.nightly
def test_mercury_with_relativity_goes_as_with_a_short_dt():
    """A year; both methods leave round-off."""
    start = orbits.System.solar_system("2020-01-01", bodies=["Sun", "Mercury", "Venus", "Jupiter"])
    flat = orbits.terms.ZonalHarmonics("Sun", J2=2.2e-7, radius=696000 * u.km, pole=(286.13, 63.87) * u.deg)
    light = orbits.terms.RadiationPressure(bodies=["Venus"], beta=1e-9, source="Sun")
    start = start.with_terms(orbits.terms.PostNewtonian(sources=["Sun"]), flat).with_forces(light)
    chosen = propagate(start, 1 * u.yr, samples=5)
    fixed = propagate(start, 1 * u.yr, samples=5, dt=0.5 * u.day, integrator=orbits.Gauss(stages=8))
    off = np.abs((chosen.q - fixed.q).to_value(u.m))[-1]
    assert off.max() < 1e-3


@pytest.mark.parametrize("stages", first(1, [4, 8]))
def test_the_error_signal_is_of_the_order_of_the_last_coefficient(stages):
    method, factor = orbits.Gauss(stages=stages), 3.0 ** (stages - 1)
    loose = 1e-4 if stages == 4 else 1e-6
    runs = [
        propagate(swayed(), 20.0, integrator=method, dt=orbits.Adaptive(tolerance=t))
        for t in (loose, loose / factor)
    ]
    steps = [run.statistics.steps for run in runs]
    assert steps[1] == pytest.approx(3.0 * steps[0], rel=0.06)


@pytest.mark.nightly
def test_bodies_and_particles_go_as_with_a_short_dt():
    """At every sample, most of which lie within a step of the bodies, and some within one of a particle's own."""
    chosen = propagate(swayed(**GRAINS), 10.0, samples=81)
    assert chosen.statistics.steps < 81
    fixed = propagate(swayed(**GRAINS), 10.0, dt=1 / 256, integrator=orbits.Gauss(stages=8), samples=81)
    off = np.abs(chosen.q - fixed.q).max(axis=(0, 2))
    assert off[:3].max() < 2e-15
    assert off[3:].max() < 1e-12  # 3e-13 at the end, 8e-13 at a pericentre
    tiny = propagate(swayed(**{name: (1e-22, *state[1:]) for name, state in GRAINS.items()}), 10.0, samples=81)
    off = np.abs(chosen.q - tiny.q).max(axis=(0, 2))
    assert off[:3].max() < 3e-15
    assert off[3:].max() < 1e-12  # 3e-13 at the end, 8e-13 at a pericentre


@pytest.mark.nightly
def test_particles_are_retired_and_the_others_change_no_bit():
    falls = {"falls": (0.0, [0.5, 0.5, 0.0], [0.0, 0.0, 0.0])}
    start = three(**PARTICLE, **falls).with_terms(SPIN, FLAT, SWAY).with_forces(DRAG)
    run = propagate(start, 10.0, samples=3)
    without = propagate(swayed(**PARTICLE), 10.0, samples=3)
    assert np.array_equal(run.q[:, :4], without.q)


@pytest.mark.nightly
def test_work_torque_and_impulse_are_those_of_the_steps_that_were_taken():
    """At every sample, within steps too, through steps that were repeated."""
    start, _, _ = eccentric(1e-3, beta=1e-3)
    run = propagate(start, 15.0, samples=40)
    work = run.work()[0].work.value
    spent = np.array([run[k].energy().value for k in range(len(run))])
    off = (spent - spent[0]) - (work - work[0])
    assert np.abs(spent - spent[0]).max() > 1e-7
    assert np.abs(off).max() < 1e-17  # 7e-19 is reached, of an energy of 5e-4


def test_samples_blocks_and_threads_change_no_bit():
    start = swayed(**GRAINS)
    few, many = propagate(start, 6.0, samples=3, threads=1), propagate(start, 6.0, samples=61, threads=2)
    assert np.array_equal(few.q, many.q[::30])
    assert np.array_equal(few.v, many.v[::30])
    for one, other in zip(few.work(), many.work(), strict=True):
        assert np.array_equal(one.work, other.work[::30])


@pytest.mark.nightly
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
    assert np.abs(back.q[-1] - start.values.q).max() < 1e-13


@pytest.mark.parametrize("dense", [False, True])
def test_states_between_samples_are_those_of_the_motion(dense):
    """They know the time that a term depends on, in a march that starts from a sample too."""
    start = swayed(**GRAINS)
    run = propagate(start, 8.0, samples=5, dense=dense)
    times = [1.3, 3.7, 7.9]
    direct = propagate(start, 8.0, samples=times)
    found = run.at(times)
    assert np.abs(found.q - direct.q).max() < 3e-14
    assert np.abs(found.v - direct.v).max() < 1e-13


def test_events_are_found_on_the_motion_of_bodies_and_particles():
    start = swayed(**GRAINS)
    events = [orbits.events.Pericentre("inner", "planet"), orbits.events.Pericentre("grain", "planet")]
    run = propagate(start, 8.0, samples=5, events=events)
    assert len(run.events) > 4
    for event in run.events:
        state = propagate(start, float(event.time), samples=[float(event.time)])
        body = run.names.index(event.body)
        q, v = state.q[-1, body] - state.q[-1, 0], state.v[-1, body] - state.v[-1, 0]
        assert abs(q @ v) < 1e-12


@pytest.mark.parametrize("particles", at((1,), [{}, {"grain": GRAINS["grain"]}]), ids=["bodies", "particles"])
def test_after_a_merger_terms_see_the_time_of_the_run(particles):
    """Two bodies merge at about 1.3; run.at marches through that from the sample before."""
    meeting = {"one": (1e-3, [2.0, 2.0, 0.0], [0.1, 0.3, 0.0]), "two": (1e-3, [2.0, 2.6, 0.0], [0.1, -0.1, 0.0])}
    bare = swayed(**meeting, **particles)
    radii = [0.0 if name not in meeting else 0.05 for name in bare.names]
    start, events = bare.replaced(radii=radii), orbits.events.Collision(then=orbits.events.Merge())
    options = {"events": events, "samples": [4.0]}
    chosen = propagate(start, 4.0, **options)
    fixed = propagate(start, 4.0, dt=1 / 128, integrator=orbits.Gauss(stages=8), **options)
    assert len(chosen.events) == len(fixed.events) == 1
    assert float(chosen.events[0].time) == pytest.approx(float(fixed.events[0].time), rel=1e-13)
    there = ~np.isnan(chosen.q.value[-1])
    np.testing.assert_allclose(chosen.q.value[-1][there], fixed.q.value[-1][there], rtol=0, atol=1e-13)
    direct = propagate(start, 4.0, events=events, samples=[3.0])
    np.testing.assert_allclose(chosen.at([3.0]).q.value[-1], direct.q.value[-1], rtol=0, atol=1e-14)
    np.testing.assert_allclose(chosen.work()[0].work[-1], fixed.work()[0].work[-1], rtol=1e-11)


def test_a_body_alone_under_forces_takes_steps_that_resolve_them():
    """No body sets a time scale: steps as long as the limit are repeated until they resolve v' = -k (v - u) + sway."""
    begun, times = np.array([1.0, 0.2, -0.3]), np.array([50.0, 300.0])
    start = orbits.System(["planet"], [1.0], np.zeros((1, 3)), [begun], units=orbits.DIMENSIONLESS)
    run = propagate(start.with_terms(SPIN, FLAT, SWAY).with_forces(DRAG), 300.0, samples=times)
    k, wind, turn = DRAG.rate, np.array(DRAG.velocity), 1j * SWAY.rate
    forced = (np.array(SWAY.A) - SWAY.rate * np.array(SWAY.C)) / (k + turn)
    left, waves = begun - wind - forced.real, np.exp(turn * times)[:, None] * forced
    fading = np.exp(-k * times)[:, None]
    np.testing.assert_allclose(run.v.value[:, 0], wind + waves.real + left * fading, rtol=0, atol=1e-13)
    way = wind * times[:, None] + ((waves - forced) / turn).real + left * (1 - fading) / k
    np.testing.assert_allclose(run.q.value[:, 0], way, rtol=0, atol=1e-11)
    # Its impulse is the force -k (v - u) over time.
    np.testing.assert_allclose(run.work()[0].impulse.value, k * (wind * times[:, None] - way), rtol=0, atol=1e-13)


def test_the_message_of_a_step_that_cannot_be_taken_names_terms_and_forces():
    said = [
        str(failure_of_bodies(TOO_SHORT, 3, 1.5, orbits.Adaptive(), orbits.Gauss(), ["a", "b"], momenta=m, forces=f))
        for m, f in ((True, False), (False, True), (False, False))
    ]
    assert "adds as much as m v to the momenta there, which needs orbits.march" in said[0]
    assert "a force jumps there" in said[1]
    assert said[2].endswith("events=orbits.events.Collision(...).")


def test_transformed_time_is_still_for_attractions_alone():
    with pytest.raises(InputError, match="nothing else, so far, not with"):
        propagate(swayed(), 1.0, dt=orbits.TimeTransformed(0.3))


def test_error_bars_come_from_companions_with_other_tolerances():
    bars = propagate(swayed(**GRAINS), 5.0, samples=3).error_estimate()
    assert 1e-17 < bars.position.value[-1, 0] < 1e-14


def test_where_terms_and_forces_are_nothing_encounters_come_out_as_without_them():
    """Burrau's problem, 1.5e-6 off, and 1.9e-6 without them: distances have low parts, and the last sweep is fine."""
    start = system([3, 4, 5], [[1, 3, 0], [-2, -1, 0], [1, -1, 0]], np.zeros((3, 3)))
    name, pole, least = start.names[0], (0.0, 0.0, 1.0), 1e-100
    nothing = (
        orbits.terms.FrameDragging(name, spin=least, pole=pole, c=3.0),
        orbits.terms.ZonalHarmonics(name, J2=least, radius=1e-3, pole=pole),
        Swaying(A=(0.0, 0.0, 0.0), C=(0.0, 0.0, 0.0)),
    )
    run = propagate(start.with_terms(*nothing).with_forces(orbits.terms.Drag(rate=least)), 63.0, samples=2)
    assert np.abs(run.q.value[-1] - BURRAU).max() < 1e-5
