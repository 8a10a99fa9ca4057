"""Times as dates, quantities, numbers and texts: the end of a run, its samples, and times in between."""

from __future__ import annotations

import datetime
import warnings

import numpy as np
import pytest
from astropy import units as u
from astropy.time import Time

import orbits
from orbits.errors import EpochError, InputError
from orbits.time_grid import times_since

from ..coverings import cover, each

EPOCH = "2022-08-09"
VERLET = orbits.StormerVerlet()


def system(epoch: str | None = EPOCH) -> orbits.System:
    return orbits.System.solar_system(EPOCH, bodies=["Sun", "Jupiter", "Saturn"]).replaced(epoch=epoch)


def pair() -> orbits.System:
    return orbits.System.from_elements({"star": {"gm": 1}, "planet": {"a": 1}}, units=orbits.DIMENSIONLESS)


@pytest.mark.parametrize(
    "until",
    [
        "2022-10-18",
        "2022-10-18 00:00",
        Time("2022-10-18", scale="tdb"),
        Time("2022-10-18", scale="tdb").tt,
        np.datetime64("2022-10-18"),
        70 * u.day,
        70,
        "70 d",
        np.float64(70),
    ],
    ids=repr,
)
def test_a_run_may_end_at_a_date_or_a_time_and_gives_the_bits_of_the_same_duration(until):
    by_duration = orbits.propagate(system(), VERLET, dt=10, duration=70, samples=3)
    run = orbits.propagate(system(), VERLET, dt=10, until=until, samples=3)
    assert run.times.tolist() == [0.0, 35.0, 70.0]
    assert np.array_equal(run.q, by_duration.q)


def test_an_end_before_the_epoch_goes_backwards_whatever_the_sign_of_the_step():
    for dt in (10, -10, "10 d", -10 * u.day):
        run = orbits.propagate(system(), VERLET, dt=dt, until="2022-05-01", samples=3)
        assert run.times.tolist() == [0.0, -50.0, -100.0]
        assert (run.step, run.dt) == (-10.0, 10 * u.day)
    forwards = orbits.propagate(system(), VERLET, dt=-10, duration=100, samples=3)
    assert np.array_equal(forwards.q, orbits.propagate(system(), VERLET, dt=10, duration=100, samples=3).q)


@each(
    ("arguments", "message"),
    [
        ({}, "neither duration nor until is given; expected one"),
        ({"duration": 10, "until": 10}, "duration and until are both given"),
        ({"duration": "2030-01-01"}, r"is a date; expected how long a run is. Its end is until="),
        ({"duration": Time("2030-01-01")}, "is a date"),
        ({"until": "2030"}, r"has no unit; expected a time \(\"2030 d\"\) or a date"),
        ({"until": "soon"}, r"until = 'soon'; expected a quantity .* a date \(\"2030-01-01\"\)"),
        ({"until": "2030-01-01T00:00Z"}, r"until is '2030.*texts are TDB; for UTC give astropy's Time"),
        ({"until": EPOCH}, "is the epoch of the system, where the run begins"),
        ({"until": np.inf}, "until must be finite"),
        ({"until": Time(["2020-01-01", "2021-01-01"])}, "must be a single number"),
        ({"until": 3 * u.km}, "until is in km"),
        ({"until": datetime.datetime(2030, 1, 1)}, r"does not say its scale of time; expected a Time.*scale='utc'"),
        ({"until": np.ma.array([1.0])}, "masked"),
        ({"duration": 10, "samples": ["2022-08-10", "tomorrow"]}, "tomorrow"),
        ({"duration": 10, "samples": [10.00000000001]}, r"samples\[0\] = 10\.00000000001 lies .* from 0 to 10 "),
        ({"duration": 10, "samples": [5, "2022-09-30"]}, r"samples\[1\] = 52 lies outside the run from 0 to 10"),
        ({"duration": 10, "samples": "5 d"}, r"a single time is \[time\]"),
    ],
)
def test_what_is_no_end_and_no_sample_is_refused_in_words(arguments, message):
    with pytest.raises(InputError, match=message):
        orbits.propagate(system(), VERLET, dt=1, **arguments)


@pytest.mark.parametrize(
    ("what", "given"),
    [
        ("until", np.datetime64("NaT")),
        ("samples", np.array(["2022-08-10", "NaT"], dtype="datetime64[D]")),
        (r"samples\[1\]", ["2022-08-10", np.datetime64("NaT")]),
    ],
)
def test_a_date_that_is_none_is_said_to_be_none(what, given):
    with pytest.raises(EpochError, match=rf"^{what} is .*NaT.*\(NaT is not a date\)\.$"):
        times_since(system(), given, what.partition("\\")[0])


@pytest.mark.parametrize("date", ["2030-01-01", Time("2020-01-01"), np.datetime64("2030-01-01"), ["2030-01-01"]])
def test_dates_need_an_epoch(date):
    without = system(epoch=None)
    with pytest.raises(EpochError, match=r"is a date, .*but the system has no epoch"):
        times_since(without, date, "t")
    with pytest.raises(InputError, match="expected a quantity"):
        times_since(pair(), "soon", "t")
    assert times_since(pair(), "2.5", "t") == 2.5


@pytest.mark.parametrize(
    "samples",
    [
        Time(["2022-08-10", "2022-09-28"], scale="tdb"),
        ["2022-08-10", "2022-09-28"],
        ("2022-08-10", Time("2022-09-28", scale="tdb")),
        np.array(["2022-08-10", "2022-09-28"]),
        np.array(["2022-08-10", "2022-09-28"], dtype="datetime64[s]"),
        np.array([1 * u.day, 50 * u.day], dtype=object),
        [1, 50] * u.day,
        ["24 h", 50.0],
    ],
    ids=repr,
)
def test_samples_are_taken_as_dates_quantities_texts_and_mixtures(samples):
    run = orbits.propagate(system(), VERLET, dt=10, until="2022-09-28", samples=samples)
    assert run.times.tolist() == [1.0, 50.0]


