"""The terms and forces of a system besides Newton's gravity, and its Lagrangian.

Modules with kernels are imported where they are needed: making a system without terms does not load Numba.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from dataclasses import replace
from functools import reduce
from itertools import product
from typing import TYPE_CHECKING, Any, NamedTuple, Self, cast

import numpy as np
from astropy import units as u
from numpy.typing import NDArray

from orbits.body_names import few, index_of, indices_of
from orbits.errors import InputError, shown
from orbits.point_masses import changed_masses
from orbits.system.rigid_body import RIGID, RigidBody
from orbits.units import UnitSystem

if TYPE_CHECKING:
    from orbits.forces.base import BoundForce, Force
    from orbits.forces.central import CentralForce
    from orbits.lagrangians.base import Lagrangian
    from orbits.lagrangians.terms.base import Summand, SumOfTerms, Term
    from orbits.system.system import System

Array = NDArray[np.float64]

ENERGY, MOMENTUM, ANGULAR_MOMENTUM = 0, 1, 2
"""The charges of a system that `whole` completes."""


class Modelled:
    """The part of `System` for terms and forces."""

    __slots__ = ()

    _terms: tuple[Term, ...]
    _forces: tuple[Force, ...]

    @property
    def terms(self) -> tuple[Term, ...]:
        """The terms added to Newton's Lagrangian, in the units of the system."""
        return self._terms

    @property
    def forces(self) -> tuple[Force, ...]:
        """The forces without a Lagrangian, in the units of the system."""
        return self._forces

    def with_terms(self, *terms: Term) -> Self:
        """Return this system with more terms in its Lagrangian; `replaced(terms=())` removes them.

            pole = (286.13, 63.87) * u.deg
            system.with_terms(orbits.terms.ZonalHarmonics("Sun", J2=2.2e-7, radius=696000 * u.km, pole=pole))

        Raises InputError, naming the term, for objects that are not terms, invalid numbers or units, a body without
        mass, and a second term of one kind for one body; UnknownNameError for an unknown body.
        """
        system: Any = self
        return cast(Self, system.replaced(terms=(*self.terms, *terms)))

    def with_forces(self, *forces: Force) -> Self:
        """Return this system with more forces that have no Lagrangian; `replaced(forces=())` removes them.

            system.with_forces(orbits.terms.Drag(rate=1e-6 / u.yr, bodies=["Ceres"]))

        Raises InputError and UnknownNameError as `with_terms` does.
        """
        system: Any = self
        return cast(Self, system.replaced(forces=(*self.forces, *forces)))

    def with_rigid(self, bodies: str | Mapping[str, RigidBody], body: RigidBody | None = None) -> Self:
        """Return this system with bodies that turn: `with_rigid("Hyperion", orbits.RigidBody(...))`, or a mapping of
        names to several. A body that was rigid before gets the new shape, attitude and spin.

            moon = orbits.RigidBody(shape=(180, 133, 103) * u.km, attitude="Saturn")
            run = orbits.propagate(system.with_rigid("Hyperion", moon), dt="1 h", duration="30 yr")
            run.rotation.attitude("Hyperion")

        The second degree of their gravity acts between all bodies: its torques turn them, and it moves the others and
        themselves. What it is between two rigid bodies, both at once, is of the fourth order in their size over their
        distance, and left out. A body without mass turns in the field of the others. `system.rigid` has the bodies;
        `system.replaced(forces=())` makes them points again.

        Raises InputError as `RigidBody` says, and UnknownNameError for an unknown body.
        """
        from orbits.system.rigid_bodies import RigidBodies

        if isinstance(bodies, str):
            bodies = {bodies: cast("RigidBody", body)}
        elif not isinstance(bodies, Mapping) or body is not None or not bodies:
            raise InputError(
                f"with_rigid got {shown(bodies)}; expected a name and an orbits.RigidBody(...), or a mapping of names "
                "to these."
            )
        system: Any = self
        return cast(Self, system.replaced(forces=(*self.forces, RigidBodies.made(bodies, system))))

    @property
    def rigid(self) -> dict[str, RigidBody]:
        """The rigid bodies by name: moments per unit of mass, attitudes as quaternions, spins as angular velocities."""
        found = [force for force in self.forces if force.kind == RIGID]
        return cast(Any, found[0]).given(cast(Any, self).units) if found else {}

    def _acting(self) -> str:
        """The end of the representation of a system: its terms and forces."""
        words = [f"{type(term).__name__} of {term.whose}" for term in self.terms]
        words += [f"{type(f).__name__} {f.whom}" for f in self.forces]
        return f"; with {', '.join(words)}" if words else ""


