"""What every diagnostic does first: check the shapes, leave the massless rows out, and scale against overflow."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray

from orbits.checks import finite_numbers, real_numbers
from orbits.diagnostics.doubledouble import Floats
from orbits.errors import InputError

BLOCK = 16_384
"""Elements of one intermediate array. About thirty such arrays are alive at once; they fit the second-level cache."""

ORDINARY = 100
"""Powers of two up to which no product of three numbers overflows or loses digits."""


def massive_rows(gm: ArrayLike, **arrays: ArrayLike) -> tuple[Floats, list[Floats]]:
    """Return the gm > 0, (m,), and the rows of each array for these bodies, (..., m, 3), as contiguous float64.

    Raises InputError, naming the array, where a shape does not fit, a value of a massive body is not finite, or a gm
    is not finite or is below 0.
    """
    gm_values = finite_numbers(gm, "gm")
    if gm_values.ndim != 1:
        raise InputError(f"gm has shape {gm_values.shape}; expected one value for each body, shape (n,).")
    if (gm_values < 0.0).any():
        raise InputError(f"gm is {gm_values.min():g} for a body; expected values >= 0.")
    massive = gm_values > 0.0
    rows = []
    shape: tuple[int, ...] | None = None
    for name, array in arrays.items():
        values = real_numbers(array, name)
        if values.ndim < 2 or values.shape[-2:] != (len(gm_values), 3):
            raise InputError(
                f"{name} has shape {values.shape}; expected (..., {len(gm_values)}, 3) for {len(gm_values)} bodies."
            )
        if shape is not None and values.shape != shape:
            raise InputError(f"{name} has shape {values.shape}; expected {shape}, as the other arrays of this state.")
        shape = values.shape
        rows.append(finite_numbers(np.ascontiguousarray(values if massive.all() else values[..., massive, :]), name))
    return gm_values[massive], rows


def scaled(x: Floats) -> tuple[Floats, int]:
    """Return (x / 2^k, k), which is exact, with k such that no product of three elements overflows.

    In sensible units k is 0.
    """
    k = int(np.frexp(np.max(np.abs(x), initial=0.0))[1])
    return (x, 0) if abs(k) < ORDINARY else (np.ldexp(x, -k), k)


def balanced(gm: Floats, *arrays: Floats) -> tuple[Floats, list[Floats], int]:
    """Return (weights, arrays, k): a weight times components of the arrays is the same product with gm, over 2^k.

    gm : (m,); arrays : (..., m, 3)
    The products are exact and at most about 1, and none that counts beside the others underflows. Each body is scaled
    by a power of two of its own; in sensible units nothing is scaled.
    """
    sizes = [np.max(np.abs(x), axis=(*range(x.ndim - 2), x.ndim - 1), initial=0.0) for x in arrays]
    mantissas, power = np.frexp(gm)
    powers = [np.frexp(size)[1] for size in sizes]
    counts = np.all([size > 0.0 for size in sizes], axis=0)
    if not counts.any() or all(np.all(np.abs(k[counts]) < ORDINARY) for k in (power, *powers)):
        return gm, list(arrays), 0
    whole = np.add(power, np.sum(powers, axis=0), dtype=np.int64)
    k = int(whole[counts].max())
    weights = np.ldexp(mantissas, np.clip(whole - k, -9999, 9999).astype(np.int32))
    return weights, [np.ldexp(x, -n[:, None]) for x, n in zip(arrays, powers, strict=True)], k


def unscaled(values: Floats, k: int | NDArray[np.int64], what: str) -> Floats:
    """Return values 2^k. Raises InputError, naming `what`, where this is beyond the range of floats."""
    with np.errstate(over="ignore"):
        out = np.ldexp(values, k)
    if not np.isfinite(out).all():
        raise InputError(
            f"{what} of these bodies is beyond the range of floats, 1.8e308; choose units in which gm, q and v are "
            "nearer to 1."
        )
    return out


def blocks(samples: int, width: int) -> Iterator[slice]:
    """Yield slices over `samples` rows, each of about BLOCK elements for rows of `width`."""
    step = max(1, BLOCK // max(1, width))
    for start in range(0, samples, step):
        yield slice(start, min(start + step, samples))
