"""The least distance of two orbits, with units."""

from __future__ import annotations

from typing import Any

import numpy as np
from astropy import units as u

from orbits.elements.moid import Conics, least_distances
from orbits.errors import InputError, shown
from orbits.system.new_bodies import JACOBI
from orbits.system.orbital_elements import OrbitalElements


def moid(orbit: OrbitalElements, other: OrbitalElements) -> u.Quantity:
    """Return the minimum orbit intersection distance, MOID: the least distance of two orbits as curves.

        elements = system.elements(primary="Sun")
        orbits.moid(elements["Apophis"], elements["Earth"]).to(u.km)
        orbits.moid(elements, elements["Earth"])  # of all bodies

    orbit, other : elements about the same primary in the same frame, ellipses, parabolas or hyperbolas. Shapes are
        broadcast, samples with samples and bodies with bodies: of a run, `run.elements()`, and one of its bodies it is
        that of the osculating orbits at each sample.
    Returns a distance in the unit of the first orbit, of their common shape, to 1e-14 of the larger orbit; NaN where a
        particle is retired. Pairs in arrays take 0.5 ms each, a single one 2 ms.
    Raises InputError for elements about another primary, in another frame or of other shapes, for those of different
        bodies in "jacobi", where each has a primary of its own, and for lengths beside plain numbers.
    """
    for given in (orbit, other):
        if not isinstance(given, OrbitalElements):
            raise InputError(f'{shown(given)} is no orbit; expected elements: system.elements(primary="Sun")["Earth"].')
    if (orbit.primary, orbit.frame) != (other.primary, other.frame):
        raise InputError(
            f"these orbits are about {orbit.primary} in the frame {orbit.frame!r} and about {other.primary} in "
            f"{other.frame!r}; expected elements about the same primary in the same frame."
        )
    if orbit.primary == JACOBI and orbit.names != other.names:
        raise InputError(
            "these orbits are about the centres of mass of the bodies before each, which differ; expected elements "
            "about one primary, such as the first body, or 'barycentre'."
        )
    if not orbit.q.unit.is_equivalent(other.q.unit):
        raise InputError(f"one orbit has units, the other none: q = {orbit.q} and {other.q}; expected both or neither.")
    several = any(x.q.ndim > x.t.ndim for x in (orbit, other))  # samples of one body are a column beside several
    elements: list[Any] = []
    for x in (orbit, other):
        own = [x.q.to_value(orbit.q.unit), x.e.value, *(y.to_value(u.rad) for y in (x.inc, x.Omega, x.omega))]
        elements += [y[:, None] for y in own] if several and x.t.ndim and x.q.ndim == 1 else own
    try:
        values = np.array(np.broadcast_arrays(*elements))
    except ValueError:
        shapes = f"{orbit.q.shape} and {other.q.shape}"
        raise InputError(f"the elements have the shapes {shapes}; expected the same, or one orbit.") from None
    there = np.isfinite(values).all(axis=0)
    both = Conics.of(*values[:, there].reshape(2, 5, -1).swapaxes(0, 1))
    distance = np.full(there.shape, np.nan)
    distance[there] = least_distances(both.some(0), both.some(1))[0]
    return u.Quantity(distance, orbit.q.unit)
