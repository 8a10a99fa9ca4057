"""Linear and angular momentum, centre of mass and Noether charges of the massive bodies, from sampled states."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from orbits.diagnostics.arrays import balanced, blocks, massive_rows, scaled, unscaled
from orbits.diagnostics.doubledouble import Floats, Pair, divide, scale, subtract, total, two_product
from orbits.errors import InputError


class NoetherCharges(NamedTuple):
    """The momentum maps of translation and rotation, each (..., 3), times G."""

    linear: Floats
    angular: Floats


def linear_momentum(gm: ArrayLike, v: ArrayLike) -> Floats:
    """G times the linear momentum, sum gm v.

    gm : (n,) length^3/time^2; massless bodies are left out. v : (..., n, 3) length/time
    Returns (..., 3), length^4/time^3. Raises InputError for values that are not finite, shapes that do not fit, and a
    momentum beyond the range of floats.
    """
    gm_massive, (v_massive,) = massive_rows(gm, v=v)
    weights, (w,), power = balanced(gm_massive, v_massive)
    return unscaled(_weighted_sum(weights, w).rounded(), power, "the linear momentum")


def angular_momentum(gm: ArrayLike, q: ArrayLike, v: ArrayLike) -> Floats:
    """G times the angular momentum about the origin, sum gm q x v.

    gm : (n,) length^3/time^2; massless bodies are left out. q, v : (..., n, 3) length and length/time
    Returns (..., 3), length^5/time^3. Raises InputError for values that are not finite, shapes that do not fit, and a
    momentum beyond the range of floats.
    """
    gm_massive, (q_massive, v_massive) = massive_rows(gm, q=q, v=v)
    shape, samples = q_massive.shape[:-2], math.prod(q_massive.shape[:-2])
    weights, (x, w), power = balanced(gm_massive, q_massive, v_massive)
    q_flat, v_flat = (array.reshape((samples, len(weights), 3)) for array in (x, w))
    out = np.empty((samples, 3))
    for block in blocks(samples, len(weights)):
        q_axes, v_axes = (np.ascontiguousarray(np.moveaxis(x[block], -1, 0)) for x in (q_flat, v_flat))
        for axis in range(3):
            i, j = (axis + 1) % 3, (axis + 2) % 3
            moment = subtract(two_product(q_axes[i], v_axes[j]), two_product(q_axes[j], v_axes[i]))
            out[block, axis] = total(scale(moment, weights)).rounded()
    return unscaled(out.reshape((*shape, 3)), power, "the angular momentum")


def centre_of_mass(gm: ArrayLike, q: ArrayLike) -> Floats:
    """Centre of mass, sum gm q / sum gm.

    gm : (n,) length^3/time^2; massless bodies are left out. q : (..., n, 3) length, or velocities for its velocity
    Returns (..., 3), in the unit of q. Raises InputError for values that are not finite, shapes that do not fit, and
    bodies without any mass.
    """
    gm_massive, (q_massive,) = massive_rows(gm, q=q)
    if not len(gm_massive):
        raise InputError("no body has gm > 0, so there is no centre of mass; expected at least one massive body.")
    weights, (x,), power = balanced(gm_massive, q_massive)
    masses, m = scaled(gm_massive)
    whole = total(Pair(masses, np.zeros_like(masses)))
    return unscaled(divide(_weighted_sum(weights, x), whole).rounded(), power - m, "the centre of mass")


def noether_charges(gm: ArrayLike, q: ArrayLike, v: ArrayLike) -> NoetherCharges:
    """The momentum maps p_k . xi(q_k) of translation and rotation, from the momenta of the step itself.

    gm : (n,); q, v : (..., n, 3)
    v must be the step's own velocity, p_k = D2 L_d(q_{k-1}, q_k) over the mass, as sampled trajectories hold it. A p_k
    recomputed from stored positions has lost a factor of |q| / |dq| in relative precision.
    Source: Marsden & West (2001), 1.3.3.
    """
    return NoetherCharges(linear_momentum(gm, v), angular_momentum(gm, q, v))


def _weighted_sum(gm: Floats, x: Floats) -> Pair:
    """Sum of gm x over the bodies: (..., m, 3) to (..., 3)."""
    flat = x.reshape((math.prod(x.shape[:-2]), *x.shape[-2:]))
    hi, lo = np.empty((len(flat), 3)), np.empty((len(flat), 3))
    for block in blocks(len(flat), 3 * len(gm)):
        columns = np.ascontiguousarray(np.moveaxis(flat[block], -1, -2))
        hi[block], lo[block] = total(two_product(columns, gm))
    shape = (*x.shape[:-2], 3)
    return Pair(hi.reshape(shape), lo.reshape(shape))
