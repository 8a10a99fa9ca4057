"""Ctrl-C between two blocks of steps."""

import os
import signal

import pytest

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
