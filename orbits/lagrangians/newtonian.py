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
from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from orbits.errors import InputError
from orbits.kernels.binding import Tag
from orbits.kernels.compile import kernel
from orbits.kernels.gravity.fine_pair_sums import add_fine_pair_accelerations
from orbits.kernels.gravity.pair_sums import (
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
from orbits.kernels.lanes import get, put
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
from orbits.lagrangians.terms.pairs import add_pair_tide


@kernel(inline=True)
def dimension(parameters):
    """Return 3 n."""
    return 3 * (parameters.shape[0] - 1)


@kernel(inline=True)
def bodies(parameters):
    """Return n."""
    return parameters.shape[0] - 1


@kernel
def free_value(parameters, t, q, v):
    """Return the kinetic energy."""
    n = parameters.shape[0] - 1
    kinetic = get(v, 0) * 0.0
    for k in range(3 * n):
        kinetic = kinetic + parameters[1 + k % n] * get(v, k) * get(v, k)
    return 0.5 * kinetic


@kernel
def free_gradients(parameters, t, q, v, f, p):
    """Write zeros into f and the momenta GM v into p."""
    n = parameters.shape[0] - 1
    for k in range(3 * n):
        put(f, k, get(q, k) * 0.0)
        put(p, k, parameters[1 + k % n] * get(v, k))


@kernel
def free_hessians(parameters, t, q, v, out):
    """Write zeros, and the diagonal matrix of GM."""
    n = parameters.shape[0] - 1
    d = 3 * n
    zero = get(q, 0) * 0.0
    for k in range(3 * d * d):
        put(out, k, zero)
    for k in range(d):
        put(out, 2 * d * d + k * d + k, zero + parameters[1 + k % n])


@kernel
def free_accelerations(parameters, q, out):
    """Write zeros."""
    for k in range(3 * (parameters.shape[0] - 1)):
        put(out, k, get(q, k) * 0.0)


@kernel
def some_free_accelerations(parameters, q, out, start, stop):
    """Write zeros for bodies start ... stop - 1."""
    n = parameters.shape[0] - 1
    for i in range(start, stop):
        put(out, i, get(q, i) * 0.0)
        put(out, n + i, get(q, i) * 0.0)
        put(out, 2 * n + i, get(q, i) * 0.0)


@kernel
def free_tides(parameters, q, some, out):
    """Write zeros."""
    for a in range(out.shape[0]):
        for b in range(out.shape[1]):
            out[a, b] = 0.0


@kernel
def value(parameters, t, q, v):
    """Return L; float64, or lanes for q, v of shape (3n, 8)."""
    return free_value(parameters, t, q, v) - pair_potential(parameters, q)


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
    free_hessians(parameters, t, q, v, out)
    for i in range(n):
        for j in range(i + 1, n):
            add_pair_tide(parameters, 1.0, q, i, j, out)


@kernel
def particle_gradients(parameters, t, sources, speeds, place, velocity):
    """Return the acceleration and the velocity of a massless particle, dL/dx and dL/dv of its own Lagrangian."""
    fx, fy, fz = attraction(parameters, sources, place[0], place[1], place[2])
    return fx, fy, fz, velocity[0], velocity[1], velocity[2]


@cache
def _compiled() -> tuple[Compiled, Compiled]:
    """Return Newton's Lagrangian, and its kinetic energy alone."""
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
        "add_finely": add_fine_pair_accelerations,
        "dynamical_rate": dynamical_rate,
        "gross_attraction": gross_attraction,
        "tides": pair_tides,
        "field": attraction,
        "field_close": close_attraction,
        "gross_field": gross_field,
        "particle_gradients": particle_gradients,
    }
    traits = frozenset({SEPARABLE, MASSLESS_PARTICLES, GRADIENTS, NEWTONIAN, ABOUT_ONE_BODY})
    # The kinetic energy alone, to which a term adds the attraction of some pairs; massless particles are attracted by
    # all bodies, and clocks choose steps as for these.
    free = {
        **{name: kernels[name] for name in ("dimension", "bodies", "dynamical_rate", "gross_attraction")},
        **{name: kernels[name] for name in ("field", "field_close", "gross_field", "particle_gradients")},
        "value": free_value,
        "gradients": free_gradients,
        "hessians": free_hessians,
        "accelerate": free_accelerations,
        "accelerate_some": some_free_accelerations,
        "accelerate_stages": free_accelerations,
        "tides": free_tides,
    }
    return Compiled(Tag("newtonian", kernels), traits), Compiled(Tag("free-bodies", free), traits)


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
    compile=lambda: _compiled()[0],
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
    some = any(term.beside_newton is not None for term in terms)
    whole = compiled_sum(_compiled()[1] if some else newton, terms)
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
