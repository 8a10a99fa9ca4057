"""The exact discrete Lagrangian: F- and F+ give the true velocities, its marching stays on the true orbit."""

import functools

import numpy as np
import pytest

from orbits import discrete
from orbits.errors import InputError, OrbitsError
from orbits.lagrangians import registry
from orbits.tableaux.gauss import gauss
from orbits.tableaux.lobatto import lobatto_iiia_iiib

from ..coverings import every, first
from .mechanics import Central, Driven, Magnetic, Oscillator, Pendulum, difference
from .swept import motion, swept


def transfers(count, kind, seed=1):
    """Random (gm, q, v, h) in the plane and in space, either sign of h, less than one revolution."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        d, gm = int(rng.integers(2, 4)), 10 ** rng.uniform(-1, 1)
        q, v = rng.normal(size=d), rng.normal(size=d)
        escape = np.sqrt(2 * gm / np.sqrt(q @ q))
        v *= escape / np.sqrt(v @ v)
        if kind == "ellipse":
            v *= rng.uniform(0.4, 0.97)
            period = 2 * np.pi * gm / (2 * gm / np.sqrt(q @ q) - v @ v) ** 1.5
            yield gm, q, v, rng.uniform(0.02, 0.9) * period * rng.choice([-1, 1])
        else:
            v *= rng.uniform(1.0, 2.0) if kind == "hyperbola" else 1.0
            yield gm, q, v, rng.uniform(0.05, 2) * np.sqrt((q @ q) ** 1.5 / gm) * rng.choice([-1, 1])


@pytest.mark.parametrize("count", first(1, [30, 300]))
@pytest.mark.parametrize("kind", ["ellipse", "hyperbola", "parabola"])
def test_f_plus_and_f_minus_of_the_exact_kepler_lagrangian_give_the_true_velocities(kind, count):
    worst, ways, judged = 0.0, set(), 0
    for gm, q, v, h in transfers(count, kind):
        q1, v1, action = motion(q, v, gm, h)
        angle = swept(q, v, q1, h)
        if min(angle, abs(angle - 180), 360 - angle) < 5:
            continue
        way = "short" if angle < 180 else "long"
        value, d1, d2 = discrete.exact_kepler(gm, way).first(q, q1, h)
        speed = max(np.sqrt(v @ v), np.sqrt(v1 @ v1))
        worst = max(worst, np.abs(-d1 - v).max() / speed, np.abs(d2 - v1).max() / speed, abs(value / action - 1))
        ways.add(way)
        judged += 1
    assert judged > count * 2 / 3
    assert ways == {"short", "long"}
    # 4.5e-15 was reached here, 6.3e-15 in 4,500 transfers; the issue asks for 1e-12.
    assert worst < 2e-14


@pytest.mark.parametrize("excess", [-1e-4, -1e-9, -1e-13, 0.0, 1e-13, 1e-9, 1e-4])
def test_nothing_is_lost_near_the_parabola(excess):
    q, h = np.array([1.0, 0.2]), 1.3
    v = np.array([-0.3, 1.0])
    v *= np.sqrt(2 * (1 + excess) / np.sqrt(q @ q) / (v @ v))
    q1, v1, action = motion(q, v, 1.0, h)
    value, d1, d2 = discrete.exact_kepler(1.0).first(q, q1, h)
    assert max(np.abs(-d1 - v).max(), np.abs(d2 - v1).max(), abs(value - action)) < 3e-15  # 4.4e-16 was reached


@pytest.mark.parametrize("a", [1e-1, 1e-2, 1e-4, 1e-6, 1e-8])
def test_nothing_is_lost_on_fast_hyperbolas_of_the_long_way(a):
    """A hyperbola with e = 3/2 from -H to H about its pericentre, in closed form, from r = 1 to r = 1."""
    e, H = 1.5, np.arccosh((1 / a + 1) / 1.5)
    side, n = np.sqrt(e * e - 1) * np.sinh(H) * a, a**-1.5
    q, q1 = (np.array([a * (e - np.cosh(H)), y]) for y in (-side, side))
    h = 2 * (e * np.sinh(H) - H) / n
    v = np.array([np.sinh(H), np.sqrt(e * e - 1) * np.cosh(H)]) * a * n / (e * np.cosh(H) - 1)
    value, d1, d2 = discrete.exact_kepler(1.0, "long").first(q, q1, h)
    action = 2 * H * np.sqrt(a) * 2 + h / (2 * a)  # 2 gm s + v_inf^2 h / 2, with H = s / sqrt(a)
    speed = np.linalg.norm(v)
    wrong = np.abs(-d1 - v).max() / speed, np.abs(d2 - v * [-1, 1]).max() / speed, abs(value / action - 1)
    assert max(wrong) < 5e-15  # 1.8e-15 was reached for forty a from 1e-1 to 1e-9


@pytest.mark.parametrize("way", ["short", "long"])
@pytest.mark.parametrize("h", [0.15, 0.9, 2.2, -2.2, 9.0])
def test_its_second_derivatives_on_hyperbolae_and_ellipses(way, h):
    L_d, q0, q1 = discrete.exact_kepler(1.3, way, mass=2.0), np.array([1.0, 0.2, -0.1]), np.array([-0.4, 0.9, 0.3])
    jet = L_d.jet(q0, q1, h)
    for got, function, x in (
        (jet.d1, lambda x: L_d.value(x, q1, h), q0),
        (jet.d2, lambda x: L_d.value(q0, x, h), q1),
        (jet.d11, lambda x: L_d.d1(x, q1, h), q0),
        (jet.d12, lambda x: L_d.d1(q0, x, h), q1),
        (jet.d12.T, lambda x: L_d.d2(x, q1, h), q0),
        (jet.d22, lambda x: L_d.d2(q0, x, h), q1),
    ):
        assert (
            np.abs(got - difference(function, x, 0.01)).max() < 1e-9 * np.abs(jet.d12).max()
        )  # truncated differences: 0.23e-9


def test_a_fall_along_a_straight_line_is_served():
    q, v, h = np.array([1.0, 0.5]), np.array([0.4, 0.2]), 0.6
    q1, v1, action = motion(q, v, 1.0, h)
    value, d1, d2 = discrete.exact_kepler(1.0).first(q, q1, h)
    assert max(np.abs(-d1 - v).max(), np.abs(d2 - v1).max(), abs(value - action)) < 3e-15  # 4.4e-16 was reached


@pytest.mark.parametrize(("e", "dimension"), first(1, [(0.5, 3), (0.5, 2), (0.0, 3), (0.0, 2)]))
def test_a_hundred_steps_of_its_equations_stay_on_the_true_orbit(e, dimension):
    q = np.array([1 - e, 0.0, 0.0])[:dimension]
    v = np.array([0.0, 0.8, 0.6])[:dimension] * np.sqrt((1 + e) / (1 - e)) / (1.0 if dimension == 3 else 0.8)
    L_d, h = discrete.exact(Central(name="kepler", dimension=dimension)), 0.25
    path = discrete.march_pairs(L_d, *discrete.start(L_d, q, v, h), h, 99)
    truth = np.array([motion(q, v, 1.0, k * h)[0] for k in range(101)])
    assert np.abs(path - truth).max() < 1e-12  # four revolutions; 1.5e-13 was reached, the issue asks for 1e-11
    p = v
    for k in range(25):
        q, p = discrete.step(L_d, q, p, h)
        assert np.abs(q - truth[k + 1]).max() < 1e-12  # 1.0e-13


@pytest.mark.parametrize("h", [0.1, 0.3, 0.8])
@pytest.mark.parametrize("L", [Oscillator(), Central(gm=1.3, mass=2.0, name="kepler")], ids=lambda L: L.name)
def test_the_collocated_action_equals_the_closed_form(L, h):
    q1 = L.q + h * L.v
    closed, made = discrete.exact(L).jet(L.q, q1, h), discrete.exact_by_collocation(L).jet(L.q, q1, h)
    scale = np.abs(closed.d12).max()
    for x, y in zip(closed, made, strict=True):
        assert np.abs(np.asarray(x) - np.asarray(y)).max() < 5e-15 * scale  # 1.5e-15 was reached


def test_closed_forms_are_chosen_by_what_the_lagrangian_is_not_by_its_name_alone():
    for name in ("free-particle", "harmonic-oscillator", "kepler"):
        assert discrete.exact(registry()[name]).name == f"exact-{name}"
    assert discrete.exact(Central(name="kepler")).name == "exact-kepler"
    assert discrete.exact(Central(name="kepler"), way="long").name == "exact-kepler-long"
    assert discrete.exact(Oscillator()).name == "exact-harmonic-oscillator"
    assert discrete.exact(Central(name="kepler", squash=0.1)).name == "exact-by-collocation"
    assert discrete.exact(Pendulum()).name == "exact-by-collocation"
    with pytest.raises(InputError, match="no such arcs"):
        discrete.exact(Pendulum(), way="long")


def test_free_particle_and_oscillator_in_numbers():
    free, spring = discrete.exact_free_particle(2.0, 2), discrete.exact_harmonic_oscillator(2.0, 8.0)
    assert abs(free.value([0, 0], [3, 4], 0.5) - 50.0) < 3e-14
    assert np.allclose(free.d2([0, 0], [3, 4], 0.5), [12, 16], rtol=1e-15)
    # x = cos 2t: p = -4 sin 2t
    h = 0.4
    value, d1, d2 = spring.first([1.0], [np.cos(2 * h)], h)
    assert abs(d1[0]) < 1e-15
    assert abs(d2[0] + 4 * np.sin(2 * h)) < 2e-15
    assert abs(value + np.sin(4 * h)) < 1e-15  # int 4 sin^2 - 4 cos^2 = -sin 4h


ORDERS = {
    "symplectic_euler_a": (discrete.symplectic_euler_a, 1),
    "symplectic_euler_b": (discrete.symplectic_euler_b, 1),
    "trapezoidal": (discrete.trapezoidal, 2),
    "midpoint": (discrete.midpoint, 2),
    "Gauss 2": (lambda L: discrete.vprk(L, gauss(2)), 4),
    "Gauss 3": (lambda L: discrete.vprk(L, gauss(3)), 6),
    "Lobatto 3": (lambda L: discrete.vprk(L, lobatto_iiia_iiib(3)), 4),
    "Lobatto 4": (lambda L: discrete.vprk(L, lobatto_iiia_iiib(4)), 6),
}


MOTIONS = {"kepler": Central(name="kepler"), "driven": Driven(), "magnetic": Magnetic()}


@functools.cache
def true_steps(system, h):
    """Several motions, for the error of one may pass through zero: q, p, then q1, p1 and the action, all exact."""
    L = MOTIONS[system]
    exact, steps = discrete.exact(L), []
    for turn in (0.0, 0.5, -0.5):
        v = np.cos(turn) * L.v + np.sin(turn) * L.v[::-1] * np.array([-1.0, 1.0])[-len(L.v) :]
        p = L.momentum(L.q, v)
        q1, p1 = discrete.step(exact, L.q, p, h)
        steps.append((L.q, p, q1, p1, exact.value(L.q, q1, h)))
    return steps


@pytest.mark.parametrize("system", every(3, MOTIONS))
@pytest.mark.parametrize("rule", ORDERS)
def test_the_order_of_a_discrete_lagrangian_is_the_order_of_its_map(rule, system):
    """Both |L_d - L_d^E| along true solutions and |F~ - flow| fall as h^(r+1)."""
    make, order = ORDERS[rule]
    L_d = make(MOTIONS[system])
    steps = {1: (0.02, 0.01, 0.005), 2: (0.02, 0.01, 0.005), 4: (0.06, 0.03, 0.02), 6: (0.12, 0.1, 0.08)}[order]
    actions, maps = [], []
    for h in steps:
        action, change = [], []
        for q, p, q1, p1, value in true_steps(system, h):
            moved, pushed = discrete.step(L_d, q, p, h)
            action.append(L_d.value(q, q1, h) - value)
            change.append(np.hstack([moved - q1, pushed - p1]))
        actions.append(np.linalg.norm(action))
        maps.append(np.linalg.norm(change))
    for errors in (actions, maps):
        assert min(errors) > 2e-13, errors  # above round-off
        slopes = np.diff(np.log(errors)) / np.diff(np.log(steps))
        # 0.63 was reached at order 6, where larger h still show the next term; orders of symmetric rules are even.
        assert abs(slopes[-1] - (order + 1)) < (0.15 if order <= 2 else 0.75), slopes


def test_more_than_one_revolution_or_half_a_turn_is_refused_with_the_reason():
    L_d = discrete.exact(Central(name="kepler"))
    q, v = np.array([1.0, 0.0]), np.array([0.0, 1.0])
    with pytest.raises(InputError, match="one revolution or more"):
        discrete.step(L_d, q, v, 6.3)
    with pytest.raises(InputError, match="180 degrees"):
        L_d.value(q, -2 * q, 1.0)
    with pytest.raises(InputError, match="360 degrees"):
        discrete.exact(Central(name="kepler"), way="long").value(q, 2 * q, 1.0)
    with pytest.raises(InputError, match="coincide"):
        L_d.value(q, q, 1.0)
    with pytest.raises(InputError, match="centre of force"):
        L_d.value(q, 0 * q, 1.0)
    # An arc above 180 degrees has no L_d of the short way; the other one has it.
    with pytest.raises(OrbitsError, match="smaller h"):
        discrete.step(L_d, q, v, 4.0)
    long = discrete.exact(Central(name="kepler"), way="long")
    assert np.abs(discrete.step(long, q, v, 4.0)[0] - [np.cos(4), np.sin(4)]).max() < 4e-14  # 6e-15


def test_conjugate_points_of_the_oscillator_are_refused():
    L_d = discrete.exact_harmonic_oscillator(1.0, 1.0)
    with pytest.raises(InputError, match="half periods"):
        L_d.value([0.3], [-0.3], np.pi)
    assert abs(L_d.d2([1.0], [np.cos(4.0)], 4.0)[0] + np.sin(4.0)) < 1e-15  # beyond half a period it is well defined
