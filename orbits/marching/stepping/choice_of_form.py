"""The choice of the form of a method for a Lagrangian."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

from orbits.errors import InputError
from orbits.forces.base import BoundForce
from orbits.integrators import registry
from orbits.integrators.base import Integrator
from orbits.integrators.canonical.bodies import CanonicalBodies
from orbits.integrators.collocation.given_bodies import GivenBodies
from orbits.integrators.forms import Form
from orbits.integrators.kicks_and_drifts.splitting import Splitting
from orbits.kernels.gravity.rigid_bodies import TAG as RIGID
from orbits.kernels.lanes import WIDTH
from orbits.lagrangians.base import GIVEN, GRADIENTS, MASSLESS_PARTICLES, SEPARABLE, Lagrangian
from orbits.marching.clocks.clock import Clock


def form_for(integrator: Integrator, lagrangian: Lagrangian, *, canonical: bool = False) -> Form:
    """Return the form of a method for a Lagrangian: the canonical one if it is requested or the only one.

    Raises InputError, naming suitable methods, if there is none.
    """
    integrator.check(lagrangian, registry)
    form = integrator.form(lagrangian, canonical=canonical)
    if form is None:
        raise InputError(f"{integrator.label} has no canonical form for '{lagrangian.name}'")
    return form


def form_of_bodies(
    integrator: Integrator,
    lagrangian: Lagrangian,
    clock: Clock,
    *,
    with_particles: bool,
    forces: Sequence[BoundForce] = (),
) -> Form:
    """Return the form that marches bodies in positions and velocities.

    forces : the forces without a Lagrangian that act on them

    Raises InputError as `form_for` does; if the method supports neither the Lagrangian nor the forces in this form,
    naming those that do; and for massless particles if the form does not support them.
    """
    rigid = next((force for force in forces if force.tag is RIGID), None)
    if rigid is not None:
        return _rigid(integrator, lagrangian, clock, rigid, forces, with_particles=with_particles)
    own = clock.own_form(integrator, lagrangian, forces, with_particles=with_particles)
    if own is not None:
        return own
    if forces or GIVEN in lagrangian.traits:  # whose tables are large, and not to be kept
        return _of_point_masses(integrator, lagrangian, type(clock), with_particles, tuple(forces))
    try:
        return _known(integrator, lagrangian, type(clock), with_particles)  # type: ignore[arg-type]
    except TypeError:  # a method of a user that cannot be hashed
        return _of_point_masses(integrator, lagrangian, type(clock), with_particles)


def _of_point_masses(
    integrator: Integrator,
    lagrangian: Lagrangian,
    clock: type[Clock],
    with_particles: bool,
    forces: tuple[BoundForce, ...] = (),
) -> Form:
    """Return the form for steps of constant length in time, or that are chosen one by one."""
    if (SEPARABLE in lagrangian.traits or integrator.follows_kepler) and not forces:
        form = form_for(integrator, lagrangian)
    else:
        form = _form_with(integrator, lagrangian, forces)
    form = clock.adapted(form)
    if with_particles and MASSLESS_PARTICLES not in lagrangian.traits:
        raise InputError(f"'{lagrangian.name}' does not define how massless particles move; give them a small mass.")
    form = form.for_particles() if with_particles else form
    if with_particles and not form.serves_particles:
        raise InputError(
            f"{integrator.label} steps '{lagrangian.name}' for massive bodies only; give the massless ones a small "
            "mass, or use a method that takes particles, such as Gauss(stages=8)"
        )
    in_lanes = form.own_kernels().get("width", WIDTH) == WIDTH
    if with_particles and form.particle_carry_rows and in_lanes and not form.keeps_particles:
        raise InputError(
            f"{integrator.label} has a carry of massless particles in lanes, which is not kept from block to block; "
            "expected particle_carry_rows = 0, a kernel keep_particles, or the constant width = 1: one particle at a "
            "time"
        )
    return form


_known = lru_cache(maxsize=64)(_of_point_masses)


def _rigid(
    integrator: Integrator,
    lagrangian: Lagrangian,
    clock: Clock,
    rigid: BoundForce,
    forces: Sequence[BoundForce],
    *,
    with_particles: bool,
) -> Form:
    """Return the form for bodies of which some are rigid: kicks and drifts that turn them too."""
    form = integrator.second_order
    able = "StormerVerlet(), SymplecticEuler() or, to order 4, 6, 8 or 10, Composition(order=8)"
    if clock.changes or not isinstance(form, Splitting):
        what = "steps that are chosen" if clock.changes else integrator.label
        raise InputError(
            f"rigid bodies are turned by kicks and drifts of one length, which {what} does not consist of: give "
            f"dt=... and {able}."
        )
    others = [force.name for force in forces if force is not rigid]
    if others:
        raise InputError(
            f"rigid bodies march by kicks and drifts, in which the force of {others[0]} has no place; leave one of the "
            "two out."
        )
    if GIVEN in lagrangian.traits or SEPARABLE not in lagrangian.traits:
        what = "bodies of an ephemeris" if GIVEN in lagrangian.traits else f"the terms of '{lagrangian.name}'"
        raise InputError(
            f"rigid bodies march by kicks and drifts, which {what} do not allow; they go with terms of positions "
            "alone, such as orbits.terms.ZonalHarmonics(...)."
        )
    tops = getattr(rigid, "tops", ()) if with_particles else ()
    from orbits.integrators.rigid.splitting import RigidSplitting

    return RigidSplitting(form.lengths, form.drifts, getattr(rigid, "rigid", 0), tops)


def _form_with(integrator: Integrator, lagrangian: Lagrangian, forces: Sequence[BoundForce]) -> Form:
    """Return the form for a Lagrangian that is not separable, or with forces without a Lagrangian."""
    count, inner = len(forces), sum(len(force.inner) for force in forces)
    form = integrator.form_with(count, inner) if GRADIENTS in lagrangian.traits else None
    if GIVEN in lagrangian.traits:
        if inner:
            changed = next(force.name for force in forces if len(force.inner))
            raise InputError(
                f"the force of {changed} changes a spin, which bodies of an ephemeris do not have; leave it out, or "
                "integrate all bodies, as System.solar_system(...) does."
            )
        form = GivenBodies(form.tableau, form.forces) if isinstance(form, CanonicalBodies) else None
    if form is not None:
        return form
    able = sorted(c.__name__ for c in registry().values() if any(m.form_with(count, inner) for m in c.examples()))
    what = f"with the force of {forces[0].name}" if forces else f"by '{lagrangian.name}', which is not separable"
    raise InputError(f"{integrator.label} cannot march bodies {what}. Use {' or '.join(able)}, of up to 8 stages.")
