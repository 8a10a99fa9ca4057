"""Massless bodies that hit massive ones in runs without dt, within long steps of the bodies."""

from __future__ import annotations

import math
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from astropy import units as u

import orbits
from orbits.events import Bounce, Collision, Merge

from ..coverings import cover, only
from ..encounters import apophis_2029

D = orbits.DIMENSIONLESS
MERGE = Collision(then=Merge())
HIT = "it merged with a body that it hit"


def propagate(start: orbits.System, duration: object, **options: object) -> orbits.Trajectory:
    return orbits.propagate(start, duration=duration, **{"events": MERGE, "progress": False, **options})


def fall(start: float, end: float) -> float:
    """The time of a radial fall from rest towards GM = 1: Kepler's equation for e = 1."""
    x = end / start
    return math.sqrt(start**3 / 2.0) * (math.acos(math.sqrt(x)) + math.sqrt(x * (1.0 - x)))


def falling(radius: float = 0.01) -> orbits.System:
    """A star, a planet that pulls at nothing, a particle on a circle, and two that fall into the star."""
    q = [[0, 0, 0], [9, 0, 0], [2.5, 0, 0], [0, 0, 0.8], [0, 0, 2.0]]
    v = [[0, 0, 0], [0, 1 / 3, 0], [0, 2.5**-0.5, 0], [0, 0, 0], [0, 0, 0]]
    names, gm = ["star", "planet", "p", "near", "far"], [1.0, 1e-30, 0, 0, 0]
    return orbits.System(names, gm=gm, q=q, v=v, radii=[radius, 0, 0, 0, 0.5 * radius], units=D)


@cover(("radius", "direction"), [0.1, 0.01, 1e-4, 1e-7], [1, -1], strength=1)
def test_a_radial_fall_ends_at_the_surface_at_keplers_time(radius: float, direction: int) -> None:
    """To a few units in the last place of the time, all within the first step of the bodies."""
    start = falling(radius)
    run = propagate(start, 6.0 * direction, samples=61)
    expected = [fall(0.8, radius), fall(2.0, 1.5 * radius)]
    assert np.abs(np.abs(run.events.time.value) - expected).max() <= 4e-15
    # To the way in the rounding errors of the time, as a part of the step and as itself: 1e-5 of a radius of 1e-7.
    rounded = 1.5 * np.spacing(np.abs(run.events.time.value)) * run.events.speed.value
    assert (np.abs(run.events.distance.value - [radius, 1.5 * radius]) <= rounded + 1e-15).all()
    speeds = [math.sqrt(2.0 / r - 2.0 / h) for r, h in ((radius, 0.8), (1.5 * radius, 2.0))]
    assert run.events.speed.value == pytest.approx(speeds, rel=1e-5)  # a rounding error of the time is 1e-5 of 1e-7
    assert [(event.kind, event.body, event.other) for event in run.events] == [
        ("merger", "star", "near"),
        ("merger", "star", "far"),
    ]
    assert [(one.name, one.reason) for one in run.retired] == [("near", HIT), ("far", HIT)]
    assert np.array_equal([one.time.value for one in run.retired], run.events.time.value)
    assert np.linalg.norm(run.retired["far"].q.value) == pytest.approx(1.5 * radius, abs=rounded[1] + 1e-15)
    column = run.names.index("near")
    after = np.abs(run.times) >= abs(run.events.time[0].value)
    assert (np.isnan(run.q.value[:, column]).any(axis=1) == after).all()
    assert "near" not in run[-1]


