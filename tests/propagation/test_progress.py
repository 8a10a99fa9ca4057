"""Progress: a bar with rate and remaining time on a terminal, no output elsewhere."""

import io
import sys
import types

import pytest

import orbits
from orbits.propagation.control import progress as module
from orbits.propagation.control.progress import Progress


class Terminal(io.StringIO):
    def isatty(self):
        return True


def run():
    system = orbits.System(
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


class Notebook:
    """IPython in the kernel of a notebook: a shell with a kernel, and displays that can be updated."""

    def __init__(self, kernel=True):
        self.messages = []
        self.shell = types.SimpleNamespace(**({"kernel": object()} if kernel else {}))

    def get_ipython(self):
        return self.shell

    def display(self, data, *, raw, display_id):
        assert raw
        assert display_id
        self.messages.append(data)
        return self

    def update(self, data, *, raw):
        assert raw
        self.messages.append(data)


def install(monkeypatch, notebook):
    monkeypatch.setitem(sys.modules, "IPython", notebook)
    monkeypatch.setitem(sys.modules, "IPython.display", notebook)
    monkeypatch.setattr(module, "PATIENCE", 0.0)
    return notebook


def test_in_a_notebook_the_bar_is_an_output_that_is_updated_and_taken_away(monkeypatch, capsys):
    notebook = install(monkeypatch, Notebook())
    monkeypatch.setattr(module, "PAUSE", 0.0)
    run()
    first, *shown, last = notebook.messages
    assert first == {"text/html": "", "text/plain": "StormerVerlet()"}
    assert last == {"text/html": "", "text/plain": ""}
    assert len(shown) >= 2
    assert '<progress value="' in shown[0]["text/html"]
    for text in (shown[-1]["text/plain"], shown[-1]["text/html"]):
        assert "StormerVerlet()" in text
        assert "100%" in text
        assert "steps/s" in text
    assert capsys.readouterr().err == ""


def test_a_notebook_is_told_the_time_that_is_left(monkeypatch):
    notebook = install(monkeypatch, Notebook())
    clock = iter([0.0, 3.0, 9.0])
    monkeypatch.setattr(module.time, "perf_counter", lambda: next(clock))
    bar = module.Notebook("gauss", 0.25)
    bar.show(0.25, "1 d", "")  # nothing is done yet: no estimate
    bar.show(0.75, "3 d", "")  # 9 s for a half: 4.5 s for the last quarter
    assert [", " in one["text/plain"] for one in notebook.messages[1:]] == [False, True]
    assert notebook.messages[-1]["text/plain"].endswith(", 4 s left")


def test_a_notebook_is_told_no_more_than_five_times_a_second(monkeypatch):
    notebook = install(monkeypatch, Notebook())
    monkeypatch.setattr(module, "PAUSE", 3600.0)
    run()
    assert len(notebook.messages) == 3


@pytest.mark.parametrize("kernel", [True, False])
def test_false_and_an_ipython_without_a_notebook_show_no_output(monkeypatch, kernel):
    notebook = install(monkeypatch, Notebook(kernel))
    bar = Progress(False if kernel else None, label="x", total=1.0, unit="d")
    bar.update(0.5, 5)
    bar.close()
    assert not notebook.messages


@pytest.mark.parametrize("wanted", [True, None])
def test_short_runs_stay_silent_even_on_a_terminal(monkeypatch, wanted):
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    bar = Progress(wanted, label="x", total=1.0, unit="d")
    bar.update(0.5, 5)
    bar.close()
    assert terminal.getvalue() == ""


def test_false_never_shows_a_bar(monkeypatch):
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setattr(module, "PATIENCE", 0.0)
    bar = Progress(False, label="x", total=1.0, unit="d")
    bar.update(0.5, 5)
    bar.close()
    assert terminal.getvalue() == ""
