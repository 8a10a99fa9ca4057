"""The work on one block, the same in a thread, in a process and on a worker of a cluster."""

from __future__ import annotations

import hashlib
import math
import os
import tempfile
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from inspect import GEN_CREATED, getgeneratorstate
from pathlib import Path
from typing import Any

import numpy as np

from orbits.ensemble.members import Ensemble
from orbits.ensemble.summaries import LOST, STOPPED, SURVIVED, Columns, of_particles, of_systems, units_of_table
from orbits.errors import InputError, IntegrationError, Interrupted, OrbitsError, RetiredWarning, StorageError
from orbits.finding import kind_of
from orbits.integrators.base import Integrator
from orbits.propagation import propagate
from orbits.propagation.control.signals import StopRequest
from orbits.propagation.control.stop_conditions import Conditions
from orbits.propagation.loop import Run, marching, to_its_end
from orbits.propagation.making_runs import RunOptions, begun, resumed
from orbits.propagation.marchers import provenance
from orbits.propagation.systems import march_in_threads
from orbits.propagation.variations.megno import megno
from orbits.system import System
from orbits.time_grid import TimeGrid
from orbits.trajectory import Trajectory

DONE, FAILED, INTERRUPTED, REFUSED = "done", "failed", "interrupted", "refused"

WARM_STEPS = 3
"""The steps for which a sample is integrated so that kernels are compiled."""

Said = tuple[str, str, str]
"""The category, the text and the kind of a warning."""

SLAB = 16
"""The samples that are read at once."""

_ALONE = threading.Lock()
"""Held while warnings are collected, which concerns all threads of a process."""


@dataclass(frozen=True)
class Task:
    """A block: what is integrated, and how. Picklable.

    number : of the block;  stem : of its file or folder in the store
    part : its members;  options : of `propagate`;  megno : options of `orbits.megno`, or None
    trajectories : whether samples are kept
    made_by : the provenance on which bits depend; a worker with another one refuses the block. Empty for any
    unfinished : the archives of a block that was interrupted elsewhere, by name
    run : distinguishes the runs of a process
    units, bodies : of the table, as in `campaign.json`; a system in other units is a failure
    """

    number: int
    stem: str
    part: Ensemble
    integrator: Integrator
    options: Mapping[str, Any]
    megno: Mapping[str, Any] | None
    trajectories: bool
    made_by: Mapping[str, str] = field(default_factory=dict)
    unfinished: Mapping[str, bytes] = field(default_factory=dict)
    run: str = ""
    units: Mapping[str, str] = field(default_factory=dict)
    bodies: Sequence[str] = ()


@dataclass
class Outcome:
    """What became of a block.

    state : done, failed (with its reason), interrupted by a request to stop, or refused by a worker of other versions
    columns : of the table, (members,) each;  bits : a hash of all its samples and columns
    files : size and SHA-256 of the files in the store, by name;  data : their bytes, if they are not there yet
    warnings : category, text and kind of each;  seconds : of work;  worker : where
    """

    number: int
    state: str
    reason: str = ""
    columns: Columns = field(default_factory=dict)
    bits: str = ""
    files: dict[str, tuple[int, str]] = field(default_factory=dict)
    data: dict[str, bytes] = field(default_factory=dict)
    warnings: list[Said] = field(default_factory=list)
    seconds: float = 0.0
    marching: float = 0.0
    worker: str = ""
    survivors: int = 0
    stopped: int = 0


class Reached:
    """Takes note of the time that a run has reached."""

    done = 0.0

    def update(self, done: float, steps: int) -> None:
        """Take note of the time reached."""
        self.done = done

    def close(self) -> None:
        """End it."""


def integrate(
    task: Task,
    folder: Path,
    worker: str,
    asked: Callable[[], str] = lambda: "",
    told: Callable[[float], None] = lambda fraction: None,
) -> Outcome:
    """Integrate a block; its archives are made in `folder`, where an unfinished one is continued.

    A block that cannot be integrated is an outcome too. Raises StorageError if files cannot be written.
    """
    begun_at = time.perf_counter()
    here = provenance()
    if changed := [said(key, here[key], there) for key, there in task.made_by.items() if here[key] != there]:
        return Outcome(task.number, REFUSED, "; ".join(changed), worker=worker)
    caught: list[Said] = []
    try:
        out = _worked(task, folder, asked, told, caught)
    except Interrupted as error:
        out = Outcome(task.number, INTERRUPTED, str(error))
    except StorageError:
        raise
    except MemoryError:
        out = Outcome(task.number, FAILED, "not enough memory; take a smaller block or fewer samples")
    except Exception as error:
        out = Outcome(task.number, FAILED, f"{type(error).__name__}: {' '.join(str(error).split())}")
    if out.state == FAILED:
        for path in files_of(folder, task.stem):
            path.unlink(missing_ok=True)
    out.warnings, out.worker = list(dict.fromkeys(caught)), worker
    out.seconds = time.perf_counter() - begun_at
    if out.state == DONE:
        out.files = {str(path.relative_to(folder)): fingerprint(path) for path in files_of(folder, task.stem)}
    return out