def checked_terms(terms: Any, names: Sequence[str], gm: Array, units: UnitSystem) -> tuple[Term, ...]:
    """Return terms in the units of a system, each with the name of its body. Raises as `Modelled.with_terms`."""
    if isinstance(terms, list | tuple) and not terms:
        return ()
    from orbits.lagrangians.terms.base import Term

    found: list[Term] = []
    for term in _each(terms, Term, "a term, such as orbits.terms.ZonalHarmonics(...)", "terms"):
        kind = type(term).__name__
        named = {name: _massive(getattr(term, name), name, kind, names, gm) for name in term.others}
        if not term.of_several:
            heaviest = names[int(np.argmax(gm))]
            named["body"] = _massive(heaviest if term.body is None else term.body, "body", kind, names, gm)
        made = replace(term, **named)
        for other in found:
            if type(other) is type(made) and (term.alone or other.body == made.body):
                one, two = other.whose, made.whose
                whose = repr(one) if one == two else f"{one!r} and {two!r}"
                raise InputError(
                    f"{one!r} has two terms {kind}; expected one. {made.if_two}"
                    if one == two == made.body
                    else f"the system has two terms {kind}, of {whose}; expected one, as they do not add up. "
                    f"{made.if_two}"
                )
        made.check_bodies(names, gm)
        found.append(made.in_units(units))
    return tuple(found)


def _massive(given: Any, what: str, kind: str, names: Sequence[str], gm: Array) -> Any:
    """Return the name, or the tuple of names, of massive bodies that a term names; None for None."""
    if given is None:
        return None
    if isinstance(given, tuple):
        return tuple(_massive(name, what, kind, names, gm) for name in given)
    i = index_of(given, names, of=kind, role="" if what == "body" else what)
    if not gm[i] > 0.0:
        if what != "body":
            raise InputError(f"{kind}: {what} has {names[i]!r}, but gm of {names[i]!r} is 0; expected a massive body.")
        raise InputError(f"{kind} belongs to a body with mass, but gm of {names[i]!r} is 0; expected a massive body.")
    return names[i]


def checked_forces(forces: Any, names: Sequence[str], gm: Array, units: UnitSystem) -> tuple[Force, ...]:
    """Return forces in the units of a system. Raises as `Modelled.with_forces`."""
    if isinstance(forces, list | tuple) and not forces:
        return ()
    from orbits.forces.base import Force
    from orbits.forces.central import CentralForce

    found: list[Force] = []
    for force in _each(forces, Force, "a force, such as orbits.terms.Drag(...)", "forces"):
        kind, bodies = type(force).__name__, force.bodies
        if bodies is not None:
            given = [bodies] if isinstance(bodies, str) else bodies
            if not isinstance(given, list | tuple) or not given:
                raise InputError(f"{kind}: bodies is {shown(bodies)}; expected names, or None for all bodies.")
            bodies = tuple(names[k] for k in indices_of(given, names, of=kind))
            if len(set(bodies)) < len(bodies):
                raise InputError(f"{kind}: bodies names one body twice, {shown(given)}; expected each once.")
        named: dict[str, Any] = {"bodies": bodies}
        if isinstance(force, CentralForce):
            named["source"] = _source(force, bodies, names, gm)
            if force.of_source and any(type(x) is type(force) and x.source == named["source"] for x in found):
                raise InputError(
                    f"{named['source']!r} has two forces {kind}; expected one, of all bodies together. Give all "
                    "that are to act: system.replaced(forces=[...])."
                )
        found.append(replace(force, **named).in_units(units))
    return _with_one_of_rigid(found, names, gm)


def _with_one_of_rigid(forces: Sequence[Any], names: Sequence[str], gm: Array) -> tuple[Force, ...]:
    """Return forces with all rigid bodies in one place, at the end, in the order of the system."""
    rigid = [force for force in forces if force.kind == RIGID]
    others = tuple(force for force in forces if force.kind != RIGID)
    return (*others, reduce(lambda one, other: one.joined(other), rigid).among(names, gm)) if rigid else others


