"""Files of times of transits and of radial velocities are read, and each line that is not understood is named."""

from __future__ import annotations

import numpy as np
import pytest
from astropy import units as u
from astropy.time import Time

import orbits
from orbits.errors import InputError, UnknownNameError
from orbits.resources import data_path


def written(tmp_path, text):
    path = tmp_path / "star.txt"
    path.write_text(text, encoding="utf-8")
    return path


def test_the_transits_of_trappist_1_are_all_read():
    times = orbits.TransitTimes.read(data_path("trappist1_transits.csv"), zero=2450000)
    assert (len(times), times.planets) == (447, tuple("bcdefgh"))
    first = times["b"]
    assert (first.time.jd[0], first.number[0], first.sigma[0]) == (2457322.51531, 0, 71e-5 * u.day)
    # Published (Agol et al. 2021, table 4), but for the variations of minutes over four years.
    assert times.linear("b").period == pytest.approx(1.510826, abs=1e-4)


def test_columns_go_by_name_and_numbers_are_counted(tmp_path):
    text = "# a comment\nx time sigma\n10.5, 0.1, 1\n\n11.5 0.1 1 # the next\n13.5 0.2 0\n14.5 0.1 1"
    times = orbits.TransitTimes.read(written(tmp_path, text), ("time", "sigma", "-"), planet="c", zero=2450000)
    assert times.number.tolist() == [0, 1, 3, 4]
    assert times.time.jd.tolist() == [2450010.5, 2450011.5, 2450013.5, 2450014.5]
    marked = "\ufeffb 0 10.5 0.1\r\nb 1 12.5 0.1\r\n"  # the mark of byte order is no part of the name
    assert orbits.TransitTimes.read(written(tmp_path, marked)).planets == ("b",)


def test_velocities_have_an_instrument_each(tmp_path):
    path = written(tmp_path, "time,velocity,sigma,tel\n1,-0.01,0.002,HIRES\n2,0.02,0.003,APF\n")
    columns = ("time", "velocity", "sigma", "instrument")
    both = orbits.RadialVelocities.read(path, columns, unit=u.km / u.s, zero=2451544)
    assert both.instruments == ("HIRES", "APF")
    np.testing.assert_allclose(both.velocity.to_value(u.m / u.s), [-10.0, 20.0])
    assert len(both["APF"] + both["HIRES"]) == 2
    assert str(both) == "RadialVelocities(2 measurements of HIRES, APF, 2000-01-01 to 2000-01-02)"


def test_each_line_that_is_not_understood_is_named(tmp_path):
    path = written(tmp_path, "b 0 10.5 0.1\nb 1 12.5\nb 2 twelve 0.1\n")
    with pytest.raises(InputError, match=r"line 2: 3 columns; line 3: 'twelve' is no number; expected 4 columns"):
        orbits.TransitTimes.read(path)
    with pytest.raises(InputError, match=r"no lines; expected 3 columns: time, velocity, sigma"):
        orbits.RadialVelocities.read(written(tmp_path, "# nothing\n"))
    with pytest.raises(InputError, match=r"cannot be read"):
        orbits.RadialVelocities.read(tmp_path / "missing.txt")
    with pytest.raises(InputError, match=r"columns is .*; expected time, velocity, sigma"):
        orbits.RadialVelocities.read(path, ("time", "speed"))
    with pytest.raises(UnknownNameError, match=r"has planets b, which `names` lacks"):
        orbits.TransitTimes.read(written(tmp_path, "b 0 1.5 0.1\n"), names={"1": "b"})
    path = written(tmp_path, "1 2 3\n")
    for given, message in (
        ({"columns": None}, "columns is None; expected time, velocity, sigma"),
        ({"columns": {"time", "velocity", "sigma"}}, r"columns is \{.*; expected .*, in their order"),
        ({"unit": u.km}, r"unit is Unit\(\"km\"\); expected one of speed"),
        ({"instrument": "x", "columns": ("instrument", "time", "velocity", "sigma")}, "'x', but a column has it, too"),
        ({"zero": None}, "zero must be a real number, got None"),
        ({"instrument": [1, 2]}, r"instrument is \[1, 2\]; expected a name"),
    ):
        with pytest.raises(InputError, match=message):
            orbits.RadialVelocities.read(path, **given)
    names = ["time", "velocity", "sigma"]
    for columns in (names, dict.fromkeys(names).keys(), np.array(names), iter(names)):
        assert orbits.RadialVelocities.read(path, columns, unit="km/s").velocity == 2000 * u.m / u.s