def warm(task: Task) -> None:
    """Compile what a block needs, by a few steps of a few of its members. Raises InputError for wrong options."""
    options = dict(task.options)
    with _collected([]):
        one = task.part.system()
        grid = _grid(one, options)
        options["duration"] = min(abs(grid.end), abs(grid.h) * WARM_STEPS if grid.h == grid.h else abs(grid.end) * 1e-4)
        options["duration"] *= grid.direction
        options.pop("until", None)
        options["samples"] = 2
        small: Any = [one] * 8 if not task.part.massless else one
        with suppress(IntegrationError):
            propagate(small, task.integrator, **options, threads=1, progress=False)
        if task.megno is not None:
            known = {name: options[name] for name in ("dt", "duration") if name in options}
            megno(one, task.integrator, **known, samples=2, check_step=False, threads=1, **task.megno)


def remote(task: Task, stopped: Callable[[], str]) -> Outcome:
    """Integrate a block on a machine that need not see the store: its files come with the outcome."""
    with tempfile.TemporaryDirectory(prefix="orbits-") as name:
        folder = Path(name)
        for inside, data in task.unfinished.items():
            (folder / inside).parent.mkdir(exist_ok=True)
            (folder / inside).write_bytes(data)
        out = integrate(task, folder, f"process {os.getpid()}", stopped)
        if task.trajectories and out.state in (DONE, INTERRUPTED):
            paths = files_of(folder, task.stem)
            out.data = {str(path.relative_to(folder)): path.read_bytes() for path in paths}
        return out


def said(key: str, there: object, here: object) -> str:
    """Return in words how an entry of the provenance of a worker differs from that of the campaign's process."""
    if key == "cpu_features":
        return "another processor, whose instructions give other last bits"
    if key == "kernel_sources":
        return "other kernels of orbits (its files differ)"
    return f"{key} {there}, this process {here}"


def fingerprint(path: Path) -> tuple[int, str]:
    """Return the size and the SHA-256 of a file."""
    found = hashlib.sha256()
    with path.open("rb") as file:
        while block := file.read(1 << 22):
            found.update(block)
    return path.stat().st_size, found.hexdigest()


def _worked(
    task: Task, folder: Path, asked: Callable[[], str], told: Callable[[float], None], caught: list[Said]
) -> Outcome:
    """Integrate a block. Raises what ends all of it."""
    _go_on(asked)
    made: dict[int, System] = {}
    reasons: dict[int, str] = {}
    with _collected(caught):
        if task.part.massless:
            made[0] = task.part.system()
        else:
            for k, one in enumerate(task.part.systems()):
                _go_on(asked)
                if isinstance(one, System) and task.units in ({}, units_of_table(one)):
                    made[k] = one
                elif isinstance(one, System):
                    own, first = (" and ".join(units.values()) for units in (units_of_table(one), task.units))
                    reasons[k] = f"the system is in {own}; expected {first}, the units of the first member"
                else:
                    reasons[k] = str(one)
    since = time.perf_counter()
    runs, failures = _marched(task, folder, made, asked, told, caught)
    marched = time.perf_counter() - since
    for failure in failures.values():
        if task.part.massless or not isinstance(failure, OrbitsError) or isinstance(failure, StorageError):
            raise failure
    reasons |= {k: f"{type(one).__name__}: {one}" for k, one in failures.items()}
    try:
        if task.part.massless:
            columns = of_particles(runs[0], len(made[0]) - len(task.part))
        else:
            columns = of_systems([runs.get(k) for k in range(len(task.part))], reasons, task.bodies)
        if task.megno is not None:
            changed = {k for k, run in runs.items() if run.changes is not None and run.changes.begin_legs}
            kept = made.keys() - reasons.keys() - changed
            columns |= _megno(task, {k: (made[k], runs[k]._reached) for k in kept}, asked)
            columns["megno"][columns["state"] == LOST] = np.nan
        bits = _bits(list(runs.values()), columns)
    finally:
        for run in runs.values():
            run.close()
    survivors, stopped = (int((columns["state"] == word).sum()) for word in (SURVIVED, STOPPED))
    return Outcome(task.number, DONE, "", columns, bits, survivors=survivors, stopped=stopped, marching=marched)


