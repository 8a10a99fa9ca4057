"""Unfinished runs in a results folder: the same run goes on; another one is not replaced, as it would be lost."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from orbits.errors import ArchiveError, InputError, with_unit
from orbits.option_values import options_text
from orbits.scenario.definition import Scenario

if TYPE_CHECKING:
    from orbits.archive import Archive
    from orbits.integrators.base import Integrator
    from orbits.system import System
    from orbits.time_grid import TimeGrid


def is_this_one(scenario: Scenario, system: System, grid: TimeGrid, path: Path) -> bool:
    """Return whether `path` has this same run, not complete, so that going on gives the bits of an uninterrupted
    run.
    """
    from orbits.archive import Archive

    try:
        with Archive.open(path) as old:
            return not (old.complete or _differences(old, scenario, system, grid))
    except ArchiveError:
        return False


def refuse_another(scenario: Scenario, system: System, grid: TimeGrid, path: Path) -> None:
    """Raise InputError if `path` has another run that is not complete, which would be lost, or one that another process
    is writing. A run that failed may be replaced.
    """
    from orbits.archive import Archive
    from orbits.archive.ended import FAILED

    try:
        with Archive.open(path) as old:
            if old.writer is not None:
                who = f"process {old.writer}" if old.writer > 0 else "another process"
                raise InputError(f"{path} is being written by {who}; wait for it, or give another folder with --out.")
            found = [] if old.complete or old.ended.how == FAILED else _differences(old, scenario, system, grid)
    except ArchiveError:
        return
    if found:
        raise InputError(
            f"{path} has an unfinished run with {', '.join(found)}. Complete it with: orbits resume {path}; or give "
            "another folder with --out, or remove the file."
        )


def _differences(old: Archive, scenario: Scenario, system: System, grid: TimeGrid) -> list[str]:
    """Return in words what is different in an archive, and in what it depends on, from this run."""
    from orbits import integrators
    from orbits.propagation.marchers import differences

    found = []
    its, mine = old.origin, scenario.origin()
    if its is not None and its != mine:
        same = mine is not None and its.scenario == mine.scenario
        options = "" if mine is None else f"{options_text(its.options)}, instead of {options_text(mine.options)}"
        found.append(f"other options: {options}" if same else f"another scenario: {its}")
    before, now = integrators.build(dict(old.integrator)), scenario.integrators[0]
    if before != now:
        found.append(_other("method", before.label, now.label))
    if old.grid.clock != grid.clock:
        found.append(_other("steps", _steps(old.grid, before, system), _steps(grid, now, system)))
    if old.grid.end != grid.end:
        found.append(_other("end", *(with_unit(f"{one.end:g}", system.units.time) for one in (old.grid, grid))))
    elif not found and not old.grid.is_that_of(grid):
        found.append(_other("samples", f"{len(old.grid):,}", f"{len(grid):,}"))
    if not found and old.system != system:
        found.append("other bodies or states")
    return found or [f"other last bits, for {change}" for change in differences(old.provenance)]


def _other(what: str, its: str, mine: str) -> str:
    return f"other {what}: {its} instead of {mine}" if its != mine else f"other {what}"


def _steps(grid: TimeGrid, method: Integrator, system: System) -> str:
    from orbits.marching.changing import ChangingSteps

    if isinstance(grid.clock, ChangingSteps):
        return grid.clock.describe(method)
    return f"dt = {with_unit(f'{grid.dt:g}', system.units.time)}"
