"""How a compiled integrator finds the kernels of a Lagrangian.

A Lagrangian enters compiled code as a tag: an empty value whose *type* names the Lagrangian. Each function
below is resolved at compile time to the kernel that the Lagrangian registered under that name. (A kernel passed as an
argument would never hit Numba's disk cache; a tag does.)

A Lagrangian of bodies may be a sum of terms: a `SumTag`, with a tuple of parameter vectors, one for each term. The
first term has the kernels of a Lagrangian, and writes; the others add to that (see `orbits.lagrangians.terms`).
Compiled code calls the functions below in the same way for both.
"""

from __future__ import annotations

from functools import wraps

from numba import types
from numba.extending import intrinsic

from orbits.kernels.compile.verbs import WithoutFirst, verb
from orbits.kernels.lanes import full, store
from orbits.kernels.tags import SumTag as SumTag
from orbits.kernels.tags import SumType as SumType
from orbits.kernels.tags import Tag as Tag
from orbits.kernels.tags import kernel_of as kernel_of


@intrinsic
def first_term(typingctx, tags):
    """Return the tag of the first term of a sum."""
    return tags.terms[0](tags), lambda context, builder, signature, arguments: context.get_dummy_value()


@intrinsic
def other_terms(typingctx, tags):
    """Return the tags of the other terms of a sum."""
    return SumType(tags.terms[1:])(tags), lambda context, builder, signature, arguments: context.get_dummy_value()


def adding(name, instead=None, optional=False):
    """Return a function that calls the kernel of that name of each term of a sum; the kernels add to their last
    arguments.

    instead : the name of the kernel to call of terms without such a one; optional : whether these add nothing
    The kernels' arguments are the strengths of the bodies (the first term's parameters), the term's own, and the rest.
    """

    @verb
    def each(tags, strength, parameters, *rest):
        compiled = kernel_of(tags.terms[0], name) or kernel_of(tags.terms[0], instead)
        if compiled is None and optional:
            if len(tags.terms) == 1:
                return lambda tags, strength, parameters, *rest: None
            return lambda tags, strength, parameters, *rest: each(other_terms(tags), strength, parameters[1:], *rest)
        if compiled is None:
            return None
        if len(tags.terms) == 1:
            return lambda tags, strength, parameters, *rest: compiled(strength, parameters[0], *rest)

        def these(tags, strength, parameters, *rest):
            compiled(strength, parameters[0], *rest)
            each(other_terms(tags), strength, parameters[1:], *rest)

        return these

    return each


def totalling(name, instead=None, skipped=0):
    """Return a function that sums, over the terms of a sum, the numbers that the kernel of that name returns.

    instead : the name of the kernel to call of terms without such a one, of whose numbers the first `skipped` are left
        out
    """

    @verb
    def one(tags, strength, own, *rest):
        compiled = kernel_of(tags.terms[0], name)
        if compiled is not None:
            return lambda tags, strength, own, *rest: compiled(strength, own, *rest)
        replacing = kernel_of(tags.terms[0], instead)
        return replacing and (lambda tags, strength, own, *rest: replacing(strength, own, *rest)[skipped:])

    return total_of(one)


def total_of(one):
    """Return a function that sums over the terms of a sum what `one` returns of the first and of its own parameters."""

    @verb
    def total(tags, strength, parameters, *rest):
        def last(tags, strength, parameters, *rest):
            return one(tags, strength, parameters[0], *rest)

        def several(tags, strength, parameters, *rest):
            mine = one(tags, strength, parameters[0], *rest)
            return plus(mine, total(other_terms(tags), strength, parameters[1:], *rest))

        return last if len(tags.terms) == 1 else several

    return total


@verb
def plus(a, b):
    """Return the sum of two numbers, or the elementwise sum of two tuples."""
    if not isinstance(a, types.BaseTuple):
        return lambda a, b: a + b
    if len(a) == 3:
        return lambda a, b: (a[0] + b[0], a[1] + b[1], a[2] + b[2])
    return lambda a, b: (a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4], a[5] + b[5])


