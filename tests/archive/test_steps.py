"""The steps that a run keeps for dense output are whole wherever it is stopped, and damage to them is found."""

from __future__ import annotations

import errno
import os
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from orbits.archive import Archive, ArchiveWriter, steps
from orbits.archive.storage import Storage
from orbits.errors import ArchiveError, StorageError

from ..coverings import first
from . import recording, runs

# Samples and steps of each commit. Chunks have five steps: they are filled within a commit and across commits.
COMMITS = [(0, 3), (2, 0), (0, 9), (1, 1), (1, 12), (2, 2)]


@pytest.fixture(autouse=True)
def small_chunks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(steps, "CHUNK_BYTES", 5 * 48 * 3)
    monkeypatch.setattr(os, "fsync", lambda descriptor: None)


def states(count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times in ascending order, q and v of so many steps: every value is another."""
    q, v = runs.samples(count, seed=9)
    return np.column_stack([0.01 * np.arange(count), 1e-19 * np.arange(count)]), q, v


def commit(writer: ArchiveWriter, number: int) -> None:
    """Write the commit of that number, from 0 on."""
    samples, count = COMMITS[number]
    first, begun = (sum(each[k] for each in COMMITS[:number]) for k in (0, 1))
    q, v = runs.samples(6)
    some = slice(first, first + samples)
    # In two pieces, as a run may give them.
    half = begun + count // 2
    pieces = [tuple(x[begun:half] for x in states(27)), tuple(x[half : begun + count] for x in states(27))]
    writer.commit(q[some], v[some], runs.checkpoint(number + 1), pieces)


def made(path: Path, room: int = 27) -> Path:
    with runs.create(path, 6, steps=room) as writer:
        for number in range(len(COMMITS)):
            commit(writer, number)
    return path


def assert_kept(path: Path, commits: int) -> None:
    count = sum(each[1] for each in COMMITS[:commits])
    with Archive.open(path) as archive:
        assert archive.committed == sum(each[0] for each in COMMITS[:commits])
        assert runs.same_checkpoint(archive.checkpoint(), runs.checkpoint(commits))
        archive.verify()
        times, q, v = states(27)
        assert len(archive.steps) == count
        assert np.array_equal(archive.steps.times, times[:count])
        found = archive.steps.states(np.arange(count))
        assert np.array_equal(found[0], q[:count])
        assert np.array_equal(found[1], v[:count])


def test_steps_are_read_back_as_they_were_written_in_any_pieces(tmp_path):
    assert_kept(made(tmp_path / "run.h5"), len(COMMITS))


def all_of(begun: list[int]) -> range:
    return range(begun[0], begun[-1] + 1)


def about_the_ends(begun: list[int]) -> list[int]:
    """Before the last write of each commit, which is its row, and after it."""
    return sorted({k for a, b in pairwise(begun) for k in (a, b - 1)} | {begun[-1]})


@pytest.mark.parametrize("stops", first(1, [about_the_ends, all_of]))
def test_every_prefix_of_the_writes_has_the_steps_of_its_last_commit_and_goes_on(stops, tmp_path, monkeypatch):
    log = recording.Recording()
    write, resize = Storage._write_some, Storage.resize

    def logged(self, offset, data):
        log.writes.append((offset, bytes(data)))
        return write(self, offset, data)

    def resized(self, size):
        log.writes.append((size, None))
        resize(self, size)

    begun = []
    with monkeypatch.context() as patch:
        patch.setattr(Storage, "_write_some", logged)
        patch.setattr(Storage, "resize", resized)
        with runs.create(tmp_path / "run.h5", 6, steps=27) as writer:
            for number in range(len(COMMITS)):
                begun.append(len(log.writes))
                commit(writer, number)
    begun.append(len(log.writes))
    path = tmp_path / "stopped.h5"
    for done in stops(begun):
        path.write_bytes(log.image(range(done)))
        commits = sum(done >= end for end in begun[1:])
        assert_kept(path, commits)
        with ArchiveWriter.reopen(path) as writer:
            for number in range(commits, len(COMMITS)):
                commit(writer, number)
        assert_kept(path, len(COMMITS))


@pytest.mark.parametrize("room", [1, 3, 4, 26])
def test_a_file_without_room_grows_and_those_that_have_it_open_read_what_they_had(room, tmp_path):
    path = tmp_path / "run.h5"
    with runs.create(path, 6, steps=room) as writer:
        commit(writer, 0)
        before = Archive.open(path)
        for number in range(1, len(COMMITS)):
            commit(writer, number)
            assert_kept(path, number + 1)
        with pytest.raises(ArchiveError, match="being written by another run"):
            Archive.claim(path)
    assert np.array_equal(before.steps.states(np.arange(3))[0], states(3)[1])
    before.close()
    assert [each.name for each in tmp_path.iterdir()] == ["run.h5"]


def test_a_file_that_has_a_second_name_since_its_making_was_killed_can_grow(tmp_path):
    path = tmp_path / "run.h5"
    with runs.create(path, 6, steps=4) as writer:
        commit(writer, 0)
    os.link(path, tmp_path / ".run.h5.partial")
    with ArchiveWriter.reopen(path) as writer:
        for number in range(1, len(COMMITS)):
            commit(writer, number)
    assert_kept(path, len(COMMITS))
    assert [each.name for each in tmp_path.iterdir()] == ["run.h5"]


def test_a_file_that_cannot_grow_keeps_what_it_has(tmp_path, monkeypatch):
    path = tmp_path / "run.h5"
    with runs.create(path, 6, steps=4) as writer:
        commit(writer, 0)
        commit(writer, 1)

        def full(self):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

        with monkeypatch.context() as patch:
            patch.setattr(Storage, "reserve", full)
            with pytest.raises(StorageError, match=r"run\.h5 needs"):
                commit(writer, 2)
        assert writer.to_archive().committed == 2
    assert_kept(path, 2)
    with ArchiveWriter.reopen(path) as writer:
        for number in range(2, len(COMMITS)):
            commit(writer, number)
    assert_kept(path, len(COMMITS))


def test_each_flipped_bit_of_a_step_is_found_when_it_is_read(tmp_path):
    path = made(tmp_path / "run.h5")
    whole = path.read_bytes()
    with Archive.open(path) as archive:
        places = archive.layout.steps
    for place, row in ((places.t, 16), (places.q, 72), (places.v, 72)):
        for step in (0, 4, 5, 13, 26):
            data = bytearray(whole)
            data[place.offset + step * row + 3] ^= 1
            path.write_bytes(data)
            with Archive.open(path) as archive, pytest.raises(ArchiveError, match=r"steps .* do not hold"):
                archive.steps.times, archive.steps.states(np.array([step]))
            with pytest.raises(ArchiveError, match=r"steps .* do not hold"):
                Archive.claim(path)
    data = bytearray(whole)
    data[places.chunks.offset] ^= 1
    path.write_bytes(data)
    with pytest.raises(ArchiveError, match="table of the chunks of steps"):
        Archive.open(path)


def test_steps_given_to_a_file_without_any_are_refused(tmp_path):
    with runs.create(tmp_path / "run.h5", 6) as writer, pytest.raises(ArchiveError, match="keeps samples only"):
        commit(writer, 0)
