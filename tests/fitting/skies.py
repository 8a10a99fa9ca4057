"""Observations of a known orbit, made by `run.ephemeris`, which shares neither derivatives nor arcs with a fit.

And how far a fit is from a state.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from astropy import units as u
from astropy.time import Time
from numpy.typing import NDArray

import orbits
from orbits.fitting.result import Fit

EPOCH = "2010-06-01"
STATIONS = ("568", "703", "W84", "500")


def state(system: orbits.System, name: str = "433") -> np.ndarray:
    place = system.names.index(name)
    return np.concatenate([system.values.q[place], system.values.v[place]])


def mahalanobis(fit: Fit, truth: np.ndarray) -> float:
    """Return chi-squared of a fitted state, by its covariance."""
    found = fit.covariance()
    scale = found.sigma
    off = (found.values - truth) / scale
    return float(off @ np.linalg.solve(found.correlation, off))


@cache
def start() -> orbits.System:
    """Return a system in DE440 with a body of the inner belt."""
    system = orbits.System.in_ephemeris(epoch=EPOCH)
    orbit = {"a": 2.3 * u.au, "e": 0.2, "inc": 9 * u.deg, "Omega": 40 * u.deg, "omega": 100 * u.deg, "M": 20 * u.deg}
    return system.add("433", primary="Sun", **orbit)


@cache
def places(years: float, count: int) -> tuple[tuple[str, float, float, float], ...]:
    """Return station, Julian date (UTC), right ascension and declination, degrees, of observations on both sides of the
    epoch, without errors.
    """
    rng = np.random.default_rng(7)
    out = []
    for sign in (-1, 1):
        run = orbits.propagate(start(), duration=sign * (years / 2 + 0.1) * u.yr, samples=2, dense=True)
        days = np.sort(rng.uniform(0.0, years / 2 * 365.25, count // 2))
        jd = np.round(2455348.5 + sign * days, 5)
        for k, station in enumerate(STATIONS):
            some = jd[k :: len(STATIONS)]
            seen = run.ephemeris("433", observer=station, times=Time(some, format="jd", scale="utc"))
            rows = zip(some, seen.ra.to_value(u.deg), seen.dec.to_value(u.deg), strict=True)
            out += [(station, float(t), float(ra), float(dec)) for t, ra, dec in rows]
    return tuple(sorted(out, key=lambda row: row[1]))


def observed(errors: NDArray[np.float64], years: float = 10.0, sigma: float = 0.5) -> orbits.Observations:
    """Return observations with these errors in right ascension times cos(dec) and declination, (m, 2), arcseconds."""
    lines = ["permID|stn|obsTime|ra|dec|rmsRA|rmsDec|astCat|mode"]
    for (station, jd, ra, dec), (east, north) in zip(places(years, len(errors)), errors, strict=True):
        time = Time(jd, format="jd", scale="utc", precision=4).isot
        ra, dec = ra + east / 3600 / np.cos(np.deg2rad(dec)), dec + north / 3600
        lines.append(f"433|{station}|{time}Z|{ra % 360:.12f}|{dec:.12f}|{sigma}|{sigma}|Gaia2|CCD")
    return orbits.Observations.parse("\n".join(lines))
