"""Closest approaches are numbers wherever one was recorded, and say how they are known."""

from __future__ import annotations

import numpy as np
import pytest
from astropy import units as u

import orbits
from orbits.marching.clocks.step_times import Place
from orbits.marching.following.own_clocks import SHORTEST
from orbits.propagation.marchers import bound
from orbits.propagation.results import refinement
from orbits.propagation.results.recording import passages_of
from tests.ensemble.belts import system as belt

MAP = orbits.WisdomHolman(encounters="retire")


def crossers() -> orbits.System:
    """The Sun, Jupiter and particles that pass it."""
    planets = orbits.System.solar_system("2022-08-09", bodies=["Sun", "Jupiter"])
    return planets.add(["p", "r"], primary="Sun", a=[4.6, 5.6] * u.au, e=0.3, M=[0.4, 2.0] * u.rad)


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_a_particle_is_known_one_rounding_after_the_end_of_a_step(direction):
    """The bodies take a step there that is shorter than any which a particle would choose."""
    system = crossers()
    marcher = bound(system, "gauss", orbits.Adaptive().towards(direction), threads=1)
    marcher.advance_to(Place(0, direction * 900.0))
    here, _ = marcher.state()
    after = float(np.nextafter(marcher.time, direction * np.inf))
    assert abs(after - marcher.time) <= SHORTEST * abs(marcher.time)
    there, _ = marcher.state_at(Place(0, after))
    np.testing.assert_allclose(there, here, rtol=0, atol=2e-15)  # 1e-13 d at 0.01 au/d
    run = orbits.propagate(system, duration=2 * after * u.day, samples=[after], progress=False)
    assert np.isfinite(run.q.value).all()
    assert not len(run.retired)


def test_a_map_that_is_marched_again_from_within_an_encounter_loses_nobody():
    """p26 comes to 0.96 au of Jupiter: not within three Hill radii of the particle's distance from the Sun, by which a
    passage is judged, but within those of the planet's, by which the start of a run is.
    """
    with pytest.warns(orbits.errors.RetiredWarning, match="retired 5 massless particles before encounters"):
        run = orbits.propagate(
            belt(40, 5.5), MAP, duration=20 * u.yr, dt="30 d", samples=5, approaches=True, progress=False
        )
    assert "p26" not in run.retired.names
    approaches = run.closest_approaches()
    assert np.isfinite([one.distance.value for one in approaches["p26"]]).all()
    assert not approaches.estimated.any()
    again = run.at(run.t[2] + 30 * u.day)
    assert np.isfinite(again.q.value[again.names.index("p26")]).all()


def test_an_approach_that_cannot_be_computed_again_is_as_recorded_and_says_so(monkeypatch):
    run = orbits.propagate(belt(40, 5.5), duration=20 * u.yr, samples=2, progress=False)
    exact = run.closest_approaches()
    one = next(iter(exact))
    body, other = run.names.index(one.body), run.names.index(one.other)
    assert not one.estimated
    assert "estimated" not in exact.to_table().colnames
    run._passages = None
    recorded = [p.distance for p in passages_of(run).passages if {p.body, p.other} == {body, other}]
    lost = 0.0, np.nan, np.nan
    monkeypatch.setattr(refinement, "_least", lambda *_: lost)
    found = run.closest_approaches()
    again = next(iter(found))
    assert again.estimated
    assert (again.body, again.other) == (one.body, one.other)
    assert again.distance.value in recorded
    assert again.distance.value == pytest.approx(one.distance.value, rel=1e-3)
    assert "estimated from the two-body orbit within the step" in str(again)
    assert not np.isnan(found.distance.value).any()
    assert found.estimated[body, 1]
    assert found.to_table()["estimated"].any()
