"""The terms of a model besides Newton's gravity, as Wisdom–Holman maps take them: all of the dominant body.

Those of positions alone, which have a `field`, add to kicks; the others have a flow. The functions here sum the
derivatives of either kind; see `orbits.kernels.maps.terms_of_dominant`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from numba import types
from numba.core.imputils import impl_ret_borrowed
from numba.extending import intrinsic

from orbits.kernels.binding import SumType, kernel_of, other_terms, plus
from orbits.kernels.compile import kernel
from orbits.kernels.compile.verbs import verb


class Terms(NamedTuple):
    """The terms of a model besides Newton's gravity: their tags and parameters; eps^2 and GM of each body."""

    tags: Any
    strength: Any
    parameters: Any


@intrinsic
def strength_of(typingctx, model):
    """Return eps^2 and GM of each body, the parameters of Newton's Lagrangian, of a model with terms or without."""
    own = model.types[1]
    several = isinstance(own, types.BaseTuple)

    def codegen(context, builder, signature, arguments):
        found = builder.extract_value(arguments[0], 1)
        found = builder.extract_value(found, 0) if several else found
        return impl_ret_borrowed(context, builder, signature.return_type, found)

    return (own[0] if several else own)(model), codegen


def is_of_positions(term):
    """Return whether a term, by its Numba type, depends on positions alone."""
    return kernel_of(term, "field") is not None


def _summing(static):
    """Return a function that sums what `about` returns over terms of positions alone, or over all others."""

    @verb
    def summed(tags, strength, parameters, gm, r, w):
        about, last = kernel_of(tags.terms[0], "about"), len(tags.terms) == 1
        if is_of_positions(tags.terms[0]) != static:
            if last:

                def nothing(tags, strength, parameters, gm, r, w):
                    none = r[0] * 0.0
                    return none, none, none, none, none, none

                return nothing
            return lambda tags, strength, parameters, gm, r, w: summed(
                other_terms(tags), strength, parameters[1:], gm, r, w
            )
        if last:
            return lambda tags, strength, parameters, gm, r, w: about(strength, parameters[0], gm, r, w)

        def these(tags, strength, parameters, gm, r, w):
            mine = about(strength, parameters[0], gm, r, w)
            return plus(mine, summed(other_terms(tags), strength, parameters[1:], gm, r, w))

        return these

    return summed


_pulls = _summing(True)
_derivatives = _summing(False)


def _has(model, static):
    """Return whether a model, by its Numba type, has terms of positions alone, or others."""
    if model == types.none or not isinstance(model.types[0], SumType):
        return False
    tag = model.types[0]
    return any(is_of_positions(term) == static for term in tag.terms[1:])


def depends_on_positions(model):
    """Return whether a model, by its Numba type, has terms of positions alone."""
    return _has(model, True)


def depends_on_velocities(model):
    """Return whether a model, by its Numba type, has terms that depend on velocities."""
    return _has(model, False)


@verb
def has_terms(model):
    """Return whether a model has terms besides Newton's."""
    if _has(model, False) or _has(model, True):
        return lambda model: True
    return lambda model: False


@verb
def if_terms(model):
    """Return a model with terms, and None for any other, which calls then need not carry."""
    if depends_on_positions(model) or depends_on_velocities(model):
        return lambda model: model
    return lambda model: None


@kernel(inline=True)
def terms_of(model):
    return Terms(other_terms(model.tag), model.parameters[0], model.parameters[1:])


@kernel(inline=True)
def derivatives_at(terms, mass, place, speed):
    """Return g and s, three numbers each, of all terms that depend on velocities."""
    gx, gy, gz, sx, sy, sz = _derivatives(terms.tags, terms.strength, terms.parameters, mass, place, speed)
    return (gx, gy, gz), (sx, sy, sz)


@kernel(inline=True)
def pulls_at(terms, mass, place):
    """Return the accelerations by all terms of positions alone."""
    gx, gy, gz, _, _, _ = _pulls(terms.tags, terms.strength, terms.parameters, mass, place, place)
    return gx, gy, gz
