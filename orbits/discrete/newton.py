"""Newton's method, run to the round-off floor."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from orbits.discrete.base import Array
from orbits.errors import ConvergenceError, InputError, IntegrationError
from orbits.lagrangians.base import show

ROUNDS = 60
HALVINGS = 12
NEAR = 1e-7
"""A change below this, relative to the unknowns, is rounding noise once it has stopped shrinking."""


def solve(
    equations: Callable[[Array], tuple[Array, Callable[[Array], Array]]],
    x: Array,
    *,
    scale: float,
    failure: str,
    step: int = -1,
    time: float = float("nan"),
) -> Array:
    """Return x with r(x) = 0, to the round-off floor.

    equations : x -> (r, right -> the solution y of J y = right), J the derivative of r at x
    scale : size of the unknowns; changes below `NEAR` times this may be rounding noise
    failure : beginning of the message if the iteration does not settle; the state and the reason are added
    Changes that increase the residual, or leave the domain, are halved. Raises ConvergenceError.
    """
    x = x.copy()
    residual, solved = _evaluated(equations, x, failure, step, time)
    least, last, best = float(np.max(np.abs(residual))), np.inf, x.copy()
    for _ in range(ROUNDS):
        if least == 0.0:
            return best
        try:
            change = solved(-residual)
        except np.linalg.LinAlgError:
            raise ConvergenceError(
                _message(failure, "its matrix is singular", x, residual), step=step, time=time
            ) from None
        size = float(np.max(np.abs(change)))
        if not np.isfinite(size):
            raise ConvergenceError(_message(failure, "its matrix is singular", x, residual), step=step, time=time)
        near = size <= NEAR * scale
        if near and (size == 0.0 or size >= 0.5 * last):
            return best
        last = size
        shorter = 1.0
        for _ in range(HALVINGS):
            trial = x + shorter * change
            try:
                new_residual, new_solved = equations(trial)
                norm = float(np.max(np.abs(new_residual)))
            except (IntegrationError, InputError):
                norm = np.inf
            if norm < least or near:
                break
            shorter *= 0.5
        else:
            raise ConvergenceError(
                _message(failure, "no part of its change reduces the residual", x, residual), step=step, time=time
            )
        if not np.isfinite(norm):
            return best
        x, residual, solved = trial, new_residual, new_solved
        if norm < least:
            least, best = norm, x.copy()
        elif near:
            return best
    raise ConvergenceError(
        _message(failure, f"it does not settle in {ROUNDS} rounds", x, residual), step=step, time=time
    )


def _evaluated(
    equations: Callable[[Array], tuple[Array, Callable[[Array], Array]]], x: Array, failure: str, step: int, time: float
) -> tuple[Array, Callable[[Array], Array]]:
    try:
        return equations(x)
    except IntegrationError as error:
        raise ConvergenceError(
            f"{failure}: the first guess {show(x)} cannot be used ({error}). Use a smaller h or a better guess.",
            step=step,
            time=time,
        ) from error


def _message(failure: str, reason: str, x: Array, residual: Array) -> str:
    return (
        f"{failure}: Newton's method fails, {reason}; it stopped at {show(x)} with a residual of "
        f"{float(np.max(np.abs(residual))):.3g}. Use a smaller h or a better guess."
    )
