"""Reader of the Minor Planet Center's MPCORB.DAT and of other files in its format, such as NEA.txt.

Source: Minor Planet Center, "Export Format for Minor-Planet Orbits",
https://www.minorplanetcenter.net/iau/info/MPOrbitFormat.html

The elements are heliocentric, in the ecliptic and equinox of J2000. Their epochs are in TT, taken as TDB here: the two
differ by less than 2 ms, in which an asteroid moves less than 100 m, and the elements are printed to 1e-5 degrees.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any, BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbits.catalogue import packed
from orbits.catalogue.catalogue import Catalogue, Floats, choose, joined
from orbits.catalogue.classes import orbit_classes
from orbits.catalogue.columns import Bytes, decimals, lines
from orbits.catalogue.selection import Selection, Ways
from orbits.catalogue.sources import opened
from orbits.catalogue.unreadable import Unreadable
from orbits.errors import InputError

BLOCK = 2**22
"""Bytes read at a time, so that only the selected bodies need memory, whatever the length of the file."""
# Ten times as many as there are today.
MOST_LINES = 20_000_000
WIDTH = 202
LEAST = 103
HEADER_ENDS = b"-" * 20
HEADER_LINES = 200

WHAT = "a file in the format of MPCORB.DAT, gzipped or not"

# Gauss's constant in degrees: the mean daily motion at 1 au.
DEGREES_A_DAY = np.degrees(0.01720209895)
# n is printed to 1e-8 degrees and a to 1e-7 au; the relative part allows for another value of the Sun's GM.
N_ABSOLUTE, N_RELATIVE = 2e-8, 1e-6


class Field(NamedTuple):
    """Columns first to last, counted from 1 as in the description of the format, and their content."""

    first: int
    last: int
    what: str
    example: str
    most: float = np.inf
    optional: bool = False


FIELDS = {
    "H": Field(9, 13, "absolute magnitude", "3.34", optional=True),
    "G": Field(15, 19, "slope parameter", "0.15", optional=True),
    "M": Field(27, 35, "mean anomaly", "0 to 360 degrees such as 102.95074", 360.0),
    "omega": Field(38, 46, "argument of perihelion", "0 to 360 degrees such as 73.36090", 360.0),
    "Omega": Field(49, 57, "longitude of the node", "0 to 360 degrees such as 80.25352", 360.0),
    "inc": Field(60, 68, "inclination", "0 to 180 degrees such as 10.58760", 180.0),
    "e": Field(71, 79, "eccentricity", "0.0790273"),
    "n": Field(81, 91, "mean daily motion", "degrees such as 0.21412733", optional=True),
    "a": Field(93, 103, "semi-major axis", "au such as 2.7670775"),
}
DESIGNATION = Field(1, 7, "packed number or designation", "'00001' or 'K07Tf8A'")
EPOCH = Field(21, 25, "packed epoch", "'K223B' for 2022 March 11")
READABLE = Field(167, 194, "readable designation", "'(1) Ceres' with the number of columns 1-7")
# These do not describe the orbit: they are nan, or blank, if they cannot be read.
NUMBERS = {"observations": (118, 122), "oppositions": (124, 126), "rms": (138, 141)}
TEXTS = {"U": (106, 106), "reference": (108, 116), "arc": (128, 136), "last_observation": (195, 202)}


def read_mpcorb(
    source: Any,
    count: int | None = None,
    *,
    names: str | Iterable[str] | None = None,
    numbers: int | Iterable[int] | None = None,
    classes: str | Iterable[str] | None = None,
    brighter_than: float | None = None,
    errors: str = "raise",
) -> Catalogue:
    """Return the minor planets of a file in the format of MPCORB.DAT, in file order, for `System.add_particles`.

        orbits.read_mpcorb("MPCORB.DAT.gz", brighter_than=12)
        orbits.read_mpcorb("MPCORB.DAT", names=["Ceres", "(433) Eros", "2007 TA418"])
        orbits.read_mpcorb("MPCORB.DAT", numbers=range(1, 1001))

    source : a path, plain or gzipped, with or without the file's header; or lines of the file as text
    count : at most the brightest `count` of those that the other arguments select, brightest first
    names : only these, in this order: names, designations or packed designations; case is ignored
    numbers : only these, in this order, after those selected by name
    classes : "belt", "trojan", "neo", or codes of the Small-Body Database, determined from the elements
    brighter_than : only absolute magnitudes H below this
    errors : "raise" stops at the first line that cannot be read; "skip" leaves out such lines, warns of their number
        and of the first of them (OrbitsWarning), and counts them in `.skipped`

    `.details` has G, U, reference, observations, oppositions, arc, rms and last_observation. A file is read piece by
    piece, so that only the selected bodies need memory.

    Raises InputError, with line and columns, for anything that is not in that format, and UnknownNameError for names
    and numbers that are not found.
    """
    selection = Selection(count, names, numbers, classes, brighter_than)
    pieces: list[dict[str, Any]] = []
    read = 0
    with opened(source, WHAT) as (stream, name):
        unreadable = Unreadable(errors, name)
        for block, line in _blocks(stream, name):
            piece, good = _piece(block, line, selection, unreadable)
            read += good
            pieces.append(piece)
            if selection.is_complete:
                break
    if not read and not unreadable.count:
        raise InputError(f"{name} has no line with elements; expected {WHAT}")
    unreadable.close(read)
    selection.check_found(f"the {read} bodies of {name}")
    called = [ways for piece in pieces for ways in piece.pop("called")]
    table = joined(pieces, unreadable.name, unreadable.count)
    rows = selection.ordered(table.numbers, called)
    return choose(
        table, {}, rows=rows, count=selection.count, names=None, numbers=None, classes=None, brighter_than=None
    )


def _blocks(stream: BinaryIO, name: str) -> Iterator[tuple[Bytes, int]]:
    """Yield whole lines as bytes, some megabytes at a time, and the number of the first line; without the header."""
    rest, line = b"", 1
    while True:
        data = stream.read(BLOCK)
        if not data and not rest.strip():
            return
        text, newline, rest = (rest + (data or b"\n")).rpartition(b"\n")
        if not newline:
            if len(rest) > BLOCK:
                raise InputError(f"{name} has no end of line in {BLOCK // 2**20} MB; expected {WHAT}")
            continue
        text += newline
        if line == 1:
            header = _header(text)
            line += text.count(b"\n", 0, header)
            text = text[header:]
        if text:
            yield np.frombuffer(text, dtype=np.uint8), line
        line += text.count(b"\n")
        if line > MOST_LINES:
            raise InputError(f"{name} has more than {MOST_LINES:,} lines; expected {WHAT}")


def _header(text: bytes) -> int:
    """Return the length of the header in bytes: up to the line of dashes among the first lines, if there is one."""
    place = 0
    for line in text.split(b"\n", HEADER_LINES)[:HEADER_LINES]:
        place += len(line) + 1
        if line.startswith(HEADER_ENDS):
            return min(place, len(text))
    return 0


def _piece(block: Bytes, line: int, selection: Selection, unreadable: Unreadable) -> tuple[dict[str, Any], int]:
    """Return the columns of the selected bodies of a block, and how many of its lines could be read."""
    rows, lengths, number = lines(block, WIDTH)
    number += line
    faults = Faults(rows, lengths, number)
    values = _elements(rows, faults)
    values["numbers"] = packed.numbers(rows[:, :7])
    faults.add(DESIGNATION, (values["numbers"] == 0) & ~_provisional(rows, values["numbers"]))
    values["names"] = _names(rows, values["numbers"], faults)
    good = faults.sorted_out(unreadable)
    values = {what: _taken(value, good) for what, value in values.items()}
    rows = rows[good]
    values["classes"] = orbit_classes(values["a"], values["e"], np.zeros(len(rows), dtype=bool))
    called = _ways(rows, values) if selection.names else []
    keep = selection.rows(values, called)
    rows = rows[keep]
    piece = {what: _taken(value, keep) for what, value in values.items()}
    piece["called"] = _taken(called, keep) if selection.names else []
    piece["details"] = {"G": piece.pop("G")}
    piece["details"] |= {what: decimals(rows[:, a - 1 : b])[0] for what, (a, b) in NUMBERS.items()}
    piece["details"] |= {what: _stripped(rows[:, a - 1 : b]).astype(str) for what, (a, b) in TEXTS.items()}
    return piece, len(good)


class Faults:
    """The first fault of each line."""

    def __init__(self, rows: Bytes, lengths: NDArray[np.int64], number: NDArray[np.int64]) -> None:
        self._rows, self._number = rows, number
        self._fault = np.zeros(len(rows), dtype=np.int64)
        self._what: list[tuple[Field | None, str]] = [(None, "")]
        for i in np.flatnonzero(lengths < LEAST).tolist():
            self._what.append((None, f"the line ends after {lengths[i]} columns; expected at least {LEAST}"))
            self._fault[i] = len(self._what) - 1
        foreign = (rows < 32) | (rows > 126)
        self._add(None, "it contains characters that are not ASCII text", np.asarray(foreign.any(axis=1)))

    def add(self, field: Field, wrong: NDArray[np.bool_]) -> None:
        """Record that the columns of this field are wrong in these lines."""
        self._add(field, f"is not a valid {field.what}; expected {field.example}", wrong)

    def contradiction(self, problem: str, wrong: NDArray[np.bool_]) -> None:
        """Record a problem of these lines as a whole."""
        self._add(None, problem, wrong)

    def _add(self, field: Field | None, problem: str, wrong: NDArray[np.bool_]) -> None:
        self._what.append((field, problem))
        self._fault[wrong & (self._fault == 0)] = len(self._what) - 1

    def sorted_out(self, unreadable: Unreadable) -> NDArray[np.int64]:
        """Report the lines with faults to `unreadable`, and return the indices of those without."""
        for i in np.flatnonzero(self._fault).tolist():
            field, problem = self._what[self._fault[i]]
            where = f"line {self._number[i]}"
            if field is not None:
                where += f", columns {field.first}-{field.last}"
                text = self._rows[i, field.first - 1 : field.last].tobytes().decode("ascii", "replace")
                problem = f"{text!r} {problem}"
            unreadable.bad(where, problem)
        return np.flatnonzero(self._fault == 0)


def _elements(rows: Bytes, faults: Faults) -> dict[str, Any]:
    values: dict[str, Any] = {"epoch": _epochs(rows, faults)}
    for what, field in FIELDS.items():
        values[what], wrong = decimals(rows[:, field.first - 1 : field.last])
        if what not in ("H", "G"):
            wrong |= (values[what] < 0.0) | (values[what] > field.most)
        if not field.optional:
            wrong |= np.isnan(values[what])
        faults.add(field, wrong)
    a, e, n = values["a"], values["e"], values.pop("n")
    ellipse: NDArray[np.bool_] = (a > 0.0) & (e < 1.0)
    faults.contradiction("a and e do not define an ellipse; expected a > 0 and 0 <= e < 1", ~ellipse)
    with np.errstate(divide="ignore", invalid="ignore"):
        expected = DEGREES_A_DAY / (a * np.sqrt(a))
        apart = np.abs(n - expected) > N_ABSOLUTE + N_RELATIVE * expected
    faults.contradiction("n and a contradict Kepler's third law; expected n = 0.98560767 a^-1.5 degrees a day", apart)
    for what in ("M", "omega", "Omega", "inc"):
        values[what] = np.radians(values[what])
    return values


def _epochs(rows: Bytes, faults: Faults) -> Floats:
    """Return the epochs as MJD. A file has few different ones, and each is unpacked once."""
    text = np.ascontiguousarray(rows[:, EPOCH.first - 1 : EPOCH.last]).view("S5").ravel()
    different, which = np.unique(text, return_inverse=True)
    days = np.full(len(different), np.nan)
    for i, one in enumerate(different.tolist()):
        try:
            days[i] = packed.date(one.decode("ascii"))
        except ValueError:  # includes UnicodeDecodeError
            continue
    epoch = days[which]
    faults.add(EPOCH, np.isnan(epoch))
    return np.asarray(epoch)


def _provisional(rows: Bytes, numbers: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return which lines have a packed provisional designation."""
    found = np.zeros(len(rows), dtype=bool)
    matches = packed.ANY.fullmatch
    texts = rows[:, :7].tobytes().decode("latin-1")
    for i in np.flatnonzero(numbers == 0).tolist():
        found[i] = matches(texts[7 * i : 7 * i + 7]) is not None
    return found


