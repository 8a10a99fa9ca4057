"""Orbits from a table with JPL's column names; missing elements are derived where possible."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbits.catalogue.catalogue import Floats, passage
from orbits.catalogue.sources import short
from orbits.errors import InputError, shown

# The name of a column here, and its names in the database, ignoring case; the first that is present is used.
ALIASES = {
    "name": ("full_name", "fullname", "name", "pdes", "des", "spkid"),
    "epoch": ("epoch_mjd", "epoch.mjd", "epoch"),
    "a": ("a",),
    "e": ("e",),
    "q": ("q",),
    "inc": ("i",),
    "Omega": ("om", "node"),
    "omega": ("w", "peri"),
    "M": ("ma", "m"),
    "T": ("tp_mjd", "tp.mjd", "tp"),
    "n": ("n",),
    "P": ("per", "period"),
    "H": ("h",),
    "gm": ("gm",),
    "diameter": ("diameter",),
    "class": ("class",),
}
TEXTS = ("name", "class")
MOMENTS = ("epoch", "T")
NUMBERS = tuple(ours for ours in ALIASES if ours not in (*TEXTS, *MOMENTS))
MOST_COLUMNS = 1000

# Above this eccentricity q and tp are used: a and the mean anomaly would lose digits of the path near the Sun.
BY_PERIHELION = 0.9

MJD_OF_JD_2400000 = -0.5
# Times above this are Julian dates: as an MJD it is the year 4596, as a Julian date 1975 BC.
SMALLEST_JD = 1e6
MJD_RANGE = (-2400000.5, 2973484.0)
JULIAN_DATE = re.compile(r"(\d{1,8})(?:\.(\d*))?")


class Columns:
    """A piece of a table as read: the names of its columns, and rows of text, numbers and None."""

    def __init__(self, header: Sequence[Any], first: int, source: str) -> None:
        self.header = [str(cell).strip() for cell in header[: MOST_COLUMNS + 1]]
        self.first = first
        self.rows: list[Any] = []
        self.place = {ours: place for ours in ALIASES if (place := self._place(ours)) is not None}
        missing = [what for what, ways in _NEEDED.items() if not any(way <= self.place.keys() for way in ways)]
        if missing or len(self.header) > MOST_COLUMNS:
            raise InputError(
                f"{source} has the columns {short(', '.join(self.header)) or 'none'}; expected as of JPL's Small-Body "
                f"Database {'at most 1,000, with ' if len(self.header) > MOST_COLUMNS else ''}"
                f"{', '.join(missing or _NEEDED)}"
            )

    def _place(self, ours: str) -> int | None:
        for alias in ALIASES[ours]:
            # In old answers Q is the aphelion distance, so the case of q matters.
            same = [
                i for i, cell in enumerate(self.header) if cell == alias or (alias != "q" and cell.lower() == alias)
            ]
            if same:
                return min(same, key=lambda i: self.header[i] != alias)
        return None

    def called(self, ours: str) -> str:
        """Return the table's own name of a column."""
        return self.header[self.place[ours]]


_NEEDED: dict[str, tuple[set[str], ...]] = {
    "epoch or epoch_mjd": ({"epoch"},),
    "e (or a and q)": ({"e"}, {"a", "q"}),
    "a, q, n or per": ({"a"}, {"q"}, {"n"}, {"P"}),
    "i": ({"inc"},),
    "om": ({"Omega"},),
    "w": ({"omega"},),
    "ma or tp": ({"M"}, {"T"}),
}


