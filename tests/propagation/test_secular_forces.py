"""What forces do to orbits in the long run, beside the secular formulas; archives, work, and later epochs with them."""

import numpy as np
import pytest
from astropy import units as u

import orbits
from orbits.errors import InputError
from orbits.terms import Damping, GasDrag, MassLoss, NonGravitational, RadiationPressure

METHOD = orbits.Gauss(stages=4)
A, E, INCLINATION = 1.0, 0.3, 0.02


def star(gm=0.0, e=E, **more):
    """A star with a body on an orbit of the semi-major axis 1 about it, in units with GM = 1."""
    n = np.sqrt(1.0 + gm)
    far, slow = A * (1 + e), n * np.sqrt((1 - e) / (1 + e))
    q = np.array([[0.0, 0, 0], [far, 0, 0]])
    v = np.array([[0.0, 0, 0], [0, slow * np.cos(INCLINATION), slow * np.sin(INCLINATION)]])
    return orbits.System(["star", "body"], [1.0, gm], q, v, units=orbits.DIMENSIONLESS, **more)


def elements(run):
    """a, e and i of the body at each sample, (3, samples)."""
    r, w = run.q.value[:, 1] - run.q.value[:, 0], run.v.value[:, 1] - run.v.value[:, 0]
    mu = 1.0 + run.system.gm.value[1]
    distance, h = np.linalg.norm(r, axis=1), np.cross(r, w)
    a = 1 / (2 / distance - (w**2).sum(axis=1) / mu)
    e = np.linalg.norm(np.cross(w, h) / mu - r / distance[:, None], axis=1)
    return np.array([a, e, np.arccos(h[:, 2] / np.linalg.norm(h, axis=1))])


def rates(force, turns=20, gm=0.0, e=E):
    """da/dt, de/dt and di/dt, averaged over whole orbits."""
    period = 2 * np.pi / np.sqrt(1.0 + gm)
    run = orbits.propagate(
        star(gm, e).with_forces(force),
        METHOD,
        dt=period / 64,
        duration=turns * period,
        samples=2,
        progress=False,
        check_step=False,
    )
    found = elements(run)
    return (found[:, -1] - found[:, 0]) / (turns * period)


SLOW = 1e-7
"""Rates: what is of their second order is 1e-5 of the change over 20 orbits."""


@pytest.mark.nightly
def test_light_makes_dust_spiral_inwards_as_wyatt_and_whipple_say():
    beta, c = 1e-6, 10.0
    da, de, _ = rates(RadiationPressure(beta=beta, c=c))
    # Of second order is the change of a and e over 20 orbits, 3e-5 of them.
    assert da == pytest.approx(-beta * (2 + 3 * E**2) / (c * A * (1 - E**2) ** 1.5), rel=1e-4)
    assert de == pytest.approx(-2.5 * beta * E / (c * A**2 * np.sqrt(1 - E**2)), rel=1e-4)


@pytest.mark.nightly
@pytest.mark.parametrize("gm", [0.0, 1e-3], ids=["particle", "body"])
def test_the_yarkovsky_effect_drifts_as_its_formula_says(gm):
    da, _, _ = rates(NonGravitational.yarkovsky(SLOW, r0=1.0), gm=gm)
    # A body moves the star along, which is what the forces are relative to.
    n = np.sqrt(1.0 + gm)
    assert da == pytest.approx(2 * SLOW / (n * A**2 * (1 - E**2)), rel=2e-5)


@pytest.mark.nightly
def test_damping_takes_a_e_and_i_at_their_rates():
    for name, expected in {
        "tau_a": (-SLOW, 0.0, 0.0),
        "tau_e": (
            -4 * SLOW * (1 - np.sqrt(1 - E**2)),
            -2 * SLOW * (1 - E**2) * (1 - np.sqrt(1 - E**2)) / E,
            0.0,
        ),
    }.items():
        assert np.allclose(rates(Damping(**{name: 1 / SLOW})), expected, rtol=2e-5, atol=1e-5 * SLOW)
    _, _, di = rates(Damping(tau_i=1 / SLOW), e=0.0)
    assert di == pytest.approx(-SLOW * INCLINATION, rel=INCLINATION**2)


@pytest.mark.nightly
def test_gas_that_turns_slower_takes_a_circular_orbit_inwards():
    eta = 1e-2
    run = orbits.propagate(
        star(e=0.0).with_forces(
            GasDrag(
                per_length=1e-5, r0=2.0, slope=1.5, eta=eta, pole=(0, -np.sin(INCLINATION), np.cos(INCLINATION))
            )
        ),
        METHOD,
        dt=0.1,
        duration=40 * np.pi,
        samples=2,
        progress=False,
        check_step=False,
    )
    behind = 1 - np.sqrt(1 - 2 * eta)
    a = elements(run)[0]
    # a' = -2 a f / v with the force k (r/r0)^-p (v - u)^2.
    assert (a[1] - a[0]) / (40 * np.pi) == pytest.approx(-2 * 1e-5 * 2.0**1.5 * behind**2, rel=1e-4)


