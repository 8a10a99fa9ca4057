"""`compare`: our methods and REBOUND's on one problem, sampled at the same times, measured by the same functions."""

from __future__ import annotations

import contextlib
import sys
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from time import perf_counter
from typing import TYPE_CHECKING, Any, NamedTuple, Unpack

import numpy as np
from numpy.typing import NDArray

from orbits import integrators as methods
from orbits.body_names import few
from orbits.elsewhere import NoOthers, unknown_argument
from orbits.errors import InputError, IntegrationError, Interrupted, RetiredWarning, StepWarning, counted
from orbits.integrators.base import Integrator
from orbits.marching.clocks.adaptive import Adaptive
from orbits.marching.legs.leg import available_threads
from orbits.point_masses import PointMasses
from orbits.propagation.making_runs import propagated
from orbits.regression import peers
from orbits.regression import tolerances as tolerance
from orbits.regression.conserved_quantities import Invariants
from orbits.regression.peer_choice import Peer, listed
from orbits.regression.problem import Problem, Sampled, time_axis
from orbits.regression.reference_choice import kind_of_reference, reference_positions
from orbits.regression.report import ReferenceNote, Report, Row
from orbits.regression.stages import Arrays, Stages, as_array, as_text
from orbits.system import System
from orbits.time_grid import TimeGrid, dynamical_time, dynamical_time_of

if TYPE_CHECKING:
    from astropy.units import Quantity

    from orbits.trajectory import Trajectory

Array = NDArray[np.float64]

_WARM_UP_STEPS = 3

_HALVED_FROM = 500
"""Massless bodies from which a peer that chooses its steps takes them in halves, on two threads: it takes minutes."""

_IN_HALVES = "Each half of the massless bodies with the massive ones, on two threads; the seconds are the processor's."


def compare(
    system: System,
    integrators: Any = None,
    *,
    dt: Any = None,
    duration: Any = None,
    until: Any = None,
    samples: Any = 101,
    against: str | Sequence[str] | None = None,
    tolerances: Mapping[str, Any] | None = None,
    reference: str | Quantity | float = "auto",
    title: str | None = None,
    runs: Sequence[Trajectory] = (),
    threads: int | None = None,
    progress: bool | None = None,
    **others: Unpack[NoOthers],
) -> Report:
    """Run our methods and REBOUND's from the same floats, with the same step or each with its own, and judge ours.

        report = orbits.compare(system, duration=10 * u.yr)  # beside IAS15, both with adaptive steps
        report = orbits.compare(system, "gauss", dt=6 * u.day, duration=100 * u.yr)  # beside WHFast and IAS15

    system : a `System`, the initial state of all of them
    integrators : one of ours or several, such as `[orbits.Gauss(stages=8), "stormer-verlet"]`; Gauss with 8 stages by
        default
    dt, duration, until, samples, threads : as in `propagate`. Every method is sampled at the same times, and ends with
        the last one. dt is also exactly the step of the fixed-step peers, and the first one that IAS15 tries. Without
        dt, or with `orbits.Adaptive(...)`, ours choose their steps one by one, as IAS15 does at its default epsilon
    against : names of peers: "whfast", "whfast512", "saba", "mercurius", "trace", "ias15", "leapfrog", with options as
        in "whfast:kernel=lazy,corrector=17" or "saba:type=8-6-4"; several in a list, or with commas; may be empty. By
        default WHFast and IAS15; without dt, IAS15
    tolerances : bounds for our methods, on the largest values over the samples: {"energy": 1e-12,
        "angular_momentum": 1e-14, "position_km": 1.0}; for positions also by body, {"position_km": {"Mercury": 0.1,
        "particles": 100}}, or as a length in the system's unit, {"position": 1e-9}; for one method only,
        {"gauss": {"energy": 1e-13}}
    reference : the reference solution for positions. "auto": the exact solution if there is one, otherwise "converged",
        or without dt "taylor". "converged" is Gauss collocation with 8 stages and the largest power of two up to dt/2
        as its step, whose own error is printed: the largest difference from the same with 7 and with 6 stages; a time
        sets this step. "taylor" is a Taylor series in 106-bit arithmetic with steps of its own, through any encounter,
        whose error is the difference from another order. "exact" requires the exact solution; "none" measures no
        positions
    title : of the table and the picture
    runs : finished runs of `integrators` from this system with this dt and these samples, which are not repeated; wall
        and compile times are then those of these runs (including writing, for a run into an archive)
    progress : True, False or None (on a terminal): names on stderr the method that is running

    Wall times include integration only. Our methods are first compiled in a run of a few steps, whose time is the
    column "compile s"; for peers it is the time within REBOUND's integrating calls, without setup and copying.

    Returns a `Report`; its `ok` is False if one of ours exceeds a tolerance or fails. A method that fails, or a peer
    that is not suited to the problem, has a row with the reason.
    Raises InputError (or a subclass) for wrong use, before the long runs; IntegrationError if all of ours fail;
    Interrupted for Ctrl-C.
    """
    for name in others:
        raise unknown_argument(compare, name)
    given = TimeGrid.of(_checked(system), dt, duration=duration, until=until, samples=samples)
    grid = TimeGrid(given.clock, given.times)  # all end with the last sample, so that their seconds are of one span
    asked = asked_for(system, integrators, grid, against, tolerances, reference)
    return compared(asked, title=title, runs=runs, threads=threads, progress=progress)