def _marched(
    task: Task,
    folder: Path,
    made: Mapping[int, System],
    asked: Callable[[], str],
    told: Callable[[float], None],
    caught: list[Said],
) -> tuple[dict[int, Trajectory], dict[int, BaseException]]:
    """March systems to their ends; return the trajectories, complete or not, and the errors of those that failed."""
    own = "stop", "events", "check_step", "approaches"
    known = {name: task.options[name] for name in own if name in task.options}
    runs: dict[int, Trajectory] = {}
    ready: dict[int, Run] = {}
    failures: dict[int, BaseException] = {}
    with _collected(caught), _given_up(runs, ready):
        for k, system in made.items():
            _go_on(asked)
            path = folder / f"{task.stem}.h5" if task.part.massless else folder / task.stem / f"{k:05d}.h5"
            try:
                run = _continued(path, known.get("stop", ())) if task.trajectories and path.exists() else None
                if run is None:
                    path.parent.mkdir(exist_ok=True)
                    place: dict[str, Any] = {"archive": path, "overwrite": True} if task.trajectories else {}
                    grid = _grid(system, task.options)
                    how = RunOptions(threads=1, progress=False, **place, **known)
                    run = begun(system, task.integrator, grid, how)
            except OrbitsError as error:
                failures[k] = error
                continue
            if isinstance(run, Run):
                ready[k] = run
            else:
                runs[k] = run
    stop, bars = StopRequest(), {k: Reached() for k in ready}
    total = sum(abs(run.grid.end) for run in ready.values()) or 1.0

    def look() -> None:
        stop.name = stop.name or asked()
        told(sum(abs(bar.done) for bar in bars.values()) / total)

    look()
    steps = {k: marching(run, stop, bars[k]) for k, run in ready.items()}
    if ready:
        march_in_threads(steps, stop, look, 1, failures)
    stopped: Interrupted | None = None
    for k in [k for k in steps if k not in failures]:
        if stop.name and getgeneratorstate(steps[k]) == GEN_CREATED:
            ready[k].release()
            stopped = Interrupted(f"stopped by {stop.name} before its start")
            continue
        try:
            with _collected(caught):
                runs[k] = to_its_end(steps[k])
        except Interrupted as error:
            stopped = error
        except Exception as error:
            failures[k] = error
            if getattr(error, "trajectory", None) is not None:
                runs[k] = error.trajectory  # type: ignore[attr-defined]
    if stopped is not None:
        for run in runs.values():
            run.close()
        raise stopped
    return runs, failures


def _go_on(asked: Callable[[], str]) -> None:
    """Raise Interrupted if a stop is requested: between the members of a block, each of which takes some 0.1 s."""
    if why := asked():
        raise Interrupted(f"stopped by {why}")


@contextmanager
def _given_up(runs: Mapping[int, Trajectory], ready: Mapping[int, Run]) -> Iterator[None]:
    """A context in which runs are made ready; if a stop is requested, their archives are left as they are."""
    try:
        yield
    except Interrupted:
        for one in ready.values():
            one.release()
        for run in runs.values():
            run.close()
        raise


def _continued(path: Path, stop: Any) -> Run | Trajectory | None:
    """Return a run that has ended, or the rest of one that was interrupted; None, without its file, if that cannot be
    continued, or has a limit of its wall time in `stop`, which archives do not hold.
    """
    with suppress(OrbitsError):
        run = Trajectory.open(path)
        if run.complete or run.stopped is not None:
            return run
        run.close()
        if Conditions(stop).seconds == math.inf:
            return resumed(path, RunOptions(progress=False, threads=1))
    path.unlink()
    return None


def _grid(system: System, options: Mapping[str, Any]) -> TimeGrid:
    known = {name: options[name] for name in ("duration", "until", "samples") if name in options}
    return TimeGrid.of(system, options.get("dt"), **known)


def _megno(task: Task, made: Mapping[int, tuple[System, float]], asked: Callable[[], str]) -> Columns:
    """Return MEGNO of these members at the end, and when each first had a passage that the method cannot follow.

    made : the systems, each with the time that its run has reached
    """
    assert task.megno is not None
    values, passages = np.full((2, len(task.part)), np.nan)
    for k, (system, end) in made.items():
        _go_on(asked)
        known: dict[str, Any] = {"dt": task.options.get("dt"), "duration": end, "samples": [end]}
        try:
            found = megno(system, task.integrator, **known, check_step=False, threads=1, **task.megno)
        except IntegrationError:
            continue
        if task.part.massless:
            members = found.particles[-len(task.part) :]
            values[:] = [one.megno[-1] for one in members]
            passages[:] = [np.nan if one.passage is None else one.passage.value for one in members]
        elif found.massive is None:
            raise InputError(
                "bodies that are read from an ephemeris have no MEGNO; expected massless ones: "
                "orbits.ensemble.particles."
            )
        else:
            values[k] = found.massive.megno[-1]
    return {"megno": values, "unresolved_at": passages} if task.part.massless else {"megno": values}


def files_of(folder: Path, stem: str) -> list[Path]:
    inside = folder / stem
    return [path for path in (folder / f"{stem}.h5", *sorted(inside.glob("*.h5"))) if path.is_file()]


def _bits(runs: list[Trajectory], columns: Columns) -> str:
    """Return a hash of the samples of runs, and of the columns of the table."""
    found = hashlib.sha256()
    for run in runs:
        found.update(run.times.tobytes())
        for k in range(0, len(run), SLAB):
            some = run[k : k + SLAB]
            found.update(some.q.value.tobytes() + some.v.value.tobytes())
    for name in sorted(columns):
        found.update(name.encode() + columns[name].tobytes())
    return found.hexdigest()


@contextmanager
def _collected(caught: list[Said]) -> Iterator[None]:
    """Collect warnings instead of giving them; those of lost particles are in the table."""
    with _ALONE, warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        try:
            yield
        finally:
            caught += [
                (one.category.__name__, str(one.message), kind_of(one.message))
                for one in found or ()
                if not issubclass(one.category, RetiredWarning)
            ]
