"""Derivatives of runs with forces without a Lagrangian, by starts and by parameters."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import mpmath
import numpy as np
import pytest
from numba import types

import orbits
from orbits.errors import InputError, UnknownNameError
from orbits.forces import registry
from orbits.forces.base import BoundForce, Force
from orbits.kernels.binding import Tag
from orbits.kernels.compile import kernel
from orbits.kernels.compile.verbs import verb
from orbits.kernels.lanes import LanesType, get, put, select, sqrt
from orbits.kernels.lanes.functions import tanh
from orbits.system.parameters import parameters_of, with_values
from orbits.terms import (
    Drag,
    FrameDragging,
    NonGravitational,
    RadiationPressure,
    Tides,
    ZonalHarmonics,
)
from tests.propagation.forces_in_many_digits import Numbers, flow

from ..coverings import first

GAUSS = orbits.Gauss(stages=8)
NAMES, GM = ["star", "a", "b"], [1.0, 1e-2, 2e-3]
Q, V = [[0, 0, 0], [1.0, 0, 0.1], [0, -1.8, 0.1]], [[0, 0, 0], [0, 1.0, 0.2], [0.7, 0, 0.05]]
SPIN, POLE, R, END = (0.5, -0.3, 2.0), (0.0, 0.6, 0.8), 0.3, 0.25
WEIGHTS = {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}  # central differences of eighth order


def bodies(*, units=orbits.DIMENSIONLESS):
    return orbits.System(NAMES, GM, Q, V, units=units)


def full():
    """A star with tides, a spin and J2, a planet, and one with light and Marsden's force."""
    tides = Tides("star", k2=0.3, radius=R, lag=0.1, inertia=0.1, spin=SPIN)
    force = NonGravitational.yarkovsky(-2e-3, A1=1e-3, A3=1e-3, r0=1.0, bodies=["b"])
    light = RadiationPressure(beta=0.01, c=10.0, bodies=["b"])
    flat = ZonalHarmonics("star", J2=0.01, radius=R, pole=POLE)
    return bodies().with_terms(flat).with_forces(tides, force, light)


PARAMETERS = ["b.A2", "b.A1", "b.beta", "star.k2", "star.lag", "star.J2", "star.gm", "b.gm"]


def transition(system, method=GAUSS, **options):
    return orbits.state_transition(system, method, check_step=False, **{"dt": 1 / 64, "duration": END, **options})


def in_many_digits(start, changed):
    """Return the end of `full()` in mpmath, (18,), from a start, (18,) with all q first, and changes of parameters."""

    def exact(x):
        return np.array([mpmath.mpf(float(k)) for k in np.ravel(x)], dtype=object)

    numbers = Numbers(
        exact(GM), mpmath.mpf(0.01), exact(POLE), mpmath.mpf(R), mpmath.mpf(0.3), mpmath.mpf(0.1), mpmath.mpf(0.1),
        exact([1e-3, -2e-3, 1e-3]), mpmath.mpf(0.01), mpmath.mpf(0.1),
    )  # fmt: skip
    for name, change in changed.items():
        body, field = name.split(".")
        if field == "gm":
            numbers.gm[NAMES.index(body)] += change
        elif field in ("A1", "A2"):
            numbers.A[int(field[1]) - 1] += change
        else:
            setattr(numbers, field, getattr(numbers, field) + change)
    y = np.concatenate([exact(Q), exact(V), exact(SPIN)])
    y[:18] = y[:18] + start
    return flow(numbers, y, END, 1)[:18]


def along(direction, parameters):
    """Return the derivative of the end along a direction of starts and parameters, by differences in 40 digits."""
    with mpmath.workdps(40):
        h, ends = mpmath.mpf(10) ** -11, []
        for sign in (1, -1):
            moved = np.array([sign * h * mpmath.mpf(float(x)) for x in direction], dtype=object)
            changes = {name: sign * h * mpmath.mpf(float(x)) for name, x in parameters.items()}
            ends.append(in_many_digits(moved, changes))
        return np.array([float(x) for x in (ends[0] - ends[1]) / (2 * h)])


def by_kinds(x):
    """Return rows of bodies, (18,), with all q first."""
    return np.concatenate([x.reshape(3, 6)[:, :3].ravel(), x.reshape(3, 6)[:, 3:].ravel()])


