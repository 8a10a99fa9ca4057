"""Energy, momenta and centre of mass, against mpmath at 60 digits."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest
from astropy import units as u

from orbits import diagnostics
from orbits.errors import InputError

from ..coverings import each

# The result is the rounding of a value good to 1e-30: half a unit in the last place, and nothing to spare but that.
HALF_ULP = 0.5 * (1 + 1e-12)


@pytest.fixture(autouse=True)
def sixty_digits():
    with mpmath.workdps(60):
        yield


@pytest.fixture(scope="module")
def states():
    """Ten bodies over 50 samples: seven massive in mixed order, masses over six decades, one close pair."""
    rng = np.random.default_rng(20240612)
    gm = 10.0 ** rng.uniform(-9, -3, size=10)
    gm[[1, 5, 8]] = 0.0
    q, v = rng.normal(size=(2, 50, 10, 3)) * 30
    q[:, 3] = q[:, 2] + 1e-6 * rng.normal(size=(50, 3))
    return gm, q, v


def mp(x):
    return mpmath.mpf(float(x))


def massive(gm):
    return [i for i in range(len(gm)) if gm[i] > 0]


def exact_energy(gm, q, v, softening=0.0):
    rows = massive(gm)
    kinetic = mpmath.fsum(mp(gm[i]) * mp(x) ** 2 / 2 for i in rows for x in v[i])
    potential = mpmath.mpf(0)
    for k, i in enumerate(rows):
        for j in rows[:k]:
            squared = mpmath.fsum((mp(a) - mp(b)) ** 2 for a, b in zip(q[i], q[j], strict=True))
            potential -= mp(gm[i]) * mp(gm[j]) / mpmath.sqrt(squared + mp(softening) ** 2)
    return kinetic + potential


def exact_angular_momentum(gm, q, v):
    rows = massive(gm)
    return [
        mpmath.fsum(mp(gm[i]) * (mp(q[i][a]) * mp(v[i][b]) - mp(q[i][b]) * mp(v[i][a])) for i in rows)
        for a, b in ((1, 2), (2, 0), (0, 1))
    ]


def ulps(value, reference):
    return float(abs(mp(value) - reference) / mp(np.spacing(abs(float(value)))))


@pytest.mark.parametrize("softening", [0.0, 0.37])
def test_the_energy_is_the_nearest_float(states, softening):
    gm, q, v = states
    energies = diagnostics.energy(gm, q, v, softening)
    assert max(ulps(energies[k], exact_energy(gm, q[k], v[k], softening)) for k in range(len(q))) <= HALF_ULP


def test_momenta_and_centre_of_mass_are_the_nearest_floats(states):
    gm, q, v = states
    rows = massive(gm)
    linear, angular = diagnostics.noether_charges(gm, q, v)
    centre = diagnostics.centre_of_mass(gm, q)
    whole = mpmath.fsum(mp(gm[i]) for i in rows)
    for k in range(len(q)):
        for axis in range(3):
            assert ulps(linear[k, axis], mpmath.fsum(mp(gm[i]) * mp(v[k, i, axis]) for i in rows)) <= HALF_ULP
            assert ulps(centre[k, axis], mpmath.fsum(mp(gm[i]) * mp(q[k, i, axis]) for i in rows) / whole) <= HALF_ULP
        for value, reference in zip(angular[k], exact_angular_momentum(gm, q[k], v[k]), strict=True):
            assert ulps(value, reference) <= HALF_ULP


def test_an_energy_that_cancels_to_nothing_keeps_its_digits():
    # A bound pair at parabolic speed: kinetic and potential energy are equal to the last bits but one.
    gm = np.array([1.0, 1e-3])
    q = np.array([[0.1, 0.2, 0.3], [1.1, -0.7, 0.4]])
    speed = np.sqrt(2 * gm.sum() / np.linalg.norm(q[1] - q[0]))
    v = np.array([[0.0, 0.0, 0.0], [speed, 0.0, 0.0]]) - np.array([speed * gm[1] / gm.sum(), 0, 0])
    reference = exact_energy(gm, q, v)
    assert abs(reference) < 1e-17
    assert ulps(diagnostics.energy(gm, q, v), reference) <= HALF_ULP


def test_rotating_by_exchange_of_axes_leaves_the_energy_flat_to_the_last_bit(states):
    gm, q, v = states
    for axes in ([1, 2, 0], [2, 1, 0]):
        assert np.array_equal(diagnostics.energy(gm, q[..., axes], v[..., axes]), diagnostics.energy(gm, q, v))


def test_massless_rows_do_not_count_wherever_they_stand(states):
    gm, q, v = states
    rows = gm > 0
    moved = np.where(rows[:, None], q, np.inf)  # not even when they are not finite
    assert np.array_equal(diagnostics.energy(gm, moved, v), diagnostics.energy(gm[rows], q[:, rows], v[:, rows]))
    assert np.array_equal(diagnostics.centre_of_mass(gm, moved), diagnostics.centre_of_mass(gm[rows], q[:, rows]))
    assert np.array_equal(diagnostics.linear_momentum(gm, v), diagnostics.linear_momentum(gm[rows], v[:, rows]))


def test_every_leading_shape_gives_the_same_values(states):
    gm, q, v = states
    energies, moments = diagnostics.energy(gm, q, v), diagnostics.angular_momentum(gm, q, v)
    q5, v5 = (x.reshape(5, 10, 10, 3) for x in (q, v))
    assert np.array_equal(diagnostics.energy(gm, q5, v5), energies.reshape(5, 10))
    assert np.array_equal(diagnostics.angular_momentum(gm, q5, v5), moments.reshape(5, 10, 3))
    assert diagnostics.energy(gm, q[0], v[0]).shape == ()
    assert diagnostics.energy(gm, q[0], v[0]) == energies[0]
    assert diagnostics.energy(gm, q[:0], v[:0]).shape == (0,)


def test_more_samples_than_one_block_are_put_together_in_order():
    rng = np.random.default_rng(3)
    gm, (q, v) = np.array([1.0, 2.0, 3.0]), rng.normal(size=(2, 20_000, 3, 3))
    k = [0, 5460, 5461, 5462, 19_999]
    assert np.array_equal(diagnostics.energy(gm, q, v)[k], diagnostics.energy(gm, q[k], v[k]))
    assert np.array_equal(diagnostics.angular_momentum(gm, q, v)[k], diagnostics.angular_momentum(gm, q[k], v[k]))
    assert np.array_equal(diagnostics.linear_momentum(gm, v)[k], diagnostics.linear_momentum(gm, v[k]))


def test_one_massive_body_has_kinetic_energy_only():
    v = np.array([[1.0, 2.0, 3.0], [9.0, 9.0, 9.0]])
    assert diagnostics.energy([2.0, 0.0], np.zeros((2, 3)), v) == 14.0


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: diagnostics.energy([1.0, 2.0], np.zeros((3, 3)), np.zeros((2, 3))), r"q has shape \(3, 3\)"),
        (lambda: diagnostics.energy([1.0], np.zeros((4, 1, 3)), np.zeros((1, 3))), r"v has shape \(1, 3\)"),
        (lambda: diagnostics.linear_momentum([[1.0]], np.zeros((1, 3))), r"gm has shape \(1, 1\)"),
        (lambda: diagnostics.centre_of_mass([0.0], np.zeros((1, 3))), "no body has gm > 0"),
        (lambda: diagnostics.energy([1.0], np.zeros((1, 3)), np.zeros((1, 3)), -1.0), "softening is -1.0"),
        (lambda: diagnostics.energy([1.0], np.zeros((1, 3)), np.zeros((1, 3)), float("nan")), "softening is nan"),
    ],
)
def test_what_does_not_fit_is_refused_in_words(call, words):
    with pytest.raises(InputError, match=words):
        call()


TWO_GM, TWO_Q, TWO_V = np.array([1.0, 1e-3]), np.array([[0.0, 0, 0], [1, 0, 0]]), np.array([[0.0, 0, 0], [0, 1, 0]])


@each(
    ("call", "words"),
    [
        (lambda: diagnostics.energy([np.nan, 1.0], TWO_Q, TWO_V), r"gm\[0\] is nan"),
        (lambda: diagnostics.energy([np.nan, np.nan], TWO_Q, TWO_V), r"gm\[0\] is nan"),
        (lambda: diagnostics.energy([-1.0, 1.0], TWO_Q, TWO_V), "gm is -1"),
        (lambda: diagnostics.energy(TWO_GM, np.full((2, 3), np.inf), TWO_V), r"q\[0, 0\] is inf"),
        (lambda: diagnostics.energy(TWO_GM, TWO_Q, TWO_V * 1e200), "beyond the range of floats"),
        (lambda: diagnostics.energy(TWO_GM, TWO_Q * 0.0, TWO_V), "at the same place"),
        (
            lambda: diagnostics.energy(np.ones(3), np.outer([0, 1e-155, 1], [1, 0, 0]), np.zeros((3, 3))),
            "at the same place",
        ),
        (lambda: diagnostics.linear_momentum(TWO_GM * 1e200, TWO_V * 1e200), "beyond the range of floats"),
        (lambda: diagnostics.angular_momentum(TWO_GM, TWO_Q * 1e200, TWO_V * 1e200), "beyond the range of floats"),
        (lambda: diagnostics.energy(["a", "b"], TWO_Q, TWO_V), "gm is .*expected an array of real numbers"),
        (lambda: diagnostics.energy(TWO_GM, "q", TWO_V), "q is 'q'"),
        (lambda: diagnostics.energy(TWO_GM, TWO_Q, TWO_V, "soft"), "softening must be a real number, got 'soft'"),
        (lambda: diagnostics.energy(TWO_GM, TWO_Q * u.au, TWO_V), "Take the floats, such as system.values.q"),
        (lambda: diagnostics.energy(None, TWO_Q, TWO_V), "gm is None"),
        (lambda: diagnostics.drift("abc"), "the series is 'abc'"),
        (lambda: diagnostics.drift([1.0, 2.0], "abc"), "the scale must be a real number, got 'abc'"),
        (lambda: diagnostics.centre_of_mass_drift("gm", [0.0], TWO_Q[None], TWO_V), "gm is 'gm'"),
        (lambda: diagnostics.centre_of_mass_drift(TWO_GM, [0.0, 1.0], TWO_Q[None], TWO_V), r"expected \(n,\) and"),
        (lambda: diagnostics.centre_of_mass_drift(TWO_GM, [0.0], TWO_Q[None], [0.0]), r"v has shape \(1,\)"),
    ],
)
def test_no_diagnostic_hands_back_nan_or_ends_in_an_error_of_another_package(call, words):
    with pytest.raises(InputError, match=words):
        call()


@pytest.mark.parametrize("power", [-500, -110, 98, 110, 500])
def test_what_overflows_on_the_way_only_is_found_to_the_last_bit(states, power):
    """A power of two rounds nothing: squares of such lengths are beyond floats, the quantities are not."""
    gm, q, v = states
    far, fast = 2.0**power, 2.0 ** -(power // 2)
    assert np.array_equal(diagnostics.energy(gm, q * far, v * fast) * far, diagnostics.energy(gm, q, v))
    turned = diagnostics.angular_momentum(gm, q * far, v / far)
    assert np.array_equal(turned, diagnostics.angular_momentum(gm, q, v))
    assert np.array_equal(diagnostics.centre_of_mass(gm, q * far) / far, diagnostics.centre_of_mass(gm, q))
    assert np.array_equal(diagnostics.linear_momentum(gm * far, v / far), diagnostics.linear_momentum(gm, v))


def test_the_centre_of_mass_of_bodies_at_the_end_of_floats_is_between_them():
    assert np.array_equal(diagnostics.centre_of_mass([1.0, 3.0], [[0.0, 0, 0], [1e308, 0, 0]]), [7.5e307, 0, 0])
