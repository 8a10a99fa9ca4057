"""Folders and files of a cache: their contents are executed, so no other user may have written them."""

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
"""Permission bits that let users other than the owner write."""

ROOT = 0


def distrusted(status: os.stat_result, *, owners: frozenset[int] = frozenset(), shared: int = 0) -> str | None:
    """Return the reason why another user may have written a file with this status, or None.

    owners : trusted users, in addition to that of this process and root
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
    """Another user may have written a file; the message says why."""


def read(path: Path, owners: frozenset[int] = frozenset()) -> bytes:
    """Return the contents of a file.

    The file is checked and read through one descriptor, so that both are the same file. Raises OSError, and
    DistrustedError if another user may have written it.
    """
    with path.open("rb") as file:
        reason = distrusted(os.fstat(file.fileno()), owners=owners)
        if reason is None:
            return file.read()
    raise DistrustedError(f"{path} {reason}: it is not used, because its contents would be executed. It is made anew.")


def write(path: Path, data: bytes, *, replace: bool = True) -> None:
    """Write a file that other processes see complete or not at all, and that only its owner may change.

    replace : False to keep an existing file
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
    """Make a private folder, or check that it is private and writable. Raises OSError otherwise.

    Warns, naming the folder, if it exists but others may write in it.
    """
    place.mkdir(parents=True, exist_ok=True, mode=0o700)
    reason = distrusted(place.stat())
    if reason is not None:
        warn(
            f"the folder {place} {reason}: compiled code is neither read from it nor kept there, because it would be "
            "executed. Another folder is used; take that permission away (chmod go-w), or choose a folder of your "
            "own with NUMBA_CACHE_DIR."
        )
        raise PermissionError(f"{place} {reason}")
    tempfile.TemporaryFile(dir=place).close()


def user_folder(name: str) -> Path:
    """Return a folder of this user for files kept between processes: in NUMBA_CACHE_DIR, else in XDG_CACHE_HOME or
    ~/.cache, else a private temporary folder. A folder in which other users may write is skipped, with a warning.
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
    """Return a private temporary folder, kept until the machine restarts, or else only for this process."""
    with contextlib.suppress(KeyError, OSError):
        place = Path(tempfile.gettempdir()) / f"orbits-{getpass.getuser()}"
        make_private(place)
        return place
    return Path(tempfile.mkdtemp(prefix="orbits-"))


@lru_cache(maxsize=256)
def warn(text: str) -> None:
    """Warn once about a file or folder of the cache.

    An unusable file must be removed before the warning: warnings may be raised as errors, which the next process would
    otherwise raise again.
    """
    warnings.warn(text, OrbitsWarning, stacklevel=3)
