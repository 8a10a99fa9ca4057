"""Tides with a constant time lag: angular momentum of orbit and spin together, secular rates, and what they lead to."""

import math

import numpy as np
import pytest
from astropy import units as u

import orbits
from orbits.errors import ConvergenceError, InputError
from orbits.events import Pericentre
from orbits.terms import Tides

from ..coverings import each

METHOD = orbits.Gauss(stages=4)
STEPS = {"progress": False, "check_step": False}
EPS = 2.0**-53


def pair(gm=1e-2, e=0.3):
    """A star of GM 1 and a planet at its apocentre, a = 1, in the plane x, y; about their barycentre."""
    far, slow = 1 + e, math.sqrt((1 + gm) * (1 - e) / (1 + e))
    q, v = [[0.0, 0, 0], [far, 0, 0]], [[0.0, 0, 0], [0, slow, 0]]
    return orbits.System(["star", "planet"], [1.0, gm], q, v, units=orbits.DIMENSIONLESS).barycentric()


def march(system, **options):
    return orbits.propagate(system, METHOD, **{"dt": 1 / 16, "samples": 9, **STEPS, **options})


def elements(run):
    """a and e at each sample, (2, samples)."""
    r, w = (x.value[:, 1] - x.value[:, 0] for x in (run.q, run.v))
    mu, distance = run.system.gm.value.sum(), np.linalg.norm(r, axis=1)
    a = 1 / (2 / distance - (w**2).sum(axis=1) / mu)
    return np.array([a, np.linalg.norm(np.cross(w, np.cross(r, w)) / mu - r / distance[:, None], axis=1)])


def hut(e):
    f = np.polynomial.polynomial.polyval
    return (
        f(e * e, [1, 31 / 2, 255 / 8, 185 / 16, 25 / 64]),
        f(e * e, [1, 15 / 2, 45 / 8, 5 / 16]),
        f(e * e, [1, 15 / 4, 15 / 8, 5 / 64]),
        f(e * e, [1, 3 / 2, 1 / 8]),
        f(e * e, [1, 3, 3 / 8]),
    )


@pytest.mark.parametrize("spin", [0.0, 2.5])
@pytest.mark.parametrize("e", [0.05, 0.3])
def test_orbit_and_spin_change_at_the_rates_of_hut(e, spin):
    gm, k2, R, lag, inertia = 1e-2, 0.3, 0.05, 1.0, 0.08
    turns, n = 16, math.sqrt(1 + gm)
    force = Tides("star", k2=k2, radius=R, lag=lag, inertia=inertia, spin=spin, pole=(0, 0, 1))
    dt = 2 * math.pi / n / 64
    run = march(pair(gm, e).with_forces(force), dt=dt, duration=turns * 64 * dt, samples=2)
    span = run.times[-1]
    spins = run.rotation.spin("star").value
    (da, de), (_, _, ds) = np.diff(elements(run))[:, 0] / span, np.diff(spins, axis=0)[0] / span
    f1, f2, f3, f4, f5 = hut(e)
    x, s = 1 - e * e, spin / n
    K = 3 * k2 * lag * n**2 * gm * R**5
    # Of second order is what the rates change in 16 orbits, 1e-5 of them, and the precession by the tides themselves.
    assert da == pytest.approx(-2 * K / x**7.5 * (f1 - x**1.5 * f2 * s), rel=5e-5)
    assert de == pytest.approx(-9 * K * e / x**6.5 * (f3 - 11 / 18 * x**1.5 * f4 * s), rel=1e-4)
    torque = 3 * k2 * lag * gm**2 * R**5 * n / x**6 * (f2 - x**1.5 * f5 * s)
    assert ds == pytest.approx(torque / (inertia * R**2), rel=5e-5)


