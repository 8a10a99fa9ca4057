"""Collisions that act on the bodies of a run: mergers, bounces, and what is kept through them."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from astropy import units as u

import orbits
from orbits.errors import EventError, InputError, SingularityError
from orbits.events import Bounce, CloseApproach, Collision, Merge
from orbits.propagation.collisions.merge_and_bounce import State
from orbits.propagation.collisions.of_a_run import _keeping_momentum, _momentum
from orbits.trajectory.changes import Changes, no_changes

from ..coverings import every, first

D = orbits.DIMENSIONLESS
MERGE = Collision(then=Merge())


def pair(radii: tuple[float, float] = (0.1, 0.1), gm: tuple[float, float] = (1.0, 0.5)) -> orbits.System:
    """Two bodies at rest, 2 apart."""
    still = np.zeros((2, 3))
    return orbits.System(["a", "b"], gm=gm, q=[[-1, 0, 0], [1, 0, 0]], v=still, radii=radii, units=D).barycentric()


def fall(start: float, end: float, mu: float) -> float:
    """The time of a radial fall from rest: Kepler's equation for e = 1."""
    x = end / start
    return math.sqrt(start**3 / (2.0 * mu)) * (math.acos(math.sqrt(x)) + math.sqrt(x * (1.0 - x)))


def disc(count: int = 100, seed: int = 1) -> orbits.System:
    """A star and a disc of planetesimals with inflated radii."""
    rng = np.random.default_rng(seed)
    angles = {name: rng.uniform(0.0, 2.0 * np.pi, count) for name in ("pomega", "Omega")}
    angles["l"] = 2.0 * np.pi * rng.permutation(count) / count  # apart at the start
    system = orbits.System.from_elements({"star": {"gm": 1.0, "radius": 0.01}}, units=D)
    return system.add(
        [f"p{i}" for i in range(count)],
        primary="star",
        gm=rng.uniform(0.5e-7, 1.5e-7, count),
        radius=0.006,
        a=rng.uniform(0.9, 1.1, count),
        e=rng.uniform(0.0, 0.03, count),
        inc=rng.uniform(0.0, 0.005, count),
        **angles,
    ).barycentric()


STEPS = pytest.mark.parametrize("dt", [None, 0.05], ids=["adaptive", "constant"])
ONE_BY_DEFAULT = pytest.mark.parametrize("dt", first(1, [None, 0.05]), ids=["adaptive", "constant"])


@pytest.mark.parametrize("dt", [None, 0.01], ids=["adaptive", "constant"])
def test_a_head_on_merger_takes_place_at_keplers_time_and_keeps_mass_momentum_and_energy_account(
    dt: float | None,
) -> None:
    run = orbits.propagate(pair(), dt=dt, duration=4.0, samples=21, events=MERGE, check_step=False)
    (event,) = run.events
    assert (event.kind, event.body, event.other) == ("merger", "a", "b")
    # To a few units in the last place of 2.5, 4e-16 each: 3e-15 was seen.
    assert abs(event.time.value - fall(2.0, 0.2, 1.5)) <= 5e-15
    assert event.distance.value == pytest.approx(0.2, rel=1e-14)
    end = run[-1]
    assert end.names == ("a",)
    assert end.gm.value[0] == 1.5
    assert end.radii.value[0] == pytest.approx(0.1 * 2.0 ** (1 / 3), rel=1e-15)  # volumes add
    assert np.abs(end.q.value).max() < 1e-15
    assert np.isnan(run.q[-1, 1]).all()
    assert [len(leg.names) for leg in run.legs] == [2, 1]
    # All energy goes: -gm gm / r at the start, and nothing moves at the end.
    assert run.energy_lost()[-1].value == pytest.approx(-0.25, rel=4e-15)
    drift = run.drift()
    assert drift.energy.max_fraction <= 4e-15
    assert drift.linear_momentum.max_fraction <= 1e-15


