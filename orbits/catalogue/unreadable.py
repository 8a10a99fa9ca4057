"""Entries that cannot be read: the first one raises an error, or all are left out, counted, and warned of."""

from __future__ import annotations

from typing import Any

from orbits.errors import InputError, shown
from orbits.finding import Finding

SHOWN = 3
MOST = 100_000


class Unreadable:
    """Raises InputError at the first bad entry (errors="raise"), or counts them and records the first few ("skip")."""

    def __init__(self, errors: Any, name: str) -> None:
        if not isinstance(errors, str) or errors not in ("raise", "skip"):
            raise InputError(
                f"errors = {shown(errors)}; expected 'raise', to stop at the first entry that cannot be read, or 'skip'"
            )
        self.skips = errors == "skip"
        self.name = name
        self.count = 0
        self._first: list[str] = []

    def bad(self, where: str, problem: str) -> None:
        """Record a bad entry. Raises InputError unless such entries are to be left out."""
        if not self.skips:
            raise InputError(
                f"{self.name}, {where}: {problem}. Correct it, or use errors='skip' to leave out such entries"
            )
        self.count += 1
        if self.count > MOST:
            raise InputError(
                f"{self.name}: more than {MOST:,} entries cannot be read; this is probably another kind of file. "
                f"{self._first[0]}"
            )
        if len(self._first) < SHOWN:
            self._first.append(f"{where}: {problem}")

    def close(self, read: int) -> None:
        """Warn of entries that were left out. Raises InputError if no entry could be read."""
        if self.count and not read:
            raise InputError(f"{self.name}: none of its {self.count} entries can be read. {self._first[0]}")
        if self.count:
            some = "; ".join(self._first) + ("; ..." if self.count > len(self._first) else "")
            left_out = f"{self.count} of {self.count + read} entries cannot be read and were left out"
            Finding(f"{self.name}: {left_out}: {some}").warn()