def test_a_hyperbolic_fall_ends_at_the_surface_at_keplers_time() -> None:
    """e = 1.5 with a pericentre at half the radius, of a star alone, whose motion sets no step."""
    e, a, radius, begun = 1.5, 1.0, 1.0, -8.0
    mean = begun  # n = 1
    H = -1.0
    for _ in range(60):
        H -= (e * math.sinh(H) - H - mean) / (e * math.cosh(H) - 1.0)
    r, b = a * (e * math.cosh(H) - 1.0), a * math.sqrt(e * e - 1.0)
    rate = 1.0 / r
    q = [a * (e - math.cosh(H)), b * math.sinh(H), 0.0]
    v = [-a * math.sinh(H) * rate, b * math.cosh(H) * rate, 0.0]
    start = orbits.System(["star", "stone"], gm=[1, 0], q=[[0, 0, 0], q], v=[[0, 0, 0], v], radii=[radius, 0], units=D)
    hit = -math.acosh((1.0 + radius / a) / e)
    expected = e * math.sinh(hit) - hit - begun
    run = propagate(start, 20.0, samples=21)
    assert run.events.time[0].value == pytest.approx(expected, abs=1e-14)
    assert run.events.distance[0].value == pytest.approx(radius, rel=1e-14)


def big_earth() -> orbits.System:
    """Apophis, which comes within 38,013 km of the Earth, if the Earth were as large as 39,000 km."""
    start = apophis_2029()
    return start.replaced(radii=[39_000.0 if name == "Earth" else 0.0 for name in start.names] * u.km)


def as_light_body(start: orbits.System, name: str) -> orbits.System:
    gm = start.values.gm.copy()
    gm[start.names.index(name)] = 1e-30 * gm.max()
    return start.replaced(gm=gm)


def test_apophis_hits_a_larger_earth_where_it_does_as_a_massive_body() -> None:
    start = big_earth()
    run = propagate(start, 150 * u.day, samples=16)
    light = propagate(as_light_body(start, "Apophis"), 150 * u.day, samples=16)
    (one,), (other,) = run.events, light.events
    assert (one.body, one.other) == (other.body, other.other) == ("Earth", "Apophis")
    # Rounding errors of the start, grown on the way: 4e-12 d, and 3e-11 of the speed were seen.
    assert one.time.value == pytest.approx(other.time.value, abs=1e-10)
    assert one.distance.to_value(u.km) == pytest.approx(39_000.0, rel=1e-9)
    assert one.speed.value == pytest.approx(other.speed.value, rel=1e-9)
    assert one.date.isot.startswith("2029-04-13T2")
    assert run.retired["Apophis"].reason == HIT
    lone = orbits.propagate(start.remove("Apophis"), duration=150 * u.day, samples=16, progress=False)
    assert np.array_equal(run.q[:, :-1], lone.q)
    missed = propagate(start.replaced(radii=start.radii * (38_000.0 / 39_000.0)), 150 * u.day, samples=2)
    assert not len(missed.events)
    assert not len(missed.retired)


def crowd(count: int = 20) -> orbits.System:
    """A star and a planet with radii, and slow particles of which many hit them."""
    rng = np.random.default_rng(3)
    q = np.concatenate([[[0, 0, 0], [5, 0, 0]], rng.normal(size=(count, 3)) * 2.0])
    v = np.concatenate([[[0, 0, 0], [0, 0.45, 0]], rng.normal(size=(count, 3)) * 0.3])
    names, gm = ["star", "planet", *[f"dust {k}" for k in range(count)]], [1, 1e-3, *[0] * count]
    return orbits.System(names, gm=gm, q=q, v=v, radii=[0.3, 0.1, *[0.0] * count], units=D)


def test_impacts_change_no_bit_of_the_others_and_do_not_depend_on_samples_or_threads() -> None:
    start = crowd()
    plain = orbits.propagate(start, duration=30.0, samples=[15.0, 30.0], progress=False)
    run = propagate(start, 30.0, samples=[15.0, 30.0])
    gone = [event.other for event in run.events]
    assert len(gone) >= 3
    assert {one.name for one in run.retired if one.reason == HIT} == set(gone)
    stay = [k for k, name in enumerate(start.names) if name not in gone]
    assert np.array_equal(run.q[:, stay], plain.q[:, stay], equal_nan=True)
    assert np.array_equal(run.v[:, stay], plain.v[:, stay], equal_nan=True)
    many = propagate(start, 30.0, samples=100, threads=2)
    assert np.array_equal(many.events.time, run.events.time)
    assert np.array_equal(many.q[-1], run.q[-1], equal_nan=True)
    assert many.retired.to_records() == run.retired.to_records()
    for event in run.events:
        alone = start.remove(*(name for name in start.names[2:] if name != event.other))
        (again,) = propagate(alone, 30.0, samples=2).events
        assert again.time == event.time