def _source(force: CentralForce, bodies: Any, names: Sequence[str], gm: Array) -> str:
    """Return the name of the body that a force comes from."""
    kind = type(force).__name__
    if force.source is None and force.of_source:
        raise InputError(f"{kind}: source is missing; expected the name of the body to which its numbers belong.")
    i = int(np.argmax(gm)) if force.source is None else index_of(force.source, names, of=kind, role="source")
    if not gm[i] > 0.0:
        raise InputError(
            f"{kind} comes from a body with mass, but gm of {names[i]!r} is 0; expected a massive body as source."
        )
    if bodies is not None and names[i] in bodies:
        raise InputError(f"{kind} comes from {names[i]!r} and cannot act on it; leave {names[i]!r} out of bodies.")
    without = [name for name in bodies or () if not gm[names.index(name)] > 0.0] if force.by_mass else ()
    if without:
        raise InputError(f"{kind} acts by the masses of bodies, but gm of {without[0]!r} is 0; expected massive ones.")
    return names[i]


def _each(given: Any, kind: type, expected: str, what: str) -> Sequence[Any]:
    for item in given if isinstance(given, list | tuple) else [given]:
        if not isinstance(item, kind):
            raise InputError(f"{what} has {shown(item)}; expected {expected}.")
    return given if isinstance(given, list | tuple) else [given]


def together(one: System, other: System) -> dict[str, Any]:
    """Return the combined terms and forces of two systems, without duplicates.

    Raises InputError for forces of one kind and source that differ and act on the same body: both would act on it.
    """
    for mine, theirs in product(one.forces, other.forces):
        if mine in other.forces or theirs in one.forces or (mine.kind, mine.owner) != (theirs.kind, theirs.owner):
            continue
        all_names = dict.fromkeys((*one.names, *other.names))
        on = [set(all_names if x.bodies is None else x.bodies) for x in (mine, theirs)]
        twice = [name for name in all_names if name in on[0] and name in on[1]]
        if twice:
            raise InputError(
                f"{type(mine).__name__} acts on {few(twice, 3)} in both systems, with other "
                "numbers; expected the same force, or one of them alone: system.replaced(forces=[...])."
            )
    terms, forces = ((*mine, *(x for x in theirs if x not in mine)) for mine, theirs in _pairs(one, other))
    return {"terms": terms, "forces": forces}


def without(system: System, gone: Set[str]) -> dict[str, Any]:
    """Return what acts in a system without some bodies: terms of others, and forces on others that they name."""
    forces = [left for left in (force.without(gone) for force in system.forces) if left is not None]
    terms = [left for left in (term.without(gone) for term in system.terms) if left is not None]
    return {"terms": terms, "forces": forces}


def seen_from(system: System, place: Array, velocity: Array) -> dict[str, Any]:
    """Return what acts in a system as seen from an origin at a place, (3,), that moves with a velocity, (3,)."""
    at, moving = u.Quantity(place, system.units.length), u.Quantity(velocity, system.units.speed)
    terms, forces = ([x.seen_from(at, moving) for x in acting] for acting in (system.terms, system.forces))
    return {"terms": terms, "forces": forces}


def _pairs(one: System, other: System) -> tuple[tuple[Sequence[Any], Sequence[Any]], ...]:
    return (one.terms, other.terms), (one.forces, other.forces)


def lagrangian_of(system: System) -> Lagrangian:
    """Return G times the Lagrangian of the massive bodies of a system; coordinates are x, y, z of each in turn."""
    from orbits.lagrangians.newtonian import n_body

    values, massive = system.values, system.massive
    return n_body(values.gm[massive], values.softening, summands_of(system))


def summands_of(system: System) -> list[Summand]:
    """Return the terms of a system bound to its massive bodies."""
    rows = np.cumsum(system.massive) - 1
    count = int(np.count_nonzero(system.massive))
    return [term.among(lambda name: int(rows[system.index(name)]), count, system.units) for term in system.terms]


class Model(NamedTuple):
    """The Lagrangian and forces of some bodies of a system, for a march.

    lagrangian : of the massive bodies; vectors : its parameters, one vector, or one for each term
    forces : the forces without a Lagrangian
    """

    lagrangian: Lagrangian
    vectors: Any
    forces: tuple[BoundForce, ...]

    def check(self) -> None:
        """Raise InputError if kernels of a user read values that have changed since they were first used."""
        for tag in (self.lagrangian.tag, *(force.tag for force in self.forces)):
            tag.check()


