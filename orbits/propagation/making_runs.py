"""Runs made ready to be marched: of a system from its start, or of an archive from where it ended."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from os import PathLike
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from orbits import integrators
from orbits.archive.pace import PACE, Pace
from orbits.errors import ArchiveError, InputError
from orbits.integrators.base import Integrator
from orbits.marching.clocks.adaptive import Adaptive
from orbits.propagation.checks.before_the_start import (
    check_archived,
    check_before_start,
    check_bodies,
    check_span,
    check_what_is_kept,
)
from orbits.propagation.checks.precision import check_length
from orbits.propagation.checks.rigid_runs import check_rigid
from orbits.propagation.control.heartbeat import Heartbeat
from orbits.propagation.control.stop_conditions import Condition, Conditions, EnergyErrorAbove, check_callback
from orbits.propagation.control.wall_clock import Deadline
from orbits.propagation.events.base import Sought
from orbits.propagation.events.seeking import Seeking
from orbits.propagation.loop import Run, march
from orbits.propagation.march_of_run import march_of_run
from orbits.propagation.marchers import differences, provenance
from orbits.propagation.resuming.sample_store import checkpoint_of, no_accounts
from orbits.propagation.resuming.step_store import StepStore, check_memory, continued, room_for_steps
from orbits.propagation.run_ends import Callback, RunEnds
from orbits.system import System
from orbits.system.model import most_inner
from orbits.time_grid import TimeGrid
from orbits.trajectory import Trajectory
from orbits.trajectory.stored import of_archive

if TYPE_CHECKING:
    from orbits.archive import ArchiveWriter
    from orbits.archive.origin import Origin
    from orbits.certificate import Certificate

Path = str | PathLike[str]


class RunOptions(NamedTuple):
    """How a run is made on a grid of steps and samples: options of `propagate`, and of `resume`, as they are handed on.

    origin : the scenario with options that makes the run, for its archive
    """

    archive: Path | None = None
    overwrite: bool = False
    certificate: bool | Certificate = False
    stop: Condition | Sequence[Condition] = ()
    events: Sought | Sequence[Sought] = ()
    callback: Callback | None = None
    check_step: bool | Literal["refuse"] = True
    approaches: bool | None = None
    dense: bool = False
    progress: bool | None = None
    threads: int | None = None
    heartbeat: Heartbeat | None = None
    wall_time: Deadline | None = None
    origin: Origin | None = None


def propagated(system: System, integrator: Integrator, grid: TimeGrid, **options: Any) -> Trajectory:
    """Propagate `system` on an existing grid of steps and samples; the options are those of `RunOptions`."""
    return march(begun(system, integrator, grid, RunOptions(**options)))


def begun(system: System, integrator: Integrator, grid: TimeGrid, how: RunOptions) -> Run:
    """Return a run on an existing grid of steps and samples, ready to be marched."""
    archive, certificate, dense = how.archive, how.certificate, how.dense
    if archive is not None:
        check_archived(system, integrator)
    conditions = Conditions(how.stop)
    check_callback(how.callback)
    seeking = Seeking(system, conditions.beside(how.events), grid.clock.direction)
    check_bodies(system, integrator)
    check_rigid(system, grid)
    marcher = march_of_run(system, integrator, grid.clock, how.threads, seeking, conditions, how.approaches)
    if grid.clock.changes:
        check_length(system, grid)
    check_before_start(system, integrator, grid, how.check_step, seeking.touching.values())
    watch = RunEnds(system, marcher, conditions, how.callback, bool(how.check_step), seeking, deadline=how.wall_time)
    accounts = no_accounts(len(grid), len(system.forces), most_inner(system))
    check_what_is_kept(system, integrator, seeking, dense=dense)
    if dense and archive is None:
        check_memory(system, integrator, grid)
    steps = StepStore(marcher.current, in_memory=archive is None) if dense else None
    if archive is None:
        if certificate is not None and certificate is not False:
            raise InputError("certificate is stored in an archive: give archive= too, or call orbits.certify")
        known = how.progress, watch, accounts, steps
        return Run(system, integrator, marcher, grid, 0, lambda: None, *known, heartbeat=how.heartbeat)
    from orbits.archive import ArchiveWriter
    from orbits.certificate import Certificate, certify
    from orbits.propagation.events.archived import description_of

    if not isinstance(certificate, bool | Certificate | None):
        raise InputError(f"certificate is a {type(certificate).__name__}; expected True or a result of orbits.certify")
    if certificate is True and isinstance(grid.clock, Adaptive):
        raise InputError("a certificate needs steps of one length: give dt=..., or omit the certificate")
    step = grid.clock if grid.clock.changes else grid.h
    measured = certify(system, integrator, step) if certificate is True else certificate

    def begin() -> ArchiveWriter:
        return ArchiveWriter.create(
            archive,
            system=system,
            integrator=integrators.describe(integrator),
            grid=grid,
            checkpoint=checkpoint_of(marcher, accounts, seeking, Pace()),
            provenance=provenance(),
            certificate=measured.to_json() if measured else "",
            events=description_of(seeking),
            steps=room_for_steps(system, integrator, grid) if dense else 0,
            origin=how.origin,
            approaches=marcher.current.problem.approaches,
            energy_bound=conditions.energy,
            overwrite=how.overwrite,
        )

    known = how.progress, watch, accounts, steps
    return Run(system, integrator, marcher, grid, 0, begin, *known, heartbeat=how.heartbeat)


def resumed(path: Path, how: RunOptions, until: Any = None, *, exactly: bool = True) -> Run | Trajectory:
    """Return the rest of the run in an archive, ready to be marched; the trajectory if it is complete."""
    from orbits.archive import Archive, ArchiveWriter, extended
    from orbits.propagation.resuming.from_checkpoint import last_sample, taken_up
    from orbits.trajectory.archived import made_by

    # Everything below is read under the lock: no second resume can add to the file after this one has read it.
    old = Archive.claim(path)
    try:
        system, (integrator, _) = old.system, made_by(old)
        changed = differences(old.provenance)
        if changed and exactly:
            raise ArchiveError(
                f"{path}: this run was made with a different {', '.join(changed)}; its last bits may come out "
                "differently here. Resume with same_bits=False (--any-bits) to accept that."
            )
        if until is not None and not old.complete:
            raise ArchiveError(f"the run in {path} is not complete yet: resume it without until=..., then extend it")
        grid = old.grid if until is None else old.grid.extended(system, until)
        if old.committed == len(grid) and old.complete:
            old.release()
            return of_archive(Trajectory, old, path=str(path))
        check_span(system, grid)
        place = old.checkpoint(), old.committed
        conditions = Conditions(EnergyErrorAbove(old.energy_bound) if old.energy_bound < math.inf else ())
        again = partial(taken_up, old, grid, place, how.events, exactly=exactly, threads=how.threads)
        marcher, seeking, accounts = again(conditions)
        energy = marcher.home.energy
        if energy is not None and energy.is_exceeded(marcher.home):  # which ended the run; it goes on past it
            conditions = Conditions(())
            marcher, seeking, accounts = again(conditions)
        steps = None if marcher.changed else continued(old, marcher.current)
    except BaseException:
        old.close()
        raise

    def begin() -> ArchiveWriter:
        now, before = checkpoint_of(marcher, accounts, seeking, Pace()), old.checkpoint()
        if until is None and now.keys() - {PACE} == before.keys() - {PACE}:
            return ArchiveWriter.going_on(old)
        # There are more samples, or a file of an earlier version has no room for the list of retired particles.
        return extended(old, grid, now)

    before = last_sample(old, old.committed)
    watch = RunEnds(system, marcher, conditions, None, True, seeking, before, how.wall_time)
    known = how.progress, watch, accounts, steps
    return Run(
        system, integrator, marcher, grid, old.committed, begin, *known, release=old.close, heartbeat=how.heartbeat
    )
