"""The other terms of a sum, and forces without a Lagrangian.

A `SumTag` can contain forces too; their parameter vectors then follow those of the terms. Missing parts add nothing.

A force may have internal variables y, such as a spin, with rates of change y' that it computes along with the forces.
Methods step them by the same rule as momenta, Y_i = y + h sum_j a_ij y'_j. Those of all forces stand in one array.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from numba.extending import intrinsic

from orbits.kernels.binding import (
    SumTag,
    SumType,
    Tag,
    add_gradients,
    kernel_of,
    momenta_of_terms,
    other_terms,
    total_of,
    total_particle_gradients,
    total_particle_momenta,
)
from orbits.kernels.compile import kernel
from orbits.kernels.compile.verbs import verb
from orbits.kernels.gravity.central_forces import add_central_force, central_particle_force
from orbits.kernels.lanes import WIDTH, full, get, load, put, store, total
from orbits.kernels.sums.summation import add_compensated, compensated_row_sums

FIGURES = 7
"""The time integrals kept of a force: its work, its torque about the origin (3) and its impulse (3), times G."""


class Moment(NamedTuple):
    """Where forces are evaluated: the times, positions, velocities and internal variables of stages."""

    t: Any
    q: Any
    v: Any
    y: Any


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


@verb
def add_terms(lagrangian, parameters, t, q, v, f, p):
    """Add dL/dq and dL/dv of all terms except the first to f and p; vectors, or rows of eight stages with t in
    `Lanes`.
    """
    if len(lagrangian.terms) == 1:
        return lambda lagrangian, parameters, t, q, v, f, p: None

    def others(lagrangian, parameters, t, q, v, f, p):
        add_gradients(other_terms(lagrangian), parameters[0], parameters[1:], t, q, v, f, p)

    return others


@verb
def add_momenta(lagrangian, parameters, t, q, v, f, p):
    """Add dL/dv of all terms except the first to p, as `add_terms` does to the same accuracy; f is workspace."""
    if len(lagrangian.terms) == 1:
        return lambda lagrangian, parameters, t, q, v, f, p: None

    def others(lagrangian, parameters, t, q, v, f, p):
        momenta_of_terms(other_terms(lagrangian), parameters[0], parameters[1:], t, q, v, f, p)

    return others


@verb
def inner_variables(lagrangian):
    """Return the number of internal variables of the forces of a sum."""
    count = sum(kernel_of(force, "inner") or 0 for force in lagrangian.forces)
    return lambda lagrangian: count


@verb
def add_acting(lagrangian, parameters, t, q, v, y, f, rates):
    """Add the forces of a sum to f, and write the rates of their internal variables y; vectors, or rows of eight stages
    with t in `Lanes`.
    """
    count = len(lagrangian.terms)
    if not lagrangian.forces:
        return lambda lagrangian, parameters, t, q, v, y, f, rates: None

    def acting(lagrangian, parameters, t, q, v, y, f, rates):
        add_forces(forces_of(lagrangian), parameters[0], parameters[count:], t, q, v, y, f, rates)

    return acting


@verb
def add_forces(tags, strength, parameters, t, q, v, y, f, rates):
    """Add forces without a Lagrangian, times G like dL/dq, to f, and write the rates of their internal variables y;
    vectors, or rows of eight stages.
    """
    own, last = kernel_of(tags.terms[0], "inner") or 0, len(tags.terms) == 1

    def one(tags, strength, parameters, t, q, v, y, f, rates):
        add_force(tags, strength, parameters[0], t, q, v, y, f, rates)

    def these(tags, strength, parameters, t, q, v, y, f, rates):
        add_force(tags, strength, parameters[0], t, q, v, y, f, rates)
        add_forces(other_terms(tags), strength, parameters[1:], t, q, v, y[own:], f, rates[own:])

    return one if last else these


@verb
def add_force(tags, strength, own, t, q, v, y, f, rates):
    """Add the first of several forces, and write the rates of its internal variables, the first ones in y."""
    force = kernel_of(tags.terms[0], "force")
    if force is None:
        return lambda tags, strength, own, t, q, v, y, f, rates: add_central_force(tags, strength, own, t, q, v, f)
    if kernel_of(tags.terms[0], "inner"):
        return lambda tags, strength, own, t, q, v, y, f, rates: force(strength, own, t, q, v, y, f, rates)
    return lambda tags, strength, own, t, q, v, y, f, rates: force(strength, own, t, q, v, f)


@verb
def particle_terms(lagrangian, parameters, t, sources, speeds, place, velocity):
    """Return the contributions of all terms except the first to dL/dx and dL/dv of a massless particle, six numbers."""
    if len(lagrangian.terms) == 1:

        def nothing(lagrangian, parameters, t, sources, speeds, place, velocity):
            zero = place[0] * 0.0
            return zero, zero, zero, zero, zero, zero

        return nothing

    def others(lagrangian, parameters, t, sources, speeds, place, velocity):
        tags = other_terms(lagrangian)
        return total_particle_gradients(tags, parameters[0], parameters[1:], t, sources, speeds, place, velocity)

    return others


@verb
def particle_momenta(lagrangian, parameters, t, sources, speeds, place, velocity):
    """Return the contributions of all terms except the first to dL/dv of a massless particle, three numbers."""
    if len(lagrangian.terms) == 1:

        def nothing(lagrangian, parameters, t, sources, speeds, place, velocity):
            zero = place[0] * 0.0
            return zero, zero, zero

        return nothing

    def others(lagrangian, parameters, t, sources, speeds, place, velocity):
        tags = other_terms(lagrangian)
        return total_particle_momenta(tags, parameters[0], parameters[1:], t, sources, speeds, place, velocity)

    return others


@verb
def particle_acting(lagrangian, parameters, t, particle, sources, speeds, place, velocity):
    """Return the force per unit mass on massless particle number `particle`, three numbers."""
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


@verb
def particle_force(tags, strength, own, t, particle, sources, speeds, place, velocity):
    """Return the first of several forces per unit mass on a massless particle, or on eight, three numbers."""
    force = kernel_of(tags.terms[0], "particle_force")

    def central(tags, strength, own, t, particle, sources, speeds, place, velocity):
        return central_particle_force(tags, strength, own, t, particle, sources, speeds, place, velocity)

    def given(tags, strength, own, t, particle, sources, speeds, place, velocity):
        return force(strength, own, t, particle, sources, speeds, place, velocity)

    return central if force is None else given


total_particle_force = total_of(particle_force)


@verb
def account(lagrangian, parameters, weights, at, rows, rates, books):
    """Add the work, torque and impulse of each force of a sum on the massive bodies in a step to its two rows of
    `books`, and the changes of the internal variables to the rows that follow.

    weights : h b, `Lanes`; at : the `Moment` of the stages, of t in `Lanes` and rows of eight
    rows : (3n, 8), workspace; rates : rows for those of the internal variables, a multiple of eight
    books : (2 forces, 8), for each force its `FIGURES` and their low parts; then the internal variables, eight in a
        row, and their low parts
    """
    count, forces = len(lagrangian.terms), len(lagrangian.forces)
    if not lagrangian.forces:
        return lambda lagrangian, parameters, weights, at, rows, rates, books: None

    def all_of_them(lagrangian, parameters, weights, at, rows, rates, books):
        _account_each(forces_of(lagrangian), parameters[0], parameters[count:], weights, at, rows, rates, books)
        if inner_variables(lagrangian) > 0:
            _advance(weights, rates, books[2 * forces :])

    return all_of_them


@verb
def _account_each(tags, strength, parameters, weights, at, rows, rates, books):
    own, last = kernel_of(tags.terms[0], "inner") or 0, len(tags.terms) == 1

    def one(tags, strength, parameters, weights, at, rows, rates, books):
        n = strength.shape[0] - 1
        for k in range(3 * n):
            put(rows, k, full(0.0))
        add_force(tags, strength, parameters[0], at.t, at.q, at.v, at.y, rows, rates)
        _book(n, weights, at.q, at.v, rows, books)

    def these(tags, strength, parameters, weights, at, rows, rates, books):
        n = strength.shape[0] - 1
        for k in range(3 * n):
            put(rows, k, full(0.0))
        add_force(tags, strength, parameters[0], at.t, at.q, at.v, at.y, rows, rates)
        _book(n, weights, at.q, at.v, rows, books)
        more = Moment(at.t, at.q, at.v, at.y[own:])
        _account_each(other_terms(tags), strength, parameters[1:], weights, more, rows, rates[own:], books[2:])

    return one if last else these


@kernel
def _advance(weights, rates, inner):
    """Add the changes in a step to the internal variables; inner : rows of these, then of their low parts."""
    half = inner.shape[0] // 2
    for block in range(half):
        for j in range(WIDTH * block, WIDTH * (block + 1)):
            store(rates, j, weights * load(rates, j))
        change, change_lo = compensated_row_sums(rates, WIDTH * block)
        high, low = add_compensated(load(inner, block), load(inner, half + block) + change_lo, change)
        store(inner, block, high)
        store(inner, half + block, low)


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
