"""The parts of adaptive steps: coefficients, error signal, dynamical time, close pairs."""

import math
from fractions import Fraction

import numpy as np
import pytest
from numpy.polynomial import legendre

import orbits
from orbits.integrators.canonical.bodies import CanonicalBodies
from orbits.integrators.canonical.room import CONTINUATION, HOURS
from orbits.integrators.collocation.form import Collocation
from orbits.integrators.collocation.lengths import prepare, signal
from orbits.integrators.collocation.rows import ETA, HB, HC, HC_LO, REST
from orbits.kernels import steps
from orbits.kernels.compile import kernel
from orbits.kernels.gravity.pair_sums import close_pair_accelerations, dynamical_rate, pair_accelerations
from orbits.kernels.lanes import WIDTH
from orbits.kernels.steps import Method, Model, State, Storage
from orbits.lagrangians.newtonian import newtonian, parameters
from orbits.marching.clocks.adaptive import root

from ..coverings import cover
from ..problems import three_bodies


@kernel
def prepared(form, coefficients, h, before, scratch):
    """Call `prepare` from Python."""
    prepare(Method(form, coefficients), h, before, Storage(scratch, scratch, scratch, None))


@kernel
def prepared_by_its_form(form, coefficients, h, before, scratch):
    """Call `prepare` of a form from Python."""
    steps.prepare(Method(form, coefficients), h, before, Storage(scratch, scratch, scratch, None))


@kernel
def signalled(form, coefficients, tag, strength, h, q, storage):
    """Call `signal` from Python."""
    carry, scratch = storage
    method, model = Method(form, coefficients), Model(tag, strength)
    return signal(method, model, h, State(q, q, q, q), Storage(carry, scratch, scratch, None))


@cover(("stages", "ratio"), [3, 5, 8], [1.0, 0.3, 1.4, 2.0], strength=1)
def test_prepared_coefficients_are_those_made_in_many_digits(stages, ratio):
    form = Collocation(orbits.Gauss(stages=stages).tableau, close=True)
    h = 0.37
    expected, found = form.coefficients(h, h / ratio), form.coefficients(1.0, 1.0)
    prepared(form.tag, found, h, h / ratio, np.zeros(form.scratch_shape(9)))
    for row in (HC, HC_LO, HB, REST):
        assert np.array_equal(found[0, row], expected[0, row])
    # START sums products of up to 1e4 that cancel: the guess need not be better than the stages' own change.
    start = slice(ETA + WIDTH, ETA + WIDTH + stages)
    largest = np.abs(expected[0, start]).max()
    np.testing.assert_allclose(found[0, start], expected[0, start], rtol=0, atol=2e-10 * largest)


@cover(("stages", "ratio"), [3, 8], [0.7, 2.0], strength=1)
def test_prepared_coefficients_of_bodies_with_terms_are_those_made_in_many_digits(stages, ratio):
    form = CanonicalBodies(orbits.Gauss(stages=stages).tableau, close=True)
    h = 0.37
    expected, found = form.coefficients(h, h / ratio), form.coefficients(1.0, 1.0)
    prepared_by_its_form(form.tag, found, h, h / ratio, np.zeros(form.scratch_shape(9)))
    for row in (HC, HC_LO, HB, REST):
        assert np.array_equal(found[0, row], expected[0, row])
    assert np.array_equal(found[0, HOURS, :stages], expected[0, HOURS, :stages])
    guess = slice(CONTINUATION, CONTINUATION + stages)
    largest = np.abs(expected[0, guess]).max()
    np.testing.assert_allclose(found[0, guess], expected[0, guess], rtol=0, atol=2e-10 * largest)
    # What is guessed are velocities relative to those at the start, of a constant force: h c g.
    constant = found[0, guess].T @ np.where(np.arange(WIDTH) < stages, found[0, HB] / ratio, 0.0)[:stages]
    np.testing.assert_allclose(constant[:stages], h * form.tableau.nodes, rtol=0, atol=1e-12 * largest)


