"""What every diagnostic does first: check the shapes, and leave the massless rows out."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray

from orbits.diagnostics.doubledouble import Floats
from orbits.errors import InputError, shown

# Elements of one intermediate array. About thirty are alive at once: 16k of them stay in the second-level cache.
BLOCK = 16_384

ORDINARY = 100
"""Powers of two up to which no product of three numbers overflows or loses digits."""


def massive_rows(gm: ArrayLike, **arrays: ArrayLike) -> tuple[Floats, list[Floats]]:
    """(gm > 0, and the rows of each array that belong to them), shapes (m,) and (..., m, 3), contiguous float64.

    Raises InputError, naming the array, where a shape does not fit, a value of a massive body is not finite, or a gm
    is not finite or below 0.
    """
    gm_values = finite(numbers(gm, "gm"), "gm")
    if gm_values.ndim != 1:
        raise InputError(f"gm has shape {gm_values.shape}; expected one value for each body, shape (n,).")
    if (gm_values < 0.0).any():
        raise InputError(f"gm is {gm_values.min():g} for a body; expected values >= 0.")
    massive = gm_values > 0.0
    rows = []
    shape: tuple[int, ...] | None = None
    for name, array in arrays.items():
        values = numbers(array, name)
        if values.ndim < 2 or values.shape[-2:] != (len(gm_values), 3):
            raise InputError(
                f"{name} has shape {values.shape}; expected (..., {len(gm_values)}, 3) for {len(gm_values)} bodies."
            )
        if shape is not None and values.shape != shape:
            raise InputError(f"{name} has shape {values.shape}; expected {shape}, as the other arrays of this state.")
        shape = values.shape
        rows.append(finite(np.ascontiguousarray(values if massive.all() else values[..., massive, :]), name))
    return gm_values[massive], rows


def numbers(value: ArrayLike, what: str) -> Floats:
    """Return an array as float64. Raises InputError, naming it, for what is no real numbers, or has a unit."""
    try:
        array = np.asarray(value)
        if array.dtype.kind in "biuf" and not hasattr(value, "unit") and not isinstance(value, np.ma.MaskedArray):
            return np.asarray(array, dtype=np.float64)
    # Whatever an object of the caller's raises when it is asked for its numbers.
    except Exception:
        pass
    remedy = " Take the floats, such as system.values.q." if hasattr(value, "unit") else ""
    raise InputError(f"{what} is {shown(value)}; expected an array of real numbers.{remedy}")


def finite(values: Floats, what: str) -> Floats:
    """Return the values. Raises InputError, naming them and the place, where one of them is not finite."""
    bad = ~np.isfinite(values)
    if bad.any():
        place = [int(i) for i in np.argwhere(bad)[0]]
        raise InputError(f"{what}{place if place else ''} is {values[bad][0]}; expected finite numbers.")
    return values


def scaled(x: Floats) -> tuple[Floats, int]:
    """Return (x / 2^k, k): exact, and so that no product of three of its elements overflows.

    k is 0 for all that is measured in sensible units.
    """
    k = int(np.frexp(np.max(np.abs(x), initial=0.0))[1])
    return (x, 0) if abs(k) < ORDINARY else (np.ldexp(x, -k), k)


def balanced(gm: Floats, *arrays: Floats) -> tuple[Floats, list[Floats], int]:
    """Return (weights, arrays, k), of which the products of a weight and components of the arrays are those of gm, over
    2^k: exact, at most about 1, and none vanishes that counts beside the others.

    gm : (m,); arrays : (..., m, 3)
    Each body is scaled on its own, by powers of two; nothing is where all is measured in sensible units.
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
    """Return values 2^k. Raises InputError where that, named `what`, is beyond the range of floats."""
    with np.errstate(over="ignore"):
        out = np.ldexp(values, k)
    if not np.isfinite(out).all():
        raise InputError(
            f"{what} of these bodies is beyond the range of floats, 1.8e308; choose units in which gm, q and v are "
            "nearer to 1."
        )
    return out


def blocks(samples: int, width: int) -> Iterator[slice]:
    """Slices over `samples` rows so that rows times `width` stays near BLOCK elements."""
    step = max(1, BLOCK // max(1, width))
    for start in range(0, samples, step):
        yield slice(start, min(start + step, samples))
