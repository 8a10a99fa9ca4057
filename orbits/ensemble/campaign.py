"""`Campaign`: the results of an ensemble in a folder, complete or while they grow."""

from __future__ import annotations

import hashlib
import os
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from astropy import units as u

from orbits.body_names import index_of
from orbits.checks import is_whole
from orbits.ensemble.store import Entry, Store
from orbits.ensemble.summaries import FAILED as MEMBER_FAILED
from orbits.ensemble.tasks import DONE, FAILED
from orbits.errors import ArchiveError, InputError, shown
from orbits.propagation import Trajectory

if TYPE_CHECKING:
    from astropy.table import QTable

WAITING = "waiting"
"""The state of a member whose block is not done yet."""

_READING = threading.Lock()
"""Held while a block is read, which another thread may want to replace by its own."""

LENGTHS, ANGLES, TIMES = ("a_min", "a_max", "closest"), ("inc_min", "inc_max"), ("end", "closest_at", "unresolved_at")


@dataclass(frozen=True)
class Progress:
    """How far a campaign is.

    blocks, done, failed : numbers of blocks: all, those that are done, and those of which nothing could be integrated
    members, members_done : all members, and those of blocks that are done
    survivors : members that were integrated to the end
    seconds : of work of all workers so far
    members_failed : members that could not be integrated, of failed blocks and of blocks that are done
    """

    blocks: int
    done: int
    failed: int
    members: int
    members_done: int
    survivors: int
    seconds: float
    members_failed: int

    @property
    def complete(self) -> bool:
        """Whether no block is left."""
        return self.done + self.failed == self.blocks

    def __str__(self) -> str:
        failed = f", {self.failed:,} failed" if self.failed else ""
        members = f"; {self.members_failed:,} could not be integrated" if self.members_failed else ""
        return (
            f"{self.done:,} of {self.blocks:,} blocks done{failed}: {self.members_done:,} of {self.members:,} members, "
            f"{self.survivors:,} of them to the end{members}; {self.seconds:,.1f} s of work"
        )


