"""Lagrangians from kernels that a user wrote by hand."""

from __future__ import annotations

import hashlib
import inspect
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from orbits.errors import InputError
from orbits.kernels.binding import Tag
from orbits.lagrangians.base import GRADIENTS, SEPARABLE, Compiled, Lagrangian, Motion
from orbits.lagrangians.symmetry import Symmetry

CANONICAL = ("value", "gradients", "hessians")
KNOWN = ("accelerate", *CANONICAL)


def from_kernels(
    kernels: Mapping[str, Any],
    *,
    coordinates: Sequence[str],
    name: str,
    parameters: Mapping[str, float],
    example: Motion | None,
    symmetries: Sequence[Symmetry],
    formula: str,
    source: str,
) -> Lagrangian:
    """Return a Lagrangian from kernels; see `Lagrangian.from_kernels`."""
    unknown = [key for key in kernels if key not in KNOWN]
    if unknown:
        raise InputError(f"'{name}': no kernel is called {', '.join(unknown)}; known are {', '.join(KNOWN)}")
    bare = [key for key, value in kernels.items() if not hasattr(value, "py_func")]
    if bare:
        raise InputError(f"'{name}': {', '.join(bare)} is not compiled; put @orbits.kernel above its definition")
    canonical = [key for key in CANONICAL if key in kernels]
    if canonical and len(canonical) < 3:
        missing = [key for key in CANONICAL if key not in kernels]
        raise InputError(f"'{name}': {', '.join(canonical)} need {', '.join(missing)} beside them")
    if not kernels:
        raise InputError(f"'{name}': no kernels were given; expected accelerate, or {', '.join(CANONICAL)}")
    if isinstance(coordinates, str) or not len(coordinates):
        raise InputError(f"'{name}': coordinates must be a list of names, got {coordinates!r}")
    traits = {SEPARABLE} if "accelerate" in kernels else set()
    traits |= {GRADIENTS} if canonical else set()
    d = len(coordinates)
    provided = {**kernels, "dimension": d}
    if "accelerate" in kernels:
        provided["accelerate_stages"] = kernels["accelerate"]
    made = Compiled(Tag(f"{name}-{d}-{_digest(kernels)}", provided), frozenset(traits))
    return Lagrangian(
        name=name,
        formula=formula or "by hand",
        coordinates=tuple(coordinates),
        parameters=dict(parameters),
        compile=lambda: made,
        example=example,
        symmetries=tuple(symmetries),
        source=source,
    )


def _digest(kernels: Mapping[str, Any]) -> str:
    """A hash of the files that the kernels stand in: an edit there makes compiled code stale."""
    digest = hashlib.sha256()
    for key, value in sorted(kernels.items()):
        function = value.py_func
        digest.update(f"{key} {function.__module__}.{function.__qualname__}".encode())
        path = Path(inspect.getfile(function))
        # What was typed into a session has no file; its code stands for it.
        digest.update(path.read_bytes() if path.is_file() else repr(function.__code__.co_consts).encode())
        digest.update(function.__code__.co_code)
    return digest.hexdigest()[:16]