def test_states_at_any_time_have_a_particle_up_to_its_impact() -> None:
    run = propagate(crowd(), 30.0, samples=16)
    times, radii = run.events.time.value, run.system.radii.value
    before, after = run.at(times - 1e-9), run.at(times + 1e-9)
    for k, event in enumerate(run.events):
        body, other = (run.names.index(name) for name in (event.body, event.other))
        gap = np.linalg.norm(before.q.value[k, other] - before.q.value[k, body])
        assert gap == pytest.approx(radii[body] + radii[other], abs=1e-7)  # 1e-9 of time away
        assert np.isnan(after.q.value[k, other]).all()


def test_particles_hit_what_and_when_each_does_as_a_massive_body() -> None:
    start = crowd()
    run, found = propagate(start, 30.0, samples=2), []
    for name in start.names[2:]:
        alone = start.remove(*(other for other in start.names[2:] if other != name))
        found += list(propagate(as_light_body(alone, name), 30.0, samples=2).events)
    assert {event.other for event in found} == {event.other for event in run.events}
    for event in found:
        (mine,) = run.events[event.other]
        assert mine.body == event.body
        assert mine.time.value == pytest.approx(event.time.value, abs=2e-13)


@pytest.mark.parametrize("at", only((20,), [2, 9, 20, 33]))
def test_a_run_resumed_before_or_after_impacts_has_its_bits(at: int, tmp_path: Path) -> None:
    start, path = crowd(), tmp_path / "run.h5"
    whole, seen = propagate(start, 20.0, samples=41), []
    propagate(start, 20.0, samples=41, archive=path, callback=lambda t, s: seen.append(t) or len(seen) == at).close()
    done = orbits.resume(path, progress=False)
    assert len(whole.events) >= 3
    assert np.array_equal(done.q, whole.q, equal_nan=True)
    assert np.array_equal(done.events.time, whole.events.time)
    assert done.retired.to_records() == whole.retired.to_records()
    done.close()
    with closing(orbits.Trajectory.open(path)) as opened:
        assert opened.retired.to_records() == whole.retired.to_records()
        assert opened[-1] == whole[-1]


def digger(mass: float = 0.0) -> orbits.System:
    """A sun, a planet, and a satellite that dives through the planet at each of its pericentres."""
    q = np.array([[0, 0, 0], [1, 0, 0], [1.004, 0, 0]])
    v = np.array([[0, 0, 0], [0, 1, 0], [0, 1 + 0.3 * math.sqrt(1e-5 / 0.004), 0.0]])
    return orbits.System(["sun", "planet", "moon"], gm=[1, 1e-5, mass], q=q, v=v, radii=[0.01, 5e-4, 0], units=D)


def test_all_collisions_within_one_step_of_the_bodies_are_recorded_and_change_no_bit() -> None:
    run = propagate(digger(), 2.0, samples=2, events=Collision())
    light = propagate(digger(1e-30), 2.0, samples=2, events=Collision())
    assert len(run.events) == len(light.events) > 2.0 * run.statistics.steps
    assert np.abs(run.events.time - light.events.time).max() < 1e-11
    plain = orbits.propagate(digger(), duration=2.0, samples=2, progress=False)
    assert np.array_equal(run.q, plain.q)


