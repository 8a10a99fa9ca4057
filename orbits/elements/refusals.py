"""Checks and messages shared by the functions of elements: which body, which value, what to do."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from orbits.elements.kepler_equation import Floats
from orbits.errors import InputError, shown
from orbits.units import kind_of

NO_MASS = "gm = {gm} of the attracting body; expected > 0: an orbit needs a mass to go around"
NO_DISTANCE = "the position is that of the attracting body; expected a distance > 0"
RECTILINEAR = (
    "the motion is straight towards or away from the attracting body (|q x v| = {h}): a rectilinear orbit has no plane "
    "and ends in a collision. Give it some transverse velocity"
)
EXTREME = (
    "the speed is 2^{octaves:.0f} times the local circular velocity; expected a factor within 2^-160 ... 2^160, where "
    "the elements are in the range of floats. Check the units of position, velocity and gm"
)
BEYOND = "{what} of this orbit would be {value}, beyond the range of floats. Choose units of similar size"


def named(names: Sequence[str] | None) -> Sequence[str] | None:
    """Return the names of bodies unchanged. Raises InputError for anything but a list of texts or None."""
    listed = isinstance(names, list | tuple) or (isinstance(names, np.ndarray) and names.ndim == 1)
    if names is None or (listed and all(isinstance(name, str) for name in names)):
        return names
    raise InputError(f"names is {shown(names)}; expected a list of names such as ['Ceres', 'Pallas'], or None")


def label(index: tuple[int, ...], names: Sequence[str] | None) -> str:
    """Return how a message refers to the body at `index` of an array: its name, its index, or nothing for a scalar."""
    if names is not None and len(index) > 0 and index[-1] < len(names):
        return f"{names[index[-1]]}: "
    if names is not None and len(names) == 1:
        return f"{names[0]}: "
    if len(index) == 0:
        return ""
    return f"entry {index[0] if len(index) == 1 else index}: "


def refuse(bad: NDArray[np.bool_], message: str, names: Sequence[str] | None, **values: Floats | str) -> None:
    """Raise InputError for the first True of `bad`, if any.

    message : a format string; {name} is replaced by values[name] at that index, or by values[name] itself if it is text
    """
    if not np.any(bad):
        return
    index = tuple(int(i) for i in np.argwhere(bad)[0])
    here = {key: value if isinstance(value, str) else float(value[index]) for key, value in values.items()}
    raise InputError(label(index, names) + message.format(**here))


def numbers(what: str, value: ArrayLike, expected: str) -> Floats:
    """Return `value` as a float64 array. Raises InputError unless it holds real numbers without a unit or a mask."""
    try:
        if isinstance(value, np.ma.MaskedArray) or hasattr(value, "unit"):
            raise TypeError("a masked array" if isinstance(value, np.ma.MaskedArray) else "it carries a unit")
        if isinstance(value, np.ndarray) and np.any(getattr(value, "mask", False)):
            raise TypeError("masked values are undefined")
        array = np.asarray(value)
        if array.dtype.kind not in "iuf":
            raise TypeError(f"got {kind_of(array)}")
        return array.astype(np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"{what} is {shown(value)}; expected {expected} ({error})") from error


def finite(what: str, value: ArrayLike, names: Sequence[str] | None) -> Floats:
    """Return `value` as a float64 array. Raises InputError unless all are finite numbers."""
    array = numbers(what, value, "a number or an array of numbers")
    refuse(~np.isfinite(array), what + " is {value}; expected a finite number", names, value=array)
    return array


def shaped(what: str, value: ArrayLike) -> Floats:
    """Return `value` as a new float64 array of shape (..., 3). Raises InputError for another shape or no numbers."""
    array = numbers(what, value, "an array of numbers of shape (..., 3)")
    if array.ndim == 0 or array.shape[-1] != 3:
        raise InputError(f"{what} has shape {array.shape}; expected (..., 3). Put x, y, z on the last axis")
    return array


def vectors(what: str, value: ArrayLike, names: Sequence[str] | None) -> Floats:
    """Return `value` as a float64 array of shape (..., 3). Raises InputError unless all are finite numbers."""
    array = shaped(what, value)
    bad = ~np.isfinite(array).all(axis=-1)
    if np.any(bad):
        index = tuple(int(i) for i in np.argwhere(bad)[0])
        raise InputError(f"{label(index, names)}{what} is {array[index].tolist()}; expected finite numbers")
    return array


def broadcast(names: Sequence[str] | None, **values: Floats) -> list[Floats]:
    """Return `values` broadcast to one shape. Raises InputError, listing the shapes, if they do not fit."""
    try:
        return [np.asarray(x) for x in np.broadcast_arrays(*values.values())]
    except ValueError as error:
        shapes = ", ".join(f"{key} {value.shape}" for key, value in values.items() if value.ndim)
        raise InputError(
            f"shapes do not fit together: {shapes}; expected scalars and arrays of one shape, one value per body"
        ) from error
