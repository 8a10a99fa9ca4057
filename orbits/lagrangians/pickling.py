"""Lagrangians of this package are pickled by name and parameters; those of users have code that cannot be pickled."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from orbits.errors import InputError
from orbits.lagrangians.base import Lagrangian
from orbits.lagrangians.registered import registry


def reduced(L: Lagrangian) -> tuple[Any, ...]:
    """Return the arguments by which pickle restores L. Raises InputError for one that is not of this package."""
    own = registry().get(L.name)
    # These parts are unchanged by other parameter values; another Lagrangian has other ones.
    parts = ("coordinates", "example", "groups")
    if own is None or any(getattr(L, part) is not getattr(own, part) for part in parts):
        raise InputError(
            f"'{L.name}' cannot be pickled: its kernels are code, and not of this package. Make it again where it is "
            "needed, such as in a module that both processes import."
        )
    return named, (L.name, dict(L.parameters))


def named(name: str, parameters: Mapping[str, float]) -> Lagrangian:
    """Return the Lagrangian of this package with that name, with these values of its parameters."""
    own = registry()[name]
    return own if own.parameters == parameters else own.with_parameters(**parameters)
