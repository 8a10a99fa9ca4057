"""Lazily read samples are indexed like NumPy arrays, and read only what is requested."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from orbits.archive import Archive
from orbits.archive.storage import Storage
from orbits.errors import ArchiveError, StorageError

from ..coverings import each
from . import runs

SAMPLES, BODIES = 11, 7


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Archive:
    return Archive.open(runs.finished(tmp_path_factory.mktemp("samples") / "run.h5", SAMPLES, 4, BODIES))


Q, V = runs.samples(SAMPLES, BODIES)
SHAPE = (SAMPLES, BODIES, 3)

KEYS = [
    0, -1, np.int64(3), slice(None), slice(2, 5), slice(None, None, -1), slice(9, 2, -3), slice(3, 3), slice(1, 99, 4),
    ..., (..., 0), (slice(None), 4), (slice(None), slice(2, 4)), (slice(None), slice(None, None, 3)),
    (slice(None), slice(5, 0, -2)), (2, 3, 1), (-1, ...), (3, slice(None), 2), [0, 5, 5, 2], ([1, 3], 2),
    ([1, 3], [2, 6]), (slice(2, 9, 2), [6, 0, 0]), (slice(None), np.arange(BODIES) % 2 == 0), np.arange(SAMPLES) > 6,
    (slice(8, 1, -2), slice(6, 1, -2), 0), ([], 2), (slice(None), []), np.zeros(SAMPLES, dtype=bool), None,
    (slice(None), None), Q > 0, np.array([[0, 1], [2, 3]]),
]  # fmt: skip


@each("key", KEYS)
def test_a_key_reads_what_numpy_would_give(archive, key):
    for lazy, whole in ((archive.q, Q), (archive.v, V)):
        got = lazy[key]
        assert np.shape(got) == np.shape(whole[key])
        assert np.array_equal(got, whole[key])


@given(key=hnp.basic_indices(SHAPE, allow_newaxis=True) | st.tuples(hnp.integer_array_indices((SAMPLES, BODIES))))
def test_any_key_reads_what_numpy_would_give(archive, key):
    key = key[0] if isinstance(key, tuple) and len(key) == 1 else key
    assert np.array_equal(archive.q[key], Q[key])
    assert np.shape(archive.q[key]) == np.shape(Q[key])


@pytest.mark.parametrize("key", [SAMPLES, -SAMPLES - 1, (0, BODIES), (0, 0, 3), (0, 0, 0, 0), "q", 1.5])
def test_a_key_that_numpy_refuses_is_refused(archive, key):
    with pytest.raises(IndexError):
        archive.q[key]


def test_samples_are_an_array_to_numpy(archive):
    assert (archive.q.shape, archive.q.ndim, archive.q.size, len(archive.q)) == (SHAPE, 3, Q.size, SAMPLES)
    assert np.asarray(archive.q).dtype == np.float64
    assert np.array_equal(np.asarray(archive.q), Q)
    assert np.asarray(archive.q, dtype=np.float32).dtype == np.float32
    assert np.array_equal(np.stack(list(archive.v)), V)
    with pytest.raises(ValueError, match="copy=False"):
        archive.q.__array__(copy=False)


def test_mapped_samples_are_the_same_and_cannot_be_written(archive):
    mapped = archive.q.mapped()
    assert np.array_equal(mapped, Q)
    assert not mapped.flags.writeable
    assert mapped.flags.aligned


def test_only_what_is_asked_for_is_read(archive, monkeypatch):
    archive.verify()  # what was checked is not read for that again
    read = []
    read_into = Storage.read_into

    def counted(self: Storage, buffer: memoryview, offset: int) -> None:
        read.append(len(buffer))
        read_into(self, buffer, offset)

    monkeypatch.setattr(Storage, "read_into", counted)
    for key, reads in (
        (4, [BODIES * 24]),
        (slice(2, 6), [4 * BODIES * 24]),
        ((slice(None), 3), [24] * SAMPLES),
        ((slice(0, 3), slice(1, 3)), [48] * 3),
        ([0, 1, 2, 8], [3 * BODIES * 24, BODIES * 24]),
        ((-1, -1), [24]),
        (slice(0), []),
    ):
        read.clear()
        archive.q[key]
        assert read == reads


def test_a_file_that_shrinks_or_closes_under_a_reader_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    path = runs.finished(tmp_path / "run.h5", SAMPLES, 4, BODIES)
    archive = Archive.open(path)
    with open(path, "r+b") as file:
        file.truncate(3000)
    with pytest.raises(ArchiveError, match="is truncated"):
        archive.q[:]

    def broken(*arguments: object) -> int:
        raise OSError(5, "Input/output error")

    with monkeypatch.context() as patch:
        patch.setattr("os.preadv", broken)
        with pytest.raises(StorageError, match=r"could not be read: Input/output error"):
            archive.q[:]
    archive.close()
    archive.close()
    with pytest.raises(ArchiveError, match="was closed"):
        archive.q[0]
    assert archive.system == runs.system(BODIES)
