"""The runs of a scenario: each has an archive of its own, so that one that was stopped goes on."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from orbits.errors import IntegrationError, Interrupted, OutOfTime, RetiredWarning, StepWarning, counted, with_unit
from orbits.scenario.definition import MIND, Scenario, slug
from orbits.scenario.unfinished import COMPLETE, UNFINISHED, looked_at

if TYPE_CHECKING:
    from orbits.integrators.base import Integrator
    from orbits.propagation.control.heartbeat import Heartbeat
    from orbits.propagation.control.wall_clock import Deadline
    from orbits.system import System
    from orbits.time_grid import TimeGrid
    from orbits.trajectory import Trajectory

_TOLD = {UNFINISHED: "going on with the unfinished run in", COMPLETE: "complete in"}
_OF_WHAT = {StepWarning: "steps that are too long", RetiredWarning: "particles that were lost"}


class Pace(NamedTuple):
    """How a run tells its progress, and when it ends: the options of `propagate`."""

    progress: bool | None
    heartbeat: Heartbeat | None
    wall_time: Deadline | None


class Telling:
    """Passes on what a scenario says, and keeps what is under way and what was warned of its controls."""

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say, self.now = say, ""
        self.of_controls: dict[str, list[warnings.WarningMessage]] = {}

    def __call__(self, text: str) -> None:
        """Say what comes next, or a warning."""
        self.now = self.now if text.startswith(MIND) else text
        self._say(text)

    @contextmanager
    def minding(self, method: Integrator, *, control: bool) -> Iterator[None]:
        """Pass on the warnings of a run, even if it fails; those of a control are kept for the end."""
        with warnings.catch_warnings(record=True) as caught:
            for kind in _OF_WHAT:
                warnings.simplefilter("always", kind)
            try:
                yield
            finally:
                if control and caught:
                    self.of_controls.setdefault(method.label, []).extend(caught)
                for warning in () if control else caught:
                    self(f"{MIND}{warning.message}")

    def mind_controls(self) -> None:
        """Say once what was warned of the controls, which are there to show it."""
        from orbits.body_names import few

        if not self.of_controls:
            return
        found = [one.category for caught in self.of_controls.values() for one in caught]
        what = " and of ".join(words for kind, words in _OF_WHAT.items() if kind in found)
        these = "the control " if len(self.of_controls) == 1 else "the controls "
        count = f"{len(found):,} warning{'s' * (len(found) > 1)}"
        self(f"{MIND}{count} of {what} for {these}{few([*self.of_controls])}, as was to be expected.")


class Runs:
    """Runs the methods of a scenario on its systems.

    archives : the file of each run, by case and label of the method
    kept : what each file has of this same run: `UNFINISHED`, `COMPLETE`, or "" for nothing
    failures : of runs, in words
    """

    def __init__(
        self, scenario: Scenario, systems: Mapping[str, System], grids: Mapping[str, TimeGrid], folder: Path
    ) -> None:
        self._scenario, self.systems, self.grids, self._folder = scenario, systems, grids, folder
        self.archives: dict[tuple[str, str], Path] = {}
        for name in systems:
            for k, method in enumerate(scenario.integrators):
                stem = "-".join(filter(None, ["run", slug(name), slug(method.label) if k else ""]))
                while folder / f"{stem}.h5" in self.archives.values():
                    stem += "-"
                self.archives[name, method.label] = folder / f"{stem}.h5"
        self.kept = {key: self._look(*key) for key in self.archives}
        self.failures: list[str] = []

    @property
    def stopped(self) -> bool:
        """Whether a run was stopped on the way, by the files."""
        return UNFINISHED in self.kept.values()

    def begin_anew(self) -> None:
        """Take no run from a file."""
        self.kept = dict.fromkeys(self.kept, "")

    def of_case(self, name: str, pace: Pace, say: Telling) -> Mapping[str, Trajectory]:
        """Run every method. One whose step fails is listed in `failures` and keeps the samples before."""
        runs: dict[str, Trajectory] = {}
        for method in self._scenario.integrators:
            key = name, method.label
            bodies = counted(len(self.systems[name]), "body")
            task = f"{name + ', ' if name else ''}{method.label}: {bodies}"
            kept = self.kept[key]
            steps = _steps(self.grids[name], self.systems[name])
            say(f"{task}, {_TOLD[kept]} {self.archives[key]}" if kept else f"{task}, {steps}")
            try:
                with say.minding(method, control=bool(runs) and not method.variational):
                    runs[method.label] = run = self._run(name, method, pace)
                self.kept[key] = COMPLETE if run.complete else UNFINISHED
            except IntegrationError as error:
                if error.trajectory is None or not len(error.trajectory):
                    raise
                self.failures.append(f"{task}: {error}")
                runs[method.label] = error.trajectory
            except Interrupted as stopped:
                if stopped.trajectory is not None:  # else no step was taken
                    self.kept[key] = COMPLETE if stopped.trajectory.complete else UNFINISHED
                raise
            if pace.wall_time is not None and pace.wall_time.ended(runs[method.label]):
                end = runs[method.label].stopped
                assert end is not None
                raise OutOfTime(f"{end.reason}, in {task}; the same command goes on with it.")
        return runs

    def interrupted(self, by: KeyboardInterrupt, doing: str, parts: Sequence[str]) -> Interrupted:
        """Return the error for a signal: what was under way, what is there, and that the same run goes on."""
        from orbits.body_names import few

        what = by.what if isinstance(by, Interrupted) else "stopped by Ctrl-C"
        if doing and doing not in what:
            what = f"{what}, in {doing}"
        there = []
        for state, words in ((COMPLETE, "complete"), (UNFINISHED, "begun")):
            names = [path.name for key, path in self.archives.items() if self.kept[key] == state]
            there += [f"{few(names)} {'is' if len(names) == 1 else 'are'} {words}"] * bool(names)
        if parts:
            there.append(f"of the comparison: {few(parts)}")
        stored = f"in {self._folder}, {'; '.join(there)}" if there else "nothing is stored yet"
        run = getattr(by, "trajectory", None)
        remedy = "run it again to go on from there" if there else "run it again"
        return Interrupted(f"{what}; {stored}", remedy, trajectory=run)

    def _run(self, name: str, method: Integrator, pace: Pace) -> Trajectory:
        from orbits.propagation.making_runs import propagated
        from orbits.propagation.run import resume

        path = self.archives[name, method.label]
        pacing: dict[str, Any] = pace._asdict()
        if self.kept[name, method.label]:
            return resume(path, **pacing)
        self._look(name, method.label)  # what another process has begun since
        origin = self._scenario.origin()
        system, grid = self.systems[name], self.grids[name]
        how = {"approaches": self._scenario.approaches, "origin": origin, **pacing}
        return propagated(system, method, grid, archive=path, overwrite=True, **how)

    def _look(self, name: str, label: str) -> str:
        method = next(each for each in self._scenario.integrators if each.label == label)
        return looked_at(self._scenario, method, self.systems[name], self.grids[name], self.archives[name, label])


def _steps(grid: TimeGrid, system: System) -> str:
    if grid.clock.changes:
        return "steps chosen one by one"
    return f"{grid.whole_steps:,} steps of {with_unit(f'{grid.dt:g}', system.units.time)}"
