"""Forces that come from one body, of which only an acceleration is written: the loops over bodies, and particles.

The kernel of such a force is

    acceleration(strength, own, t, b, A, r, w)

with `strength` the parameter vector of `newtonian`, `own` that of the force, b the row of the source, r and w place and
velocity relative to it, and A the coefficients of the body or particle that is accelerated, floats or `Lanes`. Of one
coefficient the acceleration is that per unit of it. The body that it comes from feels nothing.

The parameters of such a force are: the row of the source; the length of a block of coefficients; the numbers of the
force itself, as many as its kernel constant `numbers`; then as many blocks as its constant `coefficients`, 1 or 3, each
with one coefficient for every massive body, one for every massless particle and eight zeros.
"""

from __future__ import annotations

from functools import partial
from typing import Any

from orbits.kernels.binding import kernel_of
from orbits.kernels.compile import kernel
from orbits.kernels.compile.verbs import INLINED, verb
from orbits.kernels.lanes import LanesType, get, load, put

SOURCE, BLOCK, OWN = 0, 1, 2
"""Indices of the row of the source, of the length of a block, and of the first number of the force itself."""

APART: Any = {**INLINED, "forceinline": False}
"""Options for a function of its own: its products are not to be fused with the sums over forces."""


@verb
def coefficient(own, offset, particle, sources, x):
    """Return the coefficient of a particle, from the vector of a force, which has one for each particle from `offset`
    on; or `Lanes` of eight coefficients for eight particles in lanes.

    sources : the positions of the massive bodies, (3n,), or (3n, 8) at the stages of one particle
    x : the x coordinate of the particles
    """
    if isinstance(x, LanesType) and sources.ndim == 1:
        return lambda own, offset, particle, sources, x: load(own, offset + particle)
    return lambda own, offset, particle, sources, x: own[offset + particle]


@kernel(inline=True)
def relative(x, i, b, n):
    """Return the difference of the vectors of the bodies i and b, three numbers or lanes."""
    return get(x, i) - get(x, b), get(x, n + i) - get(x, n + b), get(x, 2 * n + i) - get(x, 2 * n + b)


@kernel(inline=True)
def relative_to(place, sources, b, n):
    """Return the difference of a vector of a particle and that of the body b."""
    return place[0] - get(sources, b), place[1] - get(sources, n + b), place[2] - get(sources, 2 * n + b)


@kernel(inline=True)
def push(f, i, n, weight, a):
    """Add `weight` times the vector a to the force on body i of n."""
    put(f, i, get(f, i) + weight * a[0])
    put(f, n + i, get(f, n + i) + weight * a[1])
    put(f, 2 * n + i, get(f, 2 * n + i) + weight * a[2])


@verb
def add_central_force(tags, strength, own, t, q, v, f):
    """Add the first of several forces, which has a kernel `acceleration`, to f."""
    force = tags.terms[0]
    acceleration, first = kernel_of(force, "acceleration"), OWN + kernel_of(force, "numbers")
    single = kernel_of(force, "coefficients") == 1

    def all_of_them(tags, strength, own, t, q, v, f):
        n, b = strength.shape[0] - 1, int(own[SOURCE])
        for i in range(n):
            A = _of_body(tags, own, first, i)
            if i != b and _acts(A):
                a = acceleration(strength, own, t, b, A, relative(q, i, b, n), relative(v, i, b, n))
                push(f, i, n, strength[1 + i] * A[0] if single else strength[1 + i], a)

    return all_of_them


@partial(verb, options=APART)
def central_particle_force(tags, strength, own, t, particle, sources, speeds, place, velocity):
    """Return the first of several forces, which has a kernel `acceleration`, on a massless particle or eight."""
    force = tags.terms[0]
    acceleration, first = kernel_of(force, "acceleration"), OWN + kernel_of(force, "numbers")
    single = kernel_of(force, "coefficients") == 1

    def found(tags, strength, own, t, particle, sources, speeds, place, velocity):
        n, b = strength.shape[0] - 1, int(own[SOURCE])
        A = _of_particle(tags, own, first + n, particle, sources, place[0])
        r, w = relative_to(place, sources, b, n), relative_to(velocity, speeds, b, n)
        a = acceleration(strength, own, t, b, A, r, w)
        return (A[0] * a[0], A[0] * a[1], A[0] * a[2]) if single else a

    return found


@verb
def _of_body(tags, own, first, i):
    """Return the coefficients of a body, a tuple; first : the index of the first block."""
    if kernel_of(tags.terms[0], "coefficients") == 1:
        return lambda tags, own, first, i: (own[first + i],)

    def three(tags, own, first, i):
        block = int(own[BLOCK])
        return own[first + i], own[first + block + i], own[first + 2 * block + i]

    return three


@verb
def _of_particle(tags, own, first, particle, sources, x):
    """Return the coefficients of a particle, or of eight, a tuple; first : the index of the first one."""
    if kernel_of(tags.terms[0], "coefficients") == 1:
        return lambda tags, own, first, particle, sources, x: (coefficient(own, first, particle, sources, x),)

    def three(tags, own, first, particle, sources, x):
        block = int(own[BLOCK])
        return (
            coefficient(own, first, particle, sources, x),
            coefficient(own, first + block, particle, sources, x),
            coefficient(own, first + 2 * block, particle, sources, x),
        )

    return three


@verb
def _acts(A):
    """Return whether one of several coefficients is not zero."""
    return (lambda A: A[0] != 0.0) if len(A) == 1 else (lambda A: A[0] != 0.0 or A[1] != 0.0 or A[2] != 0.0)
