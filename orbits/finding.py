"""What a check finds: one value with one text, which warns, refuses a run, or is told once for many runs."""

from __future__ import annotations

import os
import sys
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from orbits.errors import OrbitsWarning

SHOWN = 5
"""The most cases that a finding lists."""


@dataclass(frozen=True)
class Finding:
    """Something that the caller should know.

    said : what was found, with bodies and figures
    category : the warning in which it is given
    kind : what it has in common with those of other runs, whose bodies and figures differ; "" for its text
    rows : cases, the worst or the first ones
    hidden : how many more there are, or a number below 1 for none;  where : which these are, or where they are listed
    remedy : what can be done
    """

    said: str
    category: type[Warning] = OrbitsWarning
    kind: str = ""
    rows: Sequence[str] = ()
    hidden: int = 0
    where: str = ""
    remedy: str = ""

    def __str__(self) -> str:
        lines = [self.said, *(f"  {row.removesuffix('.')}." for row in self.rows)]
        lines += [f"  And {self.hidden:,} more{self.where}."] * (self.hidden > 0)
        return "\n".join(lines + [self.remedy] * bool(self.remedy))

    def warn(self) -> None:
        """Warn of it at the line outside this package that led to it; the warning has it as `finding`."""
        warning: Any = self.category(str(self))
        warning.finding = self
        package = os.path.dirname(__file__) + os.sep
        frame, level = sys._getframe(), 1
        while frame.f_code.co_filename.startswith(package) and frame.f_back is not None:
            frame, level = frame.f_back, level + 1
        warnings.warn(warning, stacklevel=level)


def kind_of(warning: Warning | str) -> str:
    """Return what warnings that are told once for many runs have in common: the kind of their findings, or the text."""
    return getattr(getattr(warning, "finding", None), "kind", "") or str(warning)
