"""Headers are restored exactly: any system, in any units, with any names."""

from __future__ import annotations

import math
from pathlib import Path

import astropy.units as u
import numpy as np
import pytest
from astropy.time import Time
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import orbits
from orbits import DIMENSIONLESS, SOLAR, System, UnitSystem
from orbits.archive import Archive
from orbits.archive.origin import Origin
from orbits.archive.unit_systems import unit_system_from_text, unit_system_to_text
from orbits.errors import ArchiveError

from . import runs

LEAGUE = u.def_unit("league", 5556 * u.m)
OWN = UnitSystem("Löwe & Söhne", length=LEAGUE, time=u.def_unit("watch", 4 * u.hour), mass=u.M_earth)
UNITS = [
    SOLAR,
    DIMENSIONLESS,
    OWN,
    UnitSystem("SI", u.m, u.s, u.kg),
    UnitSystem("cgs", u.cm, u.s, u.g),
    UnitSystem("galactic", u.kpc, u.Myr, 1e10 * u.M_sun),
    UnitSystem("odd", 2.3 * u.au, u.yr / (2 * math.pi), u.M_sun),
    UnitSystem("G = 2", *[u.dimensionless_unscaled] * 3, G=2.0),
    # A name that astropy gives to something else.
    UnitSystem("my au", u.def_unit("au", 1.5e11 * u.m), u.day, u.M_sun),
]


def reopened(path: Path, system: System, **options) -> Archive:
    times = np.arange(2) * 0.5 * options.get("dt", 1.0)
    with runs.create(path, times, len(system), system=system, overwrite=True, **options) as writer:
        q, v = runs.samples(1, len(system))
        writer.commit(q, v, runs.checkpoint(1, len(system)))
    archive = Archive.open(path)
    archive.close()
    return archive


@pytest.mark.parametrize("units", UNITS, ids=lambda units: units.name)
def test_every_unit_system_comes_back_equal(units):
    again = unit_system_from_text(unit_system_to_text(units))
    assert again == units
    assert repr(again.G) == repr(units.G)
    for kind in ("length", "time", "mass"):
        ours, theirs = getattr(units, kind), getattr(again, kind)
        # Equal to the last bit, not only to the few ulps that astropy calls equal; and called the same.
        assert theirs.decompose().scale == ours.decompose().scale
        assert str(theirs) == str(ours)
    assert unit_system_to_text(again) == unit_system_to_text(units)


def test_the_packages_own_unit_systems_come_back_themselves():
    for units in (SOLAR, DIMENSIONLESS):
        assert unit_system_from_text(unit_system_to_text(units)) is units


NAMES = st.text(st.characters(exclude_categories=["C", "Z"]), min_size=1, max_size=128)
NUMBERS = st.floats(-1e12, 1e12, allow_subnormal=True)
STEPS = st.floats(-1e12, -1e-300) | st.floats(1e-300, 1e12)
POSITIVE = st.floats(5e-324, 1e12)
# To the nanosecond over all dates that epochs may have, and what two floats say beyond it.
EPOCHS = st.none() | st.builds(
    lambda day, part: Time(day, part, format="jd", scale="tdb"), st.floats(1e6, 5e6), st.floats(-0.5, 0.5)
)


@st.composite
def systems(draw: st.DrawFn) -> System:
    names = draw(st.lists(NAMES, min_size=1, max_size=6, unique=True))
    units = draw(st.sampled_from(UNITS))
    n = len(names)
    row = st.tuples(NUMBERS, NUMBERS, NUMBERS)
    return System(
        names,
        [draw(POSITIVE), *draw(st.lists(st.just(0.0) | POSITIVE, min_size=n - 1, max_size=n - 1))],
        draw(st.lists(row, min_size=n, max_size=n)),
        draw(st.lists(row, min_size=n, max_size=n)),
        epoch=draw(EPOCHS) if units.is_physical else None,
        units=units,
        radii=draw(st.none() | st.lists(st.floats(0, 1e9), min_size=n, max_size=n)),
        softening=draw(POSITIVE),
    )


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(system=systems(), dt=STEPS)
def test_every_system_comes_back_equal_to_the_last_bit(system, dt, tmp_path):
    archive = reopened(tmp_path / "run.h5", system, dt=dt)
    again = archive.system
    assert again == system
    assert repr(again.values) == repr(system.values)
    assert again.names == system.names
    assert (again.epoch is None) == (system.epoch is None)
    if system.epoch is not None:
        assert (again.epoch.jd1, again.epoch.jd2, again.epoch.scale) == (system.epoch.jd1, system.epoch.jd2, "tdb")
    assert archive.dt == dt
    assert archive.integrator == runs.INTEGRATOR
    assert dict(archive.provenance) == runs.PROVENANCE


def test_the_solar_system_comes_back(tmp_path):
    system = System.solar_system("2022-08-09")
    again = reopened(tmp_path / "run.h5", system).system
    assert again == system
    assert again.units is orbits.SOLAR
    assert repr(again) == repr(system)


def test_times_and_integrator_and_provenance_come_back(tmp_path):
    times = -np.geomspace(1e-300, 1e300, 50)
    integrator = {"name": "neu", "parameters": {"stages": 3, "tol": 0.1, "scheme": "Lie-Trotter", "flag": True}}
    provenance = {"cpu_features": "+avx " * 20_000, "größe": "viel", "empty": ""}
    path = tmp_path / "run.h5"
    with runs.create(path, times, integrator=integrator, provenance=provenance, dt=-1e290) as writer:
        writer.commit(*runs.samples(0), runs.checkpoint(1))
    with Archive.open(path) as archive:
        assert np.array_equal(archive.times, times)
        assert archive.integrator == integrator
        assert dict(archive.provenance) == provenance
        assert (archive.committed, archive.complete, archive.q.shape) == (0, False, (0, 3, 3))


def test_a_scenario_with_options_comes_back_and_other_runs_have_none(tmp_path):
    origin = Origin("belt", {"planets": "all", "count": 10_000, "share": 0.1, "loud": True})
    assert reopened(tmp_path / "run.h5", runs.system(), origin=origin).origin == origin
    assert reopened(tmp_path / "plain.h5", runs.system()).origin is None


def test_a_unit_that_only_this_session_knows_is_refused(tmp_path):
    units = UnitSystem("SI", u.m, u.s, u.kg)
    object.__setattr__(units, "length", u.def_unit("smoot"))
    with pytest.raises(ArchiveError, match="made of smoot, which only this session knows"):
        unit_system_to_text(units)
