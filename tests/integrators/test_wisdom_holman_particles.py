"""Massless particles in Wisdom–Holman maps: as accurate as planets wherever they are, to the same bits in any run."""

import warnings

import astropy.units as u
import numpy as np
import pytest

import orbits
from orbits.errors import InputError, StepWarning
from orbits.kernels.maps.jacobi_particles import NUMBER

from ..maps import EVERYWHERE, KM, among_planets, marched, marcher, system
from ..problems import three_bodies

DEFAULT, PLAIN = orbits.WisdomHolman(), orbits.WisdomHolman(kernel="standard", corrector=0)
LAZY, CORRECTED = orbits.WisdomHolman(kernel="lazy"), orbits.WisdomHolman(kernel="standard")
GAUSS = orbits.Gauss(stages=8)


@pytest.fixture(scope="module")
def truth():
    """Where all are after 1200 days, by collocation in short steps."""
    return marched(GAUSS, *among_planets(), 1.0, 1200)[0]


def test_particles_are_as_accurate_as_planets_wherever_they_are(truth):
    start = among_planets()
    for method in (DEFAULT, LAZY):
        off = KM * np.linalg.norm(marched(method, *start, 3.0, 400)[0] - truth, axis=1)
        # 4e-6 km was reached, by the comet at its pericentre; 3e-7 by the others from 1.3 au on: round-off.
        assert off.max() < 2e-5
        assert off[[9, 10, 11, 12, 14, 15]].max() < 2e-6
    off = KM * np.linalg.norm(marched(PLAIN, *start, 3.0, 400)[0] - truth, axis=1)
    assert off[9:].max() < 2.0 * off[:9].max()  # the uncorrected phase, of particles as of planets


def test_their_place_in_the_order_of_the_planets_is_by_their_pericentres(truth):
    """And no other is much better, while the usual one, outermost, is far worse inside Jupiter."""
    start = among_planets()
    numbers = marcher(DEFAULT, *start, 3.0).stepper.state["particle_memory"][:, 0, NUMBER] - 1.0
    assert numbers.tolist() == list(EVERYWHERE.values())
    off = {}
    for place in (None, 8):
        run = marcher(CORRECTED, *start, 3.0)
        if place is not None:
            run.stepper.state["particle_memory"][:, 0, NUMBER] = 1.0 + place
            run.stepper.loops.enter(run.stepper.state, run.clock)
        run.advance(400)
        off[place] = np.linalg.norm(run.state()[0] - truth, axis=1)[9:]
    assert (off[8][:3] > 20.0 * off[None][:3]).all()


@pytest.mark.parametrize(("method", "order"), [(PLAIN, 2), (CORRECTED, 2), (DEFAULT, 4), (LAZY, 4)], ids=str)
def test_the_order_is_the_declared_one_inside_between_and_outside_the_planets(method, order):
    gm, q, v = three_bodies()
    x = np.array([[0.3, 0.1, 0.02], [0.1, -1.1, 0.1], [3.0, 0.4, -0.3]])
    w = np.array([[-0.5, 1.6, 0.1], [0.95, 0.1, 0.05], [-0.1, 0.57, 0.1]])
    gm, q, v = np.append(gm, np.zeros(3)), np.vstack([q, x]), np.vstack([v, w])
    truth, _ = marched(GAUSS, gm, q, v, 6.0 / 3000, 3000)
    errors = [np.abs(marched(method, gm, q, v, 6.0 / n, n)[0] - truth)[3:].max(axis=1) for n in (128, 256)]
    measured = np.log2(errors[0] / errors[1])
    assert np.abs(measured - order).max() < 0.15 * order
    assert set(marcher(method, gm, q, v, 0.1).stepper.state["particle_memory"][:, 0, NUMBER]) == {1.0, 2.0, 3.0}