@pytest.mark.nightly
def test_derivatives_by_starts_and_parameters_agree_with_differences_in_40_digits():
    """All at once, each parameter with a change that matters as much as that of the start. Seen: 8e-14."""
    stm = transition(full(), parameters=PARAMETERS)
    direction = np.random.default_rng(1).normal(size=18)
    sizes = np.linalg.norm(stm.by_parameters, axis=0)
    changes = np.array([1, -1, 1, 1, -1, 1, -1, 1]) / sizes
    found = by_kinds(stm.matrix @ direction + stm.by_parameters @ changes)
    truth = along(by_kinds(direction), dict(zip(PARAMETERS, changes, strict=True)))
    assert np.abs(found - truth).max() < 4e-13 * np.abs(truth).max()


@pytest.mark.nightly
@pytest.mark.parametrize("k", range(len(PARAMETERS)), ids=PARAMETERS)
def test_the_derivative_by_each_parameter_agrees_with_differences_in_40_digits(k):
    """Seen: 2e-13 by GM of a light body, 2e-14 by k2, 4e-15 and less by others."""
    column = by_kinds(transition(full(), parameters=PARAMETERS[k : k + 1]).by_parameters[:, 0])
    truth = along(np.zeros(18), {PARAMETERS[k]: 1.0})
    assert np.abs(column - truth).max() < 1e-12 * np.abs(truth).max()


def end_of(system, method=GAUSS, **options):
    """Return the end of a run, (6 N,), in the order of the rows of the matrix."""
    run = orbits.propagate(
        system, method, check_step=False, progress=False, **{"dt": 1 / 64, "duration": END, "samples": 2, **options}
    )
    return np.concatenate([run.q.value[-1], run.v.value[-1]], axis=1).ravel()


def difference(ends, h):
    """Return the derivative of `ends`, a function of a displacement, by differences of eighth order."""
    return sum(weight * (ends(m * h) - ends(-m * h)) for m, weight in WEIGHTS.items()) / h


TERMS = ZonalHarmonics("star", J2=0.01, radius=R, pole=POLE), FrameDragging("star", spin=0.02, pole=POLE, c=3.0)


@pytest.mark.nightly
@pytest.mark.parametrize("terms", first(1, [[], [*TERMS]]), ids=["without terms", "with terms"])
def test_every_registered_force_has_derivatives_by_the_start_and_by_its_parameters(terms):
    """All examples at once, which are compiled for what forces take too, by differences in float64, whose rounding is
    1e-12 of the largest derivative. Further examples of a force act on one body, so that parameters have one meaning.
    """
    examples = [cls.examples() for cls in registry().values()]
    forces = [replace(force, bodies=["a"]) if k else force for one in examples for k, force in enumerate(one)]
    grain = bodies().add("grain", q=[0.8, 1.2, -0.3], v=[-0.7, 0.5, 0.1])
    system = grain.with_terms(*terms).with_forces(*forces)
    acting = [force for force in system.forces if getattr(force, "bodies", None) is None or "grain" in force.bodies]
    names = [*["star.J2"] * bool(terms), "star.gm", "b.gm"]
    names += [f"{force.source or 'star'}.{field}" for force in acting for field in force.of_body]
    names += [f"grain.{f}" for force in acting for f in force.per_body if getattr(force, f) is not None]
    assert {name.split(".")[1] for name in names} >= {"A1", "A2", "A3", "beta", "k2", "lag", "fraction", "tau_a"}
    stm = transition(system, parameters=names)
    directions = np.random.default_rng(2).normal(size=(2, 24))
    q, v = system.values.q, system.values.v
    for d in directions:
        moved = d.reshape(4, 6)
        truth = difference(lambda h, m=moved: end_of(system.replaced(q=q + h * m[:, :3], v=v + h * m[:, 3:])), 1e-3)
        assert np.abs(stm.matrix @ d - truth).max() < 1e-11 * np.abs(truth).max()
    for one in parameters_of(system, names):
        column = stm["grain", one.name] if one.body == "grain" else stm.by_parameters[:18, names.index(one.name)]
        h = 0.02 * one.value
        truth = difference(lambda x, p=one: end_of(with_values(system, [p], [p.value + x])), h)
        truth = truth[18:] if one.body == "grain" else truth[:18]
        # Differences lose what the parameter moves, of the places: 1e-16 / |h truth|.
        size = np.abs(truth).max()
        assert np.abs(column - truth).max() < 1e-8 * size + 4e-15 / abs(h), one.name


