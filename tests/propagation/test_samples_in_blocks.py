"""Samples end no block: their states come from the steps that the run takes anyway, and nothing changes by a bit."""

import json

import numpy as np
import pytest
from astropy import units as u
from astropy.time import Time

import orbits
from orbits.marching.legs.block_loop import BlockLoop
from orbits.marching.stepping.partial_steps import PartialSteps
from orbits.regression.taylor import taylor
from orbits.resources import data_path

from ..coverings import at

GAUSS = orbits.Gauss(stages=8)
MANY = 350
CLOCKS = {"chosen steps": None, "constant steps": 5 * u.day, "backwards": 5 * u.day}


def planets() -> orbits.System:
    return orbits.System.from_elements(
        {
            "Sun": {"mass": 1 * u.M_sun},
            "a": {"a": 1 * u.au, "e": 0.3, "M": 0.4 * u.rad, "mass": 1e-4 * u.M_sun},
            "b": {"a": 2.2 * u.au, "e": 0.2, "M": 1 * u.rad, "mass": 1e-5 * u.M_sun},
        }
    )


def run_of(clock: str, samples, **options):
    sign = -1 if clock == "backwards" else 1
    return orbits.propagate(
        planets(), GAUSS, dt=CLOCKS[clock], duration=sign * 302.5 * u.day, samples=samples, **options
    )


@pytest.mark.parametrize("clock", CLOCKS)
def test_samples_end_no_block_and_their_states_take_one_call_for_each(clock, monkeypatch):
    calls = {"blocks": 0, "partial": 0}

    def counting(owner, name, what):
        function = getattr(owner, name)

        def counted(*given):
            calls[what] += 1
            return function(*given)

        monkeypatch.setattr(owner, name, counted)

    run_of(clock, 2)  # what is looked at once for each system is known after that
    counting(BlockLoop, "one_block", "blocks")
    counting(PartialSteps, "take", "partial")
    run_of(clock, 2)
    few = dict(calls)
    run = run_of(clock, MANY)
    # Those in the first of constant steps, in the block, and behind the last whole step.
    assert calls["blocks"] - few["blocks"] == few["blocks"]
    assert calls["partial"] - few["partial"] <= 3
    assert len(run) == MANY


@pytest.mark.parametrize("clock", CLOCKS)
def test_samples_together_are_those_that_are_looked_at_one_by_one(clock, tmp_path):
    together = run_of(clock, MANY)
    for other in (
        run_of(clock, MANY, callback=lambda t, state: None),
        run_of(clock, MANY, archive=tmp_path / "run.h5", dense=True),
        run_of(clock, together.times[[3, 4, 150, -1]]),
    ):
        rows = np.searchsorted(together.times * together.clock.direction, other.times * together.clock.direction)
        assert np.array_equal(other.q, together.q[rows])
        assert np.array_equal(other.v, together.v[rows])


@pytest.mark.parametrize("clock", CLOCKS)
def test_a_run_that_is_extended_has_the_samples_of_a_whole_one(clock, tmp_path):
    """The end of the first part lies within a step, which the whole run takes before the sample is known."""
    whole = run_of(clock, MANY)
    sign, half = whole.clock.direction, float(whole.times[166])
    first = orbits.propagate(
        planets(),
        GAUSS,
        dt=CLOCKS[clock],
        duration=half * u.day,
        samples=whole.times[:167],
        archive=tmp_path / "run.h5",
    )
    assert np.array_equal(first.q, whole.q[:167])
    resumed = orbits.resume(tmp_path / "run.h5", until=sign * 302.5)
    assert np.array_equal(resumed.q[-1], whole.q[-1])


def test_samples_before_a_step_that_cannot_be_taken_are_kept():
    fall = orbits.System(["a", "b"], [1.0, 1.0], [[-1, 0, 0], [1, 0, 0]], np.zeros((2, 3)), units=orbits.DIMENSIONLESS)
    kept = []
    for callback in (None, lambda t, state: None):
        with pytest.raises(orbits.errors.IntegrationError) as failed:
            orbits.propagate(fall, GAUSS, dt=0.1, duration=20, samples=4001, callback=callback, check_step=False)
        kept.append(failed.value.trajectory)
    together, one_by_one = kept
    # One by one, those in the step that fails are asked for before it is taken.
    assert 0 < len(together) <= len(one_by_one) <= len(together) + 20
    assert np.array_equal(together.q, one_by_one.q[: len(together)])