@pytest.mark.parametrize("method", [PLAIN, DEFAULT, LAZY], ids=str)
def test_bits_depend_neither_on_neighbours_nor_threads_nor_blocks_nor_the_order_of_the_bodies(method):
    """Particles of different places share registers, which are then filled by other instructions."""
    few = list(EVERYWHERE)
    gm, q, v = among_planets((few * 5)[:37])
    run = marcher(method, gm, q, v, 3.0, threads=3)
    run.advance(50)
    x, w = run.state()
    massive, _ = marched(method, gm[:9], q[:9], v[:9], 3.0, 50)
    assert np.array_equal(x[:9], massive)
    order = np.random.default_rng(1).permutation(len(gm))
    other = marcher(method, gm[order], q[order], v[order], 3.0)
    other.block = 7
    other.advance(20)
    other.state_after(1.7)
    saved = other.checkpoint()
    other = marcher(method, gm[order], q[order], v[order], 3.0)
    other.restore(saved)
    other.advance(30)
    assert np.array_equal(other.state()[0], x[order])
    assert np.array_equal(other.state()[1], w[order])
    for k in (9, 14, 40):
        alone = np.append(np.arange(9), k)
        assert np.array_equal(marched(method, gm[alone], q[alone], v[alone], 3.0, 50)[0][-1], x[k])


def test_samples_archives_and_times_between_leave_the_run_as_it_is(tmp_path):
    start, options = system(), {"dt": 3 * u.day, "progress": False, "check_step": False}
    many = orbits.propagate(start, DEFAULT, duration=1200 * u.day, samples=38, **options)
    part = orbits.propagate(
        start, DEFAULT, duration=500 * u.day, samples=4, archive=tmp_path / "run.h5", threads=1, **options
    )
    whole = orbits.resume(part.path, until=1200 * u.day, progress=False)
    assert np.array_equal(many.q[-1], whole.q[-1])
    assert np.array_equal(many.v[-1], whole.v[-1])
    truth = orbits.propagate(start, GAUSS, dt=1 * u.day, duration=1200 * u.day, samples=38, progress=False)
    off = np.linalg.norm((many.q - truth.q).to_value(u.km), axis=2)
    assert off.max() < 1e-4  # off the grid as on it: 4e-5 was reached, by Mercury
    time = 1023.4 * u.day
    assert np.abs((many.at(time).q - truth.at(time).q).to_value(u.km)).max() < 1e-4
    dense = orbits.propagate(start, DEFAULT, duration=1200 * u.day, samples=2, dense=True, **options)
    assert np.abs((dense.at(time).q - truth.at(time).q).to_value(u.km)).max() < 1e-4
    back = orbits.propagate(many[-1], DEFAULT, duration=-1200 * u.day, samples=2, **options)
    assert np.linalg.norm((back.q[-1] - start.q).to_value(u.km), axis=1).max() < 1e-3


def test_a_particle_that_cannot_be_stepped_is_retired_alone_where_it_is_seen():
    """One is so far away that its distance has no square: what is left of it is the start, and the others go on to the
    same bits.
    """
    gm, q, v = among_planets()
    q[12] = 1e200
    run = marcher(DEFAULT, gm, q, v, 3.0, retire=True)
    run.advance(300)
    (lost,) = run.retired()
    assert lost.body == 12
    assert np.array_equal(lost.q, q[12])
    assert lost.step == 0
    assert np.isnan(run.state()[0][12]).all()
    rest = np.arange(len(gm)) != 12
    assert np.array_equal(run.state()[0][rest], marched(DEFAULT, gm[rest], q[rest], v[rest], 3.0, 300)[0])
    saved = run.checkpoint()
    again = marcher(DEFAULT, gm, q, v, 3.0, retire=True)
    again.restore(saved)
    again.advance(10)
    run.advance(10)
    assert np.array_equal(again.state()[0], run.state()[0], equal_nan=True)


