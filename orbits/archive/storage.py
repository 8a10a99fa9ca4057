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
"""Bytes that are read, copied or checked at a time."""

_LOCKED = {errno.EACCES, errno.EAGAIN}
_NO_FALLOCATE = {errno.EOPNOTSUPP, errno.ENOSYS, errno.EINVAL}


class Storage:
    """An open file. Reads raise ArchiveError where the file is too short, StorageError where the device fails."""

    def __init__(self, path: Path, flags: int) -> None:
        """Open `path` with the flags of os.open; an OSError is the caller's to translate."""
        self.path = path
        self._descriptor = os.open(path, flags | getattr(os, "O_CLOEXEC", 0), 0o666)
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
        """Whether `path` is this very file, not another one that took its name meanwhile."""
        try:
            return os.path.samestat(os.stat(path), os.fstat(self.fileno()))
        except FileNotFoundError:
            return False

    def lock(self) -> bool:
        """Claim the file for writing; False where another writer has it. Readers are not kept out.

        A lock of the open file, not of the process: two writers in one process exclude each other too, and HDF5's own
        (flock) is another one on Linux. File systems without locks let everyone in.
        """
        if fcntl is None:
            return True
        try:
            if hasattr(fcntl, "F_OFD_SETLK"):
                whole_file = struct.pack("hhqqi4x", fcntl.F_WRLCK, os.SEEK_SET, 0, 0, 0)
                fcntl.fcntl(self.fileno(), fcntl.F_OFD_SETLK, whole_file)
            else:
                fcntl.flock(self.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            return error.errno not in _LOCKED
        return True

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
        for place in range(offset, offset + size, BLOCK):
            start = zlib.crc32(self.read(place, min(BLOCK, offset + size - place)), start)
        return start

    def write(self, offset: int, data: memoryview | bytes | bytearray) -> None:
        """Write all of `data` at `offset`; OSError is the caller's to translate."""
        view = memoryview(data)
        done = 0
        while done < len(view):
            done += self._write_some(offset + done, view[done:])

    def _write_some(self, offset: int, data: memoryview) -> int:
        return os.pwrite(self.fileno(), data, offset)

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
