"""`propagate` and `resume`: one loop from sample to sample, in memory or into an archive."""

from __future__ import annotations

import inspect
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from os import PathLike
from typing import TYPE_CHECKING, Any, TypedDict, Unpack

import numpy as np
from astropy import units as u
from numpy.typing import NDArray

from orbits import integrators
from orbits.checks import checked_flag
from orbits.elsewhere import keyword_hint
from orbits.errors import (
    ArchiveError,
    InputError,
    IntegrationError,
    Interrupted,
    OrbitsError,
    StepWarning,
    StorageError,
    UnknownNameError,
)
from orbits.integrators.base import Integrator
from orbits.integrators.marcher import Marcher
from orbits.propagation import guidance, judgement
from orbits.propagation.binding import bound, differences, provenance, restore
from orbits.propagation.grid import (
    MOST_SAMPLES,
    checked_progress,
    checked_until,
    length_of_run,
    sample_times,
    signed_step,
    split,
    whole_steps,
)
from orbits.propagation.guidance import parsed_step
from orbits.propagation.memory import MEMORY_SHARE, memory
from orbits.propagation.passages_seen import Record
from orbits.propagation.progress import Progress
from orbits.propagation.replay import REPLAY, seen_by
from orbits.propagation.signals import StopRequest
from orbits.propagation.stopping import Condition, Conditions, Stop, asks_to_stop, check_callback
from orbits.system import System
from orbits.trajectory import Statistics, Trajectory

if TYPE_CHECKING:
    from orbits.archive import Archive, ArchiveWriter
    from orbits.certificate import Certificate

Array = NDArray[np.float64]
Path = str | PathLike[str]
Callback = Callable[[u.Quantity, System], object]

CHUNK_BYTES = 16 * 1024 * 1024
"""Samples kept in memory before they are written."""

COMMIT_SECONDS = 10.0
"""An archive is committed at least this often: a lost machine costs no more than this."""

FIRST_COMMIT_SECONDS = 0.25
"""How long a run into an archive marches before its first commit after the start."""

COMMIT_SHARE = 0.25
"""Commits grow rarer with a run, up to `COMMIT_SECONDS`: a lost machine costs this share of what was computed."""


class NoOthers(TypedDict):
    """No further arguments: what is given all the same is answered with what there is instead."""


def propagate(
    system: System,
    integrator: Integrator | str,
    *,
    dt: Any,
    duration: Any = None,
    until: Any = None,
    samples: Any = 101,
    archive: Path | None = None,
    overwrite: bool = False,
    certificate: bool | Certificate = False,
    stop: Condition | Sequence[Condition] = (),
    callback: Callback | None = None,
    check_step: bool = True,
    progress: bool | None = None,
    threads: int | None = None,
    **others: Unpack[NoOthers],
) -> Trajectory:
    """Propagate `system` with constant steps and return the samples: `run.t` (n,), `run.q`, `run.v` (n, bodies, 3).

    system : a `System`; bodies with GM = 0 are massless particles in the field of the others
    integrator : e.g. `Gauss(stages=8)`, or its name as on the command line: "gauss", "gauss(stages=4)"
    dt : the length of a step, a quantity or a number in the system's time unit, or a text: "6 d", or "P/20" for a
        fraction of the shortest orbital period; rounded to 24 significant bits (`run.dt` is the step used). Its sign
        does not matter
    duration : how far to go, a quantity, a number or a text ("10 yr"); negative for backwards in time
    until : instead, the end: a date (a Time, "2030-01-01", a datetime64; TDB where no scale is said), or a time since
        the epoch (a quantity, a number, "10 yr"); before the epoch for backwards in time
    samples : a count that includes both ends, or times in a row, each as `until` takes it; off the grid of steps a
        sample is a partial step on a copy, so that sampling never changes the run
    archive : path of an HDF5 file to write; the trajectory then reads from it, and an interrupted run can be resumed
    overwrite : whether an existing archive may be replaced
    certificate : True measures what the integrator declares on this system with this step before the run, as
        `orbits.certify` does, and stores it in the archive; or a certificate that is there already
    stop : conditions that end the run early, such as `orbits.CloserThan(0.01 * u.au, "Apophis", "Earth")`, one or a
        list; `run.stopped` then says which one and holds the state. An archive can be resumed past it.
    callback : called after each sample with the time since the epoch, a quantity, and the `System` there; True ends
        the run
    check_step : warn with `StepWarning` before the run if dt is too long for the fastest passage that is ahead, and
        after it of close passages that the step could not resolve (see `run.closest_approaches()`)
    progress : None or True draws a bar on a terminal, False never
    threads : for massless particles and thousands of bodies; None takes all processors. The result does not depend on
        it, to the last bit.

    Raises InputError for what cannot be run, UnknownNameError for an argument that there is not, with what is there in
    the place of those of other packages; ConvergenceError or SingularityError for a step that fails, StorageError when
    writing fails or the archive is deleted or replaced meanwhile, Interrupted (a KeyboardInterrupt) after Ctrl-C,
    SIGTERM or SIGHUP; all but the first two with the samples so far as `.trajectory`.
    """
    for name in others:
        known = (key for key in inspect.signature(propagate).parameters if key != "others")
        raise UnknownNameError(f"propagate() has no argument {name!r}: {keyword_hint(name, known)}")
    if not isinstance(system, System):
        raise InputError(f"system must be an orbits.System, got {type(system).__name__}")
    integrator = integrators.named(integrator)
    length = length_of_run(system, duration, until)
    h = signed_step(system.units, parsed_step(system, dt, length), length)
    times = sample_times(system, samples, length)
    conditions = Conditions(system, stop)
    check_callback(callback)
    progress = checked_progress(progress)
    marcher = bound(system, integrator, h, threads, conditions)
    if checked_flag(check_step, "check_step"):
        guidance.check_step(system, integrator, h, length)
    watch = _Watch(conditions, callback, check_step)
    if archive is None:
        if certificate is not None and certificate is not False:
            raise InputError("certificate is stored in an archive: give archive= too, or call orbits.certify")
        return _march(system, integrator, marcher, times, 0, lambda: None, progress, watch)
    from orbits.archive import ArchiveWriter
    from orbits.certificate import Certificate, certify

    if not isinstance(certificate, bool | Certificate | None):
        raise InputError(f"certificate is a {type(certificate).__name__}; expected True or what orbits.certify returns")
    measured = certify(system, integrator, h) if certificate is True else certificate

    replace = checked_flag(overwrite, "overwrite")

    def begin() -> ArchiveWriter:
        return ArchiveWriter.create(
            archive,
            system=system,
            integrator=integrators.describe(integrator),
            dt=h,
            times=times,
            checkpoint=marcher.checkpoint(),
            provenance=provenance(),
            certificate=measured.to_json() if measured else "",
            overwrite=replace,
        )

    return _march(system, integrator, marcher, times, 0, begin, progress, watch)


