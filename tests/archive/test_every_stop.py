"""An archive is whole wherever a run is stopped: every prefix of its writes is played back.

The discipline was shown to matter by breaking it, and each break stays here as a test of the test: a commit row written
before what it stands for, one checkpoint slot instead of two, and no wait between contents and row all lose data.
Random kills prove little; these are all of them.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from itertools import combinations, islice
from pathlib import Path

import pytest

from orbits.archive import ArchiveWriter, commits
from orbits.archive.commits import Commit
from orbits.archive.storage import Storage

from ..coverings import first
from .recording import Recording, apply, promised, record, trouble
from .runs import assert_whole

# Samples a commit; 0 is a checkpoint alone, as a run makes one when samples are far apart.
CHUNKS = [2, 0, 3, 1]
MANY = len(CHUNKS) + 1
"""So many failures show that a broken discipline is seen at most commits."""


@pytest.fixture(autouse=True)
def no_device(monkeypatch: pytest.MonkeyPatch) -> None:
    """Do not wait for the disk of this machine: the replay itself decides which data have arrived, hundreds of
    times.
    """
    monkeypatch.setattr(os, "fsync", lambda descriptor: None)


@pytest.fixture
def recording(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Recording:
    return record(tmp_path / "run.h5", CHUNKS, monkeypatch)


def prefixes(path: Path, recording: Recording, *, torn: bool, rows: bool = False) -> Iterator[str]:
    """Stop after every write from the first on, and inside it if `torn`, in rows of commits after each of their bytes
    if `rows`; yield the failures.
    """
    before = b""
    for done, (offset, content) in enumerate(recording.writes):
        lengths = {len(content) // 2} - {0} if torn and content and done else []
        if rows and content and len(content) == commits.ROW_BYTES:
            lengths = range(1, len(content))
        for length in lengths:
            data = bytearray(before)
            apply(data, offset, content[:length])
            wrong = trouble(path, bytes(data), CHUNKS, promised(recording, done))
            if wrong:
                yield f"write {done}, {length} bytes: {wrong}"
        before = recording.image(iter([done]), before)
        wrong = trouble(path, before, CHUNKS, promised(recording, done + 1))
        if wrong:
            yield f"after write {done}: {wrong}"


def reorderings(path: Path, recording: Recording, exhaustive: tuple[int, ...] = ()) -> Iterator[str]:
    """Stop between two waits for the device: any of the writes since the last one may have arrived, and no others.

    All combinations after the waits that are `exhaustive`; none, one, and all but one after the others.
    """
    barriers = [end for end in recording.barriers if end >= recording.created]
    for index, (start, end) in enumerate(zip(barriers, [*barriers[1:], len(recording.writes)], strict=True)):
        group = range(start, end)
        sizes = range(len(group) + 1) if index in exhaustive else {0, 1, max(0, len(group) - 1)}
        before = recording.image(range(start))
        for size in sizes:
            for kept in combinations(group, size):
                wrong = trouble(path, recording.image(iter(kept), before), CHUNKS, promised(recording, start))
                if wrong:
                    yield f"after wait {index}, writes {kept}: {wrong}"


@pytest.mark.parametrize("rows", first(1, [False, True]))
def test_every_prefix_of_the_writes_opens_and_goes_on_or_had_promised_nothing(recording, tmp_path, rows):
    """Of whole writes; and, nightly, of writes that were torn in the middle, or rows after any of their bytes."""
    assert len(recording.acknowledged) == len(CHUNKS)
    assert list(prefixes(tmp_path / "stopped.h5", recording, torn=rows, rows=rows)) == []


@pytest.mark.nightly
def test_any_part_of_the_writes_between_two_waits_may_be_missing(recording, tmp_path):
    # Behind the fifth wait come the contents of the third commit, which overwrite the slot of the first, and its row.
    assert list(reorderings(tmp_path / "stopped.h5", recording, exhaustive=(4, 5))) == []


def test_the_whole_of_hdf5s_own_writing_is_over_before_the_first_commit(recording):
    sizes = [offset for offset, content in recording.writes[recording.created :] if content is None]
    assert recording.created > 0
    assert recording.barriers[0] <= recording.created
    assert not sizes


def test_a_row_written_before_its_contents_is_seen_by_the_replay(tmp_path, monkeypatch):
    write_contents = ArchiveWriter._write_contents

    def row_first(self, q, v, checkpoint):
        writes = []
        with monkeypatch.context() as patch:
            patch.setattr(self._storage, "write", lambda offset, data: writes.append((offset, bytes(data))))
            commit = write_contents(self, q, v, checkpoint)
        self._write_row(commit)
        for offset, data in writes:
            self._storage.write(offset, data)
        return commit

    with monkeypatch.context() as patch:
        patch.setattr(ArchiveWriter, "_write_contents", row_first)
        recording = record(tmp_path / "run.h5", CHUNKS, patch)
    assert len(list(islice(prefixes(tmp_path / "stopped.h5", recording, torn=False), MANY))) == MANY


def test_a_single_checkpoint_slot_is_seen_by_the_replay(tmp_path, monkeypatch):
    monkeypatch.setattr(Commit, "slot", 0)
    recording = record(tmp_path / "run.h5", CHUNKS, monkeypatch)
    assert len(list(islice(prefixes(tmp_path / "stopped.h5", recording, torn=False), MANY))) == MANY


def test_a_missing_wait_between_contents_and_row_is_seen_by_the_replay(tmp_path, monkeypatch):
    recording = record(tmp_path / "run.h5", CHUNKS, monkeypatch)
    # Of the two waits of each commit only the second one is left.
    recording.barriers = [recording.created, *recording.acknowledged]
    assert any(reorderings(tmp_path / "stopped.h5", recording))


def test_a_commit_waits_for_the_device_before_its_row_and_after_it(recording):
    for end in recording.acknowledged:
        assert {end - 1, end} <= set(recording.barriers)


def test_every_short_write_of_the_device_is_continued(tmp_path, monkeypatch):
    real_write = Storage._write_some
    with monkeypatch.context() as patch:
        patch.setattr(Storage, "_write_some", lambda self, offset, data: real_write(self, offset, data[:7]))
        recording = record(tmp_path / "short.h5", CHUNKS, patch)
    assert max(len(content) for _, content in recording.writes[recording.created :] if content) == 7
    assert_whole(tmp_path / "short.h5", sum(CHUNKS))
