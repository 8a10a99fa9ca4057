"""Massless particles follow by one contract, and threads take part in it without being waited for."""

import importlib
import inspect
import pkgutil
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import orbits
from orbits.integrators.maps import jacobi_form
from orbits.kernels.compile import kernel
from orbits.kernels.rounds import COUNTERS, DISMISSED, Turns, claim_piece, next_round
from orbits.lagrangians.newtonian import newtonian, parameters
from orbits.marching import following
from orbits.marching.following.contract import follow_block
from orbits.marching.following.follower import Follower
from orbits.marching.legs.leg import Leg
from orbits.marching.stepping.pool import Helpers

from ..problems import belt

PIECES, HELPERS, ROUNDS = 7, 3, 3000


def records():
    """Return the records of the kernels in the modules of followers."""
    names = [module.name for module in pkgutil.iter_modules(following.__path__, "orbits.marching.following.")]
    found = [one for name in names for _, one in inspect.getmembers(importlib.import_module(name), inspect.isclass)]
    return {one for one in found if hasattr(one, "_fields") and one.__module__ in names}


def test_records_have_at_most_15_fields_and_the_entry_point_12_arguments():
    assert len(records()) >= 10
    assert max(len(one._fields) for one in records()) <= 15
    assert len(inspect.signature(follow_block.py_func).parameters) <= 12


@kernel
def count_pieces(turns, counts):
    """Count the pieces that are claimed, by the thread and the round."""
    number = next_round(turns, 0)
    while number > 0:
        piece = claim_piece(turns)
        while piece < counts.shape[2]:
            counts[turns.member, number - 1, piece] += 1
            piece = claim_piece(turns)
        number = next_round(turns, number)


def test_each_piece_of_a_round_is_done_once_and_before_it_ends():
    counters, counts = np.zeros(COUNTERS, dtype=np.int64), np.zeros((1 + HELPERS, ROUNDS, PIECES), dtype=np.int64)
    count_pieces(Turns(np.zeros(COUNTERS, dtype=np.int64), 0, 0), np.zeros((1, 1, 1), dtype=np.int64))
    with ThreadPoolExecutor(HELPERS) as pool:
        others = [pool.submit(count_pieces, Turns(counters, k, 1 << 40), counts) for k in range(1, 1 + HELPERS)]
        for done in range(1, ROUNDS + 1):
            count_pieces(Turns(counters, 0, 0), counts)
            assert counts[:, done - 1].sum() == PIECES
            assert not counts[:, done:].any()
        counters[DISMISSED] = 1
    assert all(one.result() is None for one in others)
    assert np.all(counts.sum(axis=0) == 1)


def cloud(method, h, threads, particles=200):
    """Return a march of two bodies and some particles."""
    rng = np.random.default_rng(3)
    gm, n = np.array([1.0, 1e-4] + [0.0] * particles), 2 + particles
    radius, angle = rng.uniform(1.1, 2.5, n), rng.uniform(0.0, 2 * np.pi, n)
    radius[:2] = 0.0, 1.0
    q = np.stack([radius * np.cos(angle), radius * np.sin(angle), 0.05 * rng.normal(size=n)], axis=1)
    speed = 1.0 / np.sqrt(np.maximum(radius, 1e-9))
    speed[0] = 0.0
    v = np.stack([-speed * np.sin(angle), speed * np.cos(angle), np.zeros(n)], axis=1)
    return Leg.of(newtonian, method, parameters(gm[:2]), gm > 0, q, v, h, threads=threads)


WAYS = {
    "in lanes": (orbits.StormerVerlet(), 0.01),
    "one after another": (orbits.Gauss(stages=4), 0.05),
    "by own steps": (orbits.Gauss(stages=6), orbits.Adaptive()),
    "leaving a map": (orbits.WisdomHolman(encounters="follow particles"), 0.02),
}


