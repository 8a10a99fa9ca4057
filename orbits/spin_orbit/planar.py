"""The planar spin–orbit problem of one moon or planet, and its march for any number of starts."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from orbits.checks import finite_number, finite_numbers, is_whole, number_not_below_zero, whole_number
from orbits.errors import InputError, SingularityError, StepWarning, shown
from orbits.finding import Finding
from orbits.kernels.rotation.planar_spins import TOGETHER, march_spins, march_tangents
from orbits.marching.legs.leg import available_threads
from orbits.marching.stepping.pool import Pool
from orbits.spin_orbit.libration import Libration, locked
from orbits.spin_orbit.orbit_table import SCHEMES, error_of_tides, means_of_tides, orbit_table
from orbits.spin_orbit.path import SpinPath

Array = NDArray[np.float64]

WANTED = 1e-9
"""The error of a revolution that steps are chosen for, radians."""

TOO_MUCH = 1e-6
"""The error of a revolution that is warned of, radians."""

WANTED_OF_TIDES, TOO_MUCH_OF_TIDES = 1e-7, 1e-3
"""The same for the mean of the tides, as a part of itself."""

LADDER = (4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256, 384, 512, 768, 1024, 2048, 4096, 8192)
"""Steps in a revolution that are tried."""

TRIED_RATES = (-1.0, 4.0)
"""The rates for which steps are chosen."""

AT_ONCE = 20_000
"""Revolutions between two looks at an interrupt."""


@dataclass(frozen=True, kw_only=True)
class PlanarSpins:
    """Spins of a moon, or a planet, about the axis of its Kepler orbit, which they do not change.

        theta'' = - (alpha^2 / 2) (a/r)^3 sin 2(theta - f) - tides (a/r)^6 (theta' - f')

    theta : the direction of the longest axis; f : the true anomaly; ' : by the mean anomaly, so that a rate is in units
    of the mean motion n

    eccentricity : of the orbit, 0 <= e < 1
    alpha : its square is 3 (B - A)/C; or
    asphericity : (B - A)/C, at most 1
    tides : K = 3 k2 n dt (M/m) (R/a)^3 / (C/(m R^2)), with a constant time lag dt; 0 without
    order : of the kicks and drifts: 2, 4, 6 or 8
    steps : in a revolution; by default so many that a revolution of a spin of rates from -1 to 4 errs by 1e-9 rad

    The map of a step is that of a discrete Lagrangian: areas of the section are kept, with tides they shrink as they
    should. The steps are equal in eccentric anomaly.

    Raises InputError for an eccentricity outside [0, 1), alpha < 0, more or less than one of alpha and asphericity,
    shapes that no body has, tides < 0.

    Source: Goldreich & Peale (1966), AJ 71, 425; Wisdom, Peale & Mignard (1984), Icarus 58, 137; Mignard (1979), Moon
    and Planets 20, 301, for the tides.
    """

    eccentricity: float
    alpha: float | None = None
    asphericity: float | None = None
    tides: float = 0.0
    order: int = 6
    steps: int | None = None

    def __post_init__(self) -> None:
        e = finite_number(self.eccentricity, "eccentricity")
        if not 0.0 <= e < 1.0:
            raise InputError(f"eccentricity is {shown(self.eccentricity)}; expected that of an ellipse, 0 <= e < 1.")
        if self.alpha is None and self.asphericity is None:
            raise InputError("the moon has no figure: expected alpha, or asphericity = (B - A)/C = alpha^2/3.")
        if self.alpha is None:
            asphericity = number_not_below_zero(self.asphericity, "asphericity")
        else:
            asphericity = number_not_below_zero(self.alpha, "alpha") ** 2 / 3.0
            if self.asphericity is not None and not math.isclose(
                finite_number(self.asphericity, "asphericity"), asphericity, rel_tol=1e-12
            ):
                raise InputError(
                    f"alpha = {self.alpha:g} is (B - A)/C = {asphericity:g}, but asphericity is "
                    f"{self.asphericity:g}; give one of them."
                )
        if not asphericity <= 1.0 + 1e-12:
            raise InputError(f"(B - A)/C = alpha^2/3 is {asphericity:.6g}; no body has more than 1.")
        if not is_whole(self.order) or self.order not in (2, *SCHEMES):
            raise InputError(f"order is {shown(self.order)}; expected 2, 4, 6 or 8.")
        alpha = math.sqrt(3.0 * asphericity) if self.alpha is None else float(self.alpha)
        put = object.__setattr__
        put(self, "eccentricity", e)
        put(self, "alpha", alpha)
        put(self, "asphericity", asphericity)
        put(self, "tides", number_not_below_zero(self.tides, "tides"))
        if self.steps is not None:
            put(self, "steps", whole_number(self.steps, "steps", most=10**7))

    @cached_property
    def steps_per_revolution(self) -> int:
        """The steps in a revolution: as given, or chosen."""
        if self.steps is not None:
            return self.steps
        angles, rates = np.meshgrid(np.linspace(0.0, np.pi, 8, endpoint=False), np.linspace(*TRIED_RATES, 16))
        starts = self._starts(angles, rates)
        for steps in LADDER:
            if self._error(starts, steps) < WANTED and self._error_of_tides(steps) < WANTED_OF_TIDES:
                return steps
        raise InputError(
            f"eccentricity = {self.eccentricity!r}: even {LADDER[-1]} steps in a revolution err by more than "
            f"{WANTED:g} rad; give the number of steps."
        )

    @property
    def title(self) -> str:
        """The problem in a line."""
        tides = f", tides K = {self.tides:g}" if self.tides else ""
        return f"e = {self.eccentricity:g}, α = {self.alpha:.4g}{tides}"

    @property
    def equilibrium_rate(self) -> float:
        """The rate at which tides without a figure leave a spin, the pseudo-synchronous one (Hut 1981, eq. 42)."""
        drag, drive = means_of_tides(self.eccentricity)
        return drive / drag

    def section(
        self, theta: ArrayLike, rate: ArrayLike, revolutions: int, *, every: int = 1, threads: int | None = None
    ) -> SpinPath:
        """March spins, and return them at each pericentre.

        theta : directions of the long axis at the first pericentre, radians or quantities; rate : theta'/n there. They
            are broadcast against each other: one start for each pair
        revolutions : how many; the result has 1 + revolutions / every columns, of which the first is the start
        threads : how many; by default one on each processor. The result does not depend on it

        Raises InputError for starts and counts that are none. Warns with `StepWarning` if the steps are too long for
        the spins.
        """
        revolutions = whole_number(revolutions, "revolutions", most=10**12)
        if revolutions % whole_number(every, "every"):
            raise InputError(f"every = {every} does not divide the {revolutions} revolutions.")
        starts = self._starts(theta, rate)
        return self._marched(starts, revolutions, every, self._table(self.steps_per_revolution, 1), threads)

    def march(
        self, theta: ArrayLike, rate: ArrayLike, revolutions: int, *, samples: int = 64, threads: int | None = None
    ) -> SpinPath:
        """March spins as `section` does, and return them at `samples` places of each revolution.

        These are equally spaced in eccentric anomaly, which the steps lead through: if `samples` does not divide the
        number of steps in a revolution, it is rounded up.
        """
        revolutions = whole_number(revolutions, "revolutions", most=10**9)
        samples = whole_number(samples, "samples", most=10**6)
        starts = self._starts(theta, rate)
        table = self._table(-(-self.steps_per_revolution // samples) * samples, samples)
        return self._marched(starts, revolutions, 1, table, threads)

    def lyapunov(
        self, theta: ArrayLike, rate: ArrayLike, revolutions: int = 1000, *, threads: int | None = None
    ) -> Array:
        """Return the largest Lyapunov exponents of starts over some revolutions, (starts,), per revolution.

        That of a regular spin falls as ln(revolutions) / revolutions; that of a chaotic one stays where it is.
        """
        revolutions = whole_number(revolutions, "revolutions", most=10**9)
        starts = self._starts(theta, rate)
        self._look_at_steps(starts)
        state, count = _padded(starts), starts.shape[1]
        tangents, growth = np.zeros((2, state.shape[1])), np.zeros(state.shape[1])
        tangents[0] = 0.6 / np.pi
        tangents[1] = 0.8
        table, total = self._table(self.steps_per_revolution, 1), np.zeros(state.shape[1])

        def work(first: int) -> None:
            for part in _parts(revolutions, 1):
                for half in (first, first + TOGETHER // 2):
                    march_tangents(table, state, tangents, half, part, growth)
                total[first : first + TOGETHER] += growth[first : first + TOGETHER]

        _in_threads(work, count, threads)
        self._check_finite(total[:count], starts)
        return total[:count] / revolutions

    def libration(self, resonance: float = 1.0, *, theta: float = 0.0, rate: float | None = None) -> Libration:
        """Return the spin that is locked in a resonance, repeats after each revolution, and the librations about it.

        resonance : turns in a revolution of the orbit, a multiple of 1/2: 1 for the Moon, 3/2 for Mercury
        theta, rate : near which it is at the pericentre; without a rate it is sought at a theta of 0 or pi/2, and if
            there are several, the stable one whose rate is nearest to the resonance is taken

        Raises InputError for other resonances, and if there is none nearby.
        """
        return locked(self, resonance, theta, rate)

    def tangents(self, theta: float, rate: float, samples: int) -> tuple[Array, Array]:
        """Return the spin at `samples` places of a revolution, (samples, 2), and the derivatives of its angle and rate
        by those at the start, (samples, 2, 2). Raises InputError for more than one start, and counts that are none.
        """
        samples = whole_number(samples, "samples", most=10**6)
        theta, rate = finite_number(theta, "theta"), finite_number(rate, "rate")
        table = self._table(-(-self.steps_per_revolution // samples) * samples, samples)
        state = _padded(self._starts(np.full(2, theta), rate))
        tangents, growth = np.zeros((2, state.shape[1])), np.zeros(state.shape[1])
        tangents[0, 0] = tangents[1, 1] = 1.0
        grown = np.zeros(2)
        spins, matrices = np.empty((samples, 2)), np.empty((samples, 2, 2))
        for k in range(samples):
            march_tangents(table[k : k + 1], state, tangents, 0, 1, growth)
            grown += growth[:2]
            spins[k] = np.pi * (state[0, 0] + state[1, 0]), state[2, 0]
            matrices[k] = tangents[:, :2] * np.exp(grown)
        matrices[:, 0, 1] *= np.pi  # angles in half turns become radians
        matrices[:, 1, 0] /= np.pi
        return spins, matrices

    def error_of_a_revolution(self, theta: ArrayLike, rate: ArrayLike) -> float:
        """Return the largest error of the angles of starts after a revolution, radians: that of half the steps."""
        return self._error(self._starts(theta, rate), self.steps_per_revolution)

    def _error(self, starts: Array, steps: int) -> float:
        """Return the largest difference of angles after a revolution from those of twice as many steps."""
        found = []
        for count in (steps, 2 * steps):
            table = self._table(count, 1)
            state = _padded(starts)
            theta, rate = (np.empty((starts.shape[1], 1)) for _ in range(2))
            for first in range(0, starts.shape[1], TOGETHER):
                march_spins(table, state, first, 1, 1, 0, theta, rate)
            found.append(theta)
        return float(np.abs(found[1] - found[0]).max())

    def _error_of_tides(self, steps: int) -> float:
        """Return by what part of itself the mean torque of tides is wrong; 0 without tides."""
        return error_of_tides(self.eccentricity, self.order, steps) if self.tides else 0.0

    def _table(self, steps: int, intervals: int) -> Array:
        assert self.alpha is not None
        return orbit_table(self.eccentricity, self.alpha, self.tides, self.order, steps, intervals)

    def _starts(self, theta: Any, rate: Any) -> Array:
        """Return angles and rates, (2, starts)."""
        if getattr(theta, "unit", None) is not None:
            from orbits.units import DIMENSIONLESS

            theta = DIMENSIONLESS.angle_value(theta, "theta")
        angles, rates = finite_numbers(theta, "theta"), finite_numbers(rate, "rate")
        try:
            angles, rates = np.broadcast_arrays(angles, rates)
        except ValueError:
            raise InputError(
                f"theta has the shape {angles.shape}, and rate {rates.shape}; expected one start for each pair."
            ) from None
        if angles.size == 0:
            raise InputError("theta and rate are empty; expected one start or more.")
        return np.stack([angles.ravel(), rates.ravel()])

    def _marched(self, starts: Array, revolutions: int, every: int, table: Array, threads: int | None) -> SpinPath:
        self._look_at_steps(starts)
        count, intervals = starts.shape[1], len(table)
        columns = revolutions // every * intervals
        try:
            theta, rate = (np.empty((count, 1 + columns)) for _ in range(2))
        except MemoryError:
            size = 16.0 * count * (1 + columns) / 1e9
            raise InputError(
                f"{count:,} spins at {columns:,} places take {size:,.0f} GB; march fewer at a time, or look at them "
                "less often: every=..."
            ) from None
        theta[:, 0], rate[:, 0] = starts
        state = _padded(starts)

        def work(first: int) -> None:
            column = 1
            for part in _parts(revolutions, every):
                march_spins(table, state, first, part, every, column, theta, rate)
                column += part // every * intervals

        _in_threads(work, count, threads)
        self._check_finite(rate[:, -1], starts)
        anomaly = np.asarray(2.0 * np.pi * every / intervals * np.arange(1 + columns), dtype=np.float64)
        return SpinPath(self, anomaly, theta, rate)

    def _look_at_steps(self, starts: Array) -> None:
        """Warn if the steps are too long for the fastest starts."""
        steps = self.steps_per_revolution
        if self.steps is None and np.all((starts[1] >= TRIED_RATES[0]) & (starts[1] <= TRIED_RATES[1])):
            return
        wrong = self._error_of_tides(steps)
        if wrong > TOO_MUCH_OF_TIDES:
            Finding(
                f"{steps} steps in a revolution are too long for the tides, whose mean is wrong by {wrong:.1g} of "
                "itself; take more, or leave steps out.",
                StepWarning,
            ).warn()
        order = np.argsort(starts[1])
        ends = starts[:, np.unique(np.concatenate([order[: TOGETHER // 2], order[-TOGETHER // 2 :]]))]
        error = self._error(ends, steps)
        if not error < TOO_MUCH:
            enough = next((n for n in LADDER if n > steps and self._error(ends, n) < 0.1 * TOO_MUCH), None)
            more = f"steps={enough}" if enough else f"more than {LADDER[-1]} steps, or a higher order,"
            Finding(
                f"{steps} steps in a revolution are too long for some of these spins, of rates from "
                f"{starts[1].min():g} to {starts[1].max():g}: their angles err by {error:.1g} rad in one revolution. "
                f"With {more} they err by less than {TOO_MUCH:g}.",
                StepWarning,
            ).warn()

    def _check_finite(self, values: Array, starts: Array) -> None:
        bad = np.flatnonzero(~np.isfinite(values))
        if len(bad):
            theta, rate = starts[:, bad[0]]
            raise SingularityError(
                f"the spin with theta = {theta:g}, rate = {rate:g} became infinite; take more steps in a revolution "
                f"than {self.steps_per_revolution}."
            )


def _padded(starts: Array) -> Array:
    """Return the state for the kernels, (3, padded): half turns, whole ones, rates; the last start fills the lanes."""
    count = starts.shape[1]
    state = np.empty((3, -(-count // TOGETHER) * TOGETHER))
    half = starts[0] / np.pi
    state[1, :count] = np.rint(half)
    state[0, :count] = half - state[1, :count]
    state[2, :count] = starts[1]
    state[:, count:] = state[:, count - 1 : count]
    return state


def _parts(revolutions: int, every: int) -> Iterator[int]:
    """Yield parts of a march, multiples of `every`."""
    most = max(1, AT_ONCE // every) * every
    for _ in range(revolutions // most):
        yield most
    if revolutions % most:
        yield revolutions % most


def _in_threads(work: Any, count: int, threads: int | None) -> None:
    firsts = range(0, count, TOGETHER)
    most = available_threads() if threads is None else whole_number(threads, "threads, if given,")
    if most == 1 or len(firsts) == 1:
        for first in firsts:
            work(first)
        return
    pool = Pool(min(most, len(firsts)))
    try:
        for _ in pool.map(work, firsts):
            pass
    finally:  # also after an interrupt: those that have begun are waited for
        pool.shutdown(cancel_futures=True)
