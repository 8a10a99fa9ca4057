"""Creation of a file: under a temporary name, with all of its space reserved, then renamed in one step."""

from __future__ import annotations

import errno
import os
import stat
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
    """Return the temporary path under which a file is created."""
    return path.with_name(f".{path.name}.partial")


def built(path: Path, header: Header, checkpoint: Mapping[str, NDArray[Any]]) -> tuple[Storage, Layout]:
    """Create the file beside `path`, locked and with all of its space; if that fails, nothing is left behind.

    It gets the permissions of the file that it will replace, if there is one.
    """
    for name, array in checkpoint.items():
        if not isinstance(array, np.ndarray) or array.dtype.kind not in "biuf" or "/" in name or name in ("", "."):
            raise ArchiveError(f"checkpoint {name!r} is {shown(array)}; expected an array of numbers and a plain name.")
    needed = schema.bytes_needed(header, checkpoint)
    partial = partial_path(path)
    storage = _fresh(partial, path, needed)
    try:
        with discarded_on_failure(storage, partial):
            free = free_bytes(path.parent)
            if needed > free:
                raise _no_room(path, needed, free)
            image = schema.image(header, checkpoint)
            needed = image.size
            storage.resize(needed)
            storage.reserve()
            for offset, data in image.written():
                storage.write(offset, data)
            storage.sync()
            _, layout = schema.read(storage, partial)
    except OSError as error:
        # Only now, after the unfinished file was removed, does the device report the free space without it.
        raise _failure(error, path, needed) from error
    return storage, layout


def _fresh(partial: Path, path: Path, needed: int) -> Storage:
    """Open a new, empty, locked file; remains of a run that was killed during creation are removed."""
    try:
        _clear(partial, path)
        kept = os.stat(path) if os.path.lexists(path) else None
        storage = Storage(partial, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o666 if kept is None else 0o600)
    except FileExistsError:
        raise busy(path) from None
    except OSError as error:
        raise _failure(error, path, needed) from error
    if not (storage.lock() and storage.is_at(partial)):
        storage.close()
        raise busy(path)
    if kept is not None:
        storage.become(kept)
    return storage


def _clear(partial: Path, path: Path) -> None:
    """Remove a file at the temporary path, unless another run is creating it."""
    try:
        kind = os.lstat(partial).st_mode
    except FileNotFoundError:
        return
    if stat.S_ISLNK(kind):
        # No run makes a link there, and its target, if any, is not ours.
        partial.unlink()
        return
    if not stat.S_ISREG(kind):
        raise ArchiveError(f"{partial} is in the way: {path} is made there first. Remove it, or choose another path.")
    with suppress(OSError):
        if os.path.samefile(partial, path):  # a second name of the archive, left by a run that was killed
            partial.unlink()
            return
    with suppress(FileNotFoundError):
        # Never write to it: it may be a second name of a finished archive.
        stale = Storage(partial, os.O_RDWR | getattr(os, "O_NOFOLLOW", 0))
        unused = stale.lock()
        if unused:
            partial.unlink()
        stale.close()
        if not unused:
            raise busy(path)


@contextmanager
def discarded_on_failure(storage: Storage, partial: Path) -> Iterator[None]:
    """Close and remove a file that is being created, if the block fails."""
    try:
        yield
    except BaseException:
        with suppress(OSError):
            if storage.is_at(partial):
                partial.unlink()
        storage.close()
        raise


def take_name(storage: Storage, path: Path, overwrite: bool) -> None:
    """Give the finished file its name, in one step. Raises ArchiveError if the name was taken in the meantime."""
    partial = partial_path(path)
    try:
        if not overwrite:
            # Unlike a rename, a link does not replace a file that another run has just created.
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
        raise _failure(error, path, storage.size) from error
    storage.path = path
    sync_folder(path.parent)


def check_target(path: Path, overwrite: bool) -> None:
    """Refuse, with a clear message, a path where no archive can be created."""
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


def _failure(error: OSError, path: Path, needed: int) -> ArchiveError | StorageError:
    """Return the error for a file that could not be created: a wrong path, or a failing device."""
    number = error.errno
    reason = os.strerror(number) if number else str(error)
    if number == errno.EFBIG:
        most = _largest_file()
        if most is None:
            limit, remedy = "the file system takes no file of that size", "choose another disk"
        else:
            limit, remedy = f"this process may write no file larger than {human(most)}", "raise the limit (ulimit -f)"
        return StorageError(f"{path} needs {human(needed)}, but {limit}. Take fewer samples, or {remedy}.")
    if number == errno.EDQUOT:
        return StorageError(
            f"{path} needs {human(needed)}, more than your quota leaves in {path.parent}. Take fewer samples or choose "
            "another disk."
        )
    if number == errno.ENOSPC:
        with suppress(OSError):
            return _no_room(path, needed, free_bytes(path.parent))
    if number in _WRONG_USE:
        return ArchiveError(f"{path} cannot be written ({reason}); choose another path or mend its permissions.")
    return StorageError(f"{path} could not be made ({reason}); nothing was left behind.")


def _largest_file() -> int | None:
    """Return the size in bytes of the largest file that this process may write, or None without a limit."""
    try:
        import resource
    except ImportError:
        return None
    most = resource.getrlimit(resource.RLIMIT_FSIZE)[0]
    return None if most == resource.RLIM_INFINITY else most


def _no_room(path: Path, needed: int, free: int) -> StorageError:
    return StorageError(
        f"{path} needs {human(needed)}, but {human(free)} are free in {path.parent}. Take fewer samples or choose "
        "another disk."
    )


def _exists(path: Path) -> ArchiveError:
    return ArchiveError(f"{path} exists already; give overwrite=True to replace it, or go on with it by orbits.resume.")


def busy(path: Path) -> ArchiveError:
    """Return the error for a file that another writer has."""
    return ArchiveError(f"{path} is being written by another run; wait for it, or choose another path.")