def resume(
    path: Path,
    *,
    until: Any = None,
    progress: bool | None = None,
    threads: int | None = None,
    same_bits: bool = True,
) -> Trajectory:
    """Go on with the run in an archive, bit for bit as if it had never stopped.

    path : an archive written by `propagate`
    until : for a finished run, the date or the time since the epoch to extend it to, as `propagate` takes it, sampled
        as densely as before; None completes an interrupted run
    same_bits : refuse when processor, Numba or the kernels have changed since, because the last bits then may; False
        goes on all the same

    Raises ArchiveError for a file that cannot be resumed; otherwise as `propagate`.
    """
    from orbits.archive import Archive, ArchiveWriter, extended
    from orbits.trajectory.run import made_by

    progress = checked_progress(progress)
    # All that follows is read behind the lock: a second resume cannot add to the file after this one has looked.
    old = Archive.claim(path)
    try:
        system, h = old.system, old.dt
        integrator, _ = made_by(old)
        changed = differences(old.provenance)
        if changed and checked_flag(same_bits, "same_bits"):
            raise ArchiveError(
                f"{path}: this run was made with a different {', '.join(changed)}; its last bits may come out "
                "differently here. Resume with same_bits=False (--any-bits) to accept that."
            )
        target = None if until is None else checked_until(system, until, h)
        times = old.times if target is None else _extended_times(old, target)
        if old.committed == len(times):
            old.release()
            return Trajectory.of_archive(old, path=str(path), again=REPLAY)
        marcher = bound(system, integrator, h, threads)
        restore(marcher, old.checkpoint(), path)
        _check_place(marcher, times, old.committed, path)
    except BaseException:
        old.close()
        raise

    def begin() -> ArchiveWriter:
        return ArchiveWriter.going_on(old) if target is None else extended(old, times)

    watch = _Watch(Conditions(system, ()), None, True)
    return _march(system, integrator, marcher, times, old.committed, begin, progress, watch)


def _check_place(marcher: Marcher, times: Array, committed: int, path: Path) -> None:
    """Refuse a checkpoint that does not lie between the last sample that is there and the next one."""
    steps, _ = split(times, marcher.h)
    last = int(steps[committed - 1]) if committed else 0
    if not last <= marcher.step <= int(steps[committed]):
        raise ArchiveError(
            f"{path} is damaged: its checkpoint is at step {marcher.step}, but the samples before and after it are at "
            f"steps {last} and {int(steps[committed])}. Restore it from a copy."
        )


