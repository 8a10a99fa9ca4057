"""Pair sums against mpmath and against each other: lanes = scalars, fast path = plain path."""

from itertools import pairwise

import mpmath
import numpy as np
import pytest

from orbits.kernels.compile import kernel
from orbits.kernels.gravity import pair_sums
from orbits.lagrangians.newtonian import parameters

from ..coverings import first

ULP = 2.0**-53
SIZES = [1, 2, 3, 7, 8, 9, 10, 16, 17, 40, 130]


def problem(n, seed=0, softening=0.0):
    rng = np.random.default_rng(seed)
    q = rng.normal(size=(n, 3)) * 10.0 ** rng.uniform(-1, 1, (n, 1))
    gm = 10.0 ** rng.uniform(-4, 0, n)
    return gm, q, parameters(gm, softening)


def exact(gm, q, softening=0.0):
    """Accelerations, the sum of the sizes of their terms, and the potential, to 40 digits."""
    n = len(gm)
    with mpmath.workdps(40):
        acc, size, potential = np.zeros((n, 3)), np.zeros(n), mpmath.mpf(0)
        for i in range(n):
            total = [mpmath.mpf(0)] * 3
            for j in range(n):
                if i == j:
                    continue
                d = [mpmath.mpf(q[j, k]) - mpmath.mpf(q[i, k]) for k in range(3)]
                r = mpmath.sqrt(sum(x * x for x in d) + mpmath.mpf(softening) ** 2)
                total = [t + gm[j] * x / r**3 for t, x in zip(total, d, strict=True)]
                size[i] += float(gm[j] / r**2)
                potential -= mpmath.mpf(gm[i]) * gm[j] / r / 2
            acc[i] = [float(t) for t in total]
        return acc, size, float(potential)


def vector(q):
    return np.concatenate([q.T.ravel(), np.zeros(8)])


# A rounded difference of coordinates enters once itself and three times through r^-3, r^2 adds 1.5, the products 1:
# 4.6 units were reached with up to 40 bodies, 6.1 with 130.
FORCE_ULPS = 6.5


@pytest.mark.parametrize(
    ("n", "softening"), first(9, [(n, s[k % 2]) for s in ((0.0, 0.05), (0.05, 0.0)) for k, n in enumerate(SIZES)])
)
def test_bodies_in_lanes_equal_forty_digit_accelerations(n, softening):
    gm, q, strength = problem(n, seed=n, softening=softening)
    truth, size, _ = exact(gm, q, softening)
    out = np.zeros(3 * n + 8)
    pair_sums.body_accelerations(strength, vector(q), out)
    error = np.abs(out[: 3 * n].reshape(3, n).T - truth).max(axis=1)
    assert np.all(error <= FORCE_ULPS * ULP * size)


@kernel
def share(strength, q, out, start, stop):
    pair_sums.share_of_accelerations(strength, q, out, start, stop)


@pytest.mark.parametrize("n", [3, 8, 9, 30, 131, 300])
def test_shares_of_the_bodies_give_the_bits_of_all_at_once_and_write_nothing_else(n):
    _, q, strength = problem(n, seed=n)
    whole = np.zeros(3 * n + 8)
    pair_sums.body_accelerations(strength, vector(q), whole)
    assert np.all(whole[3 * n :] == 0.0)
    for edges in ([0, n], [0, 8, n], [*range(0, n, 8), n], [0, 24, n]):
        out = np.full(3 * n + 8, np.nan)
        for start, stop in pairwise(edges):
            if start < min(stop, n):
                before = out.copy()
                share(strength, vector(q), out, start, min(stop, n))
                mine = np.isin(np.arange(3 * n + 8) % n, np.arange(start, min(stop, n)))
                mine[3 * n :] = False
                assert np.array_equal(out[~mine], before[~mine], equal_nan=True)
        assert np.array_equal(out[: 3 * n], whole[: 3 * n])


