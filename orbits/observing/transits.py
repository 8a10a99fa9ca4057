"""Transits of a planet as seen from infinity: their table from the events of a run, and their times from states."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from astropy import units as u
from numpy.typing import ArrayLike, NDArray

from orbits.body_names import index_of
from orbits.elements.kepler_flow import kepler_flow
from orbits.errors import InputError
from orbits.observing.line_of_sight import line_of_sight

if TYPE_CHECKING:
    from astropy.table import QTable

    from orbits.protocols import Run

Array = NDArray[np.float64]
Whole = NDArray[np.int64]

MID = "transit, closest"

MOST_STEPS = 20
ENOUGH = 1e-12
"""The last step of Newton's method, relative to the period of the orbit."""

ALONG_ANOTHER = 0.1
"""How far from where they are closest, in radii of the star, the line of sight is not that of an event; the time that
light takes is a few hundredths.
"""


class Linear(NamedTuple):
    """A linear ephemeris of transits: t0 + number * period; t0 and period have the unit of the times."""

    t0: float
    period: float

    @classmethod
    def of(cls, number: ArrayLike, time: Array, sigma: ArrayLike = 1.0) -> Linear:
        """Return the one with the least squares; of a single transit the period is NaN."""
        n = np.asarray(number, dtype=np.float64)
        if len(n) < 2:
            return cls(float(time[0]), np.nan) if len(n) else cls(np.nan, np.nan)
        weights = np.broadcast_to(1.0 / np.asarray(sigma, dtype=np.float64), n.shape)
        mean = np.average(n, weights=weights**2)
        period, t0 = np.polyfit(n - mean, time - time[0], 1, w=weights)
        return cls(float(time[0] + t0 - mean * period), float(period))

    def at(self, number: ArrayLike) -> Array:
        """Return the times of transits; of a single one its own."""
        n = np.asarray(number, dtype=np.float64)
        return np.asarray(self.t0 + np.where(n == 0.0, 0.0, n * self.period))


def counted_transits(time: Array) -> Whole:
    """Return the numbers of transits of one planet, from 0, by the median of their intervals."""
    gaps = np.diff(time)
    steps = np.rint(gaps / np.median(gaps)) if len(gaps) else gaps
    return np.concatenate([[0], np.cumsum(steps)]).astype(np.int64)


def transits_of(run: Run, body: str, along: Any, star: str | None) -> QTable:
    """Return the table of the transits of a body; see `Trajectory.transits`."""
    from astropy.table import QTable

    towards = np.array(line_of_sight(along, "along"))
    found: Any = run.events
    planet, table = index_of(body, run.names, "body"), found.to_table()
    rows = (table["body"] == run.names[planet]) & np.char.startswith(table["kind"].astype(str), "transit")
    stars = sorted(set(table["other"][rows])) if star is None else [star]
    if len(stars) != 1:
        behind = f"passes in front of {' and '.join(stars)}; name one, star={stars[0]!r}" if stars else "has none"
        raise InputError(
            f"run.transits: {body!r} {behind}. They are those of a run with "
            f"events=orbits.events.Transit({body!r}, ..., observer=orbits.along(...))."
        )
    other = index_of(stars[0], run.names, "star")
    table = table[rows & (table["other"] == run.names[other])]
    table.sort("time")
    units, t, kind = run.system.units, table["time"].value, np.asarray(table["kind"])
    mid = t[kind == MID]
    first, second, third, fourth = (_beside(mid, t[kind == f"transit, contact {k}"], k > 2) for k in range(1, 5))
    number = counted_transits(mid)
    linear = Linear.of(number, mid)
    out = QTable({"number": number, "time": u.Quantity(mid, units.time)})
    if run.system.epoch is not None:
        out.add_column((run.system.epoch + out["time"]).copy(format="iso"), index=1, name="date")
    out["duration"] = u.Quantity(fourth - first, units.time)
    out["full_duration"] = u.Quantity(third - second, units.time)
    out["impact_parameter"] = _impact_parameters(run, mid, planet, other, towards)
    out["o_minus_c"] = u.Quantity(mid - linear.at(number), units.time)
    out.meta = {"body": run.names[planet], "star": run.names[other], "line_of_sight": tuple(towards)}
    out.meta |= {"t0": u.Quantity(linear.t0, units.time), "period": u.Quantity(linear.period, units.time)}
    return out


def _beside(mid: Array, contacts: Array, later: bool) -> Array:
    """Return for each middle the contact next to it, later or earlier; NaN if that belongs to another transit."""
    around = np.concatenate([[-np.inf], contacts, [np.inf]])
    place = np.searchsorted(around, mid)
    near = around[place if later else place - 1]
    between = np.concatenate([[-np.inf], mid, [np.inf]])
    own = near < between[2:] if later else near > between[:-2]
    return np.where(own & np.isfinite(near), near, np.nan)


def _impact_parameters(run: Run, times: Array, planet: int, star: int, towards: Array) -> Array:
    """Return the least distances on the sky in radii of the star. Raises InputError for another line of sight."""
    if not len(times):
        return np.zeros(0)
    states = run.at(times)
    way, speed = (x.value[:, planet] - x.value[:, star] for x in (states.q, states.v))
    way, speed = (x - (x @ towards)[:, None] * towards for x in (way, speed))
    size = np.linalg.norm(way, axis=1)
    radius, other = states[0].radii.value[[star, planet]]  # an event has found them
    off = np.abs((way * speed).sum(axis=1)) > ALONG_ANOTHER * radius * np.linalg.norm(speed, axis=1)
    off |= size > radius + other
    if off.any():
        raise InputError(
            f"run.transits: the transits of {run.names[planet]!r} were sought along another line of sight; expected "
            "along=orbits.along(...) as in the event."
        )
    return np.asarray(size / radius)


def mid_transits(gm: Array, q: Array, v: Array, towards: Array) -> Array:
    """Return how long after given states a planet and its star are closest on the sky, (m,); NaN if it does not
    converge, or the planet is then behind the star.

    gm : (m,), of both; q, v : (m, 3), of the planet relative to the star, near a transit

    Both move on the osculating orbit in between.
    """
    later = np.zeros(len(q))
    way, speed = q, v
    with np.errstate(all="ignore"):
        for _ in range(MOST_STEPS):
            depth, rate = way @ towards, speed @ towards
            pull = -gm / np.linalg.norm(way, axis=1) ** 3
            size = (way * way).sum(axis=1) - depth**2
            slope = (speed * speed).sum(axis=1) - rate**2 + pull * size
            step = -((way * speed).sum(axis=1) - depth * rate) / slope
            later = later + step
            if not np.isfinite(later).all():
                break
            way, speed = kepler_flow(q, v, gm, later)
        period = 2.0 * np.pi * np.sqrt(np.linalg.norm(way, axis=1) ** 3 / gm)
    return np.where((np.abs(step) < ENOUGH * period) & (way @ towards > 0.0), later, np.nan)
