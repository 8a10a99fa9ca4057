"""Terms of N-body Lagrangians, one file each: `ZonalHarmonics`, ... They are registered by being in this folder."""

from __future__ import annotations

import importlib
import pkgutil
from functools import lru_cache

from orbits.lagrangians.terms.base import Term

__all__ = ["registry"]


def registry() -> dict[str, type[Term]]:
    """Return every term of the package by its kind."""
    return dict(_found())


@lru_cache(maxsize=1)
def _found() -> dict[str, type[Term]]:
    found: dict[str, type[Term]] = {}
    for module in pkgutil.iter_modules(__path__):
        for value in list(vars(importlib.import_module(f"{__name__}.{module.name}")).values()):
            if isinstance(value, type) and issubclass(value, Term) and value is not Term:
                found[value.kind] = value
    return found
