"""Small Lagrangians written out by hand, each with a motion that shows it at work, and plain helpers."""

import numpy as np

from orbits.discrete.base import finite_vector
from orbits.errors import InputError, SingularityError


class Plain:
    """L = m |v|^2/2 + A(q).v - V(q, t) with hand-written derivatives; the methods of a library Lagrangian."""

    name = "plain"
    dimension = 2
    parameters: dict[str, float] = {}  # noqa: RUF012

    def vector(self, x, what):
        values = finite_vector(np.ravel(x), what)
        if values.size != self.dimension or np.ndim(x) > 2:
            raise InputError(f"'{self.name}' has {self.dimension} coordinates; got {what} of shape {np.shape(x)}")
        return values

    def momentum(self, q, v, t=0.0):
        return self.gradients(q, v, t)[1]

    def velocity(self, q, p, t=0.0):
        v = np.zeros(self.dimension)
        for _ in range(20):
            v = v + np.linalg.solve(self.hessians(q, v, t)[2], p - self.momentum(q, v, t))
        return v


class Pendulum(Plain):
    name, dimension = "a pendulum", 1
    q, v, h = np.array([0.4]), np.array([1.1]), 0.3

    def value(self, q, v, t=0.0):
        return 0.5 * v[0] ** 2 + np.cos(q[0])

    def gradients(self, q, v, t=0.0):
        return -np.sin(q), v.copy()

    def hessians(self, q, v, t=0.0):
        return -np.cos(q)[:, None], np.zeros((1, 1)), np.eye(1)


class Bratu(Plain):
    """q'' = -exp(q), which leads from 0 back to 0 in a time of at most sqrt(3.5138) = 1.8745 (Bratu's problem)."""

    name, dimension = "Bratu's problem", 1

    def value(self, q, v, t=0.0):
        return 0.5 * v[0] ** 2 - np.exp(q[0])

    def gradients(self, q, v, t=0.0):
        return -np.exp(q), v.copy()

    def hessians(self, q, v, t=0.0):
        return -np.exp(q)[:, None], np.zeros((1, 1)), np.eye(1)


class Driven(Plain):
    """A Duffing oscillator with a force that depends on time and a mass that depends on position: not separable."""

    name, dimension = "a driven oscillator", 1
    q, v, h = np.array([0.4]), np.array([1.1]), 0.3

    def value(self, q, v, t=0.0):
        return 0.5 * (1 + 0.3 * q[0] ** 2) * v[0] ** 2 - 0.25 * q[0] ** 4 + np.sin(2 * t) * q[0]

    def gradients(self, q, v, t=0.0):
        return 0.3 * q * v**2 - q**3 + np.sin(2 * t), (1 + 0.3 * q**2) * v

    def hessians(self, q, v, t=0.0):
        return (0.3 * v**2 - 3 * q**2)[:, None], (0.6 * q * v)[:, None], (1 + 0.3 * q**2)[:, None]


class Magnetic(Plain):
    """A particle in a magnetic field that grows outwards, and a quartic well; A is linear and cubic, not gauge-free."""

    name = "a particle in a magnetic field"
    q, v, h = np.array([0.7, -0.2]), np.array([0.3, 0.9]), 0.2

    def value(self, q, v, t=0.0):
        x, y = q
        return 0.5 * (v @ v) + (1 + x * x) * (x * v[1] - y * v[0]) - 0.25 * (q @ q) ** 2

    def gradients(self, q, v, t=0.0):
        x, y = q
        f = np.array([2 * x * (x * v[1] - y * v[0]) + (1 + x * x) * v[1], -(1 + x * x) * v[0]]) - (q @ q) * q
        return f, v + (1 + x * x) * np.array([-y, x])

    def hessians(self, q, v, t=0.0):
        x, y = q
        qq = np.array([[6 * x * v[1] - 2 * y * v[0], -2 * x * v[0]], [-2 * x * v[0], 0.0]])
        qq -= (q @ q) * np.eye(2) + 2 * np.outer(q, q)
        qv = np.array([[-2 * x * y, 1 + 3 * x * x], [-(1 + x * x), 0.0]])
        return qq, qv, np.eye(2)


class Central(Plain):
    """mass (|v|^2/2 + gm/|q|), and `squash` times a term that is not invariant under rotations."""

    name = "a planet"
    q, v, h = np.array([0.8, 0.3]), np.array([-0.4, 1.0]), 0.25

    def __init__(self, gm=1.0, mass=1.0, dimension=2, squash=0.0, name="a planet"):
        self.gm, self.mass, self.dimension, self.squash, self.name = gm, mass, dimension, squash, name
        if dimension == 3:
            self.q, self.v = np.array([0.8, 0.3, -0.2]), np.array([-0.4, 1.0, 0.2])

    def value(self, q, v, t=0.0):
        return self.mass * (0.5 * (v @ v) + self.gm / self._distance(q, t) - self.squash * q[0] ** 2)

    def gradients(self, q, v, t=0.0):
        f = -self.gm * q / self._distance(q, t) ** 3
        f[0] -= 2 * self.squash * q[0]
        return self.mass * f, self.mass * v

    def hessians(self, q, v, t=0.0):
        r, one = self._distance(q, t), np.eye(len(q))
        qq = self.gm * (3 * np.outer(q, q) / r**5 - one / r**3)
        qq[0, 0] -= 2 * self.squash
        return self.mass * qq, 0 * one, self.mass * one

    def _distance(self, q, t):
        r = np.sqrt(q @ q)
        if r == 0.0:
            raise SingularityError("the planet is at the centre", time=t)
        return r


