"""File objects for HDF5: one in memory, in which an archive is created, and one that reads an open descriptor.

HDF5 keeps data that it could not write, tries again when the process ends, and has crashed there. Here it writes to
memory, which does not fail; the bytes are then written to the device by calls whose failures are handled here.
"""

from __future__ import annotations

import io
import os
from collections.abc import Iterator
from typing import Any

from orbits.archive.storage import Storage

PAGE = 4096


class _Positioned(io.RawIOBase):
    """A file with a position, of `size` bytes."""

    size = 0
    _at = 0

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def tell(self) -> int:
        return self._at

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        self._at = offset + {os.SEEK_SET: 0, os.SEEK_CUR: self._at, os.SEEK_END: self.size}[whence]
        return self._at


class SparseFile(_Positioned):
    """A file in memory that allocates only the pages that were written to."""

    def __init__(self) -> None:
        self._pages: dict[int, bytearray] = {}

    def writable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        """Read from the position on into a buffer, up to the end of the file; return the number of bytes."""
        view = memoryview(buffer).cast("B")
        count = max(0, min(len(view), self.size - self._at))
        for done, page, within, length in _pieces(self._at, count):
            view[done : done + length] = self._pages.get(page, bytes(PAGE))[within : within + length]
        self._at += count
        return count

    def write(self, data: Any) -> int:
        """Write bytes at the position, beyond the end too; return their number."""
        view = memoryview(data).cast("B")
        for done, page, within, length in _pieces(self._at, len(view)):
            self._pages.setdefault(page, bytearray(PAGE))[within : within + length] = view[done : done + length]
        self._at += len(view)
        self.size = max(self.size, self._at)
        return len(view)

    def truncate(self, size: int | None = None) -> int:
        self.size = self._at if size is None else size
        self._pages = {page: data for page, data in self._pages.items() if page * PAGE < self.size}
        return self.size

    def written(self) -> Iterator[tuple[int, bytes]]:
        """Yield (offset, bytes) of all written pages."""
        for page in sorted(self._pages):
            yield page * PAGE, bytes(self._pages[page][: self.size - page * PAGE])


class StoredFile(_Positioned):
    """The open file of a `Storage`, for reading, even if its path now refers to another file."""

    def __init__(self, storage: Storage) -> None:
        self._storage = storage
        self.size = storage.size

    def readinto(self, buffer: Any) -> int:
        """Read from the position on into a buffer, up to the end of the file; return the number of bytes.

        Raises StorageError if the device cannot be read.
        """
        view = memoryview(buffer).cast("B")
        count = max(0, min(len(view), self.size - self._at))
        self._storage.read_into(view[:count], self._at)
        self._at += count
        return count


def _pieces(offset: int, count: int) -> Iterator[tuple[int, int, int, int]]:
    """Yield (bytes before it, page, place in the page, length) of each page that `count` bytes at `offset` touch."""
    done = 0
    while done < count:
        page, within = divmod(offset + done, PAGE)
        length = min(PAGE - within, count - done)
        yield done, page, within, length
        done += length
