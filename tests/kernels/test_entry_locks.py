"""Several processes that need the same kernels at once: each is compiled once, and no entry is lost."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import orbits

KERNELS = """
from orbits import kernel

@kernel
def halved(x):
    return 0.5 * x

@kernel
def first(x):
    return halved(x) + 1.0

@kernel
def second(x):
    return halved(x) + 2.0
"""

PROGRAM = """
import sys, time
from numba.core import event
import shared

class Count(event.Listener):
    compiled = []
    def on_start(self, event):
        self.compiled.append(event.data["dispatcher"].py_func.__name__)
        time.sleep(1.0)  # the other process is there before this is kept
    def on_end(self, event): pass

event.register("numba:compile", Count())
for name in sys.argv[1:]:
    getattr(shared, name)(1.0)
print(*Count.compiled)
"""


def together(folder, *arguments):
    """Run the program in several processes at once; return the names of what each compiled."""
    environment = {
        **os.environ,
        "PYTHONPATH": f"{folder}{os.pathsep}{Path(orbits.__file__).parents[1]}",
        "NUMBA_CACHE_DIR": str(folder / "cache"),
    }
    command = [sys.executable, "-c", PROGRAM]
    started = [
        subprocess.Popen([*command, *names], cwd=folder, env=environment, stdout=subprocess.PIPE, text=True)
        for names in arguments
    ]
    outputs = [process.communicate(timeout=300)[0] for process in started]
    assert all(process.returncode == 0 for process in started)
    return [output.split() for output in outputs]


@pytest.mark.nightly
def test_processes_that_need_the_same_kernels_compile_each_once_and_lose_none(tmp_path):
    (tmp_path / "shared.py").write_text(KERNELS)
    compiled = together(tmp_path, ["first"], ["first"], ["second"])
    assert sorted(name for names in compiled for name in names) == ["first", "halved", "second"]
    assert together(tmp_path, ["first", "second"]) == [[]]
