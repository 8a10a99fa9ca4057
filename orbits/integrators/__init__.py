"""Integrators, one file each. A walk over this folder registers every `Integrator`."""

from __future__ import annotations

import ast
import dataclasses
import importlib
import pkgutil
from collections.abc import Mapping
from difflib import get_close_matches
from functools import lru_cache
from typing import Any

from orbits.errors import InputError, UnknownNameError
from orbits.integrators.base import Integrator


@lru_cache(maxsize=1)
def registry() -> dict[str, type[Integrator]]:
    """Return every integrator of the package by its name."""
    found: dict[str, type[Integrator]] = {}
    for module in pkgutil.iter_modules(__path__):
        for value in vars(importlib.import_module(f"{__name__}.{module.name}")).values():
            if isinstance(value, type) and issubclass(value, Integrator) and hasattr(value, "name"):
                found[value.name] = value
    return found


def describe(integrator: Integrator) -> dict[str, Any]:
    """Return {"name": ..., "parameters": {...}}, from which `build` makes an equal integrator."""
    return {"name": integrator.name, "parameters": dataclasses.asdict(integrator)}


def build(description: Mapping[str, Any]) -> Integrator:
    """Return the integrator that `describe` described. Raises UnknownNameError or InputError."""
    cls = _find(str(description.get("name")))
    try:
        return cls(**description.get("parameters", {}))
    except TypeError:
        known = ", ".join(f.name for f in dataclasses.fields(cls)) or "none"
        given = ", ".join(description.get("parameters", {}))
        raise InputError(f"{cls.name} got the parameters ({given}); it knows: {known}") from None


def parse(text: str) -> Integrator:
    """Return the integrator that a person typed: "gauss", "gauss(stages=4)", "StormerVerlet()".

    Raises UnknownNameError for a name that is not registered and InputError for parameters that cannot be read.
    """
    try:
        tree = ast.parse(text.strip().replace("-", "_"), mode="eval").body
    except (SyntaxError, ValueError, MemoryError, RecursionError):
        tree = None
    if isinstance(tree, ast.Name):
        return build({"name": tree.id})
    if isinstance(tree, ast.Call) and isinstance(tree.func, ast.Name) and not tree.args:
        try:
            parameters = {str(k.arg): ast.literal_eval(k.value) for k in tree.keywords}
        except (ValueError, TypeError):
            parameters = None
        if parameters is not None:
            return build({"name": tree.func.id, "parameters": parameters})
    raise InputError(f'cannot read the integrator {text!r}; write e.g. gauss, "gauss(stages=4)" or stormer-verlet')


def _find(name: str) -> type[Integrator]:
    def key(text: str) -> str:
        return text.lower().replace("-", "").replace("_", "")

    known = registry()
    for cls in known.values():
        if key(name) in (key(cls.name), key(cls.__name__)):
            return cls
    close = get_close_matches(name.replace("_", "-").lower(), known, n=1, cutoff=0.4)
    hint = f"; did you mean {close[0]}?" if close else "."
    raise UnknownNameError(f"no integrator is called {name!r}{hint} Known: {', '.join(sorted(known))}.")