def test_thousands_of_terms_add_up_as_well_as_a_few():
    n = 4000
    rng = np.random.default_rng(4)
    q = rng.normal(size=(n, 3)) + np.array([30.0, 20.0, 10.0])
    q[0] = 0.0  # far from all others: its terms have one direction, and their partial sums are as large as they can be
    gm = 10.0 ** rng.uniform(-4, 0, n)
    out = np.zeros(3 * n + 8)
    pair_sums.body_accelerations(parameters(gm), vector(q), out)
    for i in (0, 1, n // 2, n - 1):
        d = q.astype(np.longdouble) - q[i].astype(np.longdouble)
        r2 = (d * d).sum(axis=1)
        r2[i] = 1.0
        w = gm * r2**-1.5
        size = float((w * np.sqrt(r2)).sum() - gm[i])
        # Sums of sums: 1.3 were reached; one sum after the other reaches 15.
        assert np.abs(out[i : 3 * n : n] - (w[:, None] * d).sum(axis=0)).max() <= FORCE_ULPS * ULP * size


@pytest.mark.parametrize("n", [1, 2, 3, 10, 17])
def test_pairs_one_by_one_equal_forty_digit_accelerations(n):
    gm, q, strength = problem(n, seed=n)
    truth, size, _ = exact(gm, q)
    out = np.zeros(3 * n)
    pair_sums.pair_accelerations(strength, vector(q)[: 3 * n], out)
    error = np.abs(out.reshape(3, n).T - truth).max(axis=1)
    assert np.all(error <= FORCE_ULPS * ULP * size)


@pytest.mark.parametrize("n", [2, 10])
def test_eight_stages_in_lanes_equal_the_same_stages_one_by_one(n):
    problems = [problem(n, seed=s) for s in range(8)]
    strength = problems[0][2]
    rows = np.stack([vector(q)[: 3 * n] for _, q, _ in problems], axis=1).copy()
    out = np.zeros_like(rows)
    pair_sums.pair_accelerations(strength, rows, out)
    for stage, (_, q, _) in enumerate(problems):
        alone = np.zeros(3 * n)
        pair_sums.pair_accelerations(strength, vector(q)[: 3 * n], alone)
        _, size, _ = exact(problems[0][0], q)
        assert np.all(np.abs(out[:, stage] - alone) <= FORCE_ULPS * ULP * np.tile(size, 3))


def test_internal_forces_add_up_to_nothing():
    gm, q, strength = problem(12, seed=5)
    out = np.zeros(3 * 12 + 8)
    pair_sums.body_accelerations(strength, vector(q), out)
    a = out[:36].reshape(3, 12).T
    total = np.abs((gm[:, None] * a).sum(axis=0)).max()
    assert total <= 8 * ULP * np.abs(gm[:, None] * a).sum()


def test_the_field_at_a_particle_equals_forty_digits():
    gm, q, strength = problem(9, seed=6)
    at = np.array([0.3, -0.2, 0.1])
    with mpmath.workdps(40):
        truth = [
            float(
                sum(
                    g
                    * (mpmath.mpf(b[k]) - at[k])
                    / mpmath.sqrt(sum((mpmath.mpf(b[m]) - at[m]) ** 2 for m in range(3))) ** 3
                    for g, b in zip(gm, q, strict=True)
                )
            )
            for k in range(3)
        ]
    size = sum(g / np.sum((b - at) ** 2) for g, b in zip(gm, q, strict=True))
    got = pair_sums.attraction(strength, vector(q)[:27], *at)
    assert np.abs(np.array(got) - truth).max() <= FORCE_ULPS * ULP * size


def test_the_potential_equals_forty_digits_and_its_gradient_is_the_force():
    gm, q, strength = problem(6, seed=7, softening=0.02)
    _, _, potential = exact(gm, q, 0.02)
    assert abs(pair_sums.pair_potential(strength, vector(q)) - potential) <= 8 * ULP * abs(potential)
    a = np.zeros(18 + 8)
    pair_sums.body_accelerations(strength, vector(q), a)
    step = 1e-4
    for i in range(6):
        for k in range(3):
            values = []
            for m in (-2, -1, 1, 2):
                moved = q.copy()
                moved[i, k] += m * step
                values.append(pair_sums.pair_potential(strength, vector(moved)))
            slope = (values[0] - 8 * values[1] + 8 * values[2] - values[3]) / (12 * step)
            # Fourth-order differences: truncation and round-off meet near 1e-10 of the size of the potential's terms.
            assert abs(slope + gm[i] * a[k * 6 + i]) < 1e-8 * max(1.0, abs(slope))


def test_two_bodies_at_one_place_are_not_passed_over():
    strength = parameters(np.array([1.0, 1.0, 1.0]))
    q = np.array([[1.0, 2.0, 3.0], [1.0, 2.0, 3.0], [0.0, 0.0, 0.0]])
    out = np.zeros(9 + 8)
    pair_sums.body_accelerations(strength, vector(q), out)
    assert not np.isfinite(out[:9]).all()
