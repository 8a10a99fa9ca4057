"""Running a campaign: blocks go to workers, and their results into the folder as they come."""

from __future__ import annotations

import os
import sys
import uuid
from collections import deque
from collections.abc import Callable, Mapping
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from orbits.archive.storage import human
from orbits.body_names import few
from orbits.checks import checked_choice, checked_flag, whole_number
from orbits.ensemble.bars import Bar
from orbits.ensemble.campaign import Campaign
from orbits.ensemble.dask_workers import Dask, distributed_package
from orbits.ensemble.members import Ensemble
from orbits.ensemble.plan import Plan
from orbits.ensemble.store import ABOUT, FORMAT, Entry, Store
from orbits.ensemble.summaries import primary_of, units_of_table
from orbits.ensemble.tasks import DONE, FAILED, INTERRUPTED, REFUSED, Outcome, Task
from orbits.ensemble.workers import Processes, Threads, Workers
from orbits.errors import (
    InputError,
    Interrupted,
    OrbitsWarning,
    StepWarning,
    counted,
    shown,
)
from orbits.finding import SHOWN, Finding
from orbits.marching.legs.leg import available_threads
from orbits.propagation.control.signals import StopRequest
from orbits.propagation.marchers import BITS_DEPEND_ON, differences, provenance

PAUSE = 0.2
"""Seconds between two looks at signals and at the bar."""

TRIES = 3
"""How often a block is begun whose workers are lost."""

GRACE = 60.0
"""Seconds in which blocks have to stop after a request; what has not stopped by then is done again the next time."""

MUCH = 2e9
"""The bytes of results from which on it is said that they are checked."""

Say = Callable[[str], None]


