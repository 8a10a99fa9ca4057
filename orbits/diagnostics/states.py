"""What every diagnostic does first: check the shapes, and leave the massless rows out."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike

from orbits.diagnostics.doubledouble import Floats
from orbits.errors import InputError

# Elements of one intermediate array. About thirty are alive at once: 16k of them stay in the second-level cache.
BLOCK = 16_384


def massive_rows(gm: ArrayLike, **arrays: ArrayLike) -> tuple[Floats, list[Floats]]:
    """(gm > 0, and the rows of each array that belong to them), shapes (m,) and (..., m, 3), contiguous float64.

    Raises InputError where a shape does not fit, naming the array.
    """
    gm_values = np.asarray(gm, dtype=np.float64)
    if gm_values.ndim != 1:
        raise InputError(f"gm has shape {gm_values.shape}; expected one value for each body, shape (n,).")
    massive = gm_values > 0
    rows = []
    shape: tuple[int, ...] | None = None
    for name, array in arrays.items():
        values = np.asarray(array, dtype=np.float64)
        if values.ndim < 2 or values.shape[-2:] != (len(gm_values), 3):
            raise InputError(
                f"{name} has shape {values.shape}; expected (..., {len(gm_values)}, 3) for {len(gm_values)} bodies."
            )
        if shape is not None and values.shape != shape:
            raise InputError(f"{name} has shape {values.shape}; expected {shape}, as the other arrays of this state.")
        shape = values.shape
        rows.append(np.ascontiguousarray(values if massive.all() else values[..., massive, :]))
    return gm_values[massive], rows


def blocks(samples: int, width: int) -> Iterator[slice]:
    """Slices over `samples` rows so that rows times `width` stays near BLOCK elements."""
    step = max(1, BLOCK // max(1, width))
    for start in range(0, samples, step):
        yield slice(start, min(start + step, samples))
