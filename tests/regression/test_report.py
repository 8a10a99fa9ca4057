"""A report says what was measured: a table that fits, JSON that any reader takes, a picture of the right size."""

from __future__ import annotations

import json
import struct
from dataclasses import replace
from io import StringIO

import numpy as np
import pytest
from rich.console import Console

from orbits.errors import InputError
from orbits.json_text import json_text
from orbits.regression.report import Row, Series
from orbits.regression.report_picture import picture

from .reports import NINE, TIMES, make

MANY = [*NINE, *(f"{i} Asteroid of some length" for i in range(1, 301))]


@pytest.mark.parametrize(("names", "massive"), [(NINE, NINE), (MANY, NINE), (MANY, MANY)])
def test_the_table_fits_into_100_columns_and_names_every_method(names, massive):
    text = make(names, massive).table
    assert max(len(line) for line in text.splitlines()) <= 100
    for part in ("Gauss(stages=8)", "corrector17", "1,234,567", "A remark.", "own error 2.0e-04 km", "outweighs"):
        assert part in text
    assert str(make(names, massive)) == text


def test_the_table_of_methods_fits_into_80_columns_with_whole_names():
    console = Console(width=80, file=StringIO())
    console.print(make(NINE, NINE))
    lines = console.file.getvalue().splitlines()
    assert max(map(len, lines)) <= 80
    assert any(line.startswith(" Gauss(stages=8) ") for line in lines)
    assert any(line.split()[:2] == ["REBOUND", "whfast"] for line in lines)


@pytest.mark.parametrize("count", [7, 8, 20])
def test_the_errors_of_many_methods_are_all_in_the_table_and_their_names_are_whole(count):
    names = [f"REBOUND saba:type=h_8_6_{k}" for k in range(count)]
    rows = [Row(name, "peer", "peer", positions={"Sun": 100.0 + k, "Ceres": 1.0}) for k, name in enumerate(names)]
    lines = make(["Sun", "Ceres"], ["Sun", "Ceres"], rows=rows).table.splitlines()
    assert max(map(len, lines)) <= 100
    shown = [x for line in lines if line.startswith(" Sun ") for x in line.split()[1:]]
    assert shown == [*(f"{100 + k}" for k in range(count)), "2.0e-04"]  # the reference comes last
    heads = [x for line in lines for x in line.split() if x.startswith("h_8")]
    assert heads == [f"h_8_6_{k}" for k in range(count)]  # in narrower columns words are broken anywhere


def test_brackets_in_a_title_are_part_of_it():
    named = make(NINE, NINE)
    named.settings["title"] = "Nine bodies [all of them] [/]"
    assert named.table.splitlines()[0] == "Nine bodies [all of them] [/]"


def test_many_bodies_are_summed_up_and_few_are_listed():
    few, many = make(NINE, NINE).table, make(MANY, NINE).table
    assert "Planet 4" in few
    assert "Planet 4" in many
    assert "300 massless particles" in many
    assert "99th percentile" in many
    assert "300 Asteroid of some length" in many  # the worst of them, by name
    assert "17 Asteroid" not in many


def test_a_failure_of_ours_spoils_the_verdict_and_a_peer_cannot():
    failed = Row("Verlet", "ours", "FAIL", failures=("max |dE/E| = 1.00e-03 exceeds 1.00e-12",))
    missing = Row("REBOUND ias15", "peer", "n/a", note="it failed.")
    good = Row("Gauss", "ours", "ok")
    report = make(NINE, NINE, rows=(good, failed, missing))
    assert not report.ok
    assert report.failures == ("Verlet: max |dE/E| = 1.00e-03 exceeds 1.00e-12",)
    assert "exceeds 1.00e-12" in report.table
    assert make(NINE, NINE, rows=(good, missing)).ok


def test_json_is_strict_and_holds_every_number(tmp_path):
    report = make(MANY, NINE)
    path = tmp_path / "report.json"
    assert report.to_json(path).strip() == path.read_text().strip()
    record = json.loads(path.read_text(), parse_constant=lambda x: pytest.fail(f"{x} is not JSON"))
    assert record["ok"] is True
    ours = record["rows"][0]
    assert ours["positions"]["Planet 8"] == 2.25
    assert ours["energy"] == 1e-15
    assert ours["series"]["position"] == report.rows[0].series.position.tolist()
    assert ours["particles"]["name"] == "300 Asteroid of some length"
    assert record["version"] == 2  # of version 1 the key was "yardstick"
    assert record["reference"]["error"] == 2e-4
    with pytest.raises(AttributeError, match="it is called reference now"):
        _ = report.yardstick
    assert len(record["times"]) == 11


