"""Archives damaged at random, in a separate process: no hang, crash, exhausted memory or wrong data."""

from __future__ import annotations

import contextlib
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest

import orbits
from orbits.archive import Archive, ArchiveWriter
from orbits.errors import ArchiveError, OrbitsError

from . import runs

MOST_MEMORY = 6 * 2**30  # address space, most of it libraries'
SECONDS_EACH = 0.5  # a file takes 10 ms


@pytest.mark.parametrize(
    ("count", "seed"),
    [pytest.param(30, 1, marks=pytest.mark.nightly), pytest.param(6000, None, marks=pytest.mark.slow)],
)
def test_no_damage_hangs_crashes_or_makes_an_archive_lie(count: int, seed: int | None) -> None:
    seed = int(np.random.default_rng(seed).integers(2**31))
    done = subprocess.run(
        [sys.executable, "-X", "faulthandler", "-m", "tests.archive.test_any_damage", str(count), str(seed)],
        capture_output=True, text=True, timeout=60 + SECONDS_EACH * count, check=False,
        cwd=Path(__file__).resolve().parents[2],
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-3000:]
    refused, opened = map(int, done.stdout.split())
    assert refused + opened == count
    assert min(refused, opened) > count / 20  # both happen: damage is found, and free space is no damage


def damaged(whole: bytes, rng: np.random.Generator) -> bytes:
    """One of: some bytes, one bit, a stretch of noise, of zeros, of other bytes; cut, moved apart."""
    data = bytearray(whole)
    written = np.flatnonzero(np.frombuffer(whole, dtype=np.uint8))
    a, b = (int(place) for place in rng.integers(len(data), size=2))
    match int(rng.integers(7)):
        case 0:
            for place in rng.choice(written, size=rng.integers(1, 6)):
                data[place] = rng.integers(256)
        case 1:
            data[rng.choice(written)] ^= 1 << rng.integers(8)
        case 2:
            data[a : a + 40] = rng.bytes(len(data[a : a + 40]))
        case 3:
            data[a : a + 4000] = bytes(len(data[a : a + 4000]))
        case 4:
            data[a : a + 900] = data[b : b + 900]
        case 5:
            del data[a:]
        case 6:
            data[a:a] = rng.bytes(int(rng.integers(1, 50)))
    return bytes(data)


def check(path: Path) -> bool:
    """Return whether an archive opens; raise AssertionError if it then has data that were never written."""
    q, v = runs.samples(6)
    for use in (orbits.Trajectory.open, orbits.resume):
        with contextlib.suppress(OrbitsError):
            use(path)
    with contextlib.suppress(ArchiveError), Archive.open(path, salvage=True) as archive:
        n = archive.committed
        assert archive.system == runs.system()
        assert np.array_equal(archive.q, q[:n])
        assert np.array_equal(archive.v, v[:n])
    try:
        with Archive.open(path) as archive:
            archive.verify()
            n = archive.committed
            assert archive.system == runs.system()
            assert n in (2, 4, 6)
            assert np.array_equal(archive.q, q[:n])
            assert np.array_equal(archive.v, v[:n])
            assert runs.same_checkpoint(archive.checkpoint(), runs.checkpoint(n // 2))
        ArchiveWriter.reopen(path).close()
    except ArchiveError:
        return False
    return True


def main(count: int, seed: int) -> None:
    resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY, MOST_MEMORY))
    rng = np.random.default_rng(seed)
    with tempfile.TemporaryDirectory() as folder:
        whole = runs.finished(Path(folder) / "run.h5").read_bytes()
        path = Path(folder) / "damaged.h5"
        opened = 0
        for number in range(count):
            path.write_bytes(damaged(whole, rng))
            try:
                opened += check(path)
            except BaseException as error:
                raise AssertionError(f"file {number} of seed {seed}") from error
    print(count - opened, opened)


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
