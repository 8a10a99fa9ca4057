"""The progress of a campaign over all workers: a bar on terminals and in notebooks; silent elsewhere."""

from __future__ import annotations

import sys
import time
from typing import Any

from orbits.propagation.control.progress import PATIENCE, in_notebook


class Bar:
    """Shows members that are done, blocks, losses and the rate.

    wanted : True or None for a bar on terminals and in notebooks, False for none;  label : what is run, and where
    members : of the whole;  done : of them before
    """

    def __init__(self, wanted: bool | None, label: str, members: int, done: int) -> None:
        self._shown = wanted is not False and (in_notebook() or sys.stderr.isatty())
        self._label, self._members, self._before = label, members, done
        self._begun = time.perf_counter()
        self._bar: Any = None

    def show(self, done: float, blocks: int, whole: int, busy: int, failed: int) -> None:
        """Show how many members are done, of how many blocks, and how many blocks are being integrated or failed."""
        elapsed = time.perf_counter() - self._begun
        if not self._shown or elapsed < PATIENCE:
            return
        if self._bar is None:
            self._make()
        told = f"{blocks:,} / {whole:,} blocks, {busy} at work" + (f", {failed} failed" if failed else "")
        speed = (done - self._before) / elapsed
        rate = f"{speed:,.0f} members/s" if speed >= 10 else f"{speed:.2g} members/s"
        self._bar.update(self._task, completed=done, told=told, rate=rate)

    def close(self) -> None:
        """Remove it."""
        if self._bar is not None:
            self._bar.stop()
            self._bar = None

    def _make(self) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

        columns = "[bold]{task.description}", "{task.percentage:>4.0f} %", "{task.fields[told]}", "{task.fields[rate]}"
        texts = [TextColumn(text) for text in columns]
        console = Console(file=sys.stdout if in_notebook() else sys.stderr)
        self._bar = Progress(texts[0], BarColumn(), *texts[1:], TimeRemainingColumn(), console=console, transient=True)
        self._task = self._bar.add_task(self._label, total=self._members, completed=self._before, told="", rate="")
        self._bar.start()
