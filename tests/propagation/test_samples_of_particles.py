"""Samples of massless bodies cost no block and change nothing: by clocks of their own they are shown as they come by,
through stages they are copied from the beginnings of steps.
"""

import numpy as np
import pytest
from astropy import units as u

import orbits
from orbits.marching.legs import samples_of_particles as samples
from orbits.marching.legs.block_loop import BlockLoop
from orbits.terms import Drag, FrameDragging, ZonalHarmonics

from ..problems import three_bodies
from .bodies import falling_particles

NAMES = [*"abc", "p", "q", "r", "s"]


def crowd(mass=0.0):
    """Three bodies, three that move among them, and a satellite with steps of its own; `mass` : GM of these four."""
    gm, q, v = three_bodies(particles=4)
    q[-1], v[-1] = q[1] + [0.03, 0.0, 0.0], v[1] + [0.0, 0.5, 0.3]
    return orbits.System(NAMES, gm=np.where(gm > 0.0, gm, mass), q=q, v=v, units=orbits.DIMENSIONLESS)


def blocks_of(monkeypatch, system=None, *method, **options):
    """Return a run, by default of the crowd, and the number of its blocks."""
    taken, one_block = [], BlockLoop.one_block
    monkeypatch.setattr(BlockLoop, "one_block", lambda self, most: taken.append(most) or one_block(self, most))
    run = orbits.propagate(system or crowd(), *method, progress=False, **options)
    monkeypatch.undo()
    return run, len(taken)


@pytest.mark.parametrize("direction", [1.0, -1.0], ids=["forwards", "backwards"])
def test_samples_end_no_block_and_change_nothing(monkeypatch, direction):
    few, least = blocks_of(monkeypatch, duration=30.0 * direction, samples=2)
    many, blocks = blocks_of(monkeypatch, duration=30.0 * direction, samples=701)
    assert blocks <= least + 1
    assert few.statistics.steps == many.statistics.steps < 701
    assert few.statistics.particle_evaluations == many.statistics.particle_evaluations
    for name in ("q", "v"):
        assert np.array_equal(getattr(few, name)[-1], getattr(many, name)[-1])
    some, _ = blocks_of(monkeypatch, duration=30.0 * direction, samples=71)
    assert np.array_equal(some.q, many.q[::10])
    threads, _ = blocks_of(monkeypatch, duration=30.0 * direction, samples=71, threads=2)
    assert np.array_equal(some.q, threads.q)
    assert np.array_equal(some.v, threads.v)


def test_samples_of_particles_with_many_steps_of_their_own_come_in_small_groups_with_the_same_bits(monkeypatch):
    """A run can end only between them: of 300 particles with a thousand orbits in a step, 256 samples take 15 s."""
    whole, _ = blocks_of(monkeypatch, duration=6.0, samples=301)
    groups, shown = [], samples.SamplesByOwnClocks._samples_in
    monkeypatch.setattr(samples, "WORK", 1)
    monkeypatch.setattr(samples, "FEWEST", 3)
    monkeypatch.setattr(
        samples.SamplesByOwnClocks,
        "_samples_in",
        lambda self, behind, steps: groups.append(len(behind.steps)) or shown(self, behind, steps),
    )
    run = orbits.propagate(crowd(), duration=6.0, samples=301, progress=False)
    assert max(groups) == 3
    assert np.array_equal(run.q, whole.q)
    assert np.array_equal(run.v, whole.v)


def test_samples_are_where_bodies_with_a_mass_that_moves_nothing_are():
    """Their steps are those of all bodies: 2e-13 apart, as the two runs are at the ends of steps."""
    options = {"duration": 6.0, "samples": 301, "progress": False}
    particles, bodies = orbits.propagate(crowd(), **options), orbits.propagate(crowd(1e-40), **options)
    assert particles.statistics.steps < 301
    np.testing.assert_allclose(particles.q, bodies.q, rtol=0, atol=1e-12)
    np.testing.assert_allclose(particles.v, bodies.v, rtol=0, atol=1e-12)


@pytest.mark.nightly
def test_a_sample_just_after_the_beginning_of_a_step_is_reached_with_terms_that_have_momenta(monkeypatch):
    """In a step of a moment, what momenta leave of a force is rounding errors, which no shorter step makes smaller."""
    pole, ends, one_block = (0.36, 0.48, 0.8), [], BlockLoop.one_block
    flat = ZonalHarmonics("a", J2=0.05, radius=0.3, pole=pole)
    start = crowd().with_terms(flat, FrameDragging("a", spin=0.05, pole=pole, c=3.0))
    start = start.with_forces(Drag(rate=1e-3, bodies=["b", "p"]))
    monkeypatch.setattr(
        BlockLoop, "one_block", lambda self, most: (one_block(self, most), ends.extend(self._leg.times.ends()))[0]
    )
    whole = orbits.propagate(start, duration=6.0, samples=2, progress=False)
    monkeypatch.undo()
    begun = np.unique(ends)[1:-1]
    for later in (1e-14, 1e-11):
        run = orbits.propagate(start, duration=6.0, samples=np.append(begun * (1.0 + later), 6.0), progress=False)
        assert np.array_equal(run.q[-1], whole.q[-1])
        assert not len(run.retired)


