"""States, runs and elements as tables of astropy, pandas and xarray: every float with its bits, unit and body."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from astropy import units as u
from astropy.table import QTable
from astropy.time import Time

import orbits
from orbits.errors import InputError, MissingPackageError, UnknownNameError

EPOCH = "2022-08-09T12:00:00.123456789"


@pytest.fixture(scope="module")
def system() -> orbits.System:
    made = orbits.System.solar_system(EPOCH, bodies=["Sun", "Jupiter", "Saturn"])
    return made.add("Ceres", primary="Sun", a=2.77 * u.au, e=0.08, radius=470 * u.km)


@pytest.fixture(scope="module")
def archived(system, tmp_path_factory) -> orbits.Trajectory:
    path = tmp_path_factory.mktemp("tables") / "run.h5"
    return orbits.propagate(system, orbits.Gauss(stages=4), dt=20, duration=200, samples=5, archive=path)


@pytest.fixture(scope="module")
def run(system, archived) -> orbits.Trajectory:
    return orbits.Trajectory(
        system, archived.times, archived.q.value, archived.v.value, step=20.0, integrator=archived.integrator
    )


def test_a_state_is_a_table_with_a_row_for_each_body_and_its_very_floats(system):
    table = system.to_table()
    assert tuple(table["body"]) == system.names
    assert np.array_equal(table["gm"], system.gm)
    for k, (x, vx) in enumerate([("x", "vx"), ("y", "vy"), ("z", "vz")]):
        assert np.array_equal(table[x], system.q[:, k])
        assert np.array_equal(table[vx], system.v[:, k])
    assert np.array_equal(table["radius"], system.radii)
    assert (table["x"].unit, table["vx"].unit, table["gm"].unit) == (u.au, u.au / u.day, u.au**3 / u.day**2)


def test_a_table_makes_the_same_system_again(system):
    table = system.to_table()
    q, v = (u.Quantity([table[c] for c in columns]).T for columns in (("x", "y", "z"), ("vx", "vy", "vz")))
    again = orbits.System(table["body"], table["gm"], q, v, epoch=table.meta["epoch"], radii=table["radius"])
    # An epoch is written to the nanosecond; everything else comes back to the bit.
    assert abs(again.epoch - system.epoch) < 1 * u.ns
    assert again.replaced(epoch=system.epoch) == system


def test_a_table_survives_ecsv(system, tmp_path):
    table = system.to_table()
    table.write(tmp_path / "state.ecsv")
    read = QTable.read(tmp_path / "state.ecsv")
    assert read.meta == table.meta
    for name in table.colnames[1:]:
        assert np.array_equal(read[name], table[name])
        assert read[name].unit == table[name].unit


def test_a_run_is_a_table_time_by_time_and_body_by_body(run):
    table = run.to_table()
    assert table["time"].unit == u.day
    assert np.array_equal(table["time"].value.reshape(5, 4), np.repeat(run.times[:, None], 4, axis=1))
    assert table["body"].tolist() == [*run.names] * 5
    assert np.array_equal(u.Quantity([table[c] for c in "xyz"]).T.reshape(5, 4, 3), run.q)
    assert np.array_equal(u.Quantity([table[f"v{c}"] for c in "xyz"]).T.reshape(5, 4, 3), run.v)
    assert Time(table.meta["epoch"], scale="tdb") == Time(EPOCH, scale="tdb")


def test_pandas_has_the_same_floats_by_time_and_body_and_names_the_units(run, system):
    frame = run.to_pandas()
    jupiter = frame.xs("Jupiter", level="body")
    assert np.array_equal(jupiter.index, run.times)
    assert np.array_equal(jupiter[["x", "y", "z"]].to_numpy(), run["Jupiter"].q.value)
    assert frame.attrs["units"] == {"time": "d"} | dict.fromkeys("xyz", "AU") | dict.fromkeys(
        ("vx", "vy", "vz"), "AU / d"
    )
    assert (frame.attrs["unit_system"], frame.attrs["integrator"]) == ("SOLAR", "Gauss(stages=4)")
    assert np.array_equal(system.to_pandas().loc["Ceres", ["vx", "vy", "vz"]], system.v[3].value)


def test_xarray_has_axes_time_body_component_with_units(run, system):
    data = run.to_xarray()
    assert dict(data.sizes) == {"time": 5, "body": 4, "component": 3}
    assert data.q.dims == ("time", "body", "component")
    assert np.array_equal(data.q, run.q.value)
    assert np.array_equal(data.v.sel(body="Saturn", component="y"), run["Saturn"].v[:, 1].value)
    assert (data.q.attrs["units"], data.v.attrs["units"], data.time.attrs["units"]) == ("AU", "AU / d", "d")
    assert np.array_equal(data.gm, system.gm.value)
    assert data.attrs["epoch"] == EPOCH
    assert np.array_equal(system.to_xarray().radius, system.radii.value)


def test_elements_are_tables_too_at_one_time_and_at_many(run, system):
    alone = system.elements(primary="Sun")
    table = alone.to_table()
    assert tuple(table["body"]) == alone.names == ("Jupiter", "Saturn", "Ceres")
    known = {"primary": "Sun", "frame": "ecliptic", "epoch": EPOCH, "time_scale": "tdb"}  # of which T and time count
    assert table.meta == known
    found = run.elements(primary="Sun")
    frame, data = found.to_pandas(), found.to_xarray()
    assert found.to_table().meta == data.attrs == known == {key: frame.attrs[key] for key in known}
    assert system.replaced(epoch=None).elements(primary="Sun").to_table().meta.keys() == {"primary", "frame"}
    for key in found.keys():  # noqa: SIM118 - no mapping
        assert np.array_equal(table[key], getattr(alone, key))
        assert np.array_equal(frame[key], getattr(found, key).value.ravel())
        assert np.array_equal(data[key].sel(body="Ceres"), getattr(found["Ceres"], key).value)
    assert np.array_equal(data.time, run.times)
    assert found["Saturn"].to_xarray().sizes == {"time": 5, "body": 1}
    assert alone["Saturn"].to_table()["a"] == alone.a[1]


def test_approaches_are_a_table_of_each_pair_closest_first(system):
    near = orbits.propagate(system, orbits.Gauss(stages=4), dt=20, duration=9000, samples=5).closest_approaches()
    table = near.to_table()
    assert len(table) == len(near) == len(list(near)) > 0
    for row, passage in zip(table, near, strict=True):
        assert (row["body"], row["other"]) == (passage.body, passage.other)
        assert (row["distance"], row["time"], row["speed"]) == (passage.distance, passage.time, passage.speed)
    assert np.all(np.diff(table["distance"]) >= 0)
    assert table.meta == system.to_table().meta
    alone = near.to_table("Saturn")
    assert len(alone) == sum("Saturn" in (passage.body, passage.other) for passage in near)
    with pytest.raises(UnknownNameError, match="or 'Saturn'"):
        near.to_table(["Satrun"])


def test_approaches_to_the_dominant_body_alone_are_an_empty_table():
    lonely = orbits.System.solar_system(bodies=["Sun"]).add("Ceres", primary="Sun", a=2.77 * u.au, e=0.08)
    near = orbits.propagate(lonely, orbits.Gauss(stages=4), dt=20, duration=5000).closest_approaches()
    assert (len(near), len(near.to_table())) == (0, 0)
    assert repr(near) == str(near) == "Approaches(2 bodies, none but by the dominant one)"
    assert [passage.other for passage in near["Ceres"]] == ["Sun"]


def test_a_visitor_on_a_hyperbola_about_the_dominant_body_is_listed():
    sky = orbits.System.solar_system(bodies=["Sun", "Jupiter"])
    sky = sky.add("visitor", primary="Sun", q=0.3 * u.au, e=1.2, inc=120 * u.deg, T=80 * u.day)
    sky = sky.add("comet", primary="Sun", q=0.3 * u.au, e=0.99, inc=60 * u.deg, T=80 * u.day)
    near = orbits.propagate(sky, duration=160 * u.day).closest_approaches()
    assert "visitor  Sun" in str(near)
    assert [passage.other for passage in near["visitor"]].count("Sun") == 1  # by name and in the list, but once
    assert not any({one.body, one.other} == {"comet", "Sun"} for one in near)
    assert near["comet"][0].other == "Sun"


def test_some_bodies_can_be_chosen_in_any_order(run, system):
    assert run.to_table(["Ceres", "Sun"])["body"].tolist()[:3] == ["Ceres", "Sun", "Ceres"]
    assert np.array_equal(run.to_xarray(["Ceres", "Sun"]).q, run.q[:, [3, 0]].value)
    assert system.to_pandas("Saturn").index.tolist() == ["Saturn"]
    with pytest.raises(UnknownNameError, match="or 'Saturn'"):
        run.to_table(["Satrun"])
    with pytest.raises(InputError, match="both called 'Sun'"):
        system.to_table(["Sun", "Sun"])


def test_names_of_bodies_may_come_from_an_iterator(run):
    """The samples of no body were taken for the names of two."""
    names = list(run.names[1:3])
    table, frame, data = run.to_table(iter(names)), run.to_pandas(iter(names)), run.to_xarray(iter(names))
    assert len(table) == len(frame) == 2 * len(run)
    assert data["q"].shape == (len(run), 2, 3)
    np.testing.assert_array_equal(data["q"].values, run.q[:, 1:3].value)


def test_a_run_in_an_archive_is_not_read_before_it_is_used(archived, run, monkeypatch):
    monkeypatch.setattr("orbits.archive.samples.Samples._read", None)
    data = archived.to_xarray()
    assert np.array_equal(data.q[-1, 1], run.q[-1, 1].value)
    assert archived.to_table().values_equal(run.to_table()).columns["x"].all()


def test_pure_numbers_have_no_unit():
    pair = orbits.System(["a", "b"], [1, 0], [[0, 0, 0], [1, 0, 0]], [[0, 0, 0], [0, 1, 0]], units=orbits.DIMENSIONLESS)
    assert pair.to_table()["x"].unit == u.dimensionless_unscaled
    assert pair.to_pandas().attrs["units"]["x"] == ""
    assert "epoch" not in pair.to_table().meta


def test_a_run_without_samples_is_an_empty_table(run):
    empty = orbits.Trajectory(
        run.system, np.empty(0), np.empty((0, 4, 3)), np.empty((0, 4, 3)), step=1.0, integrator=run.integrator
    )
    assert len(empty.to_table()) == len(empty.to_pandas()) == empty.to_xarray().sizes["time"] == 0


@pytest.mark.parametrize("package", ["pandas", "xarray"])
def test_a_missing_package_is_named_with_how_to_get_it(system, monkeypatch, package):
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(MissingPackageError, match=rf"needs the package {package}.*pip install 'orbits\[tables\]'"):
        getattr(system, f"to_{package}")()
    assert len(system.to_table()) == len(system)
