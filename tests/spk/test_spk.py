"""SPK kernels of runs, read back with CSPICE, the reference, and with jplephem, which is what astropy reads with."""

from __future__ import annotations

import numpy as np
import pytest
import spiceypy
from astropy import units as u
from astropy.coordinates import get_body_barycentric
from jplephem.spk import SPK

import orbits
from orbits.errors import ArchiveError, EpochError, InputError, UnknownNameError

from ..coverings import each

EPOCH = "2022-08-09T03:14:15.926"
METHOD = orbits.Gauss(stages=8)
DT, DAYS = 4 * u.day, 1000.0
TOLERANCE = 1e-3


@pytest.fixture(scope="module")
def system() -> orbits.System:
    made = orbits.System.solar_system(EPOCH, bodies=["Sun", "Mercury", "Jupiter", "Neptune"])
    made = made.add("Ceres", primary="Sun", a=2.77 * u.au, e=0.3)
    return made.add("Zoë", primary="Sun", a=0.7 * u.au, e=0.6, inc=40 * u.deg)


def propagated(system: orbits.System, days: float = DAYS, samples: int = 7) -> orbits.Trajectory:
    return orbits.propagate(system, METHOD, dt=DT, duration=days * u.day, samples=samples)


WAYS = [pytest.param(DAYS, id="forwards"), pytest.param(-DAYS, id="backwards", marks=pytest.mark.nightly)]


@pytest.fixture(scope="module", params=WAYS)
def run(system, request) -> orbits.Trajectory:
    return propagated(system, request.param)


@pytest.fixture(scope="module")
def written(run, tmp_path_factory):
    return run.to_spk(tmp_path_factory.mktemp("spk") / "run.bsp", ids={"Zoë": -1001}, tolerance_km=TOLERANCE)


@pytest.fixture
def cspice(written):
    spiceypy.furnsh(str(written.path))
    yield
    spiceypy.unload(str(written.path))


def seconds_past_j2000(state: orbits.System) -> float:
    return (state.epoch.jd1 - 2451545 + state.epoch.jd2) * 86400


def kilometres(state: orbits.System, name: str) -> np.ndarray:
    i = state.index(name)
    return np.concatenate([state.q[i].to_value(u.km), state.v[i].to_value(u.km / u.s)])


def test_cspice_reads_the_run_between_and_at_its_samples(run, written, cspice):
    times = [*(np.random.default_rng(1).uniform(0, 1, 40) * run.times[-1]), *run.times]
    states = run.at(times)
    for state in (states[k] for k in range(len(states))):
        for name, number in written.ids.items():
            found, _ = spiceypy.spkgeo(number, seconds_past_j2000(state), "J2000", 0)
            expected = kilometres(state, name)
            # The two times are 60 ns apart at most: 3 mm on the fastest way of Zoë, 70 km/s.
            assert np.linalg.norm(found[:3] - expected[:3]) < TOLERANCE + 4e-6
            # The error wavers over a record of days: 2 (degree)^2/length times it bounds its slope (Markov).
            slope = 4 * 13**2 * TOLERANCE / (written.record_days[name] * 86400)
            assert np.linalg.norm(found[3:] - expected[3:]) < slope


def test_jplephem_reads_a_run_back_in_time(system, tmp_path):
    run = propagated(system, -200, 3)
    written = run.to_spk(tmp_path / "run.bsp", bodies=["Mercury", "Jupiter"])
    with SPK.open(str(written.path)) as kernel:
        for state in map(run.at, np.linspace(0, run.times[-1], 9)):
            for name, number in written.ids.items():
                found = kernel[0, number].compute(state.epoch.jd1, state.epoch.jd2)
                assert np.linalg.norm(found - kilometres(state, name)[:3]) < TOLERANCE + 4e-6


def test_jplephem_reads_the_same(run, written):
    with SPK.open(str(written.path)) as kernel:
        for state in map(run.at, np.linspace(0, run.times[-1], 30)):
            for name, number in written.ids.items():
                found = kernel[0, number].compute(state.epoch.jd1, state.epoch.jd2)
                assert np.linalg.norm(found - kilometres(state, name)[:3]) < TOLERANCE + 4e-6


def test_the_error_is_measured_and_records_are_as_long_as_the_body_is_slow(written):
    assert all(0 < error <= TOLERANCE for error in written.error_km.values())
    days = written.record_days
    assert days["Zoë"] <= days["Mercury"] < days["Ceres"] < days["Jupiter"] <= days["Neptune"]


def test_a_smaller_tolerance_is_kept_too(system, tmp_path):
    run = propagated(system.remove("Zoë"), 200)
    written = run.to_spk(tmp_path / "run.bsp", tolerance_km=2e-6, bodies=["Mercury"])
    assert written.error_km["Mercury"] < 2e-6
    with SPK.open(str(written.path)) as kernel:
        errors = []
        for state in map(run.at, np.linspace(0, 200, 60)):
            found = kernel[0, 1].compute(state.epoch.jd1, state.epoch.jd2)
            errors.append(np.linalg.norm(found - kilometres(state, "Mercury")[:3]))
    # jplephem's seconds past J2000 are a float64: 60 ns of 59 km/s are 3.5e-6 km.
    assert max(errors) < 2e-6 + 3.6e-6


