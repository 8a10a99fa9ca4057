"""Runs into archives: the same numbers as in memory, interrupted anywhere, and resumed bit for bit."""

import os
import signal
import subprocess
import sys
import time
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from astropy import units as u

import orbits
from orbits.archive import Archive
from orbits.errors import ArchiveError, ConvergenceError, InputError, Interrupted
from orbits.propagation.resuming import sample_store
from orbits.propagation.resuming.from_checkpoint import taken_up
from tests.stopping import after_samples

from ..coverings import at, first

METHODS = [orbits.StormerVerlet(), orbits.Gauss(stages=8), orbits.methods.RungeKutta4()]
IDS = [m.label for m in METHODS]


def belt():
    return orbits.System.solar_system(epoch="2022-08-09").add_particles(orbits.asteroids(12))


ARGUMENTS = {"dt": 5 * u.day, "duration": 400 * u.day, "samples": 23}


def same(a, b):
    return np.array_equal(a.q, b.q) and np.array_equal(a.v, b.v) and np.array_equal(a.times, b.times)


@pytest.mark.parametrize("method", first(2, METHODS), ids=IDS)
def test_an_archive_holds_the_bits_of_the_run_in_memory(tmp_path, method):
    memory = orbits.propagate(belt(), method, **ARGUMENTS)
    stored = orbits.propagate(belt(), method, **ARGUMENTS, archive=tmp_path / "run.h5")
    opened = orbits.Trajectory.open(tmp_path / "run.h5")
    for other in (stored, opened):
        assert same(memory, other)
        assert other.complete
        assert other.system == memory.system
        assert other.integrator == method
        assert np.array_equal(memory.energy(), other.energy())


@pytest.mark.parametrize("method", first(2, METHODS), ids=IDS)
@pytest.mark.parametrize("stop_after", at((1,), [1, 7, 22]))
def test_a_run_stopped_between_samples_resumes_to_the_same_bits(tmp_path, monkeypatch, method, stop_after):
    """SIGTERM arrives during the run; the resumed run equals one that never stopped."""
    straight = orbits.propagate(belt(), method, **ARGUMENTS)
    after_samples(monkeypatch, stop_after, lambda: os.kill(os.getpid(), signal.SIGTERM))
    with pytest.raises(Interrupted, match="orbits resume") as caught:
        orbits.propagate(belt(), method, **ARGUMENTS, archive=tmp_path / "run.h5")
    monkeypatch.undo()
    assert len(caught.value.trajectory) == stop_after
    assert not caught.value.trajectory.complete
    assert same(orbits.resume(tmp_path / "run.h5"), straight)


def test_without_an_archive_an_interrupted_run_hands_over_what_it_has(monkeypatch):
    after_samples(monkeypatch, 1, lambda: os.kill(os.getpid(), signal.SIGINT))
    with pytest.raises(Interrupted, match=r"Ctrl-C.*1 of 23 samples.*archive=") as caught:
        orbits.propagate(belt(), METHODS[0], **ARGUMENTS)
    assert len(caught.value.trajectory) == 1
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


PROGRAM = """
import sys, orbits
from astropy import units as u
from orbits.propagation.resuming import sample_store
from orbits.propagation.resuming.from_checkpoint import taken_up
sample_store.COMMIT_SECONDS = 0.0  # commit after every block of steps
system = orbits.System.solar_system(epoch="2022-08-09").add_particles(orbits.asteroids(12))
print("started", flush=True)
orbits.propagate(system, orbits.Gauss(stages=8), dt=1 * u.day, duration=20000 * u.day, samples=1001,
                 archive=sys.argv[1], progress=False)
print("finished", flush=True)
"""


def readable(path):
    """Return whether the run has created its file, with the start in it, which takes an unknown time."""
    try:
        orbits.Trajectory.open(path).close()
    except ArchiveError:
        return False
    return True


