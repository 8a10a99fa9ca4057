"""Answers of JPL's Small-Body Database: three forms, every conic, what is missing derived, what is bad named."""

from __future__ import annotations

import csv
import gzip
import io
import json
import math
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from astropy import units as u
from hypothesis import strategies as st

import orbits
from orbits.catalogue import asteroids, read_sbdb
from orbits.ephemeris import AU_KM
from orbits.errors import InputError, OrbitsError, OrbitsWarning, UnknownNameError
from orbits.units import GM_SUN
from tests.campaigns import campaign

from ..coverings import each

FIELDS = ["spkid", "full_name", "epoch", "e", "a", "q", "i", "om", "w", "ma", "tp", "H", "GM", "diameter", "class"]
# Elements of the bundled catalogue, at MJD 59800; GM and diameters as the database gives them.
CERES = [20000001, "     1 Ceres (A801 AA)", "2459800.5", ".07863575691875528", "2.766619044655007", None,
         "10.58679512153367", "80.2664361119415", "73.53162522557164", "334.3271698971151", None, "3.33", "62.6284",
         "939.4", "MBA"]  # fmt: skip
BORISOV = [1003639, "       C/2019 Q4 (Borisov)", "2458853.5", "3.3565", "-.85149", "2.00652", "44.0526", "308.1477",
           "209.1236", None, "2458826.052844906059", None, None, None, "HYP"]  # fmt: skip
LOOKUP = {
    "signature": {"source": "NASA/JPL Small-Body Database (SBDB) API", "version": "1.3"},
    "object": {"fullname": "433 Eros (A898 PA)", "des": "433", "spkid": "20000433", "kind": "an",
               "orbit_class": {"code": "AMO", "name": "Amor"}},
    "orbit": {
        "epoch": "2461000.5", "equinox": "J2000", "condition_code": "0",
        "elements": [
            {"name": name, "value": value, "label": name, "units": None, "sigma": "1e-9"}
            for name, value in {
                "e": ".2228359407071628", "a": "1.458120998474684", "q": "1.13319923411471", "i": "10.82846651399785",
                "om": "304.2701025753316", "w": "178.9297536744151", "ma": "310.5543277370992",
                "tp": "2461088.831287055552", "per": "643.1151986547032", "n": ".5597752949286", "ad": "1.7830427",
            }.items()
        ],
    },
    "phys_par": [{"name": "GM", "value": "4.463e-04"}, {"name": "diameter", "value": "16.84"},
                 {"name": "H", "value": "10.39"}, {"name": "extent", "value": "34.4x11.2x11.2"}],
}  # fmt: skip


def query(*rows: list[Any], fields: list[str] = FIELDS) -> dict[str, Any]:
    return {"signature": {"version": "1.0"}, "fields": fields, "count": len(rows), "data": [list(row) for row in rows]}


def as_csv(*rows: list[Any], fields: list[str] = FIELDS) -> str:
    out = io.StringIO()
    csv.writer(out).writerows([fields, *rows])
    return out.getvalue()


@pytest.mark.parametrize("form", ["dict", "json", "csv", "file", "zipped"])
def test_all_forms_of_an_answer_give_the_same_catalogue(form: str, tmp_path: Path) -> None:
    path = tmp_path / "answer"
    source: Any = query(CERES, BORISOV)
    if form in ("json", "file"):
        source = json.dumps(source)
    if form in ("csv", "zipped"):
        source = "\ufeff" + as_csv(CERES, BORISOV)
    if form in ("file", "zipped"):
        path.write_bytes(gzip.compress(source.encode()) if form == "zipped" else source.encode())
        source = path
    both = read_sbdb(source)
    assert both.names == ("Ceres", "C/2019 Q4")
    assert both.numbers.tolist() == [1, 0]
    assert both.classes == ("MBA", "HYP")
    assert both.epoch.tolist() == [59800.0, 58853.0]
    assert both.by_perihelion.tolist() == [False, True]
    assert both.a[0] == 2.766619044655007
    assert both.q[1] == 2.00652
    # Eleven digits behind the day are more than a Julian date has as one float64.
    assert both.T[1] == 58825.552844906059
    assert both.M[0] == math.radians(334.3271698971151)
    assert both.gm[0] == pytest.approx(62.6284 * 86400.0**2 / AU_KM**3, rel=1e-15)
    assert both.radius[0] == pytest.approx(939.4 / 2 / AU_KM, rel=1e-15)
    assert both.gm[1] == both.radius[1] == 0.0
    assert both.details["spkid"].tolist() == ["20000001", "1003639"]


