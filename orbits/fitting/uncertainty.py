"""The covariance of an orbit, in Cartesian coordinates and in elements."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from astropy import units as u
from numpy.typing import NDArray

from orbits.elements.frames import icrf_to_ecliptic
from orbits.elements.osculating import elements_from_state
from orbits.errors import UnknownNameError, shown
from orbits.export import text_table

Array = NDArray[np.float64]

DEGREE = u.deg
FORMS: dict[str, tuple[tuple[str, u.UnitBase], ...]] = {
    "cartesian": (
        *((name, u.au) for name in ("x", "y", "z")),
        *((name, u.au / u.day) for name in ("vx", "vy", "vz")),
    ),
    "keplerian": (
        *(("a", u.au), ("e", u.one), ("inc", DEGREE)),
        *(("Omega", DEGREE), ("omega", DEGREE), ("M", DEGREE)),
    ),
    "cometary": (
        *(("e", u.one), ("q", u.au), ("T", u.day)),
        *(("Omega", DEGREE), ("omega", DEGREE), ("inc", DEGREE)),
    ),
}
"""The forms of an orbit with their coordinates; the last one has the order of JPL's covariances."""

STEP = 1e-6
"""Of central differences, relative to distance and speed: they are then good to 1e-10 of themselves."""


class Covariance(NamedTuple):
    """An orbit and its covariance in some coordinates.

    form : "cartesian", "keplerian" or "cometary"; names, units : of the six coordinates; values : (6,)
    matrix : (6, 6), in products of these units
    """

    form: str
    names: tuple[str, ...]
    units: tuple[u.UnitBase, ...]
    values: Array
    matrix: Array

    @property
    def sigma(self) -> Array:
        """The standard deviations, (6,)."""
        return np.asarray(np.sqrt(np.diag(self.matrix)))

    @property
    def correlation(self) -> Array:
        """The correlations, (6, 6)."""
        return np.asarray(self.matrix / np.outer(self.sigma, self.sigma))

    def __str__(self) -> str:
        return text_table(f"{self.form} orbit", ["", "unit", "value", "sigma"], self.rows(), words=2)

    def rows(self) -> list[list[str]]:
        """Return name, unit, value and sigma as text, with two digits of sigma."""
        out = []
        for name, unit, value, sigma in zip(self.names, self.units, self.values, self.sigma, strict=True):
            digits = int(np.clip(1 - np.floor(np.log10(sigma)), 0, 15)) if sigma > 0.0 else 15
            out.append([name, str(unit), f"{value:.{digits}f}", f"{sigma:.2g}"])
        return out


def in_form(form: str, state: Array, matrix: Array, sun: Array, gm: float) -> Covariance:
    """Return an orbit and its covariance in a form.

    state, matrix : (6,) and (6, 6), in the axes of the ICRF, au and au/d, relative to the barycentre
    sun : the state of the Sun then; gm : of the Sun, au^3/d^2. Elements are relative to it, in the ecliptic of J2000;
        T is in days since the epoch
    Raises UnknownNameError for another form, InputError for a state without elements.
    """
    if form not in FORMS:
        raise UnknownNameError(f"there is no form {shown(form)} of a covariance; expected one of {', '.join(FORMS)}.")
    names, units = zip(*FORMS[form], strict=True)
    if form == "cartesian":
        return Covariance(form, names, units, state.copy(), matrix.copy())
    relative = state - sun
    steps = np.repeat(STEP * np.array([np.linalg.norm(relative[:3]), np.linalg.norm(relative[3:])]), 3)
    moved = np.concatenate([relative[None], relative + np.diag(steps), relative - np.diag(steps)])
    q, v = (icrf_to_ecliptic(x) for x in (moved[:, :3], moved[:, 3:]))
    found = elements_from_state(q, v, np.full(len(q), gm))
    columns = np.array([np.rad2deg(found[name]) if unit == DEGREE else found[name] for name, unit in FORMS[form]])
    change = columns[:, 1:7] - columns[:, 7:]
    whole = np.array([360.0 if unit == DEGREE else np.inf for unit in units])
    if "T" in names:
        whole[names.index("T")] = float(found.P[0])  # the nearest passage may be another one
    leaps = np.isfinite(whole)
    change[leaps] -= whole[leaps, None] * np.round(change[leaps] / whole[leaps, None])
    jacobian = change / (2.0 * steps)
    return Covariance(form, names, units, columns[:, 0], jacobian @ matrix @ jacobian.T)
