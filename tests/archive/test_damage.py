"""Damaged archives are refused with a message, and their intact part can still be read."""

from __future__ import annotations

import os
import shutil
import struct
from pathlib import Path

import h5py
import numpy as np
import pytest

import orbits
from orbits.archive import Archive, ArchiveWriter
from orbits.archive.commits import ROW, Commit
from orbits.errors import ArchiveError

from . import runs


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return runs.finished(tmp_path / "run.h5")


def places(path: Path) -> dict[str, tuple[int, int]]:
    """(offset, bytes) of the arrays that change while running, as HDF5 itself says."""
    with h5py.File(path) as file:
        names = ["q", "v", "chunks", "commits", *(f"checkpoints/{s}/{n}" for s in "01" for n in ("counts", "memory"))]
        return {name: (file[name].id.get_offset(), file[name].id.get_storage_size()) for name in names}


def flip(path: Path, offset: int) -> None:
    with open(path, "r+b") as file:
        file.seek(offset)
        byte = file.read(1)[0]
        file.seek(offset)
        file.write(bytes([byte ^ 0x10]))


def write_foreign(path: Path) -> None:
    with h5py.File(path, "w") as file:
        file["q"] = np.zeros((2, 3, 3))


def write_newer(path: Path) -> None:
    runs.finished(path)
    with h5py.File(path, "r+") as file:
        file.attrs["orbits"] = "2"


def write_repacked(path: Path) -> None:
    with h5py.File(runs.finished(path.with_suffix(".original"))) as old, h5py.File(path, "w") as new:
        for name in old:
            if name != "q":
                old.copy(name, new)
        new.create_dataset("q", data=old["q"], chunks=(2, 3, 3))
        for key, value in old.attrs.items():
            new.attrs[key] = value


FILES = {
    "missing": (lambda path: None, "does not exist"),
    "folder": (Path.mkdir, "is a folder"),
    "empty": (lambda path: path.write_bytes(b""), "is empty"),
    "short": (lambda path: path.write_bytes(b"\x89HD"), "is not an HDF5 file"),
    "text": (lambda path: path.write_text("t q v\n0 1 2\n"), "is not an HDF5 file"),
    "signature alone": (lambda path: path.write_bytes(b"\x89HDF\r\n\x1a\n"), "is (damaged|truncated)"),
    "pipe": (os.mkfifo, "is not a file"),
    "foreign": (write_foreign, "not an archive of orbits"),
    "newer": (write_newer, r"schema '2'; this version of orbits reads '1'.*pip install --upgrade"),
    "repacked": (write_repacked, "rewritten by another tool: /q"),
}


@pytest.mark.parametrize("kind", FILES)
def test_a_file_that_is_no_archive_is_refused_in_words(kind, tmp_path):
    make, words = FILES[kind]
    path = tmp_path / "run.h5"
    make(path)
    for use in (Archive.open, ArchiveWriter.reopen, orbits.Trajectory.open, Archive.claim):
        with pytest.raises(ArchiveError, match=words) as caught:
            use(path)
        assert str(path) in str(caught.value)
        assert caught.value.exit_code == 2


@pytest.mark.parametrize("wrong", ["a\0b", 3, None])
def test_what_is_no_path_is_refused_in_words(wrong):
    with pytest.raises(ArchiveError, match=r"is not a path|does not exist|cannot be opened"):
        Archive.open(wrong)


def test_every_truncation_is_refused(path):
    whole = path.read_bytes()
    for size in [*range(1, 2000, 97), *range(2000, len(whole), 997), len(whole) - 1]:
        path.write_bytes(whole[:size])
        with pytest.raises(ArchiveError, match=r"truncated|damaged|not an HDF5 file"):
            Archive.open(path)


@pytest.mark.parametrize("sample", [0, 3, 4, 5])
def test_a_flipped_bit_in_the_samples_is_found(path, sample):
    # Six samples in three commits: the last one is checked at opening, all by verify().
    flip(path, places(path)["q" if sample % 2 else "v"][0] + sample * 72 + 5)
    if sample < 4:
        for read in (Archive.verify, lambda archive: archive.q[sample], lambda archive: archive.v[:]):
            with Archive.open(path) as archive, pytest.raises(ArchiveError, match=r"damaged: samples .* Restore it"):
                read(archive)
    else:
        with pytest.raises(ArchiveError, match=r"damaged: samples 4 to 5 .*salvage=True"):
            Archive.open(path)


def test_a_flipped_bit_in_the_checkpoint_or_the_table_of_chunks_is_found(path):
    whole = path.read_bytes()
    # The start and three commits: the last one's checkpoint is in slot 1.
    for name, words in (("checkpoints/1/memory", "the checkpoint"), ("chunks", "the table of chunks")):
        path.write_bytes(whole)
        flip(path, places(path)[name][0])
        with pytest.raises(ArchiveError, match=f"damaged: {words} does not hold its checksum"):
            Archive.open(path)