@ONE_BY_DEFAULT
def test_a_hundred_bodies_keep_mass_momentum_centre_of_mass_and_energy_account_to_round_off(dt: float | None) -> None:
    system = disc()
    run = orbits.propagate(system, dt=dt, duration=15.0, samples=31, events=MERGE, check_step=False)
    count = len(run.events)
    assert count >= 15
    assert len(run[-1]) == 101 - count
    assert run[-1].gm.value.sum() == pytest.approx(system.gm.value.sum(), rel=4e-16)
    drift = run.drift()
    # A few units in the last place were seen; without the account the energy changes by 4e-5.
    assert drift.energy.max_fraction < 3e-15
    assert drift.angular_momentum.max_fraction < 1e-15
    assert drift.linear_momentum.max_fraction < 1e-15
    assert drift.centre_of_mass.max_fraction < 1e-15
    assert np.ptp(run.energy().value) > 1e-5 * abs(run.energy()[0].value)
    # No two bodies that are left overlap.
    q, radii = run[-1].q.value, run[-1].radii.value
    gap = np.linalg.norm(q[:, None] - q[None], axis=2) - radii - radii[:, None]
    assert (gap + 9.0 * np.eye(len(q)) > 0.0).all()


@STEPS
def test_samples_elsewhere_change_neither_the_mergers_nor_the_end_by_a_bit(dt: float | None) -> None:
    options = {"dt": dt, "duration": 10.0, "events": MERGE, "check_step": False}
    many = orbits.propagate(disc(60), samples=np.linspace(0.0, 10.0, 171), **options)
    few = orbits.propagate(disc(60), samples=[3.3, 10.0], **options)
    assert len(many.events) >= 3
    assert np.array_equal(many.events.time, few.events.time)
    assert np.array_equal(many.q[-1], few.q[-1], equal_nan=True)
    assert np.array_equal(many.v[-1], few.v[-1], equal_nan=True)


@ONE_BY_DEFAULT
def test_a_run_resumed_after_mergers_has_the_bits_of_one_that_never_stopped(dt: float | None, tmp_path: Path) -> None:
    options = {"dt": dt, "duration": 10.0, "samples": 41, "events": MERGE, "check_step": False}
    whole = orbits.propagate(disc(60), **options)
    seen: list[float] = []

    def until_some_have_merged(t: u.Quantity, system: orbits.System) -> bool:
        seen.append(len(system))
        return len(seen) == 28

    path = tmp_path / "run.h5"
    with_half = orbits.propagate(disc(60), archive=path, callback=until_some_have_merged, **options)
    assert seen[-1] < seen[0]  # callbacks see the bodies that are left
    half = len(with_half.events)
    with_half.close()
    resumed = orbits.resume(path)
    assert 0 < half < len(resumed.events) == len(whole.events)
    assert np.array_equal(resumed.events.time, whole.events.time)
    assert np.array_equal(resumed.q, whole.q, equal_nan=True)
    assert np.array_equal(resumed.v, whole.v, equal_nan=True)
    assert resumed[-1] == whole[-1]
    resumed.close()
    opened = orbits.Trajectory.open(path)
    assert opened[-1] == whole[-1]
    assert opened.drift().energy.max_fraction < 3e-15
    opened.close()


@pytest.mark.parametrize("at", every(2, [3, 5, 8, 12]), ids=str)
def test_a_run_stopped_anywhere_within_a_step_with_a_merger_goes_on_to_the_same_bits(at: int, tmp_path: Path) -> None:
    # The merger is at 2.53, in the step from 2.52 to 2.54; samples lie before, in, and after the part of the step.
    times = [0.0, 2.41, 2.51, 2.525, 2.529, 2.53, 2.535, 2.538, 2.54, 2.55, 2.59, 2.61, 3.5, 4.0]
    options = {"dt": 0.02, "duration": 4.0, "samples": times, "events": MERGE, "check_step": False}
    moving = pair(gm=(1.0, 0.5)).replaced(v=[[0.1, 0, 0], [0.1, 0, 0]])
    whole = orbits.propagate(moving, **options)
    seen: list[int] = []
    path = tmp_path / "run.h5"
    orbits.propagate(
        moving, archive=path, callback=lambda t, s: bool(seen.append(1)) or len(seen) == at, **options
    ).close()
    resumed = orbits.resume(path)
    assert np.array_equal(resumed.q, whole.q, equal_nan=True)
    assert np.array_equal(resumed.events.time, whole.events.time)
    resumed.close()


def test_what_a_merger_off_the_centre_turns_into_spin_is_told() -> None:
    q, v = [[0, 0, 0], [1, 0, 0], [1.3, 0.02, 0.01]], [[0, 0, 0], [0, 1, 0], [-0.3, 0.9, 0.05]]
    system = orbits.System(["s", "a", "b"], [1.0, 0.01, 0.02], q, v, radii=[1e-3, 0.03, 0.03])
    run = orbits.propagate(system, duration=3.0, samples=7, events=MERGE)
    whole, lost = run.angular_momentum().value, run.angular_momentum_lost().value
    assert len(run.events) == 1
    assert np.abs(lost[-1]).min() > 0.01
    assert np.abs(whole + lost - whole[0]).max() < 4e-16 * np.linalg.norm(whole[0])  # 1.3e-16 was seen


