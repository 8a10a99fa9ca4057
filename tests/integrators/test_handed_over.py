"""Massless particles that a Wisdom–Holman map cannot follow take steps of their own, each alone, and return."""

import warnings

import numpy as np
import pytest
from astropy import units as u

import orbits
from orbits.elements import ecliptic_to_icrf, state_from_elements
from orbits.errors import InputError, RetiredWarning, SingularityError, StepWarning
from orbits.kernels.maps.jacobi_particles import ELSEWHERE, NUMBER
from orbits.lagrangians.newtonian import newtonian, parameters
from orbits.marching.clocks.adaptive import Adaptive
from orbits.marching.clocks.step_times import Place
from orbits.marching.legs.leg import Leg
from orbits.terms import ZonalHarmonics

FOLLOW, WARN = orbits.WisdomHolman(encounters="follow particles"), orbits.WisdomHolman(encounters="warn")
GAUSS = orbits.Gauss(stages=8)
DT = 100.0
KM = 149597870.7


def giants():
    """Sun, Jupiter and Saturn, in au and days."""
    start = orbits.System.solar_system("2022-08-09", bodies=["Sun", "Jupiter", "Saturn"])
    return start.values.gm, start.values.q, start.values.v


def with_particles(elements):
    """The same, with massless particles of these (a, e, M)."""
    gm, q, v = giants()
    places, speeds = zip(*(state_from_elements(gm[0], a=a, e=e, M=M) for a, e, M in elements), strict=True)
    return (
        np.append(gm, np.zeros(len(places))),
        np.vstack([q, q[0] + ecliptic_to_icrf(np.array(places))]),
        np.vstack([v, v[0] + ecliptic_to_icrf(np.array(speeds))]),
    )


CROSSERS = [(a, 0.3, M) for a, M in zip(np.linspace(4.5, 6.0, 50), np.linspace(0.0, 6.0, 50), strict=True)]
QUIET = [(2.9, 0.02, 1.0), (3.1, 0.05, 2.0), (15.0, 0.1, 3.0)]
PLUNGER = (2.5, 0.96, 2.0)


def marcher(method, gm, q, v, h, **options):
    massive = gm > 0
    return Leg.of(newtonian, method, parameters(gm[massive]), massive, q, v, h, retire=True, **options)


def marched(method, gm, q, v, h, steps, **options):
    run = marcher(method, gm, q, v, h, **options)
    run.advance(steps)
    return run.state()


def exactly(gm, q, v, time):
    """Where steps chosen one by one lead."""
    clock = Adaptive().towards(np.sign(time))
    run = Leg.of(newtonian, GAUSS, parameters(gm[gm > 0]), gm > 0, q, v, clock, retire=True)
    place = Place(0, time)
    run.advance_to(place)
    return run.state_at(place)[0]


@pytest.mark.parametrize("h", [DT, -DT])
def test_bits_depend_neither_on_neighbours_nor_threads_nor_blocks_nor_the_order_of_the_bodies(h):
    """Nor on what is sampled, nor on a checkpoint on the way, in which some particles are away."""
    gm, q, v = with_particles([*CROSSERS[::2], *QUIET, PLUNGER])
    run, steps = marcher(FOLLOW, gm, q, v, h, threads=3), 250
    run.advance(steps)
    x, w = run.state()
    assert np.array_equal(marched(WARN, gm[:3], q[:3], v[:3], h, steps)[0], x[:3])
    plain = marched(WARN, gm, q, v, h, steps)
    quiet = slice(28, 31)
    assert np.array_equal(plain[0][quiet], x[quiet])
    met = ~(plain[0][3:28] == x[3:28]).all(axis=1)
    assert met.sum() > 8
    order = np.append([2, 0, 1], 3 + np.random.default_rng(1).permutation(len(gm) - 3))
    other = marcher(FOLLOW, gm[order], q[order], v[order], h)
    other.block, away = 7, set()
    for count in (20, 37, 93, 100):
        other.advance(count)
        other.state_after(0.3 * h)
        away |= set(np.flatnonzero(other.stepper.state["particle_memory"][:, 0, NUMBER] == ELSEWHERE))
        saved = other.checkpoint()
        other = marcher(FOLLOW, gm[order], q[order], v[order], h)
        other.restore(saved)
    assert len(away) > 3
    assert np.array_equal(other.state()[0], x[order])
    assert np.array_equal(other.state()[1], w[order])
    for k in (5, 17, 27, 30, 31):
        alone = np.append(np.arange(3), k)
        assert np.array_equal(marched(FOLLOW, gm[alone], q[alone], v[alone], h, steps)[0][-1], x[k])


