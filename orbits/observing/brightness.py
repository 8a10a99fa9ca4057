"""The visual magnitude of asteroids, by the H, G system of the IAU.

    V = H + 5 lg(r Δ) - 2.5 lg[(1 - G) Φ1(α) + G Φ2(α)],   Φi = exp[-Ai tan(α/2)^Bi]

with the distances r from the Sun and Δ from the observer in au, the phase angle α, and A = 3.33, 1.87, B = 0.63, 1.22.
It is made for α up to 120 degrees; above 90 degrees it may be wrong by a magnitude.
Source: Bowell et al. (1989), in Asteroids II, 524; adopted by the IAU in 1985.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbits import ephemeris
from orbits.body_names import few, index_of
from orbits.catalogue import Catalogue
from orbits.checks import finite_number
from orbits.errors import InputError, UnknownNameError, shown

Array = NDArray[np.float64]

A, B = (3.33, 1.87), (0.63, 1.22)
USUAL_G = 0.15
"""What the Minor Planet Center and JPL take for G where it is not known."""


def magnitude(H: float, G: float, sun_distance: Array, distance: Array, phase: Array) -> Array:
    """Return V, (m,). Distances in au, the phase angle in radians."""
    half = np.tan(phase / 2.0)
    one, two = (np.exp(-a * half**b) for a, b in zip(A, B, strict=True))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(H + 5.0 * np.log10(sun_distance * distance) - 2.5 * np.log10((1.0 - G) * one + G * two))


def slopes(names: Sequence[str], H: Any, G: Any) -> dict[str, tuple[float, float]]:
    """Return H and G of the bodies for which they are known.

    names : of the bodies that are observed, whose distance from the Sun is known
    H : a number for a single body, numbers by name, a `Catalogue`, or None for the catalogue of the package
    G : as H, in numbers; where a catalogue has none it is 0.15, as for the MPC and JPL
    Raises InputError for H without G, or G without H, and UnknownNameError for a body that is not observed.
    """
    if H is None or isinstance(H, Catalogue):
        if G is not None:
            raise InputError("G is given without H; expected both: H=19.09, G=0.24, or by name, H={'Apophis': 19.09}.")
        return _of_catalogue(names, H)
    of_H, of_G = ({} if x is None else _by_name(names, x, what) for what, x in (("H", H), ("G", G)))
    if missing := [name for name in of_H if name not in of_G]:
        raise InputError(
            f"H is given without G for {few(missing)}; expected both. Where it is not known, the MPC and JPL take "
            f"G={USUAL_G}."
        )
    if more := [name for name in of_G if name not in of_H]:
        raise InputError(f"G is given without H for {few(more)}; expected both.")
    return {name: (of_H[name], of_G[name]) for name in of_H}


def _by_name(names: Sequence[str], given: Any, what: str) -> dict[str, float]:
    if isinstance(given, Mapping):
        return {
            names[index_of(name, names, of=what)]: finite_number(x, f"{what}[{name!r}]")
            for name, x in given.items()
        }
    if not names:
        raise InputError(
            f"{what} is {shown(given)}, but no observed body has a known distance from the Sun; expected none."
        )
    if len(names) != 1:
        raise InputError(
            f"{what} is {shown(given)} for {len(names)} bodies; expected numbers by name, such as "
            f"{what}={{{names[0]!r}: {0.15 if what == 'G' else 12.3}}}."
        )
    return {names[0]: finite_number(given, what)}


def _of_catalogue(names: Sequence[str], catalogue: Catalogue | None) -> dict[str, tuple[float, float]]:
    found = {}
    for name in names:
        try:
            row = ephemeris.asteroids(names=name) if catalogue is None else catalogue[name]
        except (UnknownNameError, InputError):
            continue
        if np.isfinite(row.H[0]):
            found[name] = float(row.H[0]), _slope(row.details.get("G"))
    return found


def _slope(column: Any) -> float:
    try:
        slope = float(column[0])
    except (TypeError, ValueError, IndexError):
        return USUAL_G
    return slope if np.isfinite(slope) else USUAL_G
