"""The order of a method and of its discrete Lagrangian, as slopes of errors over the length of the step."""

from __future__ import annotations

import math

import numpy as np

from orbits.certificate.measuring import EPS, Problem
from orbits.diagnostics.convergence import Slope, slope
from orbits.errors import InputError, IntegrationError
from orbits.marching.flow import Flow


def order_of_map(problem: Problem) -> Slope:
    """Return the slope of the error of q after a given time, against short steps of Gauss collocation of order 16.

    The time is 40 steps, or longer for high orders whose errors would otherwise vanish in round-off.
    """
    found = _order_over(problem, 40)
    for steps in (320, 2560) if problem.integrator.order > 8 else ():
        if math.isnan(found.order):
            longer = _order_over(problem, steps)
            # Over long times chaos amplifies round-off into the fit: only a slope near the order is accepted.
            found = longer if longer.order > 0.5 * problem.integrator.order else found
    return found


def _order_over(problem: Problem, steps: int) -> Slope:
    span = steps * problem.dt
    try:
        q = problem.reference(steps)
    except IntegrationError:
        return Slope(math.nan, (), ())
    h, errors = [], []
    for count in _counts(problem.integrator.order):
        try:
            flow = Flow(problem.lagrangian, problem.integrator, span / count, t=problem.t)
            x, _ = flow.step(problem.q, problem.p, count)
        except IntegrationError:
            continue  # the step is far too long
        h.append(abs(span) / count)
        errors.append(float(np.max(np.abs(x - q) * problem.weights)) / problem.size)
    return slope(h, errors, floor=_plateau(3e-13, errors), ceiling=2e-3)


def order_of_discrete_lagrangian(problem: Problem) -> Slope:
    """Return the slope of |L_d - exact L_d| along a true solution, less 1."""
    L_d = problem.discrete_lagrangian
    h, errors = [], []
    scale = problem.momentum_size * problem.size
    starts = [0, len(problem.path) // 5, len(problem.path) // 2]  # at a single one, the leading term may vanish
    for factor in 2.0 ** np.arange(5.0, -6.0, -0.5 if problem.integrator.order > 6 else -1.0):
        step, worst, rounding = factor * problem.dt, 0.0, 0.0
        try:
            for k in starts:
                q, t = problem.path.q[k], float(problem.path.t[k])
                action, end = problem.true_action(q, problem.path.p[k], step, t)
                worst = max(worst, abs(L_d.value(q, end, step, t) - action) / scale)
                rounding = max(rounding, EPS * abs(action) / scale)
        except (IntegrationError, InputError):
            continue  # the step is far too long
        if 0.0 < worst < 10.0 * rounding:
            continue  # a constant in L, such as the weight of a bob, rounds to more than that of a small motion
        h.append(abs(step))
        errors.append(worst)
        if max(errors[-2:]) < 3e-15:
            break  # shorter steps show nothing but round-off
    most = 3 if problem.integrator.order >= 6 else 5  # high orders pass their regime within a factor of two
    fitted = slope(h, errors, floor=_plateau(3e-14, errors), ceiling=1e-3, most=most)
    return Slope(fitted.order - 1.0, fitted.h, fitted.errors)


def _counts(order: int) -> list[int]:
    """Return the numbers of steps to try: high orders pass from 1e-3 to round-off within a factor of a few."""
    if order >= 8:
        return list(range(2, 81, 2))
    longest = {1: 26, 2: 26, 3: 18, 4: 18}.get(order, 8)
    return sorted({round(10 * 2 ** (k / 2)) for k in range(longest)} | {4, 6, 8})


def _plateau(least: float, errors: list[float]) -> float:
    """Return where round-off begins: well above the smallest error of all, as the motion may amplify it."""
    lowest = min((e for e in errors if math.isfinite(e)), default=0.0)
    return max(least, 30.0 * lowest) if lowest < 1e-11 else least
