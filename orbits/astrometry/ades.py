"""ADES, the format of astrometry of the IAU: PSV, and the same columns with commas; and XML.

Source: Chesley et al., ADES-Master, "Astrometry Data Exchange Standard", version 2022,
https://github.com/IAU-ADES/ADES-Master
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from xml.etree import ElementTree

from orbits.astrometry.record import (
    DELAY,
    DOPPLER,
    OPTICAL,
    Ignored,
    Place,
    Record,
    Unusable,
    midnight,
    number,
    require_place,
)
from orbits.ephemeris import AU_KM
from orbits.observing.stations import on_the_ellipsoid

KINDS = ("optical", "radar", "offset", "occultation")
"""The elements of XML with an observation; of these, offsets are not used."""

BODY = ("permID", "provID", "trkSub")
"""What names a body, the first of those that are there."""

SECONDS = 86400.0


def is_heading(line: str) -> bool:
    """Return whether a line has the names of columns, of a time and of a body."""
    names = {x.strip() for x in re.split(r"[|,]", line)}
    return "obsTime" in names and not names.isdisjoint(BODY)


def read_psv(lines: Sequence[str]) -> Iterator[Record | Ignored]:
    """Yield what each line gives, or why it gives nothing. Headers give the columns, and nothing else. Cannot fail."""
    columns: list[str] = []
    separator = "|"
    for at, line in enumerate(lines, start=1):
        if not line.strip() or line.lstrip().startswith(("#", "!")):
            continue
        if is_heading(line):
            columns, separator = [x.strip() for x in re.split(r"[|,]", line)], "|" if "|" in line else ","
            continue
        cells = [x.strip() for x in line.split(separator)]
        try:
            if not columns:
                raise Unusable("stands before a line with the names of the columns")
            if len(cells) > len(columns):
                raise Unusable(f"{len(cells)} columns; expected {len(columns)}")
            yield from records(at, {name: x for name, x in zip(columns, cells, strict=False) if x})
        except Unusable as error:
            yield Ignored(at, str(error), line)


def read_xml(text: str) -> Iterator[Record | Ignored]:
    """Yield what each element of an observation gives, numbered from 1, or why it gives nothing. Cannot fail.

    The text is decoded: what it declares as its encoding is passed over.
    """
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        yield Ignored(1, "has a document type; expected none, as it may expand without bounds", text[:80])
        return
    try:
        root = ElementTree.fromstring(text.strip())
    except (ElementTree.ParseError, ValueError) as error:
        yield Ignored(1, f"no valid XML: {error}", text[:80])
        return
    elements = [x for x in root.iter() if x.tag in KINDS]
    if not elements:
        yield Ignored(1, f"XML of <{root.tag}>, in which no element is one of {', '.join(KINDS)}", text[:80])
    for at, element in enumerate(elements, start=1):
        cells = {x.tag: x.text.strip() for x in element.iter() if x is not element and x.text and x.text.strip()}
        try:
            yield from records(at, cells)
        except Unusable as error:
            yield Ignored(at, f"element {element.tag}: {error}", " ".join(f"{a}={b}" for a, b in cells.items()))


def records(at: int, cells: Mapping[str, str]) -> list[Record]:
    """Return what the cells of a line, by the names of their columns, give. Raises Unusable if they give nothing."""
    if cells.get("deprecated"):
        raise Unusable("deprecated: replaced by a later measurement")
    body = next((cells[name] for name in BODY if cells.get(name)), "")
    if not body:
        raise Unusable("no permID, provID or trkSub names a body")
    jd, part = _time(cells.get("obsTime", ""))
    head = Record(at, OPTICAL, body, jd, part, cells.get("stn", cells.get("rcv", "")), notes=cells.get("notes", ""))
    if "delay" in cells or "doppler" in cells:
        return _radar(head, cells)
    place = _place(cells)
    require_place(head.station, place)
    ra, dec = _direction(cells)
    sigma_ra, sigma_dec = (_optional(cells, name, 1e-6, 1e5) for name in ("rmsRA", "rmsDec"))
    return [
        head._replace(
            place=place,
            ra=ra,
            dec=dec,
            sigma_ra=sigma_ra,
            sigma_dec=sigma_dec,
            correlation=_optional(cells, "rmsCorr", -0.999, 0.999, 0.0),
            catalogue=cells.get("astCat", "").replace("UNK", ""),
            mode=cells.get("mode", ""),
            program=cells.get("prog", ""),
            mag=_optional(cells, "mag", -35.0, 99.0),
            band=cells.get("band", ""),
        )
    ]


def _optional(cells: Mapping[str, str], name: str, least: float, most: float, other: float = math.nan) -> float:
    return number(cells[name], name, least, most) if name in cells else other


def _needed(cells: Mapping[str, str], name: str, least: float = -math.inf, most: float = math.inf) -> float:
    if name not in cells:
        raise Unusable(f"no {name}")
    return number(cells[name], name, least, most)


def _direction(cells: Mapping[str, str]) -> tuple[float, float]:
    """Return right ascension and declination, degrees; from the star and the offset of an occultation if given so."""
    if "raStar" not in cells:
        return _needed(cells, "ra", 0.0, 360.0), _needed(cells, "dec", -90.0, 90.0)
    ra, dec = _needed(cells, "raStar", 0.0, 360.0), _needed(cells, "decStar", -90.0, 90.0)
    east, north = (_needed(cells, name) / 3600.0 for name in ("deltaRA", "deltaDec"))
    return ra + east / max(math.cos(math.radians(dec)), 1e-9), dec + north


def _time(text: str) -> tuple[float, float]:
    found = re.fullmatch(r"(\d{4})-(\d\d)-(\d\d)T(\d\d):(\d\d):(\d\d(?:\.\d*)?)Z", text, re.ASCII)
    if found is None:
        raise Unusable(f"obsTime is {text!r}; expected one such as '2023-07-06T00:17:43.77Z'")
    year, month, day, hours, minutes, seconds = found.groups()
    if int(hours) > 23 or int(minutes) > 59 or float(seconds) >= 61.0:
        raise Unusable(f"obsTime is {text!r}, which is no time")
    return midnight(year, month, int(day)), (int(hours) * 3600 + int(minutes) * 60 + float(seconds)) / SECONDS


def _place(cells: Mapping[str, str]) -> Place | None:
    """Return the place of an observer in space, or one that roves; None if there is none."""
    if "sys" not in cells:
        return None
    if cells.get("ctr", "399") != "399":
        raise Unusable(f"the place is relative to body {cells['ctr']}; expected 399, the Earth")
    system = cells["sys"]
    one, two, three = (_needed(cells, name) for name in ("pos1", "pos2", "pos3"))
    if system in ("ICRF_KM", "ICRF_AU"):
        unit = AU_KM if system == "ICRF_KM" else 1.0
        return Place(one / unit, two / unit, three / unit, False)
    if system == "WGS84":
        if abs(two) > 90.0:
            raise Unusable(f"the latitude is {two:g}; expected -90 to 90")
        x, y, z = on_the_ellipsoid(one, two, three)
        return Place(x, y, z, True)
    raise Unusable(f"sys is {system!r}; expected ICRF_KM, ICRF_AU or WGS84")


def _radar(head: Record, cells: Mapping[str, str]) -> list[Record]:
    """Return a delay (seconds; its rms in microseconds), a Doppler shift (Hz), or both."""
    station, transmitter = cells.get("rcv", ""), cells.get("trx", "")
    for code in (station, transmitter):
        require_place(code, None)
    frequency = _needed(cells, "frq", 1.0, 1e6)
    head = head._replace(
        station=station, transmitter=transmitter, frequency=frequency, surface=cells.get("com") == "0"
    )
    out = []
    if "delay" in cells:
        sigma = _needed(cells, "rmsDelay", 1e-9, 1e9) * 1e-6
        out.append(head._replace(kind=DELAY, value=_needed(cells, "delay", 0.0), sigma=sigma))
    if "doppler" in cells:
        sigma = _needed(cells, "rmsDoppler", 1e-9, 1e9)
        out.append(head._replace(kind=DOPPLER, value=_needed(cells, "doppler"), sigma=sigma))
    return out