@pytest.mark.parametrize("room", [1, 5 * 48 * 8])
def test_few_samples_at_a_time_have_the_bits_of_many(monkeypatch, room):
    options = {"duration": 20.0, "samples": 301, "progress": False}
    whole = orbits.propagate(crowd(), **options)
    monkeypatch.setattr(samples, "SHOWN_BYTES", room)
    parts = orbits.propagate(crowd(), **options)
    assert np.array_equal(whole.q, parts.q)
    assert np.array_equal(whole.v, parts.v)


@pytest.mark.filterwarnings("ignore::orbits.errors.RetiredWarning")
@pytest.mark.parametrize("direction", [1.0, -1.0], ids=["forwards", "backwards"])
def test_a_particle_is_shown_up_to_where_it_is_lost_whatever_the_samples(direction):
    """Two fall on a point within a step of the bodies, in which there are samples before and after that."""
    many = orbits.propagate(falling_particles(), duration=3.6 * direction, samples=1201, progress=False)
    few = orbits.propagate(falling_particles(), duration=3.6 * direction, samples=many.times[::100], progress=False)
    assert few.retired.to_records() == many.retired.to_records()
    for lost, body in zip(many.retired, (3, 4), strict=True):
        gone = np.isnan(many.q.value[:, body]).any(axis=1)
        assert np.array_equal(gone, np.abs(many.times) > abs(lost.time.value))
        assert 0 < gone.sum() < 1200
        assert np.linalg.norm(many.q.value[~gone, body][-1]) < 0.05  # 0.003 before its end
    assert np.array_equal(few.q, many.q[::100], equal_nan=True)


def belt():
    """A star, two planets, and particles that move between them, near one of them, and towards the star."""
    orbit = {"a": 1.6 * u.au, "e": 0.1, "inc": 0.2 * u.rad}
    system = orbits.System.from_elements(
        {
            "star": {"mass": 1 * u.M_sun},
            "b": {"a": 1 * u.au, "e": 0.05, "M": 0.4 * u.rad, "mass": 1e-4 * u.M_sun},
            "calm": {**orbit, "M": 1 * u.rad},
            "c": {"a": 2.6 * u.au, "e": 0.05, "M": 1 * u.rad, "mass": 1e-3 * u.M_sun},
            "crosses": {**orbit, "e": 0.6, "M": 2.5 * u.rad},
            "falls": {**orbit, "e": 0.99, "M": 3 * u.rad},
            "stays": {**orbit, "M": 4 * u.rad},
        }
    )
    q, v = (x.value.copy() for x in (system.q, system.v))
    near = system.index("c"), system.index("crosses")
    q[near[1]], v[near[1]] = q[near[0]] + [0.7, 0.1, 0.0], v[near[0]] - [3e-3, 0.0, 0.0]
    return system.replaced(q=q * system.q.unit, v=v * system.v.unit)


THROUGH_STAGES = {
    "kicks": ("stormer-verlet", []),
    "collocation": ("gauss", ["falls"]),
    "a map": ("wisdom-holman", []),
    "a map that retires": (orbits.WisdomHolman(encounters="retire"), ["falls"]),
    "a map that follows": (orbits.WisdomHolman(encounters="follow"), []),
}
"""Methods, and the particle that is retired last."""


@pytest.mark.filterwarnings("ignore::orbits.errors.OrbitsWarning")
@pytest.mark.parametrize("direction", [1, -1], ids=["forwards", "backwards"])
@pytest.mark.parametrize("what", THROUGH_STAGES)
def test_samples_through_stages_are_those_one_by_one_and_end_no_block(monkeypatch, what, direction):
    """On the grid and off it, several in a step, before particles are retired, in encounters and after them."""
    options = {"dt": 4 * u.day, "duration": direction * 2000 * u.day, "check_step": False}
    times = np.union1d(np.arange(0.0, 2000.0, 12.0), np.arange(1.0, 2000.0, 2.9)) * direction
    method, retired = THROUGH_STAGES[what]
    together, blocks = blocks_of(monkeypatch, belt(), method, samples=times, **options)
    _, least = blocks_of(monkeypatch, belt(), method, samples=2, **options)
    assert blocks <= least + 30 < len(times) / 10
    one_by_one = orbits.propagate(belt(), method, samples=times, callback=lambda t, state: None, **options)
    assert np.array_equal(together.q, one_by_one.q, equal_nan=True)
    assert np.array_equal(together.v, one_by_one.v, equal_nan=True)
    assert together.retired.to_records() == one_by_one.retired.to_records()
    few = orbits.propagate(belt(), method, samples=times[::7], threads=2, **options)
    assert np.array_equal(few.q, together.q[::7], equal_nan=True)
    assert [lost.name for lost in together.retired] [-1:] == retired


def test_samples_up_to_an_error_in_an_event_of_particles_stay():
    def fails(t, q, v):
        if t.max() > 20.0:
            raise RuntimeError("no more")
        return q[:, 3, 0]

    event = orbits.events.Event(fails, bodies="p", name="mine")
    with pytest.raises(RuntimeError, match="no more") as caught:
        orbits.propagate(crowd(), duration=30.0, samples=301, events=event, progress=False)
    assert len(caught.value.trajectory) > 150