@pytest.mark.nightly
def test_a_parameter_of_value_0_has_its_derivative():
    """Nothing acts, but a force is about to."""
    still = bodies().with_forces(NonGravitational.yarkovsky(0.0, r0=1.0, bodies=["b"]))
    moved = bodies().with_forces(NonGravitational.yarkovsky(1e-6, r0=1.0, bodies=["b"]))
    by = [transition(system, parameters=["b.A2"])["b", "b.A2"] for system in (still, moved)]
    assert np.abs(by[0]).max() > 1e-2
    assert np.abs(by[0] - by[1]).max() < 1e-5 * np.abs(by[0]).max()


@pytest.mark.nightly
def test_a_parameter_that_is_an_orbit_and_no_force_leaves_the_matrix_symplectic_to_round_off():
    stm = transition(bodies(), parameters=["a.gm", "star.gm"], duration=4.0)
    plain = transition(bodies(), duration=4.0)
    assert stm.symplecticity_defect() < 4e-16
    assert np.abs(stm.matrix - plain.matrix).max() < 1e-13 * np.abs(plain.matrix).max()
    assert stm.parameters == ("a.gm", "star.gm")
    assert stm.by_parameters.shape == (18, 2)
    np.testing.assert_array_equal(stm["b", "Star.gm"], stm.by_parameters[12:18, 1])
    assert "18 x 18, and by a.gm, star.gm at" in repr(stm)
    with pytest.raises(UnknownNameError, match=r"body or parameter 'c.gm'"):
        stm["b", "c.gm"]


@pytest.mark.nightly
def test_drag_of_a_single_body_has_the_derivatives_of_the_exponential():
    k, t = 0.5, 4.0
    one = orbits.System(["stone"], [2.0], [[1.0, 0, 0]], [[0.3, -0.2, 0.1]], units=orbits.DIMENSIONLESS)
    found = transition(one.with_forces(Drag(rate=k)), dt=1 / 8, duration=t).matrix
    fall, way = math.exp(-k * t), -math.expm1(-k * t) / k
    expected = np.block([[np.eye(3), way * np.eye(3)], [np.zeros((3, 3)), fall * np.eye(3)]])
    assert np.abs(found - expected).max() < 1e-15


@pytest.mark.nightly
def test_megno_follows_forces():
    """A force that does nothing leaves MEGNO as it is. Free motion lets vectors grow with time; drag of the rate k lets
    them grow to sqrt(1 + 1/k^2) at most.
    """
    options = {"dt": 1 / 32, "duration": 16.0, "samples": 3, "check_step": False}
    none, idle = (orbits.megno(s, GAUSS, **options) for s in (bodies(), bodies().with_forces(Drag(rate=0.0))))
    np.testing.assert_allclose(idle.massive.megno, none.massive.megno, rtol=1e-10)
    stone = orbits.System(["stone"], [2.0], [[1.0, 0, 0]], [[0.3, -0.2, 0.1]], units=orbits.DIMENSIONLESS)
    grown = [
        float(orbits.megno(stone.with_forces(Drag(rate=k)), GAUSS, **options).massive.lyapunov[-1]) * 16.0
        for k in (0.0, 0.5)
    ]
    assert grown[1] < math.log(math.sqrt(5.0)) < 1.5 < grown[0]


@pytest.mark.nightly
def test_a_small_body_in_an_ephemeris_has_derivatives_by_its_force_and_by_masses_with_steps_of_its_own():
    """Apophis before 2029, by differences of eighth order of runs, whose rounding is 1e-10 of what they find."""
    system = orbits.System.in_ephemeris(epoch="2026-01-01", asteroids=0, bodies=["Sun", "Earth", "Jupiter"])
    system = system.add("Apophis", primary="Sun", a=0.9224, e=0.1911, inc=0.0581, M=2.0)
    system = system.with_forces(NonGravitational.yarkovsky(-2.9e-14, bodies=["Apophis"]))
    names, options = ["Apophis.A2", "Jupiter.gm", "Sun.gm", "Earth.J2"], {"dt": None, "duration": 300.0}
    stm = transition(system, parameters=names, **options)
    assert not stm.by_parameters[:18].any()
    d = np.array([1.0, -0.5, 0.2, 0.01, 0.02, -0.01])
    q, v = np.zeros((2, 4, 3))
    q[3], v[3] = d[:3], d[3:]
    start = system.values

    def moved(h):
        return end_of(system.replaced(q=start.q + h * q, v=start.v + h * v), **options)[18:]

    truth = difference(moved, 1e-3)
    assert np.abs(stm["Apophis"] @ d - truth).max() < 1e-9 * np.abs(truth).max()
    for one, h in zip(parameters_of(system, names), (1e-8, 1e-9, 1e-8, 0.1), strict=True):
        truth = difference(lambda x, p=one: end_of(with_values(system, [p], [p.value + x]), **options)[18:], h)
        off = np.abs(stm["Apophis", one.name] - truth).max()
        assert off < 1e-9 * np.abs(truth).max() + 4e-15 / h, one.name