@pytest.mark.nightly
def test_angular_momentum_of_orbits_and_spins_is_conserved_to_round_off_over_many_steps():
    both = pair(0.1, 0.4).with_forces(
        Tides("star", k2=0.3, radius=0.25, lag=0.02, inertia=0.08, spin=(0.3, -0.5, 1.4)),
        Tides("planet", k2=0.5, radius=0.1, lag=0.05, inertia=0.25, spin=(0.0, 2.0, -1.0)),
    )
    run = march(both, duration=2000.0)
    total = (run.angular_momentum() + run.rotation.spin_angular_momentum()).value
    moved = np.abs(run.rotation.spin_angular_momentum().value[-1] - run.rotation.spin_angular_momentum().value[0]).max()
    assert moved > 1e-4  # of what is exchanged
    # 32,000 steps; samples are rounded, the march is not. Measured: 5.6e-17.
    assert np.abs(total - total[0]).max() < 8 * EPS * np.linalg.norm(total[0])
    assert run.drift().angular_momentum.max_fraction < 8 * EPS
    assert run.drift().linear_momentum.max_fraction < 1e-14


def test_the_energy_of_orbits_and_spins_is_lost_at_the_rate_at_which_the_bulge_is_dragged_along():
    """Without a lag none is lost, but in the bulge: what is taken comes back each orbit."""
    k2, R, lag, inertia, gm = 0.3, 0.2, 0.05, 0.08, 1e-2
    force = Tides("star", k2=k2, radius=R, lag=lag, inertia=inertia, spin=2.0, pole=(0, 0.6, 0.8))
    run = march(pair(gm, 0.3).with_forces(force), duration=64.0, samples=1025)
    (effect,) = run.work()
    assert np.abs(run.energy() - effect.work - run.energy()[0]).max() < 1e-11
    r, w = (x.value[:, 1] - x.value[:, 0] for x in (run.q, run.v))
    distance = np.linalg.norm(r, axis=1)
    past = w - np.cross(run.rotation.spin("star").value, r)
    size = 3 * k2 * gm**2 * R**5 * lag / distance**8
    # -(F . w) - s . (-r x F) of the part with the lag: a sum of squares.
    rate = size * (2 * (np.einsum("ki,ki->k", r, w) / distance) ** 2 + (past**2).sum(axis=1))
    spins = 0.5 * inertia * R**2 * (run.rotation.spin("star").value ** 2).sum(axis=1)
    bulge = -0.5 * k2 * gm**2 * R**5 / distance**6
    kept = run.energy().value + spins + bulge
    lost = np.concatenate([[0.0], np.cumsum((rate[1:] + rate[:-1]) / 2 * np.diff(run.times))])
    # The trapezoidal rule over whole steps leaves 1e-5 of it.
    assert np.abs(kept[0] - kept - lost).max() < 1e-4 * lost[-1]
    held = march(pair(gm).with_forces(Tides("star", k2=k2, radius=R, lag=0, inertia=1, spin=0)), duration=64.0)
    r = np.linalg.norm(held.q.value[:, 1] - held.q.value[:, 0], axis=1)
    total = held.energy().value - 0.5 * k2 * gm**2 * R**5 / r**6
    assert np.ptp(total) < 1e-12


def test_a_spin_reaches_its_pseudo_synchronous_equilibrium():
    force = Tides("planet", k2=0.3, radius=0.06, lag=0.02, inertia=0.03, spin=3.0, pole=(0, 0.6, 0.8))
    late = march(pair(1e-2, 0.1).with_forces(force), duration=1600.0, samples=2)  # 20 times the time of relaxation
    (a, e), n = elements(late)[:, -1], math.sqrt(1.01)
    period = round(2 * math.pi * a**1.5 / n * 2**20) / 2**20  # so that samples are at the ends of steps
    orbit = march(late[-1], dt=period / 128, duration=period, samples=33)
    _, f2, _, _, f5 = hut(e)
    spin = orbit.rotation.spin("planet").value[:-1].mean(axis=0)
    # Elements at a sample are osculating ones: 2.1e-4 off, three times the field of the bulge.
    assert spin[2] / (n * a**-1.5) == pytest.approx(f2 / ((1 - e * e) ** 1.5 * f5), rel=3e-4)
    r, w = (x.value[0, 1] - x.value[0, 0] for x in (orbit.q, orbit.v))
    pole = np.cross(r, w) / np.linalg.norm(np.cross(r, w))
    assert np.abs(np.cross(spin, pole)).max() < 4e-5  # it began 37 degrees away, and is righted at half that rate