@pytest.mark.parametrize("then", [Merge(), Bounce()])
def test_bodies_collide_with_the_masses_of_their_time(then: object) -> None:
    """A star that has lost nearly half of itself merged as if it were whole, at 0.10 instead of -0.03."""
    q, v = [[0, 0, 0], [12, 0, 0]], [[0, -0.002, 0], [0, 0.01, 0]]
    system = orbits.System(["s", "a"], [1.0, 0.2], q, v, radii=[0.5, 0.3], units=orbits.DIMENSIONLESS)
    system = system.with_forces(orbits.terms.MassLoss(source="s", fraction=-0.01))
    run = orbits.propagate(system, duration=47.0, samples=5, events=Collision(then=then))
    time = float(run.events.time.value[0])
    met = orbits.propagate(system, duration=47.0, samples=2, events=Collision(then="stop")).stopped
    assert met is not None
    after, masses = run.at(time * (1.0 + 1e-13)), np.array([1.0 - 0.01 * time, 0.2])
    left = [masses.sum()] if then == Merge() else masses
    momentum = masses @ met.system.v.value
    assert np.abs(np.asarray(left) @ after.v.value - momentum).max() < 1e-12  # 1e-13 of a step behind: 2e-16 was seen
    assert (after.gm.value[0] * masses[0], after.gm.value.size) == (pytest.approx(left[0], rel=1e-12), len(left))
    # Relative to a momentum at the start that is 1/60 of that at the end: 3e-14 was seen.
    assert run.drift().linear_momentum.max_fraction < 1e-13
    assert run.drift().energy.max_fraction < 2e-14


@STEPS
def test_bounces_follow_the_closed_form(dt: float | None) -> None:
    restitution, reach, mu, start = 0.7, 1.0, 1.001, 2.0
    system = pair(radii=(0.9, 0.1), gm=(1.0, 1e-3))
    times = [fall(start, reach, mu)]
    for _ in range(5):
        speed2 = 2.0 * mu * (1.0 / reach - 1.0 / start) * restitution**2
        start = 1.0 / (1.0 / reach - speed2 / (2.0 * mu))
        times.append(times[-1] + 2.0 * fall(start, reach, mu))
    event = Collision(then=Bounce(restitution=restitution))
    run = orbits.propagate(system, dt=dt, duration=7.5, samples=11, events=event, check_step=False)
    assert list(run.events.kind) == ["bounce"] * 6
    assert np.abs(run.events.time.value - times).max() < 2e-14  # 7e-15 was seen
    # The energy lost at each bounce is that of the motion along the line of the centres, by 1 - e^2.
    reduced = 1e-3 / mu
    lost = sum(0.5 * reduced * v**2 * (1.0 - restitution**2) for v in run.events.speed.value)
    assert run.energy_lost()[-1].value == pytest.approx(lost, rel=1e-12)
    assert run.drift().energy.max_fraction < 2e-15
    assert run.drift().linear_momentum.max_fraction < 1e-15


def test_elastic_bounces_keep_the_energy() -> None:
    run = orbits.propagate(pair(radii=(0.9, 0.1)), duration=40.0, events=Collision(then=Bounce()))
    assert len(run.events) >= 8
    energy = run.energy().value
    assert np.ptp(energy) < 1e-14 * abs(energy[0])


@pytest.mark.nightly
@pytest.mark.parametrize("then", [Merge(), Bounce(restitution=0.7)], ids=["merge", "bounce"])
def test_collisions_keep_the_momentum_of_relativity_by_all_bodies(then: Merge | Bounce) -> None:
    """It has energies in it, and was off by 4e-8 when m v alone was kept."""
    q, v = [[0, 0, 0], [1, 0, 0], [1.2, 0.01, 0]], [[0, 0, 0], [0, 1, 0], [-0.5, 1, 0]]
    start = orbits.System(["star", "a", "b"], gm=[1.0, 1e-3, 2e-3], q=q, v=v, radii=[0.01, 0.02, 0.02], units=D)
    start = start.with_terms(orbits.terms.PostNewtonian(c=20.0)).barycentric()
    run = orbits.propagate(start, duration=2.0, samples=9, events=Collision(then=then), check_step=False)
    assert len(run.events)
    assert run.drift().linear_momentum.max_fraction < 3e-14  # 6.6e-15
    assert run.drift().energy.max_fraction < 1e-13


