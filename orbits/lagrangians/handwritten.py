"""Lagrangians from handwritten kernels."""

from __future__ import annotations

import hashlib
import inspect
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np

from orbits.checks import check_kernel
from orbits.errors import InputError, shown
from orbits.kernels.binding import Tag
from orbits.lagrangians.base import GRADIENTS, SEPARABLE, Compiled, Lagrangian, Motion, Symmetries

CANONICAL = ("value", "gradients", "hessians")
KNOWN = {
    "accelerate": "parameters, q, out",
    "value": "parameters, t, q, v",
    "gradients": "parameters, t, q, v, f, p",
    "hessians": "parameters, t, q, v, out",
}
"""The kernels, with their arguments."""


def from_kernels(
    kernels: Mapping[str, Any],
    *,
    coordinates: Sequence[str],
    name: str,
    parameters: Mapping[str, float] | None = None,
    example: Motion | None = None,
    symmetries: Symmetries = (),
    formula: str = "",
    source: str = "",
) -> Lagrangian:
    """Return a Lagrangian from handwritten kernels, functions compiled with `orbits.kernel`.

    kernels : some of
        accelerate(parameters, q, out)           d2q/dt2 = g(q), for a separable Lagrangian with unit masses, or
                                                 with masses defined by `gradients`
        value(parameters, t, q, v)               L
        gradients(parameters, t, q, v, f, p)     dL/dq into f, dL/dv into p
        hessians(parameters, t, q, v, out)       d2L/dq dq, d2L/dq dv, d2L/dv dv, each d x d row by row
    Read with get(q, k) and write with put(out, k, value) from `orbits.kernels.lanes`, so that a kernel works for
    vectors (d,) and for rows (d, 8), the stages of an implicit method in lanes.
    `accelerate` makes the Lagrangian separable; the other three together allow implicit methods in canonical form.
    Raises InputError for other names or arguments, and if neither set is complete.
    """
    if not isinstance(kernels, Mapping):
        raise InputError(
            f"'{name}': kernels must be functions by name, such as {{'accelerate': f}}; got {shown(kernels)}"
        )
    unknown = [str(key) for key in kernels if key not in KNOWN]
    if unknown:
        raise InputError(f"'{name}': no kernel is called {', '.join(unknown)}; known are {', '.join(KNOWN)}")
    for key, value in kernels.items():
        check_kernel(value, key, KNOWN[key], f"'{name}'")
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
    if isinstance(coordinates, str) or not isinstance(coordinates, Sequence):
        raise InputError(f"'{name}': coordinates must be a list of names, got {shown(coordinates)}")
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
        parameters=parameters or {},
        compile=lambda: made,
        example=example,
        groups=symmetries,
        source=source,
    )


def _digest(kernels: Mapping[str, Any]) -> str:
    """Return a hash of everything that compiled code freezes: two Lagrangians of one name must never share kernels."""
    digest = hashlib.sha256()
    seen: set[int] = set()
    for key, value in sorted(kernels.items()):
        digest.update(key.encode())
        _add(digest, value, seen)
    return digest.hexdigest()[:16]


def _add(digest: Any, value: Any, seen: set[int]) -> None:
    """Add a value; for a function, its file, its code and the values that it captures."""
    value = getattr(value, "py_func", value)
    if isinstance(value, np.ndarray):
        digest.update(f"{value.dtype}{value.shape}".encode() + value.tobytes())
    elif isinstance(value, ModuleType):
        digest.update(value.__name__.encode())
    elif not isinstance(value, FunctionType):
        digest.update(repr(value).encode())
    elif id(value) not in seen:
        seen.add(id(value))
        digest.update(f"{value.__module__}.{value.__qualname__}".encode())
        if value.__module__.partition(".")[0] == __name__.partition(".")[0]:
            return  # a kernel of this package
        path = Path(inspect.getfile(value))
        if path.is_file():  # not for code typed into a session
            digest.update(path.read_bytes())
        _add_code(digest, value.__code__)
        for name in value.__code__.co_names:
            if name in value.__globals__:
                _add(digest, value.__globals__[name], seen)
        for cell in value.__closure__ or ():
            _add(digest, cell.cell_contents, seen)


def _add_code(digest: Any, code: CodeType) -> None:
    digest.update(code.co_code + repr((code.co_names, code.co_varnames, code.co_freevars)).encode())
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            _add_code(digest, constant)
        else:
            digest.update(repr(constant).encode())
