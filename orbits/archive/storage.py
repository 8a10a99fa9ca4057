"""One open file: complete reads and writes, a lock, reserved space, and clear messages for every failure.

The arrays of an archive are preallocated at fixed places, and a run writes only their bytes: the metadata of HDF5 do
not change after creation.
"""

from __future__ import annotations

import errno
import os
import struct
import weakref
import zlib
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbits.errors import ArchiveError, StorageError

try:
    import fcntl
except ImportError:  # no locks on this platform
    fcntl = None  # type: ignore[assignment]

BLOCK = 1 << 24
"""Number of bytes that are read or copied at a time."""

CHECKED = 1 << 18
"""Number of bytes that are checked at a time: they are still in the processor's cache for their checksum."""

_LOCKED = {errno.EACCES, errno.EAGAIN}
_NO_FALLOCATE = {errno.EOPNOTSUPP, errno.ENOSYS, errno.EINVAL}


class Storage:
    """An open file. Reads raise ArchiveError if the file is too short, StorageError if the device fails."""

    def __init__(self, path: Path, flags: int, mode: int = 0o666) -> None:
        """Open `path` with the flags and the mode of os.open; the caller handles OSError.

        `path` is the name in messages; it must be updated after a rename.
        """
        self.path = path
        self._descriptor = os.open(path, flags | getattr(os, "O_CLOEXEC", 0), mode)
        self._closer = weakref.finalize(self, os.close, self._descriptor)

    def fileno(self) -> int:
        """Return the descriptor while the storage is open."""
        if not self._closer.alive:
            raise ArchiveError(f"{self.path} was closed; open it again to go on.")
        return self._descriptor

    def close(self) -> None:
        """Close the file, which also releases its lock. Closing twice has no effect."""
        self._closer()

    @property
    def size(self) -> int:
        """The size of the file in bytes."""
        return os.fstat(self.fileno()).st_size

    def is_at(self, path: Path) -> bool:
        """Return whether `path` still refers to this file, rather than to none or to another one."""
        try:
            return os.path.samestat(os.stat(path), os.fstat(self.fileno()))
        except OSError:
            return False

    @property
    def deleted(self) -> bool:
        """Whether the file has been deleted, and vanishes when it is closed."""
        return os.fstat(self.fileno()).st_nlink == 0

    def lock(self) -> bool:
        """Lock the file for writing; False if another writer has it. Readers are not locked out.

        The lock belongs to the open file, not to the process: two writers in one process exclude each other too. It is
        independent of HDF5's own lock (flock) on Linux. On file systems without locks, it always succeeds.
        """
        if fcntl is None:
            return True
        try:
            self._set_lock("F_WRLCK", fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            return error.errno not in _LOCKED
        return True

    @property
    def writer(self) -> int | None:
        """The process that has the file locked for writing, as far as the system tells: -1 if it does not tell which;
        None if none has. The question does not touch the lock.
        """
        if fcntl is None or not hasattr(fcntl, "F_OFD_GETLK"):
            return None
        asked = struct.pack("hhqqi4x", fcntl.F_WRLCK, os.SEEK_SET, 0, 0, 0)
        try:
            kind = struct.unpack("hhqqi4x", fcntl.fcntl(self.fileno(), fcntl.F_OFD_GETLK, asked))[0]
        except OSError:
            return None
        if kind == fcntl.F_UNLCK:
            return None
        return _process_of(os.fstat(self.fileno()))

    def unlock(self) -> None:
        """Unlock the file for other writers; it stays open."""
        if fcntl is not None:
            with suppress(OSError):
                self._set_lock("F_UNLCK", fcntl.LOCK_UN)

    def _set_lock(self, kind: str, otherwise: int) -> None:
        if hasattr(fcntl, "F_OFD_SETLK"):
            whole_file = struct.pack("hhqqi4x", getattr(fcntl, kind), os.SEEK_SET, 0, 0, 0)
            fcntl.fcntl(self.fileno(), fcntl.F_OFD_SETLK, whole_file)
        else:
            fcntl.flock(self.fileno(), otherwise)

    def read(self, offset: int, size: int) -> bytearray:
        """Return `size` bytes at `offset`."""
        buffer = bytearray(size)
        self.read_into(memoryview(buffer), offset)
        return buffer

    def read_into(self, buffer: memoryview, offset: int) -> None:
        """Fill `buffer`, writable bytes, from `offset` on."""
        done = 0
        while done < len(buffer):
            try:
                count = os.preadv(self.fileno(), [buffer[done : done + BLOCK]], offset + done)
            except OSError as error:
                raise StorageError(f"{self.path} could not be read: {error.strerror}.") from error
            if count == 0:
                raise ArchiveError(
                    f"{self.path} is truncated: {offset + len(buffer)} bytes are expected, {offset + done} are there. "
                    "Copy it again from where it is whole."
                )
            done += count

    def checksum(self, offset: int, size: int, start: int = 0) -> int:
        """Return the CRC-32 of `size` bytes at `offset`, continued from `start`, read in blocks."""
        buffer = memoryview(bytearray(min(CHECKED, size)))
        for place in range(offset, offset + size, CHECKED):
            block = buffer[: offset + size - place]
            self.read_into(block, place)
            start = zlib.crc32(block, start)
        return start

    def write(self, offset: int, data: memoryview | bytes | bytearray) -> None:
        """Write all of `data` at `offset`; the caller handles OSError."""
        view = memoryview(data)
        done = 0
        while done < len(view):
            done += self._write_some(offset + done, view[done:])

    def _write_some(self, offset: int, data: memoryview) -> int:
        return os.pwrite(self.fileno(), data, offset)

    def become(self, like: os.stat_result) -> None:
        """Take over the owner, if allowed, and the permissions of another file."""
        with suppress(OSError):
            os.fchown(self.fileno(), like.st_uid, like.st_gid)
        same_group = os.fstat(self.fileno()).st_gid == like.st_gid
        with suppress(OSError):
            # If the file cannot be given to the group, its permissions are not granted to another group.
            os.fchmod(self.fileno(), like.st_mode & (0o777 if same_group else 0o707))

    def resize(self, size: int) -> None:
        """Make the file end after `size` bytes; the caller handles OSError."""
        os.ftruncate(self.fileno(), size)

    def sync(self) -> None:
        """Wait until all written data have reached the device; the caller handles OSError."""
        os.fsync(self.fileno())

    def reserve(self) -> None:
        """Reserve space on the device for the whole file, so that a full disk is detected before the run begins."""
        size = self.size
        if hasattr(os, "posix_fallocate"):
            try:
                os.posix_fallocate(self.fileno(), 0, size)
                return
            except OSError as error:
                if error.errno not in _NO_FALLOCATE:
                    raise
        # If that is not supported, writing one byte claims each block; existing data are kept.
        for place in range(0, size, 4096):
            self.write(place, self.read(place, 1))


def _process_of(status: os.stat_result) -> int:
    """Return the process of this user that has a file open for writing, -1 if none is seen."""
    for process in Path("/proc").glob("[0-9]*"):
        with suppress(OSError, ValueError):
            for link in (process / "fd").iterdir():
                found = link.stat()
                if (found.st_dev, found.st_ino) != (status.st_dev, status.st_ino):
                    continue
                flags = (process / "fdinfo" / link.name).read_text().split("flags:")[1].split()[0]
                if int(flags, 8) & os.O_ACCMODE == os.O_RDWR:
                    return int(process.name)
    return -1


def free_bytes(folder: Path) -> int:
    """Return the free space, in bytes, for this user in the file system of `folder`."""
    status = os.statvfs(folder)
    return status.f_bavail * status.f_frsize


def sync_folder(folder: Path) -> None:
    """Make a new or renamed entry of `folder` durable, if the file system supports it."""
    try:
        descriptor = os.open(folder, os.O_RDONLY)
    except OSError:
        return
    try:
        os.fsync(descriptor)
    except OSError:
        return
    finally:
        os.close(descriptor)


def raw_bytes(array: NDArray[Any]) -> memoryview:
    """Return the bytes of a contiguous array without copying it."""
    return array.reshape(-1).view(np.uint8).data


def human(size: int) -> str:
    """Return a size as readable text: 4.8 GB."""
    amount = float(size)
    for unit in ("bytes", "kB", "MB", "GB", "TB"):
        if amount < 1000:
            return f"{amount:.0f} bytes" if unit == "bytes" else f"{amount:.1f} {unit}"
        amount /= 1000
    return f"{amount:.1f} PB"