add_gradients = adding("gradients")
add_hessians = adding("hessians")
add_accelerations = adding("accelerate_some")
add_inertia = adding("inertia", optional=True)
momenta_of_terms = adding("momenta", instead="gradients")
total_value = totalling("value")
total_field = totalling("field")
total_particle_gradients = totalling("particle_gradients")
total_particle_momenta = totalling("particle_momenta", instead="particle_gradients", skipped=3)


def of_lagrangian(add=None, total=None, otherwise=None):
    """Return a decorator of a function that is described by its arguments and docstring: compiled code calls the kernel
    of its name; of a sum, that of its first term. A number in place of a kernel is returned.

    add : adds to that what the kernels of the other terms write; total : returns the sum of what they return
    otherwise : the function to call without such a kernel, of a Lagrangian, its parameters and *rest
    """

    def decorated(described):
        def choose(lagrangian, parameters, *rest):
            def first(lagrangian, parameters, *rest):
                return found(first_term(lagrangian), parameters[0], *rest)

            def added(lagrangian, parameters, *rest):
                found(first_term(lagrangian), parameters[0], *rest)
                add(other_terms(lagrangian), parameters[0], parameters[1:], *rest)

            def totalled(lagrangian, parameters, *rest):
                base = found(first_term(lagrangian), parameters[0], *rest)
                return plus(base, total(other_terms(lagrangian), parameters[0], parameters[1:], *rest))

            if isinstance(lagrangian, SumType):
                return totalled if total else added if add else first
            compiled = kernel_of(lagrangian, described.__name__)
            if isinstance(compiled, int):
                return lambda lagrangian, parameters, *rest: compiled
            return WithoutFirst(compiled) if compiled else otherwise

        found = wraps(described)(verb(choose))
        return found

    return decorated


def of_record(optional=False):
    """Return a decorator of a function that is described by its arguments and docstring: compiled code calls the kernel
    of its name of the tag with which its first argument begins, the record of a method or a clock.

    optional : whether nothing is done without such a kernel
    """

    def decorated(described):
        def choose(record, *rest):
            compiled = kernel_of(record.types[0], described.__name__)
            if compiled is None and optional:
                return lambda record, *rest: None
            return compiled

        return wraps(described)(verb(choose))

    return decorated


@of_lagrangian()
def dimension(lagrangian, parameters):
    """Return the number of coordinates."""


@of_lagrangian(otherwise=lambda lagrangian, parameters, *rest: 0)
def bodies(lagrangian, parameters):
    """Return the number of bodies of three coordinates each, all x first; 0 if the coordinates are not those of
    bodies.
    """


@of_lagrangian(total=total_value)
def value(lagrangian, parameters, t, q, v):
    """Return L(q, v, t): float64 for vectors, `Lanes` for rows of eight stages (t is then `Lanes`)."""


@of_lagrangian(add=add_gradients)
def gradients(lagrangian, parameters, t, q, v, f, p):
    """Write dL/dq(q, v, t) into f and dL/dv(q, v, t) into p; vectors, or rows of eight stages with t in `Lanes`."""


@of_lagrangian(add=add_hessians)
def hessians(lagrangian, parameters, t, q, v, out):
    """Write d2L/dq dq, d2L/dq dv and d2L/dv dv, each d x d row by row, into `out`: 3 d^2 elements or rows."""


@of_lagrangian()
def tides(lagrangian, parameters, q, some, out):
    """Write the derivatives of the accelerations of some bodies by their positions; of the first term of a sum alone.

    some : (m,) int64, their numbers in ascending order; out : (3m, 3m)
    """