class Orbits:
    """The orbits of a piece of a table, arrays of shape (n,), and the problem of each row, or ""."""

    def __init__(self, columns: Columns) -> None:
        n = len(columns.rows)
        self._columns = columns
        self.problems = [""] * n
        width = len(columns.header)
        blank = [None] * width
        rows = []
        for i, row in enumerate(columns.rows):
            whole = isinstance(row, list | tuple) and len(row) == width
            if not whole:
                got = f"{len(row)} values" if isinstance(row, list | tuple) else f"a {type(row).__name__}"
                self.problems[i] = f"holds {got}; expected {width}, one for each column"
            rows.append(row if whole else blank)
        self._cells = list(zip(*rows, strict=True)) if rows else [()] * width
        self.values: dict[str, Floats] = {}
        for what in NUMBERS:
            self.values[what] = self._numbers(what, _number, "a number")
        for what in MOMENTS:
            self.values[what] = self._numbers(what, _moment, "a Julian date, or MJD")
        for what in ("inc", "Omega", "omega", "M"):
            self.values[what] = np.radians(self.values[what])
        self.by_perihelion = np.zeros(n, dtype=bool)
        with np.errstate(all="ignore"):  # values that are not finite are found below
            self._derive()
            self._check()

    def texts(self, ours: str) -> list[str]:
        """Return the cells of a column as text, on one line; empty if there is no such column."""
        if ours not in self._columns.place:
            return [""] * len(self.problems)
        return [_text(value) for value in self._cells[self._columns.place[ours]]]

    def others(self) -> dict[str, NDArray[np.str_]]:
        """Return the remaining columns as text."""
        used = set(self._columns.place.values())
        return {
            name: np.array([_text(value)[:64] for value in self._cells[i]], dtype=str)
            for i, name in enumerate(self._columns.header)
            if i not in used
        }

    def digits(self) -> int:
        """Return the largest number of significant digits of the sizes; 0 if there are none."""
        texts = [_text(value) for what in ("a", "q", "n", "P") for value in self._given(what)]
        return max((len(re.sub(r"[eE].*|[^0-9]", "", text).lstrip("0")) for text in texts), default=0)

    def _given(self, ours: str) -> Sequence[Any]:
        place = self._columns.place.get(ours)
        return () if place is None else self._cells[place]

    def _numbers(self, ours: str, read: Any, expected: str) -> Floats:
        values = np.full(len(self.problems), np.nan)
        for i, given in enumerate(self._given(ours)):
            try:
                values[i] = read(given)
            except (TypeError, ValueError, OverflowError):
                self._wrong(i, f"{self._columns.called(ours)} is {short(repr(given), 40)}; expected {expected}")
        return values

    def _wrong(self, row: int, problem: str) -> None:
        self.problems[row] = self.problems[row] or problem

    def _derive(self) -> None:
        from orbits.units import GM_SUN

        v = self.values
        epoch, a, e, q, M, T = (v[what] for what in ("epoch", "a", "e", "q", "M", "T"))
        e = np.where(np.isnan(e), 1.0 - q / a, e)
        motion = np.where(np.isnan(v["n"]), 2.0 * np.pi / v["P"], np.radians(v["n"]))
        placed, sized = np.isfinite(T), np.isfinite(a)
        given = placed & np.isfinite(q)
        shape = 1.0 - e
        a = np.where(sized, a, np.where(np.isnan(q), np.sign(shape) * np.cbrt(GM_SUN / motion**2), q / shape))
        a = np.where(e == 1.0, np.inf, a)
        q = np.where(np.isnan(q), a * shape, q)
        mean = np.sqrt(GM_SUN / np.abs(a)) / np.abs(a) * (epoch - T)
        mean = np.where(e < 1.0, np.remainder(mean, 2.0 * np.pi), mean)
        anomaly = np.isfinite(M) & (e != 1.0)
        self.by_perihelion = placed & (~anomaly | (given & (e > BY_PERIHELION)))
        M = np.where(anomaly, M, np.where(e == 1.0, np.nan, mean))
        T = np.where(placed, T, epoch - passage(a, M))
        v |= {"a": a, "e": e, "q": q, "M": M, "T": T}

    def _check(self) -> None:
        v = self.values
        a, e, q = v["a"], v["e"], v["q"]
        self._refuse("epoch", np.isnan(v["epoch"]), "is missing; expected the epoch of the elements")
        outside = (v["epoch"] < MJD_RANGE[0]) | (v["epoch"] > MJD_RANGE[1])
        self._refuse("epoch", outside, "is MJD {}; expected a date in the years -4712 to 9999")
        self._refuse("e", ~(e >= 0.0) | np.isinf(e), "is {}; expected a finite eccentricity >= 0")
        for what in ("inc", "Omega", "omega"):
            degrees = "0 to 180" if what == "inc" else "-360 to 360"
            wrong = ~(np.abs(v[what]) <= 2.0 * np.pi) if what != "inc" else ~((v[what] >= 0.0) & (v[what] <= np.pi))
            self._refuse(what, wrong, f"is {{}} rad; expected {degrees} degrees")
        self._refuse("M", (e == 1.0) & np.isnan(v["T"]), "cannot place a parabola; expected tp")
        self._refuse(
            "a", np.isnan(a) | ((1.0 - e) * a < 0.0), "is {}; expected > 0 for an ellipse, < 0 for a hyperbola"
        )
        self._refuse("q", ~((q > 0.0) & np.isfinite(q)), "is {}; expected a perihelion distance > 0")
        # Values of three digits may differ by this much; mixed-up columns do not agree at all.
        apart = np.isfinite(a) & (np.abs(q - a * (1.0 - e)) > 0.01 * (np.abs(q) + np.abs(a)))
        self._refuse("q", apart, "is {}, which contradicts a and e; expected a (1 - e)")
        self._refuse("M", np.isnan(v["M"]) & np.isnan(v["T"]), "is missing; expected ma, or tp")
        wide = np.isinf(v["M"]) | ((e < 1.0) & (np.abs(v["M"]) > 2.0 * np.pi)) | np.isinf(v["T"])
        self._refuse("M", wide, "is {} rad; expected -360 to 360 degrees")
        for what in ("gm", "diameter"):
            self._refuse(what, (v[what] < 0.0) | np.isinf(v[what]), "is {}; expected a finite value >= 0")
        self._refuse("H", np.isinf(v["H"]), "is {}; expected a finite magnitude")

    def _refuse(self, what: str, wrong: NDArray[np.bool_], problem: str) -> None:
        for i in np.flatnonzero(wrong).tolist():
            name = self._columns.called(what) if what in self._columns.place else what
            self._wrong(i, f"{name} {problem.format(f'{self.values[what][i]:.9g}')}")


def _text(value: Any) -> str:
    if value is None:
        return ""
    return short(value if isinstance(value, str) else repr(value), 200)


def _number(value: Any) -> float:
    """Return a number, nan for None and blanks. Raises ValueError or TypeError for anything else."""
    if value is None or (isinstance(value, str) and not value.strip()):
        return math.nan
    if isinstance(value, bool) or not isinstance(value, str | int | float):
        raise TypeError(f"{shown(value)} is not a number")
    return float(value)


def _moment(value: Any) -> float:
    """Return a time as MJD, with all digits of a Julian date given as text."""
    number = _number(value)
    if not abs(number) >= SMALLEST_JD:
        return number
    if isinstance(value, str) and (match := JULIAN_DATE.fullmatch(value.strip())):
        days, fraction = match.groups()
        return (int(days) - 2400000) + MJD_OF_JD_2400000 + float(f"0.{fraction or 0}")
    return number - 2400000.5
