"""Error bars of a run: how far each body may be from the exact solution of its initial values, at each sample."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from astropy import units as u
from numpy.typing import NDArray

from orbits.body_names import chosen, index_of
from orbits.export import MOST_ROWS, Tabled, headed
from orbits.results.approach import said, unit_of_errors
from orbits.system.presenting import attributes, span

if TYPE_CHECKING:
    from astropy.table import QTable

    from orbits.system import System

Array = NDArray[np.float64]

SAFETY = 2.0
"""The bar as a multiple of the root of the sum of the squares of both differences. Round-off is a random walk, and the
difference of two of them may be small by chance: of walks in one dimension, twice that root contains 97 of 100."""

LOST = 0.5
"""The bar, as a fraction of the distance from the body that attracts most, at which the phase of an orbit is lost."""

FEWEST_FITTED, LEAST_RISE = 5, 3.0
"""Samples and rise of the bar that are needed to say how it grows."""

STEEP = 4.0
"""The power of time above which errors may be growing exponentially: regular orbits reach 2, rarely more."""

LARGER = 4.0
"""The steps, not round-off, limit a run if the first companion differs this much more than the second."""


@dataclass(frozen=True)
class Growth:
    """How the error bar of a body grows, from a fit over all samples before the phase is lost.

    power : of time; round-off on a regular orbit gives 1.5, the error of a symplectic step 1, a drift of energy 2
    tenfold : for exponential growth, the time in which the bar grows tenfold; else None
    """

    power: float
    tenfold: u.Quantity | None = None

    @property
    def exponential(self) -> bool:
        """Whether the bar grows exponentially, as on a chaotic orbit."""
        return self.tenfold is not None

    def __str__(self) -> str:
        if self.tenfold is None:
            return f"t^{self.power:.1f}"
        return f"tenfold in {self.tenfold:.2g}"


@dataclass(frozen=True, repr=False)
class BodyErrorBars:
    """The error bars of one body: t, position and velocity of shape (samples,), with units.

    growth : how the position's bar grows, or None if there are too few samples to tell, or it does not
    lost : the time at which the phase of the orbit is lost, or None
    """

    name: str
    t: u.Quantity
    position: u.Quantity
    velocity: u.Quantity
    growth: Growth | None
    lost: u.Quantity | None

    def __repr__(self) -> str:
        end = "" if not len(self.t) else f", {said(self.position[-1].to(_error_unit(self.position.unit)))} at the end"
        lost = "" if self.lost is None else f", phase lost from t = {self.lost:.6g} on"
        return f"BodyErrorBars({self.name}, {len(self.t)} samples, {span(self.t)}{end}{lost})"


class ErrorBars(Tabled):
    """The error bars of a run, in the order of its samples and bodies.

    system : at the start; times (n,), q and v (n, bodies, 3) : the samples of the run, as floats
    by_steps, by_rounding : (n, bodies, 6), how far the companions are from the run: the one with finer steps,
        extrapolated to steps of no length, and the one with other rounding errors; NaN where one could not follow
    made_by : method and steps of the run, in words
    notes : what kept a companion from following the run, if anything did

    bars.position and bars.velocity, (n, bodies) with units, are lengths of vectors: the distance that a body may be
    from where it should be. Infinite bars mean that nothing is known; NaN that the particle was retired.
    bars["Mercury"] has those of one body. They are meant to contain the error, not to be close to it: see `SAFETY`.
    """

    def __init__(
        self,
        system: System,
        times: Array,
        q: Array,
        v: Array,
        by_steps: Array,
        by_rounding: Array,
        *,
        made_by: str,
        notes: Sequence[str] = (),
        origin: str = "",
    ) -> None:
        self.system, self.times, self.made_by, self.notes = system, times, made_by, tuple(notes)
        self._q, self._v, self._by_steps, self._by_rounding = q, v, by_steps, by_rounding
        self._origin = origin

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the bodies, in the order of the second axis."""
        return self.system.names

    @property
    def t(self) -> u.Quantity:
        """Times since the epoch, (n,)."""
        return u.Quantity(self.times, self.system.units.time)

    @property
    def position(self) -> u.Quantity:
        """The error bars of the positions, (n, bodies), in the system's unit of length."""
        return u.Quantity(self._bars[0], self.system.units.length)

    @property
    def velocity(self) -> u.Quantity:
        """The error bars of the velocities, (n, bodies), in the system's unit of speed."""
        return u.Quantity(self._bars[1], self.system.units.speed)

    @property
    def by_steps(self) -> u.Quantity:
        """The position error that the length of the steps causes, round-off included, (n, bodies): the distance of the
        first companion, without the factor of safety.
        """
        return u.Quantity(_lengths(self._by_steps[..., :3]), self.system.units.length)

    @property
    def by_rounding(self) -> u.Quantity:
        """The position error that round-off causes, (n, bodies): the distance of the second companion, without the
        factor of safety. Where the steps limit the run, it has up to some ten-thousandths of what these cause.
        """
        return u.Quantity(_lengths(self._by_rounding[..., :3]), self.system.units.length)

    @property
    def growth(self) -> tuple[Growth | None, ...]:
        """How the bar of each body's position grows; None if there are too few samples to tell, or no growth."""
        return tuple(self._growth)

    @property
    def lost(self) -> u.Quantity:
        """The time from which on the phase of each orbit is lost, (bodies,); NaN if it is not.

        It is lost where the bar exceeds half the distance from the body that attracts most: from there on, the run
        shows what kind of orbit it is, but not where on it the body is.
        """
        return u.Quantity(self._lost, self.system.units.time)

    def relative_to(self, name: str) -> ErrorBars:
        """Return the error bars of positions and velocities relative to a body, such as the Sun or, for a moon, its
        planet. Raises UnknownNameError.
        """
        i = index_of(name, self.names, "body")

        def relative(x: Array) -> Array:
            return x - x[:, i : i + 1]

        return ErrorBars(
            self.system,
            self.times,
            self._q,
            self._v,
            relative(self._by_steps),
            relative(self._by_rounding),
            made_by=self.made_by,
            notes=self.notes,
            origin=self.names[i],
        )

    def __getitem__(self, name: str) -> BodyErrorBars:
        """Return the error bars of a body. Raises UnknownNameError."""
        i = index_of(name, self.names, "body")
        lost = None if math.isnan(self._lost[i]) else self.lost[i]
        return BodyErrorBars(
            self.names[i], self.t, self.position[:, i], self.velocity[:, i], self._growth[i], lost
        )

    def _ipython_key_completions_(self) -> list[str]:
        return list(self.names)

    def __len__(self) -> int:
        """Return the number of samples."""
        return len(self.times)

    def to_table(self, bodies: Sequence[str] | None = None) -> QTable:
        """Return an astropy QTable with a row for each sample and body: time, body, position, velocity.

        bodies : names, all by default. Unknown names raise UnknownNameError.
        """
        from astropy.table import QTable

        pick = np.arange(len(self.names))[chosen(self.names, bodies)]
        columns = {
            "time": np.repeat(self.t, len(pick)),
            "body": np.tile(np.array(self.names, dtype=str)[pick], len(self)),
            "position": self.position[:, pick].ravel(),
            "velocity": self.velocity[:, pick].ravel(),
        }
        return QTable(columns, meta={**attributes(self.system), "made_by": self.made_by})

    @cached_property
    def _bars(self) -> tuple[Array, Array, Array]:
        """The bars of positions and velocities, (n, bodies), and the times at which phases are lost, (bodies,).

        They are the differences times `SAFETY`, but at least the rounding of the samples; once the phase is lost, they
        do not shrink.
        """
        bars = []
        for part, samples in ((slice(0, 3), self._q), (slice(3, 6), self._v)):
            ways = [_lengths(x[..., part]) for x in (self._by_steps, self._by_rounding)]
            known = np.asarray(samples, dtype=np.float64)
            rounding = _lengths(0.5 * np.spacing(np.abs(known)))
            rounding[self.times == 0.0] = 0.0  # the start of the run is exact
            bar = np.maximum(SAFETY * np.hypot(*ways), rounding)
            bar[np.isnan(bar)] = np.inf
            bar[np.isnan(known).any(axis=-1)] = np.nan
            bars.append(bar)
        if self._origin:  # a body is exactly at its own place
            i = self.names.index(self._origin)
            bars[0][:, i] = bars[1][:, i] = 0.0
        lost = np.full(len(self.names), np.nan)
        order = np.argsort(np.abs(self.times), kind="stable")
        far = bars[0] >= LOST * self._distances
        for i in np.flatnonzero(far.any(axis=0)).tolist():
            after = order[int(np.argmax(far[order, i])) :]
            lost[i] = self.times[after[0]]
            for bar in bars:
                bar[after, i] = np.where(np.isnan(bar[after, i]), np.nan, np.fmax.accumulate(bar[after, i]))
        return bars[0], bars[1], lost

    @property
    def _lost(self) -> Array:
        return self._bars[2]

    @cached_property
    def _distances(self) -> Array:
        """The distance of each body from the one that attracts it most, (n, bodies); infinite if none does."""
        gm = self.system.values.gm
        massive = np.flatnonzero(gm > 0.0)
        out = np.full((len(self.times), len(gm)), np.inf)
        for k in range(len(self.times)):
            apart = np.linalg.norm(self._q[k][:, None] - self._q[k][None, massive], axis=-1)
            apart[massive, np.arange(len(massive))] = np.inf
            with np.errstate(divide="ignore"):
                nearest = np.argmax(gm[massive] / apart**2, axis=1)
            out[k] = np.take_along_axis(apart, nearest[:, None], axis=1)[:, 0]
        return out

    @cached_property
    def _growth(self) -> list[Growth | None]:
        bars = self._bars[0]
        return [self._fitted(bars[:, i], self._lost[i]) for i in range(len(self.names))]

    def _fitted(self, bar: Array, lost: float) -> Growth | None:
        """Return the growth of a bar by least squares in log t and in t, whichever fits better."""
        time = np.abs(self.times)
        use = (time > 0.0) & np.isfinite(bar) & (bar > 0.0)
        if not math.isnan(lost):
            use &= time < abs(lost)
        if np.count_nonzero(use) < FEWEST_FITTED or bar[use].max() < LEAST_RISE * bar[use].min():
            return None
        log, fits = np.log(bar[use]), []
        for x in (np.log(time[use]), time[use]):
            if np.ptp(x) == 0.0:
                return None
            slope, start = np.polyfit(x, log, 1)
            fits.append((float(np.square(start + slope * x - log).sum()), float(slope)))
        (by_power, power), (by_rate, rate) = fits
        if power <= 0.0:
            return None
        if by_rate < by_power and power > STEEP:
            return Growth(power, u.Quantity(math.log(10.0) / rate, self.system.units.time))
        return Growth(power)

    def _mostly(self, i: int) -> str:
        """Return what limits the accuracy of a body at the end, in a word."""
        steps, rounding = self.by_steps[-1, i], self.by_rounding[-1, i]
        if not (np.isfinite(steps) and np.isfinite(rounding)):
            return "unknown"
        return "steps" if steps > LARGER * rounding else "round-off"

    def _caption(self) -> str:
        bodies = f"{len(self.names):,} bod{'y' if len(self.names) == 1 else 'ies'}"
        if not len(self):
            return f"error bars of {bodies}, {self.made_by}: no samples yet"
        about = f" relative to {self._origin}" if self._origin else ""
        notes = "".join(f"; {note}" for note in self.notes)
        return f"error bars of {bodies}{about} at t = {self.t[-1]:g}, {self.made_by}{notes}"

    def _shown(self) -> tuple[list[str], list[list[str]], int]:
        if not len(self):
            return [], [], 0
        length, speed = unit_of_errors(self.system), self.system.units.speed
        speed = u.m / u.s if speed.is_equivalent(u.m / u.s) else speed
        position, velocity = self.position[-1].to_value(length), self.velocity[-1].to_value(speed)
        head = ["body", headed("position", length), headed("velocity", speed), "mostly", "grows"]
        rows = []
        for i, name in enumerate(self.names[:MOST_ROWS]):
            grows = "" if self._growth[i] is None else str(self._growth[i])
            if not math.isnan(self._lost[i]):
                grows = f"phase lost from t = {self.lost[i]:.6g} on"
            rows.append([name, f"{position[i]:.2g}", f"{velocity[i]:.2g}", self._mostly(i), grows])
        return head, rows, len(self.names) - len(rows)


def _lengths(x: Array) -> Array:
    """Return the lengths of vectors, (..., 3)."""
    return np.asarray(np.linalg.norm(x, axis=-1))


def _error_unit(length: u.UnitBase) -> u.UnitBase:
    return u.km if length.is_equivalent(u.km) else length
