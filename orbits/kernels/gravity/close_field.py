"""What steps of particles ask of the field besides the acceleration: low parts, dynamical rates, and magnitudes."""

from __future__ import annotations

from orbits.kernels.binding import (
    SumType,
    field,
    first_term,
    kernel_of,
    of_lagrangian,
    other_terms,
    total_field,
)
from orbits.kernels.compile.verbs import WithoutFirst, verb


@verb
def field_close(lagrangian, parameters, sources, sources_lo, place, place_lo):
    """As `field`, for positions in doubled precision, with the square of the dynamical rate there: (ax, ay, az, S);
    without a kernel for that, only the high parts are used, and S is 0.
    """
    if isinstance(lagrangian, SumType):

        def summed(lagrangian, parameters, sources, sources_lo, place, place_lo):
            first = first_term(lagrangian)
            ax, ay, az, rate = field_close(first, parameters[0], sources, sources_lo, place, place_lo)
            x, y, z = place
            more = total_field(other_terms(lagrangian), parameters[0], parameters[1:], sources, x, y, z)
            return ax + more[0], ay + more[1], az + more[2], rate

        return summed
    compiled = kernel_of(lagrangian, "field_close")
    if compiled is None:

        def plain(lagrangian, parameters, sources, sources_lo, place, place_lo):
            ax, ay, az = field(lagrangian, parameters, sources, place[0], place[1], place[2])
            return ax, ay, az, ax * 0.0

        return plain
    return WithoutFirst(compiled)


@verb
def rate_at(lagrangian, parameters, sources, place):
    """Return the square of the dynamical rate of a massless particle at a place; of the first term of a sum alone."""
    if isinstance(lagrangian, SumType):
        return lambda lagrangian, parameters, sources, place: rate_at(
            first_term(lagrangian), parameters[0], sources, place
        )
    return lambda lagrangian, parameters, sources, place: field_close(
        lagrangian, parameters, sources, None, place, place
    )[3]


@of_lagrangian(otherwise=lambda lagrangian, parameters, *rest: rest[1] * 0.0)
def gross_field(lagrangian, parameters, sources, x, y, z):
    """Return the sum of the magnitudes of the attractions at a point, whose vectors may cancel."""
