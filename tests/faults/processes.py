"""Real processes: started, stopped, killed, and asked how they ended."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
PATIENCE = 120.0  # seconds; a start takes two, or a minute where kernels have to be compiled first


def whole(code: str) -> str:
    """Return code with the imports that every program needs before it."""
    return "import os, signal, sys\nfrom pathlib import Path\n" + code


def start(code: str, *arguments: Any, **options: Any) -> subprocess.Popen[str]:
    """Start a Python process with this code; signals are as a terminal gives them, or ignored."""
    ignored: list[int] = options.pop("ignored", [])

    def prepare() -> None:
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, signal.SIG_IGN if number in ignored else signal.SIG_DFL)

    return subprocess.Popen(
        [sys.executable, "-X", "faulthandler", "-c", whole(code), *map(str, arguments)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=ROOT, preexec_fn=prepare, **options,
    )  # fmt: skip


def ended(process: subprocess.Popen[str]) -> tuple[int, str, str]:
    """Wait for the end; return status, output and errors."""
    try:
        out, err = process.communicate(timeout=PATIENCE)
    except subprocess.TimeoutExpired:
        process.kill()
        raise
    return process.returncode, out, err


def wait_for(condition: Callable[[], bool]) -> None:
    """Look every few milliseconds whether something has come true."""
    until = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < until, "it never came true"
        time.sleep(0.005)


def is_stopped(process: subprocess.Popen[str]) -> bool:
    """Whether a process stopped itself by SIGSTOP. Raises AssertionError where it ended instead."""
    pid, status = os.waitpid(process.pid, os.WUNTRACED | os.WNOHANG)
    assert pid == 0 or os.WIFSTOPPED(status), "it ended"
    return pid != 0
