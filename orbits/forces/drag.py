"""Linear drag: a force against the velocity relative to a medium that moves uniformly.

    f_i = -k m_i (v_i - u)

Parameters: u (3), then k of each massive body, then k of each particle and eight zeros.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from orbits.errors import InputError, with_unit
from orbits.forces.base import BoundForce, Force
from orbits.kernels.binding import Tag
from orbits.kernels.compile import kernel
from orbits.kernels.gravity.central_forces import coefficient, push
from orbits.kernels.lanes import WIDTH, get

RATES = 3
"""The index of the first k in the parameters."""


@kernel
def force(strength, own, t, q, v, f):
    """Add -k GM (v - u) to f."""
    n = strength.shape[0] - 1
    for i in range(n):
        behind = own[0] - get(v, i), own[1] - get(v, n + i), own[2] - get(v, 2 * n + i)
        push(f, i, n, own[RATES + i] * strength[1 + i], behind)


@kernel
def particle_force(strength, own, t, particle, sources, speeds, place, velocity):
    """Return -k (v - u)."""
    k = coefficient(own, RATES + strength.shape[0] - 1, particle, sources, place[0])
    return -1.0 * k * (velocity[0] - own[0]), -1.0 * k * (velocity[1] - own[1]), -1.0 * k * (velocity[2] - own[2])


TAG = Tag("drag", {"force": force, "particle_force": particle_force})


@dataclass(frozen=True)
class Drag(Force):
    """Linear drag, -k m (v - u): velocities relative to a medium decay by the factor e in the time 1/k.

        system.with_forces(orbits.terms.Drag(rate=1e-6 / u.yr, bodies=["Ceres"]))

    bodies : names of the bodies that it acts on, massive or not; by default all
    rate : k, >= 0, with the dimension 1/time
    velocity : u, the velocity of the medium, x, y, z in the axes of the system; by default it is at rest
    """

    kind: ClassVar[str] = "drag"
    rate: Any = None
    velocity: Any = (0.0, 0.0, 0.0)

    @classmethod
    def examples(cls) -> tuple[Self, ...]:
        """Return examples of it; see `Force`."""
        return (cls(rate=1e-3, velocity=(0.1, 0.0, -0.1)),)

    def in_units(self, units: Any) -> Self:
        """Return it with rate and velocity in the system's units."""
        if self.rate is None:
            raise InputError("Drag: rate is missing; expected a number per time, such as rate=1e-6 / u.yr.")
        rate = np.asarray(units.frequency_value(self.rate, "the rate of Drag"))
        if rate.shape != () or not np.isfinite(rate) or rate < 0.0:
            shown = with_unit(rate.tolist(), f"per {units.time}" if str(units.time) else "")
            raise InputError(f"Drag: rate is {shown}; expected one finite number >= 0.")
        velocity = np.asarray(units.speed_value(self.velocity, "the velocity of Drag"))
        if velocity.shape != (3,) or not np.all(np.isfinite(velocity)):
            shown = with_unit(velocity.tolist(), units.speed)
            raise InputError(f"Drag: velocity is {shown}; expected three finite numbers.")
        return replace(self, rate=float(rate) / units.time, velocity=tuple(float(x) * units.speed for x in velocity))

    def seen_from(self, place: Any, velocity: Any) -> Self:
        """Return it with the velocity of the medium relative to an origin that moves."""
        return replace(self, velocity=tuple(own - of for own, of in zip(self.velocity, velocity, strict=True)))

    def bound(self, massive: NDArray[np.bool_], particles: NDArray[np.bool_], units: Any) -> BoundForce:
        """Return this force bound to these massive bodies and particles."""
        rate = float(units.frequency_value(self.rate))
        u = units.speed_value(self.velocity)
        own = np.concatenate([u, np.where(massive, rate, 0.0), np.where(particles, rate, 0.0), np.zeros(WIDTH)])
        return BoundForce("drag", TAG, np.ascontiguousarray(own, dtype=np.float64))
