"""Clones of a body whose orbit is uncertain, drawn from the covariance of its state or its elements."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from astropy import units as u
from numpy.typing import NDArray

from orbits.checks import whole_number
from orbits.ensemble.members import MOST, Ensemble, Systems, among, numbered
from orbits.errors import InputError, shown
from orbits.propagation.variations.deviations import warn_of_range
from orbits.results.covariance import Covariance, decomposed, in_units_of
from orbits.system import System
from orbits.system.new_bodies import JACOBI, centre_of_several, primary_name

Floats = NDArray[np.float64]


def clones(
    system: System,
    body: str,
    *,
    covariance: Any,
    count: int,
    seed: int = 0,
    elements: Mapping[str, Any] | None = None,
    primary: str | None = None,
    frame: str | None = None,
) -> Ensemble:
    """Return an ensemble of a body and its clones, drawn from the normal distribution of its uncertain orbit.

        orbits.ensemble.clones(fit.system, fit.name, covariance=fit, count=10_000, seed=1)
        orbits.ensemble.clones(system, "Apophis", covariance=C, count=10_000, seed=1)
        orbits.ensemble.clones(system, "Apophis", covariance=C, count=10_000, seed=1, primary="Sun", elements={
            "e": 1, "q": u.au, "T": u.day, "Omega": u.deg, "omega": u.deg, "inc": u.deg})  # as in JPL's database

    covariance : (6, 6), symmetric, of x, y, z, vx, vy, vz in the units and axes of the system; or of `elements`; or a
        fit, or its `covariance()` in any form, of six elements: one with parameters, such as A2, is refused
    count : of the clones; the first member is the body itself, on its nominal orbit
    seed : of the random numbers: the same seed draws the same clones, and more of them begin with the same ones
    elements : six elements as in `System.add`, in the order of the rows, and the unit of each (1 for none)
    primary, frame : of the elements, as in `System.elements`; without elements they are refused

    A massless body is cloned among the same other bodies; forces on it act on its clones, too, and a rigid body is
    refused. Of one with mass, each clone is a system of its own, in which the other bodies begin as they are. Raises
    InputError for a covariance that is none, UnknownNameError for a body or an element that does not exist.
    """
    if not isinstance(system, System):
        raise InputError(f"system is {shown(system)}; expected an orbits.System with the body to be cloned.")
    place, count = system.index(body), whole_number(count, "count", most=MOST)
    if hasattr(covariance, "system") and hasattr(covariance, "covariance"):
        warn_of_range(covariance)
        covariance = covariance.covariance()
    known = isinstance(covariance, Covariance)
    if (known or elements is None) and any(x is not None for x in (elements, primary, frame)):
        beside = "the covariance of a fit, such as fit.covariance('keplerian')" if known else "a matrix of a state"
        raise InputError(
            f"elements, primary and frame say of which elements a matrix is; expected none of them with {beside}."
        )
    if known:
        covariance.require_of(system, system.names[place])
        if len(covariance.names) > 6:
            raise InputError(
                f"the covariance has parameters, {', '.join(covariance.names[6:])}, which clones among the same bodies "
                "share; expected one of six: that of a fit without them, or covariance.matrix[:6, :6] in their units, "
                "with which the parameters stay as they are."
            )
        if covariance.form == "cartesian":
            covariance = in_units_of(system, covariance)
        else:
            elements, primary, frame = dict(zip(covariance.names, covariance.units, strict=True)), "Sun", "ecliptic"
            covariance = covariance.matrix
    seed = whole_number(seed, "seed", least=0)
    deviations = np.vstack([np.zeros(6), drawn(covariance, count, seed)])
    name = system.names[place]
    names = [name, *(f"{name} clone {k}" for k in numbered("", count))]
    gm = float(system.values.gm[place])
    if elements is None:
        q, v = system.values.q[place] + deviations[:, :3], system.values.v[place] + deviations[:, 3:]
        others = None if gm else system.remove(name)
    else:
        others = system.remove(name)
        around = primary_name(others.names, others.values.gm, primary)
        frame = system.frame if frame is None else frame
        own = _elements(system, name, elements, around, frame, deviations)
        centre = centre_of_several(others.names, around)
        before = system.remove(*system.names[place:]) if centre == JACOBI else others
        if gm and centre is not None:  # each beside the other bodies alone, whose centre of mass it moves
            points = [{key: value[k] for key, value in own.items()} for k in range(len(names))]
            placed = [before.add(name, primary=around, frame=frame, gm=gm, **one).values for one in points]
            q, v = np.array([one.q[-1] for one in placed]), np.array([one.v[-1] for one in placed])
        else:
            mass = {"gm": gm} if gm else {}
            values = before.add(names, primary=around, frame=frame, **mass, **own).values
            q, v = values.q[len(before) :].copy(), values.v[len(before) :].copy()
        q[0], v[0] = system.values.q[place], system.values.v[place]
    if gm == 0.0:
        assert others is not None  # a system has at least one massive body
        if name in system.rigid:
            raise InputError(f"{name!r} is rigid; expected a point, of which clones are made: replaced(forces=()).")
        radius = {} if system.radii is None else {"radius": system.radii[place]}
        whole = others.add(names, q=q, v=v, **radius).with_forces(*_on_clones(system, name, names))
        return among(others, whole, np.arange(len(others), len(whole)))
    return Systems(names, "systems", members=[_moved(system, place, *state) for state in zip(q, v, strict=True)])


def _on_clones(system: System, name: str, names: Sequence[str]) -> Iterator[Any]:
    """Yield the forces that name a body, with its numbers, on its clones."""
    for force in system.forces:
        bodies = set(force.bodies or ())
        if name in bodies:
            one: Any = force.without(bodies - {name})
            numbers = {key: getattr(one, key) for key in getattr(one, "per_body", ())}
            yield replace(one, bodies=names, **{key: x[0] for key, x in numbers.items() if isinstance(x, tuple)})


def drawn(covariance: Any, count: int, seed: int) -> Floats:
    """Return `count` deviations (count, 6) of a normal distribution. Raises InputError unless its covariance is one."""
    values, vectors, factors = decomposed(covariance, 6, "of a state or of six elements")
    normal = np.random.default_rng(seed).standard_normal((count, 6))
    return np.asarray((normal * np.sqrt(values)) @ vectors.T * factors)


def _elements(
    system: System, name: str, units: Mapping[str, Any], primary: str, frame: str | None, deviations: Floats
) -> dict[str, Any]:
    """Return the elements of the body and of its clones, (members,) each."""
    if not isinstance(units, Mapping) or len(units) != 6:
        raise InputError(
            f"elements is {shown(units)}; expected six, in the order of the rows, and the unit of each: "
            '{"e": 1, "q": u.au, "T": u.day, "Omega": u.deg, "omega": u.deg, "inc": u.deg}'
        )
    found = system.elements(primary=primary, frame=frame)[name]
    own, known = {}, found.keys()
    for k, (key, unit) in enumerate(units.items()):
        if key not in known:
            raise InputError(f"there is no element {shown(key)}; expected some of {', '.join(known)}.")
        value = getattr(found, key)
        try:
            unit = u.dimensionless_unscaled if unit == 1 else u.Unit(unit)
            value = value.to(unit, u.dimensionless_angles())
        except (TypeError, ValueError) as error:
            kind = str(value.unit) or "1, for none"
            raise InputError(f"the unit of {key} is {shown(unit)}; expected one such as {kind}.") from error
        own[key] = value + u.Quantity(deviations[:, k], unit)
    return own


def _moved(system: System, place: int, q: Floats, v: Floats) -> System:
    values = system.values
    places, speeds = values.q.copy(), values.v.copy()
    places[place], speeds[place] = q, v
    return system.replaced(q=places, v=speeds)