def _extended_times(old: Archive, target: float) -> Array:
    times = old.times
    if not old.complete:
        raise ArchiveError(f"the run in {old.path} is not complete yet: resume it without until=..., then extend it")
    end = float(times[-1])
    direction = np.sign(old.dt)
    if (target - end) * direction < 0.0:
        raise InputError(f"until = {target:g} lies before the end of the run, {end:g} {old.system.units.time}")
    if len(times) < 2:
        return times if target == end else np.array([end, target])
    spacing = (end - times[0]) / (len(times) - 1)
    count = int(np.floor((target - end) / spacing * (1 + 1e-12)))
    if count > MOST_SAMPLES:
        raise InputError(
            f"until = {target:g} asks for {count:.3g} more samples; at most {MOST_SAMPLES:.0e} are possible"
        )
    more = end + spacing * np.arange(1, count + 1)
    if count and abs(more[-1] - target) <= 1e-9 * abs(spacing):
        more[-1] = target
    elif target != end:
        more = np.append(more, target)
    return np.concatenate([times, more])


def _march(
    system: System,
    integrator: Integrator,
    marcher: Marcher,
    times: Array,
    first: int,
    begin: Callable[[], ArchiveWriter | None],
    progress: bool | None,
    watch: _Watch,
) -> Trajectory:
    """March from sample `first` to the last one; every way out leaves the archive closed and readable.

    begin : opens the archive to write to, if there is one
    """
    begun = time.perf_counter()
    failure: IntegrationError | StorageError | None = None
    writer: ArchiveWriter | None = None
    try:
        # A signal is noted before there is a file, so that none is left behind without a word of how to go on.
        with StopRequest() as stop:
            writer = begin()
            marcher.compile()
            compiled = time.perf_counter()
            keeper = _Keeper(len(system.names), times, first, writer)
            end = float(times[-1])
            steps = whole_steps(end, marcher.h)
            bar = Progress(progress, label=integrator.label, total=end, unit=system.units.time, steps=steps)
            try:
                try:
                    _sample(system, marcher, times, first, keeper, bar, stop, watch)
                except IntegrationError as error:
                    failure = error
                finally:
                    bar.close()
                keeper.commit(marcher)
            except StorageError as error:
                failure = error
        statistics = Statistics(
            steps=marcher.step,
            evaluations=marcher.evaluations,
            particle_evaluations=marcher.particle_evaluations,
            wall_time=time.perf_counter() - compiled,
            compile_time=compiled - begun,
        )
        try:
            trajectory = _result(system, integrator, marcher.h, times, keeper, writer, statistics)
        except OrbitsError as error:
            # From a device that has failed, what was committed can perhaps not be read either.
            raise failure or error from None
    except BaseException:
        if writer is not None:
            writer.close()
        raise
    finally:
        marcher.close()
    trajectory.stopped = watch.stopped
    trajectory.record = Record.of(marcher, float(trajectory.times[-1]) if len(trajectory) else 0.0)
    try:
        if watch.check_step and len(trajectory.record.listed):
            with StopRequest() as late:
                judgement.warn_of(trajectory, seen_by(trajectory))
            if late.name:
                raise Interrupted(f"{late.name} came when the run was done; it is complete", trajectory=trajectory)
    except StepWarning as warning:  # an error by the filters that are set: the run is not lost by it
        warning.trajectory = trajectory
        if failure is None and not _was_stopped(stop, trajectory, watch):
            raise
    if failure is not None:
        failure.trajectory = trajectory
        raise failure
    if _was_stopped(stop, trajectory, watch):
        at = f"{marcher.step * marcher.h:,.6g} of {times[-1]:,.6g} {system.units.time}".rstrip()
        how = (
            f"go on with: orbits resume {writer.path}"
            if writer is not None
            else "nothing was stored; give archive=... to be able to resume"
        )
        raise Interrupted(
            f"stopped by {stop.name} at {at}, {len(trajectory)} of {len(times)} samples done; {how}",
            trajectory=trajectory,
        )
    return trajectory


def _was_stopped(stop: StopRequest, trajectory: Trajectory, watch: _Watch) -> bool:
    """Whether a signal ended a run before its end."""
    return bool(stop.name) and not trajectory.complete and watch.stopped is None


