"""Damaged bytes are found by whoever reads or resumes a run, wherever they lie: no wrong number is handed out."""

from __future__ import annotations

import shutil
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

import orbits
from orbits.archive.storage import Storage
from orbits.errors import ArchiveError, OrbitsError

from ..coverings import every
from . import small
from .alarm import at_most

SECONDS = 20.0  # a file takes 30 ms


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Path:
    small.straight()
    return small.interrupted(tmp_path_factory.mktemp("damage") / "run.h5")


def damaged(whole: bytes, rng: np.random.Generator) -> bytes:
    """Change one byte of those that are not 0, or flip one bit anywhere."""
    data = bytearray(whole)
    if rng.random() < 0.8:
        place = int(rng.choice(np.flatnonzero(np.frombuffer(whole, dtype=np.uint8))))
        data[place] ^= int(rng.integers(1, 256))
    else:
        data[int(rng.integers(len(data)))] ^= 1 << int(rng.integers(8))
    return bytes(data)


def outcome(use, path: Path) -> str:
    """Return "right", "refused", or how it lies."""
    try:
        with at_most(SECONDS):
            run = use(path)
            right = small.is_part_of_the_run(run)
            run.closest_approaches()
            run.close()
    except OrbitsError as error:
        return "refused" if str(error) else "refused without a word"
    return "right" if right else "wrong numbers"


@pytest.mark.parametrize("count", [15, pytest.param(4000, marks=pytest.mark.faults)])
def test_no_damaged_byte_gives_a_wrong_number_by_trajectory_or_resume(count, original, tmp_path):
    whole = original.read_bytes()
    rng = np.random.default_rng(count)
    path = tmp_path / "run.h5"
    found: Counter[tuple[str, str]] = Counter()
    for _ in range(count):
        data = damaged(whole, rng)
        for name, use in (
            ("open", orbits.Trajectory.open),
            ("resume", lambda path: orbits.resume(path, progress=False, threads=1)),
        ):
            path.write_bytes(data)
            found[name, outcome(use, path)] += 1
    assert {kind for _, kind in found} == {"right", "refused"}, found
    # Both happen, for both: damage is found, and room that nothing was written to is no damage.
    assert min(found.values()) > count / 20, found


READERS = {
    "q": lambda run: run.q,
    "v": lambda run: run.v[0],
    "a sample": lambda run: run[2],
    "a body": lambda run: run["Jupiter"],
    "at": lambda run: run.at(12.25),
    "energy": lambda run: run.energy(),
    "elements": lambda run: run.elements(primary="Sun"),
    "table": lambda run: run.to_table(),
    "plot": lambda run: run.plot(),
    "copy": lambda run: orbits.Trajectory.open(run.path).q,
    "array": lambda run: np.asarray(run.archive.q),
    "blocks": lambda run: list(run._blocks()),
    "spk": lambda run: run.to_spk(Path(run.path).with_suffix(".bsp"), tolerance_km=1000),
}


@pytest.mark.parametrize("reader", every(6, READERS))
def test_every_way_of_reading_finds_a_flipped_bit_in_a_chunk_that_is_not_the_last(reader, original, tmp_path):
    data = bytearray(original.read_bytes())
    q = small.straight()[1]
    data[data.index(q[2].tobytes()) + 7] ^= 1
    path = tmp_path / "run.h5"
    path.write_bytes(data)
    run = orbits.Trajectory.open(path)
    with pytest.raises(ArchiveError, match=r"run\.h5 is damaged: samples 2 to 2 do not hold their checksum"):
        READERS[reader](run)
    # What lies in other chunks is handed out.
    assert np.array_equal(run[3].values.q, q[3])


def test_resume_refuses_to_go_on_from_damaged_samples_and_leaves_the_file(original, tmp_path):
    data = bytearray(original.read_bytes())
    data[data.index(small.straight()[2][1].tobytes())] ^= 1
    path = tmp_path / "run.h5"
    path.write_bytes(data)
    with pytest.raises(ArchiveError, match="samples 1 to 1 do not hold their checksum"):
        orbits.resume(path, progress=False)
    assert path.read_bytes() == data


def test_a_chunk_is_checked_when_something_of_it_is_first_read_and_then_no_more(original, tmp_path, monkeypatch):
    shutil.copy(original, tmp_path / "run.h5")
    run = orbits.Trajectory.open(tmp_path / "run.h5")
    checked = []
    checksum = Storage.checksum
    monkeypatch.setattr(Storage, "checksum", lambda self, *place: checked.append(place[0]) or checksum(self, *place))
    for _ in range(3):
        run[2], run[3]
    assert len(checked) == 4  # q and v of two chunks
    _ = run.q, run.v, run.q
    assert len(checked) == 2 * 7
