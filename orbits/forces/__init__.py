"""Forces without a Lagrangian, one file each. They are registered by being in this folder."""

from __future__ import annotations

import importlib
import pkgutil

from orbits.forces.base import Force

__all__ = ["registry"]

_FOUND: dict[str, type[Force]] = {}
for _module in pkgutil.iter_modules(__path__):
    for _value in list(vars(importlib.import_module(f"{__name__}.{_module.name}")).values()):
        if isinstance(_value, type) and issubclass(_value, Force) and hasattr(_value, "kind"):
            _FOUND[_value.kind] = _value


def registry() -> dict[str, type[Force]]:
    """Return every force of the package by its kind."""
    return dict(_FOUND)
