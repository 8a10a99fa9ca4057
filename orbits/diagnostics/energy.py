"""The energy of the massive bodies, from sampled states."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from orbits.checks import number_not_below_zero
from orbits.diagnostics.arrays import ORDINARY, balanced, blocks, massive_rows, scaled, unscaled
from orbits.diagnostics.doubledouble import Floats, Pair, dot, scale, subtract, total, two_product
from orbits.errors import InputError


def energy(gm: ArrayLike, q: ArrayLike, v: ArrayLike, softening: float = 0.0) -> Floats:
    """G times the energy, sum gm v^2 / 2 - sum_{i<j} gm_i gm_j / sqrt(r_ij^2 + softening^2).

    gm : (n,) length^3/time^2; massless bodies (gm = 0) are left out
    q, v : (..., n, 3) length and length/time
    softening : length, >= 0
    Returns (...), length^5/time^4: divide by G for an energy.

    All arithmetic is double-double, so the value is the float64 nearest to the energy of exactly these numbers: a
    drift of the value is a drift of the states.
    Raises InputError for values that are not finite, shapes that do not fit, two bodies at the same place without
    softening, and an energy beyond the range of floats.
    """
    gm_massive, (q_massive, v_massive) = massive_rows(gm, q=q, v=v)
    length = number_not_below_zero(softening, "softening")
    shape, samples = q_massive.shape[:-2], math.prod(q_massive.shape[:-2])
    weights, (w, _), kinetic_power = balanced(gm_massive, v_massive, v_massive)
    x, k = scaled(np.append(q_massive, length))
    length, x = float(x[-1]), x[:-1]
    masses, m = _scaled_by_pairs(gm_massive)
    q_flat, v_flat = (array.reshape((samples, len(weights), 3)) for array in (x, w))
    out = np.empty(samples)
    for block in blocks(samples, len(weights)):
        kinetic = total(scale(dot(v_flat[block], v_flat[block]), 0.5 * weights))
        attraction = _attraction(masses, q_flat[block], length)
        if np.isnan(attraction.hi).any():
            raise InputError(
                "two massive bodies are at the same place, or distances or masses differ by more than 145 powers of "
                "ten: the energy is beyond the range of floats. Expected bodies apart, or a softening."
            )
        # Kinetic and potential energy each have a unit of their own; exponents come last, so that nothing overflows.
        out[block] = _difference(kinetic, kinetic_power, attraction, 2 * m - k)
    return out.reshape(shape)


def _scaled_by_pairs(gm: Floats) -> tuple[Floats, int]:
    """Return gm / 2^m, which is exact, and m, such that the largest product of two of them is about 1."""
    largest = np.frexp(np.sort(gm)[-2:])[1]
    if not len(gm) or np.all(np.abs(largest) < ORDINARY):
        return gm, 0
    m = int(largest.sum()) // len(largest)
    with np.errstate(over="ignore"):
        return np.ldexp(gm, -m), m


def _difference(a: Pair, power_a: int, b: Pair, power_b: int) -> Floats:
    """Return a 2^power_a - b 2^power_b."""
    power = np.where(a.hi == 0.0, power_b, np.where(b.hi == 0.0, power_a, max(power_a, power_b)))
    a, b = (Pair(*(np.ldexp(x, k - power) for x in pair)) for pair, k in ((a, power_a), (b, power_b)))
    return unscaled(subtract(a, b).rounded(), power, "the energy")



def _attraction(gm: Floats, q: Floats, softening: float) -> Pair:
    """Sum of gm_i gm_j / sqrt(r_ij^2 + softening^2) over i < j: q (samples, m, 3) to (samples,).

    NaN where a distance is 0, or so small that its square loses digits.
    """
    from orbits.kernels.gravity.potential import doubled_attraction
    from orbits.kernels.lanes import WIDTH

    samples, bodies = q.shape[:2]
    result = Pair(np.empty(samples), np.empty(samples))
    squared = two_product(np.float64(softening), np.float64(softening))  # type: ignore[arg-type]
    padded_gm, axes = np.zeros(bodies + WIDTH), np.full((3, bodies + WIDTH), np.inf)
    padded_gm[:bodies] = gm
    for k in range(samples):
        axes[:, :bodies] = q[k].T
        result.hi[k], result.lo[k] = doubled_attraction(padded_gm, axes, float(squared.hi), float(squared.lo))
    return result
