"""Lagrangians, one file each: `orbits.lagrangians.pendulum`, `.kepler`, `.double_pendulum`, ...

A walk over this folder registers every module-level `Lagrangian` and makes it an attribute of this package, in the
place of the module that it stands in. Importing compiles nothing and does not load SymPy.
"""

from __future__ import annotations

import importlib
import pkgutil

from orbits.lagrangians.base import Lagrangian
from orbits.lagrangians.symmetry import boost, rotation, translation

__all__ = ["boost", "registry", "rotation", "translation"]

_FOUND: dict[str, Lagrangian] = {}
for _module in pkgutil.iter_modules(__path__):
    for _name, _value in list(vars(importlib.import_module(f"{__name__}.{_module.name}")).items()):
        if isinstance(_value, Lagrangian):
            _FOUND[_value.name] = globals()[_name] = _value


def registry() -> dict[str, Lagrangian]:
    """Return every Lagrangian of the package by its name."""
    return dict(_FOUND)
