"""A progress bar with rate and remaining time, on terminals and in notebooks; silent elsewhere.

The time in which kernels are compiled is not counted in the rate.
"""

from __future__ import annotations

import importlib
import sys
import time
from html import escape
from typing import Any

from orbits.errors import with_unit
from orbits.kernels.compile.compile_time import compile_time
from orbits.propagation.control.compiling import words

PATIENCE = 0.5
"""Seconds before a bar appears, so that short runs are silent."""

PAUSE = 0.2
"""Seconds between two messages to a notebook, which stores all of them."""


class Progress:
    """Shows the progress of a run.

    wanted : True or None for a bar on terminals and in notebooks; False for none
    begun : the time and the steps from which it is marched here
    """

    def __init__(
        self, wanted: bool | None, *, label: str, total: float, unit: Any, begun: tuple[float, int] = (0.0, 0)
    ) -> None:
        self._make = kind_of_bar(wanted)
        self._label, self._total, self._unit = label, total, unit
        self._from, self._steps_before = begun
        self._begun, self._compiled = time.perf_counter(), compile_time.seconds()
        self._bar: Terminal | Notebook | None = None

    def update(self, done: float, steps: int) -> None:
        """Report `done` of the total, in units of time, and the steps so far."""
        if self._make is None:
            return
        elapsed = time.perf_counter() - self._begun
        if self._bar is None:
            if elapsed < PATIENCE:
                return
            words.bar = self._bar = self._make(self._label, abs(self._from / self._total))
        fraction = abs(done / self._total)
        taken = steps - self._steps_before
        at = with_unit(f"{done:,.6g} / {self._total:,.6g}", self._unit)
        marched = elapsed - (compile_time.seconds() - self._compiled)
        self._bar.show(fraction, at, f"{taken / marched:,.0f} steps/s" if marched > 0.0 else "")

    def close(self) -> None:
        """Remove the bar."""
        if self._bar is not None:
            words.bar = None
            self._bar.close()
            self._bar = None


def kind_of_bar(wanted: bool | None) -> type[Terminal] | type[Notebook] | None:
    """Return what draws a bar: True or None for one on terminals and in notebooks; False for none."""
    if wanted is False:
        return None
    return Notebook if in_notebook() else Terminal if sys.stderr.isatty() else None


class Terminal:
    """A bar on standard error, by rich; begun : the fraction from which it goes on."""

    def __init__(self, label: str, begun: float) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TimeRemainingColumn

        self._bar = Progress(
            "[bold]{task.description}",
            BarColumn(),
            "{task.percentage:>4.0f} %",
            "{task.fields[at]}",
            "{task.fields[rate]}",
            TimeRemainingColumn(),
            console=Console(file=sys.stderr),
            transient=True,
        )
        self._task = self._bar.add_task(label, total=1.0, at="", rate="")
        self._bar.update(self._task, completed=begun)
        self._bar.start()

    def show(self, fraction: float, at: str, rate: str) -> None:
        self._bar.update(self._task, completed=fraction, at=at, rate=rate)

    def say(self, text: str) -> None:
        self._bar.update(self._task, rate=text)

    def close(self) -> None:
        self._bar.stop()


class Notebook:
    """An HTML bar in the output of a cell, by IPython alone; rich would need ipywidgets there."""

    def __init__(self, label: str, begun: float) -> None:
        self._label, self._from = label, begun
        self._begun = time.perf_counter()
        self._shown = -PAUSE
        display = importlib.import_module("IPython.display").display
        self._handle: Any = display(_mime("", label), raw=True, display_id=True)

    def show(self, fraction: float, at: str, rate: str) -> None:
        now = time.perf_counter() - self._begun
        if now - self._shown < PAUSE:
            return
        self._shown = now
        done = fraction - self._from
        left = f", {now * (1.0 - fraction) / done:,.0f} s left" if done > 0.0 and now > 1.0 else ""
        text = f"{self._label}  {fraction:.0%}  {at}  {rate}{left}"
        bar = f'<progress value="{fraction:.4f}" max="1" style="width:16em;vertical-align:middle"></progress>'
        html = f"<b>{escape(self._label)}</b> {bar} {escape(text.removeprefix(self._label))}"
        self._handle.update(_mime(html, text), raw=True)

    def say(self, text: str) -> None:
        self._handle.update(_mime(f"<b>{escape(self._label)}</b> {escape(text)}", f"{self._label}  {text}"), raw=True)

    def close(self) -> None:
        self._handle.update(_mime("", ""), raw=True)


def in_notebook() -> bool:
    """Whether this runs in the kernel of a notebook, where IPython is already imported; it is not imported here."""
    module = sys.modules.get("IPython")
    return module is not None and hasattr(module.get_ipython(), "kernel")


def _mime(html: str, text: str) -> dict[str, str]:
    return {"text/html": html, "text/plain": text}
