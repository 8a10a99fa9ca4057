"""`orbits ephemeris`: its options as the arguments of `run.ephemeris`, and its records for JSON."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from orbits.errors import InputError, shown
from orbits.scenario.typed import number_or_text
from orbits.time_grid import times_since
from orbits.time_grid.reading import is_date

if TYPE_CHECKING:
    from astropy.time import Time

    from orbits.observing import Ephemeris
    from orbits.trajectory import Trajectory

MOST_TIMES = 100_000

ROUNDING = 1e-6
"""Of a step, by which rounded dates may be short of whole steps: the last one counts."""


def typed_observer(text: str) -> Any:
    """Return "-70.7,-30.2,2663" (degrees east, degrees north, metres) as an `EarthLocation`, any other text unchanged.

    Raises InputError for several numbers that are no place; one alone is the code of an observatory.
    """
    parts = text.split(",")
    if len(parts) == 1:
        return text
    try:
        numbers = [float(part) for part in parts]
    except ValueError:
        return text
    outside = any(abs(x) > most for x, most in zip(numbers, (360.0, 90.0), strict=False))
    if len(numbers) not in (2, 3) or not all(map(math.isfinite, numbers)) or outside:
        raise InputError(
            f"--observer = {shown(text)}; expected a name, or a place on the Earth: degrees east, degrees north and "
            "metres above the ellipsoid, such as -70.7366,-30.2407,2663."
        )
    from astropy import units as u
    from astropy.coordinates import EarthLocation

    return EarthLocation.from_geodetic(numbers[0] * u.deg, numbers[1] * u.deg, (numbers[2:] or [0.0])[0] * u.m)


def typed_times(run: Trajectory, start: str | None, stop: str | None, step: str | None, *, utc: bool) -> Any:
    """Return the times that are meant by --from, --to and --step, or None for those of the samples.

    utc : whether dates are typed, and shown, in UTC
    Raises InputError for an incomplete span, a step that is not above 0, and too many times.
    """
    if run.system.epoch is None:
        return None  # refused by run.ephemeris
    if start is None:
        if stop is not None or step is not None:
            raise InputError("--to and --step need --from; without these three the times are those of the samples.")
        return run.epochs.utc if utc else None
    first = _since(run, start, "--from", utc=utc)
    if stop is None:
        if step is not None:
            raise InputError("--step needs --to; --from alone is a single time.")
        times = np.array([first])
    else:
        if step is None:
            raise InputError("--to needs --step, such as --step '1 d'.")
        last = _since(run, stop, "--to", utc=utc)
        length = float(times_since(run.system, number_or_text(step), "--step"))
        if not (math.isfinite(length) and length > 0.0):
            raise InputError(f"--step = {shown(step)}; expected a time above 0, such as '1 d' or '10 min'.")
        if not last >= first:
            raise InputError(f"--to = {shown(stop)} is before --from = {shown(start)}.")
        return _grid(run, first, last, length, utc=utc)
    return _utc(run, times) if utc else times


def _grid(run: Trajectory, first: float, last: float, length: float, *, utc: bool) -> Any:
    """Return times since the epoch; of UTC dates, by the clock on the wall, in which no day has more than 86,400 s.

    Raises InputError for too many.
    """
    span = last - first
    if utc:
        begin, end = _on_the_wall(_utc(run, np.array([first, last])))
        seconds = float((1.0 * run.system.units.time).to_value("s"))
        span = float((end - begin) / np.timedelta64(1, "ns")) * 1e-9 / seconds
    count = math.floor(span / length + ROUNDING) + 1
    if count > MOST_TIMES:
        raise InputError(f"{count:,} times from --from to --to; at most {MOST_TIMES:,} are possible.")
    since = length * np.arange(count)
    if not utc:
        return np.minimum(first + since, last)
    from astropy.time import Time

    dates = begin + np.rint(since * seconds * 1e9).astype("timedelta64[ns]")
    times = times_since(run.system, Time(dates, format="datetime64", scale="utc"), "--from")
    return _utc(run, np.clip(times, first, last))


def _on_the_wall(dates: Time) -> NDArray[np.datetime64]:
    """Return dates of UTC to a microsecond; those in a leap second are a second later."""
    of = dates.ymdhms
    days = np.array([f"{y:04d}-{m:02d}-{d:02d}" for y, m, d in zip(of.year, of.month, of.day, strict=True)])
    micros = np.rint(1e6 * (3600.0 * of.hour + 60.0 * of.minute + of.second))
    return np.asarray(days.astype("datetime64[ns]") + micros.astype("timedelta64[us]"))


def _utc(run: Trajectory, since: Any) -> Any:
    """Return the dates, UTC, of times since the epoch."""
    from astropy import units as u

    return (run.system.epoch + u.Quantity(since, run.system.units.time)).utc


def _since(run: Trajectory, text: str, option: str, *, utc: bool) -> float:
    value: Any = number_or_text(text)
    if utc and isinstance(value, str) and is_date(value):
        from astropy.time import Time

        value = Time(value, scale="utc")
    return float(times_since(run.system, value, option))


def record(table: Ephemeris) -> dict[str, Any]:
    """Return an ephemeris for JSON: the observer, notes and units, and a row for each time and body."""
    rows = table.to_table()
    dates, units = rows["date"].isot, {name: str(x.unit) for name, x in table.values.items()}
    figures = {name: rows[name].value for name in ("time", *table.values)}
    return {
        "observer": table.head.observer,
        "method": table.head.made_by,
        "notes": list(table.head.notes),
        "time_scale": "utc" if table.head.utc else "tdb",
        "units": {"time": str(table.t.unit), **units},
        "rows": [
            {"date": str(dates[k]), "body": str(rows["body"][k])}
            | {name: float(x[k]) if math.isfinite(x[k]) else None for name, x in figures.items()}
            for k in range(len(rows))
        ],
    }
