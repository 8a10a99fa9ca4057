"""The loop of a run from sample to sample, and what becomes of it at its end."""

from __future__ import annotations

import shlex
import time
from collections.abc import Callable, Generator
from contextlib import nullcontext, suppress
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np

from orbits.archive.ended import FAILED, INTERRUPTED, STOPPED, Ended
from orbits.archive.pace import PACE, Pace
from orbits.errors import (
    EventError,
    IntegrationError,
    Interrupted,
    OrbitsError,
    OrbitsWarning,
    StorageError,
    with_unit,
)
from orbits.integrators.base import Integrator
from orbits.integrators.forms import Array
from orbits.marching.clocks.step_times import Place
from orbits.marching.legs.march import AT_ONCE, March
from orbits.propagation.checks.after_the_run import found_in
from orbits.propagation.control.heartbeat import Beats, Heartbeat
from orbits.propagation.control.progress import Progress
from orbits.propagation.control.signals import StopRequest
from orbits.propagation.events.base import Sample
from orbits.propagation.events.functions import Raised
from orbits.propagation.particles_of_run import ParticlesOfRun
from orbits.propagation.results.recording import observed_until
from orbits.propagation.resuming.marching_again import lost_by_the_end
from orbits.propagation.resuming.sample_store import SampleStore
from orbits.propagation.run_ends import RunEnds
from orbits.system import System
from orbits.time_grid import TimeGrid
from orbits.trajectory import Excursions, RetiredParticles, Statistics, Trajectory
from orbits.trajectory.stored import of_archive

if TYPE_CHECKING:
    from orbits.archive import ArchiveWriter
    from orbits.propagation.resuming.step_store import StepStore


Marching = Generator[Place | None, None, Trajectory]
"""A run that is marched block by block; see `marching`."""

_NOTHING = np.zeros(0)


class Bar(Protocol):
    """What shows the progress of a run."""

    def update(self, done: float, steps: int) -> None:
        """Take note of the time reached, and of the number of steps."""

    def close(self) -> None:
        """End it."""


class Run(NamedTuple):
    """A run that is ready to be marched from sample `first` to the last one.

    begin : opens the archive to write to, if there is one
    accounts, steps : see `SampleStore`
    release : gives up an archive that was claimed to go on with it; for a run that is not marched
    heartbeat : the lines that it gives on its way, or None
    """

    system: System
    integrator: Integrator
    marcher: March
    grid: TimeGrid
    first: int
    begin: Callable[[], ArchiveWriter | None]
    progress: bool | None
    watch: RunEnds
    accounts: Array
    steps: StepStore | None = None
    release: Callable[[], None] = lambda: None
    heartbeat: Heartbeat | None = None

    def bar(self, label: str) -> Progress:
        """Return a bar that shows its progress."""
        unit, begun = self.system.units.time, (self.marcher.time, self.marcher.step)
        return Progress(self.progress, label=label, total=self.grid.end, unit=unit, begun=begun)


def march(run: Run) -> Trajectory:
    """March a run; however it ends, the archive is left closed and readable."""
    return to_its_end(marching(run))


def to_its_end(steps: Marching) -> Trajectory:
    """Go on with what `marching` returned to its end."""
    while True:
        try:
            next(steps)
        except StopIteration as end:
            trajectory: Trajectory = end.value
            return trajectory


