"""Lagrangians, one file each: `orbits.lagrangians.pendulum`, `.kepler`, `.double_pendulum`, ...

Every module-level `Lagrangian` in this folder is registered, and becomes an attribute of this package in place of its
module. Importing compiles nothing and does not load SymPy.

The class `Lagrangian` does not depend on how Lagrangians are made or pickled; these functions are added to it here.
"""

from __future__ import annotations

import copyreg
import importlib
import pkgutil

from orbits.lagrangians import pickling
from orbits.lagrangians.base import Lagrangian
from orbits.lagrangians.constraints import onto_constraints
from orbits.lagrangians.handwritten import from_kernels
from orbits.lagrangians.registered import FOUND, registry
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

for _module in pkgutil.iter_modules(__path__):
    for _name, _value in list(vars(importlib.import_module(f"{__name__}.{_module.name}")).items()):
        if isinstance(_value, Lagrangian):
            FOUND[_value.name] = globals()[_name] = _value


def __dir__() -> list[str]:
    """Return the public names: functions, and the registered Lagrangians."""
    return [*__all__, *(name for name, value in globals().items() if isinstance(value, Lagrangian))]
