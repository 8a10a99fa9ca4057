"""Computations in many digits, by one thread at a time: the precision of mpmath is that of the whole process."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from threading import RLock

ONE_AT_A_TIME = RLock()


@contextmanager
def many_digits(digits: int) -> Iterator[None]:
    """Let mpmath compute with so many decimal digits; no other thread changes that meanwhile."""
    import mpmath

    with ONE_AT_A_TIME, mpmath.workdps(digits):
        yield
