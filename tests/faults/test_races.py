"""Two processes that go on with one run at the same time: the second is refused, and nothing is written twice."""

from __future__ import annotations

import os
import shutil
import signal
import time
from pathlib import Path

import numpy as np
import pytest

import orbits
from orbits.archive import Archive
from orbits.errors import ArchiveError

from . import small
from .processes import ended, is_stopped, start, wait_for

# Stops itself with what it found in the file in its hands, before it goes on.
RESUME = """
import orbits
from orbits.propagation import making_runs
differences = making_runs.differences
def stop_first(recorded):
    os.kill(os.getpid(), signal.SIGSTOP)
    return differences(recorded)
making_runs.differences = stop_first
until = None if sys.argv[2] == "-" else sys.argv[2]
print(len(orbits.resume(sys.argv[1], until=until, progress=False, threads=1)))
"""


@pytest.fixture(scope="module")
def originals(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("races")
    return {"-": small.interrupted(folder / "half.h5"), "80 d": small.finished(folder / "whole.h5")}


@pytest.mark.parametrize("until", ["-", pytest.param("80 d", marks=pytest.mark.faults)])
def test_a_resume_that_is_stopped_after_it_looked_keeps_others_out_and_then_goes_on_right(until, originals, tmp_path):
    path = Path(shutil.copy(originals[until], tmp_path / "run.h5"))
    first = start(RESUME, path, until)
    wait_for(lambda: is_stopped(first))
    with pytest.raises(ArchiveError, match="is being written by another run"):
        orbits.resume(path, until=None if until == "-" else until, progress=False, threads=1)
    os.kill(first.pid, signal.SIGCONT)
    status, out, err = ended(first)
    assert (status, int(out or 0)) == (0, small.SAMPLES if until == "-" else 17), err
    with Archive.open(path) as archive:
        archive.verify()
    assert small.is_part_of_the_run(orbits.Trajectory.open(path))


RESUME_WHEN_TOLD = """
import orbits
from orbits.propagation.resuming import sample_store
sample_store.COMMIT_SECONDS = 0.0
print("ready", flush=True)
sys.stdin.readline()
try:
    print(len(orbits.resume(sys.argv[1], progress=False, threads=1)))
except orbits.errors.ArchiveError as error:
    print("refused" if "being written" in str(error) else error)
"""


@pytest.mark.faults
@pytest.mark.parametrize("seed", range(10))
def test_resumes_stopped_and_continued_at_any_moment_leave_the_right_run(seed, originals, tmp_path):
    rng = np.random.default_rng(seed)
    path = Path(shutil.copy(originals["-"], tmp_path / "run.h5"))
    processes = [start(RESUME_WHEN_TOLD, path, stdin=-1) for _ in range(3)]
    for process in processes:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
    for process in processes:
        assert process.stdin is not None
        process.stdin.write("\n")
        process.stdin.flush()
    for _ in range(40):
        process = processes[int(rng.integers(len(processes)))]
        if process.poll() is None:
            os.kill(process.pid, signal.SIGSTOP)
            time.sleep(float(rng.exponential(0.01)))
            os.kill(process.pid, signal.SIGCONT)
    outcomes = [ended(process) for process in processes]
    assert all(status == 0 for status, _, _ in outcomes), outcomes
    said = {out.strip() for _, out, _ in outcomes}
    assert said <= {"refused", str(small.SAMPLES)}, outcomes
    assert str(small.SAMPLES) in said
    run = orbits.Trajectory.open(path)
    assert run.complete
    assert small.is_part_of_the_run(run)