def test_crossers_come_out_of_their_encounters_as_by_steps_chosen_one_by_one():
    """40 years back, three quarters of them are off by less than 145 km in steps of 100 days and 0.5 km in those of 25,
    which is what the map leaves, magnified by encounters. Warned of only, a quarter is off by more than 5e5 km.
    """
    gm, q, v = with_particles([*CROSSERS, *QUIET])
    exact = exactly(gm, q, v, -14600.0)
    off = {}
    for method, h in ((FOLLOW, -DT), (FOLLOW, -DT / 4), (WARN, -DT)):
        x = marched(method, gm, q, v, h, round(-14600.0 / h))[0]
        off[method, h] = np.quantile(np.linalg.norm(x - exact, axis=1)[3:53] * KM, 0.75)

    assert off[FOLLOW, -DT] < 200.0
    assert off[FOLLOW, -DT / 4] < 1.0
    assert off[WARN, -DT] > 1e5


def system(elements):
    gm, q, v = with_particles(elements)
    names = ["Sun", "Jupiter", "Saturn", *(f"p{k}" for k in range(len(elements)))]
    return orbits.System(names, gm, q, v, units=orbits.SOLAR, epoch="2022-08-09")


def ends(start, method=None, *, years=-40, **options):
    options = {"duration": years * u.yr, "samples": [years * u.yr], "progress": False, "check_step": False, **options}
    return orbits.propagate(start, method, **options).q.to_value(u.km)[-1]


@pytest.mark.nightly
def test_crossers_are_followed_by_the_terms_of_the_run_too():
    """In steps of 25 days, about a Sun as flat as puts them 1e5 km off in 40 years; and each alone to the same bits."""
    flat = ZonalHarmonics("Sun", J2=1e-3, radius=0.3 * u.au, pole=(0.2, 0.1, 0.97))
    start = system(CROSSERS[:16]).with_terms(flat)
    found, exact, round_ = ends(start, FOLLOW, dt=25 * u.day), ends(start), ends(start.replaced(terms=()))
    off, flatness = np.linalg.norm(found - exact, axis=1)[3:], np.linalg.norm(round_ - exact, axis=1)[3:]
    assert np.median(off) < 1.5  # seen: 0.56
    assert flatness.min() > 5e4
    alone = start.remove(*(f"p{k}" for k in range(16) if k != 6))
    assert np.array_equal(ends(alone, FOLLOW, dt=25 * u.day)[-1], found[3 + 6])


@pytest.mark.nightly
def test_crossers_are_followed_in_democratic_heliocentric_coordinates_too():
    """With the error that its steps have without encounters: that of the last three particles, which have none."""
    start, coordinates = system([*CROSSERS[:16], *QUIET]), {"coordinates": "democratic-heliocentric"}
    exact = ends(start)
    off, left = (
        np.linalg.norm(ends(start, orbits.WisdomHolman(**coordinates, **more), dt=25 * u.day) - exact, axis=1)[3:]
        for more in ({"encounters": "follow"}, {})
    )
    assert np.array_equal(off[16:], left[16:])
    assert np.median(off[:16]) < 10.0 * off[16:].max()  # seen: 45,000 km, and 12,000
    assert np.median(left[:16]) > 30.0 * off[16:].max()  # seen: 820,000 km


@pytest.mark.nightly
def test_closest_approaches_of_followed_particles_do_not_depend_on_threads():
    """To the last bit: each share of the particles has its own bodies, which are seen the same in all."""
    start = system(CROSSERS)
    options = {"dt": 25 * u.day, "samples": 2, "approaches": True, "progress": False}
    one, other = (
        orbits.propagate(start, FOLLOW, duration=-30 * u.yr, threads=threads, **options)
        for threads in (1, 5)
    )
    found, expected = other.closest_approaches().distance, one.closest_approaches().distance
    assert np.array_equal(found, expected, equal_nan=True)


