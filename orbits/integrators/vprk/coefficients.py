"""The coefficients of a variational partitioned Runge–Kutta method as its kernels want them, for one step length."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from orbits.integrators.base import Array
from orbits.kernels.lanes import WIDTH
from orbits.tableaux import SymplecticTableau

# Rows. From ETA on each entry is the first of eight: row j holds column j of a matrix, one stage in each lane.
HC, HC_LO, HB, REST, STAGES = 0, 1, 2, 3, 4
ETA, START, MU, MU_BAR, CONTINUATION = 5, 13, 21, 29, 37
ROWS = 45


def in_lanes(tableau: SymplecticTableau, h: float, ratio: float = 1.0) -> Array:
    """Return (ROWS, 8) for steps of h; lanes past the last stage repeat it with weight 0.

    h c is a pair of doubled precision; eta and mu stay unscaled, because h eta would be rounded once more.
    ratio : h over the step before, from whose stages the iteration starts
    """
    s = tableau.stages
    lane = np.minimum(np.arange(WIDTH), s - 1)
    out = np.zeros((ROWS, WIDTH))
    hc = h * tableau.nodes
    rounding = [float(Fraction(h) * Fraction(c) - Fraction(p)) for c, p in zip(tableau.nodes, hc, strict=True)]
    out[HC] = hc[lane]
    out[HC_LO] = np.array(rounding)[lane]
    out[HB, :s] = h * tableau.b
    out[REST] = tableau.one_minus_nodes[lane]
    out[STAGES] = s
    continuation = tableau.continued(ratio)
    ahead = ratio * tableau.b[:, None] * continuation / tableau.b[None, :]
    for first, matrix in (
        (ETA, tableau.eta),
        (START, tableau.eta @ ahead),
        (MU, tableau.mu),
        (MU_BAR, tableau.mu_bar),
        (CONTINUATION, continuation),
    ):
        out[first : first + s] = matrix[lane].T
    return out
