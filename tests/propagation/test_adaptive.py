"""Runs without dt: steps chosen one by one, accurate to round-off, through encounters."""

import json

import numpy as np
import pytest
from astropy import units as u
from jplephem.spk import SPK

import orbits
from orbits.archive import Archive, ArchiveWriter
from orbits.archive.header import from_items, to_items
from orbits.errors import ArchiveError, InputError, SingularityError
from orbits.marching.clocks.step_times import Place
from orbits.marching.legs.block_loop import BlockLoop
from orbits.marching.legs.leg import Leg
from orbits.marching.watching import passage_list
from orbits.propagation.marchers import bound
from orbits.time_grid import TimeGrid

from ..coverings import cover, each
from ..encounters import APOPHIS_MISS, apophis_2029
from ..problems import kepler, three_bodies
from .bodies import BURRAU, falling, system


def propagate(start, duration, **options):
    return orbits.propagate(start, duration=duration, progress=False, **options)


@pytest.mark.parametrize(("e", "bound"), [(0.5, 3e-12), (0.9, 1e-10), (0.99, 3e-9), (0.999, 2e-7)])
def test_eccentric_orbits_come_out_to_round_off(e, bound):
    """A hundred orbits from the pericentre, where rounding errors of the start grow most: 3e-13, 2e-11, 3e-10, 2e-8."""
    gm, q, v = kepler(e)
    run = propagate(system(gm, q, v), 200 * np.pi, samples=[200 * np.pi])
    x, _ = orbits.kepler_flow(q[1] - q[0], v[1] - v[0], gm.sum(), 200 * np.pi)
    assert np.linalg.norm(run.q.value[-1, 1] - run.q.value[-1, 0] - x) < bound


def test_burraus_problem_comes_out_right_through_its_encounters():
    """2.5e-6 is reached; REBOUND's IAS15 is 3e-3 off, RMS over rotated starts (docs/benchmarks.md)."""
    start = system([3, 4, 5], [[1, 3, 0], [-2, -1, 0], [1, -1, 0]], np.zeros((3, 3)))
    run = propagate(start, 63.0, samples=2)
    assert np.abs(run.q.value[-1] - BURRAU).max() < 2e-5


def test_a_smaller_tolerance_is_heeded():
    gm, q, v = kepler(0.6)
    steps = [propagate(system(gm, q, v), 20.0, dt=orbits.Adaptive(tolerance=t)).statistics.steps for t in (1e-6, 1e-10)]
    assert steps[1] == pytest.approx(steps[0] * 1e4 ** (1 / 7), rel=0.1)  # the signal is of order 7


@pytest.mark.parametrize("stages", [3, 4, 5, 6, 7, 8])
def test_every_method_that_is_taken_reaches_round_off_by_default(stages):
    gm, q, v = kepler(0.6)
    run = propagate(system(gm, q, v), 20 * np.pi, integrator=orbits.Gauss(stages=stages), samples=[20 * np.pi])
    x, _ = orbits.kepler_flow(q[1] - q[0], v[1] - v[0], gm.sum(), 20 * np.pi)
    assert np.linalg.norm(run.q.value[-1, 1] - run.q.value[-1, 0] - x) < 1e-12


def test_samples_and_blocks_change_no_bit():
    start = system(*three_bodies())
    whole = propagate(start, 30.0, samples=[30.0])
    sampled = propagate(start, 30.0, samples=333)
    assert np.array_equal(whole.q[-1], sampled.q[-1])
    assert whole.statistics.steps == sampled.statistics.steps
    marcher = bound(start, "gauss", orbits.Adaptive(), 1)
    marcher.block = 7
    marcher.advance_to(Place(0, 30.0))
    assert np.array_equal(marcher.state_at(Place(0, 30.0))[0], whole.q.value[-1])


