"""The free rotation of a rigid body as arrays, and a reference of 40 digits that shares nothing with it."""

import mpmath
import numpy as np

from orbits.kernels.compile import kernel
from orbits.kernels.lanes import load, store
from orbits.kernels.rotation.free_rotation import rotate


@kernel
def rotated(moments, h, q, momentum, steps):
    """Take steps of one body in place."""
    attitude, pi = (q[0], q[1], q[2], q[3]), (momentum[0], momentum[1], momentum[2])
    for _ in range(steps):
        attitude, pi = rotate((moments[0], moments[1], moments[2]), h, attitude, pi)
    q[0], q[1], q[2], q[3] = attitude
    momentum[0], momentum[1], momentum[2] = pi


@kernel
def rotated_in_lanes(moments, h, q, momentum, steps):
    """Take steps of eight bodies in place; h : (1, 8), the rest (3, 8) and (4, 8)."""
    attitude = load(q, 0), load(q, 1), load(q, 2), load(q, 3)
    pi = load(momentum, 0), load(momentum, 1), load(momentum, 2)
    for _ in range(steps):
        attitude, pi = rotate((load(moments, 0), load(moments, 1), load(moments, 2)), load(h, 0), attitude, pi)
    store(q, 0, attitude[0])
    store(q, 1, attitude[1])
    store(q, 2, attitude[2])
    store(q, 3, attitude[3])
    store(momentum, 0, pi[0])
    store(momentum, 1, pi[1])
    store(momentum, 2, pi[2])


def by_series(moments, q, momentum, time, order=40):
    """Return the attitude, a unit quaternion, and the momentum after `time`, by Taylor series of a quarter radian."""
    with mpmath.workdps(40):
        inverse = [1 / mpmath.mpf(float(x)) for x in moments]
        rates = [inverse[2] - inverse[1], inverse[0] - inverse[2], inverse[1] - inverse[0]]
        q, pi = [mpmath.mpf(float(x)) for x in q], [mpmath.mpf(float(x)) for x in momentum]
        size = mpmath.sqrt(mpmath.fdot(q, q))
        q = [x / size for x in q]
        fastest = max(abs(x * y) for x, y in zip(pi, inverse, strict=True))
        steps = max(1, int(mpmath.ceil(4 * abs(time) * fastest)))
        h = mpmath.mpf(float(time)) / steps
        for _ in range(steps):
            q, pi = _series_step(inverse, rates, q, pi, h, order)
        return q, pi


def _series_step(inverse, rates, q, pi, h, order):
    P, Q = [[x] for x in pi], [[x] for x in q]
    for k in range(order):
        W = [[inverse[i] * x for x in P[i]] for i in range(3)]
        (b, c, d), (x, y, z) = Q[1:], W
        a = Q[0]
        more = (
            -_folded(b, x) - _folded(c, y) - _folded(d, z),
            _folded(a, x) + _folded(c, z) - _folded(d, y),
            _folded(a, y) + _folded(d, x) - _folded(b, z),
            _folded(a, z) + _folded(b, y) - _folded(c, x),
        )
        kicks = [rates[i] * _folded(P[(i + 1) % 3], P[(i + 2) % 3]) for i in range(3)]
        for row, new in zip(Q, more, strict=True):
            row.append(new / (2 * (k + 1)))
        for row, new in zip(P, kicks, strict=True):
            row.append(new / (k + 1))
    return [mpmath.polyval(x[::-1], h) for x in Q], [mpmath.polyval(x[::-1], h) for x in P]


def _folded(one, other):
    """Return the next coefficient of a product of series."""
    return mpmath.fdot(one, other[::-1])


def drawn(count, seed=1):
    """Return moments that bodies have, unit quaternions and momenta, (count, 3), (count, 4), (count, 3)."""
    rng = np.random.default_rng(seed)
    a, b = rng.uniform(0.4, 1.0, (2, count))
    c = rng.uniform(abs(a - b), a + b)
    q = rng.normal(size=(count, 4))
    return np.array([a, b, c]).T.copy(), q / np.linalg.norm(q, axis=1)[:, None], rng.normal(size=(count, 3))