def test_a_spin_that_is_held_stays_and_its_torque_is_accounted():
    force = Tides("star", k2=0.3, radius=0.3, lag=0.1, inertia=math.inf, spin=(0.0, 0.0, 2.0))
    run = march(pair().with_forces(force), duration=50.0)
    assert (run.rotation.spin("star").value == [0.0, 0.0, 2.0]).all()
    assert not run.rotation.spin_angular_momentum().value.any()
    left = (run.angular_momentum() - run.work()[0].torque).value
    assert np.abs(left - left[0]).max() < 4 * EPS * np.abs(left[0]).max()


@pytest.mark.nightly
def test_massless_bodies_move_as_without_tides_and_the_massive_ones_as_without_them():
    grain = pair().add("grain", gm=0.0, q=[0.0, 2.0, 0.0], v=[-0.7, 0.0, 0.1])
    force = Tides("star", k2=0.3, radius=0.2, lag=0.1, inertia=0.1, spin=1.0, pole=(0, 0, 1))
    with_grain, without = (march(x.with_forces(force), duration=20.0) for x in (grain, pair()))
    assert np.array_equal(with_grain.q[:, :2], without.q)
    assert np.array_equal(with_grain.rotation.spin("star"), without.rotation.spin("star"))


def test_the_moon_recedes_by_centimetres_a_year():
    """By the lag of the Earth today, 38 mm a year; Dickey et al. (1994) measured 38.2 mm by laser."""
    n, a = 2 * math.pi / (27.321661 * u.day), 384400 * u.km
    K = 3 * 0.299 * 638 * u.s * n**2 * 0.0123 * (6378.137 * u.km / a).to_value("") ** 5
    slow = 2 * K * a * ((1 * u.rad / (86164 * u.s)) * 2 * math.pi / u.rad / n).to_value("")
    assert slow.to_value("mm / yr") == pytest.approx(38, abs=8)


GOOD = {"k2": 0.3, "radius": 0.1, "lag": 0.01, "inertia": 0.3, "spin": 1.0, "pole": (0, 0, 1)}
WRONG = {
    "no source": ({"source": None}, "source is missing"),
    "unknown": ({"source": "moon"}, "moon"),
    "itself": ({"bodies": ["star"]}, "cannot act on it"),
    "massless": ({"bodies": ["grain"]}, "gm of 'grain' is 0; expected massive ones"),
    "massless source": ({"source": "grain"}, "expected a massive body as source"),
    "no radius": ({"radius": None}, r"Tides of 'star': radius is missing; .* radius=6378 \* u.km"),
    "no lag": ({"lag": None}, "lag is missing"),
    "no k2": ({"k2": None}, "k2 is missing"),
    "no inertia": ({"inertia": None}, "inertia is missing"),
    "no spin": ({"spin": None}, "spin is missing"),
    "no pole": ({"pole": None}, "pole is missing, about which it spins"),
    "two poles": ({"spin": (0, 0, 1)}, "spin is a vector; leave pole out"),
    "NaN": ({"spin": math.nan}, "spin is nan"),
    "lag": ({"lag": -1.0}, "lag is -1.0; expected one number >= 0"),
    "radius": ({"radius": 0.0}, "radius is 0.0; expected one number > 0"),
    "inertia": ({"inertia": 0.0}, "inertia is 0.0; expected one number > 0"),
}


@each(("change", "said"), WRONG.values())
def test_numbers_that_no_tides_have_are_refused(change, said):
    grain = pair().add("grain", gm=0.0, q=[0.0, 2.0, 0.0], v=[-0.7, 0.0, 0.1])
    with pytest.raises(InputError, match=said):
        grain.with_forces(Tides(**{"source": "star", **GOOD, **change}))