def test_a_run_backwards_leads_back():
    start = system(*three_bodies())
    there = propagate(start, 10.0)
    back = propagate(there[-1], -10.0)
    assert back.times[-1] == -10.0
    np.testing.assert_allclose(back.q.value[-1], start.q.value, rtol=0, atol=1e-13)


def test_energy_does_not_drift():
    """1,000 orbits at e = 0.9: 2e-14 is seen; a drift of one rounding a step would be 1e-11."""
    gm, q, v = kepler(0.9)
    run = propagate(system(gm, q, v), 2000 * np.pi, samples=50)
    assert run.drift().energy.max_fraction < 2e-13


def test_a_stopped_and_an_extended_run_have_the_bits_of_a_whole_one(tmp_path):
    start, path = system(*three_bodies()), tmp_path / "run.h5"
    whole = propagate(start, 20.0, samples=81)
    propagate(start, 10.0, samples=41, archive=path)
    longer = orbits.resume(path, until=20.0, progress=False)
    assert np.array_equal(longer.q, whole.q)
    assert np.array_equal(longer.v, whole.v)
    again = orbits.Archive.open(path).trajectory() if hasattr(orbits.Archive, "trajectory") else longer
    assert again.clock == whole.clock == orbits.Adaptive()
    assert "adaptive" in repr(longer)


def test_an_interrupted_run_is_resumed_to_the_same_bits(tmp_path):
    start, path = system(*three_bodies()), tmp_path / "run.h5"
    whole, seen = propagate(start, 20.0, samples=41), []

    def stop(t, state):
        seen.append(t)
        return len(seen) == 17

    propagate(start, 20.0, samples=41, archive=path, callback=stop)
    assert np.array_equal(orbits.resume(path, progress=False).q, whole.q)


def test_states_between_samples_are_those_of_the_orbit():
    start = system(*three_bodies())
    run = propagate(start, 10.0, samples=11)
    direct = propagate(start, 10.0, samples=[3.3, 7.7])
    found = run.at([7.7, 3.3])
    np.testing.assert_allclose(found.q.value[::-1], direct.q.value, rtol=0, atol=1e-14)


def test_close_approaches_and_conditions_are_found_to_the_precision_of_the_orbit():
    """A pair on an ellipse of a = 0.5025..., pericentre from the conserved quantities."""
    start = falling(0.1)
    speed, distance = 0.2, 2.0  # relative, at the apocentre; G m = 2
    a = 1 / (2 / distance - speed**2 / 2)
    pericentre, half = 2 * a - distance, np.pi * np.sqrt(a**3 / 2)
    run = propagate(start, 6.0)
    approach = run.closest_approaches()["b0"][0]
    assert approach.distance.value == pytest.approx(pericentre, rel=1e-12)
    assert approach.time.value == pytest.approx(half, rel=1e-14)
    assert run.unresolved() == []
    stopped = propagate(start, 6.0, stop=orbits.events.CloserThan(0.5, "b0", "b1")).stopped
    met = stopped.system.q.value
    assert np.linalg.norm(met[0] - met[1]) == pytest.approx(0.5, rel=1e-12)
    assert stopped.time.value < half


def test_a_collision_ends_the_run_and_keeps_what_was_before():
    with pytest.raises(SingularityError, match=r"b0 and b1 meet.*Use softening") as caught:
        propagate(falling(0.0), 10.0, samples=11)
    assert caught.value.time == pytest.approx(np.pi / 2 * np.sqrt(2), rel=1e-8)
    assert tuple(caught.value.bodies) == ("b0", "b1")
    assert caught.value.trajectory.times.tolist() == [0.0, 1.0, 2.0]


def test_the_file_of_a_dense_run_that_a_collision_ended_answers_for_any_time(tmp_path):
    # The last steps are so short that neighbouring times are the same float64 number, and differ in their second one.
    start = system([1.0, 1.0, 1e-3], [[1, 0, 0], [-1, 0, 0], [0, 50, 0]], np.zeros((3, 3)))
    with pytest.raises(SingularityError):
        propagate(start, 5.0, samples=51, archive=tmp_path / "run.h5", dense=True)
    run = orbits.Trajectory.open(tmp_path / "run.h5")
    short = propagate(start, 2.0, samples=[1.03])
    assert np.abs((run.at(1.03).q - short.q[0]).value).max() < 1e-14
    run.close()


