"""Lagrangians, one file each: `orbits.lagrangians.pendulum`, `.kepler`, `.double_pendulum`, ...

Every module-level `Lagrangian` in this folder is registered, and becomes an attribute of this package in place of its
module, which is loaded on first use. Importing compiles nothing and does not load SymPy.

The class `Lagrangian` does not depend on how Lagrangians are made or pickled; these functions are added to it here.
"""

from __future__ import annotations

import copyreg
import importlib
import importlib.util
import sys
from types import ModuleType
from typing import Any

from orbits.lagrangians import pickling
from orbits.lagrangians.base import Lagrangian
from orbits.lagrangians.constraints import onto_constraints
from orbits.lagrangians.handwritten import from_kernels
from orbits.lagrangians.registered import registry
from orbits.lagrangians.rigid_bodies import full_two_body, rigid_body
from orbits.lagrangians.symbolic import from_sympy
from orbits.lagrangians.symmetry import boost, rotation, translation
from orbits.lagrangians.transforming import time_transformed

__all__ = [
    "boost",
    "from_kernels",
    "from_sympy",
    "full_two_body",
    "onto_constraints",
    "registry",
    "rigid_body",
    "rotation",
    "time_transformed",
    "translation",
]

Lagrangian.from_sympy = staticmethod(from_sympy)
Lagrangian.from_kernels = staticmethod(from_kernels)
copyreg.pickle(Lagrangian, pickling.reduced)


class _Folder(ModuleType):
    """The package: when a module is imported, the Lagrangian of its name takes its place."""

    def __setattr__(self, name: str, value: Any) -> None:
        own = getattr(value, name, None) if isinstance(value, ModuleType) else None
        super().__setattr__(name, own if isinstance(own, Lagrangian) else value)


sys.modules[__name__].__class__ = _Folder


def __getattr__(name: str) -> Any:
    """Import the module of a Lagrangian when it is first asked for."""
    if name.startswith("_") or importlib.util.find_spec(f"{__name__}.{name}") is None:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    importlib.import_module(f"{__name__}.{name}")
    return globals()[name]


def __dir__() -> list[str]:
    """Return the public names: functions, and the registered Lagrangians."""
    return [*__all__, *(name.replace("-", "_") for name in registry())]