@verb
def accelerate(lagrangian, parameters, q, out):
    """Write the accelerations g(q) of all coordinates into `out`; padded vectors (d + 8,), or rows of eight stages."""
    if isinstance(lagrangian, SumType):

        def summed(lagrangian, parameters, q, out):
            accelerate(first_term(lagrangian), parameters[0], q, out)
            add_to_all(other_terms(lagrangian), parameters[0], parameters[1:], q, out)

        return summed
    compiled = kernel_of(lagrangian, "accelerate" if getattr(q, "ndim", 0) == 1 else "accelerate_stages")
    return compiled and WithoutFirst(compiled)


@verb
def add_to_all(others, strength, parameters, q, *rest):
    """Add the accelerations of all bodies by the other terms of a sum to the last argument."""
    return lambda others, strength, parameters, q, *rest: add_accelerations(
        others, strength, parameters, q, rest[-1], 0, len(strength) - 1
    )


@of_lagrangian(
    add=add_to_all,
    otherwise=lambda lagrangian, parameters, *rest: accelerate(lagrangian, parameters, rest[0], rest[2]),
)
def accelerate_close(lagrangian, parameters, q, q_lo, out):
    """As `accelerate` for rows of eight stages, with positions (q, q_lo) in doubled precision; without a kernel for
    that, only q is used.
    """


@verb
def accelerate_finely(lagrangian, parameters, q, q_lo, close, out, out_lo):
    """Write the accelerations at rows of eight stages, positions and accelerations being pairs in doubled precision.

    close : whether q_lo is used in all distances, not only in those that matter most
    Without a kernel for that, q_lo is not used, and out_lo is zero. What other terms of a sum give is of float64
    numbers.
    """
    several = isinstance(lagrangian, SumType)
    add_finely = kernel_of(lagrangian.terms[0] if several else lagrangian, "add_finely")
    if add_finely is None:

        def rounded(lagrangian, parameters, q, q_lo, close, out, out_lo):
            accelerate(lagrangian, parameters, q, out)
            for k in range(dimension(lagrangian, parameters)):
                store(out_lo, k, full(0.0))

        return rounded
    if several:

        def summed(lagrangian, parameters, q, q_lo, close, out, out_lo):
            for k in range(dimension(lagrangian, parameters)):
                store(out, k, full(0.0))
            add_to_all(other_terms(lagrangian), parameters[0], parameters[1:], q, out)
            add_finely(parameters[0], q, q_lo, close, out, out_lo)

        return summed

    def alone(lagrangian, parameters, q, q_lo, close, out, out_lo):
        for k in range(dimension(lagrangian, parameters)):
            store(out, k, full(0.0))
        add_finely(parameters, q, q_lo, close, out, out_lo)

    return alone


@of_lagrangian()
def dynamical_rate(lagrangian, parameters, q, v):
    """Return the square of the largest dynamical rate, 1 / (dynamical time)^2, and its time derivative."""


@of_lagrangian()
def gross_attraction(lagrangian, parameters, q, i):
    """Return the sum of the magnitudes of the attractions on body i, whose vectors may cancel."""


@of_lagrangian(add=add_accelerations)
def accelerate_some(lagrangian, parameters, q, out, start, stop):
    """Write the accelerations of bodies start ... stop - 1 only, bit for bit as `accelerate`; start is a multiple of
    8.
    """


@of_lagrangian(total=total_field)
def field(lagrangian, parameters, sources, x, y, z):
    """Return the acceleration (ax, ay, az) of a massless particle at (x, y, z) in the field of `sources`."""


@of_lagrangian(total=total_particle_gradients)
def particle_gradients(lagrangian, parameters, t, sources, speeds, place, velocity):
    """Return (dL/dx, dL/dv), six numbers, of the Lagrangian of a massless particle per unit mass.

    sources, speeds : positions and velocities of the massive bodies, (3n,) or (3n, 8), at the time t
    place, velocity : (x, y, z) and (vx, vy, vz) of the particle; float64 or `Lanes`
    """
