"""Lagrangians from handwritten kernels."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from typing import Any

from orbits.checks import check_kernel
from orbits.errors import InputError, shown
from orbits.kernels.binding import Tag
from orbits.kernels.compile.frozen import listed
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
    told = hashlib.sha256(listed(kernels).encode()).hexdigest()[:16]  # kernels of this package, too
    made = Compiled(Tag(f"{name}-{d}-{told}", provided), frozenset(traits))
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