def test_a_flipped_bit_in_the_last_commit_row_leaves_the_commit_before_it(path):
    flip(path, places(path)["commits"][0] + ROW.itemsize + 3)
    with Archive.open(path) as archive:
        assert archive.committed == 4
        assert not archive.complete
        assert runs.same_checkpoint(archive.checkpoint(), runs.checkpoint(2))
    q, v = runs.samples(6)
    with ArchiveWriter.reopen(path) as writer:
        writer.commit(q[4:], v[4:], runs.checkpoint(3))
    runs.assert_whole(path)


def test_a_flipped_bit_in_the_header_is_found(path):
    with h5py.File(path) as file:
        offsets = {name: file[name].id.get_offset() for name in ("times", "system/gm", "system/q", "system/v")}
    whole = path.read_bytes()
    for name, offset in offsets.items():
        path.write_bytes(whole)
        flip(path, offset)
        with pytest.raises(ArchiveError, match="damaged"):
            Archive.open(path)
        assert name
    for text in (b"body 1", b"stages", b"avx2 fma"):
        path.write_bytes(whole)
        at = whole.index(text)
        while at >= 0:
            flip(path, at)
            at = whole.find(text, at + 1)
        with pytest.raises(ArchiveError, match="damaged"):
            Archive.open(path)


@pytest.mark.parametrize("count", [80, pytest.param(400, marks=pytest.mark.nightly)])
def test_no_flipped_byte_makes_an_archive_lie(path, count):
    """Each opens with exactly the committed data, or is refused, however HDF5 reacts.

    A sample of the positions; all that are not zero, and 4000 others, were tried by hand when this was written.
    """
    whole = path.read_bytes()
    q, v = runs.samples(6)
    rng = np.random.default_rng(11)
    written = np.flatnonzero(np.frombuffer(whole, dtype=np.uint8))
    for position in rng.choice(written, size=count, replace=False):
        damaged = bytearray(whole)
        damaged[position] ^= 0xFF
        path.write_bytes(damaged)
        try:
            with Archive.open(path) as archive:
                archive.verify()
                assert archive.system == runs.system()
                assert archive.committed in (4, 6)
                assert np.array_equal(archive.q, q[: archive.committed])
                assert np.array_equal(archive.v, v[: archive.committed])
                assert runs.same_checkpoint(archive.checkpoint(), runs.checkpoint(archive.committed // 2))
        except ArchiveError:
            pass


def test_a_commit_row_that_claims_more_than_there_is_room_for_is_refused(path):
    offset = places(path)["commits"][0]
    for claim in (Commit(5, 10**15, 3, 0, 0), Commit(5, 6, 10**15, 0, 0)):
        with open(path, "r+b") as file:
            file.seek(offset)
            file.write(claim.encoded())
        with pytest.raises(ArchiveError, match="damaged: commit 5 claims"):
            Archive.open(path)


def test_salvage_reads_what_is_whole_before_the_damage(path):
    q, v = runs.samples(6)
    flip(path, places(path)["v"][0] + 2 * 72)
    with Archive.open(path, salvage=True) as archive:
        assert (archive.committed, archive.complete) == (2, False)
        assert np.array_equal(archive.q, q[:2])
        assert np.array_equal(archive.v, v[:2])
        archive.verify()
        with pytest.raises(ArchiveError, match="cannot be resumed"):
            archive.checkpoint()


def test_salvage_needs_no_commit_row(path):
    offset, size = places(path)["commits"]
    with open(path, "r+b") as file:
        file.seek(offset)
        file.write(bytes(size))
    with pytest.raises(ArchiveError, match="holds no commit"):
        Archive.open(path)
    with Archive.open(path, salvage=True) as archive:
        assert archive.committed == 6
        assert np.array_equal(archive.q, runs.samples(6)[0])


def test_an_archive_with_a_persons_own_notes_in_it_is_still_one(path):
    with h5py.File(path, "r+") as file:
        file.attrs["note"] = "the good one"
        file["system"].attrs["seen by"] = "me"
        file.create_dataset("mine/figures", data=np.arange(1000))
    runs.assert_whole(path)


def test_a_copy_is_as_good_as_the_original(path, tmp_path):
    shutil.copy(path, tmp_path / "copy.h5")
    runs.assert_whole(tmp_path / "copy.h5")


def test_a_commit_row_is_what_the_documentation_says():
    assert ROW.itemsize == 4096
    row = Commit(3, 12, 2, 7, 8).encoded()
    assert struct.unpack("<QQQIII", row)[:-1] == (3, 12, 2, 7, 8)