def test_what_a_collision_does_to_velocities_is_mended_to_the_round_off_of_a_momentum_with_energies_in_it() -> None:
    """Of relativity by all bodies, whose part is 3e-3 of m v here: each iteration gains as much."""
    q, v = [[0, 0, 0], [1, 0, 0], [1.2, 0.01, 0]], [[0, 0, 0], [0, 1, 0], [-0.5, 1, 0]]
    start = orbits.System(["star", "a", "b"], gm=[1.0, 1e-3, 2e-3], q=q, v=v, units=D)
    start = start.with_terms(orbits.terms.PostNewtonian(c=20.0)).barycentric()
    gm, before = start.values.gm, State(start.values.gm, np.zeros(3), start.values.q, start.values.v)
    stuck = before.v.copy()
    stuck[1:] = gm[1:] @ before.v[1:] / gm[1:].sum()
    there = start, Changes(start, no_changes(), 1.0).bodies_after(0), 0.0
    after = _keeping_momentum(*there, before, before._replace(v=stuck), {1, 2})
    off = _momentum(*there, after) - _momentum(*there, before)
    assert np.abs(off).max() < 1e-16  # 2e-17 of 3e-3; 7e-15 after an iteration less, 3e-7 after none


def test_bodies_that_come_to_rest_on_one_another_end_the_run_with_their_names_and_all_before() -> None:
    with pytest.raises(SingularityError, match=r"b comes to rest on a; its bounces follow one another") as raised:
        orbits.propagate(pair(radii=(0.9, 0.1)), duration=20.0, events=Collision(then=Bounce(restitution=0.5)))
    assert len(raised.value.trajectory) > 5
    assert len(raised.value.trajectory.events) > 10


def test_three_bodies_in_contact_at_the_same_instant_bounce_pair_after_pair() -> None:
    places, speeds = [[-3, 0, 0], [0, 0, 0], [3, 0, 0]], [[1, 0, 0], [0, 0, 0], [-1, 0, 0]]
    system = orbits.System(list("abc"), gm=[1e-20] * 3, q=places, v=speeds, radii=[0.5] * 3, units=D)
    run = orbits.propagate(system, duration=4.0, events=Collision(then=Bounce()))
    assert [(e.body, e.other) for e in run.events] == [("a", "b"), ("b", "c"), ("a", "b")]
    assert np.ptp(run.events.time.value) == 0.0
    assert run[-1].v.value[:, 0] == pytest.approx([-1.0, 0.0, 1.0], abs=1e-14)


def test_a_body_that_the_grown_one_overlaps_merges_at_the_same_instant() -> None:
    # b and c meet at x = 1; their sphere of radius 0.5 x 2^(1/3) = 0.63 then reaches a, at 1.12 from their middle.
    places = [[1.0, 1.12, 0.0], [0.0, 0.0, 0.0], [2.0, 0.0, 0.0]]
    system = orbits.System(
        list("abc"), gm=[1e-9] * 3, q=places, v=[[0, 0, 0], [0.1, 0, 0], [-0.1, 0, 0]], radii=[0.5] * 3, units=D
    )
    run = orbits.propagate(system, duration=8.0, events=MERGE)
    assert [(e.body, e.other) for e in run.events] == [("b", "c"), ("b", "a")]
    assert run.events.time[0] == run.events.time[1]
    assert run[-1].names == ("b",)
    assert run[-1].radii.value[0] == pytest.approx(0.5 * 3 ** (1 / 3), rel=1e-14)
    assert len(run.legs) == 2


def test_states_at_any_time_go_through_the_changes_after_the_last_sample() -> None:
    times = np.linspace(0.1, 9.9, 14)
    few = orbits.propagate(disc(60), duration=10.0, samples=[0.0, 10.0], events=MERGE)
    there = orbits.propagate(disc(60), duration=10.0, samples=times, events=MERGE)
    found = few.at(times)
    assert np.array_equal(np.isnan(found.q), np.isnan(there.q))
    assert np.nanmax(np.abs(found.q.value - there.q.value)) < 1e-11  # 3e-14 was seen: round-off, grown
    assert few.at(9.9).names == there[-1].names
    assert few.at(9.9).gm[0] == there[-1].gm[0]