def test_dates_made_from_the_epoch_and_the_length_are_within_the_run():
    start = system()
    for years in (1 / 3, 7.7, 10, 999.9):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # UTC has no rule for years to come
            dates = (start.epoch + np.linspace(0, 1, 12) * years * u.yr).utc
            run = orbits.propagate(start, VERLET, dt=100, duration=years * u.yr, samples=dates)
        assert len(run) == 12
        assert run.times[-1] <= (years * u.yr).to_value(u.day)


def test_a_time_that_misses_an_end_by_a_rounding_is_the_end():
    run = orbits.propagate(system(), VERLET, dt=50, duration=100, samples=[-1e-15, np.nextafter(100, 200)])
    assert run.times.tolist() == [0.0, 100.0]
    assert np.array_equal(run.at(np.nextafter(100, 200)).q, run[-1].q)
    with pytest.raises(InputError, match="outside the run"):
        orbits.propagate(system(), VERLET, dt=50, duration=100, samples=[100 * (1 + 1e-12)])


def test_the_dates_of_one_run_are_the_samples_of_another():
    one = orbits.propagate(system(), VERLET, dt=10, duration=333.3, samples=8)
    two = orbits.propagate(system(), VERLET, dt=10, duration=333.3, samples=one.epochs)
    assert np.array_equal(one.times, two.times)
    assert np.array_equal(one.to_xarray().q, two.to_xarray().q)
    pytest.importorskip("pandas")
    dates = one.to_xarray().date
    three = orbits.propagate(system(), VERLET, dt=10, duration=334, samples=dates)
    assert np.abs(three.times - one.times).max() < 6e-12  # half a microsecond, which is what dates are rounded to


@cover(("method", "length"), [VERLET, orbits.Gauss(stages=4)], [400.0, -400.0], strength=1)
def test_many_states_at_once_are_bit_for_bit_those_asked_for_one_by_one(method, length):
    run = orbits.propagate(system(), method, dt=7, duration=length, samples=6)
    times = np.random.default_rng(3).permutation(np.append(np.linspace(0, length, 41), run.times))
    found = run.at(times)
    assert isinstance(found, orbits.Trajectory)
    assert np.array_equal(found.times, times)
    for k in range(len(times)):
        alone = run.at(times[k])
        assert isinstance(alone, orbits.System)
        assert np.array_equal(found.q[k], alone.q)
        assert np.array_equal(found.v[k], alone.v)
        assert abs(found[k].epoch - alone.epoch) < 1 * u.ns


def test_states_are_found_between_samples_that_stand_in_any_order():
    run = orbits.propagate(system(), VERLET, dt=7, duration=400, samples=6)
    shuffled = run.at(run.times[[3, 0, 5, 1, 4, 2]])
    assert np.array_equal(shuffled.at(123.0).q, run.at(123.0).q)


def test_states_are_asked_for_by_dates_too():
    run = orbits.propagate(system(), VERLET, dt=7, duration=400, samples=6)
    assert np.array_equal(run.at("2022-09-28").q, run.at(50).q)
    assert np.array_equal(run.at(run.epochs).q, run.q)
    assert run.at(["2022-09-28", 60 * u.day]).times.tolist() == [50.0, 60.0]
    assert len(run.at([])) == 0
    for wrong, message in (
        ([10.0, 401.0], r"t\[1\] = 401 lies outside the run, 0 ... 400 d"),
        (400.00000001, r"t = 400\.00000001 lies outside the run, 0 ... 400 d"),  # 400 in ten digits
        (np.nan, "t = nan lies outside"),
        ("2021-01-01", "t = -585 lies outside"),
        ([[1.0]], r"t has shape \(1, 1\)"),
        ("noon", "t = 'noon'; expected"),
    ):
        with pytest.raises(InputError, match=message):
            run.at(wrong)


def test_many_states_at_once_bind_the_method_once_for_each_sample(monkeypatch):
    from orbits.propagation.results import marched_again

    run = orbits.propagate(system(), VERLET, dt=8, duration=400, samples=3)
    calls = []
    bound = marched_again.bound
    monkeypatch.setattr(marched_again, "bound", lambda *a, **k: calls.append(a) or bound(*a, **k))
    run.at(np.linspace(0, 400, 1000))
    assert len(calls) == 2  # and at the last sample it is the sample


def test_more_states_than_memory_holds_are_refused_before_they_are_computed(monkeypatch):
    from orbits.propagation.results import dense_output

    run = orbits.propagate(system(), VERLET, dt=7, duration=400, samples=3)
    monkeypatch.setattr(dense_output, "memory", lambda: 1e5)
    with pytest.raises(InputError, match=r"1000 states of 3 bodies need 0.0 GiB of memory, more than this machine"):
        run.at(np.linspace(0, 400, 1000))
    assert len(run.at(np.linspace(0, 400, 10))) == 10


def test_a_finished_run_is_extended_to_a_date(tmp_path):
    orbits.propagate(system(), VERLET, dt=10, duration=100, samples=3, archive=tmp_path / "run.h5")
    run = orbits.resume(tmp_path / "run.h5", until="2023-02-25")
    assert run.times.tolist() == [0.0, 50.0, 100.0, 150.0, 200.0]
    with pytest.raises(InputError, match="before the end of the run"):
        orbits.resume(tmp_path / "run.h5", until=Time("2022-09-01"))
    with pytest.raises(InputError, match="until = 'later'; expected"):
        orbits.resume(tmp_path / "run.h5", until="later")
