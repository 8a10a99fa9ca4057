"""Reader of answers of JPL's Small-Body Database: JSON from its Query and Lookup APIs, and CSV from its query tool.

Sources: https://ssd-api.jpl.nasa.gov/doc/sbdb_query.html and https://ssd-api.jpl.nasa.gov/doc/sbdb.html

The elements are heliocentric, in the ecliptic and equinox of J2000, osculating at an epoch in TDB, in au and degrees.
"""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, BinaryIO

from orbits.catalogue.catalogue import Catalogue
from orbits.catalogue.orbit_columns import Columns
from orbits.catalogue.selection import Selection
from orbits.catalogue.sources import opened, short, whole
from orbits.catalogue.table import catalogue_of_tables
from orbits.catalogue.unreadable import Unreadable
from orbits.errors import InputError

WHAT = "an answer of JPL's Small-Body Database, JSON or CSV"
MOST_JSON_BYTES = 2**29
MOST_ROWS_AT_ONCE = 50_000
LONGEST_ROW = 2**17


def read_sbdb(
    source: Any,
    count: int | None = None,
    *,
    names: str | Iterable[str] | None = None,
    numbers: int | Iterable[int] | None = None,
    classes: str | Iterable[str] | None = None,
    brighter_than: float | None = None,
    errors: str = "raise",
) -> Catalogue:
    """Return the asteroids and comets in an answer of JPL's Small-Body Database, in its order.

        orbits.read_sbdb("sbdb_query_results.csv")
        orbits.read_sbdb(requests.get("https://ssd-api.jpl.nasa.gov/sbdb.api?sstr=Eros&full-prec=1").json())

    source : a path, plain or gzipped; the text itself; or JSON already parsed into dicts and lists
    count, names, numbers, classes, brighter_than, errors : as for `read_mpcorb`

    Recognised columns, ignoring case: full_name, name, pdes or des; epoch (JD) or epoch_mjd; e, with a, q, n or per; i,
    om, w; ma, or tp (JD) or tp_mjd; H, GM (km^3/s^2), diameter (km), class. `.details` has the others as text. If q and
    tp are given, orbits with e > 0.9 are made from them, whatever the conic, and all others from a and ma. Ask for full
    precision, of JSON and of CSV: fewer than six digits cause an OrbitsWarning.

    Raises InputError, with the row and its name, for anything that is not such an answer or not an orbit, and
    UnknownNameError for names and numbers that are not found.
    """
    selection = Selection(count, names, numbers, classes, brighter_than)
    if isinstance(source, Mapping):
        unreadable = Unreadable(errors, "the answer given")
        return catalogue_of_tables(_of_json(source, unreadable.name), selection, unreadable, WHAT)
    with opened(source, WHAT) as (stream, name):
        unreadable = Unreadable(errors, name)
        return catalogue_of_tables(_pieces(stream, name), selection, unreadable, WHAT)


def _pieces(stream: BinaryIO, name: str) -> Iterator[Columns]:
    """Yield the columns of an answer: all rows at once for JSON, some thousand at a time for CSV."""
    start = stream.read(4096)
    stream.seek(0)
    if start.removeprefix(b"\xef\xbb\xbf").lstrip()[:1] in (b"{", b"["):
        text = whole(stream, name, MOST_JSON_BYTES)
        try:
            # Numbers are kept as text, so that no digit of a Julian date is lost.
            answer = json.loads(text, parse_float=str, parse_int=str)
        except (ValueError, RecursionError) as error:  # ValueError: bad JSON, or a bad encoding
            raise InputError(f"{name} is not valid JSON ({short(str(error))}); expected {WHAT}") from error
        yield from _of_json(answer, name)
    else:
        yield from _of_csv(stream, name)


def _of_csv(stream: BinaryIO, name: str) -> Iterator[Columns]:
    text = io.TextIOWrapper(stream, encoding="utf-8-sig", errors="replace", newline="")
    rows = csv.reader(_lines(text, name))
    try:
        header = next((row for row in rows if any(cell.strip() for cell in row)), [])
        columns = Columns(header, 1, name)
        for row in rows:
            if not any(cell.strip() for cell in row):
                continue
            if len(columns.rows) == MOST_ROWS_AT_ONCE:
                yield columns
                columns = Columns(header, columns.first + MOST_ROWS_AT_ONCE, name)
            columns.rows.append(row)
    except csv.Error as error:
        raise InputError(f"{name}, line {rows.line_num}: not valid CSV ({error}); expected {WHAT}") from error
    yield columns
    text.detach()


def _lines(text: io.TextIOWrapper, name: str) -> Iterator[str]:
    """Yield lines. Raises InputError for one that is too long."""
    while line := text.readline(LONGEST_ROW):
        if len(line) >= LONGEST_ROW:
            raise InputError(f"{name} has a line of more than {LONGEST_ROW} characters; expected {WHAT}")
        yield line


def _of_json(answer: Any, name: str) -> Iterator[Columns]:
    if not isinstance(answer, Mapping):
        raise InputError(f"{name} is a JSON {type(answer).__name__}; expected {WHAT}")
    if isinstance(answer.get("orbit"), Mapping):
        yield _of_lookup(answer, name)
        return
    fields, data = answer.get("fields"), answer.get("data")
    if isinstance(fields, Sequence) and _is_list(fields) and _is_list(data):
        columns = Columns(fields, 1, name)
        columns.rows += _list(data)
        yield columns
        return
    said = answer.get("message") or answer.get("moreInfo")
    matches = [short(str(m.get("pdes") or m.get("name"))) for m in _list(answer.get("list")) if isinstance(m, Mapping)]
    what = f"says {short(str(said))!r}" if said else f"has the keys {short(', '.join(map(str, answer)) or 'none')}"
    several = f". It lists {', '.join(matches[:5])}: ask for one of them" if matches else ""
    raise InputError(
        f"{name} {what}{several}; expected 'fields' and 'data' as from the Query API, or 'object' and 'orbit' as from "
        "the Lookup API"
    )


def _of_lookup(answer: Mapping[str, Any], name: str) -> Columns:
    """Return the answer of the Lookup API, one body, as a table of a single row."""
    about, orbit = answer.get("object"), answer["orbit"]
    values: dict[str, Any] = {"epoch": orbit.get("epoch")}
    for element in [*_list(orbit.get("elements")), *_list(answer.get("phys_par"))]:
        if isinstance(element, Mapping) and isinstance(element.get("name"), str):
            values.setdefault(element["name"], element.get("value"))
    if isinstance(about, Mapping):
        kind = about.get("orbit_class")
        values["full_name"] = about.get("fullname") or about.get("des")
        values["spkid"] = about.get("spkid")
        values["class"] = kind.get("code") if isinstance(kind, Mapping) else None
    values["condition_code"] = orbit.get("condition_code")
    columns = Columns(list(values), 1, name)
    columns.rows.append(list(values.values()))
    return columns


def _is_list(value: Any) -> bool:
    return isinstance(value, Sequence) and not isinstance(value, str | bytes)


def _list(value: Any) -> Sequence[Any]:
    return value if _is_list(value) else ()