def test_astropy_reads_the_same(run, written):
    moment = run.epochs[1]
    found = get_body_barycentric("mercury", moment, ephemeris=str(written.path)).xyz.to_value(u.km)
    assert np.linalg.norm(found - kilometres(run[1], "Mercury")[:3]) < TOLERANCE + 4e-6


def test_mercury_is_at_its_barycentre(run, written, cspice):
    et = seconds_past_j2000(run[2])
    assert np.array_equal(spiceypy.spkgeo(199, et, "J2000", 0)[0], spiceypy.spkgeo(1, et, "J2000", 0)[0])


def test_what_is_covered_is_the_span_of_the_run(run, written, cspice):
    window = spiceypy.spkcov(str(written.path), -1001)
    ends = sorted(seconds_past_j2000(run[k]) for k in (0, -1))
    # One unit in the last place of these seconds.
    assert np.abs(np.array(spiceypy.wnfetd(window, 0)) - ends).max() <= 1.2e-7


def test_states_in_any_order_are_covered_from_the_first_to_the_last_time(run, tmp_path):
    middle = 0.5 * run.times[-1]
    written = run.at([0.1 * middle, middle, 0.5 * middle]).to_spk(tmp_path / "run.bsp", bodies=["Neptune"])
    with SPK.open(str(written.path)) as kernel:
        for time in (0.1 * middle, middle):
            state = run.at(time)
            found = kernel[0, 8].compute(state.epoch.jd1, state.epoch.jd2)
            assert np.linalg.norm(found - kilometres(state, "Neptune")[:3]) < TOLERANCE + 4e-6
    with pytest.raises(InputError, match="covers no interval"):
        run.at([middle, middle]).to_spk(tmp_path / "none.bsp", bodies=["Neptune"])


def test_the_comments_say_how_it_was_made_and_what_the_centre_is(written):
    handle = spiceypy.dafopr(str(written.path))
    try:
        count, lines, done = spiceypy.dafec(handle, 40, 200)
    finally:
        spiceypy.dafcls(handle)
    assert done
    assert "Gauss(stages=8), dt = 4.0 d" in lines[0]
    assert any("barycentre of the selected bodies" in line for line in lines)
    assert lines[count - 1].split() == ["-1001", "Zo?"]


def test_positions_about_a_body_of_the_run(run, tmp_path):
    written = run.to_spk(tmp_path / "run.bsp", bodies=["Sun", "Jupiter", "Ceres"], centre="Sun")
    assert (written.centre, written.ids) == (10, {"Jupiter": 5, "Ceres": 2000001})
    with SPK.open(str(written.path)) as kernel:
        for state in map(run.at, np.linspace(0, run.times[-1], 9)):
            found = kernel[10, 2000001].compute(state.epoch.jd1, state.epoch.jd2)
            expected = (kilometres(state, "Ceres") - kilometres(state, "Sun"))[:3]
            assert np.linalg.norm(found - expected) < TOLERANCE + 4e-6


def test_more_bodies_than_one_record_of_summaries_holds(system, tmp_path):
    names = [f"clone {k}" for k in range(60)]
    many = system.remove("Zoë").add(names, primary="Sun", a=np.linspace(2, 3, 60) * u.au)
    run = propagated(many, 100, 2)
    written = run.to_spk(tmp_path / "run.bsp", ids={name: -2000 - k for k, name in enumerate(names)}, bodies=names)
    spiceypy.furnsh(str(written.path))
    try:
        for name in names[::7]:
            found, _ = spiceypy.spkgeo(written.ids[name], seconds_past_j2000(run[-1]), "J2000", 0)
            assert np.linalg.norm((found - kilometres(run[-1], name))[:3]) < TOLERANCE
    finally:
        spiceypy.unload(str(written.path))
    assert spiceypy.spkobj(str(written.path)).card == 60


def test_a_moon_with_the_name_of_an_asteroid_does_not_get_its_number(tmp_path):
    moons = {"Jupiter": {"gm": 2.825e-7}, "Europa": {"gm": 7.1e-12, "a": 4.49e-3}, "Io": {"a": 2.82e-3}}
    run = orbits.propagate(orbits.System.from_elements(moons, epoch="2020-01-01"), duration=1, progress=False)
    with pytest.raises(InputError, match=r"no NAIF number is known for Europa; .* ids=\{'Europa'"):
        run.to_spk(tmp_path / "moons.bsp")
    assert run.to_spk(tmp_path / "moons.bsp", ids={"Europa": 502}).ids == {"Jupiter": 5, "Europa": 502, "Io": 2000085}


