"""From a run to an SPK file: the run is integrated again, sampled within its steps, and fitted to a tolerance.

Each body has one segment with records of equal length, as long as the tolerance allows. Records of all bodies start
with a length of eight steps and are halved until the fastest body meets the tolerance; then the records of each body
are joined in pairs.
"""

from __future__ import annotations

import math
import os
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from astropy import units as u
from numpy.polynomial import chebyshev as series
from numpy.typing import NDArray

from orbits._version import __version__
from orbits.body_names import chosen, index_of
from orbits.checks import checked_flag, positive_number
from orbits.errors import ArchiveError, EpochError, InputError, shown
from orbits.marching.clocks.clock import Clock
from orbits.marching.clocks.step_times import Places
from orbits.marching.clocks.variable_steps import ChangingSteps
from orbits.spk import bodies as naif
from orbits.spk import chebyshev, daf
from orbits.time_grid import dynamical_time

if TYPE_CHECKING:
    from orbits.protocols import Run

Array = NDArray[np.float64]

J2000 = 2451545
DAY = 86400

# Records begin at multiples of this fraction of a second, which are exact in binary for millions of years.
PARTS = 1024
SHORTEST = 0.125
"""The shortest record, in seconds; runs that need shorter ones are refused."""

JOINABLE = 32
"""The number of records is a multiple of this, so that neighbours can be joined five times."""

LONGEST_IN_STEPS, SHORTEST_IN_STEPS = 8.0, 0.25

PART_OF_DYNAMICAL_TIME = 0.2
"""About the length of the steps of the adaptive clock."""

MOST_BYTES = 2**32
BLOCK = 4096


@dataclass(frozen=True)
class SpkFile:
    """A description of the written file.

    path : of the file
    ids : NAIF's number of each body;  centre : NAIF's number of the centre of all segments
    record_days : length of a body's records, days
    error_km : bound on the distance of a body's polynomials from the run, km: the truncation error of the fit, or the
        largest distance from the run's own samples if that is larger
    """

    path: Path
    ids: Mapping[str, int]
    centre: int
    record_days: Mapping[str, float] = field(repr=False)
    error_km: Mapping[str, float] = field(repr=False)


def write(
    run: Run,
    path: str | PathLike[str],
    *,
    tolerance_km: float = 1e-3,
    ids: Mapping[str, int] | None = None,
    bodies: Sequence[str] | None = None,
    centre: str | None = None,
    overwrite: bool = False,
) -> SpkFile:
    """Write a run as an SPK file of type 2 (Chebyshev polynomials of the positions), and return its accuracy.

    run : with physical units and an epoch; it is integrated again from its initial state, to be sampled within steps
    path : of the file, usually `.bsp`;  overwrite : whether an existing file may be replaced
    tolerance_km : largest distance of the polynomials from the run; velocities are their derivatives. Readers count
        time in seconds past J2000 as one float64, which resolves 60 ns in this century and 4 us after a thousand years
    ids : NAIF numbers by name, for bodies without a number or to replace the usual ones. DE440's bodies have 10 (Sun),
        1 to 9 (a planet with its moons; Mercury and Venus are also found as 199 and 299), 399 and 301 (Earth and Moon,
        each relative to the centre, not to their barycentre as in JPL's files, so astropy does not find them by name).
        Numbered asteroids of the catalogue have 2000000 + number, or 20000000 + number from 1,000,000 on, where
        they have no more mass than an asteroid
    bodies : the bodies to write, by default all
    centre : the body of the run that positions are relative to. By default the origin of the system, labelled 0, the
        Solar System barycentre. With `System.solar_system` the origin is the barycentre of the selected bodies, which
        is not DE440's barycentre unless the system was made with origin="ssb"

    Axes are those of the system, labelled J2000 (ICRF).
    Raises InputError (or a subclass) for bodies without a number, a run without units, epoch or a second sample, a run
    that is not smooth to the tolerance or does not agree with its method, and a path that cannot be written;
    ArchiveError for a file that exists; IntegrationError as `propagate` does.
    Source: NAIF, "SPK Required Reading".
    """
    target = _target(path, checked_flag(overwrite, "overwrite"))
    about = None if centre is None else index_of(centre, run.names)
    centre = None if about is None else run.names[about]
    names = tuple(np.array(run.names, dtype=object)[chosen(run.names, bodies)])
    places = [run.names.index(name) for name in names if name != centre]
    if not places:
        raise InputError(f"bodies = {list(names)!r} leaves nothing to write; expected a body besides the centre.")
    _check(run, tolerance_km)
    wanted = [run.names[i] for i in places] + ([] if centre is None else [centre])
    _refuse_retired(run, wanted)
    numbers = naif.numbers(wanted, naif.checked_ids(run.names, ids), naif.light_ones(run.system))
    centre_number = naif.SOLAR_SYSTEM_BARYCENTRE if centre is None else numbers.pop(centre)

    grid, coefficients, lost = _fitted(run, places, about, tolerance_km)
    segments, records, errors = [], {}, {}
    for k, i in enumerate(places):
        name = run.names[i]
        own, error, length = _joined(coefficients[:, :, [k]], float(lost[k]), grid.length, tolerance_km)
        seen = _largest_distance_to_samples(run, i, about, own, grid._replace(length=length))
        if seen > 2.0 * tolerance_km:
            raise InputError(
                f"the samples of {name!r} are up to {seen:.3g} km from the motion that {run.made_by}, "
                "computes; expected an unchanged run of orbits.propagate. Propagate it again."
            )
        errors[name], records[name] = max(error, seen), length / DAY
        segments.append(
            daf.Segment(name, numbers[name], centre_number, grid.start, grid.end, grid.initial, length, own)
        )
    segments += _planets_at_their_barycentres(numbers, grid)
    _store(target, _comments(run, numbers, centre, tolerance_km), segments)
    return SpkFile(target, numbers, centre_number, records, errors)


