"""Steps so long that a fixed point diverges or stalls: solved to the floor by Newton's method, or refused."""

import numpy as np
import pytest

import orbits
from orbits.marching.flow import Flow

from ..coverings import at

PENDULUM = orbits.lagrangians.pendulum


def test_newtons_method_takes_over_where_the_fixed_point_diverges():
    """A stiff oscillator, h omega = 100: Gauss with two stages against its rational map in closed form."""
    stiff = orbits.lagrangians.harmonic_oscillator.with_parameters(k=1e4, m=1.0)
    end = Flow(stiff, orbits.Gauss(stages=2), 1.0, canonical=True).step([1.0], [0.3], 3)
    z = np.array([[0.0, 1.0], [-1e4, 0.0]])
    one = np.eye(2)
    step = np.linalg.solve(one - z / 2 + z @ z / 12, one + z / 2 + z @ z / 12)
    exact = step @ step @ step @ np.array([1.0, 0.3])
    # The condition of the step is 100: 1.5e-14 was reached.
    assert abs(end[0][0] - exact[0]) < 1e-12
    assert abs(end[1][0] - exact[1]) < 1e-10
    # By itself the march goes over to the form that has Newton's method: the same bits.
    assert Flow(stiff, orbits.Gauss(stages=2), 1.0).step([1.0], [0.3], 3)[0][0] == end[0][0]


def worst_miss(L, method, dt, q, p, steps=60, *, canonical=False):
    """The largest difference of compiled steps along a march from plain solutions of the same equations."""
    from orbits.diagnostics.tangent import plain_step

    path = Flow(L, method, dt, canonical=canonical).march(q, p, steps)
    misses = []
    for k in range(steps):
        plain = plain_step(L, method.tableau, path.q[k], path.p[k], dt)
        size = max(np.abs(path.p).max(), 1.0)
        misses.append(max(np.abs(path.q[k + 1] - plain.q).max(), np.abs(path.p[k + 1] - plain.p).max() / size))
    return max(misses)


@pytest.mark.nightly
@pytest.mark.parametrize("canonical", [False, True])
@pytest.mark.parametrize(("g", "stages"), at((0, 3), [(500.0, 2), (1800.0, 4), (2000.0, 4), (2200.0, 6)]))
def test_steps_so_long_that_iterations_stall_are_solved_to_the_floor_or_refused(g, stages, canonical):
    """A stiff pendulum, h omega = 2 to 5: the change falls unevenly, and a stall is not an end."""
    stiff = PENDULUM.with_parameters(g=g)
    try:
        miss = worst_miss(stiff, orbits.Gauss(stages=stages), 0.1, [1.0], [0.5], canonical=canonical)
    except orbits.errors.ConvergenceError:
        return
    # Rounding of forces of size g; stalled iterations used to pass with 1e-10 to 1e-6.
    assert miss < 1e-13


def test_what_the_fast_form_cannot_iterate_newtons_method_solves():
    stiff = orbits.lagrangians.harmonic_oscillator.with_parameters(k=1e4, m=1.0)
    assert worst_miss(stiff, orbits.Gauss(stages=4), 0.1, [1.0], [0.3], steps=20) < 1e-13
    borderline = orbits.lagrangians.harmonic_oscillator.with_parameters(k=1500.0, m=1.0)
    assert worst_miss(borderline, orbits.Gauss(stages=4), 0.1, [1.0], [0.3], steps=20) < 1e-13