@pytest.mark.parametrize("delay", at((1,), [0.0, 0.1]))
def test_a_killed_process_leaves_a_file_that_resumes_to_the_same_bits(tmp_path, delay):
    path = tmp_path / "run.h5"
    process = subprocess.Popen([sys.executable, "-c", PROGRAM, str(path)], stdout=subprocess.PIPE, text=True)
    process.stdout.readline()
    while not readable(path):
        assert process.poll() is None, "it ended before it wrote"
        time.sleep(0.01)
    time.sleep(delay)
    process.kill()
    process.communicate()
    stopped = orbits.Trajectory.open(path)
    done = len(stopped)
    assert 0 <= done < 1001
    stopped.close()
    # The first 40 samples further on are compared, not all 1001: a shorter run of the same problem gives them.
    system = orbits.System.solar_system(epoch="2022-08-09").add_particles(orbits.asteroids(12))
    count = done + 40
    straight = orbits.propagate(
        system, orbits.Gauss(stages=8), dt=1 * u.day, duration=20 * (count - 1) * u.day, samples=count
    )
    resumed = orbits.resume(path)
    assert resumed.complete
    assert np.array_equal(resumed.q[:count], straight.q)
    assert np.array_equal(resumed.v[:count], straight.v)


@pytest.mark.parametrize("until", [500 * u.day, 800 * u.day, "800 d"])
def test_a_finished_run_is_extended_bit_for_bit(tmp_path, until):
    path = tmp_path / "run.h5"
    orbits.propagate(belt(), METHODS[1], dt=5 * u.day, duration=400 * u.day, samples=9, archive=path)
    longer = orbits.resume(path, until=until)
    count = 9 + round((u.Quantity(until).value - 400) / 50)
    straight = orbits.propagate(belt(), METHODS[1], dt=5 * u.day, duration=until, samples=count)
    assert same(longer, straight)


def test_a_backward_run_is_extended_backwards(tmp_path):
    path = tmp_path / "run.h5"
    orbits.propagate(belt(), METHODS[0], dt=5 * u.day, duration=-100 * u.day, samples=3, archive=path)
    longer = orbits.resume(path, until=-200 * u.day)
    assert same(longer, orbits.propagate(belt(), METHODS[0], dt=5 * u.day, duration=-200 * u.day, samples=5))
    with pytest.raises(InputError, match="before the end"):
        orbits.resume(path, until=-150 * u.day)


def test_a_run_with_one_sample_is_extended_in_its_own_direction(tmp_path):
    path = tmp_path / "run.h5"
    orbits.propagate(belt(), METHODS[0], dt=5 * u.day, duration=-10 * u.day, samples=[-10.0], archive=path)
    assert orbits.resume(path, until=-20 * u.day).times.tolist() == [-10.0, -20.0]


@pytest.mark.parametrize("until", [1e14, np.inf, np.nan, [500.0, 600.0], "later", 5 * u.km])
def test_an_until_that_cannot_be_is_refused_in_words(tmp_path, until):
    path = tmp_path / "run.h5"
    orbits.propagate(belt(), METHODS[0], **ARGUMENTS, archive=path)
    with pytest.raises(InputError, match="until"):
        orbits.resume(path, until=until)


def test_resuming_a_finished_run_changes_nothing(tmp_path):
    path = tmp_path / "run.h5"
    first = orbits.propagate(belt(), METHODS[0], **ARGUMENTS, archive=path)
    before = path.read_bytes()
    assert same(orbits.resume(path), first)
    assert path.read_bytes() == before


def test_an_existing_file_is_kept_unless_overwritten(tmp_path):
    path = tmp_path / "run.h5"
    orbits.propagate(belt(), METHODS[0], **ARGUMENTS, archive=path)
    with pytest.raises(ArchiveError, match="overwrite"):
        orbits.propagate(belt(), METHODS[1], **ARGUMENTS, archive=path)
    assert orbits.Trajectory.open(path).integrator == METHODS[0]
    with pytest.raises(InputError, match="overwrite is 'no'; expected True or False"):
        orbits.propagate(belt(), METHODS[1], **ARGUMENTS, archive=path, overwrite="no")
    orbits.propagate(belt(), METHODS[1], **ARGUMENTS, archive=path, overwrite=True)
    assert orbits.Trajectory.open(path).integrator == METHODS[1]


def test_other_kernels_or_another_processor_are_not_resumed_silently(tmp_path, monkeypatch):
    path = tmp_path / "run.h5"
    orbits.propagate(belt(), METHODS[0], **ARGUMENTS, archive=path)
    from orbits.propagation import marchers

    monkeypatch.setattr(marchers, "cpu_features", lambda: frozenset({"abacus"}))
    with pytest.raises(ArchiveError, match=r"cpu features.*same_bits=False"):
        orbits.resume(path, until=500 * u.day)
    longer = orbits.resume(path, until=500 * u.day, same_bits=False)
    assert longer.times[-1] == 500


