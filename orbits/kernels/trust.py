"""Folders and files of a cache: what is read from them is executed, so nobody else may have written it."""

from __future__ import annotations

import contextlib
import getpass
import os
import secrets
import stat
import tempfile
import warnings
from functools import lru_cache
from pathlib import Path

from orbits.errors import OrbitsWarning

OTHERS = stat.S_IWGRP | stat.S_IWOTH
"""Permission bits with which someone else than the owner writes."""

ROOT = 0


def distrusted(status: os.stat_result, *, owners: frozenset[int] = frozenset(), shared: int = 0) -> str | None:
    """Return why someone else may have written what has this status, in words; None where nobody can have.

    owners : users who are trusted beside this process's own and root
    shared : permission bits that are harmless here
    """
    if not hasattr(os, "getuid"):
        return None
    if status.st_uid not in {os.getuid(), ROOT, *owners}:
        return f"belongs to user {status.st_uid}"
    if status.st_mode & OTHERS & ~shared:
        return f"can be written by other users (mode {stat.S_IMODE(status.st_mode):04o})"
    return None


class DistrustedError(Exception):
    """Someone else may have written a file; the reason, in words."""


def read(path: Path, owners: frozenset[int] = frozenset()) -> bytes:
    """Return what a file holds.

    The file that is judged is the one that is read: both go through one descriptor. Raises OSError, and
    DistrustedError where someone else may have written it.
    """
    with path.open("rb") as file:
        reason = distrusted(os.fstat(file.fileno()), owners=owners)
        if reason is None:
            return file.read()
    raise DistrustedError(f"{path} {reason}: it is not used, because what it holds would be executed. It is made anew.")


def write(path: Path, data: bytes, *, replace: bool = True) -> None:
    """Write a file that other processes see whole or not at all, and that only its owner may change.

    replace : False where the first to come is the one that stays
    Raises OSError.
    """
    name = path.parent / f"{path.name}.{secrets.token_hex(8)}.partial"
    handle = os.open(name, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
        if replace:
            os.replace(name, path)
        else:
            _put_first(name, path)
    except BaseException:
        with contextlib.suppress(OSError):
            name.unlink()
        raise


def _put_first(name: Path, path: Path) -> None:
    try:
        os.link(name, path)
    except FileExistsError:
        pass
    except OSError:  # a file system without hard links
        os.replace(name, path)
        return
    name.unlink()


def make_private(place: Path) -> None:
    """Make a folder of our own, or see that it is one, and that it takes files. Raises OSError otherwise.

    Warns, naming the folder, where it is there but others may write in it.
    """
    place.mkdir(parents=True, exist_ok=True, mode=0o700)
    reason = distrusted(place.stat())
    if reason is not None:
        warn(
            f"the folder {place} {reason}: compiled code is not read from it nor kept there, because it would be "
            "executed. Another folder is used; take that permission away (chmod go-w), or choose a folder of your "
            "own with NUMBA_CACHE_DIR."
        )
        raise PermissionError(f"{place} {reason}")
    tempfile.TemporaryFile(dir=place).close()


def user_folder(name: str) -> Path:
    """Return a folder of this user's for what is kept between processes: in NUMBA_CACHE_DIR, else in XDG_CACHE_HOME or
    ~/.cache, else a private temporary folder. A folder in which other users may write is passed over, with a warning.
    """
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser())
    place = Path(chosen) / "orbits" if chosen else home / "orbits" / name
    with contextlib.suppress(OSError):
        make_private(place)
        return place
    return temporary_folder()


@lru_cache(maxsize=1)
def temporary_folder() -> Path:
    """Return a private folder for where there is no other: kept until the machine restarts, or else this process's."""
    with contextlib.suppress(KeyError, OSError):
        place = Path(tempfile.gettempdir()) / f"orbits-{getpass.getuser()}"
        make_private(place)
        return place
    return Path(tempfile.mkdtemp(prefix="orbits-"))


@lru_cache(maxsize=256)
def warn(text: str) -> None:
    """Warn once of a file or folder of the cache.

    Of a file that cannot be used only when it is out of the way: a warning may be an error, which the next process
    would raise again.
    """
    warnings.warn(text, OrbitsWarning, stacklevel=3)
