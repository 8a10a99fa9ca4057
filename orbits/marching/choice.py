"""Which form of a method marches a Lagrangian."""

from __future__ import annotations

from orbits.errors import InputError
from orbits.integrators import registry
from orbits.integrators.base import Integrator
from orbits.integrators.forms import Form
from orbits.lagrangians.base import Lagrangian


def form_for(
    integrator: Integrator, lagrangian: Lagrangian, *, canonical: bool = False, with_particles: bool = False
) -> Form:
    """Return the form, in positions and momenta if that is asked for or the only one.

    Raises InputError, naming the methods that can, where there is none.
    """
    integrator.check(lagrangian, registry())
    form = integrator.form(lagrangian, canonical=canonical)
    if form is None:
        raise InputError(f"{integrator.label} has no canonical form for '{lagrangian.name}'")
    if with_particles and not form.serves_particles:
        raise InputError(
            f"{integrator.label} steps '{lagrangian.name}' for massive bodies only; give the massless ones a small "
            "mass, or use a method that takes particles, such as Gauss(stages=8)"
        )
    return form
