"""L and its derivatives at one point, by calling its kernels from Python.

A compiled function around them would double the compile time. What kernels write is looked at: they may be a user's.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbits.errors import InputError
from orbits.kernels.binding import SumTag, Tag, kernel_of

Array = NDArray[np.float64]
Parameters = Array | tuple[Array, ...]
"""A vector; for a sum of terms, one for each, Newton's first."""

UNSET = 0x7FF8_0000_0BAD_5EED
"""The bits of a NaN that no arithmetic makes: what outputs hold before a kernel writes them."""

SPARE = 8
"""Numbers behind each output, which no kernel may write."""


def value(tag: Tag, parameters: Parameters, t: float, q: Array, v: Array, only: int | None = None) -> float:
    """Return L(q, v, t); q, v : (d,); only : the number of a term of a sum, 0 for Newton's, to be taken alone."""
    first, *others = (kernel(*own, t, q, v) for kernel, own in _kernels(tag, parameters, "value", only))
    return float(sum(others, first))


def gradients(
    tag: Tag, parameters: Parameters, t: float, q: Array, v: Array, only: int | None = None
) -> tuple[Array, Array]:
    """Return dL/dq and dL/dv, each (d,); only : as in `value`.

    Raises InputError if a kernel leaves a part of them unset, or writes beyond them.
    """
    d = len(q)
    f, p = _output(d, only), _output(d, only)
    for kernel, own in _kernels(tag, parameters, "gradients", only):
        kernel(*own, t, q, v, f[:d], p[:d])
    return _written(f, "gradients", "f", d, ("dL/dq",)), _written(p, "gradients", "p", d, ("dL/dv",))


def hessians(tag: Tag, parameters: Parameters, t: float, q: Array, v: Array, only: int | None = None) -> Array:
    """Return d2L/dq dq, d2L/dq dv and d2L/dv dv, each (d, d) row by row, (3 d^2,); only : as in `value`.

    Raises InputError as `gradients` does.
    """
    d = len(q)
    out = _output(3 * d * d, only)
    for kernel, own in _kernels(tag, parameters, "hessians", only):
        kernel(*own, t, q, v, out[: 3 * d * d])
    return _written(out, "hessians", "out", d * d, ("d2L/dq dq", "d2L/dq dv", "d2L/dv dv"))


def _kernels(
    tag: Tag, parameters: Parameters, name: str, only: int | None
) -> Iterator[tuple[Any, tuple[Array, ...]]]:
    """Yield kernels with their parameters: the first writes, those of the other terms of a sum add."""
    terms = tag.terms if isinstance(tag, SumTag) else (tag,)
    strength, *vectors = parameters if isinstance(parameters, tuple) else (parameters,)
    for k, term in enumerate(terms):
        if only is None or k == only:
            yield kernel_of(term.type, name), (strength, vectors[k - 1]) if k else (strength,)


def _output(size: int, only: int | None) -> Array:
    """Return an output for kernels that write, with spare numbers behind it; zeros for one that adds."""
    out = np.full(size + SPARE, UNSET, dtype=np.int64).view(np.float64)
    if only:
        out[:size] = 0.0
    return out


def _written(out: Array, kernel: str, argument: str, each: int, parts: tuple[str, ...]) -> Array:
    """Return what a kernel has written, parts of `each` numbers. Raises InputError as `gradients` does."""
    size, unset = each * len(parts), out.view(np.int64) == UNSET
    if not unset[size:].all():
        raise InputError(
            f"the kernel {kernel} writes beyond its output {argument}, of {size} numbers; expected "
            f"put({argument}, k, ...) with k = 0 ... {size - 1} alone."
        )
    if unset[:size].any():
        k = int(np.argmax(unset))
        raise InputError(
            f"the kernel {kernel} leaves number {k} of its output {argument} unset, number {k % each} of "
            f"{parts[k // each]}; expected put({argument}, k, ...) for all k = 0 ... {size - 1}. It is to write, and "
            "not to add to what is there."
        )
    return out[:size]