def test_an_impact_can_stop_the_run_within_a_step() -> None:
    with pytest.warns(orbits.errors.RetiredWarning, match="near"):  # its collision is not sought
        run = propagate(falling(), 6.0, samples=61, events=Collision("far", then="stop"))
    assert run.stopped is not None
    assert run.stopped.time.value == pytest.approx(fall(2.0, 0.015), rel=4e-15)
    assert "star and far: collision" in run.stopped.reason
    assert len(run) == 32
    state = run.stopped.system
    assert np.linalg.norm(state["far"].q.value - state["star"].q.value) == pytest.approx(0.015, rel=1e-10)


def test_a_fall_whose_collision_is_not_sought_ends_where_no_step_is_short_enough() -> None:
    with pytest.warns(orbits.errors.RetiredWarning, match="near"):
        run = propagate(falling(), 6.0, samples=61, events=Collision("far", then=Merge()))
    assert [one.reason for one in run.retired] == ["no step is short enough to go on", HIT]
    assert run.retired["near"].time.value == pytest.approx(fall(0.8, 0.0), rel=1e-8)
    assert [event.other for event in run.events] == ["far"]


def test_a_massless_body_bounces_off_one_with_mass() -> None:
    run = propagate(falling(), 3.0, samples=31, events=Collision("near", then=Bounce()))
    # Up and down again: twice the fall between two bounces.
    once = fall(0.8, 0.01)
    assert run.events.time.value == pytest.approx([once, 3 * once], abs=1e-11)
    assert run.events.kind[0] == "bounce"


def test_who_hit_a_body_is_remembered_after_bodies_with_mass_have_merged(tmp_path: Path) -> None:
    q = [[0, 0, 0], [0, 3.0, 0], [0, 0, 0.8], [2.5, 0, 0], [0, 0, -2.0]]
    v = [[0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 2.5**-0.5, 0], [0, 0, 0]]
    names, gm, radii = ["star", "planet", "dust", "p", "late"], [1.0, 1e-9, 0, 0, 0], [0.01, 0.001, 0, 0, 0]
    start = orbits.System(names, gm=gm, q=q, v=v, radii=radii, units=D)
    whole, path, seen = propagate(start, 9.0, samples=46), tmp_path / "run.h5", []
    assert [event.other for event in whole.events] == ["dust", "late", "planet"]
    assert whole.retired["dust"].time.value == pytest.approx(fall(0.8, 0.01), abs=1e-9)
    assert whole.retired.names == ("dust", "late")
    assert np.isfinite(whole.q.value[-1, 3]).all()
    propagate(start, 9.0, samples=46, archive=path, callback=lambda t, s: seen.append(t) or len(seen) == 44).close()
    done = orbits.resume(path, progress=False)
    assert np.array_equal(done.q, whole.q, equal_nan=True)
    assert done.retired.to_records() == whole.retired.to_records()
    done.close()


def test_a_run_by_constant_steps_goes_on_from_within_a_step_after_massless_bodies_were_lost(tmp_path: Path) -> None:
    """A merger of massive bodies leaves a part of a step, from which the march knows of a particle lost long before."""
    q, v = [[0, 0, 0], [0, 3.0, 0], [0, 0, 0.8], [2.5, 0, 0]], [[0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 2.5**-0.5, 0]]
    names, gm, radii = ["star", "planet", "dust", "p"], [1.0, 1e-9, 0, 0], [0.3, 0.001, 0, 0]
    start, path = orbits.System(names, gm=gm, q=q, v=v, radii=radii, units=D), tmp_path / "run.h5"
    how: dict[str, object] = {"dt": 1 / 32, "samples": 3, "check_step": False}
    whole = propagate(start, 7.0, **how)
    assert [event.other for event in whole.events] == ["dust", "planet"]
    run = propagate(start, 7.0, **how, archive=path, wall_time=1e-9)
    for _ in range(100):
        run.close()
        if run.complete:
            break
        run = orbits.resume(path, progress=False, wall_time=1e-9)
    with closing(orbits.Trajectory.open(path)) as done:
        assert np.array_equal(done.q, whole.q, equal_nan=True)
        assert np.array_equal(done.events.time, whole.events.time)
        assert done.retired.to_records() == whole.retired.to_records()
