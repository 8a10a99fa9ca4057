"""The other terms of a sum, and forces without a Lagrangian.

A `SumTag` can contain forces too; their parameter vectors then follow those of the terms. Missing parts add nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from numba.extending import intrinsic, overload

from orbits.kernels.binding import (
    OPTIONS,
    SumTag,
    SumType,
    Tag,
    add_forces,
    add_gradients,
    kernel_of,
    momenta_of_terms,
    other_terms,
    total_particle_force,
    total_particle_gradients,
)
from orbits.kernels.compile import kernel
from orbits.kernels.lanes import full, get, load, put, store, total
from orbits.kernels.summation import add_compensated

FIGURES = 7
"""The time integrals kept of a force: its work, its torque about the origin (3) and its impulse (3), times G."""


def acted_on(tag: Tag, parameters: Any, forces: Sequence[Any]) -> tuple[Tag, tuple[Any, ...]]:
    """Return the tag of the sum of a Lagrangian and forces, each with its `tag` and `parameters`, and its
    parameters.
    """
    terms = tag.terms if isinstance(tag, SumTag) else (tag,)
    vectors = parameters if isinstance(parameters, tuple) else (parameters,)
    return SumTag(terms, [force.tag for force in forces]), (*vectors, *(force.parameters for force in forces))


@intrinsic
def forces_of(typingctx, tags):
    """Return the tags of the forces of a sum."""
    return SumType(tags.forces)(tags), lambda context, builder, signature, arguments: context.get_dummy_value()


def add_terms(lagrangian, parameters, t, q, v, f, p):
    """Add dL/dq and dL/dv of all terms except the first to f and p; vectors, or rows of eight stages with t in
    `Lanes`.
    """
    raise NotImplementedError("add_terms() is for compiled code only")


@overload(add_terms, jit_options=OPTIONS)
def _add_terms(lagrangian, parameters, t, q, v, f, p):
    if len(lagrangian.terms) == 1:
        return lambda lagrangian, parameters, t, q, v, f, p: None

    def others(lagrangian, parameters, t, q, v, f, p):
        add_gradients(other_terms(lagrangian), parameters[0], parameters[1:], t, q, v, f, p)

    return others


def add_momenta(lagrangian, parameters, t, q, v, f, p):
    """Add dL/dv of all terms except the first to p, as `add_terms` does to the same accuracy; f is workspace."""
    raise NotImplementedError("add_momenta() is for compiled code only")


@overload(add_momenta, jit_options=OPTIONS)
def _add_momenta(lagrangian, parameters, t, q, v, f, p):
    if len(lagrangian.terms) == 1:
        return lambda lagrangian, parameters, t, q, v, f, p: None

    def others(lagrangian, parameters, t, q, v, f, p):
        momenta_of_terms(other_terms(lagrangian), parameters[0], parameters[1:], t, q, v, f, p)

    return others


def add_acting(lagrangian, parameters, t, q, v, f):
    """Add the forces of a sum to f; vectors, or rows of eight stages with t in `Lanes`."""
    raise NotImplementedError("add_acting() is for compiled code only")


@overload(add_acting, jit_options=OPTIONS)
def _add_acting(lagrangian, parameters, t, q, v, f):
    count = len(lagrangian.terms)
    if not lagrangian.forces:
        return lambda lagrangian, parameters, t, q, v, f: None

    def acting(lagrangian, parameters, t, q, v, f):
        add_forces(forces_of(lagrangian), parameters[0], parameters[count:], t, q, v, f)

    return acting


def particle_terms(lagrangian, parameters, t, sources, speeds, place, velocity):
    """Return the contributions of all terms except the first to dL/dx and dL/dv of a massless particle, six numbers."""
    raise NotImplementedError("particle_terms() is for compiled code only")


@overload(particle_terms, jit_options=OPTIONS)
def _particle_terms(lagrangian, parameters, t, sources, speeds, place, velocity):
    if len(lagrangian.terms) == 1:

        def nothing(lagrangian, parameters, t, sources, speeds, place, velocity):
            zero = place[0] * 0.0
            return zero, zero, zero, zero, zero, zero

        return nothing

    def others(lagrangian, parameters, t, sources, speeds, place, velocity):
        tags = other_terms(lagrangian)
        return total_particle_gradients(tags, parameters[0], parameters[1:], t, sources, speeds, place, velocity)

    return others


def particle_acting(lagrangian, parameters, t, particle, sources, speeds, place, velocity):
    """Return the force per unit mass on massless particle number `particle`, three numbers."""
    raise NotImplementedError("particle_acting() is for compiled code only")


@overload(particle_acting, jit_options=OPTIONS)
def _particle_acting(lagrangian, parameters, t, particle, sources, speeds, place, velocity):
    count = len(lagrangian.terms)
    if not lagrangian.forces:

        def nothing(lagrangian, parameters, t, particle, sources, speeds, place, velocity):
            zero = place[0] * 0.0
            return zero, zero, zero

        return nothing

    def acting(lagrangian, parameters, t, particle, sources, speeds, place, velocity):
        tags, own = forces_of(lagrangian), parameters[count:]
        return total_particle_force(tags, parameters[0], own, t, particle, sources, speeds, place, velocity)

    return acting


def account(lagrangian, parameters, t, weights, Q, V, rows, books):
    """Add the work, torque and impulse of each force of a sum on the massive bodies in a step to its two rows of
    `books`.

    t, weights : times of the stages and h b, `Lanes`; Q, V : (3n, 8) positions and velocities of the stages
    rows : (3n, 8), workspace; books : (2 forces, 8), for each force its `FIGURES` and their low parts
    """
    raise NotImplementedError("account() is for compiled code only")


@overload(account, jit_options=OPTIONS)
def _account(lagrangian, parameters, t, weights, Q, V, rows, books):
    count = len(lagrangian.terms)
    if not lagrangian.forces:
        return lambda lagrangian, parameters, t, weights, Q, V, rows, books: None

    def all_of_them(lagrangian, parameters, t, weights, Q, V, rows, books):
        _account_each(forces_of(lagrangian), parameters[0], parameters[count:], t, weights, Q, V, rows, books)

    return all_of_them


def _account_each(tags, strength, parameters, t, weights, Q, V, rows, books):
    raise NotImplementedError("this is for compiled code only")


@overload(_account_each, jit_options=OPTIONS)
def _choose(tags, strength, parameters, t, weights, Q, V, rows, books):
    force, last = kernel_of(tags.terms[0], "force"), len(tags.terms) == 1

    def one(tags, strength, parameters, t, weights, Q, V, rows, books):
        n = strength.shape[0] - 1
        for k in range(3 * n):
            put(rows, k, full(0.0))
        force(strength, parameters[0], t, Q, V, rows)
        _book(n, weights, Q, V, rows, books)

    def these(tags, strength, parameters, t, weights, Q, V, rows, books):
        n = strength.shape[0] - 1
        for k in range(3 * n):
            put(rows, k, full(0.0))
        force(strength, parameters[0], t, Q, V, rows)
        _book(n, weights, Q, V, rows, books)
        _account_each(other_terms(tags), strength, parameters[1:], t, weights, Q, V, rows, books[2:])

    return one if last else these


@kernel
def _book(n, weights, Q, V, f, books):
    """Add work, torque and impulse of the forces f at the stages to a pair of rows."""
    zero = full(0.0)
    work, tx, ty, tz, px, py, pz = zero, zero, zero, zero, zero, zero, zero
    for i in range(n):
        x, y, z = get(Q, i), get(Q, n + i), get(Q, 2 * n + i)
        fx, fy, fz = weights * get(f, i), weights * get(f, n + i), weights * get(f, 2 * n + i)
        work = work + (fx * get(V, i) + fy * get(V, n + i) + fz * get(V, 2 * n + i))
        tx, ty, tz = tx + (y * fz - z * fy), ty + (z * fx - x * fz), tz + (x * fy - y * fx)
        px, py, pz = px + fx, py + fy, pz + fz
    new = f[0]
    new[0], new[1], new[2], new[3] = total(work), total(tx), total(ty), total(tz)
    new[4], new[5], new[6], new[7] = total(px), total(py), total(pz), 0.0
    high, low = add_compensated(load(books, 0), load(books, 1), load(f, 0))
    store(books, 0, high)
    store(books, 1, low)
