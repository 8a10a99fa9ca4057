"""The folder of a campaign: what it is, an index of its blocks, an archive and a table for each.

    campaign.json        what the campaign is, written once
    members.npz          names of the members, and what is known of them beforehand, written once
    index.jsonl          a line for each block that is done or could not be integrated, added when all else is on disk
    block-00012.h5       the archive of a block of particles; of systems, a folder with an archive for each
    block-00012.npz      the table of its members
    campaign.lock        held by the process that runs the campaign
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import socket
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbits.archive.storage import Storage, sync_folder
from orbits.ensemble.tasks import DONE, FAILED, Outcome, files_of, fingerprint
from orbits.errors import ArchiveError, StorageError

FORMAT, EARLIER = "orbits campaign 2", "orbits campaign 1"
"""The format that is written, and one that is read but not gone on with: its identity does not tell all it must."""

ABOUT, MEMBERS, INDEX, LOCK = "campaign.json", "members.npz", "index.jsonl", "campaign.lock"

Columns = dict[str, NDArray[Any]]


@dataclass(frozen=True)
class Entry:
    """A line of the index: a block that is done, or that could not be integrated.

    first, last : its members;  state : done or failed;  files : size and SHA-256 of each, by name
    bits : a hash of all its samples and its table;  attempts : how often it was begun
    """

    block: int
    first: int
    last: int
    state: str
    reason: str = ""
    files: Mapping[str, tuple[int, str]] = field(default_factory=dict)
    bits: str = ""
    survivors: int = 0
    stopped: int = 0
    seconds: float = 0.0
    marching: float = 0.0
    worker: str = ""
    attempts: int = 1
    warnings: tuple[tuple[str, ...], ...] = ()


class Store:
    """The folder of a campaign. Made by `Store.begun` for the process that runs it, by `Store.opened` for readers."""

    def __init__(self, folder: Path, about: dict[str, Any]) -> None:
        self.folder, self.about = folder, about
        self._lock: Storage | None = None

    @classmethod
    def opened(cls, folder: Path) -> Store:
        """Return the store in a folder, for reading. Raises ArchiveError for anything else."""
        if not folder.is_dir():
            found = "is a file" if folder.exists() else "does not exist"
            raise ArchiveError(f"{folder} {found}; expected the folder of a campaign of orbits.ensemble.run.")
        try:
            about = json.loads((folder / ABOUT).read_text(encoding="utf-8"))
            if about["format"] not in (FORMAT, EARLIER):
                raise ArchiveError(
                    f"{folder} has format {about['format']!r}; this version of orbits reads {FORMAT!r}. It was written "
                    "by a newer one: pip install --upgrade orbits."
                )
        except FileNotFoundError:
            raise ArchiveError(f"{folder} is not the folder of a campaign: it has no {ABOUT}.") from None
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise ArchiveError(f"{folder / ABOUT} is damaged ({error}); restore it from a copy.") from error
        return cls(folder, about)

    @classmethod
    def begun(cls, folder: Path, about: dict[str, Any], members: Mapping[str, Any]) -> Store:
        """Return the store for running a campaign, new or to be continued, locked.

        Raises ArchiveError for a folder with other things, with another campaign, saying what differs, or with one of
        an earlier version, and if another process runs it; StorageError if it cannot be written.
        """
        if not (folder / ABOUT).exists():
            if folder.exists() and (not folder.is_dir() or any(p.name != LOCK for p in folder.iterdir())):
                raise ArchiveError(
                    f"{folder} is there already and is not the folder of a campaign; give another one, or move it away."
                )
            try:
                folder.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise ArchiveError(f"the folder {folder} cannot be made: {error.strerror}.") from error
        lock = _locked(folder)
        try:
            if (folder / ABOUT).exists():
                there = cls.opened(folder)
                if there.entries():
                    check_same(folder, there.about, about)
                elif there.about != json.loads(json.dumps(about)):  # nothing was done for it
                    for block in range(there.blocks):
                        there.forget(block)
                    (folder / ABOUT).unlink()
            if not (folder / ABOUT).exists():
                written(folder / MEMBERS, _npz({k: np.asarray(v) for k, v in members.items()}))
                written(folder / ABOUT, (json.dumps(about, indent=1) + "\n").encode())
            store = cls.opened(folder)
            _without_torn_line(folder / INDEX)
        except BaseException:
            lock.close()
            raise
        store._lock = lock
        return store

    def close(self) -> None:
        """Release the lock."""
        if self._lock is not None:
            self._lock.close()
            self._lock = None

    @property
    def blocks(self) -> int:
        """The number of blocks."""
        return -(-int(self.about["members"]) // int(self.about["block"]))

    def span(self, block: int) -> tuple[int, int]:
        """Return the first member of a block, and the one behind its last."""
        first = block * int(self.about["block"])
        return first, min(first + int(self.about["block"]), int(self.about["members"]))

    def stem(self, block: int) -> str:
        """Return the name of a block's files, without its ending."""
        return f"block-{block:0{max(5, len(str(self.blocks - 1)))}d}"

    def entries(self) -> dict[int, Entry]:
        """Return the lines of the index, the last one for each block; a line that is being written is left out."""
        found: dict[int, Entry] = {}
        try:
            text = (self.folder / INDEX).read_bytes()
        except FileNotFoundError:
            return found
        for number, line in enumerate(text.split(b"\n")[:-1], 1):
            try:
                known = json.loads(line)
                entry = Entry(**known)
            except (ValueError, TypeError):
                raise ArchiveError(
                    f"line {number} of {self.folder / INDEX} is damaged; remove it, and its block is computed again."
                ) from None
            found[entry.block] = entry
        return found

    def failures(self, entry: Entry) -> int:
        """Return how many members of a block could not be integrated: all of a failed one; and of systems, none of
        which is lost on the way, those that neither survived nor were stopped.
        """
        apart = entry.state == FAILED or self.about["kind"] != "particles"
        return (entry.last - entry.first - entry.survivors - entry.stopped) * apart

    def damaged(self, entry: Entry) -> str:
        """Return what is wrong with the files of a block that is done, or ""."""
        for name, (size, digest) in entry.files.items():
            path = self.folder / name
            try:
                if not path.is_file():
                    return f"{name} is missing"
                if path.stat().st_size != size or fingerprint(path) != (size, digest):
                    return f"{name} is damaged"
            except OSError as error:
                return f"{name} cannot be read ({error.strerror})"
        return ""

    def forget(self, block: int) -> None:
        """Remove the files of a block, which will be computed again."""
        for path in [*files_of(self.folder, self.stem(block)), self.folder / f"{self.stem(block)}.npz"]:
            path.unlink(missing_ok=True)

    def unfinished(self, block: int) -> dict[str, bytes]:
        """Return the archives of a block that was interrupted, by name."""
        paths = files_of(self.folder, self.stem(block))
        return {str(path.relative_to(self.folder)): path.read_bytes() for path in paths}

    def keep(self, outcome: Outcome) -> None:
        """Keep the archives of a block that was interrupted on another machine."""
        for name, data in outcome.data.items():
            written(self.folder / name, data)

    def add(self, outcome: Outcome, attempts: int) -> Entry:
        """Keep a block that is done or could not be integrated; its line in the index is written last.

        Raises StorageError if that fails.
        """
        if self._lock is not None and not self._lock.is_at(self.folder / LOCK):
            raise StorageError(f"{self.folder} was deleted or replaced during the campaign; nothing more is written.")
        stem, files = self.stem(outcome.number), dict(outcome.files)
        first, last = self.span(outcome.number)
        if outcome.state == DONE:
            self.keep(outcome)
            table = _npz(outcome.columns)
            written(self.folder / f"{stem}.npz", table)
            files[f"{stem}.npz"] = len(table), hashlib.sha256(table).hexdigest()
        entry = Entry(
            block=outcome.number, first=first, last=last, state=outcome.state, reason=outcome.reason, files=files,
            bits=outcome.bits, survivors=outcome.survivors, stopped=outcome.stopped, seconds=round(outcome.seconds, 4),
            marching=round(outcome.marching, 4), worker=outcome.worker, attempts=attempts,
            warnings=tuple(outcome.warnings),
        )  # fmt: skip
        line = json.dumps(asdict(entry)).encode() + b"\n"
        try:
            with (self.folder / INDEX).open("ab") as file:
                file.write(line)
                file.flush()
                os.fsync(file.fileno())
        except OSError as error:
            raise _not_written(self.folder / INDEX, error) from error
        return entry

    def columns(self, entry: Entry) -> Columns:
        """Return the table of a block. Raises ArchiveError if it is damaged."""
        return _loaded(self.folder / f"{self.stem(entry.block)}.npz")

    def members(self) -> Columns:
        """Return the names of the members, and what is known of them beforehand. Raises ArchiveError."""
        return _loaded(self.folder / MEMBERS)


