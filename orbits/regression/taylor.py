"""Positions and velocities of Newtonian motion to more digits than a float64 has, by Taylor series."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbits.errors import SingularityError, shown
from orbits.kernels.gravity.taylor_series import MET, REACHED, SERIES, SHARE, STEPS, TIME, UNDER_WAY, UNIT, march_series
from orbits.kernels.lanes import WIDTH
from orbits.point_masses import PointMasses
from orbits.time_grid import dynamical_time_of

Array = NDArray[np.float64]

ORDER = 36
"""The order of the series: about the cheapest for 31 digits."""

DIGITS = 1e-31
"""The last term of a series, as a fraction of the first."""

BLOCK = 500
"""Steps between two looks at signals."""


class Doubled(NamedTuple):
    """Positions and velocities in doubled precision: (samples, bodies, 3) each; a value is the sum of both parts.

    steps : of the series
    """

    q: Array
    q_lo: Array
    v: Array
    v_lo: Array
    steps: int

    def from_positions(self, q: Array) -> Array:
        """Return q minus the positions, (samples, bodies, 3), with the digits that a difference of floats has lost."""
        return (q - self.q) - self.q_lo


def taylor(
    start: PointMasses,
    times: Array,
    *,
    order: int = ORDER,
    reached: Callable[[float, int], None] = lambda time, steps: None,
) -> Doubled:
    """Return the states at `times`, to about 31 digits times what the motion makes of an error.

    start : gm (bodies,), q and v (bodies, 3), softening: exactly these floats
    times : (samples,) from the epoch, all of one sign, in order of growing |t|
    order : of the series; another one has other errors
    reached : called now and then with the time and the steps so far

    The time it takes grows with the number of pairs of which one body is massive, and with order^2. Raises
    SingularityError if bodies meet.
    """
    gm, q, v, softening = start
    n = len(gm)
    couples = [(i, j) for i, j in combinations(range(n), 2) if gm[i] > 0.0 or gm[j] > 0.0]
    groups = -(-len(couples) // WIDTH)
    pairs = np.zeros((WIDTH * groups, 2), dtype=np.int64)
    pairs[: len(couples)] = np.reshape(couples, (-1, 2))
    shift = np.ones((groups, WIDTH))
    shift.flat[: len(couples)] = softening**2
    size, terms = -(-3 * n // WIDTH) * WIDTH, order + 1
    state = np.zeros((4, size))
    state[0, : 3 * n], state[2, : 3 * n] = q.T.ravel(), v.T.ravel()
    clock = np.zeros(6)
    span = float(times[-1])
    clock[UNIT] = math.copysign(2.0 ** math.floor(math.log2(min(dynamical_time_of(start), abs(span) or 1.0))), span)
    clock[SHARE] = DIGITS ** (1.0 / order)
    out = np.zeros((len(times), 4, size))
    rows = SERIES * terms * groups + 3 * groups
    series = (np.zeros((terms, size)), np.zeros((terms, size)), np.zeros((rows, WIDTH)), np.zeros((rows, WIDTH)))
    status = UNDER_WAY
    while status == UNDER_WAY:
        status = march_series(gm, pairs, shift, clock, state, times, out, series, BLOCK)
        reached(float(clock[TIME]), int(clock[STEPS]))
    if status != REACHED:
        what = "bodies meet there" if status == MET else "the state is not finite there"
        raise SingularityError(f"the reference solution ends at t = {shown(float(clock[TIME]))}: {what}.")
    q, q_lo, v, v_lo = (out[:, k, : 3 * n].reshape(len(times), 3, n).transpose(0, 2, 1) for k in range(4))
    return Doubled(q, q_lo, v, v_lo, int(clock[STEPS]))
