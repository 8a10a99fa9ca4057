"""Frequency analysis: a series in time as a sum of few uniform rotations, each with its frequency and amplitude.

A discrete Fourier transform knows frequencies to 2 pi / T. Where a series is a sum of rotations, z = sum A exp(i w t),
more is in it: the frequency that maximizes the projection of z on exp(i w t), with a window that hides the ends, is
right to about 1/T^4. Terms are found one after the other in what is left by those before, as in Laskar's NAFF; after
each, the frequencies and amplitudes of all terms are corrected together by least squares with the window as weight, so
that a term is not displaced by its neighbours.

Source: Laskar (1990), Icarus 88, 266, and (1993), Physica D 67, 257; Sidlichovsky & Nesvorny (1996), CeMDA 65, 137.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from orbits.checks import finite_numbers, has_unit, whole_number
from orbits.diagnostics.doubledouble import Floats
from orbits.errors import InputError, shown

Complexes = NDArray[np.complex128]

UNEVEN = 1e-6
"""The largest departure of a time from even spacing, in intervals; the rounding of times to float64 makes less."""

MOST_CORRECTIONS = 12
SETTLED = 1e-9
"""Corrections of all terms end when no frequency moves by more than this fraction of 2 pi / T: the next correction
would be of the order of its square."""

PARTS = 1.0, 0.25
"""Of a correction: a smaller one is tried where the whole one does not help."""

APART = 1.0
"""The least distance of two terms, in 2 pi / T. Nearer ones, fitted together, would take any amplitudes to beat as a
single term does whose frequency is not quite constant.
"""

FINER = 4
"""How many times finer than 2 pi / T the spectrum is searched for the next term."""


@dataclass(frozen=True, eq=False)
class Frequencies:
    """The terms of a series, the largest first: z(t) is about sum_k amplitude_k exp(i frequency_k t).

    frequency : (terms,) radians per unit of time, positive or negative
    amplitude : (terms,) complex, in the unit of the series; its argument is the phase at t = 0
    resolution : 2 pi / T, in which a Fourier transform counts frequencies; terms that are closer are not told apart
    residual : root mean square of what the terms leave, weighted by the window, over that of the series
    """

    frequency: Floats
    amplitude: Complexes
    resolution: float
    residual: float

    def __len__(self) -> int:
        return len(self.frequency)

    def __repr__(self) -> str:
        lines = [f"{'frequency':>14}{'period':>14}{'amplitude':>12}{'phase [rad]':>13}"]
        for w, a in zip(self.frequency.tolist(), self.amplitude.tolist(), strict=True):
            period = 2.0 * math.pi / abs(w) if w else math.inf
            lines.append(f"{w:14.7g}{period:14.7g}{abs(a):12.4g}{cmath.phase(a):13.4f}")
        left = f"{self.residual:.2g} of the series is left; frequencies in radians per unit of time, resolution "
        return "\n".join([*lines, f"{left}{self.resolution:.3g}"])

    def series(self, t: ArrayLike) -> Complexes:
        """Return the sum of the terms at times t, of any shape."""
        times = finite_numbers(t, "t")
        out: Complexes = np.exp(1j * times[..., None] * self.frequency) @ self.amplitude
        return out


def frequency_analysis(
    t: ArrayLike,
    series: ArrayLike,
    terms: int = 10,
    *,
    band: tuple[float, float] | None = None,
    window: int = 1,
) -> Frequencies:
    """Decompose a series into its largest terms, A exp(i w t).

    t : (n,) evenly spaced, increasing or decreasing
    series : (n,) complex, such as e exp(i pomega) or sin(i/2) exp(i Omega); of a real one each oscillation gives two
        terms, w and -w
    terms : how many; fewer are returned if the series has no more above round-off
    band : (lowest, highest) frequency of a term [rad per unit of time]; by default all that the spacing resolves,
        |w| <= pi / spacing. A faster oscillation, of which the samples are too sparse, appears at another frequency
    window : the power p of the weight (1 + cos(2 pi (t - middle) / T))^p. A larger one separates strong terms from weak
        ones far from them better, and neighbours worse

    Of a series that is a sum of as many terms, at least four times 2 pi / T apart, frequencies and amplitudes are right
    to round-off. What else is in a series displaces them: compare the frequencies of its two halves.
    Raises InputError for times that are not evenly spaced, fewer samples than four for each term, shapes that do not
    fit, values that are not finite, and a band that is empty or beyond what the spacing resolves.
    """
    times, z = _checked(t, series)
    n, count = len(z), whole_number(terms, "terms")
    power = whole_number(window, "window", least=0, most=10)
    if 4 * count > n:
        raise InputError(f"{n} samples cannot tell {count} terms; expected at least {4 * count}, or fewer terms.")
    spacing = (times[-1] - times[0]) / (n - 1)
    middle = 0.5 * (times[0] + times[-1])
    # In units of the spacing, and from the middle: there frequency and phase of a term are corrected independently.
    tau: Floats = np.arange(n, dtype=np.float64) - 0.5 * (n - 1)
    weight: Floats = (1.0 + np.cos(2.0 * np.pi * tau / n)) ** power
    scale = 2.0 ** (np.frexp(np.abs(z).max())[1] - 1.0)  # squares of tiny and huge numbers are not lost
    fit = _Fit(tau, weight / weight.sum(), z / scale, _in_steps(band, spacing))
    for _ in range(count):
        if not fit.add():
            break
    fit.turn()
    frequency = fit.frequency / spacing
    amplitude = scale * fit.amplitude * np.exp(-1j * frequency * middle)
    order = np.argsort(-np.abs(amplitude))
    return Frequencies(
        frequency[order], amplitude[order], 2.0 * np.pi / (n * abs(spacing)), fit.left() / (fit.size or 1.0)
    )


class _Fit:
    """Terms found so far, in units of the spacing, and the series without them."""

    def __init__(self, tau: Floats, weight: Floats, z: Complexes, band: tuple[float, float]) -> None:
        self.tau, self.weight, self.z, self.band = tau, weight, z, band
        self.frequency, self.amplitude = np.zeros(0), np.zeros(0, dtype=np.complex128)
        self.residual = z
        self.size = self.left()
        self._columns = self._rows = self._products = np.zeros((0, 0), dtype=np.complex128)

    def left(self) -> float:
        """The weighted root mean square of the residual."""
        return float(np.sqrt(self.weight @ np.abs(self.residual) ** 2))

    def add(self) -> bool:
        """Find the next term and correct all; return False, and find none, where only round-off is left or no place."""
        found = self._strongest()
        if found is None or self.left() <= len(self.tau) ** 0.5 * np.finfo(float).eps * self.size:
            return False
        self.frequency = np.append(self.frequency, found)
        self._solve()
        self._correct()
        return True

    def turn(self) -> None:
        """Bring frequencies that were followed beyond half a turn in a sample back to what the spacing resolves."""
        beyond: NDArray[np.bool_] = np.abs(self.frequency) > np.pi
        if beyond.any():
            self.frequency = np.where(beyond, _turned(self.frequency), self.frequency)
            self._solve()

    def _strongest(self) -> float | None:
        """Return the frequency of the largest projection of the residual, in the band and apart from other terms."""
        n = len(self.tau)
        length = FINER * n
        spectrum = np.abs(np.fft.fft(self.weight * self.residual, length))
        grid = 2.0 * np.pi * np.fft.fftfreq(length)
        allowed = (grid >= self.band[0]) & (grid <= self.band[1])
        if not allowed.any():  # a band between two places of the grid has room for one term
            return None if len(self.frequency) else 0.5 * (self.band[0] + self.band[1])
        for other in self.frequency:
            allowed &= np.abs(_turned(grid - other)) > APART * 2.0 * np.pi / n
        if not allowed.any():
            return None
        best = int(np.argmax(np.where(allowed, spectrum, -1.0)))
        left, right = spectrum[best - 1], spectrum[(best + 1) % length]
        bend = left - 2.0 * spectrum[best] + right
        shift = 0.5 * (left - right) / bend if max(left, right) < spectrum[best] else 0.0
        return float(np.clip(grid[best] + shift * 2.0 * np.pi / length, *self.band))

    def _solve(self) -> None:
        """The amplitudes of all terms, by weighted least squares."""
        self._columns = np.exp(1j * np.outer(self.tau, self.frequency))
        self._rows = self._columns.conj().T * self.weight
        self._products = self._rows @ self._columns
        self.amplitude = self._best(self._rows @ self.z)
        self.residual = self.z - self._columns @ self.amplitude

    def _best(self, right: Complexes) -> Complexes:
        return np.asarray(np.linalg.lstsq(self._products, right, rcond=1e-12)[0], dtype=np.complex128)

    def _correct(self) -> None:
        """Frequencies of all terms, and the amplitudes with them, by Gauss-Newton steps until they settle."""
        unit = 2.0 * np.pi / len(self.tau)
        for _ in range(MOST_CORRECTIONS):
            moved: Floats = np.clip(self._step(), -0.25 * unit, 0.25 * unit)
            if not self._moved(moved) or np.abs(moved).max() <= SETTLED * unit:
                return

    def _moved(self, step: Floats) -> bool:
        """Move the frequencies by a step, or a part of it; leave them, and return False, where neither helps."""
        start, left = self.frequency, self.left()
        for part in PARTS:
            self.frequency = np.clip(start + part * step, *self.band)
            self._solve()
            if self.left() < left and not self._too_near():
                return True
        self.frequency = start
        self._solve()
        return False

    def _too_near(self) -> bool:
        apart = np.abs(_turned(self.frequency[:, None] - self.frequency))
        np.fill_diagonal(apart, np.inf)
        return bool(apart.min() < APART * 2.0 * np.pi / len(self.tau))

    def _step(self) -> Floats:
        """The corrections of the frequencies, real, with amplitudes that change beside them."""
        size = np.abs(self.amplitude)
        if not size.all():
            return np.zeros(len(size))
        # Per unit of amplitude, so that weak terms are not lost beside strong ones; and without the part for which a
        # change of amplitudes makes up.
        turning = 1j * self.tau[:, None] * self._columns * (self.amplitude / size)
        turning -= self._columns @ self._best(self._rows @ turning)
        back = turning.conj().T * self.weight
        step = np.linalg.lstsq((back @ turning).real, (back @ self.residual).real, rcond=1e-12)[0]
        return np.asarray(step / size, dtype=np.float64)


def _turned(angle: Floats) -> Floats:
    """Return angles in (-pi, pi]."""
    return np.asarray(np.pi - (np.pi - angle) % (2.0 * np.pi), dtype=np.float64)


def _checked(t: ArrayLike, series: ArrayLike) -> tuple[Floats, Complexes]:
    if has_unit(t):
        unit = getattr(t, "unit", "")
        raise InputError(f"t is in {unit}; expected plain numbers, such as run.t.to_value(u.yr).")
    times = finite_numbers(t, "t")
    try:
        z = np.asarray(series)
    except ValueError:
        raise InputError(f"series is {shown(series)}; expected complex or real numbers, (n,).") from None
    if isinstance(series, np.ma.MaskedArray):
        raise InputError("series is a masked array; expected numbers for all times: leave the others out of both.")
    if z.dtype.kind not in "fiuc":
        raise InputError(f"series holds {z.dtype.name}; expected complex or real numbers.")
    z = z.astype(np.complex128)
    if times.ndim != 1 or z.shape != times.shape or len(times) < 4:
        raise InputError(
            f"t and series have shapes {times.shape} and {z.shape}; expected (n,) each, with at least 4 samples."
        )
    if not np.isfinite(z).all():
        raise InputError(f"series holds {z[~np.isfinite(z)][0]}; expected finite values.")
    even = np.linspace(times[0], times[-1], len(times))
    spacing = (times[-1] - times[0]) / (len(times) - 1)
    off = np.abs(times - even)
    if spacing == 0.0 or off.max() > UNEVEN * abs(spacing):
        row = int(off.argmax())
        raise InputError(
            f"t is not evenly spaced: t[{row}] is {times[row]:g}, and {even[row]:g} would be; expected equal "
            "intervals, such as samples=1001 of a run."
        )
    return times, z


def _in_steps(band: tuple[float, float] | None, spacing: float) -> tuple[float, float]:
    """Return the band in radians per sample."""
    if band is None:
        return -np.inf, np.inf  # a term beside half a turn in a sample is found from the other side of it, too
    limits = finite_numbers(band, "band")
    if limits.shape != (2,) or not limits[0] < limits[1]:
        raise InputError(f"band is {band!r}; expected (lowest, highest) frequency.")
    fastest = np.pi / abs(spacing)
    if np.abs(limits).max() > fastest:
        raise InputError(
            f"band is {band!r}, but samples {abs(spacing):g} apart resolve frequencies up to {fastest:g}; expected a "
            "band within that, or a shorter spacing."
        )
    low, high = sorted(limits * spacing)
    return float(low), float(high)