def test_a_softened_collision_is_passed_through():
    start = system([1.0, 1.0], [[-1, 0, 0], [1, 0, 0]], np.zeros((2, 3)), softening=1e-3)
    run = propagate(start, 10.0)
    assert run.drift().energy.max_fraction < 1e-13


def test_a_body_alone_moves_straight_on():
    run = propagate(system([1.0], [[1, 2, 3]], [[0.5, 0, 0]]), 8.0, samples=3)
    assert run.q.value[:, 0].tolist() == [[1, 2, 3], [3, 2, 3], [5, 2, 3]]


@pytest.mark.nightly
def test_terms_of_positions_are_marched_too():
    flattened = orbits.System.solar_system().with_terms(
        orbits.terms.ZonalHarmonics("Sun", J2=1e-3, radius=696000 * u.km, pole=(286.13, 63.87) * u.deg)
    )
    fixed = orbits.propagate(flattened, "gauss", dt=1 * u.day, duration=400 * u.day, samples=2, progress=False)
    run = propagate(flattened, 400 * u.day, samples=2)
    np.testing.assert_allclose(run.q.value[-1], fixed.q.value[-1], rtol=0, atol=2e-13)


OTHERS = [
    method
    for kind in orbits.integrators.registry().values()
    for method in kind.examples()
    if method.name != "gauss" or not 3 <= method.stages <= 8
]


@each("method", OTHERS)
def test_methods_whose_steps_cannot_be_chosen_say_which_can(method):
    with pytest.raises(InputError, match=r"needs a dt.*Gauss\(stages=8\)"):
        propagate(system(*three_bodies()), 1.0, integrator=method)


def test_what_cannot_be_run_without_dt_is_refused_with_the_reason(tmp_path):
    start = system(*three_bodies())
    with pytest.raises(InputError, match="certificate needs steps of one length: give dt"):
        propagate(start, 1.0, archive=tmp_path / "run.h5", certificate=True)
    with pytest.raises(InputError, match=r"at most 2\^53 steps"):
        propagate(start, 1e300)
    for tolerance in (0.0, -1e-9, 1.0, float("nan"), "1e-9", True):
        with pytest.raises(InputError, match="tolerance is"):
            orbits.Adaptive(tolerance=tolerance)
    with pytest.raises(InputError, match="took adaptive steps"):
        _ = propagate(start, 1.0).dt


def test_a_clock_that_no_run_has_is_refused_by_the_archive(tmp_path):
    path = tmp_path / "run.h5"
    propagate(system(*three_bodies()), 1.0, archive=path)
    items = to_items(Archive.open(path).parts()[1])
    good = json.loads(items["@clock"])
    for change in ({"kind": "sundial"}, {"direction": 0.5}, {"tolerance": -1}, {"more": 1}):
        with pytest.raises(ArchiveError):
            from_items({**items, "@clock": json.dumps({**good, **change})})
    with pytest.raises(ArchiveError):
        from_items({**items, "@clock": "nonsense"})


@pytest.mark.nightly
def test_a_run_without_dt_becomes_an_spk_file_through_an_encounter(tmp_path):
    start = apophis_2029()
    light = np.where(start.values.gm > 0.0, start.values.gm, 1e-30)
    run = propagate(start.replaced(gm=light), 150 * u.day, samples=31)
    ids = {"Apophis": 2099942}
    file = run.to_spk(tmp_path / "run.bsp", centre="Earth", bodies=["Apophis"], tolerance_km=1e-2, ids=ids)
    assert file.error_km["Apophis"] < 1e-2
    miss = min(run.closest_approaches()["Apophis"], key=lambda approach: approach.distance)
    assert miss.distance.to_value(u.km) == pytest.approx(APOPHIS_MISS, abs=0.02)  # printed to 0.01 km
    with SPK.open(str(tmp_path / "run.bsp")) as kernel:
        (segment,) = [s for s in kernel.segments if s.target == 2099942]
        place = segment.compute(float((start.epoch + miss.time).jd))
    assert np.linalg.norm(place) == pytest.approx(APOPHIS_MISS, abs=0.05)


