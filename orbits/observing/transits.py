"""Transits of a planet as seen from infinity: their table from the events of a run, and their times from states."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from astropy import units as u
from numpy.typing import ArrayLike, NDArray

from orbits.body_names import index_of
from orbits.elements.kepler_flow import kepler_flow
from orbits.errors import InputError
from orbits.observing.line_of_sight import LineOfSight, arrived, line_of_sight
from orbits.units import written

if TYPE_CHECKING:
    from astropy.table import QTable

    from orbits.protocols import Run

Array = NDArray[np.float64]
Whole = NDArray[np.int64]

MID = "transit, closest"

MOST_STEPS, LONGEST_STEP, ENOUGH = 60, 0.02, 1e-12
"""Of Newton's method: the most steps, the longest one and the last one, relative to the period of the orbit."""

CIRCULAR = 1e-12
"""The eccentricity up to which the direction to the pericentre is rounding, which may even lie across the orbit."""

NEAR_WHOLE, MOST_PARTS = 0.05, 10
"""How far from whole numbers of periods the intervals of transits may be, and the most periods in the shortest one."""

SAME_LINE = 1e-12
"""How far apart the components of one line of sight are at most."""


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


def orbits_between(time: Array, period: float) -> tuple[Whole, float]:
    """Return how many orbits lie between successive transits, (m - 1,), and their mean period.

    period : about that; the shortest intervals are counted first, and tell it better for longer ones
    """
    gaps = np.diff(time)
    count, days, orbits = np.zeros(len(gaps), dtype=np.int64), 0.0, 0
    for k in np.argsort(gaps):
        count[k] = np.rint(gaps[k] / period)
        days, orbits = days + gaps[k], orbits + int(count[k])
        period = days / orbits if orbits else period
    return count, period


def counted_transits(time: Array, planet: str) -> Whole:
    """Return the numbers of transits of one planet, from 0, by the longest period of which all intervals are about
    whole numbers. Raises InputError if there is none.
    """
    gaps = np.diff(time)
    if not len(gaps):
        return np.zeros(len(time), dtype=np.int64)
    if not gaps.min() > 0.0:
        raise InputError(f"two transits of {planet!r} have the same time; expected each transit once.")
    for parts in range(1, MOST_PARTS + 1):
        count, period = orbits_between(time, gaps.min() / parts)
        if np.abs(gaps / period - count).max() < NEAR_WHOLE:
            return np.concatenate([[0], np.cumsum(count)])
    raise InputError(
        f"the intervals of the transits of {planet!r} are not whole numbers of one period; give their numbers: "
        "orbits.TransitTimes(..., number=...)."
    )


def mean_anomaly(e: Any, f: Any) -> Any:
    """Return the mean anomaly for a true anomaly, radians, on an ellipse."""
    E = 2.0 * np.arctan2(np.sqrt(1.0 - e) * np.sin(0.5 * f), np.sqrt(1.0 + e) * np.cos(0.5 * f))
    return E - e * np.sin(E)


def transits_of(run: Run, body: str, along: Any, star: str | None) -> QTable:
    """Return the table of the transits of a body; see `Trajectory.transits`."""
    from astropy.table import QTable

    planet = index_of(body, run.names, "body")
    line, found, apparent = _the_event(run, run.names[planet], along, star)
    table, towards = found.to_table(), np.array(line)
    other = index_of(str(table["other"][0]), run.names, "star")
    table.sort("time")
    units, t, kind = run.system.units, table["time"].value, np.asarray(table["kind"])
    mid = t[kind == MID]
    first, second, third, fourth = (_beside(mid, t[kind == f"transit, contact {k}"], k > 2) for k in range(1, 5))
    between = orbits_between(mid, float(np.median(np.diff(mid))))[0] if len(mid) > 1 else np.zeros(0)
    number = np.concatenate([[0], np.cumsum(between)]).astype(np.int64)[: len(mid)]
    linear = Linear.of(number, mid)
    out = QTable({"number": number, "time": u.Quantity(mid, units.time)})
    if run.system.epoch is not None:
        out.add_column(written((run.system.epoch + out["time"]).copy(format="iso")), index=1, name="date")
    out["duration"] = u.Quantity(fourth - first, units.time)
    out["full_duration"] = u.Quantity(third - second, units.time)
    out["impact_parameter"] = _impact_parameters(run, mid, planet, other, towards, apparent)
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