@pytest.mark.parametrize("samples", [[12.0], [0.77, 2.511, 5.333, 9.01]])
def test_after_a_change_within_a_step_states_at_any_time_are_on_the_steps_of_the_run(samples: list[float]) -> None:
    """A march that took whole steps from there was off by 4e-9, and 2e-9 with samples within steps."""
    options: dict[str, Any] = {"dt": 0.05, "duration": 12.0, "events": MERGE, "check_step": False}
    asked = np.sort(np.random.default_rng(1).uniform(0.0, 12.0, 60))
    sampled = orbits.propagate(disc(60), "stormer-verlet", samples=asked, **options)
    assert sampled.changes is not None
    assert len(sampled.changes) >= 2
    found = orbits.propagate(disc(60), "stormer-verlet", samples=samples, **options).at(asked)
    np.testing.assert_allclose(found.q, sampled.q, rtol=0.0, atol=1e-13)


def test_a_massless_body_that_vanishes_leaves_states_at_any_time_on_the_steps_of_the_run() -> None:
    """The run begins no leg there: one that did was off by 2e-5."""
    q, v = [[0, 0, 0], [1, 0, 0], [0, 0.6, 0]], [[0, 0, 0], [0, 1, 0], [0, 0, 0]]
    system = orbits.System(["star", "planet", "z"], [1, 1e-3, 0], q, v, radii=[0.1, 0.01, 0], units=D)
    options: dict[str, Any] = {"dt": 0.05, "duration": 6.0, "events": MERGE, "check_step": False}
    asked = np.sort(np.random.default_rng(1).uniform(0.0, 6.0, 40))
    sampled = orbits.propagate(system, "stormer-verlet", samples=asked, **options)
    assert len(sampled.events) == 1
    for samples in ([6.0], [0.333, 1.21, 4.04]):
        found = orbits.propagate(system, "stormer-verlet", samples=samples, **options).at(asked)
        np.testing.assert_allclose(found.q, sampled.q, rtol=0.0, atol=1e-14)  # 2e-15 was reached


def test_collisions_that_are_only_recorded_let_bodies_pass_through_each_other_and_change_no_bit() -> None:
    system = disc(60)
    plain = orbits.propagate(system, duration=8.0, samples=9)
    noted = orbits.propagate(system, duration=8.0, samples=9, events=Collision())
    assert len(noted.events) >= 3
    assert set(noted.events.kind) == {"collision"}
    assert np.array_equal(plain.q, noted.q)
    merged = orbits.propagate(system, duration=8.0, samples=9, events=MERGE)
    assert merged.events.time[0] == noted.events.time[0]


def test_a_collision_can_stop_the_run() -> None:
    run = orbits.propagate(pair(), duration=4.0, samples=41, events=Collision("a", "b", then="stop"))
    assert run.stopped is not None
    assert run.stopped.time.value == pytest.approx(fall(2.0, 0.2, 1.5), rel=1e-14)
    assert "a and b: collision" in run.stopped.reason
    assert np.linalg.norm(np.diff(run.stopped.system.q.value, axis=0)) == pytest.approx(0.2, rel=1e-12)
    assert len(run) == 26


def test_only_named_bodies_collide_and_of_two_rules_the_first_counts() -> None:
    system = disc(60)
    every = orbits.propagate(system, duration=8.0, samples=3, events=Collision())
    one = every.events[0].body
    named = orbits.propagate(system, duration=8.0, samples=3, events=Collision(one))
    assert all(one in (e.body, e.other) for e in named.events)
    assert 0 < len(named.events) < len(every.events)
    rules = [Collision(one), Collision(then=Merge())]
    both = orbits.propagate(system, duration=8.0, samples=3, events=rules)
    assert {e.kind for e in both.events[one]} == {"collision"}
    assert "merger" in set(both.events.kind)


