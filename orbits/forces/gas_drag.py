"""The drag of a gas disk that turns slower than Kepler's circles, quadratic in the velocity relative to it.

    f_i = -m_i k_i (r/r0)^(-p) |w - u| (w - u),   u = sqrt((1 - 2 eta) mu / r) t,   t = z x r / |z x r|

with r and w place and velocity relative to the star, mu its GM, and z the pole of the disk. The disk's height is not
resolved: its density is that of its middle plane. The star does not feel it. Numbers: z, 1/r0, p, 1 - 2 eta;
coefficients: k = (3/8) C_D rho(r0) / (s rho_s) for a sphere of the radius s and the density rho_s.

Source: Adachi, Hayashi & Nakazawa (1976), Prog. Theor. Phys. 56, 1756.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np

from orbits.checks import pole_direction
from orbits.errors import InputError, shown
from orbits.forces.central import CentralForce
from orbits.kernels.binding import Tag
from orbits.kernels.compile import kernel
from orbits.kernels.gravity.central_forces import OWN
from orbits.kernels.lanes import rsqrt_cubed, sqrt
from orbits.kernels.lanes.functions import power

NEAR, SLOPE, SUPPORT = OWN + 3, OWN + 4, OWN + 5


@kernel(inline=True)
def acceleration(strength, own, t, b, A, r, w):
    """Return the acceleration for k = 1."""
    x, y, z = r
    tx, ty, tz = own[OWN + 1] * z - own[OWN + 2] * y, own[OWN + 2] * x - own[OWN] * z, own[OWN] * y - own[OWN + 1] * x
    t2 = tx * tx + ty * ty + tz * tz
    r2 = strength[0] + x * x + y * y + z * z
    near = rsqrt_cubed(r2) * r2
    # Above the pole the gas has no direction, and none is taken.
    fast = sqrt(own[SUPPORT] * strength[1 + b] * near) * (rsqrt_cubed(t2 + (t2 == 0.0) * 1.0) * t2)
    x, y, z = w[0] - fast * tx, w[1] - fast * ty, w[2] - fast * tz
    size = -1.0 * power(own[NEAR] * near * r2, -own[SLOPE]) * sqrt(x * x + y * y + z * z)
    return size * x, size * y, size * z


TAG = Tag("gas-drag", {"acceleration": acceleration, "numbers": 6, "coefficients": 1})


@dataclass(frozen=True)
class GasDrag(CentralForce):
    """The drag of a gas disk about a star, -k (r/r0)^-slope |v - u| (v - u), u the velocity of the gas.

        system.with_forces(orbits.terms.GasDrag(per_length=1e-3 / u.au, r0=1 * u.au, slope=2.75, eta=0.002))

    bodies : names of the bodies that it acts on, massive or not; by default all but the source
    source : the star; by default the most massive body
    per_length : k at r0, >= 0, with the dimension 1/length: one, or one for each of `bodies`; (3/8) C_D rho / (s rho_s)
        for spheres of the radius s and the density rho_s in a gas of the density rho
    r0 : a length; slope : of the density of the gas, which falls with r^-slope
    eta : 0 <= eta < 1/2; the gas turns with the velocity of a circular orbit times sqrt(1 - 2 eta)
    pole : of the disk, (right ascension, declination) or a vector; by default z
    """

    kind: ClassVar[str] = "gas-drag"
    per_body: ClassVar[tuple[str, ...]] = ("per_length",)
    tag: ClassVar[Tag] = TAG
    per_length: Any = None
    r0: Any = None
    slope: Any = 0.0
    eta: Any = 0.0
    pole: Any = (0.0, 0.0, 1.0)

    @classmethod
    def examples(cls) -> tuple[Self, ...]:
        """Return examples of it; see `Force`."""
        return (cls(per_length=1e-3, r0=1.0, slope=2.5, eta=0.01, pole=(0.0, 0.6, 0.8)),)

    def in_units(self, units: Any) -> Self:
        """Return it in the system's units, with a unit vector for the pole."""
        if self.per_length is None or self.r0 is None:
            missing = "per_length" if self.per_length is None else "r0"
            such = "1e-3 / u.au" if self.per_length is None else "1 * u.au"
            raise InputError(f"GasDrag: {missing} is missing; expected, for example, {missing}={such}.")
        k = self.in_unit(1 / units.length, "per_length", units.wavenumber_value)
        if np.any(np.asarray(self.floats(k, units.wavenumber_value)) < 0.0):
            raise InputError(f"GasDrag: per_length is {shown(self.per_length)}; expected numbers >= 0.")
        single = {"r0": units.length_value(self.r0, "r0 of GasDrag")}
        single |= {name: units.pure_value(getattr(self, name), f"{name} of GasDrag") for name in ("slope", "eta")}
        for name, value in single.items():
            if value.shape != () or not np.isfinite(value):
                raise InputError(f"GasDrag: {name} is {shown(value.tolist())}; expected one finite number.")
        r0, slope, eta = (float(x) for x in single.values())
        if not r0 > 0.0:
            raise InputError(f"GasDrag: r0 is {r0:g}; expected a length > 0.")
        if not 0.0 <= eta < 0.5:
            raise InputError(f"GasDrag: eta is {eta:g}; expected 0 <= eta < 1/2.")
        pole = pole_direction(self.pole, "pole of GasDrag", units)
        return replace(self, per_length=k, r0=r0 * units.length, slope=slope, eta=eta, pole=pole)

    def constants(self, row: int, units: Any) -> Sequence[float]:
        """Return z, 1/r0, p, 1 - 2 eta."""
        return *self.pole, 1.0 / float(units.length_value(self.r0)), self.slope, 1.0 - 2.0 * self.eta

    def coefficients(self, units: Any) -> Sequence[float | tuple[float, ...]]:
        """Return k."""
        return (self.floats(self.per_length, units.wavenumber_value),)
