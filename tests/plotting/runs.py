"""Runs that need no integration: massless bodies about one star move exactly as two bodies do."""

from __future__ import annotations

import numpy as np

import orbits
from orbits.elements.kepler_flow import kepler_flow

MERGING = {
    "star": {"gm": 1.0, "radius": 0.05},
    "a": {"a": 1.0, "e": 0.1, "gm": 1e-6, "radius": 0.05},
    "b": {"a": 1.1, "e": 0.1, "gm": 2e-6, "radius": 0.05, "l": 1.0, "pomega": 3.0},
    "grain": {"a": 2.5, "gm": 0.0, "radius": 0.0},
}
"""A star, two planets that merge at t = 10.37, and a grain."""


def about_a_star(bodies, times, *, units=orbits.DIMENSIONLESS, epoch=None, method=None):
    """Return the run of massless `bodies`, elements by name, about a star of GM 1, or about the Sun where units are
    physical.
    """
    star = "star" if units == orbits.DIMENSIONLESS else "Sun"
    gm = 1.0 if units == orbits.DIMENSIONLESS else orbits.System.solar_system(bodies=["Sun"]).values.gm[0]
    massless = {name: {"gm": 0.0, **elements} for name, elements in bodies.items()}
    system = orbits.System.from_elements({star: {"gm": gm}, **massless}, units=units, epoch=epoch)
    _, q, v, _ = system.values
    times = np.asarray(times, dtype=float)
    paths = [kepler_flow(q[i] - q[0], v[i] - v[0], gm, times) for i in range(1, len(system))]
    still = np.zeros((len(times), 1, 3))
    all_q, all_v = (np.concatenate([still, *(path[k][:, None] for path in paths)], axis=1) for k in (0, 1))
    return orbits.Trajectory(
        system.replaced(q=all_q[0], v=all_v[0]), times, all_q, all_v, step=float(np.sign(times[-1])),
        integrator=method or orbits.Gauss(stages=8),
    )  # fmt: skip
