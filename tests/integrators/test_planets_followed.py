"""WisdomHolman(encounters="follow planets"): all bodies leave the map for encounters of planets, and return to it."""

import pickle
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from astropy import units as u

import orbits
from orbits.elements import state_from_elements
from orbits.errors import InputError, StepWarning
from orbits.events import CloseApproach, CloserThan, Pericentre
from orbits.integrators.maps.jacobi_form import outwards
from orbits.lagrangians.newtonian import newtonian, parameters
from orbits.marching.clocks.constant import ConstantSteps
from orbits.marching.clocks.step_times import Place
from orbits.marching.legs.excursions.planet_excursions import PlanetExcursions
from orbits.marching.legs.problem import Problem
from orbits.methods import SABA
from orbits.terms import PostNewtonian, ZonalHarmonics

from ..coverings import at, first
from ..maps import newtonian_energy, solar_system

SUN, YEAR = 0.00029591220828, 365.25
FOLLOW, WARN = orbits.WisdomHolman(encounters="follow planets"), orbits.WisdomHolman()
OPTIONS = {"dt": "100 d", "progress": False}


def planets(mass=1e-3, sizes=(5.2, 6.3, 7.9), e=0.05, seed=1, particles=()):
    """A star of one solar mass with planets that cross each other's orbits, and massless particles, (a, e) each."""
    rng = np.random.default_rng(seed)
    q, v = [np.zeros(3)], [np.zeros(3)]
    for a, share, ecc in [*((a, mass, e) for a in sizes), *((a, 0.0, ecc) for a, ecc in particles)]:
        node, peri, anomaly = rng.uniform(0.0, 2.0 * np.pi, 3)
        x, w = state_from_elements(
            (1.0 + share) * SUN, a=a, e=ecc, inc=rng.uniform(0.0, 0.03), Omega=node, omega=peri, M=anomaly
        )
        q.append(x)
        v.append(w)
    gm = np.array([SUN] + [mass * SUN] * len(sizes) + [0.0] * len(particles))
    q, v = np.array(q), np.array(v)
    names = ["star", *"bcdefg"[: len(sizes)], *(f"p{k}" for k in range(len(particles)))]
    massive = slice(0, 1 + len(sizes))
    q, v = (x - gm[massive] @ x[massive] / gm[massive].sum() for x in (q, v))
    return orbits.System(names, gm, q, v, units=orbits.SOLAR)


def energy_errors(run):
    """The relative change of the energy of the massive bodies at the samples."""
    massive = run.system.massive
    gm = run.system.values.gm[massive]
    found = [newtonian_energy(gm, q[massive], v[massive]) for q, v in zip(run.q.value, run.v.value, strict=True)]
    return np.abs(np.array(found) / found[0] - 1.0)


@pytest.fixture(scope="module")
def scattered():
    """Three Jupiters over 600 years, with encounters from the 14,500th day on."""
    return orbits.propagate(planets(), FOLLOW, duration=600 * u.yr, samples=13, **OPTIONS)


@pytest.mark.filterwarnings("ignore::orbits.errors.StepWarning")
def test_the_energy_survives_encounters_that_the_map_alone_cannot_follow():
    followed, alone = (
        energy_errors(orbits.propagate(planets(), method, duration=800 * u.yr, samples=9, **OPTIONS))
        for method in (FOLLOW, WARN)
    )
    assert followed.max() < 3e-9  # 9e-10 was reached
    assert alone.max() > 0.1  # 0.3; 8e-8 before the closest of them


def test_planets_are_where_steps_chosen_one_by_one_lead_them(scattered):
    """After the first two encounters, before chaos has made the difference of the map in quiet times large."""
    exact = orbits.propagate(planets(), duration=100 * u.yr, samples=3, progress=False)
    assert len([one for one in scattered.excursions if one.left < 80 * u.yr]) == 2
    assert np.abs((exact.q[-1] - scattered.q[2]).to_value(u.au)).max() < 1e-6  # 3e-7


def test_samples_change_no_bit(scattered):
    times = np.sort(np.random.default_rng(1).uniform(0.0, 600.0, 90)) * u.yr
    many = orbits.propagate(
        planets(), FOLLOW, duration=600 * u.yr, samples=np.concatenate([[0.0] * u.yr, times, [600.0] * u.yr]), **OPTIONS
    )
    assert np.array_equal(many.q[-1], scattered.q[-1])
    assert np.array_equal(many.v[-1], scattered.v[-1])
    assert many.excursions.to_records() == scattered.excursions.to_records()


