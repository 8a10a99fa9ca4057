"""Validators of numbers, counts, flags and vectors: each is written once, here, and names what is wrong."""

from __future__ import annotations

from typing import Any

import numpy as np

from orbits.errors import InputError, shown


def checked_flag(value: Any, what: str) -> bool:
    """Return True or False as it was given. Raises InputError, naming it, for anything else."""
    if isinstance(value, bool | np.bool_):
        return bool(value)
    raise InputError(f"{what} is {shown(value)}; expected True or False")
