"""Dates of runs: datetime64 in TDB in pandas and xarray, and epochs that print with as many digits as it takes."""

from __future__ import annotations

import re

import numpy as np
import pytest
from astropy import units as u
from astropy.time import Time

import orbits

EPOCH = "2022-08-09T01:02:03.123456"
DATES = ["2022-08-10T00:00:00.000000", "2022-12-31T23:59:59.999999", "2023-01-01T00:00:00.000000"]


@pytest.fixture(scope="module")
def run() -> orbits.Trajectory:
    system = orbits.System.solar_system(EPOCH, bodies=["Sun", "Jupiter", "Saturn"])
    return orbits.propagate(system, "stormer-verlet", dt=6, until="2023-01-01", samples=DATES)


def test_a_run_has_real_dates_in_xarray_to_select_by(run):
    data = run.to_xarray()
    assert data.date.dtype == "datetime64[us]"
    assert data.date.dims == ("time",)
    assert data.date.attrs == {"time_scale": "tdb"}
    assert np.datetime_as_string(data.date).tolist() == DATES
    assert data.swap_dims(time="date").sel(date="2022-12").sizes["date"] == 1
    assert np.array_equal(data.time, run.times)


def test_a_run_has_real_dates_in_pandas_beside_the_numbers(run):
    frame = run.to_pandas()
    assert frame.date.dtype == "datetime64[us]"
    assert frame.attrs["time_scale"] == "tdb"
    saturn = frame.xs("Saturn", level="body")
    assert np.datetime_as_string(saturn.date.to_numpy()).tolist() == DATES
    assert np.array_equal(saturn.index, run.times)
    assert saturn.set_index("date").loc["2022-12-31":, "x"].shape == (2,)
    assert len(frame) == 9


def test_elements_of_a_run_have_its_dates_and_those_of_one_state_none(run):
    found = run.elements("Sun")
    assert np.array_equal(found.to_xarray().date, run.to_xarray().date)
    assert np.array_equal(found["Jupiter"].to_pandas().date.to_numpy(), run.to_xarray().date)
    assert found.to_pandas().attrs["time_scale"] == "tdb"
    assert "date" not in run.system.elements("Sun").to_xarray().coords
    assert "date" not in run.system.to_pandas().columns


@pytest.mark.parametrize("epoch", ["2000-01-01 12:00", "2022-08-09T23:59:59.999999", "1800-02-03", 2460000.25])
def test_dates_are_those_of_astropy_to_the_microsecond(epoch):
    system = orbits.System.from_elements({"Sun": {"mass": 1 * u.M_sun}, "dust": {"a": 1 * u.au}}, epoch=epoch)
    t = np.random.default_rng(2).uniform(-1e5, 1e5, 50)
    q, v = (np.repeat(x[None], 50, axis=0) for x in system.values[1:3])
    made = orbits.Trajectory(system, t, q, v, step=1.0, integrator=orbits.StormerVerlet())
    expected = (Time(system.epoch, precision=9) + t * u.day).datetime64
    # Half a microsecond, and what a nanosecond cut off by datetime64 adds.
    assert np.abs(made.to_xarray().date.to_numpy() - expected).max() <= np.timedelta64(501, "ns")


def test_dates_before_christ_are_dates_and_beyond_the_range_of_the_type_there_are_none():
    system = orbits.System.from_elements({"Sun": {"mass": 1 * u.M_sun}, "dust": {"a": 1 * u.au}}, epoch="J2000")
    q, v = (np.repeat(x[None], 2, axis=0) for x in system.values[1:3])

    def coords(days):
        run = orbits.Trajectory(system, [0.0, days], q, v, step=1.0, integrator=orbits.StormerVerlet())
        return run.to_xarray().coords

    assert str(coords(-2451545.0)["date"].to_numpy()[1]) == "-4713-11-24T12:00:00.000000"  # where Julian dates begin
    assert "date" not in coords(2e8)
    assert (
        "date"
        not in orbits.Trajectory(
            system.replaced(epoch=None), [0.0, 1.0], q, v, step=1.0, integrator=orbits.StormerVerlet()
        )
        .to_xarray()
        .coords
    )


@pytest.mark.parametrize(
    ("epoch", "spacing", "digits"),
    [("J2000", 3600.0, 3), ("J2000", 1e-3, 4), ("2022-08-09", 2.5e-6, 7), (Time(2022.5, format="jyear"), 1e-12, 9)],
)
def test_the_epochs_of_a_run_are_printed_finely_enough_to_tell_them_apart(epoch, spacing, digits):
    system = orbits.System.from_elements({"Sun": {"mass": 1 * u.M_sun}, "dust": {"a": 1 * u.au}}, epoch=epoch)
    t = np.arange(4) * spacing / 86400
    q, v = (np.repeat(x[None], 4, axis=0) for x in system.values[1:3])
    run = orbits.Trajectory(system, t, q, v, step=1.0, integrator=orbits.StormerVerlet())
    assert run.epochs.precision == digits
    if spacing > 1e-9:
        assert len(set(run.epochs.isot)) == 4
        assert len(set(re.findall(r"'.*?'", str(run.epochs)))) == 4
    if isinstance(epoch, str):
        assert "J2000.000" not in str(run[1].epoch)