def test_a_block_with_more_passages_than_its_list_holds_is_marched_in_shorter_ones(monkeypatch):
    """A moon passes its planet once a month: a list of four is full soon, and the march goes on from the same steps."""
    start = orbits.System.solar_system(bodies=["Sun", "Earth", "Moon", "Jupiter"])
    whole = propagate(start, 2 * u.yr, samples=3)
    monkeypatch.setattr(passage_list, "BLOCK_ROOM", 4)
    short = bound(start, "gauss", orbits.Adaptive(), 1)
    longest, end = short.block, Place(0, 730.5)
    short.advance_to(end)
    assert short.block < longest
    assert short.step == whole.statistics.steps
    assert np.array_equal(short.state_at(end)[0], whole.q.value[-1])


def test_a_run_that_was_killed_before_its_first_step_is_resumed(tmp_path):
    start, path = system(*three_bodies()), tmp_path / "run.h5"
    whole = propagate(start, 5.0, samples=6)
    propagate(start, 5.0, samples=6, archive=path, callback=lambda t, state: True)  # stops at the start
    assert np.array_equal(orbits.resume(path, progress=False).q, whole.q)
    marcher = bound(start, "gauss", orbits.Adaptive(), 1)
    assert all(np.isfinite(array).all() for name, array in marcher.checkpoint().items() if name != "approaches")


def ring(bodies, light=1e-3):
    """A star and a ring of equal bodies around it, all at rest in a rotating frame."""
    angle = 0.3 + 2 * np.pi * np.arange(bodies) / bodies
    out = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    on = np.column_stack([-np.sin(angle), np.cos(angle), 0 * angle])
    pull = 1 + light * sum(1 / (4 * np.sin(np.pi * k / bodies)) for k in range(1, bodies))
    return system([1, *[light] * bodies], [[0, 0, 0], *out], [[0, 0, 0], *np.sqrt(pull) * on])


@cover(("bodies", "offset"), [2, 3, 6], [0.0, 1e-12, 1e-8], strength=1)
def test_forces_that_cancel_do_not_shorten_the_steps(bodies, offset):
    """What is left of the attractions on the star is round-off, 40 to 140 steps; once it stopped the clock."""
    start = ring(bodies)
    q = start.values.q.copy()
    q[0, 0] = offset
    run = propagate(start.replaced(q=q), 6.0)
    assert run.statistics.steps < 300
    assert np.allclose(np.linalg.norm(run.q.value[-1, 1:], axis=1), 1.0, rtol=0, atol=1e-4)


def test_the_closest_approach_is_that_at_the_end_where_bodies_still_approach():
    run = propagate(orbits.System.solar_system("2022-08-09"), 100 * u.day)
    fixed = orbits.propagate(run.system, "gauss", dt=1 * u.day, duration=100 * u.day, progress=False)
    for name in ("Mars", "Mercury", "Uranus"):
        found, expected = (r.closest_approaches()[name] for r in (run, fixed))
        assert [a.other for a in found] == [a.other for a in expected]
        np.testing.assert_allclose([a.distance.value for a in found], [a.distance.value for a in expected], rtol=1e-11)
        times = ([a.time.value for a in approaches] for approaches in (found, expected))
        np.testing.assert_allclose(*times, rtol=1e-7, atol=1e-7)