class _Grid(NamedTuple):
    """Records of a run in TDB seconds past J2000: start of the first, length, number, and the interval covered.

    offset : time of the first record since the run's epoch, in its unit of time;  seconds : seconds in that unit
    """

    initial: float
    length: float
    records: int
    start: float
    end: float
    offset: Fraction
    seconds: Fraction

    @classmethod
    def of(cls, run: Run, length: float) -> _Grid:
        """The grid of records no longer than `length` seconds."""
        epoch = run.system.epoch
        assert epoch is not None  # checked before
        seconds = Fraction(float(run.system.units.time.to(u.s)))
        zero = (Fraction(epoch.jd1) - J2000 + Fraction(epoch.jd2)) * DAY
        start, end = (zero + Fraction(float(t)) * seconds for t in (run.times.min(), run.times.max()))
        initial = Fraction(math.floor(start * PARTS), PARTS)
        count = JOINABLE * math.ceil((end - initial) / Fraction(length) / JOINABLE)
        exact = Fraction(math.ceil((end - initial) / count * PARTS), PARTS)
        return cls(float(initial), float(exact), count, float(start), float(end), (initial - zero) / seconds, seconds)


class _TooLongError(Exception):
    """Records whose truncation error, the argument, exceeds the tolerance."""


def _check(run: Run, tolerance_km: float) -> None:
    if not run.system.units.is_physical:
        raise InputError("a run in pure numbers has no kilometres and seconds; expected a system with physical units.")
    if run.system.epoch is None:
        raise EpochError("the system has no epoch, but an SPK file needs dates; use System(..., epoch=...).")
    if len(run) < 2 or not np.ptp(run.times):
        raise InputError(f"{run!r} covers no interval of time; expected a run with at least two samples.")
    positive_number(tolerance_km, "tolerance_km")


def _refuse_retired(run: Run, wanted: Sequence[str]) -> None:
    """Refuse bodies that were retired before the last sample: a segment covers the whole run."""
    end = np.abs(run.times).max()
    lost = [p for p in run.retired if p.name in wanted and abs(p.time.value) < end]
    if lost:
        raise InputError(
            f"{lost[0].name!r} was retired at t = {lost[0].time:.10g}, before the end of the run"
            f"{f', and {len(lost) - 1} more' * (len(lost) > 1)}; a segment covers the whole run. Write the others, "
            "bodies=[...], or the samples before, run[:k].to_spk(...)."
        )


