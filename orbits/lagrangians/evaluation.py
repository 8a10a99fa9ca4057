"""L and its derivatives at one point, for callers that are not compiled: its kernels, called from Python.

A compiled function around them would double what compiling takes.
"""

from __future__ import annotations

from typing import Any

from numpy import float64
from numpy.typing import NDArray

from orbits.kernels.binding import Tag, kernel_of

Array = NDArray[float64]


def value(tag: Tag, parameters: Array, t: float, q: Array, v: Array) -> float:
    """Return L(q, v, t); q, v : (d,)."""
    return float(_kernel(tag, "value")(parameters, t, q, v))


def gradients(tag: Tag, parameters: Array, t: float, q: Array, v: Array, f: Array, p: Array) -> None:
    """Write dL/dq into f and dL/dv into p, each (d,)."""
    _kernel(tag, "gradients")(parameters, t, q, v, f, p)


def hessians(tag: Tag, parameters: Array, t: float, q: Array, v: Array, out: Array) -> None:
    """Write d2L/dq dq, d2L/dq dv and d2L/dv dv, each (d, d) row by row, into out (3 d^2,)."""
    _kernel(tag, "hessians")(parameters, t, q, v, out)


def _kernel(tag: Tag, name: str) -> Any:
    return kernel_of(tag.type, name)