def test_a_stopped_run_knows_nothing_of_what_would_have_come():
    start = falling(0.3)
    stopped = propagate(start, 6.0, stop=orbits.events.CloserThan(1.0, "b0", "b1"), samples=500)
    end = stopped.stopped.time.value
    assert all(abs(a.time.value) <= end for a in stopped.closest_approaches()["b0"])
    (last,) = stopped.closest_approaches()["b0"]  # at the end itself
    assert last.distance.value == pytest.approx(1.0, rel=1e-13)  # some roundings
    assert last.time.value == pytest.approx(end, rel=1e-13)


def test_conditions_are_looked_at_up_to_the_end_of_the_run():
    """The last step of the march leads beyond the end: what is met before it is told all the same."""
    start = falling(0.3)
    whole = propagate(start, 6.0, stop=orbits.events.CloserThan(1.0, "b0", "b1")).stopped
    for duration in np.linspace(float(whole.time.value) * (1 + 1e-9), 3.0, 7):
        assert propagate(start, duration, stop=orbits.events.CloserThan(1.0, "b0", "b1")).stopped is not None
    assert propagate(start, 1.0, stop=orbits.events.CloserThan(1.0, "b0", "b1")).stopped is None


@pytest.mark.parametrize(("end", "ends_early"), [(25.3, False), (25.4, True)])
def test_the_energy_is_compared_with_that_at_the_start_up_to_the_end_of_the_run(end, ends_early):
    """Both ends are in a step in which the energy error grows from 5.1e-9 over 5.3e-9 and 6.6e-9 to 8.0e-9: less than
    the bound above that at its beginning.
    """
    clock, stop = orbits.Adaptive(tolerance=1e-4), orbits.events.EnergyErrorAbove(6e-9)
    run = propagate(system(*three_bodies()), end, dt=clock, samples=2, stop=stop)
    assert (run.stopped is not None) == ends_early


def test_a_callback_ends_a_run_at_its_sample():
    run = propagate(system(*three_bodies()), 20.0, samples=21, callback=lambda t, state: t.value >= 10)
    assert run.stopped.time.value == run.times[-1] == 10.0
    assert np.array_equal(run.stopped.system.q, run.q[-1])


def test_many_samples_in_a_step_cost_no_marching(monkeypatch):
    marcher = bound(system(*three_bodies()), "gauss", orbits.Adaptive(), 1)
    calls = []
    march = marcher.stepper.loops.march
    monkeypatch.setattr(marcher.stepper.loops, "march", lambda *a: calls.append(1) or march(*a))
    for time in np.linspace(0.0, 1.0, 1001):
        marcher.advance_to(Place(0, float(time)))
    assert len(calls) <= 2 * marcher.step + 2


@pytest.mark.parametrize("samples", [2, 101])
def test_a_short_run_is_bound_once_and_marches_its_steps_in_one_block(samples, monkeypatch):
    """A call of a millisecond, as in a fit: nothing is made or marched twice for its start or its end. The part of a
    step up to the end is marched for the record of close approaches, once, when that is asked for.
    """
    made, blocks = [], []
    make, block = Leg.__init__, BlockLoop.one_block
    monkeypatch.setattr(Leg, "__init__", lambda self, *a, **k: made.append(1) or make(self, *a, **k))
    monkeypatch.setattr(BlockLoop, "one_block", lambda self, *a: blocks.append(1) or block(self, *a))
    run = propagate(orbits.System.solar_system(), 1 * u.yr, samples=samples)
    assert (len(made), len(blocks)) == (1, 1)
    assert run.statistics.steps > 50
    assert len(run.closest_approaches()) > 0
    assert not run.unresolved()
    assert (len(made), len(blocks)) == (2, 2)


@pytest.mark.nightly
def test_close_approaches_in_the_last_part_of_a_step_are_the_same_for_any_threads():
    planets = orbits.System.solar_system().remove("Pluto")
    names = [f"p{k}" for k in range(40)]
    a, M = np.linspace(1.0, 1.4, 40) * u.au, np.linspace(0.0, 312.0, 40) * u.deg
    start = planets.add(names, primary="Sun", a=a, e=0.1, M=M)
    one, three = (
        propagate(start, 3 * u.day, samples=2, threads=threads).closest_approaches() for threads in (1, 3)
    )
    for name in names:
        found = [[(a.other, a.time.value, a.distance.value) for a in table[name]] for table in (one, three)]
        assert found[0] == found[1]