@pytest.mark.nightly
@pytest.mark.parametrize("gm", [0.0, 1e-6], ids=["particle", "body"])
def test_an_orbit_widens_as_its_star_loses_mass_and_keeps_its_eccentricity(gm):
    run = orbits.propagate(
        star(gm).with_forces(MassLoss(fraction=-SLOW)),
        METHOD,
        dt=0.1,
        duration=40 * np.pi,
        samples=2,
        progress=False,
    )
    # Elements are of the constant GM: what is gone changes them by itself, at this phase of the orbit.
    gone = SLOW * run.times[-1]
    r, w = run.q.value[-1, 1] - run.q.value[-1, 0], run.v.value[-1, 1] - run.v.value[-1, 0]
    mu = 1.0 + gm - gone
    a = 1 / (2 / np.linalg.norm(r) - (w @ w) / mu)
    assert (a - A) / run.times[-1] == pytest.approx(SLOW, rel=2e-3)
    e = np.linalg.norm(np.cross(w, np.cross(r, w)) / mu - r / np.linalg.norm(r))
    assert abs(e - E) < 2 * gone / 40  # it oscillates by the loss in an orbit


@pytest.mark.nightly
def test_mass_loss_counts_from_the_epoch_of_the_run_wherever_a_state_of_it_is_taken_up_again():
    system = star().with_forces(MassLoss(fraction=-0.01, since=-1.0))
    options = {"dt": 0.1, "progress": False, "check_step": False}
    whole = orbits.propagate(system, METHOD, duration=4.0, samples=3, **options)
    assert whole[1].forces[0].since.value == -3.0
    again = orbits.propagate(whole[1], METHOD, duration=2.0, samples=2, **options)
    assert np.max(np.abs(again.q.value[-1] - whole.q.value[-1])) < 1e-14


@pytest.mark.parametrize("whom", [None, ["body"]])
@pytest.mark.parametrize("way", [1, -1])
def test_a_run_past_the_loss_of_all_mass_is_refused(way, whom):
    """The star would go on as one that repels."""
    system = star().with_forces(MassLoss(fraction=-0.1 * way, since=2.0 * way, bodies=whom))
    with pytest.raises(InputError, match=r"MassLoss: gm of 'star' would be -0\.3 at t = -?15; .*shorter"):
        orbits.propagate(system, duration=15.0 * way, progress=False)
    early = star().with_forces(MassLoss(fraction=2.0 * way, since=1.0 * way, bodies=whom))
    with pytest.raises(InputError, match=r"MassLoss: gm of 'star' would be -1 at t = 0; expected mass to be left"):
        orbits.propagate(early, duration=1.0 * way, progress=False)


ACTING = (
    RadiationPressure(beta=(0.01, 0.02), bodies=["body", "grain"], c=100.0),
    NonGravitational(A1=1e-3, A2=(1e-3,), bodies=["grain"], r0=1.0),
    Damping(tau_a=1e3, tau_e=(1e2, 1e3), bodies=["body", "grain"]),
    GasDrag(per_length=1e-3, r0=1.0, slope=2.0, eta=0.01),
    MassLoss(fraction=-1e-3),
)


@pytest.mark.nightly
def test_all_of_them_together_are_archived_resumed_and_their_work_accounted(tmp_path):
    one = star(1e-3)
    system = one.add("grain", gm=0.0, q=[0.0, 1.6, 0.0], v=[-0.75, 0.0, 0.1]).with_forces(*ACTING)
    options = {"dt": 1 / 32, "progress": False, "check_step": False}
    whole = orbits.propagate(system, METHOD, duration=8.0, samples=9, **options)
    path = tmp_path / "run.h5"
    orbits.propagate(system, METHOD, duration=4.0, samples=5, archive=path, **options).close()
    part = orbits.Trajectory.open(path)
    assert part.system.forces == system.forces
    part.close()
    run = orbits.resume(path, until=8.0, progress=False)
    assert np.array_equal(run.q, whole.q)
    work = [w.work.value[-1] for w in run.work()]
    energy = run.energy().value
    assert sum(work) == pytest.approx(energy[-1] - energy[0], abs=1e-9 * abs(energy[0]))
    assert work[1] == 0.0  # it acts on the grain alone, which has no mass
    assert run.drift().energy.max_fraction < 1e-9
    run.close()


@pytest.mark.nightly
def test_radiation_pressure_of_one_per_cent_is_felt_in_physical_units():
    grain = orbits.System.solar_system(bodies=["Sun", "Jupiter"]).add(
        "grain", gm=0 * u.au**3 / u.day**2, q=[1, 0, 0] * u.au, v=[0, 29.78, 0] * u.km / u.s
    )
    force = RadiationPressure(beta=RadiationPressure.beta_of_sphere(20 * u.um, 2500 * u.kg / u.m**3))
    acting = grain.with_forces(force, NonGravitational(A1=1e-9 * u.au / u.day**2, bodies=["grain"]))
    assert acting.forces[0].c.to_value(u.km / u.s) == pytest.approx(299792.458)
    run = orbits.propagate(acting, METHOD, dt=1 * u.day, duration=100 * u.day, progress=False)
    bare = orbits.propagate(grain, METHOD, dt=1 * u.day, duration=100 * u.day, progress=False)
    assert 1e-3 < np.linalg.norm(run[-1]["grain"].q - bare[-1]["grain"].q).to_value(u.au) < 0.1