class Asked(NamedTuple):
    """What is compared: on a system and a grid of steps and samples, our methods, REBOUND's, the problem, the kind of
    reference, the bounds of our methods, and the tolerances from which they are.
    """

    system: System
    grid: TimeGrid
    ours: list[Integrator]
    theirs: list[Peer]
    problem: Problem
    kind: str | float
    bounds: list[tolerance.Bounds]
    tolerances: Mapping[str, Any] | None


def asked_for(
    system: System,
    integrators: Any,
    grid: TimeGrid,
    against: str | Sequence[str] | None,
    tolerances: Mapping[str, Any] | None,
    reference: str | Quantity | float = "auto",
) -> Asked:
    """Return what a comparison is asked for, as in `compare`. Raises InputError (or a subclass) for wrong use."""
    ours = _ours("gauss" if integrators is None else integrators)
    for method in ours:
        grid.clock.check(method)
    if against is None:
        against = ("ias15",) if grid.clock.changes else ("whfast", "ias15")
    theirs = listed(against)
    problem = Problem.of(system)
    kind = kind_of_reference(system, reference, problem, grid)
    wanted = tolerance.parse(
        tolerances,
        methods=[(method.name, method.label) for method in ours],
        names=problem.names,
        massive=problem.massive_names,
        units=system.units,
        unit_of_report=problem.length,
    )
    return Asked(system, grid, ours, theirs, problem, kind, wanted, tolerances)


def compared(
    asked: Asked,
    *,
    title: str | None = None,
    runs: Sequence[Trajectory] = (),
    threads: int | None = None,
    progress: bool | None = None,
    stages: Stages | None = None,
) -> Report:
    """Compare what is asked for; otherwise like `compare`.

    stages : how progress is told, instead of `progress`, and what is kept of each stage
    """
    system, grid, ours, theirs, problem, kind, wanted, tolerances = asked
    done = _given(runs, system, ours, grid)
    stages = stages or Stages(_teller(progress), progress, unit=system.units.time)
    try:
        sampled = [
            _finished(done[method.label], method)
            if method.label in done
            else _run(system, method, grid, threads, stages)
            for method in ours
        ]
        positions, note, remarks = reference_positions(system, problem, grid, kind, threads, stages)
        others = [_peer(problem, peer, grid, stages) for peer in theirs]
    except KeyboardInterrupt as stopped:
        what = stopped.what if isinstance(stopped, Interrupted) else "stopped by Ctrl-C"
        raise Interrupted(f"{what}, in {stages.now}" if stages.now else what, "nothing was compared.") from None
    invariants = Invariants(problem.start)
    rows = [
        _judged(method.measured(problem, invariants, positions), bounds, note, problem)
        for method, bounds in zip(sampled, wanted, strict=True)
    ]
    rows += [other.measured(problem, invariants, positions) for other in others]
    times, time_unit = time_axis(grid.times, _in_days(system))
    return Report(
        rows=tuple(rows),
        times=times,
        time_unit=time_unit,
        length_unit=problem.length_unit,
        names=problem.names,
        massive=problem.massive_names,
        followed="worst of the massive bodies" if np.count_nonzero(problem.massive) > 1 else "worst of the bodies",
        reference=note,
        settings=_settings(system, problem, grid, ours, tolerances, title),
        notes=(*_steps_note(ours, theirs, grid), *invariants.notes, *remarks, *_threads_note(problem, threads)),
    )


