"""Newtonian N-body problem: n massive bodies, and massless particles in their field.

    L(q, v) = sum_i m_i |v_i|^2 / 2 + sum_{i<j} G m_i m_j / sqrt(|q_i - q_j|^2 + eps^2)

A massless particle at x has its own Lagrangian per unit mass, |x'|^2 / 2 + sum_j G m_j / sqrt(|x - q_j(t)|^2 + eps^2),
in which the massive bodies are given functions of time.

Parameters: eps^2, then GM of each massive body. Any units in which GM is length^3 / time^2.
Source: Hairer, Lubich & Wanner (2006), sec. I.2.4; Plummer (1911) for the softening eps.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from orbits.kernels.binding import Tag
from orbits.kernels.gravity import attraction, body_accelerations, pair_accelerations
from orbits.lagrangians.base import MASSLESS_PARTICLES, SEPARABLE, Lagrangian

newtonian = Lagrangian(
    name="newtonian",
    formula="sum m v^2 / 2 + sum G m m' / sqrt(r^2 + eps^2)",
    tag=Tag(
        "newtonian",
        {"accelerate": body_accelerations, "accelerate_stages": pair_accelerations, "field": attraction},
    ),
    traits=frozenset({SEPARABLE, MASSLESS_PARTICLES}),
    symmetries=frozenset({"translation", "rotation"}),
    source="Hairer, Lubich & Wanner (2006), sec. I.2.4",
)


def parameters(gm: NDArray[np.float64], softening: float = 0.0) -> NDArray[np.float64]:
    """Return the parameter vector of the kernels: eps^2, then GM of the massive bodies."""
    return np.concatenate([[softening * softening], gm])