def model(system: System, bodies: Any = slice(None)) -> Model:
    """Return the model of the bodies of a system, or of some of them, which must include all massive ones."""
    from orbits.lagrangians.newtonian import newtonian, parameters

    forces: list[BoundForce] = []
    if system.forces:
        from orbits.forces.central import CentralForce
    for force in system.forces:
        massive, names = system.massive[bodies], np.asarray(system.names)[bodies]
        heavy, light = names[massive].tolist(), names[~massive].tolist()
        if force.kind == RIGID:
            forces.append(cast(Any, force).bound_to(heavy, light, system.units))
            continue
        if isinstance(force, CentralForce):
            forces.append(_lasting(force, force.about(heavy.index(force.source), heavy, light, system.units)))
            continue
        on = np.ones(len(names), dtype=bool) if force.bodies is None else np.isin(names, force.bodies)
        forces.append(_bound(force, on[massive], on[~massive], system.units))
    if not system.terms:
        vector = parameters(system.values.gm[system.massive], system.values.softening)
        found = Model(newtonian, vector, tuple(forces))
    else:
        lagrangian = lagrangian_of(system)
        found = Model(lagrangian, lagrangian.parameter_vector, tuple(forces))
    found.check()
    return found


def _bound(force: Force, massive: NDArray[np.bool_], particles: NDArray[np.bool_], units: UnitSystem) -> BoundForce:
    """Return a force bound to bodies, which may be a user's. Raises InputError for what cannot be marched."""
    from orbits.forces.base import BoundForce

    found: Any = force.bound(massive, particles, units)
    if not isinstance(found, BoundForce):
        raise InputError(
            f"bound(...) of {type(force).__name__} returns {shown(found)}; expected an orbits.forces.base.BoundForce"
        )
    found.check(bool(len(particles)))
    return _lasting(force, found)


def _lasting(force: Force, found: BoundForce) -> BoundForce:
    """Return a bound force. Raises InputError for one of the time that would begin anew with the states of a run."""
    from orbits.forces.base import Force

    if type(force).later is Force.later and found.depends_on_time:
        raise InputError(
            f"a kernel of {type(force).__name__} reads t, the time since the epoch of the system, and states of a run "
            "have later epochs; expected a method later(self, time) that returns the force for an epoch that is later "
            "by that quantity, as MassLoss does, or itself where the time changes nothing."
        )
    return found


def require_newtonian(system: System, what: str) -> None:
    """Raise InputError, naming the terms and forces, if there are any, which `what` does not take into account."""
    acting = [type(x).__name__ for x in (*system.terms, *system.forces)]
    if acting:
        raise InputError(
            f"{what} knows Newton's gravity alone, but this system also has {few(acting)}. Leave it out: "
            "system.replaced(terms=(), forces=())."
        )


def whole(system: System, charge: int, newton: Array, q: Array, v: Array, t: Any = 0.0) -> Array:
    """Return a charge of the complete Lagrangian, times G, from that of Newton's.

    q, v : (..., n, 3), of all bodies or of the massive ones only; t : times since the epoch, (...)
    """
    if not system.terms:
        return newton
    from orbits.lagrangians.terms.charges import charges

    massive = system.massive
    if q.shape[-2] != np.count_nonzero(massive):
        q, v = q[..., massive, :], v[..., massive, :]
    return np.asarray(newton + charges(cast("SumOfTerms", lagrangian_of(system)), q, v, t)[charge])


def of_rigid(system: System, charge: int) -> Any:
    """Return what the rigid bodies of a system, as it is, add to a charge, times G."""
    if all(force.kind != RIGID for force in system.forces):
        return 0.0
    from orbits.system import rigid_bodies

    states = rigid_bodies.start_states(system)
    if charge == ENERGY:
        return rigid_bodies.energy(system, system.values.q[system.massive], states)
    if charge == ANGULAR_MOMENTUM:
        return rigid_bodies.angular_momentum(system, system.values.q[system.massive], states)
    return 0.0


def axis(system: System) -> tuple[float, float, float] | None:
    """Return the axis about which angular momentum is conserved, if there is only one; zeros for none; None for all."""
    if not system.terms:
        return None
    from orbits.lagrangians.terms.base import axis_of

    return axis_of(summands_of(system))