def test_what_is_no_measurement_is_refused():
    with pytest.raises(InputError, match=r"measurement 1 is not finite, or has no sigma above zero"):
        orbits.TransitTimes("b", [1.0, 2.0], [0.1, 0.0])
    with pytest.raises(InputError, match=r"velocity is .*; expected 2 figures in m / s"):
        orbits.RadialVelocities("x", Time(["2020-01-01", "2020-01-02"]), [1, 2, 3], 1.0)
    with pytest.raises(InputError, match=r"the numbers of the transits of 'b' do not increase"):
        orbits.TransitTimes("b", [1.0, 2.0], 0.1, [1, 0])
    with pytest.raises(UnknownNameError, match=r"there is no planet 'c'; expected one of b"):
        orbits.TransitTimes("b", [1.0, 2.0], 0.1)["c"]
    with pytest.raises(UnknownNameError, match=r"there is no planet \[0, 1, 2\]; expected one of b"):
        orbits.TransitTimes("b", [1.0, 2.0], 0.1)[[0, 1, 2]]


def test_times_of_measurements_are_dates_or_days_in_any_unit():
    """Hours were taken as days."""
    assert orbits.TransitTimes("b", [48.0, 72.0] * u.hour, 0.1).time.jd.tolist() == [2.0, 3.0]
    for wrong in ([1.0, np.nan], ["2020-01-01", "2020-01-02"], [1.0, 2.0] * u.m):
        with pytest.raises(InputError, match=r"time is .*; expected a Time, or finite Julian dates"):
            orbits.TransitTimes("b", wrong, 0.1)


def test_columns_of_pandas_are_measurements():
    """"time has masked values": columns have a method `mask`."""
    pandas = pytest.importorskip("pandas")
    table = pandas.DataFrame({"name": ["b", "b"], "time": [2450000.0, 2450010.0], "sigma": [0.1, 0.2], "k": [3, 4]})
    times = orbits.TransitTimes(table.name, table.time, table.sigma, table.k)
    assert times.planet.tolist() == ["b", "b"]
    assert (times.sigma.value.tolist(), times.number.tolist()) == ([0.1, 0.2], [3, 4])
    assert orbits.RadialVelocities("x", table.time, table.k, table.sigma).velocity.value.tolist() == [3.0, 4.0]


def test_transits_are_counted_by_a_period_that_all_intervals_have():
    assert orbits.TransitTimes("b", 10.0 * np.array([0, 3, 6, 8, 11, 14]), 0.1).number.tolist() == [0, 3, 6, 8, 11, 14]
    with pytest.raises(InputError, match=r"intervals of the transits of 'b' are not whole numbers of one period"):
        orbits.TransitTimes("b", [0.0, 10.0, 23.0, 51.7, 94.0], 0.1)
    late = orbits.TransitTimes("b", [90.0, 100.0], 0.1)
    assert (orbits.TransitTimes("b", [0.0, 20.0, 30.0], 0.1) + late).number.tolist() == [0, 2, 3, 9, 10]
    with pytest.raises(InputError, match=r"do not increase with their times; some have none"):
        late + orbits.TransitTimes("b", [0.0, 10.0], 0.1, [4, 5])


def test_what_is_half_given_is_refused(tmp_path):
    masked = np.ma.array([1.0, 2.0], mask=[False, True])
    for what, given in (("time", (masked, 0.1)), ("sigma", ([1.0, 2.0], masked * 1.0))):
        with pytest.raises(InputError, match=rf"{what} has masked values"):
            orbits.TransitTimes("b", *given)
    for wrong in ([0, 1.5], [0], [0, np.inf], [0, 1e20], "x"):
        with pytest.raises(InputError, match=r"number is .*; expected 2 whole numbers"):
            orbits.TransitTimes("b", [1.0, 2.0], 0.1, wrong)
    with pytest.raises(InputError, match=r"two transits of 'b' have the same time"):
        orbits.TransitTimes("b", [1.0, 1.0], 0.1)
    for wrong in (["b", "c", "d"], "", ["b", ""]):
        with pytest.raises(InputError, match=r"planet is .*; expected a name, or one for each of 2"):
            orbits.TransitTimes(wrong, [1.0, 2.0], 0.1)
    with pytest.raises(InputError, match=r"line 1: number 0.5 is not whole; line 2: sigma 0 is not above zero"):
        orbits.TransitTimes.read(written(tmp_path, "b 0.5 10.5 0.1\nb 1 12.5 0\n"))
