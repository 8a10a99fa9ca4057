"""The progress of a campaign over all workers: a bar on terminals and in notebooks; silent elsewhere."""

from __future__ import annotations

import time

from orbits.errors import counted
from orbits.propagation.control.progress import PATIENCE, Notebook, Terminal, kind_of_bar


class Bar:
    """Shows members that are done, blocks, losses and the rate.

    wanted : True or None for a bar on terminals and in notebooks, False for none;  label : what is run, and where
    members : of the whole;  done : of them before
    """

    def __init__(self, wanted: bool | None, label: str, members: int, done: int) -> None:
        self._make = kind_of_bar(wanted)
        self._label, self._members, self._before = label, members, done
        self._begun = time.perf_counter()
        self._bar: Terminal | Notebook | None = None

    def show(self, done: float, blocks: int, whole: int, busy: int, failed: int) -> None:
        """Show how many members are done, of how many blocks; how many blocks are at work, and members failed."""
        elapsed = time.perf_counter() - self._begun
        if self._make is None or elapsed < PATIENCE:
            return
        if self._bar is None:
            self._bar = self._make(self._label, self._before / self._members)
        lost = f", {counted(failed, 'member')} failed" if failed else ""
        told = f"{blocks:,} / {whole:,} blocks, {busy} at work{lost}"
        speed = (done - self._before) / elapsed
        rate = f"{speed:,.0f} members/s" if speed >= 10 else f"{speed:.2g} members/s"
        self._bar.show(done / self._members, told, rate)

    def close(self) -> None:
        """Remove it."""
        if self._bar is not None:
            self._bar.close()
            self._bar = None