def run(
    ensemble: Ensemble | Plan,
    store: str | PathLike[str],
    *,
    integrator: Any = None,
    megno: bool | dict[str, Any] = False,
    trajectories: bool = True,
    block: int | None = None,
    client: Any = None,
    workers: int | None = None,
    processes: bool = False,
    retry: bool = False,
    progress: bool | None = None,
    say: Say | None = None,
    **options: Any,
) -> Campaign:
    """Integrate all members of an ensemble, in blocks, and return the `Campaign` in the folder `store`.

        belt = orbits.ensemble.particles(planets, orbits.asteroids(100_000))
        campaign = orbits.ensemble.run(belt, "belt.campaign", duration="1 Myr", dt="8 d", integrator="wisdom-holman")

    ensemble : from `particles`, `clones`, `grid` or `systems` of `orbits.ensemble`; or a `Plan`, which has all that
        follows up to `block`
    store : a folder, in which results are kept as they come: an archive for each block, a table, an index. If it is
        that of the same campaign, stopped before its end, it goes on; blocks whose files are damaged are done again
    integrator, dt, duration, until, samples, events, stop, check_step : as in `orbits.propagate`; two samples by
        default, at the start and at the end. An event that names a massless member is sought in its block
    megno : True for MEGNO of each member, or a dict of options of `orbits.megno`
    trajectories : whether samples are kept; False for the table alone
    block : members that are integrated together, by default as many as make the overhead of a block small. The bits of
        a particle do not depend on it
    client : a `distributed.Client` or the address of a Dask scheduler, whose workers then integrate the blocks; they
        need not see the folder. Needs orbits[distributed]
    workers : the number of threads, by default one for each processor
    processes : take processes of this machine instead of threads: for systems that a function makes in much Python
    retry : try again the blocks that could not be integrated before, or have members that could not
    progress : whether a bar is shown on terminals and in notebooks
    say : receives a line for what is taken over, damaged or lost; by default they go to standard error on terminals

    The same block gives the same bits in a thread, a process and on a worker. A block that cannot be integrated is
    listed in `campaign.failed`, its members and single systems that cannot be in `campaign.failed_members`, with a
    warning at the end, and the others go on; so does a block whose worker was lost, elsewhere. Raises InputError for
    wrong arguments, a cluster that does not answer, and workers of other versions; ArchiveError for a folder with
    another campaign, or one of an earlier version, or that another process runs; StorageError if the disk is too small,
    before the start, or fails; MissingPackageError without Dask; Interrupted after Ctrl-C, SIGTERM or SIGHUP, with the
    campaign so far as `.trajectory`: the same call goes on.
    """
    if isinstance(ensemble, Plan):
        asked = {
            "integrator": integrator is not None, "block": block is not None,
            "megno": megno is not False, "trajectories": trajectories is not True,
        }  # fmt: skip
        if given := [*options, *(name for name, here in asked.items() if here)]:
            raise InputError(f"a Plan has its own {given[0]}; change it by plan.changed({given[0]}=...).")
        plan = ensemble
    else:
        own = {"integrator": integrator, "megno": megno, "trajectories": trajectories, "block": block}
        plan = Plan(ensemble, **own, **options)
    count = available_threads() if workers is None else whole_number(workers, "workers, if given,")
    processes, retry = checked_flag(processes, "processes"), checked_flag(retry, "retry")
    progress = checked_choice(progress, "progress")
    if client is not None:
        distributed_package()
        if processes or workers is not None:
            raise InputError("client=... brings its own workers; leave out workers and processes.")
    if not isinstance(store, str | PathLike):
        raise InputError(f"store is {shown(store)}; expected the path of a folder, such as 'belt.campaign'.")
    tell = say or _to_terminal
    folder = Path(os.path.abspath(store))
    about, needed = _about(plan, folder)
    kept = Store.begun(folder, about, _members(plan.ensemble))
    try:
        pending = _pending(kept, retry, tell)
        if not pending:
            return _ended(kept)
        done = 1.0 - len(pending) / kept.blocks
        plan.check_disk(folder, needed, done)
        with StopRequest() as stop:
            loop = _Loop(plan, kept, pending, stop, tell)
            team = _team(client, count, processes, folder, loop)
            members = len(plan.ensemble)
            bar = Bar(progress, f"{counted(members, 'member')}, {team.what}", members, loop.members)
            try:
                team.warm(plan.task(0, plan.ensemble.sample(), stem="sample"))
                loop.march(team, bar)
            finally:
                bar.close()
                team.close()
        if stop.name and not Campaign(kept).complete:
            raise Interrupted(
                f"stopped by {stop.name}: {Campaign(kept).progress}. All of it is in {folder}; the same call goes on.",
                trajectory=open_again(folder),
            )
        return _ended(kept)
    finally:
        kept.close()