def test_pericentres_that_steps_do_not_resolve_are_warned_of_with_steps_that_do():
    plunging = {(2.2, 0.97): 0, (2.5, 0.1): 0}
    expected = r"too long for 1 massless particle [^§]*p0 passes Sun at 0\.066 [^§]*dt <= 0\.27 d"
    with pytest.warns(StepWarning, match=expected):
        orbits.propagate(system(plunging), DEFAULT, dt="3 d", duration="4 yr", samples=2, progress=False)


def test_encounters_of_particles_with_planets_are_named_with_time_and_place():
    """Between the kicks as well: with 60 d, Jupiter and a particle move by half of the distance in a step."""
    giants = system({(4.9, 0.1): 0, (2.5, 0.1): 0}).remove("Mercury", "Venus", "Earth-Moon barycenter", "Mars")
    options = {"samples": 2, "progress": False, "duration": 60 * u.yr}
    with pytest.warns(StepWarning, match=r"of 1 massless particle;.*\n  p0 to Jupiter: .*") as seen:
        run = orbits.propagate(giants, DEFAULT, dt="60 d", **options)
    assert "All others are right" in str(seen[-1].message)
    closest = min(run.unresolved(), key=lambda passage: passage.distance)
    listed = orbits.propagate(giants, **options).closest_approaches()["p0"]
    exact = next(passage for passage in listed if passage.other == "Jupiter")
    assert {passage.body for passage in run.unresolved()} == {"p0"}
    assert abs(closest.time - exact.time) < 0.1 * u.day
    assert abs(closest.distance - exact.distance) < 1e-3 * u.au
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        orbits.propagate(giants.remove("p0"), DEFAULT, dt="60 d", **options)


@pytest.mark.nightly
def test_it_is_certified_with_particles():
    start = system({(2.5, 0.1): 0, (1.3, 0.1): 0})
    for method in (DEFAULT, PLAIN):
        found = orbits.certify(start, method, 3 * u.day)
        assert found.ok, found.table()
        assert found["symplecticity of particles"].holds
        assert found["symplecticity of particles"].measured < 1e-12  # 9e-14 was reached


def excited():
    """Jupiter on an eccentric orbit and particles, of which one comes close to it and another one to the Sun."""
    solar = orbits.System.solar_system(bodies=["Sun", "Jupiter", "Saturn"])
    a, e, M = [2.5, 4.7, 2.9, 1.6] * u.au, [0.1, 0.15, 0.1, 0.93], [1.0, 0.5, 4.0, 3.2] * u.rad
    return solar.add(["quiet", "crosser", "other", "plunger"], primary="Sun", a=a, e=e, M=M)


@pytest.mark.filterwarnings("ignore::orbits.errors.OrbitsWarning")
def test_particles_are_retired_before_what_the_map_cannot_follow_if_asked(tmp_path):
    options = {"dt": 40 * u.day, "duration": 80 * u.yr, "progress": False}
    # At the very start, the crosser is within three Hill radii of Jupiter.
    start = orbits.propagate(excited(), GAUSS, dt=5 * u.day, duration=10 * u.yr, samples=2, progress=False)[-1]
    plain = orbits.propagate(start, DEFAULT, samples=9, **options)
    retiring = orbits.WisdomHolman(encounters="retire")
    with pytest.warns(orbits.errors.RetiredWarning, match="retired 2 massless particles before encounters.*, as asked"):
        run = orbits.propagate(start, retiring, samples=9, **options)
    assert set(run.retired.names) == {"crosser", "plunger"}
    reasons = {one.name: one.reason for one in run.retired}
    assert reasons["crosser"] == "it came within three Hill radii of a planet, or passed it too fast for the step"
    assert reasons["plunger"] == "the step did not resolve its pericentre"
    first = {}
    for passage in plain.unresolved():
        first[passage.body] = min(first.get(passage.body, passage.time), passage.time)
    for one in run.retired:  # before the step of the passage
        assert 0 * u.day <= first[one.name] - one.time < 40 * u.day
        exact = orbits.propagate(start, GAUSS, dt=5 * u.day, duration=one.time, samples=2, progress=False)
        assert np.linalg.norm(one.q - exact.q[-1, start.index(one.name)]) < 1e-5 * u.au
    gone = np.array([name in run.retired.names for name in start.names])
    assert np.array_equal(run.q[:, ~gone], plain.q[:, ~gone])
    assert np.isnan(run.q[-1, gone]).all()
    assert run.unresolved() == []
    part = orbits.propagate(
        start, retiring, samples=3, archive=tmp_path / "run.h5", threads=1, **{**options, "duration": 20 * u.yr}
    )
    whole = orbits.resume(part.path, until=80 * u.yr, progress=False)
    assert np.array_equal(whole.q[-1], run.q[-1], equal_nan=True)
    assert [one.step for one in whole.retired] == [one.step for one in run.retired]


