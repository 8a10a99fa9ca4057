"""The constraints g(q) = 0 of a Lagrangian: values and derivatives, and whether a state satisfies them.

Motions satisfy g(q) = 0 and with it G(q) v = 0, G = dg/dq: velocities are tangent to the constraints. The constraints
are independent where G M^-1 G^T has an inverse, M being the mass matrix.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from orbits.errors import InputError
from orbits.kernels.binding import kernel_of
from orbits.lagrangians.base import CONSTRAINED, Array, Lagrangian, show

ROUNDING = 2.0**-44
"""Values of constraints below this, relative to |dg/dq| |q|, are rounding errors of a start."""

DEPENDENT = 1e-12
"""The least singular value of G M^-1 G^T, scaled, with which constraints are independent."""

ROUNDS = 50


def constraint_values(lagrangian: Lagrangian, q: ArrayLike) -> tuple[Array, Array]:
    """Return the constraints g(q), (m,), and their gradients G, (m, d). Raises InputError if there are none."""
    g, G, _ = _evaluated(lagrangian, lagrangian.vector(q, "q"))
    return g, G


def constraint_hessians(lagrangian: Lagrangian, q: ArrayLike) -> Array:
    """Return the second derivatives of the constraints, (m, d, d). Raises InputError if there are none."""
    _require_constraints(lagrangian)
    m, d = len(lagrangian.constraints), lagrangian.dimension
    out = np.empty(m * d * d)
    kernel_of(lagrangian.tag.type, "constraint_hessians")(lagrangian.parameter_vector, lagrangian.vector(q, "q"), out)
    return out.reshape(m, d, d)


def directions(lagrangian: Lagrangian, q: ArrayLike) -> Array:
    """Return G M^-1, (m, d): the directions in which forces keep the constraints."""
    return _evaluated(lagrangian, lagrangian.vector(q, "q"))[2]


def onto_constraints(lagrangian: Lagrangian, q: ArrayLike, v: ArrayLike) -> tuple[Array, Array]:
    """Return the state (q, v) moved onto the constraints, g(q) = 0, with a velocity tangent to them, each (d,).

    Positions are moved along M^-1 G^T, by Newton's method; of the velocity, the part of least kinetic energy that leads
    off the constraints is removed: linear and angular momentum are kept where the constraints have these symmetries.
    Raises InputError for a Lagrangian without constraints, and if no point of them is found near q.

        q, v = orbits.lagrangians.onto_constraints(dumbbell, q=[1, 0, 0, 1.1, 0, 0], v=[0, 1, 0, 0, 1, 0])
    """
    x, w = lagrangian.vector(q, "q"), lagrangian.vector(v, "v")
    last = np.inf
    for _ in range(ROUNDS):
        g, G, W = _evaluated(lagrangian, x)
        change = W.T @ _solved(lagrangian, G @ W.T, g, x)
        x = x - change
        size = float(np.max(np.abs(change)))
        if not np.isfinite(size):
            break
        if size == 0.0 or (size >= 0.5 * last and size <= 1e-10 * float(np.max(np.abs(x)))):
            _, G, W = _evaluated(lagrangian, x)
            for _ in range(2):  # the second removes the rounding errors of the first
                w = w - W.T @ _solved(lagrangian, G @ W.T, G @ w, x)
            return x, w
        last = size
    raise InputError(
        f"'{lagrangian.name}': Newton's method finds no point of the constraints {_named(lagrangian)} near q = "
        f"{show(lagrangian.vector(q, 'q'))}; start closer to them."
    )


def require_on_constraints(lagrangian: Lagrangian, q: Array, p: Array, h: float) -> None:
    """Raise InputError unless q is on the constraints, p / M tangent to them, and the constraints independent.

    h : the step that follows, over which the rounding of positions is also one of velocities
    """
    g, G, W = _evaluated(lagrangian, q)
    size = np.sqrt(np.sum(G * G, axis=1))
    _solved(lagrangian, G @ W.T, g, q)
    # A length that the gradient turns into a distance.
    off = np.abs(g) > ROUNDING * size * float(np.sqrt(q @ q))
    remedy = "orbits.lagrangians.onto_constraints(L, q, v) returns the state moved onto the constraints."
    if np.any(off):
        k = int(np.argmax(off))
        raise InputError(
            f"'{lagrangian.name}': the start is off the constraint {lagrangian.constraints[k]} = 0: it is {g[k]:.6g} "
            f"at q = {show(q)}, which is about {abs(g[k]) / size[k]:.3g} away from it. Expected a start with all "
            f"constraints 0 but for rounding; {remedy}"
        )
    mass = lagrangian.hessians(q, np.zeros_like(q))[2]
    v = lagrangian.solve_mass(mass, p, q)
    leads, speed = np.abs(G @ v) / size, float(np.sqrt(v @ v))
    # A state of a march may be at rest but for rounding, as a pendulum where it turns.
    if np.any(leads > ROUNDING * max(speed, float(np.sqrt(q @ q)) / abs(h))):
        k = int(np.argmax(leads))
        raise InputError(
            f"'{lagrangian.name}': the velocity v = {show(v)} leads off the constraint {lagrangian.constraints[k]} = 0 "
            f"with the speed {leads[k]:.3g}, {leads[k] / speed:.3g} of its own. Expected one tangent to all "
            f"constraints; {remedy}"
        )


def _evaluated(lagrangian: Lagrangian, q: Array) -> tuple[Array, Array, Array]:
    """Return g, G and G M^-1 at q."""
    _require_constraints(lagrangian)
    m, d = len(lagrangian.constraints), lagrangian.dimension
    out = np.empty(m + 2 * m * d)
    kernel_of(lagrangian.tag.type, "constraints")(lagrangian.parameter_vector, q, out)
    if not np.all(np.isfinite(out)):
        raise InputError(
            f"'{lagrangian.name}': the constraints {_named(lagrangian)} or their gradients are not finite at q = "
            f"{show(q)}. Start elsewhere."
        )
    return out[:m], out[m : m + m * d].reshape(m, d), out[m + m * d :].reshape(m, d)


def _solved(lagrangian: Lagrangian, matrix: Array, right: Array, q: Array) -> Array:
    """Return matrix^-1 right, matrix being G M^-1 G^T. Raises InputError if the constraints are dependent."""
    size = np.sqrt(np.diag(matrix))
    even = matrix / np.where(size > 0.0, size, 1.0)[:, None] / np.where(size > 0.0, size, 1.0)
    least = np.linalg.svd(even, compute_uv=False)[-1]
    if not (least > DEPENDENT and np.all(size > 0.0)):
        raise InputError(
            f"'{lagrangian.name}': the constraints {_named(lagrangian)} are dependent at q = {show(q)}: G M^-1 G^T = "
            f"{show(matrix)}, G being their gradients, has no inverse. Leave out those that follow from others, and "
            "start where the gradients do not vanish."
        )
    solved: Array = np.linalg.solve(even, right / size) / size
    return solved


def _named(lagrangian: Lagrangian) -> str:
    return ", ".join(f"{g} = 0" for g in lagrangian.constraints)


def _require_constraints(lagrangian: Lagrangian) -> None:
    if CONSTRAINED not in lagrangian.traits:
        raise InputError(
            f"'{lagrangian.name}' has no constraints. Expected a Lagrangian such as orbits.lagrangians.dumbbell, or of "
            "orbits.Lagrangian.from_sympy(..., constraints=[...])."
        )