def test_numbers_of_bodies_are_naifs_or_ones_own(run, tmp_path):
    written = run.to_spk(tmp_path / "run.bsp", ids={"Zoë": 7, "Mercury": 199}, tolerance_km=100)
    assert written.ids == {"Sun": 10, "Mercury": 199, "Jupiter": 5, "Neptune": 8, "Ceres": 2000001, "Zoë": 7}


@each(
    ("options", "error", "message"),
    [
        ({}, InputError, r"no NAIF number is known for Zoë; .* ids=\{'Zoë': -1001\}"),
        ({"ids": {"Zoë": 10}}, InputError, "'Sun' and 'Zoë' both have the NAIF number 10"),
        ({"ids": {"Zoë": 0}}, InputError, r"ids\['Zoë'\] is 0"),
        ({"ids": {"Zoë": "7"}}, InputError, r"ids\['Zoë'\] is '7'"),
        ({"ids": ["Zoë", 7]}, InputError, "ids is .* expected numbers by name"),
        ({"ids": {"Zoe": 7}}, UnknownNameError, "no body 'Zoe'"),
        ({"overwrite": "no"}, InputError, "overwrite is 'no'; expected True or False"),
        ({"bodies": ["Pluto"]}, UnknownNameError, "no body 'Pluto'"),
        ({"bodies": ["Sun"], "centre": "Sun"}, InputError, "leaves nothing"),
        ({"bodies": ["Ceres"], "centre": "Sum"}, UnknownNameError, "Did you mean 'Sun'"),
        ({"bodies": ["Ceres"], "tolerance_km": 0}, InputError, "tolerance_km is 0"),
        ({"bodies": ["Ceres"], "tolerance_km": float("nan")}, InputError, "tolerance_km is nan"),
        ({"bodies": ["Ceres"], "tolerance_km": 1e-12}, InputError, "not smooth to 1e-12 km"),
    ],
)
def test_what_cannot_be_written_is_refused_in_words_and_leaves_no_file(run, tmp_path, options, error, message):
    with pytest.raises(error, match=message):
        run.to_spk(tmp_path / "run.bsp", **options)
    assert not list(tmp_path.iterdir())


def test_a_method_whose_steps_join_roughly_is_refused_with_how_much(system, tmp_path):
    rough = orbits.propagate(system, orbits.StormerVerlet(), dt=4 * u.day, duration=100 * u.day, samples=2)
    with pytest.raises(InputError, match=r"not smooth to 0.001 km.* larger tolerance_km"):
        rough.to_spk(tmp_path / "run.bsp", bodies=["Mercury"])
    assert rough.to_spk(tmp_path / "run.bsp", bodies=["Mercury"], tolerance_km=1e5).error_km["Mercury"] < 1e5


def test_samples_that_are_not_of_this_method_are_refused(run, tmp_path):
    other = orbits.Trajectory(
        run.system, run.times, run.q.value * (1 + 1e-9), run.v.value, step=run.step, integrator=METHOD
    )
    with pytest.raises(InputError, match=r"'Neptune' are up to .* km from the motion"):
        other.to_spk(tmp_path / "run.bsp", bodies=["Neptune"])


def test_runs_without_dates_or_units_are_refused(run, tmp_path):
    floats = (run.times, run.q.value, run.v.value)
    undated = orbits.Trajectory(run.system.replaced(epoch=None), *floats, step=run.step, integrator=METHOD)
    with pytest.raises(EpochError, match="no epoch"):
        undated.to_spk(tmp_path / "run.bsp", bodies=["Sun"])
    gm, q, v, _ = run.system.values
    pure = orbits.System(run.names, gm, q, v, units=orbits.DIMENSIONLESS)
    with pytest.raises(InputError, match="pure numbers"):
        orbits.Trajectory(pure, *floats, step=run.step, integrator=METHOD).to_spk(tmp_path / "run.bsp", bodies=["Sun"])
    single = orbits.Trajectory(run.system, *(x[:1] for x in floats), step=run.step, integrator=METHOD)
    with pytest.raises(InputError, match="at least two samples"):
        single.to_spk(tmp_path / "run.bsp", bodies=["Sun"])


def test_a_file_that_is_there_stays_unless_told(run, tmp_path):
    path = tmp_path / "run.bsp"
    path.write_text("mine")
    with pytest.raises(ArchiveError, match="overwrite=True"):
        run.to_spk(path, bodies=["Neptune"])
    assert path.read_text() == "mine"
    run.to_spk(path, bodies=["Neptune"], overwrite=True)
    assert [p.name for p in tmp_path.iterdir()] == ["run.bsp"]
    with pytest.raises(ArchiveError, match="7 is not a path"):
        run.to_spk(7)
    with pytest.raises(InputError, match="cannot write"):
        run.to_spk(tmp_path / "no folder" / "run.bsp", bodies=["Neptune"])