def test_samples_end_with_the_event_that_ends_the_run():
    stop = orbits.events.Apocentre("a", then="stop")
    together = run_of("chosen steps", MANY, events=[stop])
    one_by_one = run_of("chosen steps", MANY, events=[stop], callback=lambda t, state: None)
    assert together.stopped.time == one_by_one.stopped.time
    assert 50 < len(together) == len(one_by_one)
    assert np.array_equal(together.q, one_by_one.q)
    assert together.times[-1] < together.stopped.time.value


WITH_CARRIES = {
    "a map": ({}, "wisdom-holman", 5 * u.day),
    "a force": ({"forces": [orbits.terms.Drag(rate=1e-4 / u.yr)]}, GAUSS, 5 * u.day),
    "a force, chosen steps": ({"forces": [orbits.terms.Drag(rate=1e-4 / u.yr)]}, GAUSS, None),
    "transformed time": ({}, GAUSS, orbits.TimeTransformed(0.2)),
}
"""What acts, the method and the steps: each has more in its carry than a guess, or marches other variables."""


def blocks_of(monkeypatch, run):
    counted = []
    block = BlockLoop.one_block
    with monkeypatch.context() as patched:
        patched.setattr(BlockLoop, "one_block", lambda self, *given: counted.append(1) or block(self, *given))
        return run(), len(counted)


@pytest.mark.parametrize("what", at((0, 1, 3), WITH_CARRIES))
def test_samples_of_what_is_in_carries_are_those_one_by_one_and_end_no_block(what, monkeypatch):
    acts, method, dt = WITH_CARRIES[what]
    system = planets().replaced(**acts)

    def run(callback=None):
        how = {"dt": dt, "duration": 302.5 * u.day, "samples": MANY, "check_step": False}
        return orbits.propagate(system, method, callback=callback, **how)

    together, blocks = blocks_of(monkeypatch, run)
    one_by_one, many = blocks_of(monkeypatch, lambda: run(lambda t, state: None))
    assert np.array_equal(together.q, one_by_one.q)
    assert np.array_equal(together.v, one_by_one.v)
    assert np.array_equal(together._accounts, one_by_one._accounts)
    assert (together._accounts[-1] != 0.0).any() == bool(acts)
    assert blocks <= 4 < many


def test_accounts_of_forces_are_those_at_their_samples_where_a_pair_may_come_to_its_bound():
    """The search at the end of such a block asks for other states: all samples of it had the account of one of these,
    and the drift of the energy was 2e-2.
    """
    system = planets().replaced(forces=[orbits.terms.Drag(rate=1e-2 / u.yr)])
    stop = orbits.events.CloserThan(1.1 * u.au, "a", "b", then="stop")
    options = {"dt": 2 * u.day, "duration": 1200 * u.day, "samples": 601, "events": [stop], "check_step": False}
    together = orbits.propagate(system, GAUSS, **options)
    one_by_one = orbits.propagate(system, GAUSS, callback=lambda t, state: None, **options)
    assert together.stopped is not None
    assert np.array_equal(together._accounts, one_by_one._accounts)
    assert (np.diff(together._accounts[:, 0, 0]) != 0.0).all()


def ring() -> orbits.System:
    """Bodies on one circle about another, which run into each other, a massless one among them."""
    angles, speeds = np.array([0.0, 0.3, 0.5, 1.1, 1.6, 2.4]), np.array([1.0, 0.97, 1.02, 0.99, 0.96, 1.01])
    zero = np.zeros_like(angles)
    q = np.vstack([np.zeros(3), np.column_stack([np.cos(angles), np.sin(angles), zero])])
    v = np.vstack([np.zeros(3), np.column_stack([-np.sin(angles), np.cos(angles), zero]) * speeds[:, None]])
    gm = [1.0, 1e-4, 1e-5, 1e-4, 0.0, 1e-5, 1e-4]
    return orbits.System([*"sabcdef"], gm, q, v, units=orbits.DIMENSIONLESS, radii=[5e-3] + 6 * [0.03])