def test_what_happened_is_listed_in_whole_steps(scattered, tmp_path):
    found = scattered.excursions
    assert found.total == len(found) == 13
    assert f"{found.total} excursions from the map" in repr(scattered)
    assert "not reversible" in repr(found)
    assert found[0].bodies == ("c", "d")
    assert found[0].left == 14500 * u.day
    for one, following in pairwise(found):
        assert one.left < one.returned <= following.left
        assert one.left.value % 100.0 == one.returned.value % 100.0 == 0.0
    table = found.to_table()
    assert len(table) == 13
    assert table["returned"].unit == u.day
    assert table["left"].value.tolist() == [one.left.value for one in found]
    assert repr(found[:3].to_table()) == repr(table[:3])
    assert repr(pickle.loads(pickle.dumps(scattered)).excursions) == repr(found)
    stored = orbits.propagate(
        planets(), FOLLOW, duration=600 * u.yr, samples=13, archive=tmp_path / "run.h5", **OPTIONS
    )
    opened = orbits.Trajectory.open(stored.path)
    assert opened.excursions.to_records() == found.to_records()
    assert np.array_equal(opened.q, scattered.q)


@pytest.mark.parametrize(("years", "samples"), at((1, 3), [(300, 9), (300, 40), (300, 87), (200, 25), (200, 40)]))
def test_a_run_that_was_stopped_is_resumed_to_the_same_bits(years, samples, tmp_path):
    """At samples on the map, and on excursions from it; also after a step of an excursion that is longer than dt."""
    options = {**OPTIONS, "duration": years * u.yr, "samples": 101, "approaches": True}
    whole = orbits.propagate(planets(), FOLLOW, **options)
    stop = whole.t[samples]
    part = orbits.propagate(
        planets(), FOLLOW, archive=tmp_path / "run.h5", callback=lambda t, _: bool(t >= stop), **options
    )
    assert len(part) == samples + 1
    away = bool(part.archive.checkpoint()["excursion_counts"][0])
    assert away == any(one.left <= stop and one.returned > stop for one in whole.excursions)
    rest = orbits.resume(part.path, progress=False)
    assert np.array_equal(rest.q, whole.q)
    assert np.array_equal(rest.v, whole.v)
    assert rest.excursions.to_records() == whole.excursions.to_records()
    assert str(rest.closest_approaches()) == str(whole.closest_approaches())


def test_without_encounters_every_bit_is_that_of_the_map():
    """The Sun and eight planets in steps of 3 d."""
    gm, q, v, _ = solar_system(8)
    names = ["Sun", *map(str, range(8))]
    start = orbits.System(names, gm, q, v, units=orbits.SOLAR)
    options = {"dt": "3 d", "duration": "200 yr", "samples": 5, "progress": False}
    followed, plain = (orbits.propagate(start, method, **options) for method in (FOLLOW, WARN))
    assert not len(followed.excursions)
    assert repr(followed.excursions) == "no excursions from the map"
    for quiet in (followed, plain):
        table = quiet.excursions.to_table()
        assert table.colnames == ["bodies", "left", "returned"]
        assert not len(table)
        assert table["left"].unit == table["returned"].unit == orbits.SOLAR.time
    assert np.array_equal(followed.q, plain.q)
    assert np.array_equal(followed.v, plain.v)


@pytest.mark.nightly
def test_planets_that_have_exchanged_places_are_numbered_anew():
    """Two Neptunes: the order of their orbits at the start is not that after their encounters."""
    start = planets(5.15e-5, (5.0, 5.3), 0.08, seed=3)
    gm, q, v, _ = start.values
    problem = Problem(newtonian, FOLLOW, parameters(gm), gm > 0.0, ConstantSteps(100.0), retire=True)
    march = PlanetExcursions(problem, q, v)
    first, exchanged = outwards(gm, *march.state()), 0
    for k in range(1, 400):
        march.advance_to(Place(20 * k, 0.0))
        rows, _ = march.excursions()
        if march.leg is march.home and len(rows) and march.step == rows[-1, 1]:
            order = [0, *(int(x) for x in march.home.stepper.state["memory"][14, : len(gm) - 1])]
            assert order == outwards(gm, *march.state())
            exchanged += order != first
    assert exchanged