def marching(run: Run, stopped_by: StopRequest | None = None, bar: Bar | None = None) -> Marching:
    """March a run block by block: before each block, yield the place to which it leads; when all is marched, and before
    warnings are given, None.

    stopped_by : a request for several runs at once; None for one of its own
    bar : what shows progress; None for a bar or a heartbeat of its own
    """
    system, integrator, marcher, grid, watch = run.system, run.integrator, run.marcher, run.grid, run.watch
    begun, known = time.perf_counter(), len(marcher.retired())
    failure: Any = None  # an IntegrationError, a StorageError, or what a function of the user raised
    writer: ArchiveWriter | None = None
    complete = False
    try:
        # Signals are caught before there is a file, so that no file is left without a message on how to go on.
        with StopRequest() if stopped_by is None else nullcontext(stopped_by) as stop:
            writer = run.begin()
            marcher.compile()
            compiled = time.perf_counter()
            pace = Pace.from_now(marcher.time) if writer is not None and writer.has(PACE) else None
            room = len(grid) - run.first
            store = SampleStore(len(system.names), room, writer, run.accounts, watch.events, run.steps, pace)
            if bar is None and run.heartbeat is not None:  # that of several runs is given together
                bar = Beats(run.heartbeat, run, writer)
            elif bar is None:
                bar = run.bar(integrator.label)
            try:
                try:
                    particles = ParticlesOfRun(run)
                    complete = yield from _sample(run, store, bar, stop, particles)
                    watch.events.complete()
                    particles.end()
                except (IntegrationError, Raised) as error:
                    failure = error.error if isinstance(error, Raised) else error
                    try:
                        watch.events.complete()
                    except (EventError, Raised) as other:
                        if not isinstance(error, EventError | Raised):
                            failure.add_note(f"Besides, the search for events had ended before: {other}")
                store.ended = _how(run, complete, failure, stop)
                store.commit(marcher)
                bar.update(_reached(run, complete), marcher.step)
            except StorageError as error:
                failure = error
            finally:
                bar.close()
        evaluations, of_particles = marcher.home.stepper.counts()
        statistics = Statistics(
            steps=marcher.step,
            evaluations=evaluations,
            particle_evaluations=of_particles,
            wall_time=time.perf_counter() - compiled,
            compile_time=compiled - begun,
        )
        try:
            trajectory = _result(run, store, writer, statistics)
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
    trajectory._span = 0.0, _reached(run, complete)
    trajectory._events = watch.events.table()
    trajectory.changes = marcher.changes()
    lost = lost_by_the_end(marcher, trajectory)
    trajectory._retired = RetiredParticles.of(system, grid.clock, lost, trajectory.changes)
    excursions = marcher.excursions()
    if excursions is not None:
        trajectory._excursions = Excursions.of(system, grid.clock, *excursions)
    if marcher.changed:
        trajectory._kept = None  # steps are of the bodies of the start
    else:
        leg = marcher.home
        trajectory._record = grid.clock.to_be_judged(lambda: marcher.current.record(observed_until(trajectory)))
        if trajectory._record is None and trajectory._place is None:  # in memory, or its archive is no longer there
            trajectory._ended = leg.problem.approaches, leg.checkpoint_at_end()
    yield None
    try:
        with StopRequest() as late:
            for finding in found_in(trajectory, watch, known):
                finding.warn()
        if late.name:
            raise Interrupted(f"{late.name} came when the run was done; it is complete", trajectory=trajectory)
    except OrbitsWarning as warning:  # raised as errors: the run is not lost
        warning.trajectory = trajectory
        if failure is None and not _was_stopped(stop, trajectory, watch):
            raise
    if failure is not None:
        with suppress(AttributeError, TypeError):  # an exception of the user may have no room for it
            failure.trajectory = trajectory
        raise failure
    if _was_stopped(stop, trajectory, watch):
        at = with_unit(f"{marcher.time:,.6g} of {grid.end:,.6g}", system.units.time)
        how = (
            f"go on with: orbits resume {shlex.quote(str(writer.path))}"
            if writer is not None
            else "nothing was stored; give archive=... to be able to resume"
        )
        what = f"stopped by {stop.name} at {at}, {len(trajectory)} of {len(grid)} samples done"
        raise Interrupted(what, how, trajectory=trajectory)
    return trajectory


def march_into(run: Run, writer: Any, stop: StopRequest, bar: Bar) -> None:
    """March a run whose samples and checkpoints go to `writer`, which has the `commit` of an `ArchiveWriter`;
    without a trajectory, and without warnings. Raises what a run that fails raises.
    """
    room = len(run.grid) - run.first
    store = SampleStore(len(run.system.names), room, writer, run.accounts, run.watch.events)
    try:
        run.marcher.compile()
        for _ in _sample(run, store, bar, stop, ParticlesOfRun(run)):
            pass
        store.commit(run.marcher)
    finally:
        bar.close()
        run.marcher.close()


def _was_stopped(stop: StopRequest, trajectory: Trajectory, watch: RunEnds) -> bool:
    """Return whether a signal ended a run early."""
    return bool(stop.name) and not trajectory.complete and watch.stopped is None


def _result(run: Run, store: SampleStore, writer: ArchiveWriter | None, statistics: Statistics) -> Trajectory:
    if writer is not None:
        # From the file that was written, even if its path now refers to another one.
        path = str(writer.path) if writer.in_place else None
        return of_archive(Trajectory, writer.to_archive(), path=path, statistics=statistics)
    (q, v, accounts), grid = store.arrays(), run.grid
    return Trajectory(
        run.system,
        grid.times[: len(q)].copy(),
        q,
        v,
        step=grid.clock,
        integrator=run.integrator,
        statistics=statistics,
        complete=len(q) == len(grid) and (store.ended.finished or not grid.goes_on),
        accounts=accounts,
        kept=None if store.steps is None else store.steps.kept,
    )