def faster(t, system):
    return system.replaced(v=system.v * 1.001)


CHANGING = {
    "no event": [],
    "mergers": [orbits.events.Collision(then=orbits.events.Merge())],
    "bounces": [orbits.events.Collision(then=orbits.events.Bounce()), orbits.events.Pericentre("a")],
    "listed": [orbits.events.Collision()],
    "a function": [orbits.events.PlaneCrossing("a", normal=(1, 0, 0), then=faster)],
}


@pytest.mark.filterwarnings("ignore::orbits.errors.OrbitsWarning")
@pytest.mark.parametrize("dt", [None, 0.05, -0.05], ids=["chosen", "constant", "backwards"])
@pytest.mark.parametrize("what", CHANGING)
def test_samples_of_bodies_that_change_are_those_one_by_one_and_end_few_blocks(what, dt, monkeypatch):
    """Several in the step of a change, before it and after it, and in steps that are shorter than they were proposed,
    among a particle that is retired backwards.
    """
    sign, times = (-1.0 if dt == -0.05 else 1.0), np.linspace(0.0, 14.0, 1401)

    def run(samples, callback=None):
        how = {"dt": dt and abs(dt), "until": sign * 14.0, "check_step": False, "progress": False}
        return orbits.propagate(ring(), GAUSS, samples=samples, events=CHANGING[what], callback=callback, **how)

    together, blocks = blocks_of(monkeypatch, lambda: run(sign * times))
    few, least = blocks_of(monkeypatch, lambda: run(sign * times[[0, 700, -1]]))
    one_by_one = run(sign * times, lambda t, state: None)
    assert (len(together.events) > 0) == bool(CHANGING[what])
    assert blocks <= least + 12 * (1 + len(together.events))
    for name in ("q", "v"):
        states = getattr(together, name)
        assert np.array_equal(states, getattr(one_by_one, name), equal_nan=True)
        assert np.array_equal(states[[0, 700, -1]], getattr(few, name), equal_nan=True)
    assert together.events.to_records() == one_by_one.events.to_records() == few.events.to_records()
    again = together.at(sign * times[5::50])
    assert np.array_equal(again.q, together.q[5::50], equal_nan=True)


def test_samples_at_an_encounter_are_right_to_their_last_digit():
    """A comet at its closest to Jupiter: from the state at the beginning of that step, rounded, the velocity would be
    wrong by 124 units of its last digit.
    """
    data = json.loads(data_path("close_encounters.json").read_text(encoding="utf-8"))
    start = next(each for each in data["encounters"] if each["planet"] == "Jupiter")
    system = orbits.System.solar_system(
        epoch=Time(start["epoch_jd_tdb"], format="jd", scale="tdb"), bodies=["Sun", "Jupiter", "Saturn"]
    )
    q, v = start["q_au"] * u.au, start["v_au_per_d"] * u.au / u.day
    system = system.add("comet", primary="Sun", gm=start["gm_m3_s2"] * u.m**3 / u.s**2, q=q, v=v)
    closest = orbits.propagate(system, duration=start["closest_d"] + 50.0, samples=2).closest_approaches()
    met = min(closest["comet"], key=lambda each: each.distance)
    times = float(met.time.value) + np.array([0.0, 3.7, 11.1])
    truth = taylor(system.values, times)
    within = orbits.propagate(system, duration=start["closest_d"] + 50.0, samples=times)
    ahead = orbits.propagate(system, duration=times[0], samples=times[:1])
    for ulps, got, alone, right in ((0.5, within.q, ahead.q, truth.q), (1.0, within.v, ahead.v, truth.v)):
        assert np.abs(got.value - right).max() <= ulps * np.spacing(np.abs(right[:, -1]).max())
        assert np.array_equal(alone[0], got[0])
