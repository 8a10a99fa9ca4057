"""The non-gravitational acceleration of comets and asteroids by Marsden's formula.

    f_i = m_i g(r) (A1 r/r + A2 t + A3 h),   g(r) = alpha (r/r0)^(-m) [1 + (r/r0)^n]^(-k)

with r the place relative to the Sun, h the direction of r x w, and t = h x r/r. Numbers: alpha, 1/r0, m, n, k;
coefficients: A1, A2, A3. With g = (r0/r)^2, over an orbit, da/dt = 2 A2 r0^2 / [n a^2 (1 - e^2)], n the mean motion.

Source: Marsden, Sekanina & Yeomans (1973), AJ 78, 211; Farnocchia et al. (2013), Icarus 224, 1, for asteroids.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np

from orbits.errors import InputError, shown
from orbits.forces.central import CentralForce
from orbits.kernels.binding import Tag
from orbits.kernels.compile import kernel
from orbits.kernels.gravity.central_forces import OWN
from orbits.kernels.lanes import rsqrt_cubed
from orbits.kernels.lanes.functions import power

ALPHA, NEAR, M, N, K = range(OWN, OWN + 5)

ICE = 2.808
"""r0 of water ice in au, beyond which its sublimation falls steeply."""


@kernel(inline=True)
def acceleration(strength, own, t, b, A, r, w):
    """Return the acceleration by A1, A2, A3."""
    x, y, z = r
    vx, vy, vz = w
    r2 = strength[0] + x * x + y * y + z * z
    near = rsqrt_cubed(r2) * r2
    if own[M] == 2.0:
        g = own[ALPHA] / ((own[NEAR] * own[NEAR]) * r2)
    else:
        g = own[ALPHA] * power(own[NEAR] * near * r2, -own[M])
    if own[K] != 0.0:
        g = g * power(1.0 + power(own[NEAR] * near * r2, own[N]), -own[K])
    x, y, z = near * x, near * y, near * z
    hx, hy, hz = y * vz - z * vy, z * vx - x * vz, x * vy - y * vx
    h2 = hx * hx + hy * hy + hz * hz
    # Without an orbital plane there is no A2 or A3.
    scale = rsqrt_cubed(h2 + (h2 == 0.0) * 1.0) * h2
    hx, hy, hz = scale * hx, scale * hy, scale * hz
    tx, ty, tz = hy * z - hz * y, hz * x - hx * z, hx * y - hy * x
    return (
        g * (A[0] * x + A[1] * tx + A[2] * hx),
        g * (A[0] * y + A[1] * ty + A[2] * hy),
        g * (A[0] * z + A[1] * tz + A[2] * hz),
    )


TAG = Tag("non-gravitational", {"acceleration": acceleration, "numbers": 5, "coefficients": 3})


@dataclass(frozen=True)
class NonGravitational(CentralForce):
    """The acceleration of comets by outgassing, and of asteroids by the Yarkovsky effect, by Marsden's formula:
    g(r) (A1 radial + A2 transverse + A3 normal), g(r) = alpha (r/r0)^-m [1 + (r/r0)^n]^-k.

        system.with_forces(orbits.terms.NonGravitational(A1=1e-9 * u.au / u.day**2, bodies=["comet"]))
        system.with_forces(orbits.terms.NonGravitational.yarkovsky(-2.9e-14 * u.au / u.day**2, bodies=["Apophis"]))

    bodies : names of the bodies that it acts on, massive or not; by default all but the source
    source : the Sun; by default the most massive body
    A1, A2, A3 : accelerations at r0 (where g is normalized so), by default 0: one each, or one for each of `bodies`
    alpha, m, n, k : numbers; r0 : a length, by default 2.808 au, and 1 au for k = 0. The defaults are those of water
        ice, with g = 1 at 1 au
    """

    kind: ClassVar[str] = "non-gravitational"
    per_body: ClassVar[tuple[str, ...]] = ("A1", "A2", "A3")
    tag: ClassVar[Tag] = TAG
    A1: Any = None
    A2: Any = None
    A3: Any = None
    alpha: Any = 0.1112620426
    r0: Any = None
    m: Any = 2.15
    n: Any = 5.093
    k: Any = 4.6142

    @classmethod
    def yarkovsky(cls, A2: Any, bodies: Sequence[str] | None = None, **more: Any) -> Self:
        """Return the force of the Yarkovsky effect: a transverse acceleration A2 (1 au / r)^2.

        A2 : an acceleration, or one for each of `bodies`; more : other fields, such as A1 of radiation pressure, or r0
        """
        return cls(bodies=bodies, A2=A2, **{"alpha": 1.0, "m": 2.0, "n": 1.0, "k": 0.0, **more})

    @classmethod
    def examples(cls) -> tuple[Self, ...]:
        """Return examples of it; see `Force`."""
        return cls(A1=1e-3, A2=-1e-3, A3=1e-3, r0=1.0), cls.yarkovsky(1e-3, r0=1.0)

    def in_units(self, units: Any) -> Self:
        """Return it in the system's units."""
        given = [name for name in self.per_body if getattr(self, name) is not None]
        if not given:
            raise InputError(
                "NonGravitational: A1, A2 and A3 are missing; expected one, such as A2=1e-14 * u.au / u.day**2."
            )
        A = dict.fromkeys(self.per_body, 0.0 * units.acceleration)
        A |= {name: self.in_unit(units.acceleration, name, units.acceleration_value) for name in given}
        powers: dict[str, Any] = {
            name: float(self._one(name, units.pure_value(getattr(self, name), name)))
            for name in ("alpha", "m", "n", "k")
        }
        if self.r0 is None and not units.is_physical:
            raise InputError(f"NonGravitational: r0 is missing; {units.name} has no au: give a length.")
        if self.r0 is None:
            r0 = (ICE if powers["k"] else 1.0) * units.astronomical_unit
        else:
            r0 = self._one("r0", units.length_value(self.r0, "r0"))
        if not r0 > 0.0:
            raise InputError(f"NonGravitational: r0 is {r0:g} {units.length}; expected a length > 0.")
        return replace(self, **A, **powers, r0=r0 * units.length)

    @staticmethod
    def _one(name: str, value: Any) -> float:
        found = np.asarray(value)
        if found.shape != () or not np.isfinite(found):
            raise InputError(f"NonGravitational: {name} is {shown(found.tolist())}; expected one finite number.")
        return float(found)

    def constants(self, row: int, units: Any) -> Sequence[float]:
        """Return alpha, 1 / r0, m, n, k."""
        return self.alpha, 1.0 / float(units.length_value(self.r0)), self.m, self.n, self.k

    def coefficients(self, units: Any) -> Sequence[float | tuple[float, ...]]:
        """Return A1, A2, A3."""
        return [self.floats(getattr(self, name), units.acceleration_value) for name in self.per_body]
