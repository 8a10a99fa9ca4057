"""Spins locked in a resonance: the periodic one, its forced libration, and free librations about it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from orbits.checks import finite_number, whole_number
from orbits.errors import InputError, shown
from orbits.spin_orbit.path import SpinPath

if TYPE_CHECKING:
    from orbits.spin_orbit.planar import PlanarSpins

Array = NDArray[np.float64]

PLACES = 256
"""Places of a revolution at which the periodic spin is looked at."""

WEAK = 1e-11
"""What det(1 - M) of a revolution's map must exceed: rounding makes 4e-12 where all spins near a resonance repeat, and
none is locked.
"""

REACH = 2.5
"""Rates this far from the resonance are tried at the pericentre."""


@dataclass(frozen=True, eq=False)
class Libration:
    """A spin that makes `resonance` turns in each revolution of the orbit, and what small changes of it do.

    resonance : turns in a revolution
    theta, rate : at the pericentre, radians and units of n
    multipliers : the eigenvalues of a revolution's map about it, (2,), complex
    stable : whether small librations stay small
    period : of free librations, in revolutions of the orbit; NaN if it is not stable, or nothing librates
    path : a revolution, at 256 places
    """

    resonance: float
    theta: float
    rate: float
    multipliers: NDArray[np.complex128] = field(repr=False)
    stable: bool
    period: float
    path: SpinPath = field(repr=False)

    @property
    def angle(self) -> Array:
        """The forced libration over the revolution, theta - resonance M, (256,), radians."""
        return np.asarray(self.path.theta[0, :-1] - self.resonance * self.path.mean_anomaly[:-1])

    def sine(self, multiple: int) -> float:
        """Return the coefficient of sin(multiple M) in the forced libration, radians."""
        return self._coefficient(np.sin, multiple)

    def cosine(self, multiple: int) -> float:
        """Return the coefficient of cos(multiple M), radians: what tides add."""
        return self._coefficient(np.cos, multiple)

    def _coefficient(self, wave: Any, multiple: int) -> float:
        whole_number(multiple, "multiple", most=PLACES // 4)
        M, E = self.path.mean_anomaly[:-1], self.path.eccentric_anomaly[:-1]
        weights = 1.0 - self.path.spins.eccentricity * np.cos(E)
        return float(2.0 * np.mean(weights * self.angle * wave(multiple * M)))


def locked(spins: PlanarSpins, resonance: float, theta: float, rate: float | None) -> Libration:
    """Return the periodic spin of a resonance; see `PlanarSpins.libration`."""
    p, angle = finite_number(resonance, "resonance"), finite_number(theta, "theta")
    if (2.0 * p) % 1.0:
        raise InputError(f"resonance is {shown(resonance)}; expected a multiple of 1/2: 1, 3/2, 2, ...")
    if rate is not None:
        found = [_refined(spins, p, angle, finite_number(rate, "rate"))]
    else:
        if abs(np.sin(2.0 * angle)) > 1e-9:
            raise InputError(f"theta is {shown(theta)}; expected 0 or pi/2, unless a rate is given to begin with.")
        found = [_refined(spins, p, angle, float(guess)) for guess in _crossings(spins, p, angle)]
    kept = [each for each in found if each is not None]
    if not kept:
        raise InputError(
            f"no spin of {p:g} turns in a revolution was found near theta = {angle:g} at the pericentre; try another "
            "theta, or give a rate to begin with. A resonance too weak for floats, as all but 1 on a circle, is none."
        )
    return min(kept, key=lambda each: (not each.stable, abs(each.rate - p)))


def _crossings(spins: PlanarSpins, p: float, theta: float) -> Array:
    """Return rates at which half a revolution takes a spin half its way: symmetry does the rest."""
    rates = np.linspace(p - REACH, p + REACH, 640)
    reached = spins.march(theta, rates, 1, samples=2).theta[:, 1] - theta - p * np.pi
    k = np.flatnonzero(np.sign(reached[:-1]) != np.sign(reached[1:]))
    part = reached[k] / (reached[k] - reached[k + 1])
    return np.asarray(rates[k] + part * (rates[k + 1] - rates[k]))


def _refined(spins: PlanarSpins, p: float, theta: float, rate: float) -> Libration | None:
    """Return the periodic spin near a start by Newton's method, or None if it leads nowhere."""
    change = np.inf
    for _ in range(40):
        ends, matrices = spins.tangents(theta, rate, 1)
        miss = ends[0] - (theta + 2.0 * np.pi * p, rate)
        step = np.linalg.lstsq(np.eye(2) - matrices[0], miss, rcond=None)[0]
        before, change = change, float(np.abs(step).max())
        if not change < 1.0:
            return None
        theta, rate = theta + float(step[0]), rate + float(step[1])
        if change < 1e-14 or (change < 1e-11 and change >= before):
            break
    else:
        return None
    ends, matrices = spins.tangents(theta, rate, PLACES)
    path = spins.march(theta, rate, 1, samples=PLACES)
    M = matrices[-1]
    if spins.asphericity and not abs(1.0 - np.trace(M) + np.linalg.det(M)) > WEAK:
        return None
    multipliers = np.linalg.eigvals(M).astype(np.complex128)
    stable = bool(np.abs(multipliers).max() <= 1.0 + 1e-9 and abs(np.trace(M)) < 2.0)
    period = 1.0 / _turns(matrices) if stable and spins.asphericity else math.nan
    return Libration(p, theta, rate, multipliers, stable, period, path)


def _turns(matrices: Array) -> float:
    """Return the turns of small librations in a revolution: whole ones, too, as the vectors between show."""
    vectors = np.vstack([[[0.0, 1.0]], matrices[:, :, 1]])
    angles = np.unwrap(np.arctan2(vectors[:, 0], vectors[:, 1]))
    seen = (angles[-1] - angles[0]) / (2.0 * np.pi)
    M = matrices[-1]
    part = math.acos(np.trace(M) / (2.0 * math.sqrt(np.linalg.det(M)))) / (2.0 * np.pi)
    part = math.copysign(part, M[0, 1])
    return float(abs(part + round(seen - part)))
