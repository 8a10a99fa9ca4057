"""The loop of a run from sample to sample, and all the ways in which it can end."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from astropy import units as u
from numpy.typing import NDArray

from orbits.errors import IntegrationError, Interrupted, OrbitsError, RetiredWarning, StepWarning, StorageError
from orbits.integrators.base import Integrator
from orbits.propagation import judgement, kepler_splitting
from orbits.propagation.passages_seen import Record
from orbits.propagation.progress import Progress
from orbits.propagation.replay import REPLAY, seen_by
from orbits.propagation.sample_store import SampleStore
from orbits.propagation.signals import StopRequest
from orbits.propagation.stop_conditions import Condition, Conditions, Stop, asks_to_stop
from orbits.system import System
from orbits.time_grid import TimeGrid
from orbits.trajectory import RetiredParticles, Statistics, Trajectory
from orbits.trajectory.retired import absent, moved

if TYPE_CHECKING:
    from orbits.archive import ArchiveWriter
    from orbits.marching.marcher import Marcher

Array = NDArray[np.float64]
Callback = Callable[[u.Quantity, System], object]


@dataclass
class RunEnds:
    """The conditions that may end a run early, and the one that did."""

    conditions: Conditions
    callback: Callback | None
    check_step: bool
    stopped: Stop | None = None
    begun: float = 0.0

    def ended(self, system: System, marcher: Marcher) -> bool:
        """Return whether a condition that ends the run holds, and note it."""
        found = None if marcher.met is None else self.conditions.met(*marcher.met)
        found = found or self.conditions.overdue(time.perf_counter() - self.begun)
        if found is not None:
            self.note(system, marcher.time, marcher.state(), *found)
        return found is not None

    def note(
        self, system: System, now: float, state: tuple[Array, Array], reason: str, condition: Condition | None
    ) -> None:
        """Record the reason, the time and the state: q and v, (bodies, 3)."""
        at = _moved(system, now, *state)
        t = u.Quantity(now, system.units.time)
        self.stopped = Stop(f"{reason} at t = {t:.10g}", condition, t, at)


def march(
    system: System,
    integrator: Integrator,
    marcher: Marcher,
    grid: TimeGrid,
    first: int,
    begin: Callable[[], ArchiveWriter | None],
    progress: bool | None,
    watch: RunEnds,
    accounts: Array,
) -> Trajectory:
    """March from sample `first` to the last one; however it ends, the archive is left closed and readable.

    accounts : see `SampleStore`
    begin : opens the archive to write to, if there is one
    """
    begun, known = time.perf_counter(), len(marcher.retired())
    failure: IntegrationError | StorageError | None = None
    writer: ArchiveWriter | None = None
    try:
        # Signals are caught before there is a file, so that no file is left without a message on how to go on.
        with StopRequest() as stop:
            writer = begin()
            marcher.compile()
            compiled = time.perf_counter()
            store = SampleStore(len(system.names), len(grid) - first, writer, accounts)
            unit, steps = system.units.time, grid.whole_steps
            bar = Progress(progress, label=integrator.label, total=grid.end, unit=unit, steps=steps)
            try:
                try:
                    _sample(system, marcher, grid, first, store, bar, stop, watch)
                except IntegrationError as error:
                    failure = error
                finally:
                    bar.close()
                store.commit(marcher)
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
            trajectory = _result(system, integrator, grid, store, writer, statistics)
        except OrbitsError as error:
            # If the device has failed, the committed samples may not be readable either.
            raise failure or error from None
    except BaseException:
        if writer is not None:
            writer.close()
        raise
    finally:
        marcher.close()
    trajectory.stopped = watch.stopped
    trajectory._retired = RetiredParticles.of(system, grid.clock, marcher.retired())
    trajectory.record = Record.of(marcher, float(trajectory.times[-1]) if len(trajectory) else 0.0)
    try:
        if len(trajectory.retired) > known:
            judgement.warn_of_retired(trajectory)
        if watch.check_step and len(trajectory.record.listed):
            with StopRequest() as late:
                warn = kepler_splitting.warn_of_encounters if integrator.follows_kepler else judgement.warn_of
                warn(trajectory, seen_by(trajectory))
            if late.name:
                raise Interrupted(f"{late.name} came when the run was done; it is complete", trajectory=trajectory)
    except (RetiredWarning, StepWarning) as warning:  # warnings may be raised as errors: the run is not lost
        warning.trajectory = trajectory
        if failure is None and not _was_stopped(stop, trajectory, watch):
            raise
    if failure is not None:
        failure.trajectory = trajectory
        raise failure
    if _was_stopped(stop, trajectory, watch):
        at = f"{marcher.time:,.6g} of {grid.end:,.6g} {system.units.time}".rstrip()
        how = (
            f"go on with: orbits resume {writer.path}"
            if writer is not None
            else "nothing was stored; give archive=... to be able to resume"
        )
        raise Interrupted(
            f"stopped by {stop.name} at {at}, {len(trajectory)} of {len(grid)} samples done; {how}",
            trajectory=trajectory,
        )
    return trajectory


def _was_stopped(stop: StopRequest, trajectory: Trajectory, watch: RunEnds) -> bool:
    """Return whether a signal ended a run early."""
    return bool(stop.name) and not trajectory.complete and watch.stopped is None


def _result(
    system: System,
    integrator: Integrator,
    grid: TimeGrid,
    store: SampleStore,
    writer: ArchiveWriter | None,
    statistics: Statistics,
) -> Trajectory:
    if writer is not None:
        # From the file that was written, even if its path now refers to another one.
        path = str(writer.path) if writer.in_place else None
        return Trajectory.of_archive(writer.to_archive(), path=path, statistics=statistics, again=REPLAY)
    q, v, accounts = store.arrays()
    return Trajectory(
        system,
        grid.times[: len(q)].copy(),
        q,
        v,
        step=grid.clock,
        integrator=integrator,
        statistics=statistics,
        complete=len(q) == len(grid),
        again=REPLAY,
        accounts=accounts,
    )


def _sample(
    system: System,
    marcher: Marcher,
    grid: TimeGrid,
    first: int,
    store: SampleStore,
    bar: Progress,
    stop: StopRequest,
    watch: RunEnds,
) -> None:
    """Visit every sample from `first` on, until a stop is requested."""
    watch.begun = time.perf_counter()
    for index in range(first, len(grid)):
        if stop.name:
            return
        place = grid.place(index)
        while marcher.is_before(place):
            marcher.approach(place)
            bar.update(marcher.time)
            if stop.name or watch.ended(system, marcher):
                return
            if store.overdue:
                store.commit(marcher)
        state = marcher.state_at(place)
        store.note(marcher.accounts())
        store.add(*state)
        if watch.callback is not None:
            t = float(grid.times[index])
            if asks_to_stop(watch.callback, u.Quantity(t, system.units.time), _moved(system, t, *state)):
                watch.note(system, t, state, "the callback ended the run", None)
                return
        if store.full:
            store.commit(marcher)
    if marcher.clock.changes and (len(watch.conditions.stops) or watch.conditions.energy < np.inf):
        with suppress(IntegrationError):
            end = marcher.ended_at(grid.end)  # the last step of the march leads beyond the run
            if end.met is not None:
                watch.note(system, end.time, end.state(), *watch.conditions.met(*end.met))


def _moved(system: System, t: float, q: Array, v: Array) -> System:
    return moved(system, q, v, t, absent(q, v, system.massive))