class Campaign:
    """The results of an ensemble. Returned by `orbits.ensemble.run`, and by `orbits.ensemble.open` while it runs too.

        campaign.summary                  a row for each member: what became of it, extremes of its orbit, MEGNO
        campaign["Ceres"]                 its trajectory; campaign.run("Ceres") that of its whole block
        campaign.map("e_max")             a column over the axes of a grid
        campaign.progress, campaign.failed, campaign.failed_members

    folder : of the store, which is read anew each time
    """

    def __init__(self, store: Store) -> None:
        self._store = store
        self.folder = store.folder
        self._block: tuple[tuple[Path, int, int], Trajectory] | None = None  # that was read last

    @property
    def progress(self) -> Progress:
        """How far it is."""
        entries, store = self._store.entries().values(), self._store
        done = [entry for entry in entries if entry.state == DONE]
        return Progress(
            blocks=store.blocks,
            done=len(done),
            failed=sum(entry.state == FAILED for entry in entries),
            members=int(store.about["members"]),
            members_done=sum(entry.last - entry.first for entry in done),
            survivors=sum(entry.survivors for entry in done),
            seconds=sum(entry.seconds for entry in entries),
            members_failed=sum(self._store.failures(entry) for entry in entries),
        )

    @property
    def complete(self) -> bool:
        """Whether all blocks are done, or could not be integrated."""
        return self.progress.complete

    @property
    def failed(self) -> dict[int, str]:
        """Why blocks could not be integrated, by their numbers."""
        return {entry.block: entry.reason for entry in self.blocks if entry.state == FAILED}

    @property
    def failed_members(self) -> dict[str, str]:
        """Why members could not be integrated, by their names: those of failed blocks, and systems of the others."""
        found: dict[str, str] = {}
        for entry in self.blocks:
            if not self._store.failures(entry):
                continue
            names = self.names[entry.first : entry.last]
            if entry.state == FAILED:
                found |= dict.fromkeys(names, entry.reason)
                continue
            columns = self._store.columns(entry)
            rows = zip(names, columns["state"].tolist(), columns["reason"].tolist(), strict=True)
            found |= {name: reason for name, state, reason in rows if state == MEMBER_FAILED}
        return found

    @property
    def blocks(self) -> list[Entry]:
        """The blocks that are done or failed, in their order: members, files, seconds, worker."""
        return [entry for _, entry in sorted(self._store.entries().items())]

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The names of the members."""
        return tuple(self._store.members()["name"].tolist())

    @property
    def bits(self) -> str:
        """A hash of all samples and of the table: equal for campaigns that have the same bits.

        Raises InputError before all blocks are done.
        """
        if not self.complete:
            raise InputError(f"the bits of a campaign are known when it is complete; so far: {self.progress}.")
        return hashlib.sha256("".join(entry.bits + entry.state for entry in self.blocks).encode()).hexdigest()

    @property
    def summary(self) -> QTable:
        """An astropy QTable with a row for each member, and these columns.

        name, block, and for grids the parameters
        state : "survived", "stopped" (an event or a condition ended its block or system), "lost" (a particle that was
            retired), "failed", or "waiting" for its block
        end : the time that it reached since the epoch;  reason : why not the end
        a_min, a_max, e_min, e_max, inc_min, inc_max : over the samples, about the most massive body; of systems
            (members, bodies), in the order of meta["bodies"], those of the first member, and then of bodies of other
            names; NaN for the most massive one and those that are not there
        closest, closest_to, closest_at : the closest approach to another body than the one that dominates the system,
            with 90 % of its mass, if one does, and its time; infinity if none came near, NaN if bodies with mass
            merge, bounce or are changed. Of systems that of the two bodies that came closest. Not if the plan has
            approaches=False
        megno, unresolved_at : if asked for; NaN for lost particles and where bodies with mass merge, bounce or are
            changed; and when the first passage was that its method cannot follow
        energy_error : of systems, the largest relative deviation at the samples, with what mergers and bounces took
        """
        from astropy.table import QTable

        store = self._store
        count, units = int(store.about["members"]), store.about["units"]
        columns: dict[str, Any] = {}
        known = store.members()
        for name, values in known.items():
            columns[name] = _with_unit(values, store.about["columns"].get(name, ""))
        columns["block"] = np.arange(count) // int(store.about["block"])
        columns["state"] = np.full(count, WAITING, dtype="U8")
        found: dict[str, Any] = {}
        for entry in self.blocks:
            rows = slice(entry.first, entry.last)
            if entry.state == FAILED:
                columns["state"][rows] = MEMBER_FAILED
                _fill(found, "reason", np.full(entry.last - entry.first, entry.reason), rows, count)
                continue
            for name, values in store.columns(entry).items():
                if name == "state":
                    columns["state"][rows] = values
                else:
                    _fill(found, name, values, rows, count)
        kinds = {**dict.fromkeys(LENGTHS, units["length"]), **dict.fromkeys(ANGLES, "rad"),
                 **dict.fromkeys(TIMES, units["time"])}  # fmt: skip
        columns |= {name: _with_unit(values, kinds.get(name, "")) for name, values in found.items()}
        meta = {"folder": str(self.folder), "made_by": store.about["title"], "bodies": store.about["bodies"]}
        return QTable(columns, meta=meta, copy=False)

    def map(self, column: str) -> Any:
        """Return a column of the table over the axes of a grid: an array of their lengths; see `axes`.

        Raises InputError for an ensemble that is no grid, and for a column that the table does not have.
        """
        axes = self._store.about["axes"]
        if not axes:
            raise InputError("this ensemble is no grid, so it has no map; its table is campaign.summary.")
        table = self.summary
        if column not in table.colnames:
            raise InputError(f"the table has no column {shown(column)}; expected one of {', '.join(table.colnames)}.")
        values = table[column]
        return np.reshape(values, (*axes.values(), *values.shape[1:]))

    @property
    def axes(self) -> dict[str, Any]:
        """The values of each axis of a grid, by name; empty for other ensembles."""
        shape = list(self._store.about["axes"].values())
        table = {name: np.reshape(values, shape) for name, values in self._store.members().items() if name != "name"}
        return {
            name: _with_unit(np.moveaxis(table[name], k, 0).reshape(shape[k], -1)[:, 0], self._unit(name))
            for k, name in enumerate(self._store.about["axes"])
        }

    def run(self, member: str | int) -> Trajectory:
        """Return the trajectory with a member: of its block of particles, or of its system.

        member : its name, or its number. Raises UnknownNameError for an unknown name; ArchiveError if its block is not
        done, failed, or has no samples; InputError for a number that there is not.
        """
        return Trajectory.open(self._path(self._index(member)))

    def __getitem__(self, member: str | int) -> Any:
        """Return the trajectory of a member: of a particle its own, as run["Ceres"]; of a system the whole. Raises as
        `run`.
        """
        if self._store.about["kind"] != "particles":
            return self.run(member)
        k = self._index(member)
        path = self._path(k)
        status = path.stat()
        key = path, status.st_ino, status.st_mtime_ns  # a file that is damaged is replaced
        with _READING:
            if self._block is None or self._block[0] != key:  # a block has many members
                if self._block is not None:
                    self._block[1].close()
                    self._block = None
                self._block = key, Trajectory.open(path)
            return self._block[1][self.names[k]]

    def _path(self, k: int) -> Path:
        """Return the archive with a member. Raises ArchiveError if there is none."""
        block = k // int(self._store.about["block"])
        name = self.names[k]
        entry = self._store.entries().get(block)
        if entry is None or entry.state == FAILED:
            what = "is not done yet" if entry is None else f"could not be integrated: {entry.reason}"
            raise ArchiveError(f"{name!r} is in block {block}, which {what}")
        stem = self._store.stem(block)
        particles = self._store.about["kind"] == "particles"
        path = self.folder / (f"{stem}.h5" if particles else f"{stem}/{k - entry.first:05d}.h5")
        if not path.exists():
            kept = self._store.about["identity"]["trajectories"] == "kept"
            why = "it could not be integrated; see campaign.summary" if kept else "the campaign keeps no samples"
            raise ArchiveError(f"{name!r} has no trajectory: {why}.")
        return path

    def __len__(self) -> int:
        return int(self._store.about["members"])

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    def verify(self) -> dict[int, str]:
        """Return what is wrong with the files of blocks that are done, by their numbers; empty if all is well.

        A campaign that is run again does this first, and computes such blocks again.
        """
        found = {entry.block: self._store.damaged(entry) for entry in self.blocks if entry.state == DONE}
        return {block: what for block, what in found.items() if what}

    def __repr__(self) -> str:
        return f"Campaign({os.fspath(self.folder)!r}: {self._store.about['title']}; {self.progress})"

    def _unit(self, name: str) -> str:
        return str(self._store.about["columns"].get(name, ""))

    def _index(self, member: str | int) -> int:
        if isinstance(member, str):
            return index_of(member, self.names, "member")
        if not is_whole(member) or not -len(self) <= member < len(self):
            raise InputError(f"member is {shown(member)}; expected a name, or a number up to {len(self) - 1}.")
        return int(member) % len(self)


def open_campaign(folder: str | PathLike[str]) -> Campaign:
    """Return the campaign in a folder, complete or not; it may be running.

    Raises ArchiveError for a folder that is not that of a campaign.
    """
    return Campaign(Store.opened(Path(folder)))


def _with_unit(values: Any, unit: str) -> Any:
    return u.Quantity(values, unit, copy=False) if unit else values


def _fill(found: dict[str, Any], name: str, values: Any, rows: slice, count: int) -> None:
    """Write the rows of a block into a column, which is made, or made wider, where that is needed."""
    if name not in found:
        blank = "" if values.dtype.kind == "U" else np.nan
        found[name] = np.full((count, *values.shape[1:]), blank, dtype=values.dtype)
    elif found[name].dtype != values.dtype:
        found[name] = found[name].astype(np.promote_types(found[name].dtype, values.dtype))
    if found[name].shape[1:] != values.shape[1:]:
        width = max(found[name].shape[1:], values.shape[1:])
        wider = np.full((count, *width), np.nan)
        wider[(slice(None), *(slice(0, size) for size in found[name].shape[1:]))] = found[name]
        found[name] = wider
    found[name][(rows, *(slice(0, size) for size in values.shape[1:]))] = values