def test_closest_approaches_and_events_within_encounters_are_those_of_chosen_steps():
    options = {"duration": 80 * u.yr, "samples": 3, "progress": False, "events": CloseApproach("c", "d")}
    followed = orbits.propagate(planets(), FOLLOW, dt="100 d", approaches=True, **options)
    exact = orbits.propagate(planets(), **options)
    assert len(followed.events) == len(exact.events) > 0
    for one, other in zip(followed.events, exact.events, strict=True):
        assert abs(one.time - other.time) < 1e-3 * u.day
    found, expected = (
        min(a.distance for a in run.closest_approaches()["c"] if a.other == "d" or a.body == "d")
        for run in (followed, exact)
    )
    assert abs(found - expected) < 1e-6 * u.au


def test_states_between_samples_are_those_of_a_run_with_samples_there(scattered):
    """Within an excursion, and between two: a march that begins at a sample leaves the map at other times."""
    times = [14_800.0, 17_000.0, 24_000.0, 27_777.0] * u.day
    sampled = orbits.propagate(planets(), FOLLOW, until=times[-1], samples=[0.0 * u.day, *times], **OPTIONS)
    there = scattered.at(times)
    assert np.abs((there.q - sampled.q[1:]).to_value(u.au)).max() < 5e-8  # 9e-9, of 3e-7 that the map is off


def test_backwards_in_time_encounters_are_followed_too():
    run = orbits.propagate(planets(), FOLLOW, duration=-300 * u.yr, samples=7, **OPTIONS)
    assert run.excursions[0].left < 0 * u.day
    assert run.excursions.total > 3
    assert energy_errors(run).max() < 1e-8


@pytest.mark.parametrize(
    ("method", "most"),
    [
        # 2e-5, that of these coordinates without encounters
        (orbits.WisdomHolman(coordinates="democratic-heliocentric", encounters="follow planets"), 5e-5),
        (SABA(10, 6, 4, encounters="follow planets"), 2e-8),
    ],
    ids=["democratic-heliocentric", "SABA"],
)
def test_other_maps_follow_encounters_as_well(method, most):
    run = orbits.propagate(planets(), method, duration=200 * u.yr, samples=5, **OPTIONS)
    assert run.excursions.total >= 3
    assert energy_errors(run).max() < most


@pytest.mark.nightly
def test_lists_of_systems_and_terms_of_positions_go_through_encounters():
    options = {**OPTIONS, "duration": 150 * u.yr, "samples": 4}
    pole = (0.0 * u.deg, 90.0 * u.deg)
    flat = ZonalHarmonics("star", J2=1e-3, radius=696_000 * u.km, pole=pole)
    several = [planets(), planets(seed=2)]
    for systems in (several, [one.with_terms(flat) for one in several]):
        found = orbits.propagate(systems, FOLLOW, **options)
        assert all(run.excursions.total for run in found)
        alone = orbits.propagate(systems[1], FOLLOW, **options)
        assert np.array_equal(found[1].q, alone.q)
        assert alone.drift().energy.max_fraction < 3e-9


def test_a_condition_ends_a_run_within_an_encounter():
    stop, options = CloserThan(0.9 * u.au, "b", "c"), {"duration": 200 * u.yr, "samples": 3, "progress": False}
    followed = orbits.propagate(planets(), FOLLOW, dt="100 d", stop=stop, **options)
    exact = orbits.propagate(planets(), stop=stop, **options)
    assert followed.excursions[-1].returned is None
    assert abs(followed.stopped.time - exact.stopped.time) < 10 * u.day  # by the error of the map before
    assert followed.stopped.reason.startswith("b and c: closer than 0.9 AU")