def test_a_run_without_dt_says_how_its_steps_were_chosen():
    start = system(*three_bodies())
    for clock, stages, tolerance in ((None, 8, "1e-09"), (orbits.Adaptive(1e-7), 8, "1e-07"), (None, 4, "1.9307e-08")):
        run = propagate(start, 1.0, integrator=orbits.Gauss(stages=stages), dt=clock, samples=2)
        assert run.made_by == f"Gauss(stages={stages}), adaptive steps (tolerance {tolerance})"
        assert run.made_by in repr(run)
        attributes = run.to_table().meta
        assert attributes["steps"] == run.to_xarray().attrs["steps"] == f"adaptive steps (tolerance {tolerance})"
        assert "dt" not in attributes
    fixed = propagate(start, 1.0, dt=0.125, samples=2).to_table().meta
    assert fixed["dt"] == 0.125
    assert "steps" not in fixed


def test_the_default_tolerance_can_be_given_for_the_same_bits():
    start = system(*three_bodies())
    given, default = (propagate(start, 3.0, dt=clock, samples=4) for clock in (orbits.Adaptive(tolerance=1e-9), None))
    assert np.array_equal(given.q, default.q)
    assert repr(orbits.Adaptive(tolerance=1e-9)) == "Adaptive(tolerance=1e-09)"
    assert repr(orbits.TimeTransformed(step=0.3)) == "TimeTransformed(step=0.3)"


@pytest.mark.parametrize("dt", [orbits.Adaptive, "adaptive", " Adaptive "], ids=str)
def test_the_clock_is_an_object_and_the_message_shows_it(dt):
    with pytest.raises(InputError, match=r"expected dt=orbits.Adaptive\(\), or no dt"):
        propagate(system(*three_bodies()), 1.0, dt=dt)


def test_an_archive_whose_method_cannot_have_its_steps_is_damaged(tmp_path):
    start, path = system(*three_bodies()), tmp_path / "run.h5"
    grid = TimeGrid.of(start, None, duration=1.0, samples=2)
    method = orbits.integrators.describe(orbits.StormerVerlet())
    ArchiveWriter.create(path, system=start, integrator=method, grid=grid, checkpoint={}, provenance={}).close()
    with pytest.raises(ArchiveError, match="needs a dt"):
        orbits.Trajectory.open(path)


def test_samples_that_are_not_of_the_run_are_refused_in_spk_with_its_method(tmp_path):
    start = orbits.System.solar_system(bodies=["Sun", "Jupiter"])
    run = propagate(start, 30 * u.day, samples=4)
    other = run._with_samples(run.times, run.q.value + 1e-3, run.v.value)
    with pytest.raises(InputError, match=r"motion that Gauss\(stages=8\), adaptive steps.*unchanged run"):
        other.to_spk(tmp_path / "run.bsp")


def test_many_samples_in_a_step_are_those_of_partial_steps_one_by_one():
    """They are computed together, 256 at a time; thrown bodies, among whose samples are steps that are rejected."""
    thrown = system([3, 4, 5], [[1, 3, 0], [-2, -1, 0], [1, -1, 0]], np.zeros((3, 3)))
    whole = propagate(thrown, 63, samples=20001)
    marcher = bound(thrown, whole.integrator, whole.clock)
    for k in range(0, 20001, 29):
        place = marcher.clock.place(whole.times[k])
        marcher.advance_to(place)
        assert np.array_equal(marcher.state_at(place)[0], whole.q.value[k])
    alone = propagate(thrown, 63, samples=whole.times[3:20001:1234])
    assert np.array_equal(alone.v, whole.v[3:20001:1234])
