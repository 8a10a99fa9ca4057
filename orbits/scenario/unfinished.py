"""Unfinished runs in a results folder: the same run goes on; another one is not replaced, as it would be lost."""

from __future__ import annotations

import fcntl
import os
import shlex
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from orbits import errors
from orbits.errors import ArchiveError, InputError, IntegrationError, OrbitsError, with_unit
from orbits.option_values import option_text
from orbits.scenario.definition import Scenario
from orbits.scenario.files import replaceable

if TYPE_CHECKING:
    from orbits.archive import Archive
    from orbits.archive.ended import Ended
    from orbits.integrators.base import Integrator
    from orbits.system import System
    from orbits.time_grid import TimeGrid

UNFINISHED, COMPLETE = "unfinished", "complete"


@contextmanager
def alone_in(folder: Path) -> Iterator[None]:
    """Keep other processes from running scenarios in a folder, by a lock of the folder itself, which leaves no file
    behind. Raises InputError if one does so already, or if the folder cannot be read.
    """
    try:
        descriptor = os.open(folder, os.O_RDONLY)
    except OSError as error:
        raise InputError(
            f"the folder {folder} cannot be read ({error.strerror}); give another one with --out."
        ) from None
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise InputError(
                f"another process runs a scenario in {folder}; wait for it, or give another folder with --out."
            ) from None
        except OSError:  # a file system without locks: those of the archives are left
            pass
        yield
    finally:
        os.close(descriptor)


def looked_at(scenario: Scenario, method: Integrator, system: System, grid: TimeGrid, path: Path) -> str:
    """Return what `path` has of the same run by `method`, to the last bit: `UNFINISHED`, `COMPLETE`, or "" for nothing.

    Raises InputError if it has another run that is not complete, one that another process is writing, or one that
    cannot be read: it would be lost. A run that its method could not continue may be replaced.
    """
    from orbits.archive import Archive

    if not replaceable(path).exists():
        return ""
    elsewhere = "give another folder with --out, or remove the file."
    try:
        with Archive.open(path) as old:
            if old.writer is not None:
                who = f"process {old.writer}" if old.writer > 0 else "another process"
                raise InputError(f"{path} is being written by {who}; wait for it, or give another folder with --out.")
            complete, failed = old.complete, _failed(old.ended)
            found, changes = _differences(old, scenario, method, system, grid), _changes(old)
    except ArchiveError as error:
        raise InputError(f"{error} It is not replaced: {elsewhere}") from None
    if not (found or changes):
        return COMPLETE if complete else UNFINISHED
    if complete or failed:
        return ""
    told = "; ".join([*found, changes] if changes else found)
    how = f"orbits resume {shlex.quote(str(path))}" + " --any-bits" * bool(changes)
    raise InputError(
        f"{path} has an unfinished run that is not this one: {told}. To complete it: {how}. Otherwise {elsewhere}"
    )


def _failed(ended: Ended) -> bool:
    """Return whether a run was ended by its own equations, not by a full disk or an exception of the user."""
    from orbits.archive.ended import FAILED

    kind = getattr(errors, ended.why.partition(":")[0], None)
    return ended.how == FAILED and isinstance(kind, type) and issubclass(kind, IntegrationError)


def _differences(old: Archive, scenario: Scenario, now: Integrator, system: System, grid: TimeGrid) -> list[str]:
    """Return in words what is different in the run of an archive from this one."""
    from orbits import integrators
    from orbits.propagation.marchers import looks_for_approaches

    found = []
    its, mine = old.origin, scenario.origin()
    if its is not None and mine is not None and its.scenario == mine.scenario:
        if its != mine:
            found.append(_other_options(its.options, mine.options))
    elif its is not None:
        found.append(f"it was made by the scenario {its}")
    elif mine is not None:
        found.append("it was made without options")
    try:
        before = integrators.build(dict(old.integrator))
    except OrbitsError:
        found.append(f"it has a method that is not known here, {old.integrator['name']}")
        before = None
    if before not in (None, now):
        found.append(f"it has {before.label}, this one {now.label}")
    if old.system.units != system.units:
        found.append("it has other units")
    else:
        if old.grid.clock != grid.clock and before is not None:
            found.append(f"it has {_steps(old.grid, before, system)}, this one {_steps(grid, now, system)}")
        if old.grid.end != grid.end:
            rounded = f"{old.grid.end:g}", f"{grid.end:g}"
            its_end, end = rounded if rounded[0] != rounded[1] else (repr(old.grid.end), repr(grid.end))
            unit = system.units.time
            found.append(f"it ends at t = {with_unit(its_end, unit)}, this one at {with_unit(end, unit)}")
        elif not found and not old.grid.is_that_of(grid):
            many = f"{len(old.grid):,} samples, this one {len(grid):,}"
            found.append("it has samples at other times" if len(old.grid) == len(grid) else f"it has {many}")
        if not found and old.system != system:
            found.append("it has other bodies, states or forces")
    if looks_for_approaches(scenario.approaches, now, system) and not old.approaches:
        found.append("it looks for no closest approaches, and this one does")
    if old.events_text or old.steps is not None:
        found.append("it was made by orbits.propagate, with " + ("events" if old.events_text else "dense output"))
    return found


def _changes(old: Archive) -> str:
    """Return in words what the last bits of a run depend on that has changed since; "" for nothing."""
    from orbits.propagation.marchers import differences

    changed = ", ".join(differences(old.provenance))
    return f"it was made with a different {changed}; its last bits may come out differently here" if changed else ""


def _other_options(its: Mapping[str, object], mine: Mapping[str, object]) -> str:
    """Return the options that differ in words: "it has a=2.0 and no b, this one a=1.0 and b=yes"."""
    names = [name for name in {**its, **mine} if name not in its or name not in mine or its[name] != mine[name]]
    both = (" and ".join(_given(options, name) for name in names) for options in (its, mine))
    return "it has {}, this one {}".format(*both)


def _given(options: Mapping[str, object], name: str) -> str:
    return f"no {name}" if name not in options else f"{name}={option_text(options[name]) or repr('')}"


def _steps(grid: TimeGrid, method: Integrator, system: System) -> str:
    return grid.clock.describe(method, system.units.time) + " backwards" * (grid.direction < 0.0)
