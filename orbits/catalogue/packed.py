"""The Minor Planet Center's packed designations and dates.

    number("00001") == 1;  number("A0000") == 100000;  number("~000z") == 620061
    designation("K07Tf8A") == "2007 TA418";  designation("_QC0aEM") == "2026 CZ6190"
    designation("T1S3138") == "3138 T-1"
    date("K223B") == 59649    # 2022 March 11 as MJD

Sources: Minor Planet Center, "Packed Provisional and Permanent Designations" and "Packed Dates", and for designations
past the 15,500th of a half-month its "Extended Packed Provisional Designation Scheme".
"""

from __future__ import annotations

import datetime
import re

import numpy as np
from numpy.typing import NDArray

DIGITS = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz"
ORDER = "ABCDEFGHJKLMNOPQRSTUVWXYZ"
"""The letters that count within a half-month: all but I."""

CENTURIES = {"I": 1800, "J": 1900, "K": 2000, "L": 2100}
# Numbers from here on are written as a tilde and four digits in base 62.
FIRST_OF_TILDE = 620_000
# Designations from here on, beyond 25 times the 620 cycles that two characters count, have an underscore.
FIRST_OF_UNDERSCORE = 15_500

HALF_MONTH = "[A-HJ-Y]"
PROVISIONAL = re.compile(rf"([I-L])(\d\d)({HALF_MONTH})([0-9A-Za-z])(\d)([A-HJ-Z])")
EXTENDED = re.compile(rf"_([0-9A-Za-z])({HALF_MONTH})([0-9A-Za-z]{{4}})")
COMET = re.compile(rf"([I-L])(\d\d)({HALF_MONTH})([0-9A-Za-z])(\d)([0a-z])")
"""The last character is the fragment, 0 for none."""
FRAGMENT = re.compile(r"(?:^|\d)([a-z]{1,2})$")
"""Of a numbered comet, at the end of columns 6 to 12."""

SURVEY = re.compile(r"(PL|T1|T2|T3)S(\d{4})")
ANY = re.compile("|".join(f"(?:{form.pattern})" for form in (PROVISIONAL, EXTENDED, SURVEY)))
"""All packed provisional designations."""

_VALUE = np.full(256, -1, dtype=np.int64)
_VALUE[[ord(digit) for digit in DIGITS]] = np.arange(len(DIGITS))
_MJD_OF_ORDINAL = 678576


def numbers(columns: NDArray[np.uint8]) -> NDArray[np.int64]:
    """Return the numbers packed in the bytes of columns 1 to 7, (n, 7) to (n,); 0 for anything else."""
    first, rest = columns[:, 0], _VALUE[columns[:, 1:5]]
    numbered = (columns[:, 5:] == ord(" ")).all(axis=1)
    digits = (rest >= 0) & (rest < 10)
    plain = numbered & digits.all(axis=1) & (_VALUE[first] >= 0)
    tilde = numbered & (first == ord("~")) & (rest >= 0).all(axis=1)
    small = _VALUE[first] * 10_000 + rest @ np.array([1000, 100, 10, 1])
    large = FIRST_OF_TILDE + rest @ np.array([62**3, 62**2, 62, 1])
    return np.where(plain, small, np.where(tilde, large, 0))


def number(packed: str) -> int:
    """Return the number packed in five characters. Raises ValueError for anything else."""
    found = 0
    if len(packed) == 5 and packed.isascii():
        found = int(numbers(np.frombuffer(f"{packed}  ".encode(), dtype=np.uint8).reshape(1, 7))[0])
    if not found:
        raise ValueError(
            f"{packed!r} is not a packed number; expected five characters such as '00001', 'A0000' or '~000z'"
        )
    return found


def designation(packed: str) -> str:
    """Return the provisional designation packed in seven characters. Raises ValueError for anything else."""
    if match := PROVISIONAL.fullmatch(packed):
        century, year, half, tens, ones, order = match.groups()
        cycle = 10 * DIGITS.index(tens) + int(ones)
        return f"{_year(CENTURIES[century] + int(year))} {half}{order}{cycle or ''}"
    if match := EXTENDED.fullmatch(packed):
        year, half, digits = match.groups()
        count = FIRST_OF_UNDERSCORE
        for place, digit in enumerate(reversed(digits)):
            count += DIGITS.index(digit) * 62**place
        return f"{2000 + DIGITS.index(year)} {half}{ORDER[count % 25]}{count // 25}"
    if match := SURVEY.fullmatch(packed):
        survey, serial = match.groups()
        return f"{serial} {survey[0]}-{survey[1]}"
    raise ValueError(f"{packed!r} is not a packed designation; expected seven characters such as 'K07Tf8A'")


def date(packed: str) -> int:
    """Return a date packed in five characters as MJD. Raises ValueError for anything else."""
    try:
        century, year, month, day = packed[0], packed[1:3], DIGITS.index(packed[3]), DIGITS.index(packed[4])
        if len(packed) == 5 and year.isascii() and year.isdigit():
            return datetime.date(CENTURIES[century] + int(year), month, day).toordinal() - _MJD_OF_ORDINAL
    except (LookupError, ValueError):
        pass
    raise ValueError(f"{packed!r} is not a packed date; expected five characters such as 'K223B' for 2022 March 11")


def _year(year: int) -> str:
    """Return a year as it is written in designations: before 1925 with an A for the first digit."""
    return str(year) if year >= 1925 else f"A{year % 1000:03d}"


def name(number_columns: str, designation_columns: str) -> str:
    """Return the name of a body by columns 1-5 and 6-12 of an observation: its number if it has one, such as "99942",
    "1P" or, of a fragment, "73P-BB", otherwise its designation, such as "2004 MN4" or "C/2015 A1"; what is packed in no
    known way as it is.
    """
    numbered, provisional = number_columns.strip(), designation_columns.strip()
    if re.fullmatch(r"\d{4}[A-Z]", numbered):
        part_of = FRAGMENT.search(provisional)
        return numbered.lstrip("0") + (f"-{part_of[1].upper()}" if part_of else "")
    try:
        return str(number(numbered))
    except ValueError:
        pass
    try:
        named = designation(provisional)
    except ValueError:
        comet = COMET.fullmatch(provisional)
        if comet:
            century, year, half, tens, ones, fragment = comet.groups()
            part = "" if fragment == "0" else f"-{fragment.upper()}"
            named = f"{CENTURIES[century] + int(year)} {half}{10 * DIGITS.index(tens) + int(ones)}{part}"
        else:
            named = provisional
    return "/".join(part for part in (numbered, named) if part)
