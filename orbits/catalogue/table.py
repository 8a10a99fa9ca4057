"""A catalogue from tables of orbits that are read piece by piece."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from orbits.body_names import LONGEST_NAME
from orbits.catalogue.catalogue import Catalogue, choose, joined
from orbits.catalogue.classes import orbit_classes
from orbits.catalogue.names import is_comet, parts, plain
from orbits.catalogue.orbit_columns import Columns, Orbits
from orbits.catalogue.selection import Selection, Ways
from orbits.catalogue.unreadable import Unreadable
from orbits.errors import InputError
from orbits.finding import Finding

AU_KM = 149597870.7
SECONDS_A_DAY = 86400.0
FEW_DIGITS = 6


def catalogue_of_tables(
    pieces: Iterable[Columns], selection: Selection, unreadable: Unreadable, what: str
) -> Catalogue:
    """Return the selected rows of tables of orbits. Raises InputError if there are no orbits in them."""
    pieces_read: list[dict[str, Any]] = []
    called: list[Ways] = []
    read = digits = 0
    for columns in pieces:
        orbits = Orbits(columns)
        piece, ways, good = _piece(columns, orbits, selection, unreadable)
        digits = max(digits, orbits.digits())
        read += good
        pieces_read.append(piece)
        called += ways
        if selection.is_complete:
            break
    if not read and not unreadable.count:
        raise InputError(f"{unreadable.name} has no row with an orbit; expected {what}")
    unreadable.close(read)
    selection.check_found(f"the {read} bodies of {unreadable.name}")
    if 0 < digits < FEW_DIGITS:
        Finding(
            f"{unreadable.name} gives the sizes of orbits with {digits} digits at most: positions are uncertain by "
            f"{10.0 ** (1 - digits):g} of the distance. Ask for full precision: full-prec=1 in the APIs, a tick box in "
            "the query tool"
        ).warn()
    table = joined(pieces_read, unreadable.name, unreadable.count)
    order = selection.ordered(table.numbers, called)
    return choose(
        table, {}, rows=order, count=selection.count, names=None, numbers=None, classes=None, brighter_than=None
    )


def _piece(
    columns: Columns, orbits: Orbits, selection: Selection, unreadable: Unreadable
) -> tuple[dict[str, Any], list[Ways], int]:
    """Return the columns of a piece's selected bodies, the forms of their names, and how many rows could be read."""
    full = (
        orbits.texts("name")
        if "name" in columns.place
        else [f"row {columns.first + i}" for i in range(len(columns.rows))]
    )
    known = [parts(name) for name in full]
    for i, (_, name, _) in enumerate(known):
        if not orbits.problems[i] and not 0 < len(name) <= LONGEST_NAME:
            orbits.problems[i] = f"the name has {len(name)} characters; expected 1 to {LONGEST_NAME}"
    for i, problem in enumerate(orbits.problems):
        if problem:
            unreadable.bad(f"row {columns.first + i}" + (f" ({full[i]})" if full[i] else ""), problem)
    good = np.array([i for i, problem in enumerate(orbits.problems) if not problem], dtype=np.int64)
    values: dict[str, Any] = {what: value[good] for what, value in orbits.values.items()}
    names = [known[i][1] for i in good.tolist()]
    numbers = [known[i][0] for i in good.tolist()]
    comets = np.array([is_comet(name) for name in names], dtype=bool)
    derived = orbit_classes(values["a"], values["e"], comets)
    given = orbits.texts("class")
    values["classes"] = [given[i] or derived[k] for k, i in enumerate(good.tolist())]
    values["numbers"] = np.array(numbers, dtype=np.int64)
    ways = [
        tuple(dict.fromkeys(plain(way) for way in (name, full[i], known[i][2], *_numbered(number, name)) if way))
        for i, name, number in zip(good.tolist(), names, numbers, strict=True)
    ]
    keep = selection.rows(values, ways)
    rows = good[keep]
    piece = {
        what: values[what][keep] for what in ("a", "e", "inc", "Omega", "omega", "M", "epoch", "H", "q", "T", "numbers")
    }
    piece["by_perihelion"] = orbits.by_perihelion[rows]
    piece["gm"] = np.nan_to_num(values["gm"][keep]) * (SECONDS_A_DAY**2 / AU_KM**3)
    piece["radius"] = np.nan_to_num(values["diameter"][keep]) * (0.5 / AU_KM)
    piece["names"] = [names[k] for k in keep.tolist()]
    piece["classes"] = [values["classes"][k] for k in keep.tolist()]
    piece["details"] = {name: column[rows] for name, column in orbits.others().items()}
    return piece, [ways[k] for k in keep.tolist()], len(good)


def _numbered(number: int, name: str) -> tuple[str, ...]:
    return (str(number), f"{number} {name}") if number else ()