def test_the_bundled_asteroids_come_back_through_the_readers_own_columns() -> None:
    every = asteroids()
    rows = [
        [f"{number or ''} {name}", epoch, *map(repr, values)]
        for number, name, epoch, *values in zip(
            every.numbers.tolist(), every.names, every.epoch.tolist(), every.e.tolist(), every.a.tolist(),
            *(np.degrees(getattr(every, what)).tolist() for what in ("inc", "Omega", "omega", "M")), every.H.tolist(),
            strict=True)
    ]  # fmt: skip
    read = read_sbdb(as_csv(*rows, fields=["full_name", "epoch_mjd", "e", "a", "i", "om", "w", "ma", "H"]))
    assert read.names == every.names
    assert read.classes == every.classes  # they follow from the elements
    assert np.array_equal(read.a, every.a)
    assert np.array_equal(read.e, every.e)
    # Degrees and back: the last bits.
    assert np.abs(read.M - every.M).max() < 2e-15


def test_a_lookup_is_a_table_of_one_body() -> None:
    for source in (LOOKUP, json.dumps(LOOKUP)):
        eros = read_sbdb(source)
        assert (eros.names, eros.numbers.tolist(), eros.classes) == (("Eros",), [433], ("AMO",))
        assert (eros.epoch[0], eros.a[0], eros.H[0]) == (61000.0, 1.458120998474684, 10.39)
        assert eros.T[0] == 61088.331287055552
        assert eros.gm[0] == pytest.approx(4.463e-4 * 86400.0**2 / AU_KM**3, rel=1e-15)


def test_mean_anomaly_and_perihelion_of_one_answer_agree() -> None:
    by_anomaly = read_sbdb(LOOKUP)
    elements = [x for x in LOOKUP["orbit"]["elements"] if x["name"] != "ma"]  # type: ignore[index]
    by_passage = read_sbdb({**LOOKUP, "orbit": {**LOOKUP["orbit"], "elements": elements}})  # type: ignore[dict-item]
    assert (by_anomaly.by_perihelion[0], by_passage.by_perihelion[0]) == (False, True)
    # JPL's ma and tp agree to the last digits of n: a difference of GM in its 9th digit would show.
    assert by_passage.M[0] == pytest.approx(by_anomaly.M[0], rel=1e-10)


@pytest.mark.parametrize("drop", [("a",), ("q",), ("a", "q"), ("e",), ("a", "q", "per"), ("a", "q", "n"), ("ma",)])
def test_what_is_missing_is_derived(drop: tuple[str, ...]) -> None:
    elements = [x for x in LOOKUP["orbit"]["elements"] if x["name"] not in drop]  # type: ignore[index]
    full = read_sbdb(LOOKUP)
    eros = read_sbdb({**LOOKUP, "orbit": {**LOOKUP["orbit"], "elements": elements}})  # type: ignore[dict-item]
    for what in ("a", "e", "q", "M", "T"):
        # n of eleven digits, q of sixteen where e is 1 - q/a.
        assert getattr(eros, what)[0] == pytest.approx(getattr(full, what)[0], rel=1e-9)


