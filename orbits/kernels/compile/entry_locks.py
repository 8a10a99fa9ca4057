"""Locks, so that of several processes that need the same entry of the cache one compiles it and the others wait.

An entry is locked while it is compiled, with the callees that it needs; entries are locked from callers to callees, as
the calls lead, so that no two processes wait for each other. An index is locked while it is read and written again, so
that none loses what another adds. Locks are bytes of one file in each folder of the cache: they need no clearing up,
and end with their process.
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import os
import time
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path

PAUSE = 0.02
"""Seconds between two attempts."""

PATIENCE = 300.0
"""Seconds after which a process goes on without a lock: the one that has it may have been stopped."""


@contextlib.contextmanager
def locked(folder: Path, name: str) -> Iterator[None]:
    """Hold the lock of that name in a folder until the end; where files cannot be locked, do nothing."""
    file = _file(folder, os.getpid())
    if file is None:
        yield
        return
    byte = int.from_bytes(hashlib.blake2b(name.encode(), digest_size=7).digest(), "big")
    held = _acquired(file, byte)
    try:
        yield
    finally:
        if held:
            fcntl.lockf(file, fcntl.LOCK_UN, 1, byte)


@lru_cache(maxsize=1024)
def _file(folder: Path, process: int) -> int | None:
    """Return the file of the locks of a folder, which stays open in this process: closing it would end all of them."""
    with contextlib.suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
        return os.open(folder / "kernels.lock", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    return None


def _acquired(file: int, byte: int) -> bool:
    """Wait for a lock; return whether it is held."""
    given_up = time.monotonic() + PATIENCE
    while time.monotonic() < given_up:
        try:
            fcntl.lockf(file, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, byte)
            return True
        except (BlockingIOError, PermissionError):  # another process has it
            time.sleep(PAUSE)
        except OSError:  # a file system without locks
            return False
    return False
