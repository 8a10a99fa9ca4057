"""Tables of close approaches like those of JPL's Center for Near Earth Object Studies."""

from __future__ import annotations

import numpy as np
import pytest
from astropy import units as u

import orbits
from orbits.errors import InputError
from tests.encounters import apophis_2029


@pytest.fixture(scope="module")
def approaches():
    return orbits.propagate(apophis_2029(), duration=150 * u.day, samples=2).closest_approaches()


def test_apophis_of_2029_is_listed_as_by_jpl(approaches):
    """CNEOS lists 2029-Apr-13 21:46 TDB, 0.10 LD, 0.00025 au, 7.42 km/s, and 5.84 km/s at infinity."""
    (row,) = approaches.to_table("Earth", within=0.05 * u.au)[:1]
    assert (row["body"], row["other"], row["date"].iso[:16]) == ("Apophis", "Earth", "2029-04-13 21:46")
    assert round(float(row["lunar_distances"]), 2) == 0.10
    assert round(row["distance"].to_value(u.au), 5) == 0.00025
    assert round(row["speed"].to_value(u.km / u.s), 2) == 7.42
    assert round(row["v_infinity"].to_value(u.km / u.s), 2) == 5.84
    one = approaches["Apophis"][0]
    assert one.v_infinity == row["v_infinity"]


def test_tables_are_in_the_order_of_distance_or_of_time_and_reach_as_far_as_asked(approaches):
    near = approaches.to_table("Apophis", within=0.02 * u.au)
    assert near["other"].tolist() == ["Earth", "Moon"]
    assert len(approaches.to_table()) == len(approaches) > 5
    assert (np.diff(approaches.to_table(order="time")["time"]) >= 0).all()
    assert (np.diff(approaches.to_table()["distance"]) >= 0).all()
    with pytest.raises(InputError, match="order is 'date'; expected 'distance' or 'time'"):
        approaches.to_table(order="date")
    with pytest.raises(InputError, match="within is 0; expected a finite number above 0"):
        approaches.to_table(within=0)
    with pytest.raises(InputError, match="within is in km / s; expected length"):
        approaches.to_table(within=1 * u.km / u.s)


def test_bodies_that_are_bound_have_no_velocity_at_infinity(approaches):
    moon = next(one for one in approaches["Moon"] if one.other == "Earth")
    assert (moon.other, moon.v_infinity) == ("Earth", None)
    table = approaches.to_table("Moon", within=0.003 * u.au)
    bound = table[(table["body"] == "Moon") & (table["other"] == "Earth")]
    assert np.isnan(bound["v_infinity"]).all()
    assert " bound " in str(approaches)


def test_without_units_there_are_no_lunar_distances():
    pair = orbits.System(
        ["a", "b"], [1, 1e-3], [[0, 0, 0], [1, 0, 0]], [[0, 0, 0], [0.3, 0.9, 0]], units=orbits.DIMENSIONLESS
    )
    table = orbits.propagate(pair, duration=10.0, samples=2).closest_approaches().to_table()
    assert "lunar_distances" not in table.colnames
    assert "v_infinity" in table.colnames


def test_positions_at_the_start_are_no_flybys_but_are_known_of_each_body():
    """Two planets begin after their conjunction and part."""
    bodies = {"star": {"gm": 1.0}, "b": {"a": 1.0, "gm": 1e-6}, "c": {"a": 1.2, "M": -0.05, "gm": 1e-3}}
    system = orbits.System.from_elements(bodies, units=orbits.DIMENSIONLESS)
    parting = orbits.propagate(system, duration=3.0).closest_approaches()
    assert len(parting) == 0
    assert "none" in repr(parting)
    first = parting["c"][0]
    assert {first.body, first.other} == {"b", "c"}
    assert first.time.value == 0.0
    run = orbits.propagate(system, duration=35.0, samples=3501)
    apart = np.linalg.norm((run["b"].q - run["c"].q).value, axis=1)
    (again,) = run.closest_approaches()  # within the reach of c, three Hill radii
    assert again.time.value == pytest.approx(run.times[500 + apart[500:].argmin()], abs=0.01)  # a sample every 0.01
