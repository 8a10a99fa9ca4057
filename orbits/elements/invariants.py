"""Invariants of two-body motion from a state, computed without cancellation: they determine the orbit.

2 - r v^2/gm (which is r/a), r v^2/gm - 1 (e cos E), h^2/(gm r) - 1 (e cos f), q.v (e sin E) and q x v are all
differences. They are computed in double-double arithmetic and rounded once, so that each has all its digits however
close the orbit is to a circle, a parabola or the reference plane; the only uncertainty left is that of the state.
The state is first scaled by powers of two, which is exact, so that no square over- or underflows.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from orbits.diagnostics import doubledouble as dd
from orbits.elements.kepler_equation import Floats
from orbits.elements.refusals import EXTREME, NO_DISTANCE, NO_MASS, RECTILINEAR, broadcast, refuse

# Below this |q x v|/(|q| |v|), rounding alone determines the orbital plane.
INDISTINCT = 4.0 * np.finfo(np.float64).eps
# v may differ from the circular velocity by this power of two: its sixth power must be a float.
MOST_OCTAVES = 160

Exponents = NDArray[np.intc]


class Motion(NamedTuple):
    """A state and its invariants, arrays of shape (...), in units of 2^length and 2^speed of its own."""

    q: Floats  # (..., 3)
    v: Floats  # (..., 3)
    gm: Floats
    r: Floats
    qv: Floats
    h: Floats  # q x v, (..., 3)
    h_size: Floats
    p: Floats  # h^2/gm
    e_cos_f: Floats
    e_cos_E: Floats  # or e cosh F
    binding: Floats  # r/a
    length: Exponents
    speed: Exponents

    @property
    def time(self) -> Exponents:
        """The exponent of the unit of time."""
        return self.length - self.speed


def measured(q: Floats, v: Floats, gm: Floats, t: Floats, names: Sequence[str] | None) -> tuple[Motion, Floats]:
    """Return the motion of finite states q and v (..., 3) about gm (...), and t, broadcast to its shape.

    Raises InputError, naming the body, for gm <= 0, q = 0 and a rectilinear orbit.
    """
    first, _, gm, t = broadcast(names, q=q[..., 0], v=v[..., 0], gm=gm, t=t)
    q, v = np.broadcast_to(q, (*first.shape, 3)), np.broadcast_to(v, (*first.shape, 3))
    refuse(gm <= 0.0, NO_MASS, names, gm=gm)
    largest = np.max(np.abs(q), axis=-1)
    refuse(largest == 0.0, NO_DISTANCE, names)
    length = np.frexp(largest)[1]
    speed = (np.frexp(gm)[1] - length) // 2
    q, fastest = scaled(q, -length[..., None]), np.max(np.abs(v), axis=-1)
    refuse(fastest == 0.0, RECTILINEAR, names, h=fastest)
    octaves = np.frexp(fastest)[1] - speed
    refuse(np.abs(octaves) > MOST_OCTAVES, EXTREME, names, octaves=octaves)
    v, gm = scaled(v, -speed[..., None]), scaled(gm, -length - 2 * speed)

    # Operations of one kind are stacked: for a single state the cost is that of calls, not of arithmetic.
    squares = dd.total(dd.two_product(np.stack([q, v, q]), np.stack([q, v, v])))
    r2_, v2_, qv_ = (dd.Pair(squares.hi[i], squares.lo[i]) for i in range(3))
    ahead, behind = [1, 2, 0], [2, 0, 1]
    h_ = dd.subtract(dd.two_product(q[..., ahead], v[..., behind]), dd.two_product(q[..., behind], v[..., ahead]))
    h2_, r_ = dd.total(dd.multiply(h_, h_)), dd.multiply(r2_, dd.reciprocal_root(r2_))
    one, gm_ = dd.Pair(np.ones_like(gm), np.zeros_like(gm)), dd.Pair(gm, np.zeros_like(gm))
    rv2_ = dd.multiply(r_, v2_)
    vis_viva, p_ = (dd.divide(part, gm_) for part in (rv2_, h2_))
    r, p, h = r_.rounded(), p_.rounded(), h_.rounded()
    h_size = np.sqrt(p * gm)
    # The size in the caller's units is for the message only, where an overflow to inf does no harm.
    with np.errstate(over="ignore", under="ignore"):
        shown = np.ldexp(h_size, length + speed)
    refuse(h_size <= INDISTINCT * r * np.linalg.norm(v, axis=-1), RECTILINEAR, names, h=shown)
    e_cos_E = dd.subtract(vis_viva, one).rounded()
    binding = dd.subtract(dd.Pair(2.0 * one.hi, one.lo), vis_viva).rounded()
    e_cos_f = dd.subtract(dd.divide(p_, r_), one).rounded()
    return Motion(q, v, gm, r, qv_.rounded(), h, h_size, p, e_cos_f, e_cos_E, binding, length, speed), t


def scaled(x: Floats, exponent: ArrayLike) -> Floats:
    """Return x 2^exponent; infinite or 0 beyond the range of floats."""
    with np.errstate(over="ignore", under="ignore"):
        return np.asarray(np.ldexp(x, exponent))
