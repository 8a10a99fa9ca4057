"""Terms of N-body Lagrangians, one file each: `ZonalHarmonics`, ... They are registered by being in this folder."""

from __future__ import annotations

import importlib
import pkgutil

from orbits.lagrangians.terms.base import Term

__all__ = ["registry"]

_FOUND: dict[str, type[Term]] = {}
for _module in pkgutil.iter_modules(__path__):
    for _value in list(vars(importlib.import_module(f"{__name__}.{_module.name}")).values()):
        if isinstance(_value, type) and issubclass(_value, Term) and _value is not Term:
            _FOUND[_value.kind] = _value


def registry() -> dict[str, type[Term]]:
    """Return every term of the package by its kind."""
    return dict(_FOUND)
