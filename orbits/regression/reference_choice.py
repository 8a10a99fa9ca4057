"""Which reference solution a comparison takes, and its positions."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbits.errors import InputError, IntegrationError, shown
from orbits.point_masses import PointMasses
from orbits.regression import reference as solutions
from orbits.regression.problem import Problem
from orbits.regression.report import ReferenceNote
from orbits.regression.stages import Stages
from orbits.system import System
from orbits.time_grid import TimeGrid, dynamical_time_of

Array = NDArray[np.float64]

EXACT_SOLVES = 200_000
"""With reference="auto", the exact solution is used up to this many bodies times samples (up to a minute)."""

SERIES_STEPS, SERIES_SECONDS = 3.5, 6e-6
"""Steps of a Taylor series in a dynamical time, and seconds for a pair and a step of both series: roughly."""

AFFORDABLE = 60.0
"""With reference="auto", a Taylor series is computed if it takes at most about so many seconds."""

_REFERENCES = ("auto", "exact", "converged", "taylor", "none")
_BLIND = (
    "The reference solution is collocation with the same forces as ours, so it cannot reveal errors common to both. "
    "Peers share no code with it."
)


def kind_of_reference(system: System, reference: Any, problem: Problem, grid: TimeGrid) -> str | float:
    """Return the kind of reference solution: "exact", "taylor", "none", "too long" for a series that takes long, or the
    step of the converged runs.

    reference : as in `orbits.compare`. Raises InputError for anything else, and for one that does not apply.
    """
    if not isinstance(reference, str):
        return grid.with_step(system, reference, "reference").dt
    if reference == "step-halved":
        raise InputError("reference='step-halved' is called 'converged' now, and its two runs differ in their stages.")
    if reference not in _REFERENCES:
        raise InputError(f"reference is {shown(reference)}; expected {', '.join(_REFERENCES)} or a step (a time).")
    exact = solutions.exact_applies(problem.start)
    if reference == "exact" and not exact:
        raise InputError(
            "reference='exact' needs one massive body with massless ones, or two massive bodies alone, without "
            "softening; this system has no exact solution. Use 'auto' or 'converged'."
        )
    affordable = len(problem.names) * len(grid.times) <= EXACT_SOLVES
    if reference == "exact" or (reference == "auto" and exact and affordable):
        return "exact"
    if reference == "auto" and grid.clock.changes:
        return "taylor" if _seconds_of_series(problem.start, grid) <= AFFORDABLE else "too long"
    if reference in ("none", "taylor"):
        return reference
    if grid.clock.changes:
        raise InputError(
            "reference='converged' has half of dt as its step, and there is no dt; give its step (a time), or 'taylor'."
        )
    return solutions.power_of_two(grid.dt / 2)


def _seconds_of_series(start: PointMasses, grid: TimeGrid) -> float:
    """Return roughly how long the two Taylor series take, by the dynamical time at the start."""
    massive = int(np.count_nonzero(start.massive))
    pairs = massive * (len(start.gm) - massive) + massive * (massive - 1) / 2
    return SERIES_STEPS * abs(grid.end) / dynamical_time_of(start) * (pairs + 10) * SERIES_SECONDS


def reference_positions(
    system: System, problem: Problem, grid: TimeGrid, kind: str | float, threads: int | None, stages: Stages
) -> tuple[Array | None, ReferenceNote | None, tuple[str, ...]]:
    """Return reference positions (samples, bodies, 3), the note about them, and remarks if there are none."""
    if kind == "none":
        return None, None, ("No reference solution: positions are not measured.",)
    if kind == "too long":
        minutes = f"{_seconds_of_series(problem.start, grid) / 60:.2g} minutes"
        told = f"No reference solution: it would take about {minutes}; reference='taylor' computes it nevertheless."
        return None, None, (told,)
    try:
        if kind == "exact":
            made = solutions.exact(problem.start, grid.times, stages)
        elif kind == "taylor":
            made = solutions.series(problem.start, grid.times, stages)
        else:
            made = solutions.converged(system, grid.with_step(system, float(kind)), threads, stages)
    except IntegrationError as error:
        return None, None, (f"The reference solution failed, so positions are not measured: {error}",)
    errors = dict(zip(problem.names, (made.error * problem.length).tolist(), strict=True))
    return made.q, ReferenceNote(made.kind, made.description, errors), (_BLIND,) if made.kind == "converged" else ()
