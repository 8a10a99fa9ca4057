"""Damping of orbits by a disk: semi-major axes, eccentricities and inclinations decay at given rates.

    f_i = m_i [-w / (2 tau_a) - 2 (r . w) r / (r^2 tau_e) - 2 (w . z) z / tau_i]

with r and w place and velocity relative to the star, and z the pole of the disk. The star does not feel it. Numbers: z;
coefficients: the rates 1 / tau_a, 1 / tau_e, 1 / tau_i. For an orbit in no other force than the star's,

    da/dt = -a / tau_a - 4 a [1 - sqrt(1 - e^2)] / tau_e,   de/dt = -2 (1 - e^2) [1 - sqrt(1 - e^2)] / (e tau_e)

averaged over its period and to first order in the rates, and di/dt = -i / tau_i for small i.

Source: Papaloizou & Larwood (2000), MNRAS 315, 823.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

from orbits.checks import pole_direction
from orbits.errors import InputError
from orbits.forces.central import CentralForce
from orbits.kernels.binding import Tag
from orbits.kernels.compile import kernel
from orbits.kernels.gravity.central_forces import OWN


@kernel(inline=True)
def acceleration(strength, own, t, b, A, r, w):
    """Return the acceleration by the three rates."""
    x, y, z = r
    vx, vy, vz = w
    along = 2.0 * A[1] * (x * vx + y * vy + z * vz) / (strength[0] + x * x + y * y + z * z)
    across = 2.0 * A[2] * (vx * own[OWN] + vy * own[OWN + 1] + vz * own[OWN + 2])
    slow = 0.5 * A[0]
    return (
        -1.0 * (slow * vx + along * x + across * own[OWN]),
        -1.0 * (slow * vy + along * y + across * own[OWN + 1]),
        -1.0 * (slow * vz + along * z + across * own[OWN + 2]),
    )


TAG = Tag("damping", {"acceleration": acceleration, "numbers": 3, "coefficients": 3})


@dataclass(frozen=True)
class Damping(CentralForce):
    """The damping of orbits by a disk: semi-major axes decay within tau_a, eccentricities within tau_e, inclinations
    within tau_i.

        system.with_forces(orbits.terms.Damping(tau_a=1e5 * u.yr, tau_e=1e3 * u.yr, bodies=["b", "c"]))

    bodies : names of the bodies that it acts on, massive or not; by default all but the source
    source : the star; by default the most massive body
    tau_a, tau_e, tau_i : times, in which a, e and i decay by the factor e: one each, or one for each of `bodies`; None
        for no decay. Negative ones are growth.
    pole : of the disk, (right ascension, declination) or a vector; by default z. Only for tau_i
    """

    kind: ClassVar[str] = "damping"
    per_body: ClassVar[tuple[str, ...]] = ("tau_a", "tau_e", "tau_i")
    tag: ClassVar[Tag] = TAG
    tau_a: Any = None
    tau_e: Any = None
    tau_i: Any = None
    pole: Any = (0.0, 0.0, 1.0)

    @classmethod
    def examples(cls) -> tuple[Self, ...]:
        """Return examples of it; see `Force`."""
        return (cls(tau_a=300.0, tau_e=50.0, tau_i=100.0, pole=(0.0, 0.6, 0.8)),)

    def in_units(self, units: Any) -> Self:
        """Return it with times in the system's unit, and a unit vector for the pole."""
        given = [name for name in self.per_body if getattr(self, name) is not None]
        if not given:
            raise InputError(
                "Damping: tau_a, tau_e and tau_i are missing; expected one time at least, such as tau_a=1e5 * u.yr."
            )
        times = {name: self.in_unit(units.time, name, units.time_value) for name in given}
        for name, value in times.items():
            floats = self.floats(value, units.time_value)
            if 0.0 in (floats if isinstance(floats, tuple) else (floats,)):
                raise InputError(f"Damping: {name} is 0; expected a time other than 0, or None for no decay.")
        return replace(self, **times, pole=pole_direction(self.pole, "pole of Damping", units))

    def constants(self, row: int, units: Any) -> Sequence[float]:
        """Return the pole."""
        return tuple(self.pole)

    def coefficients(self, units: Any) -> Sequence[float | tuple[float, ...]]:
        """Return the rates."""
        return [self._rates(getattr(self, name), units) for name in self.per_body]

    def _rates(self, times: Any, units: Any) -> float | tuple[float, ...]:
        if times is None:
            return 0.0
        found = self.floats(times, units.time_value)
        return tuple(1.0 / x for x in found) if isinstance(found, tuple) else 1.0 / found
