"""Marches of Lagrangians on R^d: recording, the times of force evaluations, and marches that end early."""

import numpy as np
import pytest
import sympy

import orbits
from orbits.errors import ConvergenceError, InputError, IntegrationError, SingularityError
from orbits.lagrangians.base import SEPARABLE
from orbits.marching.flow import Flow
from orbits.methods import ExplicitEuler, LobattoIIIAB, LobattoIIIBA, RungeKutta4, SymplecticEuler

from ..coverings import at, each, first

q, v, x, y, vx, vy = sympy.symbols("q v x y vx vy")

IMPLICIT = [orbits.Gauss(stages=2), LobattoIIIAB(stages=3), SymplecticEuler()]
EXPLICIT = [orbits.StormerVerlet(), RungeKutta4(), ExplicitEuler()]


@pytest.fixture(scope="module")
def runaway():
    """A force that grows with the fifth power: it overflows after a few steps."""
    return orbits.Lagrangian.from_sympy(v**2 / 2 + q**6 / 6, q=[q], v=[v], name="runaway")


@pytest.mark.parametrize("every", at((1,), [1, 3]))
@pytest.mark.parametrize("method", at((5,), [*IMPLICIT, *EXPLICIT]), ids=lambda m: m.label)
def test_an_error_names_the_first_step_that_cannot_be_taken_and_keeps_what_was_before(runaway, method, every):
    def march(steps, every=1):
        return orbits.march(runaway, method, dt=0.5, steps=steps, every=every, q=[1.0], v=[0.0])

    with pytest.raises(IntegrationError, match=r"'runaway', step \d+ .*Use a smaller dt") as caught:
        march(60, every)
    step, path = caught.value.step, caught.value.trajectory
    assert f"step {step + 1} " in str(caught.value)
    assert caught.value.time == 0.5 * step
    assert len(path) == step // every + 1
    assert np.isfinite(path.q).all()
    assert np.isfinite(path.p).all()
    if step:
        whole = march(step)  # so far it goes
        assert np.array_equal(path.q, whole.q[::every][: len(path)])
        assert np.array_equal(path.p, whole.p[::every][: len(path)])
    with pytest.raises(IntegrationError) as again:
        march(step + 1)
    assert again.value.step == step


@pytest.mark.nightly
@pytest.mark.parametrize("method", first(1, IMPLICIT), ids=lambda m: m.label)
def test_a_mass_matrix_that_loses_its_inverse_on_the_way_is_an_error_with_the_step(method):
    """x moves by 1/8 in each step, exactly; at x = 1, after eight steps, y has no kinetic energy."""
    L = orbits.Lagrangian.from_sympy(vx**2 / 2 + (x - 1) ** 2 * vy**2 / 2, q=[x, y], v=[vx, vy], name="vanishing")
    with pytest.raises(SingularityError, match=r"step 9 .* q = \[1., 0.\].*no inverse.*regular there") as caught:
        orbits.march(L, method, dt=0.5, steps=20, q=[0.0, 0.0], v=[0.25, 0.0])
    assert caught.value.step == 8
    assert caught.value.trajectory.q[:, 0].tolist() == [k / 8 for k in range(9)]


@pytest.mark.parametrize("canonical", first(1, [False, True]))
def test_a_step_of_any_length_gives_a_result_or_an_error(canonical):
    L = orbits.lagrangians.kepler
    flow = Flow(L, orbits.Gauss(stages=4), 50.0, canonical=canonical)
    try:
        q, p = flow.step([0.7, 0.2], [-0.3, 1.2])
    except ConvergenceError as error:
        q, p = error.trajectory.q, error.trajectory.p
    assert np.isfinite([q, p]).all()


@pytest.mark.parametrize("method", [*IMPLICIT, *EXPLICIT], ids=lambda m: m.label)
def test_marches_are_repeatable_and_recording_changes_no_bit(method):
    flow = Flow(orbits.lagrangians.kepler, method, 0.05)
    start = [0.7, 0.2], [-0.3, 1.2]
    all_of_them = flow.march(*start, 24)
    thinned = flow.march(*start, 24, every=4)
    assert np.array_equal(thinned.q, all_of_them.q[::4])
    assert np.array_equal(thinned.p, all_of_them.p[::4])
    assert np.array_equal(thinned.t, all_of_them.t[::4])
    end = flow.step(*start, 24)
    assert np.array_equal(end[0], all_of_them.q[-1])
    assert np.array_equal(end[1], all_of_them.p[-1])