@each("e", [0.2, 0.95, 0.9999999, 1.0, 1.0000001, 1.5, 40.0])
@each("days", [-400.0, 0.0, 33.0])
def test_comets_of_every_conic_are_where_their_perihelion_puts_them(e: float, days: float) -> None:
    row = ["C/2000 A1 (Test)", 59800.0 + days, e, 0.7, 30.0, 40.0, 50.0, 59800.0]
    comet = query(row, fields=["full_name", "epoch_mjd", "e", "q", "i", "om", "w", "tp_mjd"])
    with pytest.warns(OrbitsWarning, match="with 1 digits at most"):
        system = orbits.System.from_catalogue(orbits.read_sbdb(comet), bodies=["Sun"])
    q, v = system.q[1].to_value("au") - system.q[0].to_value("au"), system.v[1].to_value("au/d")
    r, speed = np.linalg.norm(q), np.linalg.norm(v - system.v[0].to_value("au/d"))
    # Energy and angular momentum of the orbit, at the last bits; the passage by going back to it.
    assert 0.5 * speed**2 - GM_SUN / r == pytest.approx(-0.5 * GM_SUN * (1 - e) / 0.7, abs=1e-14 * GM_SUN / 0.7)
    assert np.linalg.norm(np.cross(q, v)) == pytest.approx(math.sqrt(GM_SUN * 0.7 * (1 + e)), rel=2e-14)
    back, _ = orbits.elements.two_body(q, v, GM_SUN, -days)
    assert np.linalg.norm(back) == pytest.approx(0.7, rel=1e-12)


def test_one_call_makes_a_system_with_masses_where_they_are_known() -> None:
    light = orbits.System.from_catalogue(orbits.read_sbdb(query(CERES)))
    assert not light.massive[-1]
    assert light.radii[-1].to_value("km") == pytest.approx(469.7)
    heavy = orbits.System.from_catalogue(orbits.read_sbdb(query(CERES)), massive=True)
    assert heavy.gm[-1].to_value(u.km**3 / u.s**2) == pytest.approx(62.6284, rel=1e-14)
    assert np.abs(heavy.centre_of_mass().to_value("au")).max() < 1e-15
    bundled = orbits.System.from_catalogue(orbits.asteroids(names="Ceres"))
    # The same digits in another file, two conversions of units further.
    assert np.linalg.norm((light.q[-1] - bundled.q[-1]).to_value("au")) < 1e-14
    with pytest.raises(InputError, match="no GM is known for Ceres; expected a catalogue with GM"):
        orbits.System.from_catalogue(orbits.asteroids(names="Ceres"), massive=True)
    with pytest.raises(orbits.errors.EpochError, match="2 epochs"):
        orbits.System.from_catalogue(orbits.read_sbdb(query(CERES, BORISOV)))
    found = orbits.read_sbdb(query(CERES, BORISOV))
    both = orbits.System.from_catalogue(found, propagate_to_epoch=True, epoch="2022-08-09")
    assert both.names[-1] == "C/2019 Q4"


@pytest.mark.parametrize(
    ("chosen", "names"),
    [
        ({"names": ["borisov", "Ceres"]}, ("C/2019 Q4", "Ceres")),
        ({"names": "A801 AA"}, ("Ceres",)),
        ({"numbers": 1}, ("Ceres",)),
        ({"classes": "comet"}, ("C/2019 Q4",)),
        ({"brighter_than": 5}, ("Ceres",)),
        ({"count": 1}, ("Ceres",)),
    ],
)
def test_choosing_goes_as_for_the_bundled_asteroids(chosen: dict[str, Any], names: tuple[str, ...]) -> None:
    assert read_sbdb(query(BORISOV, CERES), **chosen).names == names
    with pytest.raises(UnknownNameError, match="'Vesta': not among the 2 bodies"):
        read_sbdb(query(BORISOV, CERES), names="Vesta")