def _the_event(run: Run, body: str, along: Any, star: str | None) -> tuple[LineOfSight, Any, bool]:
    """Return the line of sight of the event of the transits of a body, what it found, and whether that is apparent.

    Raises InputError unless there is one.
    """
    wanted = None if along is None else line_of_sight(along, "along")
    other = None if star is None else run.names[index_of(star, run.names, "star")]
    events: Any = run.events
    seen = [
        (line_of_sight(observer, "observer"), events, apparent)
        for observer, apparent, events in events.by_event()
        if isinstance(observer, list | tuple) and events[0].kind.startswith("transit")
        if events[0].body == body and other in (None, events[0].other)
    ]
    chosen = [one for one in seen if wanted is None or np.allclose(one[0], wanted, rtol=0.0, atol=SAME_LINE)]
    if len(chosen) == 1:
        return chosen[0]
    told = "; ".join(f"of {one[0].other}, {line}, apparent={apparent}" for line, one, apparent in chosen or seen)
    if chosen:
        said = f"{body!r} has those of {len(chosen)} events, {told}; choose by star=... or along=..., or seek one."
    elif seen:
        said = f"those of {body!r} were sought along another line of sight: {told}."
    else:
        said = (
            f"{body!r} has none at the times of these samples. If they were sought, none is there; if not, seek them: "
            f"propagate with events=orbits.events.Transit({body!r}, ..., observer=orbits.along(...))."
        )
    raise InputError(f"run.transits: {said}")


def _impact_parameters(run: Run, times: Array, planet: int, star: int, towards: Array, apparent: bool) -> Array:
    """Return the least distances on the sky in radii of the star."""
    if not len(times):
        return np.zeros(0)
    states = run.at(times)
    q, v = (x.value[:, [planet, star]] for x in (states.q, states.v))
    if apparent:
        q = arrived(q, v, towards, 1.0 / run.system.units.speed_of_light)
    radii = states.system.radii.value if states.changes is None else states.changes.over(times).radii
    return np.asarray(np.linalg.norm(np.cross(q[:, 0] - q[:, 1], towards), axis=1) / radii[..., star])


def mid_transits(gm: Array, q: Array, v: Array, towards: Array) -> Array:
    """Return how long after given states a planet and its star are closest on the sky, (m,), before or after by half a
    period at most; NaN if no such transit is found, as of orbits that are not ellipses.

    gm : (m,), of both; q, v : (m, 3), of the planet relative to the star

    Both move on the osculating orbit in between.
    """
    with np.errstate(all="ignore"):
        later, period = _nearest_conjunction(gm, q, v, towards)
        known = np.isfinite(later)
        later, step, slope = np.where(known, later, 0.0), np.zeros(len(q)), np.ones(len(q))
        way, speed = kepler_flow(q, v, gm, later)
        for _ in range(MOST_STEPS):
            depth, rate = way @ towards, speed @ towards
            pull = -gm / np.linalg.norm(way, axis=1) ** 3
            size = (way * way).sum(axis=1) - depth**2
            slope = (speed * speed).sum(axis=1) - rate**2 + pull * size
            step = -((way * speed).sum(axis=1) - depth * rate) / np.abs(slope)  # down to where they are closest
            step = np.where(known, np.clip(step, -LONGEST_STEP * period, LONGEST_STEP * period), 0.0)
            later = later + step
            known &= np.isfinite(step)
            later = np.where(known, later, 0.0)
            way, speed = kepler_flow(q, v, gm, later)
            if (np.abs(step) < ENOUGH * period)[known].all():
                break
        known &= (np.abs(step) < ENOUGH * period) & (slope > 0.0) & (way @ towards > 0.0)
        return np.where(known & (np.abs(later) <= 0.5 * period), later, np.nan)


def _nearest_conjunction(gm: Array, q: Array, v: Array, towards: Array) -> tuple[Array, Array]:
    """Return how long after given states omega + f is 90 degrees, (m,), half a period at most, and the period; NaN on
    orbits that are not ellipses.
    """
    r, pole = np.linalg.norm(q, axis=1), np.cross(q, v)
    pole /= np.linalg.norm(pole, axis=1)[:, None]
    a = 1.0 / (2.0 / r - (v * v).sum(axis=1) / gm)
    pericentre = np.cross(v, np.cross(q, v)) / gm[:, None] - q / r[:, None]
    e = np.linalg.norm(pericentre, axis=1)
    pericentre = np.where(e[:, None] > CIRCULAR, pericentre, q)
    f, at = (
        np.arctan2((np.cross(pericentre, x) * pole).sum(axis=1), (pericentre * x).sum(axis=1))
        for x in (q, np.broadcast_to(towards, q.shape))
    )
    period = 2.0 * np.pi * np.sqrt(a**3 / gm)
    return ((mean_anomaly(e, at) - mean_anomaly(e, f)) / (2.0 * np.pi) + 0.5) % 1.0 * period - 0.5 * period, period
