"""Lagrangians, one file each. A walk over this folder registers every module-level `Lagrangian`."""

from __future__ import annotations

import importlib
import pkgutil
from functools import lru_cache

from orbits.lagrangians.base import Lagrangian


@lru_cache(maxsize=1)
def registry() -> dict[str, Lagrangian]:
    """Return every Lagrangian of the package by its name."""
    found: dict[str, Lagrangian] = {}
    for module in pkgutil.iter_modules(__path__):
        for value in vars(importlib.import_module(f"{__name__}.{module.name}")).values():
            if isinstance(value, Lagrangian):
                found[value.name] = value
    return found
