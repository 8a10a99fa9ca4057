"""The Catalogue: heliocentric elements of many small bodies as arrays, and the selection of bodies from it."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from orbits.catalogue.classes import CLASSES, GROUPS
from orbits.catalogue.names import is_comet, plain
from orbits.checks import is_whole, place_in
from orbits.errors import InputError, OutOfRangeError, UnknownNameError, shown

Floats = NDArray[np.float64]

# Above all numbers of bodies, and well within int64.
MOST_NUMBER = 10**15

# The default of fields that are computed from others.
UNKNOWN: Any = None


@dataclass(frozen=True, eq=False, repr=False)
class Catalogue:
    """Osculating heliocentric elements of asteroids and comets, one row each; arrays of shape (n,), read-only.

    names : the name, "Ceres", or for bodies without one the provisional designation, "2000 SN209"
    numbers : int64; 0 for a body without a number
    a : semi-major axis, au; negative for a hyperbola, inf for a parabola;  e : eccentricity
    inc, Omega, omega, M : inclination, node, argument of perihelion, mean anomaly at the epoch, radians
    epoch : MJD, TDB
    H : absolute magnitude, nan if unknown
    classes : codes of the Small-Body Database, see `CLASSES`
    frame : the frame of the angles, "ecliptic" for the ecliptic and equinox of J2000
    q : perihelion distance, au;  T : time of perihelion passage, MJD, TDB
    by_perihelion : bool; True where the source gave q and T and the orbit is made from them; a and M are derived
    gm : GM, au^3/d^2;  radius : au; 0 if unknown
    details : the other columns of the source, by name
    skipped : number of entries of the source that were left out because they could not be read
    source : where it was read from, for messages

    catalogue[:100] and catalogue[catalogue.a > 3] are catalogues too; catalogue["Ceres"] has a single row.
    """

    names: tuple[str, ...]
    numbers: NDArray[np.int64]
    a: Floats
    e: Floats
    inc: Floats
    Omega: Floats
    omega: Floats
    M: Floats
    epoch: Floats
    H: Floats
    classes: tuple[str, ...]
    frame: str = "ecliptic"
    q: Floats = UNKNOWN
    T: Floats = UNKNOWN
    by_perihelion: NDArray[np.bool_] = UNKNOWN
    gm: Floats = UNKNOWN
    radius: Floats = UNKNOWN
    details: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    skipped: int = 0
    source: str = "the catalogue"

    def __post_init__(self) -> None:
        n = len(self.names)
        unknown = {"by_perihelion": np.zeros(n, dtype=bool), "gm": np.zeros(n), "radius": np.zeros(n)}
        if self.q is UNKNOWN:
            unknown["q"] = self.a * (1.0 - self.e)
        if self.T is UNKNOWN:
            unknown["T"] = self.epoch - passage(self.a, self.M)
        for what, value in unknown.items():
            if getattr(self, what) is UNKNOWN:
                object.__setattr__(self, what, value)
        for array in (*(getattr(self, what) for what in ARRAYS), *self.details.values()):
            array.flags.writeable = False

    def __len__(self) -> int:
        return len(self.names)

    def __getitem__(self, key: str | int | slice | Sequence[int] | NDArray[np.int64] | NDArray[np.bool_]) -> Self:
        """Return the rows selected by name, index, slice, mask or array of indices, in the order given."""
        if isinstance(key, str):
            return self[[row_of_name(key, {plain(name): row for row, name in enumerate(self.names)}, self)]]
        expected = "a name, an index, a slice, a mask or an array of indices"
        if not isinstance(key, slice) and not np.iterable(key):
            key = [place_in(len(self), key, "catalogue", "bodies", expected)]
        try:
            rows = np.atleast_1d(np.arange(len(self))[key])
            if rows.ndim > 1:
                raise ValueError(f"rows of shape {rows.shape}")
        except (IndexError, TypeError, ValueError) as error:
            raise OutOfRangeError(f"catalogue[{shown(key)}]: {error}; expected {expected}.") from None
        return replace(
            self,
            names=tuple(self.names[row] for row in rows),
            classes=tuple(self.classes[row] for row in rows),
            details={name: column[rows] for name, column in self.details.items()},
            **{what: getattr(self, what)[rows] for what in ARRAYS},
        )

    def __repr__(self) -> str:
        if not len(self):
            return "Catalogue of 0 asteroids"
        shown = ", ".join(self.names[:4]) + (", ..." if len(self) > 4 else "")
        epochs = [f"{epoch:.9g}" for epoch in np.unique(self.epoch)]
        when = " and ".join(epochs) if len(epochs) < 4 else f"{epochs[0]} ... {epochs[-1]}"
        H = self.H[np.isfinite(self.H)]
        brightness = f"H {H.min():g} ... {H.max():g}; " if len(H) else ""
        comets = sum(is_comet(name) for name in self.names)
        many = "s" * (len(self) != 1)
        kind = f"asteroid{many}" if not comets else f"comet{many}" if comets == len(self) else "asteroids and comets"
        return (
            f"Catalogue of {len(self)} {kind}: {shown}\n  {self._kinds()}; "
            f"a {self.a.min():.3f} ... {self.a.max():.3f} au, e up to {self.e.max():.3f}, {brightness}"
            f"{self.frame} of J2000, epoch MJD {when} TDB"
        )

    def _repr_html_(self) -> str:
        from orbits.export import MOST_ROWS, html_table

        head = ("body", "a [au]", "e", "inc [deg]", "Omega [deg]", "omega [deg]", "M [deg]", "epoch [MJD]", "H")
        angles = np.degrees([self.inc, self.Omega, self.omega, self.M])
        columns = (self.a, self.e, *angles, self.epoch, self.H)
        rows = [
            [name, *(f"{float(column[i]):.9g}" if column is self.epoch else f"{column[i]:.6g}" for column in columns)]
            for i, name in enumerate(self.names[:MOST_ROWS])
        ]
        return html_table(repr(self), head, rows, len(self) - len(rows))

    def _kinds(self) -> str:
        trojans = self.classes.count("TJN")
        belt = sum(self.classes.count(code) for code in GROUPS["belt"])
        others = len(self) - trojans - belt
        return f"{belt} in the belt, {trojans} Trojans" + (f", {others} elsewhere" if others else "")


ARRAYS = tuple(
    f.name for f in fields(Catalogue) if f.name not in ("names", "classes", "frame", "details", "skipped", "source")
)


def passage(a: Floats, M: Floats) -> Floats:
    """Return the days since the nearest perihelion passage; a in au, M in radians; nan for a parabola."""
    from orbits.units import GM_SUN

    nearest = np.where(a > 0.0, np.remainder(M + np.pi, 2.0 * np.pi) - np.pi, M)
    with np.errstate(invalid="ignore", over="ignore"):
        return np.asarray(nearest * np.abs(a) * np.sqrt(np.abs(a) / GM_SUN))


def choose(
    table: Catalogue,
    rows_by_name: Mapping[str, int],
    *,
    rows: list[int],
    count: int | None,
    names: str | Iterable[str] | None,
    numbers: int | Iterable[int] | None,
    classes: str | Iterable[str] | None,
    brighter_than: float | None,
) -> Catalogue:
    """Return the selected rows of a table, from `rows` unless names or numbers are given; see `asteroids`."""
    if names is not None or numbers is not None:
        chosen = [row_of_name(name, rows_by_name, table) for name in checked_strings(names, "names")]
        chosen += [_row_of_number(number, table) for number in checked_numbers(numbers)]
        rows = list(dict.fromkeys(chosen))
    wanted = checked_classes(classes)
    if wanted is not None:
        rows = [row for row in rows if table.classes[row] in wanted]
    limit = checked_magnitude(brighter_than)
    if limit is not None:
        rows = [row for row in rows if table.H[row] < limit]
    if checked_count(count) is not None:
        if count > len(rows):  # type: ignore[operator]
            raise InputError(
                f"count = {shown(count)}, but there are only {len(rows)} such asteroids in {table.source}. Ask for "
                "fewer, or leave out count to get them all"
            )
        rows = sorted(rows, key=lambda row: _faintness(float(table.H[row])))[:count]
    return table if len(rows) == len(table) and rows == list(range(len(rows))) else table[rows]


def joined(pieces: list[dict[str, Any]], source: str, skipped: int) -> Catalogue:
    """Return the catalogue whose columns are given in pieces, dicts of lists, arrays and dicts, which are emptied."""
    whole: dict[str, Any] = {}
    for what, first in list(pieces[0].items()):
        parts = [piece.pop(what) for piece in pieces]
        if isinstance(first, list):
            whole[what] = tuple(value for part in parts for value in part)
        elif isinstance(first, dict):
            whole[what] = {name: np.concatenate([part[name] for part in parts]) for name in first}
        else:
            whole[what] = np.concatenate(parts)
    return Catalogue(**whole, skipped=skipped, source=source)


def checked_count(count: Any) -> int | None:
    """Return a whole number of asteroids, or None. Raises InputError for anything else."""
    if count is None:
        return None
    if not is_whole(count) or count < 1:
        raise InputError(f"count = {shown(count)}; expected a whole number of asteroids, 1 or more")
    return int(count)


def checked_magnitude(brighter_than: Any) -> float | None:
    """Return an absolute magnitude, or None. Raises InputError for anything else."""
    if brighter_than is None:
        return None
    number = isinstance(brighter_than, int | float | np.integer | np.floating)
    number = number and not isinstance(brighter_than, bool | np.timedelta64)
    if not number or not abs(brighter_than) < math.inf:
        raise InputError(f"brighter_than = {shown(brighter_than)}; expected an absolute magnitude, such as 10.5")
    return float(min(max(brighter_than, -MOST_NUMBER), MOST_NUMBER))


def checked_strings(given: Any, what: str) -> list[str]:
    """Return one or several strings as a list, empty for None. Raises InputError for anything else."""
    if given is None:
        return []
    values = _listed(given)
    for value in values:
        if not isinstance(value, str):
            example = "'belt'" if what == "classes" else "'Ceres' (numbers= takes numbers)"
            raise InputError(f"{what} contains {shown(value)}; expected strings such as {example}")
    return values


def checked_numbers(numbers: Any) -> list[int]:
    """Return one or several numbers of asteroids as a list, empty for None. Raises InputError for anything else."""
    if numbers is None:
        return []
    values = _listed(numbers)
    for number in values:
        if not is_whole(number):
            raise InputError(
                f"numbers contains {shown(number)}; expected whole numbers such as 1 for Ceres (names= takes names)"
            )
        if abs(int(number)) > MOST_NUMBER:
            raise InputError("numbers contains one above 10^15; expected numbers of asteroids, such as 1 for Ceres")
    return [int(number) for number in values]


def _listed(given: Any) -> list[Any]:
    """Return an iterable as a list, and a text or anything else as a list of one."""
    if isinstance(given, str):
        return [given]
    try:
        return list(given)
    except TypeError:  # includes arrays without dimensions, which only look iterable
        return [given]


def checked_classes(classes: Any) -> set[str] | None:
    """Return the codes of the Small-Body Database that classes and groups mean, or None."""
    return None if classes is None else {code for name in checked_strings(classes, "classes") for code in _codes(name)}


def _codes(name: str) -> tuple[str, ...]:
    # JFC and JFc are two classes: an exact match comes first, then one ignoring case.
    found = [code for code in CLASSES if code == name] or [code for code in CLASSES if code.upper() == name.upper()]
    found = found or list(GROUPS.get(name.lower(), ()))
    if found:
        return tuple(found)
    raise UnknownNameError(
        f"there is no class {shown(name)} of asteroids here; expected {', '.join(map(repr, GROUPS))} or one of "
        + ", ".join(f"{code} ({meaning})" for code, meaning in CLASSES.items())
    )


def row_of_name(name: str, rows: Mapping[str, int], table: Catalogue) -> int:
    """Return rows[name], ignoring case. Raises UnknownNameError, with close matches."""
    key = plain(name)
    if key in rows:
        return rows[key]
    close = dict.fromkeys(table.names[rows[k]] for k in difflib.get_close_matches(key, rows, n=3, cutoff=0.7))
    meant = f"; did you mean {' or '.join(map(repr, close))}?" if close else "."
    raise UnknownNameError(
        f"there is no asteroid {shown(name)} here{meant} Expected a name or designation of one of these {len(table)}, "
        f"{table.source}"
    )


def _row_of_number(number: int, table: Catalogue) -> int:
    found = np.flatnonzero((table.numbers == number) & (table.numbers > 0))
    if len(found):
        return int(found[0])
    known = np.sort(table.numbers[table.numbers > 0])
    close = np.sort(known[np.argsort(np.abs(known - number), kind="stable")[:3]])
    nearest = f"; the closest are {', '.join(map(str, close))}" if len(close) else ""
    raise UnknownNameError(
        f"there is no asteroid with number {number} here{nearest}. Expected the number of one of these {len(table)}, "
        f"{table.source}"
    )


def _faintness(H: float) -> float:
    return math.inf if math.isnan(H) else H
