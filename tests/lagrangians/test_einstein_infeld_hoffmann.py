"""Relativity by several bodies: the Lagrangian in forty digits, accelerations of ephemerides, momenta alone."""

import mpmath
import numpy as np
import pytest

from orbits.kernels import binding
from orbits.kernels.compile import kernel
from orbits.lagrangians.newtonian import n_body
from orbits.lagrangians.terms.einstein_infeld_hoffmann import KEPT, einstein_infeld_hoffmann

EPS = 2.0**-53
GM = (1.0, 0.3, 0.01, 0.2)
C = 3.0
SOURCES = {"all": [0, 1, 2, 3], "two": [1, 3], "one": [2]}


def term(sources, bodies=4, c=C):
    return einstein_infeld_hoffmann(sources, bodies, c)


def state(seed=1, bodies=4):
    rng = np.random.default_rng(seed)
    return rng.normal(size=(bodies, 3)), rng.normal(size=(bodies, 3))


def in_digits(q, v, sources, eps2):
    """c^2 times the term as its module has it, pair by pair, in the digits of mpmath."""

    def dot(a, b):
        return sum(x * y for x, y in zip(a, b, strict=True))

    bodies = range(len(GM))
    apart = {(i, j): [a - b for a, b in zip(q[i], q[j], strict=True)] for i in bodies for j in bodies if i != j}
    near = {pair: 1 / mpmath.sqrt(dot(d, d) + eps2) for pair, d in apart.items()}
    total = mpmath.mpf(0)
    for i in bodies:
        by_sources = sum(GM[j] * near[i, j] for j in sources if j != i)
        by_others = sum(GM[j] * near[i, j] for j in bodies if j not in sources and j != i) if i in sources else 0
        # Phi^2 without the part that is quadratic in the masses of others than sources.
        total += GM[i] * (dot(v[i], v[i]) ** 2 / 8 - by_sources * (by_sources + 2 * by_others) / 2)
        for j in range(i + 1, len(GM)):
            if i in sources or j in sources:
                d, w = apart[i, j], near[i, j]
                bracket = 3 * (dot(v[i], v[i]) + dot(v[j], v[j])) - 7 * dot(v[i], v[j])
                total += GM[i] * GM[j] * w / 2 * (bracket - dot(v[i], d) * dot(v[j], d) * w * w)
    return total


@pytest.mark.parametrize("softening", [0.0, 0.2])
@pytest.mark.parametrize("sources", SOURCES.values(), ids=SOURCES)
def test_value_forces_and_momenta_are_those_of_the_formula_in_forty_digits(sources, softening):
    q, v = state()
    L, newton = n_body(GM, softening, [term(sources)]), n_body(GM, softening)
    with mpmath.workdps(40):
        step, eps2 = mpmath.mpf(10) ** -15, mpmath.mpf(softening * softening)
        exact = [[[mpmath.mpf(float(x)) for x in row] for row in array] for array in (q, v)]
        value = float(in_digits(*exact, sources, eps2) / C**2)
        slopes = np.zeros((2, len(GM), 3))
        for which, i, axis in np.ndindex(slopes.shape):
            ends = []
            for sign in (1, -1):
                exact[which][i][axis] += sign * step
                ends.append(in_digits(*exact, sources, eps2))
                exact[which][i][axis] -= sign * step
            slopes[which, i, axis] = float((ends[0] - ends[1]) / (2 * step) / C**2)
    # Newton's part is taken off, which is about 1.
    assert L.value(q.ravel(), v.ravel()) - newton.value(q.ravel(), v.ravel()) == pytest.approx(value, abs=4 * EPS)
    pairs = zip(L.gradients(q.ravel(), v.ravel()), newton.gradients(q.ravel(), v.ravel()), strict=True)
    for (mine, without), slope in zip(pairs, slopes, strict=True):
        assert np.max(np.abs(mine - without - slope.ravel())) < 8 * EPS


