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
    closures = [key for key, value in kernels.items() if value.py_func.__closure__]
    if closures:
        raise InputError(
            f"'{name}': {', '.join(closures)} uses a variable of the function that it is defined in, which compiled "
            "code would keep for ever; make it one of the parameters"
        )
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


def _sources(function: Any, seen: dict[str, bytes]) -> None:
    """Collect the sources of a function's file and of those that hold the kernels it calls."""
    path = Path(inspect.getfile(function))
    # What was typed into a session has no file; its code stands for it.
    code = function.__code__
    seen[f"{function.__module__}.{function.__qualname__}"] = code.co_code + repr(code.co_consts).encode()
    if path.is_file():
        seen[str(path)] = path.read_bytes()
    for name in code.co_names:
        called = getattr(function.__globals__.get(name), "py_func", None)
        if called is not None and f"{called.__module__}.{called.__qualname__}" not in seen:
            _sources(called, seen)


def _digest(kernels: Mapping[str, Any]) -> str:
    """A hash of the files that the kernels and what they call stand in: an edit there makes compiled code stale."""
    digest = hashlib.sha256()
    for key, value in sorted(kernels.items()):
        seen: dict[str, bytes] = {}
        _sources(value.py_func, seen)
        digest.update(key.encode())
        for name, text in sorted(seen.items()):
            digest.update(name.encode() + text)
    return digest.hexdigest()[:16]
