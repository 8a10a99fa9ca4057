"""Numbers in columns of fixed width, many lines at once, each rounded once.

A decimal number of at most 15 digits is an integer over a power of ten. Both are exact as float64, so their quotient is
the float64 nearest to the printed number.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Bytes = NDArray[np.uint8]
Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

MOST_DIGITS = 15
BLANK, DOT, PLUS, MINUS, ZERO, NEWLINE, RETURN = (ord(c) for c in " .+-0\n\r")


def decimals(columns: Bytes) -> tuple[Floats, Bools]:
    """Return the numbers in columns, (n, width) to (n,), nan for blank columns; and which columns are not numbers.

    A number is an optional sign, digits and at most one point, with blanks around it, as Fortran's Fw.d writes it.
    """
    n, width = columns.shape
    value, power = np.zeros(n, dtype=np.int64), np.zeros(n, dtype=np.int64)
    begun, ended, pointed, digits, negative, wrong = (np.zeros(n, dtype=bool) for _ in range(6))
    for column in np.ascontiguousarray(columns.T):
        digit = column - ZERO  # wraps around: everything else is > 9
        is_digit, is_point = digit <= 9, column == DOT
        is_sign, is_blank = (column == PLUS) | (column == MINUS), column == BLANK
        wrong |= ~(is_digit | is_point | is_sign | is_blank)
        wrong |= (is_sign & begun) | (is_point & pointed) | (ended & ~is_blank)
        value = np.where(is_digit, 10 * value + digit, value)
        power += is_digit & pointed
        negative |= column == MINUS
        digits |= is_digit
        pointed |= is_point
        ended |= begun & is_blank
        begun |= ~is_blank
    wrong |= (begun & ~digits) | (value >= 10**MOST_DIGITS)
    if width > MOST_DIGITS:
        raise ValueError(f"{width} columns; expected at most {MOST_DIGITS}, so that no digit is lost")
    number = np.where(negative, -1.0, 1.0) * value / 10.0**power
    return np.where(begun & ~wrong, number, np.nan), wrong


def lines(block: Bytes, width: int) -> tuple[Bytes, NDArray[np.int64], NDArray[np.int64]]:
    """Return the lines of a block, their lengths, and the number of lines before each: (n, width), (n,), (n,).

    block : ends with a newline
    Lines are cut or padded with blanks to `width` bytes; lengths exclude the newline. Blank lines are left out.
    """
    ends = np.flatnonzero(block == NEWLINE)
    starts = np.concatenate([[0], ends[:-1] + 1])
    lengths = ends - starts
    lengths -= (lengths > 0) & (block[ends - 1] == RETURN)
    number = np.flatnonzero(lengths)
    starts, lengths = starts[number], lengths[number]
    filled = np.concatenate([block, np.full(width, BLANK, dtype=np.uint8)])
    rows = np.lib.stride_tricks.sliding_window_view(filled, width)[starts]
    short = np.flatnonzero(lengths < width)
    tails = rows[short]
    tails[np.arange(width) >= lengths[short, None]] = BLANK
    rows[short] = tails
    some = (rows != BLANK).any(axis=1)
    return rows[some], lengths[some], number[some]
