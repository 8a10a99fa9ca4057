"""Uncertainties of optical astrometry by station, catalogue, date and technique.

Source: Vereš, Farnocchia, Chesley & Chamberlin (2017), Icarus 296, 139, by way of programs that use its rules: the
paper was not at hand. Techniques and catalogues that came later are taken like their nearest relatives. The rules
for the program codes of one observer at the stations 309 and G83 are left out.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from orbits.astrometry.record import Record

Array = NDArray[np.float64]

BY_DATE = {"703": (2456658.5, 1.0, 0.8), "691": (2452640.5, 0.6, 0.5), "644": (2452883.5, 0.6, 0.4)}
"""Stations whose uncertainty changed: the Julian date, and arcseconds before and after it."""

BY_STATION = {
    **dict.fromkeys(("704", "C51", "J75"), 1.0),
    **dict.fromkeys(("645", "673", "H01"), 0.3),
    **dict.fromkeys(("E10", "F65", "J04", "K91", "K92", "K93", "Q63", "Q64", "V37", "W85", "W86", "W87"), 0.4),
    **dict.fromkeys(("689", "950", "W84", "G96"), 0.5),
    **dict.fromkeys(("G45", "608"), 0.6),
    **dict.fromkeys(("D29", "E12"), 0.75),
    "F51": 0.2,
    "699": 0.8,
}
GAIA = ("Gaia1", "Gaia2", "Gaia3", "Gaia3E")
"""The paper knows the first; the later ones are taken like it."""

BY_CATALOGUE = {
    "568": {"USNOB1": 0.5, "USNOB2": 0.5, "PPMXL": 0.2, **dict.fromkeys(GAIA, 0.1)},
    "Y28": {"PPMXL": 0.3, **dict.fromkeys(GAIA, 0.3)},
    **{station: dict.fromkeys(GAIA, 0.1) for station in ("T09", "T12", "T14")},
}
PHOTOGRAPHIC = ("", "P", "A", "N", "Z", "PHO", "NOR", "UNK")
"""Modes of plates. In ADES, UNK stands for what has no letter in 80 columns: plates, as a rule."""

BY_MODE = {
    **dict.fromkeys(("E", "OCC", "H"), 0.2),
    **dict.fromkeys(("T", "MER"), 0.5),
    **dict.fromkeys(("e", "ENC"), 0.75),
    **dict.fromkeys(("M", "MIC"), 2.0),
    **dict.fromkeys(("n", "VID"), 1.0),
}
FROM_SPACE = 1.5
"""Of telescopes in space that have none of their own in BY_STATION, as WISE (C51) has."""
PLATES_END, PLATES_OF_OLD = 2433282.5, 2411368.5
"""1950-01-01 and 1890-01-01."""

IN_A_NIGHT = 4
"""More observations than this of a body from one station in a night count as so many."""


def sigma(one: Record) -> float:
    """Return the uncertainty of an optical observation in each coordinate, arcseconds, as if it were alone."""
    jd = one.jd + one.part
    if one.place is not None and not one.place.turns:
        return BY_STATION.get(one.station, FROM_SPACE)
    if one.mode in BY_MODE:
        return BY_MODE[one.mode]
    if one.mode in PHOTOGRAPHIC and not (one.mode == "UNK" and one.catalogue in GAIA):
        return 10.0 if jd < PLATES_OF_OLD else 5.0 if jd < PLATES_END else 2.5
    if one.station in BY_DATE:
        change, before, after = BY_DATE[one.station]
        return before if jd < change else after
    if one.station in BY_CATALOGUE and one.catalogue in BY_CATALOGUE[one.station]:
        return BY_CATALOGUE[one.station][one.catalogue]
    return BY_STATION.get(one.station, 1.0 if one.catalogue else 1.5)


def sigmas(records: Sequence[Record]) -> Array:
    """Return the uncertainties in right ascension times cos(dec), and declination, (m, 2), arcseconds: those given, and
    otherwise by the rules. Those by the rules grow as sqrt(N / 4) with the number N > 4 of the same body from one
    station in a night.
    """
    nights = [(one.body, one.station, night(one)) for one in records]
    count = Counter(nights)
    out = np.empty((len(records), 2))
    for row, (one, group) in enumerate(zip(records, nights, strict=True)):
        usual = sigma(one) * np.sqrt(max(1.0, count[group] / IN_A_NIGHT))
        given = np.array([one.sigma_ra, one.sigma_dec])
        out[row] = np.where(np.isfinite(given), given, usual)
    return out


def night(one: Record) -> int:
    """Return the number of the night of an observation, which changes about noon at its station."""
    from orbits.observing.stations import stations

    station = stations().get(one.station)
    x = station.x if station is not None else None
    east = 0.0 if x is None or not x.any() else np.arctan2(x[1], x[0]) / (2.0 * np.pi)
    return int(np.floor(one.jd + one.part + east))
