"""Forces without a Lagrangian, one file each. They are registered by being in this folder."""

from __future__ import annotations

import importlib
import pkgutil
from functools import lru_cache

from orbits.forces.base import Force

__all__ = ["registry"]


def registry() -> dict[str, type[Force]]:
    """Return every force of the package by its kind."""
    return dict(_found())


@lru_cache(maxsize=1)
def _found() -> dict[str, type[Force]]:
    found: dict[str, type[Force]] = {}
    for module in pkgutil.iter_modules(__path__):
        for value in list(vars(importlib.import_module(f"{__name__}.{module.name}")).values()):
            if isinstance(value, type) and issubclass(value, Force) and hasattr(value, "kind"):
                found[value.kind] = value
    return found
