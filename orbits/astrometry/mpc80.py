"""The 80-column format of the Minor Planet Center: optical, from space, roving, and radar.

Source: https://www.minorplanetcenter.net/iau/info/OpticalObs.html, SatelliteObs.html, RovingObs.html, RadarObs.html
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from orbits.astrometry.record import (
    DELAY,
    DOPPLER,
    OPTICAL,
    Ignored,
    Place,
    Record,
    Unusable,
    microseconds,
    midnight,
    number,
    require_place,
)
from orbits.catalogue import packed
from orbits.ephemeris import AU_KM
from orbits.observing.stations import on_the_ellipsoid

WIDTH = 80
MODES = " PeCTMcEHNnABVSRD"
"""Column 15 of records that are used: kinds of detector, and the first lines of two."""

SECONDS = 86400.0
HALF_A_DIGIT = 0.0433
"""Seconds: half of the sixth decimal of a day, in which a radar echo may change by microseconds."""

SECOND = {"V": "v", "S": "s", "R": "r"}
UNUSED = {
    "X": "replaced by a later measurement of the same exposure",
    "x": "replaced by a later measurement of the same exposure",
    "O": "an offset of a satellite, not a place in the sky",
    "v": "a second line without the first one",
    "s": "a second line without the first one",
    "r": "a second line without the first one",
}
CATALOGUES = {
    "U": "Gaia1", "V": "Gaia2", "W": "Gaia3", "X": "Gaia3E", "Z": "ATLAS2", "Y": "UCAC5", "q": "UCAC4",
    "r": "UCAC2", "u": "UCAC3", "t": "PPMXL", "L": "2MASS", "o": "USNOB1", "s": "USNOB2", "c": "USNOA2",
    "a": "USNOA1", "d": "USNOSA2", "l": "ACT", "m": "GSCACT", "w": "CMC14", "v": "NOMAD", "i": "GSC1.1", "e": "UCAC1",
}
"""Names in ADES of the catalogues that are usual in column 72; others keep their letter."""


class Second(NamedTuple):
    """The second line of a record of two: its number and text."""

    number: int
    text: str


def read(lines: Sequence[str]) -> Iterator[Record | Ignored]:
    """Yield what each line gives, or why it gives nothing. Lines without text are passed over. Cannot fail."""
    k = 0
    while k < len(lines):
        line, at = lines[k].rstrip(), k + 1
        k += 1
        if not line:
            continue
        second = None
        if len(line) <= WIDTH and line[14:15] in SECOND:
            following = lines[k].rstrip() if k < len(lines) else ""
            if following[14:15] == SECOND[line[14]] and following[:12] == line[:12] and following[15:32] == line[15:32]:
                second, k = Second(k + 1, following), k + 1
        try:
            yield from _records(at, line, second)
        except Unusable as error:
            yield Ignored(at, str(error), line)
            if second is not None:
                yield Ignored(second.number, f"belongs to line {at}", second.text)


def _records(at: int, line: str, second: Second | None) -> list[Record]:
    if len(line) != WIDTH:
        raise Unusable(f"{len(line)} columns; expected {WIDTH}")
    mode = line[14]
    if mode in UNUSED:
        raise Unusable(UNUSED[mode])
    if mode not in MODES:
        raise Unusable(f"column 15 is {mode!r}; expected one of {MODES!r}")
    if mode in SECOND and second is None:
        raise Unusable(f"its second line, with {SECOND[mode]!r} in column 15, does not follow")
    if second is not None and len(second.text) != WIDTH:
        raise Unusable(f"its second line has {len(second.text)} columns; expected {WIDTH}")
    jd, part = _date(line[15:32])
    head = Record(at, OPTICAL, packed.name(line[:5], line[5:12]), jd, part, line[77:80], mode=mode.strip())
    if not head.body:
        raise Unusable("columns 1 to 12 name no body")
    if mode == "R":
        assert second is not None
        return _radar(head, line, second.text)
    place = None
    if second is not None:
        place = (_in_space if mode == "S" else _on_the_way)(second.text)
    require_place(head.station, place)
    ra = 15.0 * _sexagesimal(line[32:44], "right ascension", 24.0)
    sign, dec = line[44], _sexagesimal(line[45:56], "declination", 90.0)
    if sign not in "+-":
        raise Unusable(f"the sign of the declination is {sign!r}; expected + or -")
    mag = line[65:70]
    return [
        head._replace(
            place=place,
            ra=ra,
            dec=-dec if sign == "-" else dec,
            mag=number(mag, "magnitude", -35.0, 99.0) if mag.strip() else math.nan,
            band=line[70].strip(),
            catalogue=CATALOGUES.get(line[71], line[71].strip()),
            program=line[13].strip(),
            notes=line[12].strip(),
        )
    ]


def _date(text: str) -> tuple[float, float]:
    found = re.fullmatch(r"(\d{4}) (\d\d) (\d\d)(\.\d*)? *", text, re.ASCII)
    if found is None:
        raise Unusable(f"the date is {text.strip()!r}; expected one such as '2004 03 15.10789'")
    year, month, day, part = found.groups()
    return midnight(year, month, int(day)), float("0" + part) if part else 0.0


def _sexagesimal(text: str, what: str, most: float) -> float:
    """Return hours or degrees: 'HH MM SS.sss', 'HH MM.mmm' or 'HH.hhh'."""
    found = re.fullmatch(r"(\d\d)(?: (\d\d)(?: (\d\d))?)?(\.\d*)? *", text, re.ASCII)
    if found is None:
        raise Unusable(f"{what} is {text.strip()!r}; expected one such as '04 06 08.08'")
    *figures, part = found.groups()
    parts = [float(x) for x in figures if x is not None]
    parts[-1] += float("0" + part) if part else 0.0  # of the last that is there
    value = sum(x / 60.0**k for k, x in enumerate(parts))
    if max(parts[1:], default=0.0) >= 60.0 or value > most:
        raise Unusable(f"{what} is {text.strip()!r}, which is out of its range")
    return value


def _signed(text: str, what: str) -> float:
    """Return a number whose sign may stand apart from it."""
    return number(text.replace(" ", ""), what)


def _in_space(second: str) -> Place:
    """Return the place of a satellite: x, y, z in the ICRF, km (1 in column 33) or au (2)."""
    if second[32] not in "12":
        raise Unusable(f"the unit of the satellite's place is {second[32]!r}; expected 1 (km) or 2 (au)")
    unit = AU_KM if second[32] == "1" else 1.0
    x, y, z = (_signed(second[a:b], "the satellite's place") / unit for a, b in ((34, 45), (46, 57), (58, 69)))
    return Place(x, y, z, False)


def _on_the_way(second: str) -> Place:
    """Return the place of a roving observer, whose second line has longitude, latitude and height."""
    longitude = number(second[34:44], "longitude", -360.0, 360.0)
    latitude = number(second[45:55], "latitude", -90.0, 90.0)
    height = second[56:61]
    above = number(height, "height", -1e3, 1e5) if height.strip() else 0.0
    x, y, z = on_the_ellipsoid(longitude, latitude, above)
    return Place(x, y, z, True)


def _radar(head: Record, line: str, second: str) -> list[Record]:
    """Return a delay, a Doppler shift, or both. Decimal points stand between columns 43 and 44, and 58 and 59."""
    transmitter = line[68:71]
    for station in (transmitter, head.station):
        require_place(station, None)
    if second[32] not in "SC":
        raise Unusable(f"the point of reflection is {second[32]!r}; expected S or C")
    frequency = number((line[62:67] + "." + line[67] + second[62:67]).replace(" ", ""), "frequency", 1.0, 1e6)
    head = head._replace(
        part=_second(head.part), transmitter=transmitter, frequency=frequency, surface=second[32] == "S"
    )
    out = []
    if line[32:47].strip():
        pointed = (_pointed(x[a:43], x[43:47]) for x, a in ((line, 32), (second, 33)))
        delay, sigma = (microseconds(x, "delay") for x in pointed)
        out.append(head._replace(kind=DELAY, value=delay, sigma=sigma))
    if line[47:62].strip():
        shift, sigma = (number(_pointed(x[47:58], x[58:62]), "Doppler shift") for x in (line, second))
        out.append(head._replace(kind=DOPPLER, value=shift, sigma=sigma))
    if not out:
        raise Unusable("neither a delay nor a Doppler shift")
    return out


def _second(part: float) -> float:
    """Return the part of a day at the whole second, as times of radar are, that six decimals of it stand for; as it is
    if they stand for none.
    """
    whole = round(part * SECONDS)
    return whole / SECONDS if abs(part * SECONDS - whole) < HALF_A_DIGIT else part


def _pointed(whole: str, part: str) -> str:
    return f"{whole.strip() or '0'}.{part.strip()}".replace(" ", "")
