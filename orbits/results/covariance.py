"""The covariance of an orbit, in Cartesian coordinates and in elements."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from astropy import units as u
from numpy.typing import NDArray

from orbits.checks import finite_numbers, is_one_of
from orbits.elements.frames import icrf_to_ecliptic
from orbits.elements.osculating import elements_from_state
from orbits.errors import InputError, UnknownNameError, shown
from orbits.export import text_table
from orbits.system.parameters import Parameter, parameters_of

if TYPE_CHECKING:
    from astropy.time import Time

    from orbits.system import System

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


NEGATIVE = 1e-9
"""The largest share of the largest eigenvalue by which rounding may make one of a covariance negative, after it was
scaled to correlations."""

SAME = 1e-3
"""Seconds by which the epoch of a covariance and that of a system may differ."""


class Covariance(NamedTuple):
    """An orbit and its covariance in some coordinates.

    form : "cartesian", "keplerian" or "cometary"; names, units : of the six coordinates, then of parameters
    values : (n,); matrix : (n, n), in products of these units
    body, epoch : whose orbit it is, and when, TDB; None if it was made by hand
    """

    form: str
    names: tuple[str, ...]
    units: tuple[u.UnitBase, ...]
    values: Array
    matrix: Array
    body: str | None = None
    epoch: Time | None = None

    def require_of(self, system: System, body: str) -> None:
        """Raise InputError unless it is of this body at the epoch of a system."""
        if self.body is not None and self.body != body:
            raise InputError(f"the covariance is of {self.body}; expected one of {body}, or body={self.body!r}.")
        if self.epoch is not None and (system.epoch is None or abs((self.epoch - system.epoch).to_value(u.s)) > SAME):
            start = "there are no dates" if system.epoch is None else f"the system is at {system.epoch.iso} TDB"
            raise InputError(
                f"the covariance is of {self.body} at {self.epoch.tdb.iso} TDB, but {start}; expected that of the same "
                "date: fit.covariance(at=...), or a run from the date of this one."
            )

    @property
    def sigma(self) -> Array:
        """The standard deviations, (n,)."""
        return np.asarray(np.sqrt(np.diag(self.matrix)))

    @property
    def correlation(self) -> Array:
        """The correlations, (n, n)."""
        return np.asarray(self.matrix / np.outer(self.sigma, self.sigma))

    def __str__(self) -> str:
        return text_table(f"{self.form} orbit", ["", "unit", "value", "sigma"], self.rows(), words=2)

    def rows(self) -> list[list[str]]:
        """Return name, unit, value and sigma as text, with two digits of sigma."""
        out = []
        for name, unit, value, sigma in zip(self.names, self.units, self.values, self.sigma, strict=True):
            digits = 1 - int(np.floor(np.log10(sigma))) if sigma > 0.0 else 15
            if digits <= 15 or value == 0.0:
                text = f"{value:.{max(0, digits)}f}"
            else:
                text = f"{value:.{int(np.clip(digits + np.floor(np.log10(abs(value))), 1, 15))}e}"
            out.append([name, str(unit), text, f"{sigma:.2g}"])
        return out


def in_units_of(system: System, covariance: Covariance) -> Array:
    """Return the matrix of a state, and of parameters of a system, in the units of this."""
    own = [*[system.units.length] * 3, *[system.units.speed] * 3]
    own += [one.unit for one in parameters_of(system, covariance.names[6:])]
    scale = [unit.to(other) for unit, other in zip(covariance.units, own, strict=True)]
    return np.asarray(covariance.matrix * np.outer(scale, scale))


class Decomposed(NamedTuple):
    """A covariance as correlations: values (n,) >= 0 and vectors (n, n) of these, and the sigmas, (n,)."""

    values: Array
    vectors: Array
    factors: Array


def decomposed(covariance: Any, size: int, expected: str) -> Decomposed:
    """Return the eigenvalues of a covariance. Raises InputError, with what is expected, for what is none."""
    matrix = finite_numbers(covariance, "covariance")
    if matrix.shape != (size, size):
        raise InputError(f"covariance has shape {matrix.shape}; expected {(size, size)}, {expected}.")
    scale = np.sqrt(np.abs(np.diag(matrix)))
    if (np.diag(matrix) < 0.0).any() or (np.abs(matrix - matrix.T) > 1e-9 * np.outer(scale, scale)).any():
        raise InputError(f"covariance is not symmetric with variances >= 0 on its diagonal; expected one {expected}.")
    factors = np.where(scale > 0.0, scale, 1.0)
    values, vectors = np.linalg.eigh((matrix + matrix.T) / 2 / np.outer(factors, factors))
    if values.min() < -NEGATIVE * max(values.max(), 0.0):
        raise InputError(
            f"covariance has a negative eigenvalue, {values.min():.3g} of its correlations; expected a covariance. "
            "Were digits lost when it was copied?"
        )
    return Decomposed(np.maximum(values, 0.0), vectors, factors)


def in_form(
    form: str,
    start: Array,
    matrix: Array,
    sun: Array,
    gm: float,
    parameters: Sequence[Parameter] = (),
    *,
    body: str | None = None,
    epoch: Time | None = None,
) -> Covariance:
    """Return an orbit and its covariance in a form, with those of parameters at the end.

    start, matrix : (n,) and (n, n), the state in the axes of the ICRF, au and au/d, relative to the barycentre, then
        the parameters
    sun : the state of the Sun then; gm : of the Sun, au^3/d^2. Elements are relative to it, in the ecliptic of J2000;
        T is in days since the epoch
    body, epoch : whose orbit it is, and when
    Raises UnknownNameError for another form, InputError for a state without elements.
    """
    if not is_one_of(form, FORMS):
        raise UnknownNameError(f"there is no form {shown(form)} of a covariance; expected one of {', '.join(FORMS)}.")
    names, units = zip(*FORMS[form], strict=True)
    names, units = (*names, *(one.name for one in parameters)), (*units, *(one.unit for one in parameters))
    if form == "cartesian":
        return Covariance(form, names, units, start.copy(), matrix.copy(), body, epoch)
    relative = start[:6] - sun
    steps = np.repeat(STEP * np.array([np.linalg.norm(relative[:3]), np.linalg.norm(relative[3:])]), 3)
    moved = np.concatenate([relative[None], relative + np.diag(steps), relative - np.diag(steps)])
    q, v = (icrf_to_ecliptic(x) for x in (moved[:, :3], moved[:, 3:]))
    found = elements_from_state(q, v, np.full(len(q), gm))
    columns = np.array([np.rad2deg(found[name]) if unit == DEGREE else found[name] for name, unit in FORMS[form]])
    change = columns[:, 1:7] - columns[:, 7:]
    whole = np.array([360.0 if unit == DEGREE else np.inf for _, unit in FORMS[form]])
    if "T" in names:
        whole[names.index("T")] = float(found.P[0])  # the nearest passage may be another one
    leaps = np.isfinite(whole)
    change[leaps] -= whole[leaps, None] * np.round(change[leaps] / whole[leaps, None])
    jacobian = np.eye(len(start))
    jacobian[:6, :6] = change / (2.0 * steps)
    values = np.append(columns[:, 0], start[6:])
    return Covariance(form, names, units, values, jacobian @ matrix @ jacobian.T, body, epoch)
