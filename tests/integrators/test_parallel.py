"""Thousands of bodies: force evaluations shared among threads give the bits of the compiled loop."""

import threading
from concurrent.futures import ThreadPoolExecutor
from threading import Event

import numpy as np
import pytest

import orbits
from orbits.integrators.composition import Composition
from orbits.integrators.gauss import Gauss
from orbits.integrators.stormer_verlet import StormerVerlet
from orbits.kernels.barrier import claim, meet
from orbits.kernels.compile import kernel
from orbits.lagrangians.newtonian import newtonian, parameters
from orbits.marching.legs.leg import Leg
from orbits.marching.stepping import parallel

from ..coverings import cover

BODIES = 150


def cluster(particles=0, seed=2):
    """Bodies of one size, and massless particles among them."""
    rng = np.random.default_rng(seed)
    count = BODIES + particles
    gm = np.where(np.arange(count) < BODIES, 1.0 / BODIES, 0.0)
    return gm, rng.normal(size=(count, 3)), 0.3 * rng.normal(size=(count, 3))


def march(gm, q, v, threads, steps=40, method=None):
    massive = gm > 0
    strength = parameters(gm[massive], 0.01)
    run = Leg.of(newtonian, method or StormerVerlet(), strength, massive, q, v, 0.01, threads=threads)
    run.advance(steps - 7)
    run.advance(7)
    checkpoint = run.checkpoint()
    run.state_after(0.003)  # a partial step elsewhere must not disturb the march
    run.advance(1)
    run.close()
    return checkpoint, run.state()


@cover(
    ("method", "particles", "threads"),
    [StormerVerlet(), Composition(order=4, scheme="blanes-moan")],
    [0, 20],
    [2, 3, 1, 5],
    strength=1,
)
def test_bits_do_not_depend_on_the_number_of_threads_nor_on_being_shared(method, particles, threads, monkeypatch):
    problem = cluster(particles)
    alone, alone_later = march(*problem, threads=1, method=method)
    monkeypatch.setattr(parallel, "LEAST_BODIES", BODIES)
    assert parallel.Parallel.serves(method.second_order, newtonian.tag, BODIES)
    shared, shared_later = march(*problem, threads=threads, method=method)
    for name, array in alone.items():
        assert np.array_equal(shared[name], array), name
    assert np.array_equal(alone_later, shared_later)


def test_methods_of_other_steps_are_not_shared():
    tag = newtonian.tag
    assert parallel.Parallel.serves(StormerVerlet().second_order, tag, parallel.LEAST_BODIES)
    assert not parallel.Parallel.serves(StormerVerlet().second_order, tag, parallel.LEAST_BODIES - 1)
    assert not parallel.Parallel.serves(Gauss(stages=2).second_order, tag, parallel.LEAST_BODIES)


def test_an_error_in_a_thread_is_raised(monkeypatch):
    monkeypatch.setattr(parallel, "LEAST_BODIES", BODIES)

    def fail(*arguments):
        raise MemoryError

    monkeypatch.setattr(parallel, "march_together", fail)
    with pytest.raises(MemoryError):
        march(*cluster(), threads=2)


@kernel
def _meet_often(counters, team, meetings):
    for meeting in range(1, meetings + 1):
        meet(counters, team, meeting)


@pytest.mark.parametrize("absent", [0, 1, 2])
def test_who_waits_for_one_that_failed_goes_home(absent):
    def go(counters, team, member):
        if member == absent:
            raise MemoryError
        _meet_often(counters, team, 1000)

    with ThreadPoolExecutor(3) as pool, pytest.raises(MemoryError):
        parallel.Threads(3, pool).run(go)


def test_a_team_that_was_interrupted_can_be_used_again(monkeypatch):
    """The threads finish before the interruption is raised, and leave nothing behind."""
    inside = Event()

    def go(counters, team, member):
        inside.set()
        _meet_often(counters, team + 1, 1)  # one more than there are: only giving up ends it

    def interrupted(futures):
        inside.wait()
        monkeypatch.undo()
        raise KeyboardInterrupt

    monkeypatch.setattr(parallel, "wait", interrupted)
    with ThreadPoolExecutor(3) as pool:
        team = parallel.Threads(3, pool)
        with pytest.raises(KeyboardInterrupt):
            team.run(go)
        team.run(lambda counters, team, member: _meet_often(counters, team, 100))


def test_a_team_takes_each_piece_once_in_every_round():
    taken = [[] for _ in range(7)]

    def go(counters, team, member):
        for round_, pieces in enumerate(taken):
            while (piece := claim(counters, team, round_, 50)) < 50:
                pieces.append(piece)
            meet(counters, team, round_ + 1)

    with ThreadPoolExecutor(3) as pool:
        parallel.Threads(3, pool).run(go)
    assert [sorted(pieces) for pieces in taken] == [list(range(50))] * 7


def test_no_close_approach_in_a_cluster_is_passed_over():
    gm, q, v = cluster()
    run = Leg.of(newtonian, StormerVerlet(), parameters(gm, 0.01), gm > 0, q, v, 0.01)
    d2 = [((q[:, None] - q) ** 2).sum(axis=2)]
    for _ in range(60):
        run.advance(1)
        now = run.state()[0]
        d2.append(((now[:, None] - now) ** 2).sum(axis=2))
    d2 = np.array(d2) + np.diag(np.full(BODIES, np.inf))
    passed = np.where((d2[1:-1] <= d2[:-2]) & (d2[1:-1] <= d2[2:]), d2[1:-1], np.inf)
    least = np.minimum(d2[0].min(axis=1), passed.min(axis=(0, 1)))
    apart = Leg.of(newtonian, StormerVerlet(), parameters(gm, 0.01), gm > 0, q, v, 0.01)
    apart.advance(60)
    recorded = apart.checkpoint()["approaches"][0, 1, :BODIES]
    # Between two steps bodies come closer than at either: never farther, and a little only, but for a few.
    assert np.all(recorded <= least * (1 + 1e-12))
    assert np.median(least / recorded) < 1.01


def test_more_threads_than_the_system_grants_are_an_error_in_words(monkeypatch):
    start, granted = threading.Thread.start, []

    def limited(thread):
        if len(granted) == 3:
            raise RuntimeError("can't start new thread")
        granted.append(thread)
        start(thread)

    rng = np.random.default_rng(1)
    n = 400  # massless, 50 shares
    q, v = rng.normal(size=(2, n + 1, 3))
    system = orbits.System([str(k) for k in range(n + 1)], [1.0] + [0.0] * n, q, v, units=orbits.DIMENSIONLESS)
    # What tells that kernels are compiled is a thread as well.
    orbits.propagate(system, orbits.StormerVerlet(), dt=1e-3, duration=0.01, threads=1, check_step=False)
    monkeypatch.setattr(threading.Thread, "start", limited)
    with pytest.raises(orbits.errors.InputError, match="threads = 20: the system grants this process no more than 4"):
        orbits.propagate(system, orbits.StormerVerlet(), dt=1e-3, duration=2.0, threads=20, check_step=False)
