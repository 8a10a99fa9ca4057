"""The energy of the massive bodies, from sampled states."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from orbits.diagnostics.doubledouble import Floats, Pair, dot, scale, subtract, total, two_product
from orbits.diagnostics.states import blocks, massive_rows
from orbits.errors import InputError, shown


def energy(gm: ArrayLike, q: ArrayLike, v: ArrayLike, softening: float = 0.0) -> Floats:
    """G times the energy, sum gm v^2 / 2 - sum_{i<j} gm_i gm_j / sqrt(r_ij^2 + softening^2).

    gm : (n,) length^3/time^2; massless bodies (gm = 0) do not count
    q, v : (..., n, 3) length and length/time
    softening : length, >= 0
    Returns (...), length^5/time^4: divide by G for an energy.

    Every sum and product is a double-double one, so the value is the float64 nearest to the energy of exactly these
    numbers: what drifts in it drifts in the states.
    Raises InputError for shapes that do not fit.
    """
    gm_massive, (q_massive, v_massive) = massive_rows(gm, q=q, v=v)
    if not (math.isfinite(softening) and softening >= 0):
        raise InputError(f"softening is {shown(softening)}; expected a finite length >= 0.")
    shape = q_massive.shape[:-2]
    q_flat, v_flat = (x.reshape((-1, *x.shape[-2:])) for x in (q_massive, v_massive))
    out = np.empty(len(q_flat))
    for block in blocks(len(q_flat), len(gm_massive)):
        kinetic = total(scale(dot(v_flat[block], v_flat[block]), 0.5 * gm_massive))
        out[block] = subtract(kinetic, _attraction(gm_massive, q_flat[block], softening)).rounded()
    return out.reshape(shape)


def _attraction(gm: Floats, q: Floats, softening: float) -> Pair:
    """Sum over i < j of gm_i gm_j / sqrt(r_ij^2 + softening^2) of q (samples, m, 3): shape (samples,)."""
    from orbits.kernels.lanes import WIDTH
    from orbits.kernels.potential import doubled_attraction

    samples, bodies = q.shape[:2]
    result = Pair(np.empty(samples), np.empty(samples))
    squared = two_product(np.float64(softening), np.float64(softening))  # type: ignore[arg-type]
    padded_gm, axes = np.zeros(bodies + WIDTH), np.full((3, bodies + WIDTH), np.inf)
    padded_gm[:bodies] = gm
    for k in range(samples):
        axes[:, :bodies] = q[k].T
        result.hi[k], result.lo[k] = doubled_attraction(padded_gm, axes, float(squared.hi), float(squared.lo))
    return result