@pytest.mark.filterwarnings("ignore::orbits.errors.StepWarning")
def test_a_pericentre_of_a_planet_that_the_step_does_not_resolve_is_followed():
    """e = 0.9 at 3 au beside a Jupiter at 12 au: five steps in a full turn at the pericentre."""
    gm = SUN * np.array([1.0, 1e-4, 1e-3])
    inner, outer = state_from_elements(SUN, a=3.0, e=0.9, M=3.0), state_from_elements(SUN, a=12.0, M=1.0)
    q, v = (np.array([np.zeros(3), one, two]) for one, two in zip(inner, outer, strict=True))
    start = orbits.System(["star", "b", "c"], gm, q, v, units=orbits.SOLAR)
    options = {"dt": "12 d", "duration": "500 yr", "samples": 11, "progress": False}
    followed, alone = (energy_errors(orbits.propagate(start, method, **options)) for method in (FOLLOW, WARN))
    assert followed.max() < 1e-8
    assert alone.max() > 30.0 * followed.max()


PARTICLES = [(3.0, 0.1), (5.4, 0.2), (6.5, 0.1), (9.0, 0.2), (11.0, 0.05)]


def test_massless_particles_go_along(tmp_path):
    """The planets keep their bits; particles are where chosen steps lead them, and a resumed run has the same bits."""
    method = orbits.WisdomHolman(encounters="follow")
    start = planets(particles=PARTICLES)
    options = {"dt": "100 d", "duration": 80 * u.yr, "samples": 9, "progress": False}
    run = orbits.propagate(start, method, **options)
    assert np.array_equal(run.q[:, :4], orbits.propagate(planets(), FOLLOW, **options).q)
    exact = orbits.propagate(start, duration=80 * u.yr, samples=9, progress=False)
    off = np.linalg.norm((run.q - exact.q).to_value(u.au), axis=2)
    assert np.median(off[-1, 4:]) < 1e-6  # 1e-7
    stop = run.t[4]  # away
    part = orbits.propagate(
        start, method, archive=tmp_path / "run.h5", callback=lambda t, _: bool(t >= stop), threads=1, **options
    )
    rest = orbits.resume(part.path, progress=False)
    assert np.array_equal(rest.q, run.q)


@pytest.mark.filterwarnings("ignore::orbits.errors.RetiredWarning")
def test_particles_that_hit_a_planet_on_an_excursion_are_retired_there(tmp_path):
    """A pair of planets that is bound, so that the map is never entered, each with a radius of 0.02 au."""
    gm = SUN * np.array([1.0, 1e-3, 1e-3, 0.0, 0.0])
    centre, speed = state_from_elements(SUN, a=5.0, M=0.0)
    apart, turn = np.array([0.1, 0.0, 0.0]), np.array([0.0, np.sqrt(2e-3 * SUN / 0.1), 0.0])
    q = np.array([np.zeros(3), centre - apart / 2, centre + apart / 2, centre + 0.3 * turn / turn[1], 3.0 * centre])
    v = np.array([np.zeros(3), speed - turn / 2, speed + turn / 2, speed, speed / np.sqrt(3.0)])
    start = orbits.System(
        ["star", "b", "c", "falls", "stays"], gm, q, v, units=orbits.SOLAR, radii=[0.0, 0.04, 0.04, 0.0, 0.0]
    )
    method = orbits.WisdomHolman(encounters="follow")
    options = {"dt": "50 d", "duration": "3000 d", "samples": 4, "progress": False}
    run = orbits.propagate(start, method, archive=tmp_path / "run.h5", **options)
    assert run.excursions[0].returned is None
    (lost,) = run.retired
    assert lost.name == "falls"
    assert lost.reason in ("it hit b", "it hit c")
    there = orbits.propagate(start, duration="3000 d", samples=2, progress=False).at(lost.time)
    gap = np.linalg.norm(there[lost.reason[-1]].q - lost.q) - 0.04 * u.au
    assert abs(gap) < 1e-8 * u.au
    assert np.isnan(run.q[-1, 3]).all()
    assert np.isfinite(run.q[-1, 4]).all()
    opened = orbits.Trajectory.open(run.path)
    assert opened.retired.to_records() == run.retired.to_records()


def test_radii_change_nothing_without_particles_that_are_followed():
    """The radii of bodies matter to particles that are followed to their surfaces, and to nobody else."""
    started = ((4.0, 0.6), (12.0, 0.8), (12.0, 0.7), (4.5, 0.7))
    for particles in ((), started):
        plain = planets(particles=particles)
        radii = np.where(plain.massive, 1e-7, 0.0)
        radii[0] = 2.2
        runs = [
            orbits.propagate(system, FOLLOW, duration=100 * u.yr, samples=3, check_step=False, **OPTIONS)
            for system in (plain, plain.replaced(radii=radii))
        ]
        assert len(runs[0].excursions) == len(runs[1].excursions) > 0
        assert len(runs[0].retired) == len(runs[1].retired)
        assert np.array_equal(runs[0].q.value, runs[1].q.value, equal_nan=True)
        assert np.array_equal(runs[0]._record.listed, runs[1]._record.listed)