def test_samples_archives_threads_and_times_between_leave_the_run_as_it_is(tmp_path):
    """The archive ends while a particle is away. Between the steps, states are within what the map leaves of those of
    steps chosen one by one, in encounters too.
    """
    start, options = system([*CROSSERS[:16], PLUNGER]), {"dt": -DT * u.day, "progress": False}
    with warnings.catch_warnings():
        warnings.simplefilter("error", StepWarning)  # all passages are followed
        many = orbits.propagate(start, FOLLOW, duration=-30 * u.yr, samples=41, approaches=True, **options)
        part = orbits.propagate(
            start, FOLLOW, duration=-11 * u.yr, samples=3, archive=tmp_path / "run.h5", threads=2, **options
        )
        whole = orbits.resume(part.path, until=-30 * u.yr, progress=False, threads=1)
    assert (part.archive.checkpoint()["particle_memory"][:, 0, NUMBER] == ELSEWHERE).any()
    assert np.array_equal(many.q[-1], whole.q[-1])
    assert np.array_equal(many.v[-1], whole.v[-1])
    exact = orbits.propagate(start, duration=-30 * u.yr, samples=many.t, progress=False)
    off = np.linalg.norm((many.q - exact.q).to_value(u.km), axis=2)
    assert np.median(off.max(axis=0)) < 300.0  # 120 were reached; those quiet until then are off by 0.01
    closest, expected = many.closest_approaches(), exact.closest_approaches()
    for name in ("p14", "p13", "p8"):  # between the ends of steps that Jupiter passes in a third of their length
        one, other = (next(a for a in found[name] if a.other == "Jupiter") for found in (closest, expected))
        assert abs(one.distance - other.distance) < 1e-5 * u.au
        assert abs(one.time - other.time) < 0.01 * u.day


@pytest.mark.filterwarnings("ignore::orbits.errors.RetiredWarning")
def test_particles_that_hit_a_body_are_retired_with_time_and_place(tmp_path):
    """Jupiter and the Sun with radii of 0.1 and 0.12 au: time and place are those at which steps chosen one by one have
    that distance, but for what the map leaves of the way there; the others keep their bits.
    """
    start = system([*CROSSERS[:16], PLUNGER])
    large = start.replaced(radii=[0.12, 0.1, 0.0, *np.zeros(17)] * u.au)
    options = {"dt": -DT * u.day, "progress": False, "duration": -30 * u.yr, "samples": 4}
    free = orbits.propagate(start, FOLLOW, **options)
    run = orbits.propagate(large, FOLLOW, **options)
    assert {(one.name, one.reason) for one in run.retired} == {
        ("p8", "it hit Jupiter"),
        ("p13", "it hit Jupiter"),
        ("p14", "it hit Jupiter"),
        ("p16", "it hit Sun"),
    }
    exact = orbits.propagate(start, duration=-30 * u.yr, samples=2, progress=False)
    for one in run.retired:
        there, body = exact.at(one.time), "Sun" if one.name == "p16" else "Jupiter"
        radius = large[body].radius
        gap = np.linalg.norm(one.q - there[body].q) - radius
        assert abs(gap) < 1e-6 * u.au
        assert np.linalg.norm(one.q - there[one.name].q) < 1e-5 * u.au
    gone = np.array([name in run.retired.names for name in start.names])
    assert np.array_equal(run.q[:, ~gone], free.q[:, ~gone])
    assert np.isnan(run.q[-1, gone]).all()
    part = orbits.propagate(
        large, FOLLOW, archive=tmp_path / "run.h5", threads=1, **{**options, "duration": -10 * u.yr, "samples": 2}
    )
    whole = orbits.resume(part.path, until=-30 * u.yr, progress=False)
    assert [(one.name, one.time, one.q.value.tolist()) for one in whole.retired] == [
        (one.name, one.time, one.q.value.tolist()) for one in run.retired
    ]


