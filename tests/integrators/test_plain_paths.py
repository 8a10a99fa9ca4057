"""Each fast path against a plain, slow, obviously right one, to round-off on a nonlinear problem."""

import mpmath
import numpy as np
import pytest

from orbits.integrators import registry
from orbits.integrators.composition import Composition
from orbits.integrators.gauss import Gauss
from orbits.integrators.runge_kutta_4 import RungeKutta4
from orbits.integrators.stormer_verlet import StormerVerlet
from orbits.lagrangians.newtonian import n_body

from ..contracts.problems import march, marcher
from ..coverings import only
from ..problems import particles_around, three_bodies

DIGITS = 40


def exact_numbers(array):
    return [[mpmath.mpf(float(x)) for x in row] for row in array]


def accelerations(gm, q):
    n = len(q)
    out = [[mpmath.mpf(0)] * 3 for _ in range(n)]
    for i in range(n):
        for j in range(n):
            if i != j and gm[j]:
                d = [q[j][k] - q[i][k] for k in range(3)]
                w = gm[j] / mpmath.sqrt(sum(x * x for x in d)) ** 3
                out[i] = [a + w * x for a, x in zip(out[i], d, strict=True)]
    return out


def moved(q, v, h):
    return [[x + h * y for x, y in zip(a, b, strict=True)] for a, b in zip(q, v, strict=True)]


def verlet(gm, q, v, h):
    v = moved(v, accelerations(gm, q), h / 2)
    q = moved(q, v, h)
    return q, moved(v, accelerations(gm, q), h / 2)


def chain(method):
    """Kicks and drifts with their exact lengths, one after the other."""
    scheme = method._scheme

    def step(gm, q, v, h):
        v = moved(v, accelerations(gm, q), h * scheme.kicks[0])
        for k, d in zip(scheme.kicks[1:], scheme.drifts, strict=True):
            q = moved(q, v, h * d)
            v = moved(v, accelerations(gm, q), h * k)
        return q, v

    return step


def euler(gm, q, v, h):
    return moved(q, v, h), moved(v, accelerations(gm, q), h)


def runge_kutta(gm, q, v, h):
    """The textbook form in (q, v), not the one in the kernel."""
    k1 = v, accelerations(gm, q)
    k2 = moved(v, k1[1], h / 2), accelerations(gm, moved(q, k1[0], h / 2))
    k3 = moved(v, k2[1], h / 2), accelerations(gm, moved(q, k2[0], h / 2))
    k4 = moved(v, k3[1], h), accelerations(gm, moved(q, k3[0], h))
    for k, weight in ((k1, 1), (k2, 2), (k3, 2), (k4, 1)):
        q, v = moved(q, k[0], h * weight / 6), moved(v, k[1], h * weight / 6)
    return q, v


def partitioned(tableau):
    """A partitioned Runge–Kutta method in (q, v) with its exact coefficients, iterated to forty digits."""

    def step(gm, q, v, h):
        s = range(tableau.stages)
        Q, V = [q] * tableau.stages, [v] * tableau.stages
        for _ in range(400):
            G = [accelerations(gm, x) for x in Q]
            newQ, newV = [], []
            for i in s:
                x, w = q, v
                for j in s:
                    x = moved(x, V[j], h * tableau.exact_a[i][j])
                    w = moved(w, G[j], h * tableau.exact_a_bar[i][j])
                newQ.append(x)
                newV.append(w)
            change = max(
                abs(a - b)
                for X, Y in zip(newQ, Q, strict=True)
                for r, u in zip(X, Y, strict=True)
                for a, b in zip(r, u, strict=True)
            )
            Q, V = newQ, newV
            if change < mpmath.mpf(10) ** -(DIGITS - 5):
                break
        for i in s:
            b = tableau.exact_b[i]
            q, v = moved(q, V[i], h * b), moved(v, accelerations(gm, Q[i]), h * b)
        return q, v

    return step


ON_THEIR_OWN = ("wisdom-holman", "saba", "lie-group-variational")
"""Methods on Kepler orbits, and of rigid bodies: they have files of their own."""

OWN_PATH = ("gauss", "stormer-verlet", "composition")
IMPLICIT = (
    *(Gauss(stages=s) for s in (1, 2, 3, 8)),
    *(
        m
        for name, cls in registry().items()
        if name not in ("gauss", "stormer-verlet", "composition", *ON_THEIR_OWN)
        for m in cls.examples()
    ),
)
PLAIN = {
    "stormer-verlet": (StormerVerlet(), verlet),
    "runge-kutta-4": (RungeKutta4(), runge_kutta),
    "explicit-euler": (registry()["explicit-euler"](), euler),
    **{m.label: (m, chain(m)) for m in Composition.examples()},
    **{m.label: (m, partitioned(m.tableau)) for m in IMPLICIT if m.variational},
}

SOME = [
    *("stormer-verlet", "runge-kutta-4", "explicit-euler", "Gauss(stages=1)", "Gauss(stages=3)"),
    *("LobattoIIIAB(stages=3)", "LobattoIIIBA(stages=3)", Composition.examples()[0].label),
]
"""Those held to it by default: a method of each kernel, with few stages."""


