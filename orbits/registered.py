"""Registries: what is in a folder is known by being there."""

from __future__ import annotations

import importlib
import pkgutil
from functools import lru_cache
from typing import TypeVar

T = TypeVar("T")


@lru_cache(maxsize=16)
def registered(package: str, base: type[T], name: str) -> dict[str, type[T]]:
    """Return the classes of a package that derive from a base and have an attribute `name`, by its value."""
    found: dict[str, type[T]] = {}
    for module in pkgutil.iter_modules(importlib.import_module(package).__path__):
        for value in vars(importlib.import_module(f"{package}.{module.name}")).values():
            if isinstance(value, type) and issubclass(value, base) and hasattr(value, name):
                found[getattr(value, name)] = value
    return found