@each(
    ("field", "value", "message"),
    [
        ("e", "x", r"row 1 \(1 Ceres \(A801 AA\)\): e is 'x'; expected a number"),
        ("e", None, "e is nan; expected a finite eccentricity"),
        ("e", -0.1, "e is -0.1; expected a finite eccentricity >= 0"),
        ("e", True, "e is True; expected a number"),
        ("e", 1.5, "a is 2.766"),
        ("e", 1.0, "cannot place a parabola"),
        ("a", "-2.7", "a is -2.7"),
        ("a", "nan", "a is nan; expected > 0"),
        ("a", [1], r"a is \[1\]; expected a number"),
        ("q", "1.3", "q is 1.3, which contradicts a and e"),
        ("i", "190", "i is 3.3161"),
        ("om", "1e3", "om is 17.45"),
        ("w", "inf", "w is inf"),
        ("ma", None, "ma is missing; expected ma, or tp"),
        ("epoch", None, "epoch is missing"),
        ("epoch", "9e9", r"epoch is MJD 8.9976e\+09; expected a date in the years"),
        ("epoch", "2022-08-09", "epoch is '2022-08-09'; expected a Julian date"),
        ("GM", "-1", "GM is -1"),
        ("H", "inf", "H is inf"),
        ("full_name", "", "the name has 0 characters"),
        ("full_name", "x" * 150, "the name has 150 characters"),
    ],
)
def test_a_bad_row_is_named_or_left_out_aloud(field: str, value: Any, message: str) -> None:
    bad = list(CERES)
    bad[FIELDS.index(field)] = value
    with pytest.raises(InputError, match=message):
        read_sbdb(query(bad))
    with pytest.warns(OrbitsWarning, match="1 of 2 entries cannot be read and were left out: row 1"):
        rest = read_sbdb(query(bad, BORISOV), errors="skip")
    assert (rest.names, rest.skipped) == (("C/2019 Q4",), 1)


@each(
    ("source", "message"),
    [
        ({"message": "specified object was not found", "code": "200"}, "says 'specified object was not found'"),
        ({"message": "several", "list": [{"pdes": "1P"}, {"pdes": "2P"}]}, "It lists 1P, 2P: ask for one of them"),
        ({}, "has the keys none"),
        (query(), "no row with an orbit"),
        (query([1, 2]), "holds 2 values; expected 15"),
        ({**query(), "data": ["hello"]}, "holds a str; expected 15"),
        ({"fields": ["full_name", "e"], "data": []}, "has the columns full_name, e; expected"),
        ({"fields": "e", "data": []}, "has the keys fields, data"),
        ({"fields": [{}] * 2000, "data": []}, "expected as of JPL's Small-Body Database at most 1,000"),
        ({"orbit": {"elements": 3}}, "has the columns epoch"),
        ('{"fields": [', "not valid JSON"),
        ("[" * 100_000 + "\n", "not valid JSON"),
        ('{"a":' * 100_000, "not valid JSON"),
        ("\n[1, 2]", "JSON list"),
        ("a,b\n1,2\n", "has the columns a, b; expected"),
        ("\n\n", "has the columns none"),
        (b"\xff\xfe\x00", "has the columns"),
        ("x" * 300_000 + "\n", "a line of more than 131072 characters"),
        (3, "the source is a int"),
        ("nowhere.csv", "No such file"),
    ],
)
def test_what_is_no_answer_is_refused(source: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        read_sbdb(source)


def test_json_that_is_too_large_is_refused_before_it_is_parsed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("orbits.catalogue.sbdb.MOST_JSON_BYTES", 2**20)
    with pytest.raises(InputError, match="has more than 1 MB unpacked"):
        read_sbdb(gzip.compress(b"{" + b" " * 2**21))


def test_elements_of_few_digits_bring_a_warning() -> None:
    short = [
        cell[:5] if isinstance(cell, str) and name in "ea" else cell for name, cell in zip(FIELDS, CERES, strict=True)
    ]
    with pytest.warns(OrbitsWarning, match="with 4 digits at most: .* full-prec=1"):
        read_sbdb(query(short))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        read_sbdb(query(CERES))


def test_rows_in_pieces_are_rows_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    text = as_csv(*[[*CERES[:1], f"{i} Body{i}", *CERES[2:]] for i in range(1, 50)])
    whole = read_sbdb(text)
    monkeypatch.setattr("orbits.catalogue.sbdb.MOST_ROWS_AT_ONCE", 7)
    pieces = read_sbdb(text)
    assert pieces.names == whole.names
    assert np.array_equal(pieces.a, whole.a)
    with pytest.raises(InputError, match=r"row 50 \(bad\): holds 15|row 50: holds 1 values"):
        read_sbdb(text + "bad\n")


junk = st.one_of(
    st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=8), st.lists(st.integers(), max_size=2),
    st.dictionaries(st.text(max_size=2), st.integers(), max_size=2), st.sampled_from(["1e999", "-0", "nan", "٣"]),
)  # fmt: skip