def _fitted(
    run: Run, places: Sequence[int], about: int | None, tolerance_km: float
) -> tuple[_Grid, Array, Array]:
    """Return the grid of records that meet the tolerance, coefficients (records, degree + 1, bodies, 3), and errors."""
    typical, shortest = abs(run.step), SHORTEST_IN_STEPS
    if run.clock.changes:
        shortest = 0.0
        typical = min(PART_OF_DYNAMICAL_TIME * dynamical_time(run.system), float(np.ptp(run.times)))
    step = typical * float(run.system.units.time.to(u.s))
    length, reached = LONGEST_IN_STEPS * step, math.inf
    while length >= shortest * step:
        grid = _Grid.of(run, length)
        needed = 8 * 3 * (chebyshev.DEGREE + 1) * grid.records * len(places)
        if needed > MOST_BYTES:
            raise InputError(
                f"{grid.records} records of {len(places)} bodies need {needed / 2**30:.1f} GiB; at most "
                f"{MOST_BYTES / 2**30:.0f} are possible. Write fewer bodies at a time (bodies=[...])."
            )
        if grid.length < SHORTEST:
            break
        try:
            return grid, *_coefficients(run, places, about, grid, tolerance_km)
        except _TooLongError as loss:
            reached = loss.args[0]
            length = min(length, grid.length) / 2.0
    raise InputError(
        f"{run.made_by} is not smooth to {tolerance_km:g} km: because of its own error in a step, records of "
        f"{2 * length / DAY:.3g} d deviate by {reached:.2g} km. Use a larger tolerance_km, or propagate with a smaller "
        f"{run.clock.refined_by} or a method of higher order."
    )


def _coefficients(
    run: Run, places: Sequence[int], about: int | None, grid: _Grid, tolerance_km: float
) -> tuple[Array, Array]:
    """March through all records. Raises _TooLongError as soon as a block of them misses the tolerance."""
    units = run.system.units
    km, kms = float(units.length.to(u.km)), float(units.speed.to(u.km / u.s))
    march = run._begun()
    coefficients = np.empty((grid.records, chebyshev.DEGREE + 1, len(places), 3))
    lost = np.zeros(len(places))
    order = range(grid.records) if run.clock.direction > 0 else range(grid.records - 1, -1, -1)
    try:
        for at in range(0, grid.records, JOINABLE):
            block = order[at : at + JOINABLE]
            q, v = np.empty((2, len(block), chebyshev.NODES, len(run.names), 3))
            visits = _visits(grid, block, run.clock)
            for some, *states in march.along(visits.places):
                where = visits.rows[some], visits.nodes[some]
                q[where], v[where] = states
            if about is not None:
                q, v = q - q[:, :, [about]], v - v[:, :, [about]]
            fit, loss = chebyshev.fitted(q[:, :, places] * km, v[:, :, places] * kms, grid.length / 2.0)
            if loss.max() > tolerance_km:
                raise _TooLongError(float(loss.max()))
            coefficients[np.array(block)] = fit
            lost = np.maximum(lost, loss.max(axis=0))
    finally:
        march.close()
    return coefficients, lost


class _Visits(NamedTuple):
    """Nodes of records in the order in which a march comes by: rows of a block and nodes, (m,), and their places."""

    rows: NDArray[np.intp]
    nodes: NDArray[np.intp]
    places: Places


def _visits(grid: _Grid, block: Sequence[int], clock: Clock) -> _Visits:
    """Return the nodes of a block of records.

    The end of a record that is reached first is computed exactly; the remainder is at most as long as a record.
    """
    forwards, begun = clock.direction > 0, []
    for record in block:
        end = grid.offset + (record + (not forwards)) * Fraction(grid.length) / grid.seconds
        begun.append(clock.place(end))
    length = float(Fraction(grid.length) / grid.seconds)
    parts = length * ((1.0 + chebyshev.nodes()) / 2.0 if forwards else -(1.0 - chebyshev.nodes()) / 2.0)
    more = clock.places((np.array([place.rest for place in begun])[:, None] + parts).ravel())
    steps = more.steps + np.repeat([place.steps for place in begun], len(parts))
    rows, nodes = np.divmod(np.lexsort((more.rests * clock.direction, steps)), len(parts))
    order = rows * len(parts) + nodes
    return _Visits(rows, nodes, Places(steps[order], more.rests[order]))


