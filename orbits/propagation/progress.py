"""A progress bar with rate and time left: on a terminal only, silent elsewhere."""

from __future__ import annotations

import sys
import time
from typing import Any

PATIENCE = 0.5
"""Seconds before a bar appears: short runs stay silent."""


class Progress:
    """Shows how far a run is. `wanted`: True or None on a terminal shows the bar; False never does."""

    def __init__(self, wanted: bool | None, *, label: str, total: float, unit: Any, steps: int) -> None:
        self._wanted = wanted is not False and sys.stderr.isatty()
        self._label, self._total, self._unit, self._steps = label, total, unit, steps
        self._begun = time.perf_counter()
        self._bar: Any = None
        self._task: Any = None

    def update(self, done: float) -> None:
        """Report `done` of the total, in units of time."""
        if not self._wanted:
            return
        if self._bar is None:
            if time.perf_counter() - self._begun < PATIENCE:
                return
            self._open()
        fraction = abs(done / self._total)
        rate = fraction * self._steps / (time.perf_counter() - self._begun)
        self._bar.update(
            self._task,
            completed=fraction,
            at=f"{done:,.6g} / {self._total:,.6g} {self._unit}",
            rate=f"{rate:,.0f} steps/s",
        )

    def close(self) -> None:
        """Take the bar away."""
        if self._bar is not None:
            self._bar.stop()
            self._bar = None

    def _open(self) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

        columns = (
            "[bold]{task.description}",
            BarColumn(),
            "{task.percentage:>4.0f} %",
            "{task.fields[at]}",
            "{task.fields[rate]}",
        )
        console = Console(file=sys.stderr)
        self._bar = Progress(
            *(c if not isinstance(c, str) else TextColumn(c) for c in columns),
            TimeRemainingColumn(),
            console=console,
            transient=True,
        )
        self._task = self._bar.add_task(self._label, total=1.0, at="", rate="")
        self._bar.start()