@campaign(
    80,
    1500,
    cells=st.lists(st.tuples(st.integers(0, len(FIELDS) - 1), junk), max_size=4),
    header=st.lists(st.tuples(st.integers(0, len(FIELDS) - 1), junk), max_size=1),
    errors=st.sampled_from(["raise", "skip"]),
)
def test_any_cell_gives_a_catalogue_or_an_error_in_words(cells: list[Any], header: list[Any], errors: str) -> None:
    row, fields = list(CERES), list(FIELDS)
    for place, value in cells:
        row[place] = value
    for place, value in header:
        fields[place] = value
    check_read(query(row, BORISOV, fields=fields), errors)
    check_read(as_csv(row, BORISOV, fields=[str(field) for field in fields]), errors)


@campaign(80, 1500, answer=st.recursive(junk, lambda x: st.lists(x) | st.dictionaries(
    st.sampled_from(["fields", "data", "object", "orbit", "elements", "name", "value", "epoch", "list", "message"]), x
), max_leaves=12), errors=st.just("skip"))  # fmt: skip
def test_any_json_gives_a_catalogue_or_an_error_in_words(answer: Any, errors: str) -> None:
    check_read(answer if isinstance(answer, dict) else {"orbit": answer, "fields": answer, "data": answer}, errors)
    check_read(json.dumps(answer).encode(), errors)


@campaign(
    80,
    1500,
    kind=st.sampled_from(["json", "csv", "lookup", "zipped"]),
    changes=st.lists(st.tuples(st.integers(0, 5000), st.integers(0, 255)), max_size=4),
    keep=st.integers(0, 3000),
)
def test_flipped_bytes_and_truncation_give_a_catalogue_or_an_error_in_words(
    kind: str, changes: list[tuple[int, int]], keep: int
) -> None:
    text = {"csv": as_csv(CERES, BORISOV), "lookup": json.dumps(LOOKUP)}.get(kind, json.dumps(query(CERES, BORISOV)))
    data = bytearray(gzip.compress(text.encode(), mtime=0) if kind == "zipped" else text.encode())
    for place, value in changes:
        data[place % len(data)] = value
    check_read(bytes(data[:keep]), "skip")


@campaign(60, 1500, data=st.binary(max_size=300))
def test_random_bytes_give_a_catalogue_or_an_error_in_words(data: bytes) -> None:
    check_read(data, "raise")


def check_read(source: Any, errors: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", OrbitsWarning)
        try:
            catalogue = read_sbdb(source, errors=errors)
        except OrbitsError:
            return
    for what in ("e", "inc", "Omega", "omega", "q", "epoch", "gm", "radius"):
        assert np.isfinite(getattr(catalogue, what)).all()
    assert (np.isfinite(catalogue.M) | np.isfinite(catalogue.T)).all()
    assert all(0 < len(name) <= 128 and name.isprintable() for name in catalogue.names)