def newhall(gm, q, v, c2):
    """The accelerations of point masses to first post-Newtonian order, as ephemerides integrate them.

    Source: Newhall, Standish & Williams (1983), A&A 125, 150; Moyer (2003), eq. 4-26, with beta = gamma = 1.
    """
    n = len(gm)
    d = q[None, :, :] - q[:, None, :]
    r = np.linalg.norm(d, axis=2) + np.eye(n)
    pull = gm * (1 - np.eye(n)) / r
    depth = pull.sum(axis=1)
    newton = np.einsum("ij,ijk->ik", pull / r**2, d)
    found = newton.copy()
    for i in range(n):
        for j in range(n):
            if i != j:
                bracket = v[i] @ v[i] + 2 * v[j] @ v[j] - 4 * v[i] @ v[j] - 4 * depth[i] - depth[j]
                bracket += 0.5 * d[i, j] @ newton[j] - 1.5 * (d[i, j] @ v[j] / r[i, j]) ** 2
                change = bracket * d[i, j] - (d[i, j] @ (4 * v[i] - 3 * v[j])) * (v[i] - v[j])
                found[i] += (gm[j] / r[i, j] ** 3 * change + 3.5 * gm[j] / r[i, j] * newton[j]) / c2
    return found


def test_accelerations_are_those_of_ephemerides_up_to_the_second_order():
    """The difference falls by c^4, a hundred for each ten in c^2."""
    gm = np.array(GM)
    q, v = state(3)
    off = []
    for c2 in (1e3, 1e4, 1e5, 1e6):
        L = n_body(gm, 0.0, [term(range(4), c=c2**0.5)])
        f, _ = L.gradients(q.ravel(), v.ravel())
        _, mixed, mass = L.hessians(q.ravel(), v.ravel())
        found = np.linalg.solve(mass, f - mixed.T @ v.ravel())
        off.append(np.max(np.abs(found - newhall(gm, q, v, c2).ravel())))
    assert off[-1] < 1e-9  # of accelerations of about 1, so that the next ratios are not those of round-off
    assert off[0] / off[1] == pytest.approx(100, rel=0.05)
    assert off[1] / off[2] == pytest.approx(100, rel=0.01)
    assert off[2] / off[3] == pytest.approx(100, rel=0.01)


def test_more_pairs_than_are_kept_have_the_forces_of_the_same_lagrangian():
    bodies = 100
    assert bodies * (bodies - 1) // 2 > KEPT
    rng = np.random.default_rng(4)
    gm, (q, v) = rng.uniform(0.1, 1.0, bodies) / bodies, state(5, bodies)
    L = n_body(gm, 0.3, [term(range(bodies), bodies)])
    x, w = q.ravel(), v.ravel()
    dx, dw = rng.normal(size=(2, len(x)))
    f, p = L.gradients(x, w)
    h = 1e-4
    values = [L.value(x + s * h * dx, w + s * h * dw) for s in (-2, -1, 1, 2)]
    slope = (values[0] - 8 * values[1] + 8 * values[2] - values[3]) / (12 * h)
    # Rounding of a value of about 1, over h; the term is a ninth of the rest.
    assert f @ dx + p @ dw == pytest.approx(slope, rel=1e-10)


@kernel
def momenta(tags, strength, parameters, q, v, f, alone, p):
    binding.momenta_of_terms(tags, strength, parameters, 0.0, q, v, f, alone)
    binding.add_gradients(tags, strength, parameters, 0.0, q, v, f, p)


@pytest.mark.parametrize("sources", SOURCES.values(), ids=SOURCES)
def test_momenta_alone_are_those_beside_the_forces(sources):
    L = n_body(GM, 0.1, [term(sources)])
    q, v = (x.T.ravel().copy() for x in state(7))
    f, alone, p = np.zeros((3, len(q)))
    momenta(binding.SumTag([term(sources).tag]), L.parameter_vector[0], L.parameter_vector[1:], q, v, f, alone, p)
    assert np.max(np.abs(p)) > 0.01
    assert np.max(np.abs(alone - p)) < 8 * EPS * np.max(np.abs(p))