class _Loop:
    """The blocks of a campaign on their way to workers and into the folder."""

    def __init__(self, plan: Plan, store: Store, pending: list[int], stop: StopRequest, say: Say) -> None:
        self.plan, self.store, self.stop, self.say = plan, store, stop, say
        self.name = uuid.uuid4().hex[:12]
        self.made_by = provenance()
        self.waiting = deque(pending)
        self.tries: dict[int, int] = {}
        self.busy: set[int] = set()
        self.failed = 0
        waiting = set(pending)
        spans = [store.span(block) for block in range(store.blocks) if block not in waiting]
        self.blocks, self.members = len(spans), sum(last - first for first, last in spans)

    def task(self, block: int, *, sends: bool) -> Task:
        """Return a block as it is sent; with what there is of it, if workers do not see the folder."""
        known = {key: self.made_by[key] for key in ("orbits", *BITS_DEPEND_ON)}
        unfinished = self.store.unfinished(block) if sends and self.plan.trajectories else {}
        stem = self.store.stem(block)
        part = self.plan.ensemble.part(*self.store.span(block))
        table = {key: self.store.about[key] for key in ("units", "bodies")}
        return self.plan.task(block, part, stem=stem, made_by=known, unfinished=unfinished, run=self.name, **table)

    def march(self, team: Workers, bar: Bar) -> None:
        """Send blocks, and keep what comes back, until all are done or a stop is requested."""
        asked, patience = False, GRACE / PAUSE
        while self.busy or (self.waiting and not self.stop.name):
            if self.stop.name and not asked:
                asked = True
                self.say(f"{self.stop.name}: the blocks at work stop at the end of their steps; what is done is kept")
                team.stop(self.stop.name)
            if asked:
                patience -= 1
                if patience < 0:
                    return
            while self.waiting and not self.stop.name and len(self.busy) < team.slots + team.ahead:
                block = self.waiting.popleft()
                self.busy.add(block)
                self.tries[block] = self.tries.get(block, 0) + 1
                team.submit(self.task(block, sends=team.remote))
            found = team.result(PAUSE)
            if found is not None:
                self._take(*found)
            size = self.store.about["block"]
            done = min(self.members + team.fractions() * size, len(self.plan.ensemble))
            bar.show(done, self.blocks, self.store.blocks, min(len(self.busy), team.slots), self.failed)

    def _take(self, block: int, outcome: Outcome | BaseException | None) -> None:
        """Keep the outcome of a block, or begin it again. Raises what concerns the whole campaign."""
        self.busy.discard(block)
        if outcome is None:
            if self.stop.name:
                return
            if self.tries[block] < TRIES:
                self.say(f"block {block}: its worker was lost; it is done again")
                self.waiting.append(block)
                return
            outcome = Outcome(block, FAILED, f"its worker was lost {TRIES} times; is there too little memory?")
        if isinstance(outcome, BaseException):
            raise outcome
        if outcome.state == REFUSED:
            raise InputError(
                f"the worker {outcome.worker} has {outcome.reason}: its bits would differ. All blocks that are done "
                "are kept; install the same versions, and the same call goes on."
            )
        if outcome.state == INTERRUPTED:
            self.store.keep(outcome)
            return
        entry = self.store.add(outcome, self.tries[block])
        first, last = self.store.span(block)
        self.blocks, self.members = self.blocks + 1, self.members + last - first
        self.failed += self.store.failures(entry)
        if outcome.state == FAILED:
            self.say(f"block {block} could not be integrated: {outcome.reason}")


def _team(client: Any, count: int, processes: bool, folder: Path, loop: _Loop) -> Workers:
    """Return the workers."""
    if client is not None:
        return Dask(client, loop.name, loop.made_by)
    count = min(count, len(loop.waiting))
    return Processes(count, folder) if processes else Threads(count, folder)


def _about(plan: Plan, folder: Path) -> tuple[dict[str, Any], int]:
    """Return what a campaign is, for its folder, and about how many bytes it takes."""
    system = plan.first()
    massive = int(system.massive.sum())
    ensemble, grid, units = plan.ensemble, plan.grid(system), system.units
    grid.clock.check(plan.integrator)
    others = massive if ensemble.kind == "particles" else len(system)
    block = plan.block_size(grid, others)
    if plan.block is None and (folder / ABOUT).exists():
        block = int(Store.opened(folder).about["block"])  # the same, whatever is chosen by later versions
    plan.check_events(block)
    steps = f"dt = {grid.dt:g} {units.time}".rstrip() if grid.h == grid.h else "steps chosen one by one"
    span = f"{grid.end:g} {units.time}".rstrip()
    about = {
        "format": FORMAT,
        "title": f"{len(ensemble):,} {ensemble.kind}, {plan.integrator.label}, {steps}, {span}",
        "kind": ensemble.kind,
        "members": len(ensemble),
        "block": block,
        "units": units_of_table(system),
        "columns": {name: str(getattr(values, "unit", "") or "") for name, values in ensemble.columns.items()},
        "axes": {name: len(values) for name, values in ensemble.axes.items()},
        "bodies": np.array(system.names)[system.massive | (ensemble.kind != "particles")].tolist(),
        "primary": primary_of(system),
        "identity": {**plan.identity(), "block": str(block)},
        "provenance": provenance(),
    }
    return about, plan.bytes_needed(grid, others, block)


def _members(ensemble: Ensemble) -> dict[str, Any]:
    columns = {name: getattr(values, "value", values) for name, values in ensemble.columns.items()}
    return {"name": list(ensemble.names), **columns}