def _checked(system: Any) -> System:
    if isinstance(system, System):
        return system
    raise InputError(f"system must be an orbits.System, got a {type(system).__name__}")


def _ours(integrators: Any) -> list[Integrator]:
    several = list(integrators) if isinstance(integrators, list | tuple) else [integrators]
    if not several:
        raise InputError("no integrator to compare; give one, such as orbits.Gauss(stages=8), or a list of them.")
    out = [methods.named(method) for method in several]
    labels = [method.label for method in out]
    for label in labels:
        if labels.count(label) > 1:
            raise InputError(f"{label} is compared twice; give each method once.")
    return out


def _given(runs: Sequence[Trajectory], system: System, ours: list[Integrator], grid: TimeGrid) -> dict[str, Trajectory]:
    """Return finished runs by their method's label. Raises InputError for one that does not fit the comparison."""
    out = {}
    for run in runs:
        label = run.integrator.label
        if label not in [method.label for method in ours]:
            raise InputError(f"runs holds one of {label}, which is not compared; give its integrator too.")
        if run.system != system or run.clock != grid.clock or not np.array_equal(run.times, grid.times):
            raise InputError(f"the run of {label} has another system, step or samples; leave it out of runs.")
        out[label] = run
    return out


def _teller(progress: bool | None) -> Callable[[str], None]:
    if progress or (progress is None and sys.stderr.isatty()):
        return lambda what: print(f"comparing: {what} ...", file=sys.stderr, flush=True)
    return lambda what: None


def _run(system: System, method: Integrator, grid: TimeGrid, threads: int | None, stages: Stages) -> Sampled:
    """Compile in a run of a few steps, then run. If a step fails, the result has the reason."""
    pacing = stages.of_run(method.label)
    started = perf_counter()
    short = _beginning(system, grid)
    with contextlib.suppress(IntegrationError):  # the run below fails in the same way, and reports it
        propagated(system, method, short, threads=threads, progress=False, check_step=False)
    compile_s = perf_counter() - started
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", StepWarning)
            warnings.simplefilter("always", RetiredWarning)
            run = propagated(system, method, grid, threads=threads, **pacing)
    except IntegrationError as error:
        return Sampled(method.label, "ours", compile_s=compile_s, note=str(error))
    note = " ".join(str(warning.message) for warning in caught)
    return replace(_finished(run, method, compile_s), note=note)


def _beginning(system: System, grid: TimeGrid) -> TimeGrid:
    """Return the first few steps of a grid, with a sample at their end."""
    if not grid.clock.changes:
        return grid.begun(_WARM_UP_STEPS + 0.5)
    return TimeGrid(grid.clock, np.array([0.0, grid.direction * min(dynamical_time(system), abs(grid.end))]))


def _finished(run: Trajectory, method: Integrator, compile_s: float | None = None) -> Sampled:
    """Return a run's samples, and its cost unless it was opened from a file."""
    units, cost = run.system.units, run.statistics
    if len(run.retired):
        return Sampled(method.label, "ours", compile_s=compile_s, note=f"gave up {few(run.retired.names)}")
    return Sampled(
        method.label,
        "ours",
        q=np.asarray(run.q.to_value(units.length)),
        v=np.asarray(run.v.to_value(units.speed)),
        steps=None if cost is None else cost.steps,
        wall_s=None if cost is None else cost.wall_time,
        compile_s=cost.compile_time if compile_s is None and cost is not None else compile_s,
    )


