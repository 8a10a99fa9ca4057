"""Which form of a method marches a Lagrangian."""

from __future__ import annotations

from dataclasses import replace

from orbits.errors import InputError
from orbits.integrators import registry
from orbits.integrators.base import Integrator
from orbits.integrators.collocation import Collocation
from orbits.integrators.forms import Form
from orbits.kernels.lanes import WIDTH
from orbits.lagrangians.base import SEPARABLE, Lagrangian
from orbits.marching.clocks import Clock


def form_for(integrator: Integrator, lagrangian: Lagrangian, *, canonical: bool = False) -> Form:
    """Return the form, in positions and momenta if that is asked for or the only one.

    Raises InputError, naming the methods that can, where there is none.
    """
    integrator.check(lagrangian, registry())
    form = integrator.form(lagrangian, canonical=canonical)
    if form is None:
        raise InputError(f"{integrator.label} has no canonical form for '{lagrangian.name}'")
    return form


def form_of_bodies(integrator: Integrator, lagrangian: Lagrangian, clock: Clock, *, with_particles: bool) -> Form:
    """Return the form in which bodies are marched by their positions and velocities.

    Raises InputError as `form_for`, for Lagrangians whose velocities are not their momenta, and for massless particles
    where the form has none.
    """
    form = form_for(integrator, lagrangian)
    if clock.changes:
        return _changing(form, lagrangian, with_particles=with_particles)
    if SEPARABLE not in lagrangian.traits:
        raise InputError(
            f"'{lagrangian.name}' is not separable: its momenta are not its velocities, by which bodies are marched "
            "here; use orbits.march, which takes any Lagrangian"
        )
    if with_particles and not form.serves_particles:
        raise InputError(
            f"{integrator.label} steps '{lagrangian.name}' for massive bodies only; give the massless ones a small "
            "mass, or use a method that takes particles, such as Gauss(stages=8)"
        )
    if with_particles and form.particle_carry_rows and form.own_kernels().get("width", WIDTH) == WIDTH:
        raise InputError(
            f"{integrator.label} carries numbers of massless particles that lie in lanes from step to step, which are "
            "not kept; expected particle_carry_rows = 0, or the constant width = 1: one particle at a time"
        )
    return form


def _changing(form: Form, lagrangian: Lagrangian, *, with_particles: bool) -> Form:
    """Return the form for steps that differ in length: bodies come close, and distances keep their digits."""
    if not isinstance(form, Collocation):
        raise InputError(
            f"'{lagrangian.name}' is not separable, and steps are chosen for separable Lagrangians only: give dt=..."
        )
    if with_particles:
        raise InputError(
            "massless particles are marched with constant steps only, so far: give dt=..., or give them a small mass"
        )
    return replace(form, close=True)