@pytest.mark.parametrize("way", WAYS)
def test_helpers_take_part_and_change_no_bit(way, monkeypatch):
    monkeypatch.setattr("orbits.marching.stepping.pool.WORTHWHILE", 0.0)
    method, h = WAYS[way]
    helped, end = 0, time.monotonic() + 120.0
    while not helped and time.monotonic() < end:  # the system decides when threads run; on a busy machine late
        alone, shared = cloud(method, h, 1), cloud(method, h, 3)
        for _ in range(400):
            alone.advance(20)
            shared.advance(20)
            helped += sum(int(evaluations[0]) for evaluations in shared.stepper.loops.follower._evaluations[1:])
            if helped and alone.step >= 200:
                break
    assert helped > 0
    shared.close()  # what is asked for now is computed by the caller's thread
    alone.advance(20)
    shared.advance(20)
    expected = alone.checkpoint()
    for name, array in shared.checkpoint().items():
        assert np.array_equal(array, expected[name], equal_nan=True), name


def test_nobody_waits_for_threads_that_do_not_come():
    march, expected = cloud(orbits.StormerVerlet(), 0.01, 2), cloud(orbits.StormerVerlet(), 0.01, 1)
    free = threading.Event()
    march.stepper.loops._pool.submit(free.wait)
    march.stepper.loops._helpers._pace = 1.0
    march.advance(100)
    assert march.stepper.loops._helpers._running[1].running() is False
    free.set()
    expected.advance(100)
    assert np.array_equal(march.state()[0], expected.state()[0])
    march.close()


def test_samples_leave_the_threads_to_the_march(monkeypatch):
    """A partial step, on a copy of the state, neither dismisses the threads nor binds the march anew."""
    monkeypatch.setattr("orbits.marching.stepping.pool.WORTHWHILE", 0.0)
    monkeypatch.setattr("orbits.marching.stepping.pool.PATIENCE", 10**9)  # none leaves by itself
    march, dismissed = cloud(orbits.StormerVerlet(), 0.01, 2), []
    march.advance(100)
    march.advance(100)
    bound = march.stepper.loops.follower._bound[False]
    monkeypatch.setattr(Helpers, "dismiss", lambda self: dismissed.append(self))
    march.stepper.loops._helpers._pace = 1e-7
    march.state_after(0.005)
    march.advance(1)
    assert march.stepper.loops.follower._bound[False] is bound
    assert dismissed == []
    monkeypatch.undo()
    march.close()


def test_what_is_shared_once_is_done_by_the_caller_until_it_takes_long(monkeypatch):
    """What is seen of particles in a map, on a busy machine: waiting for a thread would take longer."""
    march, alone = (cloud(*WAYS["leaving a map"], threads) for threads in (3, 1))
    helpers, work = march.stepper.loops._helpers, []
    helpers._whole = 0.0  # as after a short one
    helpers.each(lambda start, stop: work.append((start, stop)), [(0, 8), (8, 16)])
    assert work == [(0, 16)]
    helpers._whole = 1.0
    helpers.each(lambda start, stop: work.append((start, stop)), [(0, 8), (8, 16)])
    assert sorted(work[1:]) == [(0, 8), (8, 16)]
    monkeypatch.setattr("orbits.marching.stepping.pool.WORTH_WAITING", -1.0)
    for one in (march, alone):
        one.advance(20)
    assert all(np.array_equal(*both) for both in zip(march.state(), alone.state(), strict=True))
    march.close()


def test_the_way_of_following_is_chosen_once():
    kinds = {way: type(cloud(*WAYS[way], 1, particles=8).stepper.loops.follower) for way in WAYS}
    assert kinds["in lanes"] is kinds["one after another"] is Follower
    assert len(set(kinds.values())) == 3


@pytest.mark.nightly
@pytest.mark.parametrize("method", [orbits.WisdomHolman(), orbits.WisdomHolman(kernel="standard", corrector=0)])
def test_particles_have_the_same_bits_eight_or_twice_eight_at_a_time(monkeypatch, method):
    # Eight where registers of the processor have four numbers, for kicks of two parts; the samples lie within steps.
    system, found = belt(20), []
    for features in (frozenset(), frozenset({"avx512f"})):
        monkeypatch.setattr(jacobi_form, "cpu_features", lambda features=features: features)
        run = orbits.propagate(system, method, dt="3 d", duration="600 d", samples=41, check_step=False)
        found.append((run.q.value, run.v.value))
    assert np.array_equal(found[0], found[1])