@pytest.mark.parametrize("stages", [3, 8])
def test_the_error_signal_is_the_last_legendre_coefficient_of_the_forces(stages):
    form, (gm, q, _) = Collocation(orbits.Gauss(stages=stages).tableau, close=True), three_bodies()
    rng, d, h = np.random.default_rng(3), 9, 0.2
    c, b = form.tableau.nodes, form.tableau.b
    g = 1.0 + 1e-3 * rng.standard_normal((d, stages))
    carry = np.zeros((form.carry_rows(d), WIDTH))
    carry[:d, :stages] = h * b * g
    fitted = np.array([legendre.legfit(2 * c - 1, row, stages - 1)[-1] for row in h * g])
    bodies = [np.abs(fitted[i::3]).max() / np.abs(h * g[i::3]).max() for i in range(3)]
    scratch = np.ones(form.scratch_shape(d))
    bound = (form.tag, form.coefficients(h, h), newtonian.tag, parameters(gm))
    found = signalled(*bound, h, q.T.ravel(), (carry, scratch))
    assert found == pytest.approx(max(bodies), rel=1e-12)  # 1e-3 of 1: three digits are lost


def test_the_dynamical_rate_and_its_change_are_those_of_the_pairs():
    rng = np.random.default_rng(5)
    for n in (2, 3, 9, 12):
        gm, q, v = rng.uniform(0.1, 1.0, n), rng.standard_normal((n, 3)), rng.standard_normal((n, 3))
        strength = parameters(gm, 0.1)

        def rate(x, gm=gm, n=n):
            pairs = [(i, j) for i in range(n) for j in range(i)]
            return math.fsum((gm[i] + gm[j]) / (np.sum((x[i] - x[j]) ** 2) + 0.01) ** 1.5 for i, j in pairs)

        vectors = [np.concatenate([x.T.ravel(), np.full(16, np.nan)]) for x in (q, v)]
        found, change = dynamical_rate(np.concatenate([strength, np.full(8, np.nan)])[: n + 1].copy(), *vectors)
        assert found == pytest.approx(rate(q), rel=1e-14)
        eps = 1e-6
        assert change == pytest.approx((rate(q + eps * v) - rate(q - eps * v)) / (2 * eps), rel=1e-6)


def test_accelerations_of_close_pairs_keep_the_digits_that_separate_them():
    """Two bodies 1e-9 apart at a distance of 1e3: plain positions keep three digits of their separation."""
    gm, apart = np.array([1.0, 2.0]), 1.2345678901234567e-9
    exact = [Fraction(1000), 1000 + Fraction(apart)]
    q, q_lo = np.zeros((6, WIDTH)), np.zeros((6, WIDTH))
    for k, x in enumerate(exact):
        q[k] = float(x)
        q_lo[k] = float(x - Fraction(float(x)))
    close, plain = np.empty((6, WIDTH)), np.empty((6, WIDTH))
    close_pair_accelerations(parameters(gm), q, q_lo, close)
    pair_accelerations(parameters(gm), q, plain)
    expected = gm[1] / apart**2
    assert abs(close[0, 0] / expected - 1) < 1e-15
    assert abs(plain[0, 0] / expected - 1) > 1e-5
    assert close[0, 0] * gm[0] == -close[1, 0] * gm[1]


def test_roots_of_ratios_are_as_good_as_they_say_and_increase():
    for bound, roots, most in (4.2e-7, np.linspace(0.95, 1.05, 101), 16), (3e-3, np.linspace(0.75, 1.3, 101), 8):
        for n in range(1, most + 1):
            found = np.array([root.py_func(y**n, 1.0 / n) for y in roots.tolist()])
            assert np.abs(found / roots - 1.0).max() < bound
    ratios = np.geomspace(1e-12, 1e12, 200).tolist()
    assert all(np.diff([root.py_func(x, 1.0 / k) for x in ratios]).min() >= 0.0 for k in range(1, 17))
