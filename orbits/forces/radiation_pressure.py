"""Radiation pressure with Poynting–Robertson drag: light of a star on dust, to first order in v / c.

    f_i = beta_i (m_i mu / r^2) [(1 - r' / c) r/r - w / c]

with mu = GM of the star, r and w place and velocity relative to it, and r' = r . w / r. The star does not feel it.
Numbers: 1 / c; coefficients: beta. Over an orbit,

    da/dt = -beta mu (2 + 3 e^2) / [c a (1 - e^2)^(3/2)],   de/dt = -5 beta mu e / [2 c a^2 (1 - e^2)^(1/2)]

Source: Burns, Lamy & Soter (1979), Icarus 40, 1; Wyatt & Whipple (1950), ApJ 111, 134.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np

from orbits.checks import light_speed
from orbits.errors import InputError, shown
from orbits.forces.central import CentralForce
from orbits.kernels.binding import Tag
from orbits.kernels.compile import kernel
from orbits.kernels.gravity.central_forces import OWN
from orbits.kernels.lanes import rsqrt_cubed

SUNLIGHT = 3 * 3.828e26 / (16 * np.pi * 1.3271244e20 * 299792458.0)
"""3 L / (16 pi GM c) of the Sun, with the nominal values of the IAU (2015, resolution B3), in kg/m2: beta of a sphere
times its radius and density."""


@kernel(inline=True)
def acceleration(strength, own, t, b, A, r, w):
    """Return the acceleration for beta = 1."""
    x, y, z = r
    vx, vy, vz = w
    r2 = strength[0] + x * x + y * y + z * z
    near3 = rsqrt_cubed(r2)
    near = near3 * r2
    size = strength[1 + b] * near3
    shade = 1.0 - own[OWN] * near * (x * vx + y * vy + z * vz)
    far = own[OWN] * near * r2
    return size * (shade * x - far * vx), size * (shade * y - far * vy), size * (shade * z - far * vz)


TAG = Tag("radiation-pressure", {"acceleration": acceleration, "numbers": 1, "coefficients": 1})


@dataclass(frozen=True)
class RadiationPressure(CentralForce):
    """Light of a star on dust: radiation pressure with Poynting–Robertson drag, to first order in v/c.

        system.with_forces(orbits.terms.RadiationPressure(beta=0.05, bodies=["grain"]))

    bodies : names of the bodies that it acts on, massive or not; by default all but the source
    source : the star; by default the most massive body
    beta : the ratio of radiation pressure to gravity, >= 0: one number, or one for each of `bodies`; `beta_of_sphere`
        computes it
    c : the speed of light; required if units are dimensionless
    """

    kind: ClassVar[str] = "radiation-pressure"
    per_body: ClassVar[tuple[str, ...]] = ("beta",)
    tag: ClassVar[Tag] = TAG
    beta: Any = None
    c: Any = None

    @staticmethod
    def beta_of_sphere(radius: Any, density: Any, efficiency: float = 1.0) -> Any:
        """Return beta in sunlight of spheres of a radius and a density, quantities; floats or arrays.

        efficiency : of radiation pressure, averaged over the spectrum; 1 for spheres larger than about 1 um

        Raises InputError for what is not a length > 0, a density > 0 or a number >= 0.
        """
        try:
            surface = np.asarray((radius * density).to_value("kg / m2"))
        except (AttributeError, TypeError, ValueError) as error:
            raise InputError(
                f"radius is {shown(radius)} and density {shown(density)}; expected a length and a density, such as "
                "1 * u.um and 2500 * u.kg / u.m**3."
            ) from error
        if not (np.all(surface > 0.0) and np.all(np.asarray(efficiency) >= 0.0)):
            raise InputError(
                f"radius x density is {shown(surface.tolist())} kg/m2 and efficiency {shown(efficiency)}; expected "
                "radius and density > 0 and efficiency >= 0."
            )
        return efficiency * SUNLIGHT / surface

    @classmethod
    def examples(cls) -> tuple[Self, ...]:
        """Return examples of it; see `Force`."""
        return (cls(beta=0.01, c=10.0),)

    def in_units(self, units: Any) -> Self:
        """Return it with floats for beta, and c in the system's unit."""
        if self.beta is None:
            raise InputError("RadiationPressure: beta is missing; expected a number >= 0, such as beta=0.05.")
        beta = self.in_unit(1.0, "beta", units.pure_value)
        if np.any(np.asarray(beta) < 0.0):
            raise InputError(f"RadiationPressure: beta is {shown(beta)}; expected numbers >= 0.")
        return replace(self, beta=beta, c=light_speed(self, units) * units.speed)

    def constants(self, row: int, units: Any) -> Sequence[float]:
        """Return 1 / c."""
        return (1.0 / float(units.speed_value(self.c)),)

    def coefficients(self, units: Any) -> Sequence[float | tuple[float, ...]]:
        """Return beta."""
        return (self.beta,)