def _names(rows: Bytes, numbers: NDArray[np.int64], faults: Faults) -> list[str]:
    """Return "Ceres" for the readable designation "(1) Ceres"; its number must agree with columns 1-7."""
    texts = _texts(rows, READABLE.first, READABLE.last)
    wrong = np.zeros(len(rows), dtype=bool)
    for i, (text, number) in enumerate(zip(texts, numbers.tolist(), strict=True)):
        if text[:1] == "(":
            inside, _, name = text[1:].partition(")")
            texts[i] = name.strip() or inside
            wrong[i] = inside != str(number)
        elif not text:
            texts[i] = _unpacked(rows[i, :7].tobytes().decode("latin-1"), number)
        else:
            wrong[i] = number > 0
    faults.add(READABLE, wrong)
    return texts


def _unpacked(text: str, number: int) -> str:
    try:
        return str(number) if number else packed.designation(text)
    except ValueError:
        return ""  # already recorded as a fault


def _ways(rows: Bytes, values: dict[str, Any]) -> list[Ways]:
    """Return the forms of each name: name, number, both, and packed designation."""
    codes = _texts(rows, DESIGNATION.first, DESIGNATION.last)
    called = zip(values["names"], values["numbers"].tolist(), codes, strict=True)
    return [
        (name.lower(), code.lower(), str(number), f"{number} {name}".lower())
        if number
        else (name.lower(), code.lower())
        for name, number, code in called
    ]


def _texts(rows: Bytes, first: int, last: int) -> list[str]:
    width = last - first + 1
    text = rows[:, first - 1 : last].tobytes().decode("latin-1")
    return [text[i : i + width].strip() for i in range(0, len(text), width)]


def _stripped(columns: Bytes) -> NDArray[np.bytes_]:
    return np.char.strip(np.ascontiguousarray(columns).view(f"S{columns.shape[1]}").ravel())


def _taken(values: Any, places: NDArray[np.int64]) -> Any:
    return [values[i] for i in places.tolist()] if isinstance(values, list) else values[places]
