"""`propagate` and `resume`: they read the arguments once, and march a run."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from os import PathLike
from typing import TYPE_CHECKING, Any, Literal, TypedDict, Unpack, cast, overload

from orbits import integrators
from orbits.checks import checked_choice, checked_flag
from orbits.elsewhere import NoOthers, unknown_argument
from orbits.errors import ArchiveError, InputError, shown
from orbits.finding import Finding
from orbits.integrators.base import Integrator
from orbits.propagation.checks.rigid_runs import default_method
from orbits.propagation.control.heartbeat import heartbeat_of
from orbits.propagation.control.stop_conditions import Condition
from orbits.propagation.control.wall_clock import Deadline
from orbits.propagation.events.base import Sought
from orbits.propagation.loop import Run, march
from orbits.propagation.making_runs import Path, RunOptions, begun, resumed
from orbits.propagation.run_ends import Callback
from orbits.propagation.systems import (
    archives_of,
    check_samples,
    each,
    make_folder,
    march_each,
    systems_of,
    threads_of_each,
)
from orbits.system import System
from orbits.time_grid import TimeGrid
from orbits.trajectory import Trajectory

if TYPE_CHECKING:
    from orbits.certificate import Certificate


class Options(TypedDict, total=False):
    """The options of `propagate`."""

    dt: Any
    duration: Any
    until: Any
    samples: Any
    overwrite: bool
    certificate: bool | Certificate
    stop: Condition | Sequence[Condition]
    events: Sought | Sequence[Sought]
    callback: Callback | None
    check_step: bool | Literal["refuse"]
    approaches: bool | None
    dense: bool
    progress: bool | None
    threads: int | None
    error_estimate: bool
    heartbeat: Any
    wall_time: Any


@overload
def propagate(
    system: System,
    integrator: Integrator | str | None = None,
    *,
    archive: Path | None = None,
    **options: Unpack[Options],
) -> Trajectory: ...


@overload
def propagate(
    system: Iterable[System],
    integrator: Integrator | str | None = None,
    *,
    archive: Path | Sequence[Path] | None = None,
    **options: Unpack[Options],
) -> list[Trajectory]: ...


def propagate(
    system: System | Iterable[System],
    integrator: Integrator | str | None = None,
    *,
    dt: Any = None,
    duration: Any = None,
    until: Any = None,
    samples: Any = 101,
    archive: Path | Sequence[Path] | None = None,
    overwrite: bool = False,
    certificate: bool | Certificate = False,
    stop: Condition | Sequence[Condition] = (),
    events: Sought | Sequence[Sought] = (),
    callback: Callback | None = None,
    check_step: bool | Literal["refuse"] = True,
    approaches: bool | None = None,
    dense: bool = False,
    progress: bool | None = None,
    threads: int | None = None,
    error_estimate: bool = False,
    heartbeat: Any = None,
    wall_time: Any = None,
    **others: Unpack[NoOthers],
) -> Trajectory | list[Trajectory]:
    """Propagate `system` and return the samples: `run.t` (n,), `run.q`, `run.v` (n, bodies, 3).

        run = orbits.propagate(system, duration=100 * u.yr)  # steps chosen one by one
        run = orbits.propagate(system, "gauss", dt=6 * u.day, duration="100 yr")  # constant steps, symplectic
        runs = orbits.propagate([system, other], "wisdom-holman", dt="3 d", duration="1e5 yr")  # one for each

    system : a `System`; bodies with GM = 0 are massless particles in the field of the others. Or a list of systems of
        equal shape, with the same numbers of massive bodies and of massless particles, the same units and the same
        samples: the result is a list of trajectories, each with the bits that it has alone
    integrator : a method such as `Gauss(stages=8)`, the default, or its name as on the command line: "gauss",
        "gauss(stages=4)". Systems with rigid bodies need kicks and drifts; their default is `Composition(order=8)`
    dt : None or `orbits.Adaptive()` chooses steps one by one, also through encounters, with errors at the level of
        round-off, for Gauss; massless particles take steps of their own where they need to;
        `orbits.TimeTransformed(step=0.3)` takes constant steps of transformed time, symplectic through near-collisions,
        for a few massive bodies of comparable masses. Or the length of a step: a quantity, a number in the system's
        time unit, or a text such as "6 d", or "P/20" for a fraction of the shortest orbital period; it is rounded to 24
        significant bits (`run.dt` is the step used), and its sign does not matter
    duration : the length of the run: a quantity, a number or a text ("10 yr"); negative for backwards in time
    until : instead, its end: a date (a Time, "2030-01-01", a datetime64; TDB if no scale is given), or a time since
        the epoch (a quantity, a number, "10 yr"); before the epoch for backwards in time
    samples : a number of samples, including both ends, or a sequence of times in the formats of `until`, within the
        run, which goes on to its end wherever they are; a sample off the grid of steps is computed by a partial step on
        a copy, so that samples never change the run
    archive : path of an HDF5 file to write; the trajectory then reads from it, and an interrupted run can be resumed.
        For a list of systems a folder, with a file for each, "{}" in the name of the files for the number of the
        system, as in "runs/{}.h5", or a list of paths
    overwrite : whether an existing archive may be replaced
    certificate : True certifies the integrator on this system with this step before the run, as `orbits.certify`
        does, and stores the certificate in the archive; or an existing certificate
    stop : a condition that ends the run early, such as `orbits.events.EnergyErrorAbove(1e-9)`, or a list of them;
        `run.stopped` then has the condition and the state. An archive can be resumed past it. Distances, as in
        `orbits.events.CloserThan(0.01 * u.au, "Apophis", "Earth")`, are events with then="stop"
    events : what is sought on the motion within steps, such as `orbits.events.CloseApproach("Apophis", "Earth")`, one
        event or a list of them: `run.events` is their table. They change the run only if they stop it, or act
    callback : called after each sample with the time since the epoch, a quantity, and the `System` there; True ends
        the run. With it, or with events, the systems of a list are propagated one after the other
    check_step : warn with `StepWarning` before the run if dt is too long for the fastest passage ahead, and after it
        about close passages that the step did not resolve (see `run.unresolved()`); with `OrbitsWarning` about
        bodies so far from the origin that their separations have few digits. After a run in which bodies merged,
        bounced or were changed, no passages are judged. "refuse" raises InputError instead of the warning before the
        run; False leaves all of this out
    approaches : whether closest approaches are looked for, for `run.closest_approaches()`. None looks for them where
        that takes little time, with Gauss and other implicit methods, and with rigid bodies, to warn of those that
        touch. With maps it may take longer than the steps: True asks for them. The states, events and other warnings
        of a run do not depend on it
    dense : True keeps the state at every step, in memory or in the archive, so that `run.at` answers for any times at
        once: about 0.3 microseconds a body and time. It takes 48 bytes a body and step; the samples are the same. If
        an event changes the bodies there is a warning, and `run.at` marches from the samples, as without it
    progress : None or True shows a progress bar on a terminal, False does not
    threads : number of threads for massless particles, thousands of bodies and lists of systems; None for all
        processors. The bits of the result do not depend on it
    error_estimate : whether the two companions of `run.error_estimate()` are marched after the run, in 2.4 times its
        time; there are none, and a warning, if bodies merge, bounce or are changed on the way
    heartbeat : for logs, instead of the bar: the wall time from line to line, such as "60 s", of lines on standard
        error with the time reached, steps per second, what is left, the drift of energy and angular momentum, and the
        samples in the archive; or an `orbits.Heartbeat`, which gives them to a function
    wall_time : the longest that the run may take, from the call on, such as "2 h", "12:00:00" or seconds: it is then
        ended between two blocks of steps, `run.complete` is False, and `orbits.resume` goes on with its archive to the
        bits of a run that was never ended. For a list of systems, of all together

    Raises InputError for invalid arguments; UnknownNameError for unknown ones, which for arguments of other packages
    names the equivalent; ConvergenceError or SingularityError if a step of the massive bodies fails (a massless
    particle is retired alone, see `run.retired`, with a `RetiredWarning`); StorageError if writing fails or the archive
    is deleted or replaced during the run; Interrupted (a KeyboardInterrupt) after Ctrl-C, SIGTERM or SIGHUP; and what
    your own functions raise, in `events` or `callback`. All except the first two have the samples so far as
    `.trajectory`. For a list of systems, SystemsError if some of them fail, with the trajectories of all.
    """
    for name in others:
        raise unknown_argument(propagate, name)
    deadline = Deadline.of(wall_time)
    given = None if integrator is None else integrators.named(integrator)
    estimated = checked_flag(error_estimate, "error_estimate")

    if estimated and deadline is not None:
        raise InputError(
            "wall_time limits the run alone, but error_estimate=True marches two companions after it, in 2.4 times its "
            "time; leave it out, and call run.error_estimate() when the run is complete."
        )

    def grid_of(one: System) -> TimeGrid:
        return TimeGrid.of(one, dt, duration=duration, until=until, samples=samples)

    how = RunOptions(
        archive=cast("Path | None", archive if isinstance(system, System) else None),
        overwrite=checked_flag(overwrite, "overwrite"),
        certificate=certificate,
        stop=stop,
        events=events,
        callback=callback,
        check_step=check_step,
        approaches=checked_choice(approaches, "approaches"),
        dense=checked_flag(dense, "dense"),
        progress=checked_choice(progress, "progress"),
        threads=threads,
        heartbeat=heartbeat_of(heartbeat),
        wall_time=deadline,
    )
    if isinstance(system, System):
        run = march(begun(system, given or default_method(system), grid_of(system), how))
        return _completed(run, dense, estimated, threads)
    several = systems_of(system)
    method = given or default_method(*several)
    grids = each(len(several), lambda k: grid_of(several[k]))
    check_samples(grids)
    paths = archives_of(archive, len(several), how.overwrite)
    in_turn = bool(callback) or not (isinstance(events, Sequence) and not events)
    of_each = threads if in_turn else threads_of_each(len(several), threads)

    def prepared(k: int) -> Run:
        own = how._replace(archive=paths[k] if paths else None, threads=of_each)
        return begun(several[k], method, grids[k], own)

    ready = each(len(several), prepared)
    make_folder(archive)
    runs = march_each(ready, threads, how.progress, in_turn=in_turn)
    return each(len(runs), lambda k: _completed(runs[k], dense, estimated, threads))


def _completed(run: Trajectory, dense: bool, estimated: bool, threads: int | None) -> Trajectory:
    """Return a run with its error bars, if they are asked for; warn of what a run with changes does not have."""
    merged = run.changes is not None and run.changes.begin_legs
    if merged and dense:
        Finding(
            "dense=True: no steps are kept of a run in which events change the bodies; run.at(times) marches on from "
            "the preceding sample, through the changes: its answers are right, but take longer."
        ).warn()
    if estimated and merged:
        Finding(
            "error_estimate=True: there are no error bars, as bodies merged, bounced or were changed at events; the "
            "run itself is complete."
        ).warn()
    elif estimated:
        from orbits.propagation.results.error_estimate import error_bars

        run.error_bars = error_bars(run, threads)
    return run


class ResumeOptions(TypedDict, total=False):
    """The options of `resume`."""

    until: Any
    events: Sought | Sequence[Sought]
    progress: bool | None
    threads: int | None
    same_bits: bool
    heartbeat: Any
    wall_time: Any


@overload
def resume(path: Path, **options: Unpack[ResumeOptions]) -> Trajectory: ...


@overload
def resume(path: list[Any] | tuple[Any, ...], **options: Unpack[ResumeOptions]) -> list[Trajectory]: ...


def resume(
    path: Path | list[Any] | tuple[Any, ...],
    *,
    until: Any = None,
    events: Sought | Sequence[Sought] = (),
    progress: bool | None = None,
    threads: int | None = None,
    same_bits: bool = True,
    heartbeat: Any = None,
    wall_time: Any = None,
) -> Trajectory | list[Trajectory]:
    """Continue the run in an archive, bit for bit as if it had never stopped.

    path : an archive written by `propagate`; or a list of archives, as of a list of systems, for a list of trajectories
    until : for a finished run, the date or the time since the epoch to which it is extended, as in `propagate`, with
        samples as dense as before; None completes an interrupted run
    events : those of the run, if an archive cannot hold them: functions of your own, and what acts. Others are known
    same_bits : refuse if the processor, Numba or the kernels have changed, because the last bits may then change, and
        functions in `events` whose code is not that of the run; False resumes anyway
    heartbeat, wall_time : as in `propagate`

    Raises ArchiveError for a file that cannot be resumed; otherwise as `propagate`.
    """
    exactly = checked_flag(same_bits, "same_bits")
    how = RunOptions(
        events=events,
        progress=checked_choice(progress, "progress"),
        threads=threads,
        heartbeat=heartbeat_of(heartbeat),
        wall_time=Deadline.of(wall_time),
    )
    if isinstance(path, str | PathLike):
        if os.path.isdir(path):
            raise ArchiveError(
                f"{path} is a folder; expected an archive, or a list of them: for those in it, "
                f"orbits.resume(sorted(pathlib.Path({os.fspath(path)!r}).glob('*.h5')))."
            )
        run = resumed(path, how, until, exactly=exactly)
        return run if isinstance(run, Trajectory) else march(run)
    if not isinstance(path, Iterable) or getattr(path, "shape", None) == ():
        raise ArchiveError(f"path is {shown(path)}; expected the path of an archive, or a list of paths.")
    paths = list(path)
    if not paths:
        raise ArchiveError("the list of archives is empty; expected a path, or a list with at least one.")
    in_turn = not (isinstance(events, Sequence) and not events)
    of_each = threads if in_turn else threads_of_each(len(paths), threads)
    runs: list[Run | Trajectory] = []

    def take(k: int) -> None:
        runs.append(resumed(paths[k], how._replace(threads=of_each), until, exactly=exactly))

    try:
        each(len(paths), take)
    except BaseException:
        for run in runs:  # archives that were claimed are left as they are
            if isinstance(run, Run):
                run.release()
        raise
    return march_each(runs, threads, how.progress, in_turn=in_turn)
