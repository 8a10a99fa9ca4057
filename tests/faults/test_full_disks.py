"""Devices without room, in real processes: words, the right exit status, and nothing left behind."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from .processes import ROOT, ended, start, whole

CREATE = """
import resource
from tests.archive import runs
from orbits.errors import StorageError
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[2]), -1))
try:
    runs.create(Path(sys.argv[1]), 1000, bodies=100, overwrite=True)
except StorageError as error:
    print(error)
    sys.exit(7)
"""

WHOLE = 4_860_160  # bytes of this archive


@pytest.mark.parametrize(
    "limit",
    [2**20, *(pytest.param(int(n), marks=pytest.mark.faults) for n in (0, *np.geomspace(7, WHOLE - 1, 37)))],
)
def test_a_limit_on_the_size_of_files_ends_in_words_and_not_in_a_crash_at_exit(limit, tmp_path):
    (tmp_path / "run.h5").write_text("precious")
    status, out, err = ended(start(CREATE, tmp_path / "run.h5", limit))
    assert (status, err) == (7, "")
    assert "run.h5 needs 4.9 MB, but this process may write no file larger than" in out
    assert "raise the limit" in out
    assert [path.name for path in tmp_path.iterdir()] == ["run.h5"]
    assert (tmp_path / "run.h5").read_text() == "precious"


FULL = """
from tests.archive import runs
from orbits.archive.storage import free_bytes, human
from orbits.archive import creation
from orbits.errors import StorageError
folder = Path(sys.argv[1])
if sys.argv[2] == "late":
    creation.free_bytes = lambda folder: 10**12 if any(folder.glob(".*.partial")) else free_bytes(folder)
before = free_bytes(folder)
try:
    runs.create(folder / "run.h5", 1000, bodies=100)
except StorageError as error:
    assert list(folder.iterdir()) == [], list(folder.iterdir())
    assert free_bytes(folder) == before
    assert f" MB, but {human(before)} are free in {folder}." in str(error), error
    print(error)
    sys.exit(7)
"""

MOUNT = 'mount -t tmpfs -o size=2m none "$0" && exec "$@"'


def in_a_small_disk(folder: Path, *command: str) -> subprocess.CompletedProcess[str]:
    """Run a command where `folder` is a device of 2 MB. Skips where this system lets nobody make one."""
    unshare = shutil.which("unshare")
    inside = [unshare or "", "--user", "--map-root-user", "--mount", "sh", "-c", MOUNT, str(folder)]
    if unshare is None or subprocess.run([*inside, "true"], capture_output=True, check=False).returncode:
        pytest.skip("needs unshare and user namespaces to make a small disk without being root")
    return subprocess.run([*inside, *command], capture_output=True, text=True, check=False, cwd=ROOT, timeout=120)


@pytest.mark.nightly
@pytest.mark.parametrize("when", [pytest.param("early", marks=pytest.mark.faults), "late"])
def test_a_full_disk_says_what_is_free_on_it_without_the_unfinished_file(when, tmp_path):
    """Early: by asking first. Late: the file system promised room that it then does not have."""
    done = in_a_small_disk(tmp_path, sys.executable, "-c", whole(FULL), str(tmp_path), when)
    assert (done.returncode, done.stderr) == (7, ""), done.stderr


FILL = """
import orbits
from orbits.propagation.resuming import sample_store
from tests.faults import small
sample_store.COMMIT_SECONDS = 0.0
path = Path(sys.argv[1]) / "run.h5"
def fill(t, state):
    if t.value > 20 and not Path(sys.argv[1], "other").exists():
        other = os.open(path.with_name("other"), os.O_WRONLY | os.O_CREAT)
        try:
            while True:
                os.write(other, bytes(4096))
        except OSError:
            pass
small.propagate(path, callback=fill)
sys.exit(0 if small.is_part_of_the_run(orbits.Trajectory.open(path)) else 1)
"""


@pytest.mark.nightly
def test_a_disk_that_others_fill_during_the_run_does_not_stop_it(tmp_path):
    """All of its room was reserved when the file was made."""
    done = in_a_small_disk(tmp_path, sys.executable, "-c", whole(FILL), str(tmp_path))
    assert (done.returncode, done.stderr) == (0, ""), done.stderr