@pytest.mark.parametrize("distance", [0.08, 0.22])
def test_flybys_of_retrograde_particles_in_less_than_a_step_count_as_encounters(distance):
    """At 4 and 11 Hill radii of a planet of 2.5e-5, at twice its speed: in steps of 0.08 the way in a step is 0.15."""
    start = orbits.System.from_elements(
        {
            "star": {"gm": 1.0},
            "b": {"gm": 2.5e-5, "a": 1.0},
            "p": {"gm": 0.0, "a": 1.0 + distance, "inc": np.pi, "l": 4.03},
        },
        units=orbits.DIMENSIONLESS,
    )
    options = {"duration": 10.0, "samples": [10.0]}
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        plain = orbits.propagate(start, DEFAULT, dt=0.08, **options)
        kept = orbits.propagate(start, orbits.WisdomHolman(encounters="retire"), dt=0.08, **options)
    off = np.linalg.norm(plain["p"].q[-1] - orbits.propagate(start, **options)["p"].q[-1])  # 1.9e-4 and 2e-6
    assert (off > 1e-5, len(plain.unresolved()) > 0, kept.retired.names) == (
        (True, True, ("p",)) if distance < 0.15 else (False, False, ())
    )
    assert [("too fast for the step" in str(warning.message)) for warning in told] == [True] * 2 * (distance < 0.15)


def test_a_planet_too_light_to_do_harm_is_passed_at_any_speed():
    """Retrograde, at 0.005 of a rock of 1e-20, in steps whose way is 0.15: three Hill radii are 4e-7."""
    rock, particle = {"gm": 1e-20, "a": 1.0}, {"gm": 0.0, "a": 1.005, "inc": np.pi, "l": 4.03}
    start = orbits.System.from_elements(
        {"star": {"gm": 1.0}, "rock": rock, "p": particle}, units=orbits.DIMENSIONLESS
    )
    for encounters in ("warn", "retire"):
        run = orbits.propagate(start, orbits.WisdomHolman(encounters=encounters), dt=0.08, duration=10.0, samples=2)
        assert (len(run.unresolved()), len(run.retired)) == (0, 0)


def test_a_pericentre_that_is_not_resolved_is_warned_of_after_the_run_too():
    with pytest.warns(StepWarning) as seen:
        run = orbits.propagate(excited(), DEFAULT, dt=40 * u.day, duration=10 * u.yr, samples=2, progress=False)
    assert "plunger passes Sun at 0.11" in str(seen[-1].message)
    assert "of 1 massless particle had fewer; the rest of the run" in str(seen[-1].message)
    assert {passage.body for passage in run.unresolved()} == {"plunger"}
    enough = float(str(seen[-1].message).split("All others are right. dt <= ")[1].split()[0])
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # the step that is named is one of which nothing is said
        alone = excited().remove("crosser")
        orbits.propagate(alone, DEFAULT, dt=enough * u.day, duration=10 * u.yr, samples=2, progress=False)
    with pytest.raises(InputError, match="expected 'warn', 'follow', 'follow particles'"):
        orbits.WisdomHolman(encounters="ignore")
