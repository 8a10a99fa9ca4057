"""Progress: a bar with rate and time left on a terminal, silence elsewhere."""

import io
import sys

import pytest

import orbits
from orbits.propagation import progress as module
from orbits.propagation.progress import Progress


class Terminal(io.StringIO):
    def isatty(self):
        return True


def run():
    system = orbits.System.from_states(
        ["a", "b"], [1.0, 0.0], [[0, 0, 0], [1, 0, 0]], [[0, 0, 0], [0, 1, 0]], units=orbits.DIMENSIONLESS
    )
    return orbits.propagate(system, orbits.StormerVerlet(), dt=1e-3, duration=50.0, samples=11, progress=True)


def test_nothing_is_written_where_there_is_no_terminal(capsys):
    run()
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err == ""


def test_on_a_terminal_the_bar_shows_method_time_and_rate(monkeypatch):
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setattr(module, "PATIENCE", 0.0)
    run()
    shown = terminal.getvalue()
    assert "StormerVerlet()" in shown
    assert "steps/s" in shown
    assert "%" in shown


@pytest.mark.parametrize("wanted", [True, None])
def test_short_runs_stay_silent_even_on_a_terminal(monkeypatch, wanted):
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    bar = Progress(wanted, label="x", total=1.0, unit="d", steps=10)
    bar.update(0.5)
    bar.close()
    assert terminal.getvalue() == ""


def test_false_never_shows_a_bar(monkeypatch):
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setattr(module, "PATIENCE", 0.0)
    bar = Progress(False, label="x", total=1.0, unit="d", steps=10)
    bar.update(0.5)
    bar.close()
    assert terminal.getvalue() == ""
