"""One file by its descriptor: whole reads, whole writes, a lock, room reserved; every failure in words.

The arrays of an archive are preallocated at fixed places, so a run writes their bytes there and nothing else: no byte
that HDF5 needs to find its way through the file changes after creation.
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
"""Bytes that are read or copied at a time."""

CHECKED = 1 << 18
"""Bytes that are checked at a time: they are still in the processor's cache when their checksum is taken."""

_LOCKED = {errno.EACCES, errno.EAGAIN}
_NO_FALLOCATE = {errno.EOPNOTSUPP, errno.ENOSYS, errno.EINVAL}


class Storage:
    """An open file. Reads raise ArchiveError where the file is too short, StorageError where the device fails."""

    def __init__(self, path: Path, flags: int, mode: int = 0o666) -> None:
        """Open `path` with the flags and the mode of os.open; an OSError is the caller's to translate.

        `path` is the name that messages give; a rename has to set it anew.
        """
        self.path = path
        self._descriptor = os.open(path, flags | getattr(os, "O_CLOEXEC", 0), mode)
        self._closer = weakref.finalize(self, os.close, self._descriptor)

    def fileno(self) -> int:
        """Return the descriptor, for as long as the storage is open."""
        if not self._closer.alive:
            raise ArchiveError(f"{self.path} was closed; open it again to go on.")
        return self._descriptor

    def close(self) -> None:
        """Close the file, and with it give up its lock. Closing twice does nothing."""
        self._closer()

    @property
    def size(self) -> int:
        """Bytes in the file."""
        return os.fstat(self.fileno()).st_size

    def is_at(self, path: Path) -> bool:
        """Whether `path` leads to this very file, not to nothing or to another one that took its name meanwhile."""
        try:
            return os.path.samestat(os.stat(path), os.fstat(self.fileno()))
        except OSError:
            return False

    @property
    def deleted(self) -> bool:
        """Whether the file has no name any more, and goes when it is closed."""
        return os.fstat(self.fileno()).st_nlink == 0

    def lock(self) -> bool:
        """Claim the file for writing; False where another writer has it. Readers are not kept out.

        A lock of the open file, not of the process: two writers in one process exclude each other too, and HDF5's own
        (flock) is another one on Linux. File systems without locks let everyone in.
        """
        if fcntl is None:
            return True
        try:
            self._set_lock("F_WRLCK", fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            return error.errno not in _LOCKED
        return True

    def unlock(self) -> None:
        """Let other writers have the file, which stays open."""
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
        """Fill `buffer`, which is writable bytes, from `offset`."""
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
        """CRC-32 of `size` bytes at `offset`, continued from `start`, read in blocks."""
        buffer = memoryview(bytearray(min(CHECKED, size)))
        for place in range(offset, offset + size, CHECKED):
            block = buffer[: offset + size - place]
            self.read_into(block, place)
            start = zlib.crc32(block, start)
        return start

    def write(self, offset: int, data: memoryview | bytes | bytearray) -> None:
        """Write all of `data` at `offset`; OSError is the caller's to translate."""
        view = memoryview(data)
        done = 0
        while done < len(view):
            done += self._write_some(offset + done, view[done:])

    def _write_some(self, offset: int, data: memoryview) -> int:
        return os.pwrite(self.fileno(), data, offset)

    def become(self, like: os.stat_result) -> None:
        """Take over the owner, as far as that is allowed, and the permissions of another file."""
        with suppress(OSError):
            os.fchown(self.fileno(), like.st_uid, like.st_gid)
        same_group = os.fstat(self.fileno()).st_gid == like.st_gid
        with suppress(OSError):
            # What was granted to a group that the file cannot be given to is granted to no other one.
            os.fchmod(self.fileno(), like.st_mode & (0o777 if same_group else 0o707))

    def resize(self, size: int) -> None:
        """Make the file end after `size` bytes; OSError is the caller's to translate."""
        os.ftruncate(self.fileno(), size)

    def sync(self) -> None:
        """Return when all that was written has reached the device; OSError is the caller's to translate."""
        os.fsync(self.fileno())

    def reserve(self) -> None:
        """Give every byte of the file its place on the device now, so that a full disk shows before the run begins."""
        size = self.size
        if hasattr(os, "posix_fallocate"):
            try:
                os.posix_fallocate(self.fileno(), 0, size)
                return
            except OSError as error:
                if error.errno not in _NO_FALLOCATE:
                    raise
        # Where that is not to be had, one byte in each block claims the block; what is there already is kept.
        for place in range(0, size, 4096):
            self.write(place, self.read(place, 1))


def free_bytes(folder: Path) -> int:
    """Bytes that this user can still write in the file system of `folder`."""
    status = os.statvfs(folder)
    return status.f_bavail * status.f_frsize


def sync_folder(folder: Path) -> None:
    """Make a new or renamed entry of `folder` durable, where the file system lets one."""
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
    """Bytes as people say them: 4.8 GB."""
    amount = float(size)
    for unit in ("bytes", "kB", "MB", "GB", "TB"):
        if amount < 1000:
            return f"{amount:.0f} bytes" if unit == "bytes" else f"{amount:.1f} {unit}"
        amount /= 1000
    return f"{amount:.1f} PB"