class Oscillator(Plain):
    name = "harmonic-oscillator"
    q, v, h = np.array([0.8, 0.3]), np.array([-0.4, 1.0]), 0.3
    mass = np.array([[2.0, 0.3], [0.3, 1.0]])
    stiffness = np.array([[1.5, -0.2], [-0.2, 0.7]])

    def value(self, q, v, t=0.0):
        return 0.5 * (v @ self.mass @ v - q @ self.stiffness @ q)

    def gradients(self, q, v, t=0.0):
        return -self.stiffness @ q, self.mass @ v

    def hessians(self, q, v, t=0.0):
        return -self.stiffness, np.zeros((2, 2)), self.mass


class Degenerate(Plain):
    """No kinetic energy for the second coordinate."""

    name = "a degenerate system"
    q, v, h = np.array([0.8, 0.3]), np.array([-0.4, 1.0]), 0.3

    def value(self, q, v, t=0.0):
        return 0.5 * v[0] ** 2 - 0.5 * (q @ q)

    def gradients(self, q, v, t=0.0):
        return -q, np.array([v[0], 0.0])

    def hessians(self, q, v, t=0.0):
        return -np.eye(2), np.zeros((2, 2)), np.diag([1.0, 0.0])


def difference(function, x, delta=0.02):
    """The derivative of a scalar or vector function by eighth-order central differences; last axis: by x."""
    weights = {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}
    columns = []
    for k in range(len(x)):
        unit = np.zeros(len(x))
        unit[k] = delta
        columns.append(sum(w * (function(x + m * unit) - function(x - m * unit)) for m, w in weights.items()) / delta)
    return np.moveaxis(np.array(columns), 0, -1)


def rules():
    """Every way to make a discrete Lagrangian from a Lagrangian, by the name of its maker."""
    from orbits import discrete
    from orbits.tableaux.elementary import drift_kick, kick_drift
    from orbits.tableaux.gauss import gauss
    from orbits.tableaux.lobatto import lobatto_iiia_iiib, lobatto_iiib_iiia

    tableaux = (
        *map(gauss, (1, 2, 3)),
        *map(lobatto_iiia_iiib, (2, 3)),
        lobatto_iiib_iiia(3),
        kick_drift(),
        drift_kick(),
    )
    plain = ("symplectic_euler_a", "symplectic_euler_b", "trapezoidal", "midpoint", "exact", "exact_by_collocation")
    return {
        **{name: getattr(discrete, name) for name in plain},
        **{f"vprk {t.name}": (lambda L, t=t: discrete.vprk(L, t)) for t in tableaux},
    }


def systems():
    """Hand-written Lagrangians, with the names under which closed forms are chosen where there is one."""
    return {
        "pendulum": Pendulum(),
        "driven": Driven(),
        "magnetic": Magnetic(),
        "kepler": Central(gm=1.3, mass=2.0, name="kepler"),
        "kepler in space": Central(dimension=3, name="kepler"),
        "oscillators": Oscillator(),
    }


def pair(L):
    """Two points that the Lagrangian's motion nearly joins in the time h, but not quite."""
    return L.q, L.q + L.h * L.v + 0.02


def compare(L_d, q0, q1, h, t, bound, delta):
    """Assert that D1, D2 and the second derivatives of L_d are those of its value, by differences of width delta."""
    jet = L_d.jet(q0, q1, h, t)
    scale = np.abs(jet.d12).max()

    def by(which):
        ends = [q0, q1]

        def moved(x):
            ends[which] = x
            return np.hstack(L_d.first(*ends, h, t))

        slopes = difference(moved, ends[which], delta)
        return slopes[0], slopes[1 : 1 + len(q0)], slopes[1 + len(q0) :]

    expected = ((jet.d1, jet.d11, jet.d12.T), (jet.d2, jet.d12, jet.d22))
    for which in (0, 1):
        for got, slope in zip(expected[which], by(which), strict=True):
            assert np.abs(got - slope).max() < bound * scale
    assert np.abs(jet.d11 - jet.d11.T).max() < 1e-15 * scale  # 1.9e-16 was reached
    assert np.abs(jet.d22 - jet.d22.T).max() < 1e-15 * scale
    assert L_d.first(q0, q1, h, t)[0] == jet.value
    for x, y in zip(L_d.hessian(q0, q1, h, t), jet[3:], strict=True):
        assert np.array_equal(x, y)
