"""Whether what is found means anything: zeros at the start, functions that are round-off, and events in every step."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from orbits.propagation.events.base import Array, Bound, Whole
from orbits.propagation.events.search.zeros import NEAR_BY, Zeros
from orbits.trajectory.events import BODY, OTHER, TIME

SHIFT = 1e-9
"""How far bodies are moved, as a fraction of their positions and velocities, to see what a function makes of it."""

ROUNDING = 1e-11
"""The errors of positions and velocities, as a fraction of themselves, below which changes mean nothing: the
motion between the checks has the errors of its polynomials, up to 1e-12 of a velocity.
"""

AT_START = 2.0**-41
"""The same at the start, for a state that was rounded, or that an event of an earlier run located: to 2.4e-13 of it."""

SURE = 1e3
"""A function that is so many times as large as round-off in one direction is that in all."""

PART = 1e-3
"""What is shorter than this share of the longest step is the part of one, in which no function changes much."""

SAME = 1e-9
"""Events that are less than this fraction of a step apart are at the same time."""

DIRECTIONS = 4
"""The directions, all different for all bodies, in which they are moved."""

MANY = 64
"""The steps from which on events that happen in all of them are remarkable."""


def are_clear(
    bound: Bound, zeros: Zeros, lengths: Array, longest: float, t: Array, q: Array, v: Array
) -> NDArray[np.bool_]:
    """Return at which zeros a function is more than round-off, a tenth of a step away, (m,).

    lengths : of the steps; longest : so far, which counts instead of a part of a step that is far shorter
    t, q, v : the states there. Round-off is what becomes of the function if all bodies are moved by their last bits.
    """
    own = np.maximum(np.abs(lengths[zeros.steps]), np.finfo(np.float64).tiny)
    large = zeros.sizes * np.where(own < PART * longest, longest / own, 1.0)
    return ~_are_round_off(bound, large, t, q, v, zeros.columns, ROUNDING)


def are_at_start(bound: Bound, zeros: Zeros, lengths: Array, t: Array, q: Array, v: Array) -> NDArray[np.bool_]:
    """Return which zeros are the one with which the run starts, at t = 0, (m,): up to them a function changes by no
    more than round-off, as from a pericentre that has been computed, or at which an earlier run stopped.

    lengths : of the steps; t, q, v : the states there
    """
    since = np.abs(t) / np.maximum(np.abs(lengths[zeros.steps]), np.finfo(np.float64).tiny)
    found, near = since <= SAME, np.flatnonzero(since <= 1.0)
    if len(near):
        changes = (zeros.sizes / NEAR_BY * since)[near]
        found[near] |= _are_round_off(bound, changes, t[near], q[near], v[near], zeros.columns[near], AT_START)
    return found


def _are_round_off(
    bound: Bound, large: Array, t: Array, q: Array, v: Array, columns: Whole, rounding: float
) -> NDArray[np.bool_]:
    """Return at which zeros of a function what it is elsewhere, `large`, is no more than its round-off.

    rounding : the errors of positions and velocities, as a fraction of themselves
    """
    most = _moved(bound, t, q, v, columns, 0)
    doubtful = np.flatnonzero(~(large > SURE * (rounding / SHIFT) * most))
    for k in range(1, DIRECTIONS if len(doubtful) else 1):
        some = t[doubtful], q[doubtful], v[doubtful], columns[doubtful]
        most[doubtful] = np.fmax(most[doubtful], _moved(bound, *some, k))
    return np.asarray(large <= (rounding / SHIFT) * most)


def _moved(bound: Bound, t: Array, q: Array, v: Array, columns: Whole, direction: int) -> Array:
    """Return what becomes of a function at its zeros if all bodies are moved in one of the directions."""
    way = SHIFT * np.random.default_rng(direction).uniform(-1.0, 1.0, (2, *q.shape[1:]))
    sizes = (np.sqrt((x * x).sum(axis=2, keepdims=True)) for x in (q, v))
    near_q, near_v = (x + size * one for x, size, one in zip((q, v), sizes, way, strict=True))
    with np.errstate(all="ignore"):
        change = np.abs(bound.at(t, near_q, near_v, columns))
    return np.where(np.isfinite(change), change, 0.0)


def in_rapid_succession(rows: Array, length: float) -> bool:
    """Return whether many events of one pair follow each other in less than a time; rows of one function."""
    for pair in np.unique(rows[:, BODY : OTHER + 1], axis=0):
        times = rows[(rows[:, BODY : OTHER + 1] == pair).all(axis=1), TIME]
        soon = np.abs(np.diff(np.sort(times))) < length
        if len(soon) >= MANY and (np.convolve(soon, np.ones(MANY), "valid") == MANY).any():
            return True
    return False


def in_every_step(steps: Whole, columns: Whole, count: int) -> bool:
    """Return whether one column of a function has zeros in each of many steps."""
    if count < MANY or len(steps) < count:
        return False
    return any(len(np.unique(steps[columns == column])) == count for column in np.unique(columns))
