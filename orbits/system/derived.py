"""What is computed of a system is computed once: a system never changes, and is often propagated many times."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from orbits.system.system import System

T = TypeVar("T")


def derived(system: System, compute: Callable[[System], T]) -> T:
    """Return compute(system), which nobody changes, from the first time that it was asked for."""
    known = system._derived
    if compute not in known:
        known[compute] = compute(system)
    found: T = known[compute]
    return found
