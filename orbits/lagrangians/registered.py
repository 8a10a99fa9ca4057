"""The registry of the Lagrangians of this package, by name."""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache

from orbits.lagrangians.base import Lagrangian


def registry() -> dict[str, Lagrangian]:
    """Return every Lagrangian of the package by its name."""
    return dict(_found())


@cache
def _found() -> dict[str, Lagrangian]:
    """Return the Lagrangians of all modules in this folder."""
    found = pkgutil.iter_modules(importlib.import_module("orbits.lagrangians").__path__)
    modules = [importlib.import_module(f"orbits.lagrangians.{module.name}") for module in found]
    values = (value for module in modules for value in vars(module).values())
    return {value.name: value for value in values if isinstance(value, Lagrangian)}