@pytest.mark.parametrize(
    ("method", "steps"),
    [
        (SymplecticEuler(variant="kick-drift"), 160),
        (SymplecticEuler(variant="drift-kick"), 160),
        (LobattoIIIAB(stages=2), 20),
        (LobattoIIIBA(stages=3), 10),
        (orbits.Gauss(stages=3), 4),
    ],
    ids=lambda m: getattr(m, "label", None),
)
def test_forces_that_depend_on_time_are_taken_at_the_times_of_the_stages(method, steps):
    """The order holds with a driven pendulum too, started late; a wrong time would leave order 1 at most."""
    L = orbits.lagrangians.driven_pendulum
    span, t0 = 2.0, 0.7
    start = {"q": [1.1], "v": [0.4], "t": t0}
    truth = orbits.march(L, orbits.Gauss(stages=8), dt=span / 16, steps=16, **start).q[-1]
    errors = [
        np.abs(orbits.march(L, method, dt=span / n, steps=n, **start).q[-1] - truth).max() for n in (steps, 2 * steps)
    ]
    # The next term of the error is a few percent of the first at these steps.
    assert np.log2(errors[0] / errors[1]) == pytest.approx(method.order, abs=0.2)
    if method.order == 1:
        late = {**start, "t": t0 + 0.1}
        moved = orbits.march(L, orbits.Gauss(stages=8), dt=span / 16, steps=16, **late).q[-1]
        assert np.abs(moved - truth).max() > 0.01  # the time of the start matters


@pytest.mark.nightly
def test_a_term_linear_in_the_velocity_moves_the_momenta_and_nothing_else():
    """L + 3 v = L + d(3 q)/dt has the same motions with p + 3: momenta are dL/dv in every form of the march."""
    plain = orbits.lagrangians.harmonic_oscillator.with_parameters(m=1.0, k=1.0)
    gauged = orbits.Lagrangian.from_sympy(v**2 / 2 + 3 * v - q**2 / 2, q=[q], v=[v], name="gauged oscillator")
    assert SEPARABLE not in gauged.traits
    for method in IMPLICIT:
        a = orbits.march(plain, method, dt=0.1, steps=30, q=[1.0], v=[0.5])
        b = orbits.march(gauged, method, dt=0.1, steps=30, q=[1.0], v=[0.5])
        # 30 roundings of p + 3; 1.8e-15 was reached.
        assert np.abs(a.q - b.q).max() < 5e-15
        assert np.abs(a.p + 3.0 - b.p).max() < 5e-15
        assert np.abs(a.v - b.v).max() < 5e-15
    with pytest.raises(InputError, match="separable"):
        orbits.march(gauged, orbits.StormerVerlet(), dt=0.1, steps=1, q=[1.0], v=[0.5])


PENDULUM, GAUSS = orbits.lagrangians.pendulum, orbits.Gauss()
START = {"q": [1.0], "v": [0.0]}
WRONG = {
    "dt as text": ({"dt": "0.1"}, "dt must be a real number, got '0.1'"),
    "complex dt": ({"dt": 0.1j}, "dt must be a real number"),
    "complex dt of NumPy": ({"dt": np.complex128(0.1 + 1j)}, "dt must be a real number"),
    "no dt": ({"dt": None}, "dt must be a real number"),
    "dt beyond floats": ({"dt": 10**400}, "dt must be a real number"),
    "infinite dt": ({"dt": float("-inf")}, "dt must be finite"),
    "zero dt": ({"dt": 0}, "dt must be finite and not zero, got 0"),
    "t as text": ({"t": "0"}, "t must be a real number"),
    "infinite t": ({"t": float("nan")}, "t must be finite"),
    "no steps": ({"steps": 0}, "steps must be a whole number >= 1, got 0"),
    "negative steps": ({"steps": -3}, "steps must be a whole number >= 1"),
    "a fraction of a step": ({"steps": 2.5}, "steps must be a whole number >= 1"),
    "yes": ({"steps": True}, "steps must be a whole number >= 1"),
    "every": ({"every": 0}, "every must be a whole number >= 1"),
    "both v and p": ({"p": [0.0]}, "needs q and either v or p; got both"),
    "v alone": ({"q": None}, "needs q together with v or p"),
    "a matrix": ({"q": [[1.0, 2.0]]}, r"has 1 coordinate \(q\); got q of shape \(1, 2\)"),
    "infinite v": ({"v": [np.inf]}, "v must be finite"),
    "complex v": ({"v": [1j]}, "v must be 1 real numbers"),
    "q as text": ({"q": ["1"]}, "q must be 1 real numbers"),
}


@each("case", WRONG)
def test_a_start_or_step_that_makes_no_sense_is_refused(case):
    changes, message = WRONG[case]
    with pytest.raises(InputError, match=message):
        orbits.march(PENDULUM, GAUSS, **{"dt": 0.1, "steps": 3, **START, **changes})


def test_a_path_shows_itself_in_one_line_without_its_numbers():
    path = orbits.march(orbits.lagrangians.kepler, orbits.Gauss(stages=2), dt=0.05, steps=1000, every=10)
    assert repr(path) == "DiscretePath(kepler, 101 samples, t = 0 ... 50; Gauss(stages=2), dt = 0.05)"
