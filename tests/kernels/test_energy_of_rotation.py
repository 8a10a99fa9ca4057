"""The energy of a free rotation in doubled precision, against forty digits."""

import mpmath
import numpy as np

from orbits.kernels.compile import kernel
from orbits.kernels.rotation.in_doubled_precision import momentum_and_energy, rotation_to_energy


@kernel
def measured(q, p, inverse, out):
    attitude = (q[0, 0], q[0, 1]), (q[1, 0], q[1, 1]), (q[2, 0], q[2, 1]), (q[3, 0], q[3, 1])
    momentum = (p[0, 0], p[0, 1]), (p[1, 0], p[1, 1]), (p[2, 0], p[2, 1])
    own, energy = momentum_and_energy(attitude, momentum, (inverse[0], inverse[1], inverse[2]))
    out[0], out[1], out[2] = own
    out[3], out[4] = energy


@kernel
def turned_back(momentum, inverse, excess, out):
    found = rotation_to_energy((momentum[0], momentum[1], momentum[2]), (inverse[0], inverse[1], inverse[2]), excess)
    out[0], out[1], out[2] = found


def drawn(rng, count):
    """Numbers of doubled precision: pairs of a float and a fraction of its last bit."""
    high = rng.normal(size=count)
    return np.column_stack([high, high * rng.uniform(-0.5, 0.5, count) * 2.0**-53])


def exact(pairs):
    return [mpmath.mpf(float(x)) + mpmath.mpf(float(y)) for x, y in pairs]


def test_momentum_and_energy_of_any_attitude_have_all_digits_of_their_pairs():
    rng = np.random.default_rng(2)
    for _ in range(20):
        q, p, inverse, out = drawn(rng, 4), drawn(rng, 3), rng.uniform(0.5, 2.0, 3), np.zeros(5)
        q /= 2.0 ** np.round(np.log2(np.linalg.norm(q[:, 0])))  # of about unit length, as marched ones are
        measured(q, p, inverse, out)
        with mpmath.workdps(50):
            a, b, c, d = exact(q)
            R = mpmath.matrix([
                [a * a + b * b - c * c - d * d, 2 * (b * c - a * d), 2 * (b * d + a * c)],
                [2 * (b * c + a * d), a * a - b * b + c * c - d * d, 2 * (c * d - a * b)],
                [2 * (b * d - a * c), 2 * (c * d + a * b), a * a - b * b - c * c + d * d],
            ])  # fmt: skip
            own = (R.T * mpmath.matrix(exact(p))) / (a * a + b * b + c * c + d * d)
            energy = sum(mpmath.mpf(float(i)) * x * x for i, x in zip(inverse, own, strict=True))
            assert max(abs(mpmath.mpf(float(x)) - y) for x, y in zip(out, own, strict=False)) < 4e-16 * mpmath.norm(own)
            # 106 bits less a few for two dozen sums.
            assert abs(exact([out[3:5]])[0] - energy) < 2.0**-98 * energy


def test_the_rotation_that_takes_energy_back_does_so_to_first_order():
    rng = np.random.default_rng(3)
    for _ in range(20):
        momentum, inverse, excess = rng.normal(size=3), rng.uniform(0.5, 2.0, 3), rng.uniform(-1e-13, 1e-13)
        angle = np.zeros(3)
        turned_back(momentum, inverse, excess, angle)
        # A body turned by a small angle has the momentum p - angle x p in its axes.
        change = -2.0 * (inverse * momentum) @ np.cross(angle, momentum)
        assert abs(change + excess) < 1e-12 * abs(excess)
    angle = np.ones(3)
    turned_back(np.array([0.0, 2.0, 0.0]), np.array([1.0, 0.7, 0.5]), 1e-13, angle)
    assert not angle.any()  # about a principal axis no rotation changes it
