"""Making a file: beside its place, with all of its room on the device, and then under its name in one step."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbits.archive import schema
from orbits.archive.header import Header
from orbits.archive.schema import Layout
from orbits.archive.storage import Storage, free_bytes, human, sync_folder
from orbits.errors import ArchiveError, StorageError, shown

_FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}
_WRONG_USE = {
    errno.EACCES,
    errno.EPERM,
    errno.EROFS,
    errno.ENOENT,
    errno.ENOTDIR,
    errno.ENAMETOOLONG,
    errno.EINVAL,
    errno.ELOOP,
}


def partial_path(path: Path) -> Path:
    """Where a file is made before it takes its name."""
    return path.with_name(f".{path.name}.partial")


def built(path: Path, header: Header, checkpoint: Mapping[str, NDArray[Any]]) -> tuple[Storage, Layout]:
    """Make the file beside `path`, locked and with all of its room; nothing is left behind where that fails."""
    for name, array in checkpoint.items():
        if not isinstance(array, np.ndarray) or array.dtype.kind not in "biuf" or "/" in name or name in ("", "."):
            raise ArchiveError(f"checkpoint {name!r} is {shown(array)}; expected an array of numbers and a plain name.")
    needed = schema.bytes_needed(header, checkpoint)
    partial = partial_path(path)
    storage = _fresh(partial, path, needed)
    with discarded_on_failure(storage, partial):
        try:
            free = free_bytes(path.parent)
            if needed > free:
                raise _no_room(path, needed, free)
            schema.write(partial, header, checkpoint)
            storage.reserve()
            storage.sync()
        except (OSError, RuntimeError) as error:
            raise _failure(error, path, needed) from error
        _, layout = schema.read(storage, partial)
    return storage, layout


def _fresh(partial: Path, path: Path, needed: int) -> Storage:
    """Open a new, empty, locked file; what a run that was killed while creating left there is thrown away."""
    try:
        with suppress(FileNotFoundError):
            # Never written to: it may be another name of a file that has long become an archive.
            stale = Storage(partial, os.O_RDWR)
            unused = stale.lock()
            if unused:
                partial.unlink()
            stale.close()
            if not unused:
                raise busy(path)
        storage = Storage(partial, os.O_RDWR | os.O_CREAT | os.O_EXCL)
    except FileExistsError:
        raise busy(path) from None
    except OSError as error:
        raise _failure(error, path, needed) from error
    if not (storage.lock() and storage.is_at(partial)):
        storage.close()
        raise busy(path)
    return storage


@contextmanager
def discarded_on_failure(storage: Storage, partial: Path) -> Iterator[None]:
    """Close and remove a file that is being made, if what is done meanwhile fails."""
    try:
        yield
    except BaseException:
        with suppress(OSError):
            if storage.is_at(partial):
                partial.unlink()
        storage.close()
        raise


def take_name(storage: Storage, path: Path, overwrite: bool) -> None:
    """Give the finished file its name, in one step. Raises ArchiveError where the name was taken meanwhile."""
    partial = partial_path(path)
    try:
        if not overwrite:
            # Unlike a rename, a link does not replace a file that another run has just made.
            try:
                os.link(partial, path)
                partial.unlink()
            except FileExistsError:
                raise
            except OSError:
                pass  # a file system without links
        if storage.is_at(partial):
            if not overwrite and os.path.lexists(path):
                raise _exists(path)
            os.replace(partial, path)
    except FileExistsError:
        raise _exists(path) from None
    except OSError as error:
        raise _failure(error, path, 0) from error
    sync_folder(path.parent)


def check_target(path: Path, overwrite: bool) -> None:
    """Refuse, in words, a path where no archive can be made."""
    if os.path.isdir(path):
        raise ArchiveError(f"{path} is a folder; give a file in it, such as {path / 'run.h5'}.")
    if not os.path.isdir(path.parent):
        raise ArchiveError(f"the folder {path.parent} does not exist; make it, or choose another path.")
    if not os.path.lexists(path):
        return
    if not overwrite:
        raise _exists(path)
    if not os.path.isfile(path):
        raise ArchiveError(f"{path} is not a file, so it cannot be replaced; choose another path.")
    try:
        storage = Storage(path, os.O_RDWR)
    except OSError as error:
        raise ArchiveError(f"{path} cannot be replaced ({error.strerror}); check its permissions.") from error
    free = storage.lock()
    storage.close()
    if not free:
        raise busy(path)


def _failure(error: OSError | RuntimeError, path: Path, needed: int) -> ArchiveError | StorageError:
    """Say in words why a file could not be made: a wrong path, or a device that fails."""
    number = getattr(error, "errno", None)
    if number in _FULL:
        with suppress(OSError):
            return _no_room(path, needed, free_bytes(path.parent))
    reason = os.strerror(number) if number else str(error).strip().partition("\n")[0]
    if number in _WRONG_USE:
        return ArchiveError(f"{path} cannot be written ({reason}); choose another path or mend its permissions.")
    return StorageError(f"{path} could not be made ({reason}); nothing was left behind.")


def _no_room(path: Path, needed: int, free: int) -> StorageError:
    return StorageError(
        f"{path} needs {human(needed)}, but {human(free)} are free in {path.parent}. Take fewer samples or choose "
        "another disk."
    )


def _exists(path: Path) -> ArchiveError:
    return ArchiveError(f"{path} exists already; give overwrite=True to replace it, or go on with it by orbits.resume.")


def busy(path: Path) -> ArchiveError:
    """Say that another writer has the file."""
    return ArchiveError(f"{path} is being written by another run; wait for it, or choose another path.")