def test_numbers_that_are_not_finite_become_null():
    row = Row("Euler", "ours", "FAIL", energy=float("inf"), position=float("nan"), failures=("energy",))
    record = json.loads(make(NINE, NINE, rows=(row,)).to_json())
    assert record["rows"][0]["energy"] is None
    assert record["rows"][0]["position"] is None


def test_lists_of_numbers_stand_on_one_line_each_and_text_is_left_alone():
    tricky = {
        "times": [0.0, -1e-300, None, True],
        "rows": [[1, 2], [3, "[\n1,\n2]"], []],
        "words": ["[", "]", "a b"],
        "mapping": {"x": [1], "y": {}},
    }
    text = json_text(tricky)
    assert json.loads(text) == tricky
    assert ' "times": [0.0, -1e-300, null, true],\n' in text
    assert "  [1, 2],\n" in text
    assert '\n  "[",\n' in text
    report = make(NINE, NINE)
    assert report.to_json().count("\n") < 120
    assert json.loads(report.to_json())["times"] == TIMES.tolist()


def test_a_note_that_names_its_method_is_not_headed_by_it_once_more():
    notes = ("dt = 6 d is too long for ExplicitEuler(): shorter.", "REBOUND ias15: it failed.", "it needs a Sun.")
    methods = ("ExplicitEuler()", "REBOUND ias15", "REBOUND whfast")
    rows = tuple(Row(method, "peer", "n/a", note=note) for method, note in zip(methods, notes, strict=True))
    lines = make(NINE, NINE, rows=rows).table.splitlines()[-3:]
    assert lines == [*notes[:2], "REBOUND whfast: it needs a Sun."]


def size(picture):
    return struct.unpack(">II", picture.read_bytes()[16:24])


@pytest.mark.nightly
@pytest.mark.parametrize("length_unit", ["km", ""])
def test_the_picture_is_1600_by_1000(tmp_path, length_unit):
    report = make(NINE, NINE, length_unit=length_unit)
    assert size(report.plot(tmp_path / "report.png")) == (1600, 1000)
    with pytest.raises(InputError, match="cannot write"):
        report.plot(tmp_path / "no such folder" / "report.png")


def test_a_picture_without_anything_measured_is_still_a_picture(tmp_path):
    row = Row("Gauss", "ours", "not judged", series=Series(*(np.full(11, np.nan) for _ in range(3))))
    assert size(make(NINE, NINE, rows=(row,)).plot(tmp_path / "report.png")) == (1600, 1000)


def test_a_single_sample_is_a_mark_in_the_picture():
    row = Row("Gauss", "ours", "ok", series=Series(*(np.array([0.0, 1e-9]) for _ in range(3))))
    made = picture(replace(make(NINE, NINE, rows=(row,)), times=np.array([0.0, 100.0])))
    marks = [line.get_markevery() for panel in made.axes for line in panel.lines if line.get_marker() == "o"]
    assert marks == [None, None, None]  # a fraction of the length of a line, of which a point has none, draws no mark


@pytest.mark.parametrize(
    ("massive", "whose"), [(9, ""), (2, " of the massive bodies"), (1, " of the worst massless body")]
)
def test_the_picture_says_whose_energy_and_angular_momentum_it_shows(massive, whose):
    # A single massive body has neither: those of each massless one about it are compared, and the worst is shown.
    titles = [panel.get_title("left") for panel in picture(make(NINE, NINE[:massive])).axes]
    assert titles[1:] == [f"energy{whose}, |ΔE/E|", f"angular momentum{whose}, |ΔL|/|L|"]


def test_an_unwritable_path_is_refused_in_words(tmp_path):
    report = make(NINE, NINE)
    with pytest.raises(InputError, match="cannot write"):
        report.to_json(tmp_path / "no such folder" / "report.png")
    with pytest.raises(InputError, match="cannot write"):
        report.plot(tmp_path / "report.unknown-format")