def test_one_body_has_one_spin():
    with pytest.raises(InputError, match="'star' has two forces Tides; expected one, of all bodies together"):
        pair().with_forces(Tides("star", **GOOD), Tides("star", **GOOD))


def test_what_does_not_know_a_spin_is_refused_and_a_body_without_tides_has_none():
    system = pair().with_forces(Tides("star", **GOOD))
    both = system.with_forces(Tides("planet", **GOOD))
    for acting in (system, both):
        with pytest.raises(InputError, match=r"but Tides changes a spin .* run.at\(times\) marches on"):
            march(acting, duration=2.0, dense=True)
        with pytest.raises(InputError, match=r"but Tides changes a spin .*; leave out Pericentre, or Tides\.$"):
            march(acting, duration=2.0, events=Pericentre("planet"))
    with pytest.raises(InputError, match="those with Tides, star"):
        march(system, duration=2.0).rotation.spin("planet")
    with pytest.raises(InputError, match=r"a system with forces orbits.terms.Tides"):
        march(pair(), duration=2.0).rotation.spin("star")


def test_spins_at_times_with_blocks_between_them_are_those_of_each_alone():
    force = Tides("star", k2=0.3, radius=0.25, lag=0.02, inertia=0.08, spin=(0.3, -0.5, 1.4))
    run, times = march(pair(0.1, 0.4).with_forces(force), duration=2000.0, samples=2), [1.0, 2.0, 1900.5]
    for time, found in zip(times, run.at(times), strict=True):
        assert found.forces == run.at(time).forces


def test_energies_of_states_in_any_order_are_drawn_with_the_work_of_forces():
    force = Tides("star", k2=0.3, radius=0.25, lag=0.02, inertia=0.08, spin=(0.3, -0.5, 1.4))
    run = march(pair(0.1, 0.4).with_forces(force), duration=20.0, samples=2)
    mixed, sorted_ = (run.at(times).plot("energy") for times in ([3.0, 1.0, 2.0], [1.0, 2.0, 3.0]))
    for one, other in zip(mixed.axes[0].lines, sorted_.axes[0].lines, strict=True):
        assert np.array_equal(one.get_xydata(), other.get_xydata())


@pytest.mark.nightly
def test_steps_are_chosen_with_tides_too_and_an_eccentric_orbit_keeps_its_angular_momentum():
    force = Tides("planet", k2=0.3, radius=0.01, lag=0.01, inertia=0.3, spin=3.0, pole=(0, 0.6, 0.8))
    system = pair(1e-2, 0.9).with_forces(force)
    run = orbits.propagate(system, orbits.Gauss(stages=8), duration=100.0, samples=9, progress=False)
    fixed = orbits.propagate(system, orbits.Gauss(stages=8), dt=1 / 512, duration=100.0, samples=9, **STEPS)
    assert np.abs((run.rotation.spin("planet") - fixed.rotation.spin("planet")).value).max() < 1e-10
    assert np.abs((run.rotation.spin("planet")[-1] - run.rotation.spin("planet")[0]).value).max() > 1e-3
    total = (run.angular_momentum() + run.rotation.spin_angular_momentum()).value
    assert np.abs(total - total[0]).max() < 8 * EPS * np.linalg.norm(total[0])
    assert run.at(run.times[4]).forces == run[4].forces


def test_massless_bodies_with_steps_of_their_own_are_refused_beside_a_spin():
    grain = pair().add("grain", gm=0.0, q=[0.0, 2.0, 0.0], v=[-0.7, 0.0, 0.1])
    with pytest.raises(InputError, match="internal variables of tides, such as a spin, are not known: give dt"):
        orbits.propagate(grain.with_forces(Tides("star", **GOOD)), duration=1.0)


def test_a_spin_that_changes_faster_than_a_step_is_an_error_and_not_a_number():
    stiff = Tides("planet", k2=0.3, radius=0.05, lag=1.0, inertia=1e-4, spin=3.0, pole=(0, 0, 1))
    with pytest.raises(ConvergenceError, match="change faster than the step can follow"):
        march(pair().with_forces(stiff), duration=10.0)