def most_inner(system: System) -> int:
    """Return the largest number of internal variables of a force."""
    return max(force.variables for force in system.forces) if system.forces else 0


def continued(system: System, accounts: Array, names: Sequence[str] | None = None) -> System:
    """Return a system with the internal variables of its forces as in the accounts of a sample, (forces, 7 + inner).

    names : the bodies of the march that the accounts are of, if it has not all massless ones
    """
    if not most_inner(system):
        return system
    from orbits.kernels.gravity.terms_and_forces import FIGURES

    found: list[Any] = []
    for force, row in zip(system.forces, accounts, strict=True):
        inner = row[FIGURES : FIGURES + force.variables]
        if force.kind == RIGID and names is not None:
            found.append(cast(Any, force).continued_some(inner, names, system.units))
        else:
            found.append(force.continued(inner, system.units) if force.variables else force)
    return system.replaced(forces=found)


def depends_on_time(system: System) -> bool:
    """Return whether a term of a system depends on time, so that energy is not conserved."""
    from orbits.lagrangians.base import TIME_DEPENDENT

    return any(TIME_DEPENDENT in summand.traits for summand in summands_of(system))


def centre(system: System, q: Array, v: Array, t: Any = 0.0) -> Array:
    """Return the centre of mass of the massive bodies, (..., 3), in which energies weigh too if a term says so.

    q, v : (..., n, 3), of the massive bodies; t : times since the epoch, (...)
    """
    gm = masses_at(system, t)[..., system.massive]
    newton = centre_of(gm, q)
    more = inertia(system, q, v, t)
    if more is None:
        return newton
    # Energies are small beside masses, so that the departure from Newton's centre needs no more digits.
    moved = np.sum(more[..., None] * (q - newton[..., None, :]), axis=-2)
    return np.asarray(newton + moved / (gm.sum(axis=-1) + more.sum(axis=-1))[..., None])


def centre_velocity(system: System, q: Array, v: Array, t: Any = 0.0) -> Array:
    """Return the velocity of the centre of mass: momentum over mass, with the energies in both. As `centre`."""
    from orbits.diagnostics import linear_momentum

    gm, more = masses_at(system, t)[..., system.massive], inertia(system, q, v, t)
    if more is None:
        return centre_of(gm, v)
    momentum = whole(system, MOMENTUM, linear_momentum(gm, v), q, v, t)
    return np.asarray(momentum / (gm.sum(axis=-1) + more.sum(axis=-1))[..., None])


def masses_at(system: System, t: Any = 0.0) -> Array:
    """Return the GM of the bodies at times since the epoch, (..., n), or (n,) where no force changes it."""
    return changed_masses(t, system.forces, system.values.gm, system.names, system.units)


def centre_of(gm: Array, x: Array) -> Array:
    """Return the centres of mass, (..., 3), of places or velocities x, (..., n, 3); gm : (n,), or (samples, n)."""
    from orbits.diagnostics import centre_of_mass

    if gm.ndim == 1:
        return centre_of_mass(gm, x)
    return np.array([centre_of_mass(*one) for one in zip(gm, x, strict=True)]).reshape(*x.shape[:-2], 3)


def inertia(system: System, q: Array, v: Array, t: Any = 0.0) -> Array | None:
    """Return what massive bodies weigh in the centre of mass besides GM, (..., n); None for nothing. As `centre`."""
    if not system.terms:
        return None
    lagrangian = cast("SumOfTerms", lagrangian_of(system))
    if all(summand.galilean for summand in lagrangian.summands):
        return None
    from orbits.lagrangians.terms.charges import inertia_of

    return inertia_of(lagrangian, q, v, t)


def given_bodies(system: System) -> tuple[str, ...]:
    """Return the names of the massive bodies of a system that are read from an ephemeris."""
    return tuple(name for term in system.terms for name in term.gives_bodies)


def acts_on_massive(system: System) -> tuple[str, ...]:
    """Return the kinds of the forces that act on massive bodies."""
    massive = {name for name, has_mass in zip(system.names, system.massive, strict=True) if has_mass}
    found = []
    for force in system.forces:
        if force.kind == RIGID:  # part of the Lagrangian
            continue
        on = massive if force.bodies is None else massive.intersection(force.bodies)
        if on - {getattr(force, "source", None)}:
            found.append(type(force).__name__)
    return tuple(found)