def _peer(problem: Problem, peer: Peer, grid: TimeGrid, stages: Stages) -> Sampled:
    """Return a peer's samples, or the reason why it has none."""
    reason = peers.unsuited(peer, problem.start.gm, problem.start.softening)
    if grid.clock.changes and peer.fixed_step:
        reason = "it has steps of one length, and this comparison has no dt"
    if reason:
        return Sampled(peer.label, "peer", note=reason + ".")
    how = f"{grid.whole_steps:,} steps" if peer.fixed_step else "steps of its own"
    halves = not peer.fixed_step and int(np.count_nonzero(problem.start.gm == 0)) >= _HALVED_FROM

    def computed() -> Arrays:
        first = _first_step(problem.start, grid)
        with stages.under_way(f"{peer.label}: {counted(len(problem.names), 'body')}, {how}", grid.times) as reached:
            run = peers.run(peer.name, problem.start, times=grid.times, dt=first, reached=reached, halves=halves)
        cost = {"steps": np.array(run.steps), "wall_s": np.array(run.wall_s)}
        notes = [_IN_HALVES] * halves + list(run.warnings)
        return {"q": run.q, "v": run.v, **cost, "warnings": as_array(" ".join(notes))}

    try:
        run = stages.keep(peer.label, computed)
    except IntegrationError as error:
        return Sampled(peer.label, "peer", note=str(error))
    cost = int(run["steps"]), float(run["wall_s"])
    return Sampled(peer.label, "peer", run["q"], run["v"], *cost, note=as_text(run["warnings"]))


def _first_step(start: PointMasses, grid: TimeGrid) -> float:
    """Return dt; without one, a first step for peers that choose their own, short enough for what they begin with."""
    return 0.02 * min(dynamical_time_of(start), abs(grid.end)) if grid.clock.changes else grid.dt


def _judged(row: Row, bounds: tolerance.Bounds, note: ReferenceNote | None, problem: Problem) -> Row:
    """Return the row of one of our methods, with its verdict."""
    if row.verdict == "n/a":
        return replace(row, verdict="FAIL", failures=(row.note,), note="")
    if not bounds:
        return replace(row, verdict="not judged")
    reached = {
        key: value
        for key, value in (("energy", row.energy), ("angular_momentum", row.angular_momentum))
        if value is not None
    }
    unit = f" {problem.length_unit}" if problem.length_unit else ""
    failures = bounds.failures(reached, row.positions, note.errors if note is not None else {}, unit)
    return replace(row, verdict="FAIL" if failures else "ok", failures=failures)


def _steps_note(ours: list[Integrator], theirs: list[Peer], grid: TimeGrid) -> tuple[str, ...]:
    if not isinstance(grid.clock, Adaptive):
        return ()
    tolerances = {f"{grid.clock.tolerance_for(method):.2g}" for method in ours}
    epsilons = [dict(peer.options).get("epsilon") for peer in theirs if not peer.fixed_step]
    at = ", ".join("its default epsilon" if each is None else f"epsilon {each:g}" for each in dict.fromkeys(epsilons))
    theirs_too = f"; IAS15 chooses its own, at {at}" if epsilons else ""
    return (f"Steps: ours are chosen one by one, tolerance {' and '.join(sorted(tolerances))}{theirs_too}.",)


def _threads_note(problem: Problem, threads: int | None) -> tuple[str, ...]:
    used = threads or available_threads()
    if used == 1 or np.all(problem.massive):
        return ()
    return (f"Wall times: ours share the massless particles among {used} threads; REBOUND runs on one.",)


def _in_days(system: System) -> float | None:
    from astropy import units as u

    return float(system.units.time.to(u.day)) if system.units.time.is_equivalent(u.day) else None


def _settings(
    system: System, problem: Problem, grid: TimeGrid, ours: list[Integrator], wanted: Any, title: str | None
) -> dict[str, Any]:
    """Return the settings of the comparison, for JSON."""
    from orbits._version import __version__

    plain = {key: _plain(value) for key, value in (wanted or {}).items()}
    return {
        "title": title or f"{counted(len(problem.names), 'body')}, {len(problem.massive_names)} of them massive",
        "integrators": [methods.describe(method) for method in ours],
        "dt": None if grid.clock.changes else grid.dt,
        "tolerance": grid.clock.tolerance if isinstance(grid.clock, Adaptive) else None,
        "times": [float(grid.times[0]), float(grid.times[-1])],
        "time_unit": str(system.units.time),
        "samples": len(grid.times),
        "bodies": len(problem.names),
        "massive": len(problem.massive_names),
        "units": system.units.name,
        "epoch": None if system.epoch is None else f"{system.epoch.tdb.isot} TDB",
        "tolerances": plain,
        "versions": {"orbits": __version__, "rebound": _rebound_version(), "numpy": np.__version__},
    }


def _rebound_version() -> str:
    from importlib.metadata import version

    return version("rebound")


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _plain(inner) for key, inner in value.items()}
    return value if isinstance(value, int | float) else str(value)