def _loaded(path: Path) -> Columns:
    try:
        with np.load(path, allow_pickle=False) as found:
            return dict(found)
    except (OSError, ValueError, KeyError, EOFError) as error:
        raise _damaged(path, error) from error


def check_same(folder: Path, about: Mapping[str, Any], wanted: Mapping[str, Any]) -> None:
    """Raise ArchiveError if the campaign in a folder is another one, saying what differs, or of an earlier version."""
    if about["format"] == EARLIER:
        raise ArchiveError(
            f"{folder} was begun by an earlier version of orbits, which did not note all that tells one campaign from "
            "another. orbits.ensemble.open reads what is there; to compute more, give another folder, or take that "
            "version."
        )
    there, here = about["identity"], wanted["identity"]
    keys = [key for key in {**there, **here} if there.get(key) != here.get(key)]
    if not keys:
        return
    told = "; ".join(f"{key}: {there.get(key, 'nothing')} there, {here.get(key, 'nothing')} here" for key in keys)
    raise ArchiveError(
        f"{folder} is the store of another campaign. What differs: {told}. Give another folder, or the same campaign."
    )


def written(path: Path, data: bytes) -> None:
    """Write a file as a whole or not at all. Raises StorageError if that fails."""
    partial = path.with_name(f".{path.name}.partial")
    try:
        path.parent.mkdir(exist_ok=True)
        with partial.open("wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.replace(partial, path)
        sync_folder(path.parent)
    except OSError as error:
        partial.unlink(missing_ok=True)
        raise _not_written(path, error) from error


def _locked(folder: Path) -> Storage:
    """Return the lock of a folder. Raises ArchiveError if another process has it."""
    path = folder / LOCK
    try:
        lock = Storage(path, os.O_RDWR | os.O_CREAT)
    except OSError as error:
        raise ArchiveError(f"{folder} cannot be written ({error.strerror}); mend its permissions.") from error
    if not lock.lock():
        with suppress(OSError, ValueError):
            holder = path.read_text(encoding="utf-8").strip()
        lock.close()
        raise ArchiveError(
            f"{folder} is being run by another process ({holder}); wait for it, or stop it and go on here. "
            "orbits.ensemble.open reads it meanwhile."
        )
    lock.resize(0)
    lock.write(0, f"process {os.getpid()} on {socket.gethostname()}\n".encode())
    return lock


def _without_torn_line(path: Path) -> None:
    """Remove the end of a line that a killed process did not write to its end."""
    with suppress(FileNotFoundError):
        text = path.read_bytes()
        whole = text.rfind(b"\n") + 1
        if whole < len(text):
            os.truncate(path, whole)


def _npz(columns: Mapping[str, NDArray[Any]]) -> bytes:
    out = io.BytesIO()
    np.savez(out, **dict(columns))  # type: ignore[arg-type]
    return out.getvalue()


def _damaged(path: Path, error: Exception) -> ArchiveError:
    return ArchiveError(f"{path} is damaged or missing ({error}); run the campaign again, which computes it again.")


def _not_written(path: Path, error: OSError) -> StorageError:
    return StorageError(
        f"{path} could not be written ({error.strerror}); what was done before is kept, and the same call goes on."
    )
