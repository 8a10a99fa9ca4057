"""One observation as it stands in a file, and what is wrong with a line that is none."""

from __future__ import annotations

import datetime
import math
import re
from decimal import Decimal
from typing import NamedTuple

from orbits.observing.stations import stations

JULIAN_DAY_OF_ORDINAL = 1721424.5
"""The Julian date of midnight before the day of ordinal 0 of `datetime.date`."""

OPTICAL, DELAY, DOPPLER = "optical", "delay", "doppler"
NAN = math.nan


class Unusable(Exception):
    """A line that gives no observation; its text is the reason."""


class Ignored(NamedTuple):
    """A line that is not used: its number from 1, or that of an element of XML; the reason; the line itself."""

    line: int
    reason: str
    text: str


class Place(NamedTuple):
    """Where an observer was: relative to the geocentre, au.

    x, y, z : in the axes of the ICRF, or of the Earth if it `turns` with it
    """

    x: float
    y: float
    z: float
    turns: bool


class Record(NamedTuple):
    """One observation.

    line : its number in the file; kind : "optical", "delay" or "doppler"; body : number or designation
    jd, part : Julian date of UTC, a midnight and the part of the day; of the reception for radar
    station : code of the observatory; place : of one that is not in the table of codes, or None
    ra, dec : optical, degrees, J2000/ICRF; value : a round-trip delay in seconds, a Doppler shift in Hz
    sigma_ra, sigma_dec : arcseconds, that of right ascension times cos(dec), as given; correlation : of both
    sigma : of the delay in seconds, of the Doppler shift in Hz; NaN for all that is not given
    catalogue : of reference stars; mode : as in ADES, or the letter of the MPC; program, notes : of the MPC
    mag, band : magnitude; transmitter, frequency (MHz), surface : of radar, whether it is to the surface
    """

    line: int
    kind: str
    body: str
    jd: float
    part: float
    station: str
    place: Place | None = None
    ra: float = NAN
    dec: float = NAN
    value: float = NAN
    sigma_ra: float = NAN
    sigma_dec: float = NAN
    correlation: float = 0.0
    sigma: float = NAN
    catalogue: str = ""
    mode: str = ""
    program: str = ""
    notes: str = ""
    mag: float = NAN
    band: str = ""
    transmitter: str = ""
    frequency: float = NAN
    surface: bool = False


def midnight(year: str, month: str, day: int) -> float:
    """Return the Julian date of the beginning of a day. Raises Unusable if there is none."""
    try:
        return datetime.date(int(year), int(month), day).toordinal() + JULIAN_DAY_OF_ORDINAL
    except ValueError:
        raise Unusable(f"{year!r} {month!r} {day} is no date") from None


def number(text: str, what: str, least: float = -math.inf, most: float = math.inf) -> float:
    """Return a number in plain decimals. Raises Unusable, naming what it is, for any other text and out of bounds."""
    cleaned = text.strip()
    if not re.fullmatch(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d{1,2})?", cleaned, re.ASCII):
        raise Unusable(f"{what} is {cleaned!r}; expected a number")
    found = float(cleaned)
    if not least <= found <= most:
        raise Unusable(f"{what} is {cleaned}; expected {least:g} to {most:g}")
    return found


def microseconds(text: str, what: str) -> float:
    """Return microseconds as seconds, rounded once, as in formats that have seconds. Raises Unusable as `number`."""
    number(text, what)
    return float(Decimal(text.strip()).scaleb(-6))


def require_place(station: str, place: Place | None) -> None:
    """Raise Unusable if it is not known where an observer was."""
    if place is not None:
        return
    found = stations().get(station)
    if found is None:
        raise Unusable(f"{station!r} is no code of an observatory")
    if found.x is None:
        raise Unusable(f"{found} has no place on the Earth, and the record gives none")