def test_a_failing_run_leaves_its_samples_readable(tmp_path):
    system = orbits.System(
        ["sun", "comet"], [1.0, 1e-9], [[0, 0, 0], [10, 0.02, 0]], [[0, 0, 0], [-1.0, 0, 0]], units=orbits.DIMENSIONLESS
    )
    path = tmp_path / "run.h5"
    with pytest.raises(ConvergenceError):
        orbits.propagate(system, orbits.Gauss(stages=8), dt=0.7, duration=20.0, samples=41, archive=path)
    kept = orbits.Trajectory.open(path)
    assert len(kept) > 10
    assert not kept.complete
    with pytest.raises(ConvergenceError):
        orbits.resume(path)
    assert len(orbits.Trajectory.open(path)) == len(kept)


def test_commits_come_early_and_then_ever_more_rarely(monkeypatch):
    clock, commits = [0.0], []
    monkeypatch.setattr(sample_store, "time", SimpleNamespace(perf_counter=lambda: clock[0]))
    writer = SimpleNamespace(commit=lambda q, v, checkpoint: commits.append(clock[0]))
    marcher = SimpleNamespace(checkpoint=dict)
    events = SimpleNamespace(complete=lambda: None, checkpoint=dict)
    store = sample_store.SampleStore(1, 10, writer, sample_store.no_accounts(10, 0), events)
    for tick in range(1, 60 * 60 * 20):
        clock[0] = tick / 20
        if store.full:
            store.commit(marcher)
    commits = np.array(commits)
    pauses = np.diff(commits, prepend=0.0)
    assert commits[0] <= 0.3
    # A quarter of what was computed, to the 50 ms between two looks at the clock, and no more than ten seconds.
    assert (pauses <= np.maximum(0.25, 0.25 * (commits - pauses)) + 0.051).all()
    assert pauses.max() <= 10.051
    assert pauses[-1] >= 10.0
    # Twenty commits in the first forty seconds cost less than a second on a slow disk.
    assert (commits < 40).sum() <= 25


def test_a_trajectory_in_an_archive_is_read_lazily(tmp_path):
    path = tmp_path / "run.h5"
    run = orbits.propagate(belt(), METHODS[0], **ARGUMENTS, archive=path)
    assert not isinstance(run._q, np.ndarray)
    assert run["Ceres"].q.shape == (23, 3)
    assert str(path) in repr(run)
    assert Path(run.path) == path


AWAY = {
    "on an excursion": (orbits.WisdomHolman(encounters="follow"), {"dt": 0.1, "duration": 60.0, "samples": 1157}),
    "within a step": (orbits.Gauss(stages=4), {"dt": 0.25, "duration": 12.0, "samples": 1201}),
    "at a step": (orbits.Gauss(stages=4), {"dt": 0.25, "duration": -12.0, "samples": 1201}),
}


def faster(t, system):
    return system.replaced(v=system.v * 1.001)


@pytest.mark.parametrize("way", AWAY)
def test_a_checkpoint_with_another_number_of_steps_is_refused(tmp_path, way):
    # Where bodies are away from the steps of the clock, its time says nothing about their number; a march would go on
    # from there by steps of another length.
    method, options = AWAY[way]
    bodies = {"star": {"gm": 1.0}, "a": {"a": 1.0, "e": 0.1, "gm": 1e-3}, "p": {"a": 1.2, "e": 0.2, "M": 2.0}}
    bodies["b"] = {"a": 1.35, "e": 0.18, "M": 0.5, "gm": 1e-3}
    system = orbits.System.from_elements(bodies, units=orbits.DIMENSIONLESS)
    acting = orbits.events.Apocentre("a", then=faster) if way == "within a step" else ()
    path, last = tmp_path / "run.h5", {"on an excursion": 20.0, "within a step": 0.0, "at a step": 2.0}[way]

    def ends(t, state):
        return abs(t.value) > last

    if acting:
        events = orbits.propagate(system, method, events=acting, check_step=False, **options).events
        last = float(events.time.value[0])
    orbits.propagate(system, method, archive=path, events=acting, callback=ends, check_step=False, **options).close()
    with Archive.open(path) as archive:
        checkpoint = archive.checkpoint()
        for more in (0, 3, 10**6):
            changed = {name: array.copy() for name, array in checkpoint.items()}
            changed["counts"][0] += more
            message = f"is damaged: its checkpoint is at step {changed['counts'][0]}, t ="
            with pytest.raises(ArchiveError, match=message) if more else nullcontext():
                taken_up(archive, archive.grid, (changed, archive.committed), acting, exactly=True, threads=1)