@pytest.mark.filterwarnings("ignore::orbits.errors.RetiredWarning")
@pytest.mark.parametrize("encounters", ["follow", "warn"])
def test_what_is_ejected_or_falls_too_close_is_retired_after_every_64th_step(encounters):
    gm, q, v = with_particles([(3.0, 0.0, 1.0), (2.9, 0.3, 1.0), QUIET[1]])
    v[3] *= 1.5  # on an open orbit
    names = ["Sun", "Jupiter", "Saturn", "comet", "stone", "rock"]
    start = orbits.System(names, gm, q, v, units=orbits.SOLAR)
    method = orbits.WisdomHolman(encounters=encounters, ejected_beyond=30.0, lost_within=2.1)
    options = {"dt": 60 * u.day, "duration": 50 * u.yr, "progress": False, "check_step": False}
    with pytest.warns(RetiredWarning, match="retired 2 massless particles, as asked: their q and v") as seen:
        run = orbits.propagate(start, method, samples=3, **options)
    assert not any("smaller dt" in str(each.message) for each in seen)
    again = orbits.propagate(start, method, samples=29, **options)
    reasons = {one.name: one.reason for one in run.retired}
    assert reasons == {"comet": "it was ejected", "stone": "its pericentre is below the limit"}
    assert [(one.step, one.q.value.tolist()) for one in run.retired] == [
        (one.step, one.q.value.tolist()) for one in again.retired
    ]
    comet, stone = run.retired["comet"], run.retired["stone"]
    assert comet.step % 64 == 0
    assert stone.step == 64
    before = again.at(comet.time - 64 * 60 * u.day)
    assert np.linalg.norm(before["comet"].q - before["Sun"].q) < 30 * u.au < np.linalg.norm(comet.q)


def test_planets_that_meet_end_the_run_if_asked():
    """Two planets of a tenth of Jupiter's mass, a third of an au apart: the run ends before the step of their passage,
    wherever samples are, and with all before it.
    """
    gm, q, v = with_particles([QUIET[1]])
    q[2], v[2] = state_from_elements(gm[0], a=5.4, e=0.02, M=0.5)
    q[1], v[1] = state_from_elements(gm[0], a=5.1, e=0.02, M=1.5)
    q[1:3], v[1:3] = q[1:3] + q[0], v[1:3] + v[0]
    gm[1:3] *= [0.1, 0.3]
    start = orbits.System(["Sun", "one", "other", "p"], gm, q, v, units=orbits.SOLAR)
    options = {"dt": DT * u.day, "duration": 300 * u.yr, "progress": False, "check_step": False}
    warned = orbits.propagate(start, WARN, samples=4, **options)
    met = min(warned.unresolved(), key=lambda passage: passage.time)
    ends = []
    for samples in (4, 61):
        with pytest.raises(SingularityError, match="within 3 mutual Hill radii") as caught:
            orbits.propagate(start, orbits.WisdomHolman(encounters="refuse"), samples=samples, **options)
        ends.append(caught.value.step)
        assert set(caught.value.bodies) == {"one", "other"}
        assert len(caught.value.trajectory) == np.searchsorted(np.linspace(0, 300, samples), caught.value.time / 365.25)
    assert ends[0] == ends[1] == int(met.time / (DT * u.day))


def test_what_does_not_fit_is_refused():
    with pytest.raises(InputError, match="expected 'warn', 'follow', 'follow particles'"):
        orbits.WisdomHolman(encounters="leave")
    with pytest.raises(InputError, match="ejected_beyond is -3; expected a distance above 0"):
        orbits.WisdomHolman(ejected_beyond=-3)
    with pytest.raises(InputError, match=r"unit of length, such as ejected_beyond=100$"):
        orbits.WisdomHolman(ejected_beyond=100 * u.au)
    with pytest.raises(InputError, match="lost_within is 3, and ejected_beyond 2; expected a smaller"):
        orbits.WisdomHolman(lost_within=3, ejected_beyond=2)


def two_equal_planets(apart=0.235, mass=1e-3):
    """Planets on circles, that pass each other at 3.4 Hill radii of one of them, within 3 mutual ones."""
    r = np.array([1.0, 1.0 + apart])
    q, v = np.zeros((2, 3, 3))
    q[1:, 0], v[1:, 1] = [1.0, -1.0] * r, [1.0, -1.0] / np.sqrt(r)
    return orbits.System(["star", "a", "b"], [1.0, mass, mass], q, v, units=orbits.DIMENSIONLESS)


def test_planets_meet_within_mutual_hill_radii_not_within_those_of_one():
    start, options = two_equal_planets(), {"duration": 40.0, "samples": 2, "progress": False, "check_step": False}
    method = orbits.WisdomHolman(encounters="refuse")
    with pytest.raises(SingularityError, match="within 3 mutual Hill radii"):
        orbits.propagate(start, method, dt=0.05, **options)
    far = two_equal_planets(0.4)
    assert orbits.propagate(far, method, dt=0.05, **options).times[-1] == 40.0
