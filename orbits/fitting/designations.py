"""Packed numbers and designations of the Minor Planet Center, unpacked.

Source: https://www.minorplanetcenter.net/iau/info/PackedDes.html
"""

from __future__ import annotations

import re
import string

DIGITS = string.digits + string.ascii_uppercase + string.ascii_lowercase
SURVEYS = {"PLS": "P-L", "T1S": "T-1", "T2S": "T-2", "T3S": "T-3"}


def unpacked(number: str, provisional: str) -> str:
    """Return the name of a body by columns 1-5 and 6-12 of an 80-column record: its number if it has one, such as
    "99942" or "1P", otherwise its designation, such as "2004 MN4"; what is packed in no known way as it is.
    """
    number, provisional = number.strip(), provisional.strip()
    if re.fullmatch(r"\d{5}", number):
        return number.lstrip("0") or "0"
    if re.fullmatch(r"[A-Za-z]\d{4}", number):
        return str(DIGITS.index(number[0]) * 10000 + int(number[1:]))
    if re.fullmatch(r"~[0-9A-Za-z]{4}", number):
        count = 0
        for digit in number[1:]:
            count = 62 * count + DIGITS.index(digit)
        return str(620000 + count)
    if re.fullmatch(r"\d{4}[A-Z]", number):
        return number.lstrip("0")
    return (number + "/" if number else "") + _designation(provisional)


def _designation(packed: str) -> str:
    if re.fullmatch(r"[I-L]\d\d[A-Z][0-9A-Za-z]\d[A-Za-z0-9]", packed):
        year = str(DIGITS.index(packed[0])) + packed[1:3]
        count = 10 * DIGITS.index(packed[4]) + int(packed[5])
        if packed[6].isupper():
            return f"{year} {packed[3]}{packed[6]}{count or ''}"
        fragment = "" if packed[6] == "0" else f"-{packed[6].upper()}"
        return f"{year} {packed[3]}{count}{fragment}"
    if packed[:3] in SURVEYS and re.fullmatch(r"\d{4}", packed[3:]):
        return f"{packed[3:]} {SURVEYS[packed[:3]]}"
    return packed