def test_massless_bodies_vanish_into_massive_ones_and_change_no_bit_of_the_others() -> None:
    rng = np.random.default_rng(3)
    q = np.concatenate([[[0, 0, 0], [5, 0, 0]], rng.normal(size=(20, 3)) * 2.0])
    v = np.concatenate([[[0, 0, 0], [0, 0.45, 0]], rng.normal(size=(20, 3)) * 0.3])
    names = ["star", "planet", *[f"dust {k}" for k in range(20)]]
    radii = [0.5, 0.1, *[0.0] * 20]
    system = orbits.System(names, gm=[1, 1e-3, *[0] * 20], q=q, v=v, radii=radii, units=D)
    options = {"dt": 0.02, "duration": 20.0, "samples": 21, "check_step": False}
    plain = orbits.propagate(system, **options)
    run = orbits.propagate(system, events=MERGE, **options)
    gone = [name for name in names if name not in run[-1].names]
    assert len(gone) >= 5
    assert sorted(event.other for event in run.events) == sorted(gone)
    assert {event.body for event in run.events} <= {"star", "planet"}
    stay = [names.index(name) for name in run[-1].names]
    assert np.array_equal(run.q[:, stay], plain.q[:, stay])
    assert len(run.legs[-1].names) == len(stay)
    assert np.array_equal(run[-1].gm, system.gm[stay])
    assert set(run.retired.names) == set(gone)
    assert {particle.reason for particle in run.retired} == {"it merged with a body that it hit"}
    times = {event.other: event.time for event in run.events}
    for particle in run.retired:  # where it hit, when it did
        assert particle.time == times[particle.name]
        assert particle.step == particle.time // run.dt


def test_what_passes_within_a_step_is_found_though_both_ends_are_outside() -> None:
    # 1.5 diameters in a step: the bodies overlap only between its ends.
    system = orbits.System(
        ["a", "b"], gm=[1e-9, 1e-9], q=[[0, 0, 0], [-1.0, 0.05, 0]], v=[[0, 0, 0], [1, 0, 0]], radii=[0.05] * 2, units=D
    )
    run = orbits.propagate(system, dt=0.3, duration=3.0, events=Collision(), check_step=False)
    assert len(run.events) == 1
    assert run.events.time[0].value == pytest.approx(1.0 - math.sqrt(0.1**2 - 0.05**2), rel=1e-8)
    # And one that passes by at 1.0001 radii is not.
    missed = system.replaced(q=[[0, 0, 0], [-1.0, 0.10001, 0]])
    assert not len(orbits.propagate(missed, dt=0.3, duration=3.0, events=Collision(), check_step=False).events)


def test_a_run_backwards_merges_bodies_as_it_meets_them() -> None:
    run = orbits.propagate(pair(), duration=-4.0, events=MERGE)
    assert run.events[0].time.value == pytest.approx(-fall(2.0, 0.2, 1.5), rel=1e-14)
    assert run[-1].names == ("a",)


def test_work_of_forces_is_accounted_for_over_legs() -> None:
    drag = orbits.terms.Drag(rate=0.01)
    run = orbits.propagate(disc(60).with_forces(drag), dt=0.05, duration=12.0, samples=9, events=MERGE)
    assert len(run.events) >= 3
    # The quadrature of the work has the order of the method; angular momentum is exact to round-off.
    assert run.drift().angular_momentum.max_fraction < 1e-14
    assert run.drift().energy.max_fraction < 1e-12


