"""Lists of systems: their runs side by side, on all cores, each with the bits that it has alone.

A run that fails does not end the others: all that was computed is in the error that is raised at the end. The warnings
of the systems are given together.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, wait
from contextlib import contextmanager, suppress
from os import PathLike
from pathlib import Path
from typing import TypeVar

from orbits.checks import listed, whole_number
from orbits.errors import ArchiveError, InputError, Interrupted, OrbitsError, SystemsError, counted, shown
from orbits.finding import SHOWN, Finding, kind_of
from orbits.marching.legs.leg import available_threads
from orbits.marching.stepping.pool import Pool
from orbits.propagation.control.heartbeat import Pulse
from orbits.propagation.control.progress import Progress
from orbits.propagation.control.signals import StopRequest
from orbits.propagation.loop import Marching, Run, marching, to_its_end
from orbits.system import System
from orbits.time_grid import TimeGrid
from orbits.trajectory import Trajectory

T = TypeVar("T")

PAUSE = 0.1
"""Seconds between two looks at what the threads have reached."""


def systems_of(given: object) -> list[System]:
    """Return a list of systems of equal shape. Raises InputError for anything else, naming those that differ."""
    systems = listed(given)
    if systems is None:
        raise InputError(
            f"system must be an orbits.System, or a list of systems of equal shape, got {type(given).__name__}"
        )
    if not systems:
        raise InputError("the list of systems is empty; expected an orbits.System, or a list with at least one.")
    for k, system in enumerate(systems):
        if not isinstance(system, System):
            raise InputError(f"systems[{k}] is {shown(system)}; expected an orbits.System.")
    first = _shape(systems[0])
    for k, system in enumerate(systems):
        for what, own in _shape(system).items():
            if own != first[what]:
                raise InputError(
                    f"the systems of a list have equal shapes: systems[{k}] has {what} {own}, but systems[0] "
                    f"{first[what]}. Propagate those of each shape by a call of their own."
                )
    return systems


def _shape(system: System) -> dict[str, object]:
    """Return what the systems of a list have in common, by its name in messages."""
    massive = int(system.massive.sum())
    units = system.units
    return {
        "massive bodies:": massive,
        "massless particles:": len(system) - massive,
        "units": ", ".join(str(unit) or "dimensionless" for unit in (units.length, units.time, units.mass)),
        "G =": units.G,
    }


def check_samples(grids: Sequence[TimeGrid]) -> None:
    """Raise InputError unless all runs have samples, and ends, at the same times since the epoch."""
    first = grids[0]
    for k, grid in enumerate(grids):
        if grid.end != first.end or grid.times.shape != first.times.shape or (grid.times != first.times).any():
            raise InputError(
                f"the runs of a list have the same samples: those of systems[{k}], up to {grid.end:.10g} after its "
                f"epoch, differ from those of systems[0], up to {first.end:.10g}. Give duration=, and samples as a "
                "number or times since the epoch, where the epochs differ."
            )


def archives_of(archive: object, count: int, overwrite: bool) -> list[Path]:
    """Return the path of the archive of each system of a list; [] for none.

    archive : None; a folder, for files 0.h5, 1.h5, ... in it; a path with {} for the number; or a list of paths
    Raises InputError for other values and for a file, ArchiveError for archives that exist.
    """
    if archive is None:
        return []
    if isinstance(archive, str | PathLike):
        paths = _numbered(os.fspath(archive), count)
    elif isinstance(archive, Sequence) and all(isinstance(path, str | PathLike) for path in archive):
        if len(archive) != count:
            raise InputError(f"archive has {len(archive)} paths for {count} systems; expected one for each.")
        paths = [Path(path) for path in archive]
        if len({path.absolute() for path in paths}) < count:
            raise InputError("archive has the same path twice; expected a file of its own for each system.")
    else:
        raise InputError(f"archive is {shown(archive)}; expected a folder, a path with {{}}, or a list of paths.")
    from orbits.archive.creation import check_target

    for path in paths:
        if path.parent.exists() or path.parent != _folder(archive):
            check_target(path.absolute(), overwrite)
    return paths


def make_folder(archive: object) -> None:
    """Make the folder for the archives of a list, if `archive` is one."""
    folder = _folder(archive)
    if folder is not None:
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ArchiveError(f"the folder {folder} cannot be made: {error.strerror}.") from error


def _folder(archive: object) -> Path | None:
    """Return the folder that stands for the archives in it, or None."""
    if not isinstance(archive, str | PathLike) or "{}" in Path(os.fspath(archive)).name:
        return None
    return Path(os.fspath(archive))


def _numbered(text: str, count: int) -> list[Path]:
    digits = len(str(count - 1))
    if "{}" in Path(text).name:
        folder, name = Path(text).parent, Path(text).name
        return [folder / name.replace("{}", f"{k:0{digits}d}") for k in range(count)]
    folder = Path(text)
    if folder.suffix in (".h5", ".hdf5", ".hdf") or folder.is_file():
        raise InputError(
            f"archive = {text!r} is one file, for {count} systems; expected a folder, a path with {{}} for the "
            f"number of the system, such as {folder.stem + '-{}.h5'!r}, or a list of paths."
        )
    paths = [folder / f"{k:0{digits}d}.h5" for k in range(count)]
    if strangers := sorted(path.name for path in folder.glob("*.h5") if path not in paths):
        raise InputError(
            f"archive = {text!r} is a folder with archives of other runs, such as {strangers[0]}, which would be "
            "taken for systems of this list; expected one without."
        )
    return paths


def each(count: int, make: Callable[[int], T]) -> list[T]:
    """Call a function with the number of each system; warnings are given together, and an error names the system."""
    made, found = [], _Warnings(count)
    for k in range(count):
        with found.of(k):
            try:
                made.append(make(k))
            except OrbitsError as error:
                error.args = (f"systems[{k}]: {error}",)
                raise
    found.give()
    return made


class _Warnings:
    """The warnings of several systems, given together: each kind once, with the numbers of its systems."""

    def __init__(self, count: int) -> None:
        self._count = count
        self._found: dict[type[Warning], dict[str, dict[str, list[int]]]] = {}  # by category, kind and text

    @contextmanager
    def of(self, k: int) -> Iterator[None]:
        """A context that collects the warnings of system k instead of giving them."""
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            try:
                yield
            finally:
                for one in caught:
                    kinds = self._found.setdefault(one.category, {})
                    numbers = kinds.setdefault(kind_of(one.message), {}).setdefault(str(one.message), [])
                    if k not in numbers:
                        numbers.append(k)

    def give(self) -> None:
        """Give them, in the order of their first systems."""
        for category, kinds in self._found.items():
            groups = list(kinds.values())
            lines = [self._told(group) for group in groups[:SHOWN]]
            hidden = sorted({k for group in groups[SHOWN:] for numbers in group.values() for k in numbers})
            if hidden:
                lines.append(f"And {_names(hidden, self._count)} have other warnings of their own.")
            Finding("\n".join(lines), category, next(iter(kinds)) if len(kinds) == 1 else "").warn()

    def _told(self, group: Mapping[str, Sequence[int]]) -> str:
        """Return the texts of one kind: their systems, and the text of the first."""
        (text, first), *others = group.items()
        if not others:
            return f"{_names(first, self._count)}: {text}"
        numbers = sorted({k for own in group.values() for k in own})
        which = f"their texts differ in figures; this is that of systems[{first[0]}]"
        return f"{_names(numbers, self._count)} ({which}): {text}"


def _names(numbers: Sequence[int], count: int) -> str:
    """Return the systems of these numbers in words."""
    if len(numbers) == count > 1:
        return f"all {count} systems"
    some = ", ".join(map(str, numbers[:8])) + f" and {len(numbers) - 8:,} more" * (len(numbers) > 8)
    return f"systems[{some}]"


class _Bars:
    """The progress of several runs, shown as one; each run reports to one of `bars`."""

    def __init__(self, runs: Sequence[Run], progress: bool | None) -> None:
        one, self._count = runs[0], len(runs)
        label = f"{one.integrator.label}, {counted(self._count, 'system')}"
        self.bars = [_Reached(run.marcher.time, run.marcher.step) for run in runs]
        unit, end = one.system.units.time, one.grid.end
        wanted = progress if one.heartbeat is None else False
        self._shown = Progress(wanted, label=label, total=end, unit=unit, begun=self._reached())
        self._pulse = Pulse(one.heartbeat, unit, end, *self._reached())

    def show(self) -> None:
        """Show the mean of what they have reached."""
        self._shown.update(*self._reached())
        if self._pulse.due:
            self._pulse.beat(*self._reached(), self._told())

    def close(self) -> None:
        """Remove it."""
        self._shown.close()
        if self._pulse.beaten:
            self._pulse.beat(*self._reached(), self._told(), last=True)

    def _reached(self) -> tuple[float, int]:
        """Return the mean of the times reached, and the sum of the steps."""
        return sum(bar.done for bar in self.bars) / self._count, sum(bar.steps for bar in self.bars)

    def _told(self) -> list[str]:
        done = sum(bar.ended for bar in self.bars)
        return [f"{done:,} of {counted(self._count, 'system')} done"]


class _Reached:
    def __init__(self, done: float, steps: int) -> None:
        self.done, self.steps, self.ended = done, steps, False

    def update(self, done: float, steps: int) -> None:
        self.done, self.steps = done, steps

    def close(self) -> None:
        self.ended = True


def threads_of_each(count: int, threads: int | None) -> int:
    """Return how many threads each of several runs has that are marched at the same time."""
    whole = available_threads() if threads is None else whole_number(threads, "threads, if given,")
    return max(1, whole // count)


def march_each(
    runs: Sequence[Run | Trajectory], threads: int | None, progress: bool | None, *, in_turn: bool
) -> list[Trajectory]:
    """March several runs to their ends, and return their trajectories; those that are trajectories are done already.

    threads : how many of them run at the same time; None for all processors
    in_turn : one after another in this thread, as functions of the user are called on the way

    Raises SystemsError if some fail, Interrupted after a signal; both have the trajectories of all.
    """
    done: list[Trajectory | None] = [run if isinstance(run, Trajectory) else None for run in runs]
    left = {k: run for k, run in enumerate(runs) if isinstance(run, Run)}
    failures: dict[int, BaseException] = {}
    found = _Warnings(len(runs))
    if left:
        bars = _Bars(list(left.values()), progress)
        with StopRequest() as stop:
            begun = {
                k: marching(run, stop, bar) for (k, run), bar in zip(left.items(), bars.bars, strict=True)
            }
            try:
                if not in_turn:
                    march_in_threads(begun, stop, bars.show, threads, failures)
                for k, steps in begun.items():
                    if k not in failures:
                        with found.of(k), _noted(k, failures):
                            done[k] = to_its_end(steps)
                        bars.show()
            finally:
                bars.close()
                for steps in begun.values():
                    steps.close()
    for k, failure in failures.items():
        done[k] = getattr(failure, "trajectory", None)
    try:
        found.give()
    except Warning as warning:  # raised as an error: the runs are not lost
        if not failures:
            with suppress(AttributeError, TypeError):
                warning.trajectory = done  # type: ignore[attr-defined]
            raise
    if failures:
        raise _error(failures, done)
    return [run for run in done if run is not None]


def march_in_threads(
    begun: Mapping[int, Marching],
    stop: StopRequest,
    show: Callable[[], None],
    threads: int | None,
    failures: dict[int, BaseException],
) -> None:
    """March runs up to the point at which warnings are given; note the errors of those that fail.

    begun : what `marching` returned for each, by their numbers; stop : ends them; show : called again and again
    """
    pool = Pool(min(available_threads() if threads is None else threads, len(begun)))

    def task(k: int) -> None:
        with _noted(k, failures):
            while not stop.name and next(begun[k]) is not None:  # the rest of a run that is stopped is not for a thread
                pass

    running: set[Future[None]] = set()
    try:
        for k in begun:
            running.add(pool.submit(task, k))
        while running:
            ended, running = wait(running, PAUSE)
            for future in ended:
                future.result()
            show()
    except BaseException:
        stop.name = stop.name or "an interrupt"
        wait(running)
        raise
    finally:
        pool.shutdown()


@contextmanager
def _noted(k: int, failures: dict[int, BaseException]) -> Iterator[None]:
    """A context that notes the error of a run, unless it is an interrupt of Python's own."""
    try:
        yield
    except KeyboardInterrupt as error:
        if not isinstance(error, Interrupted):
            raise
        failures[k] = error
    except Exception as error:
        failures[k] = error


def _error(failures: dict[int, BaseException], done: list[Trajectory | None]) -> SystemsError | Interrupted:
    """Return the error for all those that failed."""
    interrupted = {k: error for k, error in failures.items() if isinstance(error, Interrupted)}
    others = {k: error for k, error in failures.items() if k not in interrupted}
    whole = sum(run is not None and run.complete for run in done)
    if interrupted:
        message = f"{whole} of {len(done)} systems are complete; the others:"
        return Interrupted(_listed(message, failures), trajectory=done)
    many = counted(len(done), "system")
    message = f"{len(others)} of {many} failed; the others are complete, and all are in .trajectories:"
    return SystemsError(_listed(message, others), failures=others, trajectories=done)


def _listed(message: str, failures: dict[int, BaseException]) -> str:
    rows = [f"systems[{k}]: {error}" for k, error in list(failures.items())[:SHOWN]]
    return str(Finding(message, rows=rows, hidden=len(failures) - SHOWN))
