"""What a run says of itself and gives to other programs if its bodies, masses or radii change."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from astropy import units as u

import orbits
from orbits.errors import InputError

BODIES = {
    "star": {"gm": 1.0, "radius": 0.05},
    "a": {"a": 1.0, "e": 0.1, "gm": 1e-6, "radius": 0.05},
    "b": {"a": 1.1, "e": 0.1, "gm": 2e-6, "radius": 0.05, "l": 1.0, "pomega": 3.0},
}
DISC = orbits.System.from_elements(BODIES, units=orbits.DIMENSIONLESS)
SAME = "bodies merge, or masses change, between these samples"


@pytest.fixture(scope="module")
def merged() -> orbits.Trajectory:
    return orbits.propagate(DISC, duration=20.0, events=orbits.events.Collision(then=orbits.events.Merge()))


def swollen(t: u.Quantity, system: orbits.System) -> orbits.System:
    return system.replaced(radii=2.0 * system.radii.value)


def test_a_run_says_how_many_bodies_merged(merged) -> None:
    assert repr(merged).startswith("Trajectory(3 bodies (1 merged), 101 samples")
    assert repr(merged[:20]).startswith("Trajectory(3 bodies, 20 samples")
    assert repr(merged.changes) == "Changes(2 of bodies; see run.events and run.legs)"


def test_tables_have_mass_and_radius_at_each_time(merged) -> None:
    data = merged.to_xarray()
    assert data.gm.dims == data.radius.dims == ("time", "body")
    late = data.sel(time=15.0)
    assert late.gm.values.tolist()[::2] == [1.0, 3e-6]
    assert late.radius.values[2] == pytest.approx(0.05 * 2 ** (1 / 3), rel=1e-15)
    assert np.isnan([late.gm.sel(body="a"), late.radius.sel(body="a"), late.q.sel(body="a", component="x")]).all()
    early = data.sel(time=10.0)
    assert early.gm.values.tolist() == [1.0, 1e-6, 2e-6]
    frame = merged.to_pandas(bodies=["b"])
    assert frame.gm.unique().tolist() == [2e-6, 3e-6]
    assert merged.to_table().colnames[:4] == ["time", "body", "gm", "radius"]


def test_tables_of_a_run_with_the_same_bodies_are_as_they_were() -> None:
    same = orbits.propagate(DISC, duration=2.0, events=orbits.events.Collision(then=orbits.events.Merge()))
    assert same.to_xarray().gm.dims == ("body",)
    assert "gm" not in same.to_pandas()


def test_elements_are_those_of_the_bodies_between_two_changes(merged) -> None:
    with pytest.raises(InputError, match=SAME):
        merged.elements()
    late, early = merged[60:].elements("star"), merged[:20].elements("star")
    assert late.names == ("b",)
    assert early.names == ("a", "b")
    for k, found in ((60, late["b"].a[0]), (100, late["b"].a[-1])):
        assert found == merged[k].elements("star")["b"].a


def test_changes_of_radii_alone_begin_a_leg() -> None:
    events = orbits.events.Pericentre("a", "star", then=swollen)
    run = orbits.propagate(DISC, duration=8.0, events=events)
    assert len(run.events) == 1
    assert [leg.radii.value.tolist() for leg in run.legs] == [[0.05] * 3, [0.1] * 3]
    assert run.legs[1].time == run.events.time[0]
    assert run.to_xarray().radius.values[[0, -1], 1].tolist() == [0.05, 0.1]
    assert run.elements("star").names == ("a", "b")  # the masses stay


def test_refusals_name_what_was_called_and_what_goes_through_changes(merged, tmp_path) -> None:
    calls: dict[str, Any] = {
        "run.closest_approaches()": merged.closest_approaches,
        "run.unresolved()": merged.unresolved,
        "run.error_estimate()": merged.error_estimate,
    }
    for name, call in calls.items():
        with pytest.raises(InputError) as caught:
            call()
        assert name in str(caught.value)
        assert "run.at(times) and the samples go through" in str(caught.value)
