"""Perform a scenario: integrate, compare, check, draw, and write the results folder."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

from orbits.errors import InputError, OrbitsError, counted, shown, with_unit
from orbits.json_text import json_text, plain
from orbits.scenario.definition import CaseOutcome, Check, Outcome, Scenario, slug
from orbits.scenario.files import remove_pictures, replaceable, results_folder, write_text
from orbits.scenario.loading import located
from orbits.scenario.parts import Parts, identity
from orbits.scenario.runs import Pace, Runs, Telling
from orbits.scenario.study import Study, StudyOutcome, StudyResult
from orbits.scenario.unfinished import alone_in

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from orbits.propagation.control.heartbeat import Heartbeat
    from orbits.propagation.control.wall_clock import Deadline
    from orbits.regression.comparison import Asked
    from orbits.system import System
    from orbits.time_grid import TimeGrid
    from orbits.trajectory import Trajectory


Say = Callable[[str], None]


@overload
def perform(
    scenario: Scenario,
    *,
    out: str | os.PathLike[str] | None = ...,
    plot: bool = ...,
    progress: bool | None = ...,
    say: Say = ...,
    heartbeat: Heartbeat | None = ...,
    wall_time: Deadline | None = ...,
) -> Outcome: ...
@overload
def perform(
    scenario: Study,
    *,
    out: str | os.PathLike[str] | None = ...,
    plot: bool = ...,
    progress: bool | None = ...,
    say: Say = ...,
) -> StudyOutcome: ...
def perform(
    scenario: Scenario | Study,
    *,
    out: str | os.PathLike[str] | None = None,
    plot: bool = True,
    progress: bool | None = None,
    say: Say = lambda text: None,
    heartbeat: Heartbeat | None = None,
    wall_time: Deadline | None = None,
) -> Outcome | StudyOutcome:
    """Run a scenario and write its results.

    out : results folder, ./results/NAME by default. Files of an earlier run are replaced, other files never. If the
        same run was interrupted by Ctrl-C, it is continued, as is a study that keeps its parts; another run that is
        not complete is refused, as it would be lost
    plot : whether to draw
    progress : as in `propagate`; say : receives messages about the progress, one line each
    heartbeat, wall_time : lines about each run of a scenario, and the limit that all of them keep together

    Raises InputError (or a subclass) for wrong use, IntegrationError for a run that fails, Interrupted after Ctrl-C,
    OutOfTime when the wall time is over: if the scenario is run again, the first run goes on where it was. An exceeded
    tolerance raises no error; it makes `outcome.ok` False.
    """
    if not isinstance(scenario, Scenario | Study):
        raise InputError(f"perform got {shown(scenario)}; expected a scenario, such as orbits.scenario.load('kepler').")
    folder = results_folder(out or Path("results") / scenario.name)
    if isinstance(scenario, Study):
        return _perform_study(scenario, folder, plot, say)
    with alone_in(folder):
        return _perform(scenario, folder, plot, Pace(progress, heartbeat, wall_time), Telling(say))


def _perform(scenario: Scenario, folder: Path, plot: bool, pace: Pace, say: Telling) -> Outcome:
    from orbits.time_grid import TimeGrid

    with located():
        systems, step = scenario.cases(), scenario.step()
    grids = {
        name: TimeGrid.of(system, step, duration=scenario.duration, samples=scenario.samples)
        for name, system in systems.items()
    }
    report = replaceable(folder / "report.json")  # before the long runs, not after them
    for grid in grids.values():
        for method in scenario.integrators:
            grid.clock.check(method)
    comparisons = {name: _comparison(scenario, system, grids[name]) for name, system in systems.items()}
    runs = Runs(scenario, systems, grids, folder)
    if report.exists() and not runs.stopped:  # what is there is finished
        runs.begin_anew()
    remove_pictures(report)
    report.unlink(missing_ok=True)
    parts = {name: _parts(scenario, name, systems[name], grids[name], folder, say) for name in systems}
    say(_plan(scenario, systems, grids, plot))
    try:
        outcome = _performed(scenario, folder, plot, pace, say, (runs, parts, comparisons))
    except KeyboardInterrupt as stopped:
        there = [f"{name}, {part}" if name else part for name, each in parts.items() for part in each.kept]
        raise runs.interrupted(stopped, say.now, there) from None
    for each in parts.values():
        each.remove()
    return outcome


def _plan(scenario: Scenario, systems: Mapping[str, System], grids: Mapping[str, TimeGrid], plot: bool) -> str:
    """Return in a line what is going to be done."""
    from orbits.plotting.words import fitting_time

    grid, unit = next(iter(grids.values())), next(iter(systems.values())).units.time
    factor, fitting = fitting_time(grid.end, unit)
    sizes = {len(each) for each in systems.values()}
    cases = f"{len(systems)} cases of {'up to ' * (len(sizes) > 1)}" * (len(systems) > 1)
    bodies = cases + counted(max(sizes), "body")
    then = ["comparison with " + ", ".join(scenario.against)] * bool(scenario.against)
    then += ["checks"] * (scenario.checks is not None) + ["pictures"] * plot
    after = f"; then {', '.join(then)}" if then else ""
    methods = counted(len(scenario.integrators), "method")
    return f"{bodies}, over {with_unit(f'{factor * grid.end:.4g}', fitting)}, by {methods}{after}"


def _performed(
    scenario: Scenario,
    folder: Path,
    plot: bool,
    pace: Pace,
    say: Telling,
    kept: tuple[Runs, Mapping[str, Parts], Mapping[str, Asked | None]],
) -> Outcome:
    cases: dict[str, CaseOutcome] = {}
    runs, parts, comparisons = kept
    for name, system in runs.systems.items():
        found = runs.of_case(name, pace, say)
        report = _report(scenario, name, comparisons[name], found, parts[name], pace, say)
        cases[name] = CaseOutcome(name, system, found, report)
    outcome = Outcome(scenario=scenario, folder=folder, cases=cases)
    with located():
        given = () if scenario.checks is None else scenario.checks(outcome)
        checks = tuple(given) if isinstance(given, Iterable) else (given,)
    for check in checks:
        if not isinstance(check, Check):
            wanted = "checks must yield orbits.scenarios.Check values"
            raise InputError(f"scenario {scenario.name!r}: {wanted}, got {shown(check)}.")
    outcome = replace(outcome, checks=checks)
    files, complaints = [*runs.archives.values()], [*runs.failures]
    if plot:
        say("drawing")
        try:
            files += _draw(outcome)
        except OrbitsError as error:
            complaints.append(str(error))
    say.mind_controls()
    files.append(folder / "report.json")
    outcome = replace(outcome, files=tuple(files), complaints=tuple(complaints))
    write_text(folder / "report.json", to_json(outcome) + "\n")
    return outcome


def _parts(scenario: Scenario, name: str, system: System, grid: TimeGrid, folder: Path, say: Say) -> Parts:
    """Return the finished stages of a comparison, which depend on the problem alone."""
    from orbits.propagation.events.functions import in_full

    x = system.values
    problem = hashlib.sha256(in_full((system.names, system.terms, system.forces, x.softening, grid.clock)).encode())
    for each in (x.gm, x.q, x.v, grid.times):
        problem.update(each.tobytes())
    made_by = {"scenario": scenario.name, "case": name, "problem": problem.hexdigest(), "rebound": version("rebound")}
    return Parts(folder, made_by, say, prefix=f"{slug(name)}-" * bool(name))


def to_json(outcome: Outcome | StudyOutcome) -> str:
    """Return an outcome as JSON text."""
    return json_text(to_record(outcome))


def to_record(outcome: Outcome | StudyOutcome) -> dict[str, Any]:
    """Return an outcome as values for JSON; null stands for numbers that are not finite."""
    scenario = outcome.scenario
    record: dict[str, Any] = {
        "format": "orbits-scenario",
        "version": 1,
        "scenario": scenario.name,
        "title": scenario.title,
        "ok": outcome.ok,
        "failures": list(outcome.failures),
        "checks": [{"claim": c.claim, "ok": bool(c.ok), "measured": c.measured} for c in outcome.checks],
        "files": [str(path) for path in outcome.files],
    }
    if isinstance(outcome, StudyOutcome):
        result = outcome.result
        tables = [{"title": t.title, "columns": t.columns, "rows": t.rows} for t in result.tables]
        return {**record, **plain({"tables": tables, "record": result.record}, "a study's tables and record")}
    cases = {
        name: {
            "runs": {label: _run_record(run) for label, run in case.runs.items()},
            "report": json.loads(case.report.to_json()) if case.report is not None else None,
        }
        for name, case in outcome.cases.items()
    }
    options = {"options": outcome.options} if outcome.options else {}
    whole: dict[str, Any] = plain({**record, **options, "cases": cases}, "a scenario's record")
    return whole


def _perform_study(study: Study, folder: Path, plot: bool, say: Say) -> StudyOutcome:
    report = replaceable(folder / "report.json")
    parts = Parts(folder, identity(study.experiment, study.name, study.dt), say) if study.resumable else None
    more = [*([] if study.dt is None else [study.dt]), *([] if parts is None else [parts])]
    with located():
        result = study.experiment(say, *more)
    if not isinstance(result, StudyResult):
        raise InputError(f"study {study.name!r}: its experiment must return a StudyResult, got {shown(result)}.")
    files: list[Path] = []
    complaints: list[str] = []
    remove_pictures(report)
    if plot and result.figures:
        from orbits.plotting import look

        say("drawing")
        try:
            with located(), look():
                figures = {name: draw() for name, draw in result.figures.items()}
            files += _saved(figures, folder)
        except OrbitsError as error:
            complaints.append(str(error))
    outcome = StudyOutcome(study, folder, result, (*files, report), tuple(complaints))
    write_text(report, to_json(outcome) + "\n")
    if parts is not None:
        parts.remove()
    return outcome


def _comparison(scenario: Scenario, system: System, grid: TimeGrid) -> Asked | None:
    """Return the comparison that a scenario asks for on a system, None for none. Raises InputError for wrong use."""
    if not scenario.against and not scenario.demands():
        return None
    from orbits.regression.comparison import asked_for

    return asked_for(system, list(scenario.integrators), grid, scenario.against, scenario.demands() or None)


def _report(
    scenario: Scenario,
    name: str,
    asked: Asked | None,
    found: Mapping[str, Trajectory],
    parts: Parts,
    pace: Pace,
    say: Say,
) -> Any:
    if asked is None:
        return None
    from orbits.regression.comparison import compared
    from orbits.regression.stages import Stages

    peers = ", ".join(scenario.against) or "the reference solution alone"
    say(f"{name + ', ' if name else ''}comparing with {peers}")
    return compared(
        asked,
        title=f"{scenario.headline()}: {name}" if name else scenario.headline(),
        runs=[run for run in found.values() if run.complete],
        stages=Stages(say, pace.progress, pace.heartbeat, asked.system.units.time, parts.get),
    )


def _draw(outcome: Outcome) -> list[Path]:
    from orbits.plotting import look, plot_trajectory

    figures: dict[str, Figure] = {}
    if outcome.scenario.draw is not None:
        with located(), look():
            drawn = outcome.scenario.draw(outcome)
        figures.update(drawn if isinstance(drawn, Mapping) else {outcome.scenario.name: drawn})
    else:
        for name, case in outcome.cases.items():
            figures[slug(name) or "run"] = plot_trajectory(case.run, title=outcome.scenario.headline())
    paths = _saved(figures, outcome.folder)
    for name, case in outcome.cases.items():
        if case.report is not None:
            path = replaceable(outcome.folder / f"comparison{'-' + slug(name) if name else ''}.png")
            if path in paths:
                raise InputError(
                    f"a figure is called {path.stem!r}, as the picture of the comparison is, which is left out; give "
                    "it another name."
                )
            case.report.plot(path)
            paths.append(path)
    return paths


def _saved(figures: Mapping[str, Any], folder: Path) -> list[Path]:
    from orbits.plotting import save

    for name, figure in figures.items():
        if not hasattr(figure, "savefig"):
            raise InputError(f"draw gave {figure!r} as {name!r}; expected a matplotlib Figure, or several by name.")
        if Path(str(name)).name != str(name):
            raise InputError(f"draw called a figure {shown(name)}; expected a name without a folder: it names a file.")
    paths = []
    for name, figure in figures.items():
        paths.append(replaceable(folder / f"{name}.png"))
        save(figure, paths[-1])
    return paths


def _run_record(run: Trajectory) -> dict[str, Any]:
    from orbits.marching.clocks.adaptive import Adaptive  # imports Numba, which the start of the command line avoids

    drift = run.drift()
    cost = run.statistics
    return {
        "integrator": run.integrator.label,
        "made_by": run.made_by,
        "dt": None if run.clock.changes else abs(run.step),
        "tolerance": run.clock.tolerance_for(run.integrator) if isinstance(run.clock, Adaptive) else None,
        "time_unit": str(run.system.units.time),
        "samples": len(run),
        "steps": cost.steps if cost else None,
        "wall_s": cost.wall_time if cost else None,
        "compile_s": cost.compile_time if cost else None,
        "largest_relative_change": {
            name: getattr(drift, name).max_fraction
            for name in ("energy", "angular_momentum", "linear_momentum", "centre_of_mass")
        },
    }