def _reached(run: Run, finished: bool) -> float:
    """Return the time up to which a run was marched."""
    if finished:
        return run.grid.end
    stopped = run.watch.stopped
    return run.marcher.time if stopped is None else float(stopped.time.value)


def _how(run: Run, finished: bool, failure: Exception | None, stop: StopRequest) -> Ended:
    """Return how a run ended."""
    how = why = ""
    if run.watch.stopped is not None:
        how, why = STOPPED, run.watch.stopped.reason
    elif failure is not None:
        how, why = FAILED, f"{type(failure).__name__}: {failure}"
    elif stop.name and not finished:
        how, why = INTERRUPTED, stop.name
    return Ended(finished, _reached(run, finished), how, why)


def _sample(
    run: Run, store: SampleStore, bar: Bar, stop: StopRequest, particles: ParticlesOfRun
) -> Generator[Place, None, bool]:
    """Visit every sample of a run, and its end, until a stop is requested; return whether it came to its end. The place
    to which the next block leads is yielded before it.
    """
    marcher, grid, watch = run.marcher, run.grid, run.watch
    watch.begun = time.perf_counter()
    places, events, index = grid.places, watch.events, run.first
    goals, count = len(grid.goals), len(grid)
    alone = particles.may_end or watch.callback is not None  # what may end the run at each sample
    singly = 0  # the sample up to which blocks end before each, as a partial step from within one failed
    while index < goals:
        if stop.name:
            return False
        place = places.at(index)
        if marcher.is_before(place):
            room = 1 if alone or index < singly else max(store.room, 1)
            last = index + marcher.samples.together(places.between(index, min(index + room, goals)))
            if last > index + 1:
                place = places.at(last - 1)
            yield place
            failure: IntegrationError | None = None
            try:
                marcher.approach(place)
            except IntegrationError as error:
                failure = error
            passed = marcher.samples.passed(places.between(index, min(last, count))) if last > index + 1 else 0
            q = v = accounts = _NOTHING
            if passed:
                try:
                    q, v = marcher.samples.in_block(places.between(index, index + passed))
                    accounts = marcher.samples.accounts()
                except IntegrationError:
                    singly = last
                    continue
            step = marcher.step
            found = watch.after()  # with a failure, in the steps before it
            steps = marcher.step
            if found is not None:
                early = (grid.times[index : index + passed] - found.time) * grid.direction < 0.0
                passed = int(np.count_nonzero(early))
            elif steps != step:
                passed = min(passed, marcher.samples.passed(places.between(index, index + passed)))
            if passed:
                store.add(q[:passed], v[:passed], accounts[:passed])
                particles.reach(grid.goals[index : index + passed], q, v, later=failure is not None)
                index += passed
            bar.update(marcher.time, steps)
            if failure is not None and found is None:
                raise failure
            if stop.name or watch.interrupted(found) or watch.ended(done=index == goals):
                return False
            if store.full and index < goals:  # the last one is committed with the end of the run
                store.commit(marcher)
            continue
        goal = float(grid.goals[index])
        while events.of_bodies.interrupts:  # those between the last step and the sample
            found = watch.ahead(goal)
            if watch.interrupted(found):
                return False
            if found is None:
                break
        if index == count and not particles and events.stops is None:
            break
        single = alone or bool(events.of_bodies.interrupts) or events.stops is not None
        most = 1 if single else max(min(store.room, AT_ONCE, count - index), 1)
        q, v = marcher.samples.ahead(places.between(index, index + most))
        sample, accounts = Sample(goal, q[0], v[0]), marcher.samples.accounts()
        if watch.interrupted(events.before_sample(marcher.current, sample)):
            return False
        if particles.reach(grid.goals[index : index + len(q)], q, v):
            return False
        if index == count:
            break
        store.add(q, v, accounts)
        index += len(q)
        if watch.called_back(sample, accounts[0]):
            return False
        if store.full and index < goals:
            store.commit(marcher)
    while (found := watch.events.before(marcher.current, grid.end, record=True)) is not None:
        if watch.interrupted(found):
            return False
    watch.at_end(grid.end)
    return True