@pytest.mark.parametrize("rates", first(1, [{"a": 0.3, None: 0.1}, {"a": 0.3, None: 0.1, "b": 0.2}]), ids=len)
def test_work_of_forces_stays_with_them_where_the_bodies_of_one_are_all_gone(rates: Any) -> None:
    """It was added to that of other forces, or ended the run with an error of NumPy."""
    near, far, heavy = ([x, 0.0, 0.0] for x in (-0.1, 0.1, 10.0))
    names, places, still = ["a", "b", "c"], [near, far, heavy], np.zeros((3, 3))
    system = orbits.System(names, [1e-3, 2e-3, 1.0], places, still, radii=[0.03] * 3, units=D)
    forces = [orbits.terms.Drag(rate=rate, bodies=None if body is None else [body]) for body, rate in rates.items()]
    system = system.with_forces(*forces)
    run = orbits.propagate(system, dt=0.05, duration=4.0, samples=5, events=MERGE, check_step=False)
    assert run[-1].forces == system.forces[1:]
    on_lost = run.work()[0].work.value
    assert on_lost[-1] == on_lost[-2] != 0.0
    assert run.drift().linear_momentum.max_fraction < 1e-14


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"radii": None}, r"collisions need radii, and the bodies have none. Give them: system.add\(..., radius"),
        ({"radii": [0.0, 0.0]}, "collisions need radii"),
        ({"radii": [1.5, 0.6]}, r"a and b are 2 apart at the start, less than their radii together, 2\.1\. Move"),
    ],
)
def test_radii_that_are_missing_or_overlap_are_refused(change: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        orbits.propagate(pair().replaced(**change), duration=1.0, events=MERGE)


def test_unsound_collisions_are_refused() -> None:
    system = pair()
    for events, message in [
        ([MERGE, CloseApproach("a", "b", then=lambda t, s: s)], "only collisions act in a run whose bodies"),
        (CloseApproach("a", "b", then=Merge()), "only bodies that collide can do that"),
        (Collision("a", "A"), "twice; expected two bodies"),
    ]:
        with pytest.raises(InputError, match=message):
            orbits.propagate(system, duration=1.0, events=events)
    with pytest.raises(InputError, match="expected 'record', 'stop'"):
        Collision(then=lambda t, system: None)
    with pytest.raises(InputError, match="expected 0"):
        Bounce(restitution=1.5)
    with pytest.raises(InputError, match="keeps the steps of the same bodies"):
        orbits.propagate(system, duration=1.0, events=MERGE, dense=True)
    with pytest.raises(InputError, match="is tested in steps of the same bodies"):
        orbits.propagate(system, duration=1.0, events=MERGE, stop=orbits.events.EnergyErrorAbove(1e-9))
    far = orbits.events.FartherThan(9.0, "a", "b", then="stop")
    assert orbits.propagate(system, duration=1.0, events=[MERGE, far]).complete


def test_what_knows_the_same_bodies_from_start_to_end_refuses_runs_with_mergers() -> None:
    run = orbits.propagate(pair(), duration=4.0, events=MERGE)
    for refused in (run.closest_approaches, run.unresolved, run._begun, run.elements):
        with pytest.raises(InputError, match=r"bodies merge, (bounce, or are changed|or masses change)"):
            refused()
    quiet = orbits.propagate(pair(), duration=1.0, events=MERGE)
    assert len(quiet.closest_approaches())


def test_exact_collisions_without_radii_still_name_the_bodies() -> None:
    with pytest.raises((SingularityError, EventError), match=r"a and b|b and a"):
        orbits.propagate(pair(), duration=4.0)


@pytest.mark.parametrize(("reach", "met"), [(0.24, 1), (0.2, 0)])
def test_a_sample_in_a_step_that_cannot_be_taken_is_reached_and_collisions_before_it_are_found(reach, met):
    """Two points fall on each other at t = 0.785, within the last step; far away two bodies meet at t = 1 - reach."""
    q, v = [[0.5, 0, 0], [-0.5, 0, 0], [0, 8, 0], [1, 8, 0]], [[0, 0, 0], [0, 0, 0], [0, 0, 0], [-1, 0, 0]]
    system = orbits.System(list("abcd"), [1.0, 1.0, 1e-9, 1e-9], q, v, radii=[0.0, 0.0, reach, 0.0], units=D)
    options = {"dt": 0.25, "duration": 0.77, "samples": 2, "check_step": False, "progress": False}
    run = orbits.propagate(system, events=Collision(then="record"), **options)
    assert np.array_equal(run.q, orbits.propagate(system, **options).q)
    assert len(run.events) == met
    assert np.abs(run.events.time.value - (1.0 - reach)).max(initial=0.0) < 2e-3  # the others pull both


@pytest.mark.parametrize("then", [Merge(), Bounce(), "stop"], ids=["merge", "bounce", "stop"])
def test_bodies_that_meet_before_their_pericentre_need_no_steps_that_resolve_it(then: Any) -> None:
    """A head-on fall, and one with a pericentre at 0.005: neither is reached."""
    for sideways in (0.0, 0.1):
        system = pair()
        system = system.replaced(v=system.v.value + np.array([[0, 0, 0], [0, sideways, 0]]))
        run = orbits.propagate(system, dt=0.01, duration=2.6, events=Collision(then=then), check_step="refuse")
        assert len(run.events) == 1


def test_steps_are_looked_at_where_bodies_pass_each_other_before_they_touch_or_pass_through() -> None:
    for radii, then in (((0.1, 0.1), "record"), ((1e-6, 1e-6), Merge())):
        with pytest.raises(InputError, match="falls straight into"):
            orbits.propagate(pair(radii), dt=0.01, duration=2.6, events=Collision(then=then), check_step="refuse")
