"""The shadow energy: conserved to the order asked for, where the energy oscillates by h^2."""

import itertools

import numpy as np
import pytest
from astropy import units as u

import orbits
from orbits.diagnostics.shadow import central_weights

from ..coverings import first

LAGRANGIANS = orbits.lagrangians
CASES = [
    (LAGRANGIANS.kepler, orbits.StormerVerlet(), 0.05),
    (LAGRANGIANS.kepler, orbits.Gauss(stages=1), 0.05),
    (LAGRANGIANS.charged_particle, orbits.Gauss(stages=1), 0.05),
    (LAGRANGIANS.pendulum_on_a_sphere, orbits.methods.Rattle(), 0.1),
]


def path_of(L, method, h, time=4.0, samples=5):
    steps = round(time / h)
    return orbits.march(L, method, dt=h, steps=steps, every=steps // samples)


def orders(L, method, h, asked):
    found = []
    for step in (h, h / 2):
        path = path_of(L, method, step)
        found.append([np.ptp(path.energy()), *(np.ptp(orbits.shadow_energy(path, order=order)) for order in asked)])
    return np.log2(np.array(found[0]) / np.array(found[1])), found[1]


@pytest.mark.parametrize(("L", "method", "h"), first(2, CASES), ids=lambda x: getattr(x, "name", str(x)))
def test_its_fluctuation_falls_with_the_order_asked_for_where_that_of_the_energy_falls_as_h_squared(L, method, h):
    measured, last = orders(L, method, h, (4, 6, 8))
    assert np.all(np.abs(measured - [2, 4, 6, 8]) < 0.35), measured  # the magnetic field's: 1.99, 3.98, 5.94, 7.7
    assert last[3] < 1e-4 * last[0]


def test_a_method_of_order_four_has_one_of_order_ten():
    measured, _ = orders(LAGRANGIANS.kepler, orbits.methods.Composition(order=4), 0.1, (8, 10))
    assert np.all(np.abs(measured[1:] - [8, 10]) < 0.8), measured  # 7.9, 9.3


def test_a_method_that_is_not_symmetric_has_one_of_the_middle_of_the_steps_after_each_sample():
    measured, last = orders(LAGRANGIANS.kepler, orbits.methods.SymplecticEuler(), 0.05, (4, 6))
    # Of its order 1 and an even number of steps more: 1, 5 - 1 and 7 - 1 at least.
    assert abs(measured[0] - 1) < 0.1
    assert measured[1] > 4.8  # 4.98
    assert measured[2] > 6.8
    assert last[2] < 1e-6 * last[0]


def test_it_is_the_modified_hamiltonian_of_stormer_verlet():
    """H + h^2/12 p^2 V'' - h^2/24 V'^2 + O(h^4), the first terms of the series."""
    for h, bound in ((0.1, 6e-6), (0.05, 4e-7)):  # 3.9e-6, 2.4e-7
        path = orbits.march(LAGRANGIANS.pendulum, orbits.StormerVerlet(), q=[1.0], v=[0.5], dt=h, steps=40, every=5)
        q, p = path.q[:, 0], path.p[:, 0]
        series = p**2 / 2 - np.cos(q) + h**2 * (p**2 * np.cos(q) / 12 - np.sin(q) ** 2 / 24)
        assert np.abs(orbits.shadow_energy(path) - series).max() < bound


def test_of_the_oscillator_it_is_known_in_closed_form():
    """H~ = (q^2 (1 - h^2/4) + p^2) / 2 times arccos(1 - h^2/2) / (h sqrt(1 - h^2/4)) (HLW IX.3, for unit frequency)."""
    h = 0.25
    spring = LAGRANGIANS.harmonic_oscillator.with_parameters(m=1.0, k=1.0)
    path = orbits.march(spring, orbits.StormerVerlet(), q=[1.0], v=[0.2], dt=h, steps=10, every=5)
    q, p = path.q[:, 0], path.p[:, 0]
    exact = (q**2 * (1 - h**2 / 4) + p**2) / 2 * np.arccos(1 - h**2 / 2) / (h * np.sqrt(1 - h**2 / 4))
    off = [np.abs(orbits.shadow_energy(path, order=order) - exact).max() for order in (4, 6, 8, 14)]
    # 1.6e-4, 1.9e-5, 1.4e-6, 3.9e-10: an order of two more is worth a factor of 14 at this step.
    assert off[0] < 2e-4
    assert off[3] < 5e-10
    assert all(a > 8 * b for a, b in itertools.pairwise(off)), off


def three_planets(**changed):
    system = orbits.System.solar_system(bodies=["Sun", "Jupiter", "Saturn"])
    return system.replaced(**changed) if changed else system


def relative_range(energy):
    return float(np.ptp(energy) / abs(energy[0]))


def test_a_run_with_few_samples_between_its_steps_shows_it_too():
    """The step before a sample is found by taking the part of a step back."""
    found = []
    for dt in (100, 50):
        run = orbits.propagate(
            three_planets(), orbits.StormerVerlet(), dt=dt, duration=20_000, samples=4, check_step=False
        )
        assert any(run.clock.place(float(t)).rest for t in run.times)
        found.append([relative_range(e) for e in (run.energy(), orbits.shadow_energy(run))])
        assert orbits.shadow_energy(run).unit == run.energy().unit
    assert found[1][0] > 1e-5
    assert found[1][1] < 3e-6 * found[1][0]
    assert 5 < np.log2(found[0][1] / found[1][1]) < 11


@pytest.mark.nightly
def test_it_includes_the_terms_of_the_lagrangian():
    system = three_planets().with_terms(orbits.terms.PostNewtonian("Sun"))
    run = orbits.propagate(system, orbits.Gauss(stages=1), dt=100, duration=8000, samples=5, check_step=False)
    assert relative_range(orbits.shadow_energy(run, order=8)) < 1e-3 * relative_range(run.energy())


def test_the_weights_are_those_of_the_first_derivative():
    assert np.array_equal(central_weights(1), [0.5])
    assert np.allclose(central_weights(2), [2 / 3, -1 / 12], rtol=1e-15)
    assert np.allclose(central_weights(4), [4 / 5, -1 / 5, 4 / 105, -1 / 280], rtol=1e-15)


def turning(name):
    """Three planets, of which one is rigid."""
    return three_planets().with_rigid(name, orbits.RigidBody(shape=(1.2, 1.1, 1.0) * u.R_jup, spin=1 * u.rad / u.day))


def test_runs_without_such_an_energy_are_refused_with_the_reason():
    march, kepler = orbits.march, LAGRANGIANS.kepler
    short = {"duration": 400, "samples": 3, "check_step": False}
    cases = [
        (lambda: march(kepler, orbits.methods.RungeKutta4(), dt=0.1, steps=2), {}, "is not symplectic"),
        (lambda: march(kepler, orbits.StormerVerlet(), dt=0.1, steps=2), {"order": 7}, "even number from 4 to 14"),
        (lambda: march(kepler, orbits.StormerVerlet(), dt=0.1, steps=2), {"order": 2}, "even number from 4 to 14"),
        (lambda: march(LAGRANGIANS.driven_pendulum, orbits.Gauss(), dt=0.1, steps=2), {}, "depends on time"),
        (lambda: 3, {}, "expected a run of orbits.propagate"),
        (lambda: orbits.propagate(turning("Jupiter"), dt=0.05, duration=1, samples=2), {}, "rotation of rigid bodies"),
        (lambda: orbits.propagate(three_planets(), orbits.WisdomHolman(), dt=100, **short), {}, "into Kepler motions"),
        (lambda: orbits.propagate(three_planets(), orbits.Gauss(), **short), {}, "adaptive steps.*one modified"),
        (
            lambda: orbits.propagate(three_planets(), "symplectic-euler", dt=30, **short),
            {},
            "cannot be taken back.*multiples of dt",
        ),
        (
            lambda: orbits.propagate(
                three_planets().with_forces(orbits.terms.Drag(rate=1e-7)), orbits.Gauss(stages=2), dt=50, **short
            ),
            {},
            "the force of Drag has no Lagrangian",
        ),
    ]
    for make, options, message in cases:
        with pytest.raises(orbits.errors.InputError, match=message):
            orbits.shadow_energy(make(), **options)
