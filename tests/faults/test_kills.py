"""A run that is killed at any call to the system loses nothing that was there, and goes on to the same bits."""

from __future__ import annotations

import subprocess
import sys

import pytest

from .processes import ROOT


@pytest.mark.parametrize(("every", "least"), [(199, 6), pytest.param(1, 300, marks=pytest.mark.faults)])
def test_a_run_killed_at_any_stage_of_making_overwriting_resuming_extending_is_whole(every, least, tmp_path):
    done = subprocess.run(
        [sys.executable, "-m", "tests.faults.killed", str(tmp_path), str(every)],
        capture_output=True, text=True, check=False, cwd=ROOT, timeout=1800,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-3000:]
    killed, *found = done.stdout.split("\n", 1)
    assert found[0].strip() == ""
    assert int(killed) >= least
