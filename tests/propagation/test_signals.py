"""Ctrl-C between two blocks of steps."""

import os
import pickle
import signal

import pytest

import orbits
from orbits.propagation.signals import CAUGHT, StopRequest


def test_handlers_of_other_programs_are_left_alone_and_those_of_python_are_put_back(monkeypatch):
    """A handler installed outside Python reads as None."""
    known, before = signal.getsignal, [signal.getsignal(number) for number in CAUGHT]
    monkeypatch.setattr(signal, "getsignal", lambda number: None if number == signal.SIGTERM else known(number))
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
    assert isinstance(caught.value, orbits.Interrupted)
    assert not isinstance(caught.value, Exception)
    assert len(caught.value.trajectory) == 1
    again = pickle.loads(pickle.dumps(caught.value))
    assert (str(again), len(again.trajectory)) == (str(caught.value), 1)