def test_a_dt_too_long_is_warned_of_and_refused_though_planets_are_followed():
    with pytest.raises(InputError, match=r"All bodies would be away from the map for good\. dt <= "):
        orbits.propagate(planets(), FOLLOW, dt="1500 d", duration="100 yr", check_step="refuse", progress=False)


@pytest.mark.nightly
def test_relativity_by_the_star_acts_in_encounters_too():
    start = planets().with_terms(PostNewtonian(sources=["star"]))
    run = orbits.propagate(start, FOLLOW, **{**OPTIONS, "duration": 200 * u.yr})
    assert len(run.excursions)
    assert run.drift().energy.max_fraction < 1e-8  # 7e-10
    assert run.drift().angular_momentum.max_fraction < 1e-14


@pytest.mark.filterwarnings("ignore::orbits.errors.RetiredWarning", "ignore::orbits.errors.StepWarning")
@pytest.mark.parametrize(
    ("mass", "sizes", "radius", "years", "count"),
    first(
        1,
        [
            (1e-3, (5.2, 6.3, 7.9), 0.3, 60, 4),
            (1e-3, (5.2, 6.3, 7.9), 0.3, 200, 13),
            (1e-4, (5.2, 7.3, 9.9), 0.1, 200, 4),
        ],
    ),
)
def test_impacts_are_at_the_surface_whatever_the_samples(mass, sizes, radius, years, count):
    """By steps of their own among those of the map, and on excursions: blocks end between contact and pericentre."""
    apart = [(3.0, 0.1), (5.25, 0.05), (6.0, 0.2), (9.0, 0.1), (40.0, 0.3)]
    particles = [*apart, *((5.2 + 0.15 * k, 0.1) for k in range(16))]
    start = planets(mass, sizes, particles=particles)
    radii = np.where(start.massive, radius, 0.0)
    radii[0] = 0.005
    method = orbits.WisdomHolman(encounters="follow")
    options = {**OPTIONS, "duration": years * u.yr}
    seen = []
    for samples in (3, 101):
        run = orbits.propagate(start.replaced(radii=radii * u.au), method, samples=samples, **options)
        seen.append([(one.name, one.reason, one.time.value, one.q.value.tolist()) for one in run.retired])
    assert len(seen[0]) == count
    assert seen == [seen[0]] * 2
    times = np.unique([0.0, *(one.time.value for one in run.retired), years * YEAR])
    free = orbits.propagate(start, method, samples=times * u.day, **options)
    for one in run.retired:
        there, body = free.q.value[times == one.time.value], start.names.index(one.reason.split()[-1])
        # Reached: 5e-12, of which one.time leaves the rounding errors.
        assert abs(np.linalg.norm(one.q.value - there[0, body]) / radii[body] - 1.0) < 1e-10


def test_what_does_not_fit_is_refused():
    start, options = planets(), {"dt": "100 d", "duration": "10 yr"}
    with pytest.raises(InputError, match="leave it out"):
        orbits.propagate(start, FOLLOW, dense=True, **options)
    with pytest.raises(InputError, match="encounters='warn'"):
        orbits.megno(start, FOLLOW, **options)
    with pytest.raises(InputError, match="expected 'warn', 'follow', 'follow particles'"):
        orbits.WisdomHolman(encounters="ignore")
    with pytest.warns(StepWarning, match='encounters="follow"'):
        orbits.propagate(start, WARN, dt="100 d", duration="1 yr", progress=False)


def touch(t, system):
    """Change the bodies by too little to matter."""
    return system.replaced(v=system.values.v * (1.0 + 1e-15))


