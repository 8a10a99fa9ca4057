"""What is looked at before a run begins: whether its steps resolve what lies ahead. It warns, or refuses the run."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

from orbits.checks import checked_flag
from orbits.errors import InputError
from orbits.finding import Finding
from orbits.integrators.base import Integrator
from orbits.propagation.checks import kepler_splitting, step_check
from orbits.propagation.checks.precision import warn_if_far
from orbits.propagation.checks.rigid_runs import turning_fast

if TYPE_CHECKING:
    from orbits.system import System
    from orbits.time_grid import TimeGrid

REFUSE = "refuse"


def checked_answer(check_step: Any) -> bool | str:
    """Return True, False or "refuse" as it was given. Raises InputError for anything else."""
    if isinstance(check_step, str) and check_step == REFUSE:
        return check_step
    return checked_flag(check_step, "check_step", f"True (warn), False or {REFUSE!r}")


def check_bodies(system: System, integrator: Integrator) -> None:
    """Raise InputError, naming them, for bodies and terms that a method on Kepler orbits cannot take."""
    if integrator.follows_kepler:
        kepler_splitting.require_outside(system)
        kepler_splitting.require_terms_of_dominant(system, integrator)


def check_span(system: System, grid: TimeGrid) -> None:
    """Raise EpochError, naming the term, if one does not describe the motion until the end of a run."""
    for term in system.terms:
        term.check_span(grid.end, system.units)


def check_before_start(system: System, integrator: Integrator, grid: TimeGrid, check_step: Any) -> None:
    """Warn of what the steps of a run do not resolve, or refuse the run, or do neither, as `check_step` says.

    Raises InputError for another `check_step`, and with "refuse" for all that is a `StepWarning` with True.
    """
    if checked_answer(check_step):
        warn_if_far(system, grid.end)
    check_span(system, grid)
    warn_or_refuse(found_ahead(system, integrator, grid), check_step)


def found_ahead(system: System, integrator: Integrator, grid: TimeGrid) -> Iterator[Finding]:
    """Find what steps of one length do not resolve."""
    if not grid.clock.changes:
        look = kepler_splitting.unfit if integrator.follows_kepler else step_check.too_long
        yield from look(system, integrator, grid.h, grid.end)
        yield from turning_fast(system, grid.h)


def warn_or_refuse(found: Iterable[Finding], check_step: Any) -> None:
    """Warn of what is found, if `check_step` is True; with "refuse" raise InputError with all of it."""
    answer = checked_answer(check_step)
    if answer == REFUSE:
        if texts := [str(finding) for finding in found]:
            raise InputError("\n".join([*texts, f"This is refused by check_step={REFUSE!r}."]))
    elif answer:
        for finding in found:
            finding.warn()
