"""Radar astrometry as JPL gives it: as text with tabs between nine columns, and as the answers of its interface, JSON.

Source: https://ssd-api.jpl.nasa.gov/doc/sb_radar.html
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence

from orbits.astrometry import ades
from orbits.astrometry.record import Ignored, Record, Unusable, microseconds

COLUMNS = ("des", "epoch", "value", "sigma", "units", "freq", "rcvr", "xmit", "bp")
"""Of the text, and the fields of JSON: body, UTC of the reception, microseconds or Hz, MHz, antennas, bounce point."""

ANTENNAS = {"-1": "251", "-2": "254", "-9": "256", "-13": "252", "-14": "253", "-25": "257",
            "-34": "272", "-35": "263", "-36": "264", "-43": "265", "-73": "259"}  # fmt: skip
"""The codes of the MPC by JPL's numbers of antennas."""


def is_row(line: str) -> bool:
    """Return whether a line has the columns of the text."""
    cells = line.split("\t")
    return len(cells) == len(COLUMNS) and cells[4].strip() in ("us", "Hz")


def read(lines: Sequence[str]) -> Iterator[Record | Ignored]:
    """Yield what each line gives, or why it gives nothing. Lines without text are passed over. Cannot fail."""
    for at, line in enumerate(lines, start=1):
        try:
            if line.strip():
                yield _record(at, [cell.strip() for cell in line.split("\t")])
        except Unusable as error:
            yield Ignored(at, str(error), line)


def lines_of(text: str) -> list[str]:
    """Return the rows of an answer as lines of the text; of one that is none, itself, which gives nothing."""
    try:
        answer = json.loads(text)
        fields = [answer["fields"].index(name) for name in COLUMNS]
        return ["\t".join(str(row[k]) for k in fields) for row in answer["data"]] or [text]
    except (ValueError, LookupError, TypeError, AttributeError):
        return [text]


def _record(at: int, cells: Sequence[str]) -> Record:
    """Return the observation of a row, which is read as one of ADES."""
    if len(cells) != len(COLUMNS):
        raise Unusable(f"no radar astrometry of JPL's: {len(cells)} columns with tabs between; expected {len(COLUMNS)}")
    body, time, value, sigma, unit, frequency, receiver, transmitter, bounce = cells
    if unit not in ("us", "Hz") or bounce not in ("C", "P"):
        raise Unusable(f"the unit is {unit!r}, the bounce point {bounce!r}; expected us or Hz, C or P")
    if unit == "us":
        measured = {"delay": repr(microseconds(value, "the delay")), "rmsDelay": sigma}
    else:
        measured = {"doppler": value, "rmsDoppler": sigma}
    words = body.split()
    named = {"permID": words[0] if words and words[0].isdecimal() else body}
    antennas = {"rcv": ANTENNAS.get(receiver, receiver), "trx": ANTENNAS.get(transmitter, transmitter)}
    when = {"obsTime": time.replace(" ", "T") + "Z"}
    (found,) = ades.records(at, named | antennas | when | measured | {"frq": frequency, "com": str(int(bounce == "C"))})
    return found
