"""REBOUND: systems and runs converted both ways, and runs compared with its integrators.

REBOUND is loaded when a function is called.
"""

from __future__ import annotations

from orbits.regression import compare, from_rebound, run_from_rebound, to_rebound

__all__ = [
    "compare",
    "from_rebound",
    "run_from_rebound",
    "to_rebound",
]


def __dir__() -> list[str]:
    """Return the public names."""
    return __all__
