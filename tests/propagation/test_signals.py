"""Ctrl-C between two blocks of steps."""

import _signal
import os
import pickle
import signal
import subprocess
import sys

import pytest

import orbits
from orbits.propagation.control.signals import CAUGHT, StopRequest


def test_handlers_of_other_programs_are_left_alone_and_those_of_python_are_put_back(monkeypatch):
    """A handler installed outside Python reads as None."""
    known, before = _signal.getsignal, [_signal.getsignal(number) for number in CAUGHT]
    monkeypatch.setattr(_signal, "getsignal", lambda number: None if number == signal.SIGTERM else known(number))
    with StopRequest() as request:
        assert known(signal.SIGTERM) is before[1]
        assert not request.name
        os.kill(os.getpid(), signal.SIGINT)
        assert request.name == "Ctrl-C"
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGINT)
    assert [known(number) for number in CAUGHT] == before


def test_a_loop_that_goes_on_after_failed_runs_ends_with_ctrl_c():
    """`except Exception: continue` must not swallow it."""
    pair = orbits.System.from_elements({"star": {"gm": 1}, "planet": {"a": 1}}, units=orbits.DIMENSIONLESS)
    begun = []

    def interrupt(t, system):
        os.kill(os.getpid(), signal.SIGINT)

    def loop():
        for _ in range(3):
            begun.append(1)
            try:
                orbits.propagate(pair, "stormer-verlet", dt=0.01, duration=1.0, samples=5, callback=interrupt)
            except Exception:
                continue

    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # some runners ignore it
    try:
        with pytest.raises(KeyboardInterrupt) as caught:
            loop()
    finally:
        signal.signal(signal.SIGINT, before)
    assert len(begun) == 1
    assert isinstance(caught.value, orbits.errors.Interrupted)
    assert not isinstance(caught.value, Exception)
    assert len(caught.value.trajectory) == 1
    again = pickle.loads(pickle.dumps(caught.value))
    assert (str(again), len(again.trajectory)) == (str(caught.value), 1)


@pytest.mark.nightly
def test_the_suite_does_not_depend_on_signals_that_its_process_inherited_as_ignored():
    """As under `nohup make test &`, and on many runners: a test that sends signals, where they are ignored."""
    tests = [__file__ + "::test_handlers_of_other_programs_are_left_alone_and_those_of_python_are_put_back"]
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *tests]
    done = subprocess.run(command, preexec_fn=ignore_all, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout[-800:]


def ignore_all():
    for number in CAUGHT:
        signal.signal(number, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_BLOCK, CAUGHT)
