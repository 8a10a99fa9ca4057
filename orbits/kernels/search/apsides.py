"""The apsides of the osculating orbit of a pair, from its relative state.

From e cos f = p/r - 1 and e sin f = (q.v/r) sqrt(p/GM), with the true anomaly f, e is off by some 2^-53 on any orbit:
e^2 = 1 - p/a would leave half of the digits to e of a circle, and to both apsides. A number has the bits of a lane.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from orbits.kernels.compile import kernel
from orbits.kernels.lanes import fma, maximum, minimum, select, sqrt

OPEN = 1e150
"""The largest distance on an orbit, also if it is open: its square is finite."""


class Apsides(NamedTuple):
    """Eccentricity; least and largest distance, `OPEN` on open orbits; (2 x area swept in unit time)^2; and 1/a."""

    e: Any
    least: Any
    largest: Any
    swept2: Any
    inverse_a: Any


@kernel(inline=True)
def apsides(mu, x, y, z, u, v, w):
    """Return the `Apsides` of a pair of total GM mu > 0 from its relative state, in numbers or `Lanes`. A fall along a
    line has e = 1 and the least distance 0.
    """
    cx, cy, cz = fma(y, w, -(z * v)), fma(z, u, -(x * w)), fma(x, v, -(y * u))
    swept2 = fma(cx, cx, fma(cy, cy, cz * cz))
    parameter, inverse_r = swept2 / mu, 1.0 / sqrt(fma(x, x, fma(y, y, z * z)))
    outwards = fma(x, u, fma(y, v, z * w)) * inverse_r
    e_cos_f = fma(parameter, inverse_r, -1.0)
    e = sqrt(fma(e_cos_f, e_cos_f, outwards * outwards * (parameter / mu)))
    inverse_a = fma(2.0, inverse_r, -(fma(u, u, fma(v, v, w * w)) / mu))
    largest = select(inverse_a > 0.0, minimum((1.0 + e) / maximum(inverse_a, 1e-300), OPEN), OPEN)
    return Apsides(e, parameter / (1.0 + e), largest, swept2, inverse_a)


@kernel
def _write_apsides(mu, q, v, out):
    """Write the `Apsides` of pairs into the rows of `out`, (5, n); mu : (n,) or (1,); q, v : (n, 3)."""
    every = 1 if mu.shape[0] > 1 else 0
    for k in range(q.shape[0]):
        found = apsides(mu[every * k], q[k, 0], q[k, 1], q[k, 2], v[k, 0], v[k, 1], v[k, 2])
        out[0, k], out[1, k], out[2, k], out[3, k], out[4, k] = found


def apsides_of(q: ArrayLike, v: ArrayLike, mu: ArrayLike) -> Apsides:
    """Return the `Apsides` of pairs as arrays (...): q, v : (..., 3), relative; mu : (...) or one for all, > 0.

    What is beyond the range of floats is not finite, also for a distance of 0; nothing is raised.
    """
    place, velocity = (np.ascontiguousarray(x, dtype=np.float64) for x in (q, v))
    shape, each = place.shape[:-1], np.ascontiguousarray(mu, dtype=np.float64)
    if each.size > 1 and each.shape != shape:
        each = np.ascontiguousarray(np.broadcast_to(each, shape))
    out = np.empty((len(Apsides._fields), *shape))
    _write_apsides(each.reshape(-1), place.reshape(-1, 3), velocity.reshape(-1, 3), out.reshape(len(out), -1))
    return Apsides(*out)