def _result(
    system: System,
    integrator: Integrator,
    h: float,
    times: Array,
    keeper: _Keeper,
    writer: ArchiveWriter | None,
    statistics: Statistics,
) -> Trajectory:
    if writer is not None:
        # Through the file that was written, whatever its path leads to by now.
        path = str(writer.path) if writer.in_place else None
        return Trajectory.of_archive(writer.to_archive(), path=path, statistics=statistics, again=REPLAY)
    q, v = keeper.arrays()
    return Trajectory(
        system,
        times[: len(q)],
        q,
        v,
        step=h,
        integrator=integrator,
        statistics=statistics,
        complete=len(q) == len(times),
        again=REPLAY,
    )


@dataclass
class _Watch:
    """What may end a run early, and what did."""

    conditions: Conditions
    callback: Callback | None
    check_step: bool
    stopped: Stop | None = None
    begun: float = 0.0

    def ended(self, system: System, marcher: Marcher) -> bool:
        """Note whether a condition holds that ends the run."""
        found = None if marcher.met is None else self.conditions.met(*marcher.met)
        found = found or self.conditions.overdue(time.perf_counter() - self.begun)
        if found is not None:
            self.note(system, marcher, *found)
        return found is not None

    def note(self, system: System, marcher: Marcher, reason: str, condition: Condition | None) -> None:
        """Keep the reason and the state."""
        at = _moved(system, marcher.step * marcher.h, *marcher.state())
        t = u.Quantity(marcher.step * marcher.h, system.units.time)
        self.stopped = Stop(f"{reason} at t = {t:.10g}", condition, t, at)


def _moved(system: System, t: float, q: Array, v: Array) -> System:
    epoch = None if system.epoch is None else system.epoch + u.Quantity(t, system.units.time)
    return system.replaced(q=q, v=v, epoch=epoch)


def _sample(
    system: System,
    marcher: Marcher,
    times: Array,
    first: int,
    keeper: _Keeper,
    bar: Progress,
    stop: StopRequest,
    watch: _Watch,
) -> None:
    """Visit every sample from `first` on, or as many as there are before a stop is asked for."""
    watch.begun = time.perf_counter()
    steps, remainders = split(times, marcher.h)
    for index in range(first, len(times)):
        if stop.name:
            return
        while marcher.step < steps[index]:
            marcher.advance(min(marcher.block, int(steps[index]) - marcher.step))
            bar.update(marcher.step * marcher.h)
            if stop.name or watch.ended(system, marcher):
                return
            if keeper.overdue:
                keeper.commit(marcher)
        state = marcher.state_after(float(remainders[index]))
        keeper.add(*state)
        if watch.callback is not None:
            t = float(times[index])
            if asks_to_stop(watch.callback, u.Quantity(t, system.units.time), _moved(system, t, *state)):
                watch.note(system, marcher, "the callback ended the run", None)
                return
        if keeper.full:
            keeper.commit(marcher)


class _Keeper:
    """Collects samples; hands them to the archive chunk by chunk, or keeps them all when there is none."""

    def __init__(self, bodies: int, times: Array, first: int, writer: ArchiveWriter | None) -> None:
        self._writer = writer
        room = len(times) - first
        if writer is not None:
            room = min(room, max(1, CHUNK_BYTES // (48 * bodies)))
        needed = 48 * room * bodies
        if needed > MEMORY_SHARE * memory():
            raise InputError(
                f"{room} samples of {bodies} bodies need {needed / 2**30:.1f} GiB of memory, more than this machine "
                "has to give; take fewer samples, or give archive=... to write them to a file as they come"
            )
        self._q = np.empty((room, bodies, 3))
        self._v = np.empty((room, bodies, 3))
        self._count = 0
        self._begun = self._committed_at = time.perf_counter()

    @property
    def full(self) -> bool:
        """Whether there is no room for another sample before a commit."""
        return self._writer is not None and (self._count == len(self._q) or self.overdue)

    @property
    def overdue(self) -> bool:
        """Whether the archive should be brought up to date: soon after the start, and then ever more rarely."""
        if self._writer is None:
            return False
        elapsed = self._committed_at - self._begun
        pause = min(COMMIT_SECONDS, max(FIRST_COMMIT_SECONDS, COMMIT_SHARE * elapsed))
        return time.perf_counter() - self._committed_at > pause

    def add(self, q: Array, v: Array) -> None:
        """Take one more sample."""
        self._q[self._count], self._v[self._count] = q, v
        self._count += 1

    def commit(self, marcher: Marcher) -> None:
        """Make everything taken so far durable, together with the state to go on from."""
        if self._writer is not None:
            self._writer.commit(self._q[: self._count], self._v[: self._count], marcher.checkpoint())
            self._count = 0
            self._committed_at = time.perf_counter()

    def arrays(self) -> tuple[Array, Array]:
        """Return what was kept."""
        return self._q[: self._count], self._v[: self._count]
