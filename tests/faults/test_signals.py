"""SIGINT, SIGTERM and SIGHUP at any moment of a run: it ends in order, and its file goes on to the same bits."""

from __future__ import annotations

import signal
from pathlib import Path

import pytest

import orbits
from orbits.propagation.control.signals import CAUGHT, StopRequest

from . import small
from .processes import ended, start

# A signal to itself at a given moment; the status is that of the command line.
RUN = """
import orbits
from orbits.archive import creation, writer
from orbits.errors import Interrupted
from orbits.propagation import marchers
from orbits.propagation.resuming import sample_store
from tests.faults import small

path, number, moment = Path(sys.argv[1]), int(sys.argv[2]), sys.argv[3]
owner, name = {
    "before the file exists": (creation.Storage, "resize"),
    "before it has its name": (writer, "take_name"),
    "before the kernels are ready": (marchers.Leg, "compile"),
    "in the middle": (sample_store.SampleStore, "add"),
}[moment]
real = getattr(owner, name)
calls = []
def then(*arguments, **options):
    calls.append(1)
    if len(calls) == (5 if moment == "in the middle" else 1):
        os.kill(os.getpid(), number)
    return real(*arguments, **options)
setattr(owner, name, then)
try:
    small.propagate(path, overwrite=True)
except Interrupted as stopped:
    print(stopped)
    sys.exit(stopped.exit_code)
"""
MOMENTS = ["before the file exists", "before it has its name", "before the kernels are ready", "in the middle"]
NUMBERS = [signal.SIGINT, signal.SIGTERM, signal.SIGHUP]
SHORT = [(signal.SIGTERM, "in the middle")]
ALL = [
    pytest.param(number, moment, marks=[] if (number, moment) in SHORT else pytest.mark.faults)
    for number in NUMBERS
    for moment in MOMENTS
]


@pytest.mark.parametrize(("number", "moment"), ALL)
def test_a_signal_at_any_moment_leaves_a_run_that_goes_on_to_the_same_bits(number, moment, tmp_path: Path):
    path = tmp_path / "run.h5"
    status, out, err = ended(start(RUN, path, int(number), moment))
    name = "Ctrl-C" if number == signal.SIGINT else number.name
    assert (status, err) == (130, "")
    assert f"stopped by {name} at " in out
    assert f"go on with: orbits resume {path}" in out
    assert [each.name for each in tmp_path.iterdir()] == ["run.h5"]
    assert len(orbits.Trajectory.open(path)) == (5 if moment == "in the middle" else 0)
    assert small.is_part_of_the_run(orbits.resume(path, progress=False))


@pytest.mark.nightly
def test_a_run_that_ignores_sighup_as_under_nohup_runs_to_its_end(tmp_path):
    path = tmp_path / "run.h5"
    status, out, err = ended(start(RUN, path, int(signal.SIGHUP), "in the middle", ignored=[signal.SIGHUP]))
    assert (status, out, err) == (0, "", "")
    assert orbits.Trajectory.open(path).complete


def test_signals_that_are_ignored_stay_ignored_and_the_others_are_noted():
    before = {number: signal.signal(number, signal.SIG_DFL) for number in CAUGHT}
    try:
        signal.signal(signal.SIGHUP, signal.SIG_IGN)
        with StopRequest() as stop:
            signal.raise_signal(signal.SIGHUP)
            assert stop.name == ""
            signal.raise_signal(signal.SIGTERM)
            assert stop.name == "SIGTERM"
        assert signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
