"""The memory of this machine, and the share of it that samples may use."""

from __future__ import annotations

import os
from functools import cache

MEMORY_SHARE = 0.8
"""Share of the machine's memory that the samples returned by one call may use."""


@cache
def memory() -> float:
    """Return the size of this machine's memory in bytes, infinity if the operating system does not tell."""
    try:
        return float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    except (AttributeError, ValueError, OSError):
        return float("inf")
