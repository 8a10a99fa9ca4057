"""Tides with a constant time lag, and the spin of the body in which they are raised.

    f_i = -(3 k2 G m_i^2 R^5 / r^8) { r + lag [2 (r . w) r / r^2 + w + r x s] },   C s' = -sum_i r x f_i

with r and w place and velocity of the companion i relative to the body, R its radius, s its spin and C = inertia M R^2.
The body feels the reactions, and its spin their torque: the angular momentum of orbits and spin together is conserved.
Each companion is pulled by the bulge that it raises itself. Numbers: 3 k2 R^5, lag, 1 / (inertia R^2); coefficients:
1 for companions. Internal variables: s.

With the mean motion n, x = 1 - e^2 and the rate K = 3 k2 lag n^2 (m / M) (R / a)^5, averaged over an orbit in the plane
of the equator, to first order in the rate,

    da/dt = -2 K a / x^(15/2) [f1 - x^(3/2) f2 s / n],   de/dt = -9 K e / x^(13/2) [f3 - 11/18 x^(3/2) f4 s / n]
    C ds/dt = K' / x^6 [f2 - x^(3/2) f5 s / n],   K' = 3 k2 lag G m^2 R^5 n / a^6

    f1 = 1 + 31/2 e^2 + 255/8 e^4 + 185/16 e^6 + 25/64 e^8,   f2 = 1 + 15/2 e^2 + 45/8 e^4 + 5/16 e^6
    f3 = 1 + 15/4 e^2 + 15/8 e^4 + 5/64 e^6,   f4 = 1 + 3/2 e^2 + 1/8 e^4,   f5 = 1 + 3 e^2 + 3/8 e^4

Source: Mignard (1979), Moon and Planets 20, 301; Hut (1981), A&A 99, 126.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from orbits.body_names import few
from orbits.checks import pole_direction
from orbits.errors import InputError, shown
from orbits.forces.central import CentralForce
from orbits.kernels.binding import Tag
from orbits.kernels.compile import kernel
from orbits.kernels.gravity.central_forces import OWN, SOURCE, push, relative
from orbits.kernels.lanes import get, put, rsqrt_cubed

SIZE, LAG, LIGHTNESS, FIRST = range(OWN, OWN + 4)


@kernel
def force(strength, own, t, q, v, y, f, rates):
    """Add the forces and their reaction to f, and write the rate of the spin y."""
    n, b = strength.shape[0] - 1, int(own[SOURCE])
    sx, sy, sz = get(y, 0), get(y, 1), get(y, 2)
    tx, ty, tz = 0.0 * sx, 0.0 * sx, 0.0 * sx
    for i in range(n):
        if own[FIRST + i] != 0.0:
            x, y_, z = relative(q, i, b, n)
            vx, vy, vz = relative(v, i, b, n)
            r2 = strength[0] + x * x + y_ * y_ + z * z
            near = rsqrt_cubed(r2)
            near = near * near * r2 * r2
            near4 = near * near
            raised = strength[1 + i] * strength[1 + i] * own[SIZE]
            size = -1.0 * raised * (near4 * near4)
            along = 1.0 + 2.0 * own[LAG] * near * (x * vx + y_ * vy + z * vz)
            fx = size * (along * x + own[LAG] * (vx + (y_ * sz - z * sy)))
            fy = size * (along * y_ + own[LAG] * (vy + (z * sx - x * sz)))
            fz = size * (along * z + own[LAG] * (vz + (x * sy - y_ * sx)))
            push(f, i, n, 1.0, (fx, fy, fz))
            push(f, b, n, -1.0, (fx, fy, fz))
            tx, ty, tz = tx - (y_ * fz - z * fy), ty - (z * fx - x * fz), tz - (x * fy - y_ * fx)
    lightness = own[LIGHTNESS] / strength[1 + b]
    put(rates, 0, lightness * tx)
    put(rates, 1, lightness * ty)
    put(rates, 2, lightness * tz)


@kernel
def particle_force(strength, own, t, particle, sources, speeds, place, velocity):
    """Return zero: a body without mass raises no tides."""
    zero = place[0] * 0.0
    return zero, zero, zero


@dataclass(frozen=True)
class Tides(CentralForce):
    """Tides that other bodies raise in one, with a constant time lag; its spin changes by their torque.

        earth = {"k2": 0.299, "radius": 6378.137 * u.km, "lag": 638 * u.s, "inertia": 0.3307}
        turning = {"spin": 360.9856 * u.deg / u.day, "pole": (0 * u.deg, 90 * u.deg)}
        system = system.with_forces(orbits.terms.Tides("Earth", **earth, **turning, bodies=["Moon"]))
        orbits.propagate(system, orbits.Gauss(stages=8), duration=1 * u.yr).rotation.spin("Earth")

    source : the massive body in which tides are raised; it must be given
    bodies : names of those that raise them, all with mass; by default all other massive bodies. Massless ones raise no
        tides, and do not feel those of others
    k2 : the Love number; radius : R; lag : the time by which the bulge lags behind, >= 0
    inertia : C / (M R^2) with the moment of inertia C, such as 0.4 for a uniform sphere; math.inf holds the spin
    spin : the angular velocity, a vector in the axes of the system, or one number about the `pole`
    pole : (right ascension, declination) or a vector, with a spin of one number
    """

    kind: ClassVar[str] = "tides"
    variables: ClassVar[int] = 3
    of_source: ClassVar[bool] = True
    by_mass: ClassVar[bool] = True
    of_body: ClassVar[tuple[str, ...]] = ("k2", "lag")
    tag: ClassVar[Tag] = Tag("tides", {"force": force, "particle_force": particle_force, "inner": 3})
    source: str | None = field(default=None, kw_only=False)
    bodies: Sequence[str] | None = field(default=None, kw_only=True)
    k2: Any = None
    radius: Any = None
    lag: Any = None
    inertia: Any = None
    spin: Any = None
    pole: Any = None

    @property
    def whom(self) -> str:
        """The body in which tides are raised, and by which, in words."""
        return f"of {self.source}" + ("" if self.bodies is None else f" by {few(self.bodies, 3)}")

    @classmethod
    def examples(cls) -> tuple[Self, ...]:
        """Return examples of it; see `Force`."""
        return (cls("star", k2=0.3, radius=0.3, lag=0.1, inertia=0.1, spin=(0.5, -0.3, 2.0)),)

    def in_units(self, units: Any) -> Self:
        """Return it in the system's units, with the spin as a vector."""
        whose = f"Tides of {self.source!r}"
        such = {"k2": "0.3", "radius": "6378 * u.km", "lag": "600 * u.s", "inertia": "0.3", "spin": "6 * u.rad / u.day"}
        for name, example in such.items():
            if getattr(self, name) is None:
                raise InputError(f"{whose}: {name} is missing; expected, for example, {name}={example}.")
        k2 = self._one("k2", units.pure_value(self.k2, "k2"), 0.0)
        radius = self._one("radius", units.length_value(self.radius, "radius"), 0.0, above=True)
        lag = self._one("lag", units.time_value(self.lag, "lag"), 0.0)
        held = isinstance(self.inertia, float) and self.inertia == math.inf
        inertia = math.inf if held else self._one("inertia", units.pure_value(self.inertia, "inertia"), 0.0, above=True)
        given = list(self.spin) if isinstance(self.spin, tuple) else self.spin
        spin = np.asarray(units.rate_value(given, "spin of Tides"))
        if not np.all(np.isfinite(spin)) or spin.shape not in ((), (3,)):
            raise InputError(
                f"{whose}: spin is {shown(spin.tolist())}; expected three finite numbers, or one and pole=..."
            )
        if spin.shape == () and self.pole is None and spin != 0.0:
            raise InputError(f"{whose}: pole is missing, about which it spins; or give spin as a vector.")
        if spin.shape == (3,) and self.pole is not None:
            raise InputError(f"{whose}: spin is a vector; leave pole out, or give spin as one number.")
        if spin.shape == ():
            pole = (0.0, 0.0, 1.0) if self.pole is None else self.pole
            spin = spin * np.array(pole_direction(pole, "pole of Tides", units))
        return replace(
            self,
            k2=k2,
            radius=radius * units.length,
            lag=lag * units.time,
            inertia=inertia,
            spin=tuple(x * units.rate for x in spin.tolist()),
            pole=None,
        )

    def _one(self, name: str, value: Any, least: float, *, above: bool = False) -> float:
        found = np.asarray(value)
        if found.shape != () or not np.isfinite(found) or found < least or (above and found == least):
            sign = ">" if above else ">="
            raise InputError(
                f"Tides of {self.source!r}: {name} is {shown(found.tolist())}; expected one number {sign} {least:g}."
            )
        return float(found)

    def constants(self, row: int, units: Any) -> Sequence[float]:
        """Return 3 k2 R^5, the lag, 1 / (inertia R^2)."""
        R = float(units.length_value(self.radius))
        return 3.0 * self.k2 * R**5, float(units.time_value(self.lag)), 1.0 / (self.inertia * R**2)

    def moment(self, gm: float, units: Any) -> float:
        """Return the moment of inertia of the body with this GM, times G, in the units of the system."""
        return float(self.inertia * gm * units.length_value(self.radius) ** 2)

    def coefficients(self, units: Any) -> Sequence[float | tuple[float, ...]]:
        """Return 1."""
        return (1.0,)

    def inner(self, units: Any) -> Sequence[float]:
        """Return the spin."""
        return [float(units.rate_value(x)) for x in self.spin]

    def continued(self, inner: NDArray[np.float64], units: Any) -> Self:
        """Return it with this spin."""
        return replace(self, spin=tuple(float(x) * units.rate for x in inner))
