"""Newtonian N-body problem: n massive bodies, and massless particles in their field.

    L(q, v) = sum_i m_i |v_i|^2 / 2 + sum_{i<j} G m_i m_j / sqrt(|q_i - q_j|^2 + eps^2)

A massless particle at x has its own Lagrangian per unit mass, |x'|^2 / 2 + sum_j G m_j / sqrt(|x - q_j(t)|^2 + eps^2),
in which the massive bodies are given functions of time.

Parameters: eps^2, then GM of each massive body. Any units in which GM is length^3 / time^2. Quantities
proportional to masses (L, momenta, energy) are multiplied by G, as GM is what is known.
Source: Hairer, Lubich & Wanner (2006), sec. I.2.4; Plummer (1911) for the softening eps.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from orbits.errors import InputError
from orbits.kernels.binding import Tag
from orbits.kernels.compile import kernel
from orbits.kernels.fine_gravity import fine_pair_accelerations
from orbits.kernels.gravity import (
    attraction,
    body_accelerations,
    close_attraction,
    close_pair_accelerations,
    dynamical_rate,
    gross_attraction,
    gross_field,
    pair_accelerations,
    pair_potential,
    pair_tides,
    share_of_accelerations,
)
from orbits.kernels.lanes import get, put, sqrt
from orbits.lagrangians.base import (
    ABOUT_ONE_BODY,
    GRADIENTS,
    MASSLESS_PARTICLES,
    NEWTONIAN,
    SEPARABLE,
    Compiled,
    Lagrangian,
    Motion,
)
from orbits.lagrangians.symmetry import Symmetry, boost, rotation, translation
from orbits.lagrangians.terms.base import Summand, SumOfTerms, compiled_sum, kept


@kernel(inline=True)
def dimension(parameters):
    """Return 3 n."""
    return 3 * (parameters.shape[0] - 1)


@kernel(inline=True)
def bodies(parameters):
    """Return n."""
    return parameters.shape[0] - 1


@kernel
def value(parameters, t, q, v):
    """Return L; float64, or lanes for q, v of shape (3n, 8)."""
    n = parameters.shape[0] - 1
    kinetic = get(v, 0) * 0.0
    for k in range(3 * n):
        kinetic = kinetic + parameters[1 + k % n] * get(v, k) * get(v, k)
    return 0.5 * kinetic - pair_potential(parameters, q)


@kernel
def gradients(parameters, t, q, v, f, p):
    """Write the forces GM g(q) into f and the momenta GM v into p."""
    n = parameters.shape[0] - 1
    pair_accelerations(parameters, q, f)
    for k in range(3 * n):
        gm = parameters[1 + k % n]
        put(f, k, gm * get(f, k))
        put(p, k, gm * get(v, k))


@kernel
def hessians(parameters, t, q, v, out):
    """Write the tidal matrix, zeros, and the diagonal matrix of GM."""
    n = parameters.shape[0] - 1
    d = 3 * n
    zero = get(q, 0) * 0.0
    for k in range(3 * d * d):
        put(out, k, zero)
    for k in range(d):
        put(out, 2 * d * d + k * d + k, zero + parameters[1 + k % n])
    for i in range(n):
        for j in range(i + 1, n):
            dx, dy, dz = get(q, j) - get(q, i), get(q, n + j) - get(q, n + i), get(q, 2 * n + j) - get(q, 2 * n + i)
            r2 = dx * dx + dy * dy + dz * dz + parameters[0]
            w = parameters[1 + i] * parameters[1 + j] / (r2 * sqrt(r2))
            for a in range(3):
                da = dx if a == 0 else (dy if a == 1 else dz)
                for b in range(3):
                    db = dx if b == 0 else (dy if b == 1 else dz)
                    tide = w * (3.0 * da * db / r2 - (1.0 if a == b else 0.0))
                    ii, jj = (a * n + i) * d + b * n + i, (a * n + j) * d + b * n + j
                    ij, ji = (a * n + i) * d + b * n + j, (a * n + j) * d + b * n + i
                    put(out, ii, get(out, ii) + tide)
                    put(out, jj, get(out, jj) + tide)
                    put(out, ij, get(out, ij) - tide)
                    put(out, ji, get(out, ji) - tide)


@kernel
def particle_gradients(parameters, t, sources, speeds, place, velocity):
    """Return the acceleration and the velocity of a massless particle, dL/dx and dL/dv of its own Lagrangian."""
    fx, fy, fz = attraction(parameters, sources, place[0], place[1], place[2])
    return fx, fy, fz, velocity[0], velocity[1], velocity[2]


def _compiled() -> Compiled:
    kernels = {
        "dimension": dimension,
        "bodies": bodies,
        "value": value,
        "gradients": gradients,
        "hessians": hessians,
        "accelerate": body_accelerations,
        "accelerate_some": share_of_accelerations,
        "accelerate_stages": pair_accelerations,
        "accelerate_close": close_pair_accelerations,
        "accelerate_finely": fine_pair_accelerations,
        "dynamical_rate": dynamical_rate,
        "gross_attraction": gross_attraction,
        "tides": pair_tides,
        "field": attraction,
        "field_close": close_attraction,
        "gross_field": gross_field,
        "particle_gradients": particle_gradients,
    }
    traits = frozenset({SEPARABLE, MASSLESS_PARTICLES, GRADIENTS, NEWTONIAN, ABOUT_ONE_BODY})
    return Compiled(Tag("newtonian", kernels), traits)


def parameters(gm: NDArray[np.float64], softening: float = 0.0) -> NDArray[np.float64]:
    """Return the parameter vector of the kernels: eps^2, then GM of the massive bodies."""
    return np.concatenate([[softening * softening], gm])


def symmetries(parameters: Mapping[str, float]) -> tuple[Symmetry, ...]:
    """Return the translations and boosts along and the rotations about the three axes."""
    axes = dict(zip("xyz", np.eye(3), strict=True))
    gm = [value for name, value in parameters.items() if name.startswith("GM")]
    bodies = len(gm)
    return (
        *(translation(u, copies=bodies, name=f"translation along {x}") for x, u in axes.items()),
        *(boost(u, gm, name=f"boost along {x}") for x, u in axes.items()),
        *(rotation(u, copies=bodies, name=f"rotation about {x}") for x, u in axes.items()),
    )


# A star, an inner planet on an eccentric orbit and an outer one: nonlinear, not integrable, not coplanar.
_GM = (1.0, 1e-2, 3e-3)
_EXAMPLE = Motion(
    q=(0.0, 0.0, 0.0, 0.7, 0.1, 0.05, -1.5, 0.4, -0.2),
    v=(0.0, 0.0, 0.0, -0.1, 1.3, 0.1, -0.2, -0.7, 0.15),
    dt=0.15,
)


def _coordinates(bodies: int) -> tuple[str, ...]:
    return tuple(f"{x}{i + 1}" for i in range(bodies) for x in "xyz")


def _order(bodies: int) -> tuple[int, ...]:
    """The kernels hold all x, then all y, then all z."""
    return tuple(3 * body + axis for axis in range(3) for body in range(bodies))


newtonian = Lagrangian(
    name="newtonian",
    formula="sum m v^2 / 2 + sum G m m' / sqrt(r^2 + eps^2)",
    coordinates=_coordinates(len(_GM)),
    parameters={"eps2": 0.0, **{f"GM{i + 1}": gm for i, gm in enumerate(_GM)}},
    compile=_compiled,
    example=_EXAMPLE,
    groups=symmetries,
    source="Hairer, Lubich & Wanner (2006), sec. I.2.4",
    order=_order(len(_GM)),
)


def n_body(gm: ArrayLike, softening: float = 0.0, terms: Sequence[Summand] = ()) -> Lagrangian:
    """Return the Lagrangian of n bodies with these GM, all > 0; coordinates x, y, z of each body in turn.

    gm : (n,), length^3 / time^2; softening : Plummer's eps, length
    terms : terms added to kinetic energy and attraction, see `orbits.lagrangians.terms`
    Raises InputError for a GM that is not positive: a massless particle has a Lagrangian of its own.
    """
    values = np.atleast_1d(np.asarray(gm, dtype=np.float64))
    if values.ndim != 1 or not np.all(values > 0.0) or not np.all(np.isfinite(values)):
        raise InputError(
            "the N-body Lagrangian is that of the massive bodies, all GM > 0 and finite; leave the massless ones out"
        )
    n = len(values)
    newton = newtonian.compiled
    made = replace(
        newtonian,
        coordinates=_coordinates(n),
        parameters={"eps2": softening * softening, **{f"GM{i + 1}": float(g) for i, g in enumerate(values)}},
        compile=lambda: newton,
        example=None,
        order=_order(n),
    )
    if not terms:
        return made
    whole = compiled_sum(newton, terms)
    return SumOfTerms(
        name=" + ".join(["newtonian", *(term.name for term in terms)]),
        formula=" + ".join([newtonian.formula, *(term.formula for term in terms)]),
        coordinates=made.coordinates,
        parameters=made.parameters,
        compile=lambda: whole,
        example=None,
        groups=lambda known: kept(symmetries(known), terms, n),
        source=newtonian.source,
        order=made.order,
        summands=tuple(terms),
    )
