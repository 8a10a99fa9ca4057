"""The shadow energy at the samples of a run: what its steps conserve, where the energy oscillates."""

from __future__ import annotations

from typing import Any

import numpy as np
from astropy import units as u

from orbits.checks import is_whole
from orbits.diagnostics.shadow import require_shadow, shadow_energies, taken_back
from orbits.errors import InputError, shown
from orbits.integrators.base import Integrator
from orbits.marching.flow import DiscretePath
from orbits.system.model import acts_on_massive, depends_on_time, given_bodies, lagrangian_of
from orbits.trajectory import Trajectory

MORE, MOST = 6, 12
"""How far the order may be above that of the method, by default and at most."""


def shadow_energy(run: Trajectory | DiscretePath, order: int | None = None) -> Any:
    """Return the shadow energy at the samples of a run, (n,): that of the modified Hamiltonian that its steps conserve.

    run : of `orbits.propagate` with steps of one length, or a path of `orbits.march`
    order : even, above that of the method by up to 12: the power of h by which the result is off; by default 6 more

    The energy of a variational method oscillates by O(h^r), r being its order. Its steps follow the motion of a
    modified Hamiltonian, whose value hardly changes: what is seen of it here oscillates by O(h^order), down to
    round-off. A drift that the energy's own oscillation hides shows in it: of round-off, or of encounters that the
    step does not resolve.

    It is computed from the steps next to each sample, or next to the last step before one that lies between two. They
    are taken again on a copy, as many as `order` is above that of the method, with the true motion beside them. For a
    run it is the energy of the massive bodies, of the whole Lagrangian, in the unit of `run.energy()`; for a path it is
    a number, like `path.energy()`. For methods that are not symmetric it is that of the middle of the steps, which
    begin at the sample.

    Raises InputError for a method that is not variational, or on Kepler orbits; for steps that are chosen or that
    depend on the state; for terms that depend on time, bodies of an ephemeris, rigid bodies of a system, and forces
    without a Lagrangian on massive bodies; and for other orders. IntegrationError if the steps next to a sample cannot
    be taken.

        run = orbits.propagate(system, orbits.StormerVerlet(), dt=1 * u.day, duration=100 * u.yr)
        np.ptp(run.energy()), np.ptp(orbits.shadow_energy(run))
    """
    if not isinstance(run, Trajectory | DiscretePath):
        raise InputError(f"expected a run of orbits.propagate or a path of orbits.march; got {shown(run)}")
    if not isinstance(run.integrator, Integrator):
        raise InputError(f"{run.integrator.label} is not a method of this package, so its steps are not known.")
    order = _order(run.integrator, order)
    if isinstance(run, DiscretePath):
        require_shadow(run.lagrangian, run.integrator)
        return shadow_energies(run.lagrangian, run.integrator, run.dt, run.q, run.p, run.t, order)
    _check(run)
    energies = np.empty(len(run))
    for samples, system, q, v in run._blocks():
        lagrangian = lagrangian_of(system)
        require_shadow(lagrangian, run.integrator)
        q, v = (np.asarray(x).reshape(len(x), -1) for x in (q, v))
        p = np.array([lagrangian.momentum(x, w) for x, w in zip(q, v, strict=True)])
        rests = np.array([run.clock.place(float(t)).rest for t in run.times[samples]])
        states = taken_back(lagrangian, run.integrator, rests, q, p, run.times[samples])
        energies[samples] = shadow_energies(lagrangian, run.integrator, run.step, *states, order)
    return u.Quantity(energies / run.system.units.G, run.system.units.energy)


def _order(integrator: Integrator, order: Any) -> int:
    own = integrator.order
    least, most = own + 2 - own % 2, own + MOST - own % 2
    if order is None:
        return own + MORE - own % 2
    if not is_whole(order) or order % 2 or not least <= order <= most:
        raise InputError(
            f"order is {shown(order)}; expected an even number from {least} to {most}, as {integrator.label} has order "
            f"{own}."
        )
    return int(order)


def _check(run: Trajectory) -> None:
    if not np.isfinite(run.step):
        raise InputError(
            f"this run took {run.made_by}: with steps that depend on the state no method is the map of one modified "
            "Hamiltonian. Expected steps of one length, dt=..."
        )
    if given_bodies(run.system):
        raise InputError(
            "the massive bodies are read from an ephemeris: nothing of theirs is integrated, or conserved. Expected "
            "bodies that are all integrated, such as those of System.solar_system()."
        )
    if forces := acts_on_massive(run.system):
        raise InputError(
            f"the force of {forces[0]} has no Lagrangian, and takes energy from the massive bodies or gives it: there "
            "is none that the steps conserve. Expected a system without it: system.replaced(forces=())."
        )
    if any(run.system.massive[run.system.index(name)] for name in run.system.rigid):
        raise InputError(
            "the rotation of rigid bodies is part of the energy that the steps conserve, and not among the coordinates "
            "that are looked at here. Expected a path of orbits.march, such as of orbits.lagrangians.full_two_body, or "
            "a system without them: system.replaced(forces=())."
        )
    if depends_on_time(run.system):
        raise InputError(
            "a term of the system depends on time: there is no energy to keep, and no shadow of it. Expected terms "
            "that do not."
        )
