"""Compositions as compiled maps: one by two kernels, orders, any base, any Lagrangian, archives."""

import numpy as np
import pytest

import orbits
from orbits.errors import InputError
from orbits.integrators import build, describe, parse
from orbits.methods import VPRK, Composition, ImplicitMidpoint
from orbits.tableaux.published import COMPOSITIONS, SPLITTINGS

from ..contracts.problems import errors_against_the_exact_orbit, march, marcher
from ..coverings import first
from ..problems import kepler, three_bodies

VERLET = orbits.StormerVerlet()
SCHEMES = [(4, "suzuki"), (4, "triple-jump"), *sorted(COMPOSITIONS), *sorted(SPLITTINGS)]


@pytest.mark.parametrize(("order", "name"), SCHEMES)
def test_every_scheme_reaches_its_order_as_a_compiled_map(order, name):
    """Convergence faster than the order is allowed: optimized schemes have small leading terms."""
    method = Composition(VERLET, order=order, scheme=name)
    steps, errors = errors_against_the_exact_orbit(method, 0.3, 2.0, np.unique(np.round(2 ** np.arange(1, 9, 0.25))))
    keep = np.flatnonzero((errors > 1e-13) & (errors < 1e-3))[-6:]
    measured = -np.polyfit(np.log(steps[keep]), np.log(errors[keep]), 1)[0]
    assert len(keep) >= 4
    assert measured > 0.92 * order


@pytest.mark.nightly
def test_kicks_and_drifts_are_lobatto_composed_by_its_own_kernels():
    """Störmer–Verlet is the default pair of `VPRK`: chains of merged kicks against one implicit substep at a time."""
    start = three_bodies(particles=11)
    chain = march(Composition(VERLET, order=6, scheme="kahan-li"), *start, 0.15, 20)
    general = march(Composition(VPRK(), order=6, scheme="kahan-li"), *start, 0.15, 20)
    for a, b in zip(chain, general, strict=True):
        assert np.abs(a - b).max() < 4e-15  # roundings of 180 substeps; 1e-15 was reached


def test_the_implicit_midpoint_rule_is_gauss_with_one_stage_bit_for_bit():
    start = three_bodies(particles=11)
    for a, b in zip(
        march(ImplicitMidpoint(), *start, 0.15, 20), march(orbits.Gauss(stages=1), *start, 0.15, 20), strict=True
    ):
        assert np.array_equal(a, b)


IMPLICIT = Composition(orbits.Gauss(stages=2), order=6, scheme="triple-jump")


def test_an_implicit_method_composed_has_its_order():
    steps, errors = errors_against_the_exact_orbit(IMPLICIT, 0.3, 2.0, 2 ** np.arange(1, 8))
    keep = np.flatnonzero((errors > 1e-13) & (errors < 1e-3))[-4:]
    measured = -np.polyfit(np.log(steps[keep]), np.log(errors[keep]), 1)[0]
    assert abs(measured - 6) < 0.3


@pytest.mark.nightly
def test_particles_of_an_implicit_composition_do_not_know_their_neighbours_and_a_checkpoint_goes_on():
    gm, q, v = three_bodies(particles=11)
    one = marcher(IMPLICIT, gm, q, v, 0.15)
    one.advance(30)
    many = marcher(IMPLICIT, gm, q, v, 0.15, threads=3)
    many.block = 7
    many.advance(13)
    many.state_after(0.05)
    again = marcher(IMPLICIT, gm, q, v, 0.15)
    again.restore(many.checkpoint())
    again.advance(17)
    alone = marcher(IMPLICIT, gm[[0, 1, 2, 13]], q[[0, 1, 2, 13]], v[[0, 1, 2, 13]], 0.15)
    alone.advance(30)
    for a, b, c in zip(one.state(), again.state(), alone.state(), strict=True):
        assert np.array_equal(a, b)
        assert np.array_equal(a[[0, 1, 2, 13]], c)


@pytest.mark.nightly
def test_a_massless_particle_of_an_implicit_composition_moves_as_a_body_without_mass_would():
    gm, q, v = three_bodies(particles=11)
    light = march(IMPLICIT, gm, q, v, 0.15, 20)
    heavy = march(IMPLICIT, np.where(gm > 0, gm, 1e-30), q, v, 0.15, 20)
    assert max(np.abs(a - b).max() for a, b in zip(light, heavy, strict=True)) < 4e-15


@pytest.mark.nightly
@pytest.mark.parametrize("name", ["charged-particle", "driven-pendulum"])
def test_lagrangians_that_are_not_separable_or_depend_on_time_are_marched_by_composed_gauss(name):
    """With order 6 of Gauss with two stages, against Gauss with eight at a tenth of the step."""
    L = orbits.lagrangians.registry()[name]
    errors = []
    for dt in (0.1, 0.05):
        path = orbits.march(L, IMPLICIT, dt=dt, steps=round(2 / dt))
        truth = orbits.march(L, orbits.Gauss(stages=8), dt=0.01, steps=200)
        errors.append(np.abs(path.q[-1] - truth.q[-1]).max())
    assert errors[1] < 1e-7
    assert np.log2(errors[0] / errors[1]) > 5.5


def test_verlet_composed_refuses_what_verlet_refuses():
    with pytest.raises(InputError, match=r"needs a Lagrangian that is separable.*Use .*Gauss"):
        orbits.march(orbits.lagrangians.charged_particle, Composition(VERLET), dt=0.1, steps=1)


@pytest.mark.parametrize(
    "method",
    [
        pytest.param(Composition(VERLET, order=6), marks=pytest.mark.nightly),
        pytest.param(Composition(orbits.Gauss(stages=1), order=4), marks=pytest.mark.contracts),
    ],
    ids=lambda m: m.label,
)
def test_a_composition_is_certified(method):
    certificate = orbits.certify(orbits.lagrangians.kepler, method, 0.1)
    assert certificate.ok, certificate.table()
    assert certificate["discrete Euler-Lagrange residual"].holds, certificate.table()


def test_compositions_are_described_built_and_typed():
    for method in (*Composition.examples(), IMPLICIT, Composition(VERLET)):
        assert build(describe(method)) == method
        assert parse(method.label) == method
    assert parse("composition(gauss(stages=2), order=6)").base == orbits.Gauss(stages=2)
    assert parse("composition") == Composition()
    assert parse("symplectic-euler(variant='drift-kick')").variant == "drift-kick"
    for text in ("composition(1, 2, 3, 4)", "composition(gauss(", "composition(base=[gauss()])"):
        with pytest.raises(InputError):
            parse(text)


@pytest.mark.parametrize("method", first(1, [Composition(VERLET, order=4), IMPLICIT]), ids=str)
def test_a_run_of_a_composition_is_stored_and_extended_bit_for_bit(tmp_path, method):
    gm, q, v = kepler(0.3)
    system = orbits.System(["a", "b"], gm, q, v, units=orbits.DIMENSIONLESS)
    straight = orbits.propagate(system, method, dt=0.1, duration=4.0, samples=9)
    orbits.propagate(system, method, dt=0.1, duration=2.0, samples=5, archive=tmp_path / "run.h5")
    longer = orbits.resume(tmp_path / "run.h5", until=4.0)
    assert longer.integrator == method
    assert np.array_equal(np.asarray(straight.q[-1]), np.asarray(longer.q[-1]))
    assert np.array_equal(np.asarray(longer.at(1.23).q), np.asarray(straight.at(1.23).q))
