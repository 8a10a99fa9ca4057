"""Runs beyond the years that calendars have: states, tables and archives show Julian years."""

import warnings

import numpy as np
import pytest
from astropy import units as u
from astropy.time import Time

import orbits
from orbits.units import as_epoch, date_text


@pytest.fixture(scope="module")
def long_run(tmp_path_factory):
    """Sun, Jupiter and Saturn for 20,000 years."""
    start = orbits.System.solar_system(bodies=["Sun", "Jupiter", "Saturn"])
    path = tmp_path_factory.mktemp("far") / "run.h5"
    return orbits.propagate(
        start, "wisdom-holman", dt="100 d", duration="20000 yr", samples=5, archive=path, progress=False
    )


def test_states_after_ad_9999_are_given_with_julian_years(long_run):
    last = long_run[-1]
    assert "epoch J22000.0" in repr(last)
    assert last.epoch.jyear == pytest.approx(22000.0, abs=1e-3)
    assert "J21000" in repr(long_run.at(19000 * u.yr))
    assert long_run.epochs[-1].jyear == pytest.approx(22000.0, abs=1e-3)
    assert last.to_table().meta["epoch"].startswith("J22000")


def test_a_run_goes_on_from_there_through_an_archive(long_run, tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # astropy's of dubious years
        again = orbits.propagate(
            long_run[-1], "wisdom-holman", dt="100 d", duration="1000 yr", samples=3, archive=tmp_path / "on.h5",
            progress=False, approaches=True,
        )  # fmt: skip
        opened = orbits.Trajectory.open(again.path)
        assert opened.system.epoch == long_run[-1].epoch
        assert "J23000.0" in repr(opened[-1])
        assert repr(opened.closest_approaches())


def test_events_and_approaches_there_have_dates(long_run):
    found = orbits.propagate(
        long_run[-1], duration=15 * u.yr, events=orbits.events.Pericentre("Jupiter", "Sun"), samples=3, progress=False
    )
    assert "J22" in str(found.events)
    assert np.all(found.events.to_table()["date"].jyear > 22000.0)
    assert str(found.events.to_table())


def test_dates_in_calendars_are_written_as_before_and_far_ones_are_only_taken_from_astropy():
    assert date_text(Time("2022-08-09 12:00", scale="tdb"), 16) == "2022-08-09 12:00"
    assert date_text(Time("2022-08-09", scale="tdb"), between="T") == "2022-08-09T00:00:00.000"
    far = Time(1e9, format="jd", scale="tdb")
    assert as_epoch(far) == far
    assert date_text(far) == f"J{far.jyear:.3f}"
    with pytest.raises(orbits.errors.EpochError, match="after AD 9999"):
        as_epoch(1e9)
