"""What a notebook shows: small tables, whatever the names and however many bodies."""

from __future__ import annotations

import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

import orbits
from orbits.certificate.certificate import Certificate, Finding
from orbits.kernels.search.record import COLUMNS, DISTANCE2, PARTNER, SPEED2, TIME
from orbits.marching.clocks.constant import ConstantSteps
from orbits.marching.legs.record import Record
from orbits.regression.report import Report, Row
from orbits.results.approaches import Approaches
from orbits.results.passages import Seen
from orbits.scenarios import StudyResult, Table

from ..coverings import each

NASTY = "<script>alert('&\"')</script>"


class Texts(HTMLParser):
    """The texts of the cells, and every tag."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.texts: list[str] = []
        self.open: list[str] = []
        self.feed(html)
        self.close()
        assert not self.open

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.open.append(tag)
        assert {name for name, _ in attrs} <= {"style", "colspan"}

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.texts.append(data)


def system(bodies: int = 3) -> orbits.System:
    names = [NASTY, *(f"body {i}" for i in range(1, bodies))]
    q, v = np.random.default_rng(4).normal(size=(2, bodies, 3))
    return orbits.System(names, np.arange(bodies, 0, -1.0), q, v, units=orbits.DIMENSIONLESS)


def run() -> orbits.Trajectory:
    start = system()
    q, v = (np.array([x, x]) for x in start.values[1:3])
    return orbits.Trajectory(start, [0, 1], q, v, step=1.0, integrator=orbits.Gauss(stages=2), path=NASTY)


def met(bodies: int = 3) -> Approaches:
    """Neighbours on a line that pass at 1, 2, 3, ...; nothing is near the first body."""
    start = system(bodies)
    closest = np.full((4, 2, bodies), np.inf)
    closest[TIME, 1, 1:] = np.arange(1, bodies)
    closest[[DISTANCE2, SPEED2], 1, 1:] = np.arange(1, bodies) ** 2
    closest[PARTNER] = np.arange(bodies) - 1.0
    clock = ConstantSteps(1.0)
    seen = Seen(start, Record(closest, np.empty((0, COLUMNS)), 0, -1, np.zeros(bodies), bodies), clock)
    # There is no orbit to make them better by.
    return Approaches(start, clock, seen, refine=lambda numbers: None, error_at_end=lambda k: None)


def certificate() -> Certificate:
    finding = Finding("symplectic", 3.0, 64.0, "ulps", False, True, True)
    return Certificate(NASTY, "Gauss(stages=2)", 0.5, "d", (finding,))


def report() -> Report:
    row = Row(NASTY, "ours", "FAIL", steps=7, energy=1e-15, worst_body=NASTY, failures=(NASTY,))
    return Report((row,), np.arange(2.0), "d", "km", ("a",), ("a",), NASTY, None, {"title": NASTY}, (NASTY,))


def catalogue() -> orbits.ephemeris.Catalogue:
    return replace(orbits.asteroids(1), names=(NASTY,))


def study() -> StudyResult:
    table = Table(NASTY, ["method", "error", "steps"], [["gauss", 1.23456e-9, 12345], ["verlet", None, 7]])
    return orbits.scenarios.StudyResult(tables=(table, table))


VALUES = [
    system,
    lambda: system().elements("body 1"),
    run,
    lambda: run().elements("body 1"),
    met,
    certificate,
    report,
    catalogue,
    lambda: system()[0],
    study,
]
KINDS = [
    "system", "elements", "run", "elements of a run", "approaches", "certificate", "report", "catalogue", "body",
    "study",
]  # fmt: skip


@each("make", VALUES)
def test_names_are_escaped_and_every_tag_is_closed(make):
    html = make()._repr_html_()
    seen = Texts(html)
    assert set(seen.tags) <= {"table", "caption", "tbody", "tr", "th", "td", "p"}
    assert any(NASTY in text for text in seen.texts)
    assert "<script" not in html


def test_tables_of_a_study_show_the_figures_that_print_shows():
    seen = Texts(study()._repr_html_())
    assert seen.tags.count("table") == 2
    assert {"gauss", "1.23e-09", "12,345"} <= set(seen.texts)


def test_a_thousand_bodies_make_no_larger_table_than_twenty():
    seen = Texts(system(1000)._repr_html_())
    assert seen.tags.count("tr") == 22
    assert seen.texts[-1] == "... and 980 more"
    assert Texts(system(20)._repr_html_()).tags.count("tr") == 21
    assert Texts(orbits.asteroids(1000)._repr_html_()).texts[-1] == "... and 980 more"
    assert Texts(system(1000).elements("body 1")._repr_html_()).texts[-1] == "... and 979 more"
    assert Texts(met(1001)._repr_html_()).texts[-1] == "... and 980 more"


def test_of_a_thousand_passages_the_closest_are_printed():
    caption, head, first, *_, last = str(met(1001)).split("\n")
    assert caption == repr(met(1001))
    assert head.split() == ["body", "passes", "distance", "time", "speed", "off", "at", "the", "end"]
    assert first.split()[-3:] == ["1", "1", "1"]
    assert last == "... and 980 more"
    assert len(str(met(1001)).split("\n")) == 23
    assert max(map(len, str(met(1001)).split("\n"))) < 120


def test_elements_of_a_run_are_printed_as_the_range_of_each_body():
    solar = orbits.System.solar_system("2022-08-09", bodies=["Sun", "Jupiter", "Saturn"])
    found = orbits.propagate(solar, orbits.Gauss(stages=4), dt=20, duration=4000).elements("Sun")
    caption, head, jupiter, saturn = repr(found).split("\n")
    assert caption.endswith("lowest ... highest of 101 samples, t = 0 ... 4000 d")
    assert head.split() == ["body", "a", "[AU]", "e", "inc", "[deg]"]
    a = found["Saturn"].a.value
    assert saturn.startswith(f"Saturn   {a.min():.6g} ... {a.max():.6g}")
    assert repr(found["Jupiter"]).split("\n")[2].split() == jupiter.split()
    assert f"{a.min():.6g} ... {a.max():.6g}" in Texts(found._repr_html_()).texts


def test_elements_of_no_samples_say_so():
    start = system()
    empty = orbits.Trajectory(
        start, np.empty(0), np.empty((0, 3, 3)), np.empty((0, 3, 3)), step=1.0, integrator=orbits.Gauss(stages=2)
    )
    assert repr(empty.elements("body 1")).endswith("0 samples, no samples yet")
    assert repr(empty["body 1"]) == "BodyTrajectory(body 1, 0 samples, no samples yet)"


@pytest.mark.parametrize("make", [system, run, lambda: run()["body 1"], met, certificate, report])
def test_repr_is_one_line_of_words(make):
    text = repr(make())
    assert re.fullmatch(r"(System|Trajectory|BodyTrajectory|Approaches|Certificate|Report)\(.*\)", text)
    assert len(text) < 300


def test_a_table_shows_the_figures_of_each_body_with_units():
    solar = orbits.System.solar_system(bodies=["Sun", "Jupiter"])
    seen = Texts(solar._repr_html_())
    assert "x [AU]" in seen.texts
    assert f"{solar.values.q[1, 0]:.6g}" in seen.texts


def test_a_run_shows_whether_its_certificate_holds():
    shown = run()
    shown.certificate = certificate()
    assert any("symplectic: 3.00 ulps" in text for text in Texts(shown._repr_html_()).texts)


@pytest.mark.parametrize("bodies", [3, [3], ["Vulcan"], "Vulcan"])
def test_a_run_cannot_be_drawn_for_what_names_no_body(bodies):
    with pytest.raises(orbits.errors.InputError, match=r"expected a s|Vulcan"):
        run().plot(bodies=bodies)


def test_drift_is_a_table_with_the_figures_that_print_has():
    drift = run().drift()
    seen = Texts(drift._repr_html_())
    assert seen.tags.count("tr") == 5
    assert {"energy", "centre of mass", "max change"} <= set(seen.texts)
    assert f"{drift.energy.max_fraction:.2e}" in seen.texts
    assert repr(drift) == str(drift)


def test_a_body_is_a_table():
    seen = Texts(system()[NASTY]._repr_html_())
    assert {NASTY, "gm", "q", "v"} <= set(seen.texts)


@pytest.mark.parametrize("make", [system, run, met, lambda: system().elements("body 1")])
def test_keys_are_completed_with_the_names_that_can_be_asked_for(make):
    value = make()
    names = value._ipython_key_completions_()
    assert NASTY in names
    for name in names:
        assert value[name] is not None


@pytest.mark.parametrize("make", [system, run])
def test_a_figure_shows_itself_where_no_pyplot_has_been_imported(make):
    png, size = make().plot()._repr_png_()
    assert png.startswith(b"\x89PNG")
    assert set(size) == {"width", "height"}
    assert 300 < size["height"] <= size["width"] < 1100