def test_events_that_act_during_an_encounter_leave_the_run_in_it():
    """A change too small to matter: the run goes on by chosen steps, and all its excursions are listed."""
    options = {"until": 40_000 * u.day, "samples": 5, **OPTIONS}
    plain = orbits.propagate(planets(), FOLLOW, events=CloserThan(1.2 * u.au, "c", "d"), **options)
    acted = orbits.propagate(planets(), FOLLOW, events=CloserThan(1.2 * u.au, "c", "d", then=touch), **options)
    assert len(acted.events) == len(plain.events) == 1
    first = plain.excursions[0]
    assert first.left < acted.events[0].time < first.returned
    assert [one.left for one in acted.excursions] == [one.left for one in plain.excursions]
    assert np.abs(acted.q - plain.q).max() < 1e-6 * u.au


THREE = orbits.System.solar_system(bodies=["Sun"]).add(
    ["b", "c", "d"], primary="Sun", gm=[2.8e-7] * 3 * u.au**3 / u.day**2, a=[5.2, 6.3, 7.9] * u.au, M=[0, 2, 4] * u.rad
)
FORWARDS, BACKWARDS = CloserThan(2.5 * u.au, "b", "c", then=touch), Pericentre("b", then=touch)
"""Events that act at 4347 d and at -10725 d: so soon before an encounter that it begins in the rest of their step."""


def three_planets(days, event, *events, samples=4, **more):
    given = {**OPTIONS, "duration": days * u.day, "samples": samples, "check_step": False, **more}
    return orbits.propagate(THREE, FOLLOW, events=[event, *events], **given)


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("days", "event", "changed", "pairs"),
    first(1, [
        (21900, FORWARDS, 43, [("b", "c")]), (-21900, BACKWARDS, 107, [("b", "d"), ("b", "c"), ("c", "d")])
    ]),
)
def test_an_encounter_that_begins_soon_after_a_change_is_listed(days, event, changed, pairs, tmp_path):
    """All bodies are in chosen steps when it begins, for the rest of the step of the change; resumed within the first
    of these steps, in the encounter and before the change.
    """
    plain = three_planets(days, replace(event, then="record"))
    whole = three_planets(days, event, samples=61)
    assert [one.bodies for one in whole.excursions] == [one.bodies for one in plain.excursions] == pairs
    k = pairs.index(("b", "c"))
    (left, returned), (usual, until) = whole.excursions[k].steps, plain.excursions[k].steps
    assert changed <= left <= usual
    assert abs(returned - until) < 5
    assert three_planets(days, event).excursions.to_records() == whole.excursions.to_records()
    first = int(np.searchsorted(np.abs(whole.t.value), 100.0 * left))
    for sample in (first - 1, first, first + 1, first + 4):
        path = tmp_path / f"{sample}.h5"
        stop = abs(whole.t[sample])
        three_planets(days, event, samples=61, archive=path, callback=lambda t, _, stop=stop: bool(abs(t) >= stop))
        rest = orbits.resume(path, events=[event], progress=False)
        assert np.array_equal(rest.q, whole.q)
        assert np.array_equal(rest.v, whole.v)
        for run in (rest, orbits.Trajectory.open(path)):
            assert run.excursions.total == len(pairs)
            assert run.excursions.to_records() == whole.excursions.to_records()


def test_the_encounter_of_a_changed_run_is_listed_though_it_ends_early_or_changes_again():
    """In the encounter, shortly after a second change there, and in a step with two changes; not if it ends before."""
    in_it, at_once = CloserThan(1.9 * u.au, "b", "c", then=touch), CloserThan(2.52 * u.au, "b", "c", then=touch)
    last = three_planets(4700, FORWARDS).events[0].time
    assert 4300 * u.day < last < 4400 * u.day
    for days, events, count in (
        (last.value, [], 0),
        (last.value + 1.0, [], 0),
        (4700, [], 1),
        (4680, [in_it], 1),
        (21900, [in_it], 1),
        (4700, [at_once], 1),
        (21900, [at_once], 1),
    ):
        run = three_planets(days, FORWARDS, *events)
        assert len(run.events) == 1 + len(events)
        assert run.excursions.total == len(run.excursions) == count
        for one in run.excursions:
            assert one.bodies == ("b", "c")
            assert one.steps[0] in (43, 44, 45)
            assert (one.returned is None) == (days < 5000)
    two = three_planets(4700, FORWARDS, at_once).events
    assert 4300 * u.day < two[0].time < two[1].time < 4400 * u.day