def _pending(store: Store, retry: bool, say: Say) -> list[int]:
    """Return the blocks that are left, those first that were begun; files of damaged ones are removed."""
    entries = store.entries()
    changed = differences(store.about["provenance"])
    if changed and len(entries) < store.blocks:
        raise InputError(
            f"{store.folder}: this campaign was begun with a different {', '.join(changed)}; the last bits of the "
            "other blocks may come out differently here. Go on with the same versions, or begin anew in another folder."
        )
    pending, size = [], sum(size for entry in entries.values() for size, _ in entry.files.values())
    if size > MUCH:
        say(f"{human(size)} of results are compared with their checksums")
    for block in range(store.blocks):
        entry: Entry | None = entries.get(block)
        if entry is not None and entry.state == DONE:
            wrong, failures = store.damaged(entry), store.failures(entry) if retry else 0
            if not wrong and not failures:
                continue
            say(f"block {block}: {wrong or counted(failures, 'member') + ' failed'}; it is done again")
            store.forget(block)
        elif entry is not None and not retry:
            continue
        pending.append(block)
    if entries and pending:
        say(f"{store.blocks - len(pending):,} of {store.blocks:,} blocks are there already")
    return pending


def _ended(store: Store) -> Campaign:
    """Return the campaign, and warn of what failed and of what its blocks warned of."""
    campaign = Campaign(Store(store.folder, store.about))
    entries = campaign.blocks
    failed = campaign.failed
    if failed:
        told = f"{len(failed):,} of {store.blocks:,} blocks could not be integrated; see campaign.failed:"
        rows = [f"block {block}: {reason}" for block, reason in list(failed.items())[:SHOWN]]
        Finding(told, rows=rows, hidden=len(failed) - SHOWN).warn()
    if len(campaign.failed_members) > sum(entry.last - entry.first for entry in entries if entry.block in failed):
        _members_failed(campaign).warn()
    found: dict[str, dict[str, dict[str, set[int]]]] = {}  # by category, kind and text
    for entry in entries:
        for category, text, *kind in entry.warnings:  # no kind in an index of earlier versions
            kinds = found.setdefault(category, {})
            kinds.setdefault(kind[0] if kind else text, {}).setdefault(text, set()).add(entry.block)
    for category, kinds in found.items():
        groups = sorted(kinds.values(), key=lambda group: -len(set().union(*group.values())))
        lines = [_told(group, store.blocks) for group in groups[:SHOWN]]
        if len(groups) > SHOWN:
            lines.append(f"and {len(groups) - SHOWN:,} others; see campaign.blocks[k].warnings")
        Finding("\n".join(lines), StepWarning if category == StepWarning.__name__ else OrbitsWarning).warn()
    return campaign


def _members_failed(campaign: Campaign) -> Finding:
    """Return what is told of members that could not be integrated: how many, and why, the commonest first."""
    failed = campaign.failed_members
    reasons: dict[str, list[str]] = {}
    for name, reason in failed.items():
        reasons.setdefault(reason, []).append(name)
    groups = sorted(reasons.items(), key=lambda group: -len(group[1]))
    return Finding(
        f"{len(failed):,} of {len(campaign):,} members could not be integrated; see campaign.failed_members:",
        rows=[f"{few(names)}: {reason}" for reason, names in groups[:SHOWN]],
        hidden=len(groups) - SHOWN,
        where=" reasons",
    )


def _told(group: Mapping[str, set[int]], count: int) -> str:
    """Return warnings of one kind: how many blocks have one, and the most frequent text."""
    text = max(group, key=lambda text: len(group[text]))
    blocks = f"{len(set().union(*group.values())):,} of {count:,} blocks"
    more = f" ({len(group):,} texts that differ in figures, in campaign.blocks[k].warnings; this is one)"
    return f"{blocks}{more * (len(group) > 1)}: {text}"


def open_again(folder: Path) -> Campaign:
    """Return the campaign in a folder, for reading."""
    return Campaign(Store.opened(folder))


def _to_terminal(text: str) -> None:
    if sys.stderr.isatty():
        print(text, file=sys.stderr)
