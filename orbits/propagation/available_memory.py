"""How much memory this machine has, and how much of it samples may take."""

from __future__ import annotations

import os
from functools import cache

MEMORY_SHARE = 0.8
"""How much of the machine's memory the samples that one call returns may take."""


@cache
def memory() -> float:
    """Return the size of this machine's memory in bytes; infinity where the system does not say."""
    try:
        return float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    except (AttributeError, ValueError, OSError):
        return float("inf")
