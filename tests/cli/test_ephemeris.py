"""`orbits ephemeris`: what an observer sees of the bodies of an archive."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

import orbits
from orbits.cli import app
from orbits.scenario.ephemerides import typed_times

from ..coverings import each


@pytest.fixture(scope="module")
def archive(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("sky") / "run.h5"
    system = orbits.System.solar_system("2026-01-01", bodies=["Sun", "Earth", "Moon", "Mars"])
    orbits.propagate(system, duration="10 d", samples=3, archive=path).close()
    return path


def typed(archive: Path, *options: str) -> Result:
    return CliRunner().invoke(app, ["ephemeris", str(archive), *options])


def test_a_span_of_times_is_printed_in_utc_for_each_body(archive):
    span = ["--from", "2026-01-02", "--to", "2026-01-05", "--step", "1 d"]
    found = typed(archive, "--body", "mars", "--body", "Moon", *span, "--utc")
    assert found.exit_code == 0
    lines = [line for line in found.stdout.splitlines() if line.startswith("2026-01-0")]
    first = ["2026-01-02", "00:00:00"]
    assert [line.split()[:3] for line in lines[:2]] == [[*first, "Mars"], [*first, "Moon"]]
    assert len(lines) == 8
    assert "date (UTC) " in found.stdout
    assert found.stdout.startswith("Mars, Moon as seen from the geocentre; 4 times; ")


@each(("first", "last"), [("2022-07-01", "2022-07-05"), ("2016-12-30", "2017-01-03")])
def test_days_of_utc_are_even_and_the_last_is_among_them(first, last):
    """TDB - UTC falls by 30 µs in the first span, whose end was missing, and a leap second is in the other."""
    system = orbits.System.solar_system(first, bodies=["Sun", "Mars"])
    run = orbits.propagate(system, duration="6 d", samples=2)
    dates = typed_times(run, first, last, "1 d", utc=True)
    assert (len(dates), dates.isot[-1]) == (5, f"{last}T00:00:00.000")
    assert {date[11:] for date in dates.isot} == {"00:00:00.000"}


def test_on_a_day_with_a_leap_second_the_clock_on_the_wall_counts():
    system = orbits.System.solar_system("2016-12-30", bodies=["Sun", "Mars"])
    run = orbits.propagate(system, duration="6 d", samples=2)
    dates = typed_times(run, "2016-12-31T06:00", "2016-12-31T07:00", "20 min", utc=True)
    assert [date[11:] for date in dates.isot] == ["06:00:00.000", "06:20:00.000", "06:40:00.000", "07:00:00.000"]
    dates = typed_times(run, "2016-12-31T12:00", "2017-01-02T12:00", "1 d", utc=True)
    assert {date[11:] for date in dates.isot} == {"12:00:00.000"}
    assert len(dates) == 3


def test_json_has_the_figures_of_the_ephemeris(archive):
    found = json.loads(typed(archive, "--observer=-70.7366,-30.2407,2663", "--body", "Mars", "--json").stdout)
    run = orbits.Trajectory.open(archive)
    place = "70.73660° W, 30.24070° S, 2663 m"
    assert (found["observer"], found["time_scale"], found["units"]["distance"]) == (place, "tdb", "AU")
    assert [row["time"] for row in found["rows"]] == [0.0, 5.0, 10.0]
    assert "V" not in found["units"]
    one = typed(archive, "--body", "Mars", "--from", "5", "--h", "-1.5", "--g", "0.15", "--json")
    (row,) = json.loads(one.stdout)["rows"]
    seen = run.ephemeris("Mars", times=5.0, H=-1.5, G=0.15)
    assert (row["ra"], row["V"], row["elongation"]) == (seen.ra.value[0], seen.V.value[0], seen.elongation.value[0])


def test_a_run_without_units_is_not_seen(tmp_path):
    pair = orbits.System(["a", "b"], [1, 1], [[0, 0, 0], [1, 0, 0]], [[0, 0, 0], [0, 1, 0]], units=orbits.DIMENSIONLESS)
    orbits.propagate(pair, duration=0.1, samples=2, archive=tmp_path / "run.h5").close()
    found = typed(tmp_path / "run.h5", "--from", "0", "--utc")
    assert found.exit_code == 2
    assert "needs physical units and an epoch" in " ".join(found.stderr.split())


@each(
    ("options", "message"),
    [
        (["--to", "2026-01-05"], "--to and --step need --from"),
        (["--from", "2026-01-05", "--to", "2026-01-06"], "--to needs --step, such as --step '1 d'"),
        (["--from", "2026-01-05", "--step", "1 d"], "--step needs --to; --from alone is a single time"),
        (["--from", "2026-01-05", "--to", "2026-01-03", "--step", "1 d"], "is before --from"),
        (["--from", "1", "--to", "2", "--step", "0"], "--step = '0'; expected a time above 0"),
        (["--from", "1", "--to", "9", "--step", "1 s"], "691,201 times from --from to --to; at most 100,000"),
        (["--from", "1", "--to", "9", "--step", "1 km"], "--step is in km; expected time"),
        (["--from", "yesterday"], "--from = 'yesterday'; expected a quantity"),
        (["--from", "2027-01-01"], "= 365 lies outside the run, 0 ... 10 d (2026-01-01 00:00 ... 2026-01-11"),
        (["--observer", "1,95"], "--observer = '1,95'; expected a name, or a place on the Earth"),
        (["--observer", "568,20"], "--observer = '568,20'; expected a name, or a place on the Earth"),
        (["--observer", "Palomar"], "there is no observer 'Palomar'"),
        (["--body", "Vesta"], "there is no body 'Vesta'"),
        (["--body", "Mars", "--h", "3"], "H is given without G"),
    ],
)
def test_what_cannot_be_meant_is_refused_with_exit_code_2(archive, options, message):
    found = typed(archive, *options)
    assert found.exit_code == 2
    assert message in " ".join(found.stderr.split())
