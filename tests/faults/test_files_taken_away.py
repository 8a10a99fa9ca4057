"""A file that is deleted, moved or replaced under a run: an error at the next commit, with every sample in it."""

from __future__ import annotations

import os
import pickle
import shutil
from pathlib import Path

import numpy as np
import pytest

import orbits
from orbits.errors import StorageError
from orbits.propagation import loop
from orbits.propagation.resuming import sample_store
from tests.stopping import after_samples

from . import small

AT = 5


def deleted(path: Path) -> None:
    path.unlink()


def moved(path: Path) -> None:
    path.rename(path.with_name("moved.h5"))


def folder_moved(path: Path) -> None:
    path.parent.rename(path.parent.with_name("elsewhere"))


def replaced(path: Path) -> None:
    shutil.copy(path, path.with_name("copy"))
    os.replace(path.with_name("copy"), path)


def by_another_run(path: Path) -> None:
    path.unlink()
    small.propagate(path, samples=3).close()


WAYS = {way.__name__: way for way in (deleted, moved, folder_moved, replaced, by_another_run)}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    (tmp_path / "runs").mkdir()
    return tmp_path / "runs" / "run.h5"


def disturbed(way, path, use, at=AT):
    """Run with a commit for each sample, and take the file away when sample `at` is there."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sample_store, "COMMIT_SECONDS", 0.0)
        after_samples(patch, at, lambda: way(path))
        return use()


@pytest.mark.parametrize("way", WAYS)
def test_a_run_whose_file_is_taken_away_says_so_at_once_and_hands_its_samples_over(way, path):
    words = "run.h5 was deleted" if way in ("deleted", "replaced", "by_another_run") else "run.h5 was moved away"
    with pytest.raises(StorageError, match=words) as caught:
        disturbed(WAYS[way], path, lambda: small.propagate(path))
    assert caught.value.exit_code == 1
    run = caught.value.trajectory
    assert len(run) == AT
    assert run.path is None
    assert small.is_part_of_the_run(run)
    run.closest_approaches()
    again = pickle.loads(pickle.dumps(run))
    assert small.is_part_of_the_run(again)


def test_resume_does_so_too(path):
    small.interrupted(path)
    with pytest.raises(StorageError, match=r"run\.h5 was deleted") as caught:
        disturbed(deleted, path, lambda: orbits.resume(path, progress=False, threads=1), at=2)
    assert len(caught.value.trajectory) == 7 + 2
    assert small.is_part_of_the_run(caught.value.trajectory)


def test_a_file_that_was_moved_is_resumed_where_it_is(path):
    with pytest.raises(StorageError, match="moved away"):
        disturbed(moved, path, lambda: small.propagate(path))
    assert small.is_part_of_the_run(orbits.resume(path.with_name("moved.h5"), progress=False))


def test_propagate_returns_its_own_run_whatever_takes_its_name_before_it_returns(path, monkeypatch):
    result = loop._result

    def too_late(*arguments):
        by_another_run(path)
        return result(*arguments)

    monkeypatch.setattr(loop, "_result", lambda *a: (monkeypatch.undo(), too_late(*a))[1])
    run = small.propagate(path)
    assert run.complete
    assert len(run) == small.SAMPLES
    assert small.is_part_of_the_run(run)


def test_a_run_that_was_opened_answers_from_its_own_file_after_another_took_its_name(path):
    other = orbits.System(["a", "b"], [1, 1e-3], np.eye(2, 3), np.zeros((2, 3)), units=orbits.SOLAR)
    run = orbits.Trajectory.open(small.finished(path))
    expected = repr(run.closest_approaches())
    path.unlink()
    orbits.propagate(other, small.METHOD, dt=1, duration=2, archive=path, progress=False, check_step=False).close()
    assert small.is_part_of_the_run(run)
    assert repr(run.closest_approaches()) == expected


@pytest.mark.parametrize("error", [28, 5])
def test_a_device_that_fails_hands_over_what_was_committed(path, monkeypatch, error):
    from orbits.archive.storage import Storage

    real = Storage.sync
    count = []

    def sync(self):
        count.append(1)
        if len(count) > 12:
            raise OSError(error, os.strerror(error))
        real(self)

    monkeypatch.setattr(sample_store, "COMMIT_SECONDS", 0.0)
    monkeypatch.setattr(Storage, "sync", sync)
    with pytest.raises(StorageError, match="could not be written") as caught:
        small.propagate(path)
    run = caught.value.trajectory
    assert 0 < len(run) < small.SAMPLES
    assert small.is_part_of_the_run(run)
    monkeypatch.undo()
    run.close()
    assert small.is_part_of_the_run(orbits.resume(path, progress=False))
