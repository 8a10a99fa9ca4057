"""What is said while kernels are compiled, and that it is not counted as time of marching."""

import io
import os
import pty
import subprocess
import sys
import time

import pytest
from numba.core.event import trigger_event

from orbits.kernels.compile import kernel
from orbits.kernels.compile.compile_time import CompileTime, compile_time
from orbits.propagation.control import compiling
from orbits.propagation.control import progress as module
from orbits.propagation.control.progress import Progress

WORDS = "compiling for this machine, once: "

PROGRAM = """
from orbits.kernels.search.collisions import fraction_of_contact
from orbits.propagation.control import compiling
compiling.PATIENCE, compiling.PAUSE = 0.0, 0.02
fraction_of_contact((0.0,) * 6, (1.0,) * 6, 1.0, 0.1, 0.0, 0.0)
"""


class Terminal(io.StringIO):
    def isatty(self):
        return True


@kernel
def nothing(x):
    return x


def compiles(seconds, times=1):
    """Let it look as if a kernel were compiled, one within the other."""
    for _ in range(times):
        outer, inner = ({"dispatcher": each} for each in (nothing.entry, nothing.callee))
        with trigger_event("numba:compile", data=outer), trigger_event("numba:compile", data=inner):
            time.sleep(seconds)


@pytest.fixture
def impatient(monkeypatch):
    monkeypatch.setattr(compiling, "PATIENCE", 0.0)
    monkeypatch.setattr(compiling, "PAUSE", 0.02)


def test_seconds_of_compiling_count_once_and_only_of_our_kernels():
    before = compile_time.seconds()
    compiles(0.1, times=2)
    with trigger_event("numba:compile", data={"dispatcher": object()}):
        time.sleep(0.1)
    assert 0.2 <= compile_time.seconds() - before < 0.3
    assert CompileTime().seconds() == 0.0


def test_a_terminal_shows_the_seconds_and_then_an_empty_line(monkeypatch, impatient):
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    compiles(0.2)
    shown = terminal.getvalue()
    assert WORDS in shown
    assert "s so far …" in shown
    assert shown.endswith(compiling.ERASED)


def test_a_log_gets_one_line_and_only_from_a_command(monkeypatch, impatient, capsys):
    monkeypatch.setattr(compiling.words, "_logged", False)
    monkeypatch.setattr(compiling.words, "in_logs", False)
    compiles(0.1)
    assert capsys.readouterr().err == ""
    monkeypatch.setattr(compiling.words, "in_logs", True)
    compiles(0.1, times=3)
    assert capsys.readouterr().err.splitlines() == ["compiling for this machine, once; later runs find it in the cache"]


def test_a_bar_says_it_and_leaves_that_time_out_of_the_rate(monkeypatch, impatient):
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setattr(module, "PATIENCE", 0.0)
    bar = Progress(True, label="gauss", total=1.0, unit="d")
    said = []
    bar.update(0.0, 0)
    monkeypatch.setattr(bar._bar, "say", said.append)
    monkeypatch.setattr(bar._bar, "show", lambda fraction, at, rate: said.append(rate))
    compiles(0.5)
    bar.update(0.5, 50)
    bar.close()
    assert said[0].startswith(WORDS)
    assert compiling.ERASED not in terminal.getvalue()
    assert float(said[-1].split()[0].replace(",", "")) > 50 / 0.5


def output(folder):
    """Run the program on a terminal, with that cache; return what it shows."""
    control, terminal = pty.openpty()
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(folder)}
    process = subprocess.Popen([sys.executable, "-c", PROGRAM], stdout=terminal, stderr=terminal, env=environment)
    os.close(terminal)
    shown = b""
    while True:
        try:
            part = os.read(control, 4096)
        except OSError:  # the terminal is closed
            break
        if not part:
            break
        shown += part
    os.close(control)
    assert process.wait(timeout=60) == 0
    return shown.decode()


def test_a_first_run_says_it_and_a_second_one_says_nothing(tmp_path):
    assert WORDS in output(tmp_path)
    assert output(tmp_path) == ""