def test_every_method_has_a_plain_path_to_be_held_to():
    assert {method.name for method, _ in PLAIN.values()} == set(registry()) - set(ON_THEIR_OWN)


@pytest.mark.parametrize("name", only(SOME, PLAIN))
def test_three_steps_equal_the_plain_path_in_forty_digits(name):
    method, plain = PLAIN[name]
    gm, q, v = three_bodies()
    x, w = particles_around(2)
    gm, q, v = np.append(gm, [0.0, 0.0]), np.vstack([q, x]), np.vstack([v, w])
    h = 0.125
    got_q, got_v = march(method, gm, q, v, h, 3)
    with mpmath.workdps(DIGITS):
        Q, V = exact_numbers(q), exact_numbers(v)
        masses = [mpmath.mpf(float(g)) for g in gm]
        for _ in range(3):
            Q, V = plain(masses, Q, V, mpmath.mpf(h))
        truth_q, truth_v = np.array(Q, dtype=float), np.array(V, dtype=float)
    # Compensated sums: what is left are the roundings of h g, 2.2e-16 at most was reached on speeds of 1.5.
    assert np.abs(got_q - truth_q).max() < 5e-16
    assert np.abs(got_v - truth_v).max() < 5e-16


@pytest.mark.parametrize("method", [StormerVerlet(), Gauss(stages=1)], ids=lambda m: m.label)
def test_the_march_is_the_map_of_its_discrete_lagrangian(method):
    """Störmer–Verlet that of the trapezoidal L_d, one-stage Gauss that of the midpoint L_d.

    The equations of positions do not distinguish Störmer–Verlet from symplectic Euler; momenta do.
    """
    from orbits import discrete

    gm, q, v = three_bodies()
    h, states = 0.0625, [(q, v)]
    run = marcher(method, gm, q, v, h)
    for _ in range(40):
        run.advance(1)
        states.append(run.state())
    path, p = np.array([x for x, _ in states]), gm[:, None] * np.array([w for _, w in states])
    right, wrong = discrete.trapezoidal(n_body(gm)), discrete.midpoint(n_body(gm))
    if method.name == "gauss":
        right, wrong = wrong, right
    size = gm[:, None] * np.abs(path).max(axis=(0, 2))[:, None] / h
    ulps = np.abs(discrete.euler_lagrange_residual(right, path, h)).max(axis=0) / size * 2.0**53
    assert ulps.max() < 5  # three roundings of q, divided by h; 2.0 was reached
    momenta = np.abs(discrete.momentum_residual(right, path, p, h)).max(axis=(0, 1)) / size * 2.0**53
    assert momenta.max() < 5  # 1.7 was reached
    euler = discrete.symplectic_euler_a(n_body(gm))
    assert (np.abs(discrete.momentum_residual(euler, path, p, h)).max(axis=(0, 1)) / size).max() > 1e-6
    # The other quadrature is another map: its equations are missed by h^3.
    assert (np.abs(discrete.euler_lagrange_residual(wrong, path, h)).max(axis=0) / size).max() > 1e-6


@pytest.mark.parametrize("discrete_lagrangian", ["trapezoidal", "midpoint"])
def test_the_derivatives_of_a_discrete_lagrangian_are_those_of_its_value(discrete_lagrangian):
    from orbits import discrete

    gm, q, v = three_bodies()
    L_d = getattr(discrete, discrete_lagrangian)(n_body(gm, softening=0.1))
    h = 0.1
    q1 = q + h * v
    for which, derivative in ((0, L_d.d1(q, q1, h).reshape(3, 3)), (1, L_d.d2(q, q1, h).reshape(3, 3))):
        for body in range(3):
            for axis in range(3):
                values = []
                for m in (-2, -1, 1, 2):
                    ends = [q.copy(), q1.copy()]
                    ends[which][body, axis] += m * 1e-3
                    values.append(L_d.value(*ends, h))
                slope = (values[0] - 8 * values[1] + 8 * values[2] - values[3]) / 12e-3
                assert abs(slope - derivative[body, axis]) < 1e-12  # 1.0e-14 was reached


def test_starting_momenta_are_those_of_the_legendre_transform():
    """p_0 = -D1 L_d(q_0, q_1): the velocity the march starts from is the discrete momentum over GM, to round-off."""
    from orbits import discrete

    gm, q, v = three_bodies()
    h = 0.0625
    q1, v1 = march(StormerVerlet(), gm, q, v, h, 1)
    L_d = discrete.trapezoidal(n_body(gm))
    assert np.abs(-L_d.d1(q, q1, h).reshape(3, 3) / gm[:, None] - v).max() < 4 * 2.0**-53 * np.abs(q).max() / h
    assert np.abs(L_d.d2(q, q1, h).reshape(3, 3) / gm[:, None] - v1).max() < 4 * 2.0**-53 * np.abs(q).max() / h
