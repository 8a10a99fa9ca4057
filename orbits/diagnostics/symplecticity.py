"""Symplecticity of the compiled step: |M^T J M - J| for the massive bodies, and for each massless particle on its own.

M is the derivative of one step, by central differences of eighth order. States are in doubled precision, so that
differences of nearly equal states keep their digits, and each body is displaced in proportion to its distance from the
nearest other one. (Certificates use the exact derivative of the method's tableau instead; this module measures what is
actually computed, and serves methods without a tableau.)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from orbits.diagnostics.doubledouble import Floats, subtract
from orbits.diagnostics.stepping import Bodies, StepMap, reach

if TYPE_CHECKING:
    from orbits.integrators.base import Integrator
    from orbits.lagrangians.terms.base import Summand

_WEIGHTS = {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}
_DISPLACEMENT = 2.0**-8
"""Displacement of a body over its distance from the nearest one. Its eighth power is 5e-20; the truncation error of a
derivative of 1/r^2 is some thousand times that."""


_TINY = 1e-30
"""GM of a body that attracts nothing."""


@dataclass(frozen=True, eq=False)
class Symplecticity:
    """Defects of one step, in coordinates sqrt(gm) (q, v dt), which give all bodies equal weight.

    massive : the largest |M^T J M - J| of the massive bodies, over |M|^2 where that exceeds 1
    particles : (m,), the same for the map of each massless particle's (q, v) with the massive bodies given
    noise : uncertainty of the derivatives: how far they change when the displacements are halved
    """

    massive: float
    particles: Floats
    noise: float


def symplecticity(
    gm: ArrayLike,
    q: ArrayLike,
    v: ArrayLike,
    integrator: Integrator,
    dt: float,
    *,
    softening: float = 0.0,
    terms: Sequence[Summand] = (),
) -> Symplecticity:
    """Measure whether one step of dt is symplectic on these bodies.

    gm (n,), q and v (n, 3) : float64 in one system of units
    terms : of the Lagrangian, bound to the massive bodies (`orbits.lagrangians.terms`); momenta are then dL/dv
    The joint map of massive bodies and particles is not measured: it is not symplectic, as particles attract nothing.
    Raises InputError for bodies or steps that cannot be marched, IntegrationError for a step that fails.
    Source: Hairer, Lubich & Wanner (2006), sec. VI.2.
    """
    from orbits.diagnostics.tangent import symplecticity_defect

    bodies = replace(Bodies.of(gm, q, v, softening), terms=tuple(terms))
    radii, massive = reach(bodies), bodies.massive
    noise, states = 0.0, [(bodies.q, bodies.v)]
    if terms:
        marcher = bodies.marcher(integrator, dt)
        marcher.advance(1)
        states.append(marcher.state())

    def defects(weights: Floats, radii: Floats, *, particles: bool) -> list[float]:
        nonlocal noise
        step = StepMap(bodies, integrator, dt, particles=particles)
        coarse, fine = (_derivatives(step, radii * size, dt, joint=not particles) for size in (1.0, 0.5))
        found = []
        for k, (one, other) in enumerate(zip(coarse, fine, strict=True)):
            scale = np.concatenate([np.sqrt(weights), np.sqrt(weights)])
            noise = max(noise, float(np.max(np.abs(scale[:, None] * (one - other) / scale))))
            d = len(weights)
            canonical = one.copy()  # of (q, p) with p = gm v dt
            canonical[d:] *= weights[:, None]
            canonical[:, d:] /= weights
            if terms:
                before, after = (_momenta(bodies, x, w, dt, k if particles else None) for x, w in states)
                canonical = after @ canonical @ np.linalg.inv(before)
            found.append(symplecticity_defect(canonical, np.sqrt(weights)))
        return found

    (whole,) = defects(np.repeat(bodies.gm[massive], 3), radii[massive], particles=False)
    fibres = defects(np.ones(3), radii[~massive], particles=True) if not massive.all() else []
    return Symplecticity(whole, np.array(fibres), noise)


def _momenta(bodies: Bodies, q: Floats, v: Floats, dt: float, particle: int | None) -> Floats:
    """Return the derivative of (q, p dt) by (q, gm v dt), of the massive bodies or of one massless particle."""
    from orbits.lagrangians.newtonian import n_body

    massive, gm = bodies.massive, bodies.gm[bodies.massive]
    x, w = q[massive], v[massive]
    if particle is not None:
        one = np.flatnonzero(~massive)[particle]
        gm, x, w = np.append(gm, _TINY), np.vstack([x, q[one]]), np.vstack([w, v[one]])
    _, mixed, mass = n_body(gm, bodies.softening, bodies.terms).hessians(x.ravel(), w.ravel())
    if particle is not None:
        gm, mixed, mass = np.ones(1), mixed[-3:, -3:] / _TINY, mass[-3:, -3:] / _TINY
    d = 3 * len(gm)
    found = np.eye(2 * d)
    found[d:, :d], found[d:, d:] = dt * mixed.T, mass / np.repeat(gm, 3)
    return found


def _derivatives(step: StepMap, radii: Floats, dt: float, *, joint: bool) -> list[Floats]:
    """Return the derivative of `step` in (q, v dt): one (6n, 6n) matrix if `joint`, else one (6, 6) for each body."""
    n = len(radii)
    size = 3 * n if joint else 3
    columns = []
    for k in range(2 * size):
        axis = k % 3
        moved = np.array([k % size // 3]) if joint else np.arange(n)
        delta = _power_of_two(_DISPLACEMENT * radii[moved])
        column = np.zeros((2, n, 3))
        for m, weight in _WEIGHTS.items():
            displacement = np.zeros((2, n, 3))
            displacement[k // size, moved, axis] = m * delta / (1.0 if k < size else abs(dt))
            ahead, behind = step(*displacement), step(*(-displacement))
            column += weight * subtract(ahead, behind).rounded()
        column[1] *= abs(dt)
        columns.append(column / (delta[0] if joint else delta[:, None]))
    stacked = np.array(columns)  # (2 size, 2, n, 3)
    if joint:
        return [stacked.reshape(2 * size, 2 * size).T]
    return [stacked[:, :, i].reshape(2 * size, 2 * size).T for i in range(n)]


def _power_of_two(x: Floats) -> Floats:
    return np.exp2(np.floor(np.log2(x)))
