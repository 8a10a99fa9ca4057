"""L and its derivatives at one point, by calling its kernels from Python.

A compiled function around them would double the compile time.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from numpy import float64
from numpy.typing import NDArray

from orbits.kernels.binding import SumTag, Tag, kernel_of

Array = NDArray[float64]
Parameters = Array | tuple[Array, ...]
"""A vector; for a sum of terms, one for each, Newton's first."""


def value(tag: Tag, parameters: Parameters, t: float, q: Array, v: Array) -> float:
    """Return L(q, v, t); q, v : (d,)."""
    first, *others = (kernel(*own, t, q, v) for kernel, own in _kernels(tag, parameters, "value"))
    return float(sum(others, first))


def gradients(tag: Tag, parameters: Parameters, t: float, q: Array, v: Array, f: Array, p: Array) -> None:
    """Write dL/dq into f and dL/dv into p, each (d,)."""
    for kernel, own in _kernels(tag, parameters, "gradients"):
        kernel(*own, t, q, v, f, p)


def hessians(tag: Tag, parameters: Parameters, t: float, q: Array, v: Array, out: Array) -> None:
    """Write d2L/dq dq, d2L/dq dv and d2L/dv dv, each (d, d) row by row, into out (3 d^2,)."""
    for kernel, own in _kernels(tag, parameters, "hessians"):
        kernel(*own, t, q, v, out)


def _kernels(tag: Tag, parameters: Parameters, name: str) -> Iterator[tuple[Any, tuple[Array, ...]]]:
    """Yield kernels with their parameters: the first writes, those of the other terms of a sum add."""
    terms = tag.terms if isinstance(tag, SumTag) else (tag,)
    strength, *vectors = parameters if isinstance(parameters, tuple) else (parameters,)
    yield kernel_of(terms[0].type, name), (strength,)
    for term, own in zip(terms[1:], vectors, strict=True):
        yield kernel_of(term.type, name), (strength, own)