def _joined(coefficients: Array, lost: float, length: float, tolerance_km: float) -> tuple[Array, float, float]:
    """Return a body's coefficients (records, degree + 1, 3), error and length, with records as long as possible."""
    while len(coefficients) % 2 == 0:
        longer, more = chebyshev.merged(coefficients)
        if lost + float(more.max()) > tolerance_km:
            break
        coefficients, lost, length = longer, lost + float(more.max()), 2.0 * length
    return coefficients[:, :, 0], lost, length


def _largest_distance_to_samples(run: Run, body: int, about: int | None, fit: Array, grid: _Grid) -> float:
    """Return the largest distance of the polynomials from the run's samples, km."""
    km = float(run.system.units.length.to(u.km))
    farthest = 0.0
    for first in range(0, len(run), BLOCK):
        block = slice(first, first + BLOCK)
        q = run.q.value[block, body]
        if about is not None:
            q = q - run.q.value[block, about]
        seconds = (run.times[block] - float(grid.offset)) * float(grid.seconds)
        record = np.clip((seconds / grid.length).astype(np.int64), 0, len(fit) - 1)
        s = 2.0 * (seconds - record * grid.length) / grid.length - 1.0
        there = series.chebval(s[None], np.moveaxis(fit[record], 0, -1), tensor=False)
        farthest = max(farthest, float(np.linalg.norm(there.T - q * km, axis=1).max()))
    return farthest


def _planets_at_their_barycentres(numbers: Mapping[str, int], grid: _Grid) -> list[daf.Segment]:
    """Return segments that place Mercury and Venus at their barycentres, if these were written."""
    length = grid.length * grid.records
    return [
        daf.Segment(
            name, planet, number, grid.start, grid.end, grid.initial, length, np.zeros((1, chebyshev.DEGREE + 1, 3))
        )
        for name, number in numbers.items()
        if (planet := naif.WITHOUT_MOONS.get(number)) is not None and planet not in numbers.values()
    ]


def _comments(run: Run, numbers: Mapping[str, int], centre: str | None, tolerance_km: float) -> list[str]:
    steps = f"dt = {abs(run.step)!r} {run.system.units.time}"
    if isinstance(run.clock, ChangingSteps):
        steps = run.clock.describe(run.integrator)
    lines = [
        f"Made by orbits {__version__}: {run.integrator.label}, {steps}.",
        f"Epoch of the initial state: {run.system.epoch} TDB.",
        f"Polynomials within {tolerance_km:g} km of the run. Axes: ICRF (J2000 in SPICE).",
    ]
    if centre is None:
        lines += [
            "The centre, labelled 0, is the origin of the system that was propagated. For",
            "System.solar_system() that is the barycentre of the selected bodies, which",
            "differs from DE440's by kilometres, as asteroids, for instance, are left out;",
            "with origin='ssb' it is DE440's at the epoch.",
        ]
    return [*lines, "", *(f"{number:>12} {name}" for name, number in numbers.items())]


def _target(path: str | PathLike[str], overwrite: bool) -> Path:
    try:
        target = Path(path)
    except TypeError as error:
        raise ArchiveError(f"{shown(path)} is not a path; expected something like 'run.bsp'.") from error
    if target.exists() and not overwrite:
        raise ArchiveError(f"{target} exists; choose another name, or replace it with overwrite=True.")
    return target


def _store(target: Path, comments: Sequence[str], segments: Sequence[daf.Segment]) -> None:
    """Write beside the target, then move the complete file there, so that no incomplete file is ever read."""
    try:
        handle, name = tempfile.mkstemp(prefix=f".{target.name}.", dir=target.parent)
        try:
            with os.fdopen(handle, "w+b") as file:
                daf.write(file, f"orbits {__version__}", comments, segments)
            os.replace(name, target)
        except BaseException:
            os.unlink(name)
            raise
    except OSError as error:
        raise InputError(f"cannot write {str(target)!r}: {error.strerror}. Choose another path.") from error
