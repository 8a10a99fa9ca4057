"""Garbage collection, while many objects are made of which most live for a while."""

from __future__ import annotations

import contextlib
import gc
from collections.abc import Iterator

MOST = 3_000_000
"""The number of objects that may be left, of which more than a half is garbage, before all garbage is collected."""

_left = 0
"""The number of objects left since then."""


@contextlib.contextmanager
def garbage_left() -> Iterator[None]:
    """Switch garbage collection off until the end.

    Compiling makes millions of objects, and reading the sources one million: repeated garbage collection took a seventh
    of the time of the first, and half of that of the second. What is left at the end is counted as old: the next
    collection of young objects, a moment later, would go through all of it.
    """
    collects = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collects:
            _grow_old()
            gc.enable()


def _grow_old() -> None:
    """Count all objects as old, or collect garbage if there is much of it."""
    global _left
    _left += gc.get_count()[0]
    if _left > MOST:
        gc.collect()
        _left = 0
    elif gc.get_freeze_count() == 0:  # else somebody else has frozen objects, which would be let go
        gc.freeze()
        gc.unfreeze()