@pytest.mark.nightly
def test_a_particle_depends_on_what_acts_on_it_alone_and_on_others_if_coupled():
    grain = bodies().add("grain", q=[0.8, 1.2, -0.3], v=[-0.7, 0.5, 0.1]).add("other", q=[2, 0, 0], v=[0, 0.6, 0])
    system = grain.with_forces(NonGravitational.yarkovsky(1e-3, r0=1.0, bodies=["grain"]))
    alone = transition(system, coupled=False, parameters=["grain.A2"])
    both = transition(system, parameters=["grain.A2", "a.gm"])
    np.testing.assert_allclose(alone["grain", "grain.A2"], both["grain", "grain.A2"], rtol=1e-12)
    assert not both["other", "grain.A2"].any()
    assert both["other", "a.gm"].any()
    with pytest.raises(InputError, match=r"massive bodies depend on a\.gm.*coupled=True"):
        transition(system, coupled=False, parameters=["a.gm"])
    run = orbits.propagate(system, GAUSS, dt=1 / 64, duration=END, samples=2, check_step=False, progress=False)
    np.testing.assert_array_equal(run.state_transition(parameters=["grain.A2"])["grain", "grain.A2"][0], 0.0)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: transition(full(), orbits.WisdomHolman()), "Tides"),
        (lambda: transition(bodies(), orbits.WisdomHolman(), parameters=["a.gm"]), "by parameters are not known in"),
        (lambda: transition(bodies(), "runge-kutta-4", parameters=["a.gm"]), "of symplectic Runge-Kutta methods alone"),
        (lambda: transition(full(), parameters=["star.J4"]), "not known where it is 0; expected a small value"),
        (lambda: transition(full(), parameters="a.gm"), "expected a list of names"),
    ],
)
def test_what_has_no_known_derivative_is_refused_with_the_reason(make, words):
    with pytest.raises(InputError, match=words):
        make()


@verb
def without_duals(x):
    return (lambda x: x) if isinstance(x, types.Float | LanesType) else None


def of_user(spoilt):
    """A force as users write it, pushing back what is far: with comparisons, absolute values and functions."""

    def force(strength, own, t, q, v, f):
        n = strength.shape[0] - 1
        for i in range(n):
            x, y = get(q, i), get(v, i)
            far = select(abs(x) > 0.5, 0.1 * tanh(x) * abs(x), x * 0.0)
            put(f, i, get(f, i) - strength[1 + i] * (far + 0.01 * y * sqrt(1.0 + y * y)))

    def failing(strength, own, t, q, v, f):
        put(f, 0, get(f, 0) + without_duals(get(q, 0)) * strength[1])

    kernels = {"force": kernel(failing if spoilt else force), "particle_force": kernel(force)}
    name = "spoilt" if spoilt else "walls"
    tag = Tag(f"test of derivatives: {name}", kernels)

    @dataclass(frozen=True)
    class Walls(Force):
        kind = name

        def in_units(self, units):
            return self

        def bound(self, massive, particles, units):
            return BoundForce(name, tag, np.zeros(1))

    return bodies().with_forces(Walls())


@pytest.mark.nightly
def test_a_force_of_a_user_has_derivatives_without_a_line_for_them():
    system, d = of_user(False), np.random.default_rng(3).normal(size=(3, 6))
    q, v = system.values.q, system.values.v
    truth = difference(lambda h: end_of(system.replaced(q=q + h * d[:, :3], v=v + h * d[:, 3:])), 1e-3)
    assert np.abs(transition(system).matrix @ d.ravel() - truth).max() < 1e-11 * np.abs(truth).max()


def test_a_force_whose_kernel_cannot_give_derivatives_is_named():
    with pytest.raises(InputError, match=r"the derivatives of spoilt are not known: .*without_duals\(Dual\)"):
        transition(of_user(True))
