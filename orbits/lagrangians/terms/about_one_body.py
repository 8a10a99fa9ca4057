"""The kernels of a term whose part of L is a sum over pairs with one body, made from what it is for a pair.

    part(strength, own, gm, r, w)     returns the part of L of a body with this GM at r from the source, with velocity w
    about(strength, own, gm, r, w)    returns its derivatives, per GM, with respect to r and w, six numbers

The source is the body `own[0]`, and feels the reaction. The loops below are copied for each term, with its own `part`
and `about`. A copy belongs to the file of the term, so that the cache of compiled code keeps them apart, and compiles
them again when that file changes.
"""

from __future__ import annotations

from collections.abc import Callable
from types import FunctionType
from typing import Any

from orbits.kernels.compile import kernel
from orbits.kernels.lanes import get
from orbits.lagrangians.terms.pairs import add_with_reaction, difference, put_acceleration, put_reaction, separation

part: Any = None
"""Stands for the kernel of a term."""

about: Any = None
"""Stands for the kernel of a term."""


def value(strength, own, t, q, v):
    """Return the sum over pairs with the source."""
    n, b = strength.shape[0] - 1, int(own[0])
    total = get(q, 0) * 0.0
    for i in range(n):
        if i != b:
            total = total + part(strength, own, strength[1 + i], difference(q, i, b, n), difference(v, i, b, n))
    return total


def gradients(strength, own, t, q, v, f, p):
    """Add the forces to f and the momenta to p, with the reaction of the source."""
    n, b = strength.shape[0] - 1, int(own[0])
    for i in range(n):
        if i != b:
            gm = strength[1 + i]
            fx, fy, fz, px, py, pz = about(strength, own, gm, difference(q, i, b, n), difference(v, i, b, n))
            add_with_reaction(f, (gm * fx, gm * fy, gm * fz), i, b, n)
            add_with_reaction(p, (gm * px, gm * py, gm * pz), i, b, n)


def forces(strength, own, t, q, v, f, p):
    """Add the forces, and the reaction on the source, to f."""
    n, b = strength.shape[0] - 1, int(own[0])
    for i in range(n):
        if i != b:
            gm, r = strength[1 + i], difference(q, i, b, n)
            ax, ay, az = about(strength, own, gm, r, r)[:3]
            add_with_reaction(f, (gm * ax, gm * ay, gm * az), i, b, n)


def accelerate_some(strength, own, q, out, start, stop):
    """Add the accelerations of bodies start ... stop - 1; that of the source is due to all others."""
    n, b = strength.shape[0] - 1, int(own[0])
    whole = start <= b < stop
    bx, by, bz = get(q, 0) * 0.0, get(q, 0) * 0.0, get(q, 0) * 0.0
    for i in range(0 if whole else start, n if whole else stop):
        if i != b:
            gm, r = strength[1 + i], difference(q, i, b, n)
            ax, ay, az = about(strength, own, gm, r, r)[:3]
            bx, by, bz = bx + gm * ax, by + gm * ay, bz + gm * az
            if start <= i < stop:
                put_acceleration(out, (ax, ay, az), i, n)
    if whole:
        put_reaction(out, (bx, by, bz), 1.0 / strength[1 + b], b, n)


def field(strength, own, sources, x, y, z):
    """Return the acceleration of a massless particle at (x, y, z)."""
    r = separation((x, y, z), sources, int(own[0]), strength.shape[0] - 1)
    return about(strength, own, 0.0, r, r)[:3]


def particle_gradients(strength, own, t, sources, speeds, place, velocity):
    """Return the force and the momentum per unit mass."""
    n, b = strength.shape[0] - 1, int(own[0])
    return about(strength, own, 0.0, separation(place, sources, b, n), separation(velocity, speeds, b, n))


def particle_forces(strength, own, t, sources, speeds, place, velocity):
    """Return the force per unit mass, and zeros for the momentum."""
    r = separation(place, sources, int(own[0]), strength.shape[0] - 1)
    return about(strength, own, 0.0, r, r)


def kernels_from(part: Any, about: Any, hessians: Any, *, static: bool = False) -> dict[str, Any]:
    """Return the kernels of a term, for its `Tag`.

    part, about : inlined kernels, as above; hessians : its kernel of that name
    static : whether it depends on positions alone, so that `about` returns zeros for momenta
    """
    loops: dict[str, Callable] = {"value": value, "gradients": forces if static else gradients}
    if static:
        loops |= {"accelerate_some": accelerate_some, "field": field}
    loops["particle_gradients"] = particle_forces if static else particle_gradients
    found = {name: _compiled(name, loop, part, about) for name, loop in loops.items()}
    return {**found, "hessians": hessians, "about": about}


def _compiled(name: str, loop: Any, part: Any, about: Any) -> Any:
    """Return a kernel of that name: a copy of a loop over pairs for one term."""
    term = about.py_func
    code = loop.__code__.replace(co_filename=term.__code__.co_filename)
    copied = FunctionType(code, {**globals(), "part": part, "about": about}, name)
    copied.__module__, copied.__qualname__, copied.__doc__ = term.__module__, name, loop.__doc__
    return kernel(copied)


__all__ = ["kernels_from"]
