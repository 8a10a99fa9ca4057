"""Kernels read and write within their arrays: eight lanes beyond the end of one end a process in rare places only."""

import signal
import subprocess
import sys
from pathlib import Path

import pytest

from .small_runs import RUNS, WRONG

ROOT = Path(__file__).parents[2]

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="arrays end with a page on Linux only")


def done(name):
    """The process of `small_runs` with a name."""
    command = [sys.executable, "-m", "tests.kernels.small_runs", name]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)


QUICK = ("chosen_steps",)
"""What is not compiled for these tests alone."""


@pytest.mark.parametrize("name", [pytest.param(name, marks=[] if name in QUICK else pytest.mark.slow) for name in RUNS])
def test_kernels_touch_no_memory_behind_their_arrays(name):
    process = done(name)
    assert process.returncode == 0, process.stderr


def test_one_lane_behind_an_array_ends_the_process():
    process = done(WRONG)
    assert process.returncode == -signal.SIGSEGV, process.stderr
