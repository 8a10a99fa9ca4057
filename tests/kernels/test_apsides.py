"""The apsides of osculating orbits against 40 digits from the same floats, and numbers against lanes."""

import mpmath
import numpy as np
import pytest

from orbits.elements import state_from_elements
from orbits.kernels.compile import kernel
from orbits.kernels.lanes import WIDTH, load, store
from orbits.kernels.search.apsides import OPEN, apsides, apsides_of

EPS = np.finfo(np.float64).eps
MU = 0.7


def states(e, count=200):
    """Return states all around orbits of the eccentricity e and all sizes and orientations, (count, 3) each."""
    rng = np.random.default_rng(5)
    widest = np.pi if e < 1.0 else 0.9 * np.arccos(-1.0 / e)
    sizes, angles = 10.0 ** rng.uniform(-3.0, 3.0, count), rng.uniform(0.0, 2.0 * np.pi, (2, count))
    shape = {"q": sizes, "e": e, "f": rng.uniform(-widest, widest, count)}
    return state_from_elements(MU, **shape, inc=rng.uniform(0.0, np.pi, count), Omega=angles[0], omega=angles[1])


def exact(q, v):
    """Return e, the apsides and 1/a of a state to 40 digits."""
    with mpmath.workdps(40):
        q, v, mu = [mpmath.mpf(float(x)) for x in q], [mpmath.mpf(float(x)) for x in v], mpmath.mpf(MU)
        (x, y, z), (a, b, c) = q, v
        hx, hy, hz = h = [y * c - z * b, z * a - x * c, x * b - y * a]
        r, p = mpmath.norm(q), sum(k * k for k in h) / mu
        vector = [(b * hz - c * hy) / mu - x / r, (c * hx - a * hz) / mu - y / r, (a * hy - b * hx) / mu - z / r]
        e, inverse_a = mpmath.norm(vector), 2 / r - sum(k * k for k in v) / mu
        return e, p / (1 + e), (1 + e) / inverse_a if inverse_a > 0 else mpmath.mpf(OPEN), inverse_a


# A circle, as round as floats are; e near 1 from both sides; a hyperbola, and one that is a straight line.
@pytest.mark.parametrize("e", [0.0, 1e-9, 0.3, 0.999, 1.0 - 1e-9, 1.0 + 1e-9, 1.5, 1e3])
def test_e_and_apsides_have_all_the_digits_that_states_determine(e):
    q, v = states(e)
    found = apsides_of(q, v, MU)
    for k in range(len(q)):
        r, speed = np.linalg.norm(q[k]), np.linalg.norm(v[k])
        # Products of coordinates are rounded relative to themselves, and cancel in the area of a narrow orbit.
        area = r * speed / np.sqrt(found.swept2[k])
        e_true, least, largest, inverse_a = exact(q[k], v[k])
        size = (2.0 / r + speed**2 / MU) / float(abs(inverse_a))  # by which 2/r and v^2/GM cancel
        assert abs(found.e[k] - e_true) <= 4.0 * EPS * max(1.0, e) * area
        assert abs(found.least[k] / least - 1) <= 4.0 * EPS * area
        assert abs(found.inverse_a[k] / inverse_a - 1) <= 2.0 * EPS * size
        assert abs(found.largest[k] / largest - 1) <= 4.0 * EPS * size


def test_a_fall_along_a_line_has_e_1_and_comes_to_the_centre():
    for fall in (-1.0, 0.0, 3.0):
        found = apsides_of([1.0, 2.0, -2.0], np.multiply(fall, [1.0, 2.0, -2.0]), MU)
        assert (found.e, found.least, found.swept2) == (1.0, 0.0, 0.0)
    assert apsides_of([3.0, 0.0, 0.0], [0.0, 0.0, 0.0], MU).largest == 3.0


def test_without_a_distance_nothing_is_finite_and_nothing_is_raised():
    assert not np.isfinite(apsides_of([0.0, 0.0, 0.0], [1.0, 0.0, 0.0], MU).e)


@kernel
def _apsides_of_eight(mu, state, out):
    found = apsides(
        mu, load(state, 0), load(state, 1), load(state, 2), load(state, 3), load(state, 4), load(state, 5)
    )
    store(out, 0, found.e)
    store(out, 1, found.least)
    store(out, 2, found.largest)
    store(out, 3, found.swept2)
    store(out, 4, found.inverse_a)


def test_numbers_have_the_bits_of_lanes():
    q, v = (x[:WIDTH] for x in states(0.3))
    out = np.empty((5, WIDTH))
    _apsides_of_eight(MU, np.ascontiguousarray(np.concatenate([q.T, v.T])), out)
    assert np.array_equal(out, apsides_of(q, v, MU))
