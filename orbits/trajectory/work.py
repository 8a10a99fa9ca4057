"""Work, torque and impulse of forces without a Lagrangian on the massive bodies of a run, summed over its steps."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from astropy import units as u
from numpy.typing import NDArray

from orbits.errors import InputError, counted
from orbits.system.model import given_bodies
from orbits.system.rigid_body import RIGID

if TYPE_CHECKING:
    from orbits.forces.base import Force
    from orbits.trajectory.trajectory import Trajectory

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class ForceEffect:
    """Work, torque and impulse of one force on the massive bodies, from the start of the run up to each of n samples.

    force : the force of the system
    inner : (n, variables), the internal variables of the force at the samples, such as a spin, in the system's units
    work : (n,), an energy; torque : (n, 3), the time integral about the origin, an angular momentum; impulse : (n, 3)

    They are sums over the stages of the steps, with the weights of the method: momentum and angular momentum change by
    impulse and torque up to round-off, energy changes by the work up to an error of the order of the method.
    """

    force: Force
    work: u.Quantity
    torque: u.Quantity
    impulse: u.Quantity
    inner: Array

    def __repr__(self) -> str:
        last = f"{self.work[-1]:.6g}" if len(self.work) else "nothing yet"
        count = counted(len(self.work), "sample")
        return f"{type(self.force).__name__} {self.force.whom}: work {last} at the last of {count}"


def accounts_of(run: Trajectory) -> Array:
    """Return work, torque and impulse of each force up to each sample, times G, and its internal variables there,
    (n, forces, 7 + inner).

    Raises InputError for a trajectory that has only samples of a run.
    """
    count = len(run.system.forces)
    if not count:
        return np.zeros((len(run), 0, 7))
    found: Any = run._accounts
    if found is None and run.archive is not None:
        found = run.archive.checkpoint().get("accounts")
    if found is None:
        raise InputError(
            f"{run!r} has only samples, but the work of forces is summed during a run; expected the run as "
            "orbits.propagate or orbits.resume returned it, or some of its samples, run[10:20]."
        )
    return np.asarray(found[: len(run)])


def effects(run: Trajectory) -> tuple[ForceEffect, ...]:
    """Return the effect of each force of a run. Raises what `accounts_of` raises, and InputError among bodies of an
    ephemeris.
    """
    if run.system.forces and given_bodies(run.system):
        raise InputError(
            "the work of forces is not summed where massive bodies are read from an ephemeris; integrate all of them, "
            "as System.solar_system(...) does."
        )
    units, known = run.system.units, accounts_of(run)
    found = known / units.G
    return tuple(
        ForceEffect(
            force,
            u.Quantity(found[:, k, 0], units.energy),
            u.Quantity(found[:, k, 1:4], units.angular_momentum),
            u.Quantity(found[:, k, 4:7], units.momentum),
            known[:, k, 7 : 7 + force.variables],
        )
        for k, force in enumerate(run.system.forces)
        if force.kind != RIGID  # which have a Lagrangian
    )
