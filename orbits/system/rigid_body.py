"""Rigid bodies as users give them: moments of inertia, attitude and spin."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from astropy import units as u
from numpy.typing import NDArray

from orbits import rotations
from orbits.body_names import index_of
from orbits.errors import InputError, shown

if TYPE_CHECKING:
    from orbits.system.system import System
    from orbits.units import UnitSystem

Array = NDArray[np.float64]

RIGID = "rigid-bodies"
"""The kind of what makes bodies of a system rigid, among its forces."""

AXES = ("A", "B", "C")

ABOVE = 1e-12
"""The sine of the angle between a line and a velocity below which both determine no plane."""


class Turning(NamedTuple):
    """The rigid part of a body in the units of a system: its moments per unit of mass, (3,), its attitude as a unit
    quaternion, (4,), and its spin as an angular momentum per unit of mass in the axes of the system, (3,).
    """

    moments: Array
    attitude: Array
    spin: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class RigidBody:
    """The shape, attitude and rotation of a body that turns, for `System.with_rigid`.

        moon = orbits.RigidBody(shape=(180, 133, 103) * u.km, attitude="Saturn")        # locked: it turns as it orbits
        top = orbits.RigidBody(A=0.32, B=0.45, C=0.52, radius=135 * u.km, spin=4 * u.rad / u.day)

    A, B, C : the principal moments of inertia about the axes 1, 2, 3 of the body, in any order: as mass times length
        squared; divided by the mass, as length squared; or divided by m R^2 as plain numbers, with `radius`
    radius : the R of moments that are plain numbers
    shape : instead of A, B, C, the semi-axes a, b, c of a homogeneous ellipsoid along the axes 1, 2, 3
    attitude : the rotation from the axes of the body to those of the system, a quaternion (4,) or a matrix (3, 3); by
        default both have the same axes. Or the name of another body: axis 1 points to it, and axis 3 along the angular
        momentum of the orbit about it
    spin : the angular velocity, a vector in the axes of the system, or one number about axis 3. With the name of a body
        as attitude it may be left out: the body then turns as the line to that other one does

    A body without mass turns in the field of the others, and attracts none.

    Raises InputError when it becomes part of a system: for moments that no body has, an attitude that is no rotation
    (with its distance from one), numbers that are not finite, and wrong units.
    """

    A: Any = None
    B: Any = None
    C: Any = None
    radius: Any = None
    shape: Any = None
    attitude: Any = None
    spin: Any = None

    def __eq__(self, other: object) -> bool:
        """Whether another one was given by the same values."""
        if not isinstance(other, RigidBody):
            return NotImplemented
        pairs = ((getattr(self, each.name), getattr(other, each.name)) for each in fields(self))
        return all((one is None) == (two is None) and bool(np.array_equal(one, two)) for one, two in pairs)

    __hash__ = None  # type: ignore[assignment]

    def of(self, name: str, system: System) -> Turning:
        """Return it as the body of that name of a system. Raises InputError, naming the body."""
        i = system.index(name)
        whose = f"RigidBody {system.names[i]!r}"
        moments = self._moments(whose, float(system.values.gm[i]), system.units)
        line = self._line(whose, i, system)
        quaternion = self._quaternion(whose, line)
        R = rotations.matrices(quaternion)
        rates = self._rates(whose, R, line, system.units)
        return Turning(moments, quaternion, R @ (moments * (R.T @ rates)))

    def _moments(self, whose: str, gm: float, units: UnitSystem) -> Array:
        from orbits.rotations import checked_moments

        given = [getattr(self, axis) for axis in AXES]
        if (self.shape is None) == all(x is None for x in given):
            what = "neither A, B, C nor shape are given" if self.shape is None else "both A, B, C and shape are given"
            raise InputError(f"{whose}: {what}; expected three moments of inertia, or three semi-axes.")
        if self.shape is not None:
            return self._of_shape(whose, units)
        missing = [axis for axis, x in zip(AXES, given, strict=True) if x is None]
        if missing:
            raise InputError(f"{whose}: {' and '.join(missing)} missing; expected A, B and C.")
        pairs = list(zip(AXES, given, strict=True))
        found = np.array([_one(self._per_mass(whose, x, axis, gm, units), x, f"{whose}: {axis}") for axis, x in pairs])
        try:
            checked_moments(found)
        except InputError:
            words = ", ".join(f"{axis} = {shown(x)}" for axis, x in pairs)
            largest = AXES[int(found.argmax())]
            why = "those are > 0" if found.min() <= 0.0 else f"{largest} exceeds the sum of the two others"
            raise InputError(f"{whose}: {words} are no moments of inertia of a body: {why}.") from None
        return found

    def _per_mass(self, whose: str, x: Any, axis: str, gm: float, units: UnitSystem) -> Array:
        """Return a moment divided by the mass."""
        unit = getattr(x, "unit", u.dimensionless_unscaled)
        plain = unit.is_equivalent(u.dimensionless_unscaled)
        if plain and self.radius is not None:
            R = _one(units.length_value(self.radius, f"{whose}: radius"), self.radius, f"{whose}: radius", above=0.0)
            return units.pure_value(x, f"{whose}: {axis}") * (R * R)
        if self.radius is not None:
            raise InputError(
                f"{whose}: {axis} is {shown(x)}, with a unit, but radius is given, which is for moments divided by "
                "m R^2; leave out the radius, or the unit."
            )
        if plain and units.is_physical:
            raise InputError(
                f"{whose}: {axis} is {shown(x)}, without a unit; expected a moment such as 3e19 * u.kg * u.km**2, or, "
                "divided by the mass, in u.km**2; or give radius=R, if it is divided by m R^2."
            )
        if units.is_physical and unit.is_equivalent(u.m**2):
            return units.area_value(x, f"{whose}: {axis}")
        if not gm > 0.0:
            raise InputError(
                f"{whose} has no mass (gm = 0), by which its moments of inertia could be divided; give them per unit "
                "of mass, such as A=3000 * u.km**2, divided by m R^2 with radius=R, or give its shape."
            )
        return units.moment_value(x, f"{whose}: {axis}") / (gm / units.G)

    def _of_shape(self, whose: str, units: UnitSystem) -> Array:
        axes = units.length_value(self.shape, f"{whose}: shape")
        if axes.shape != (3,) or not np.all(np.isfinite(axes)) or not np.all(axes > 0.0):
            raise InputError(f"{whose}: shape is {shown(self.shape)}; expected three semi-axes > 0.")
        if self.radius is not None:
            raise InputError(f"{whose}: shape and radius are both given; leave the radius out.")
        a, b, c = axes**2
        return np.array([b + c, c + a, a + b]) / 5.0

    def _line(self, whose: str, i: int, system: System) -> tuple[Array, Array] | None:
        """Return place and velocity of the body to which axis 1 points, relative to this one; None if it has no such
        attitude.
        """
        if not isinstance(self.attitude, str):
            return None
        j = index_of(self.attitude, system.names, of=whose, role="attitude")
        if i == j:
            raise InputError(f"{whose}: attitude names the body itself; expected another one.")
        x, v = system.values.q[j] - system.values.q[i], system.values.v[j] - system.values.v[i]
        normal = np.linalg.norm(np.cross(x, v))
        if not normal > ABOVE * np.linalg.norm(x) * np.linalg.norm(v):
            raise InputError(
                f"{whose}: attitude={self.attitude!r} needs an orbit about it, but the two move along the line that "
                "joins them; give a quaternion or a matrix."
            )
        return x, v

    def _quaternion(self, whose: str, line: tuple[Array, Array] | None) -> Array:
        given = self.attitude
        if line is not None:
            first, third = line[0] / np.linalg.norm(line[0]), np.cross(*line)
            third = third / np.linalg.norm(third)
            given = np.column_stack([first, np.cross(third, first), third])
        if given is None:
            return np.array([1.0, 0.0, 0.0, 0.0])
        try:
            found = np.asarray(given, dtype=np.float64)
            if found.shape == (4,) and abs(np.linalg.norm(found) - 1.0) <= 4e-16:  # stored ones keep their bits
                return found
            return rotations.start((0.0, 0.0, 0.0), found)[0]
        except InputError as error:
            raise InputError(f"{whose}: {error}") from None
        except (TypeError, ValueError, OverflowError):
            raise InputError(
                f"{whose}: attitude is {shown(given)}; expected a quaternion, (4,), a matrix, (3, 3), or the name of a "
                "body."
            ) from None

    def _rates(self, whose: str, R: Array, line: tuple[Array, Array] | None, units: UnitSystem) -> Array:
        """Return the angular velocity in the axes of the system."""
        if self.spin is None:
            if line is None:
                raise InputError(
                    f"{whose}: spin is missing; expected an angular velocity, such as 4 * u.rad / u.day about axis 3 "
                    "or a vector, or the name of a body as attitude, about which it then turns as it orbits."
                )
            return np.cross(*line) / (line[0] @ line[0])
        given = list(self.spin) if isinstance(self.spin, tuple) else self.spin
        found = np.asarray(units.rate_value(given, f"{whose}: spin"))
        if found.shape not in ((), (3,)) or not np.all(np.isfinite(found)):
            raise InputError(f"{whose}: spin is {shown(found.tolist())}; expected one finite number, or three.")
        return R[:, 2] * float(found) if found.shape == () else found


def _one(value: Array, given: Any, what: str, *, above: float | None = None) -> float:
    """Return one finite number. Raises InputError."""
    found = np.asarray(value)
    if found.shape != () or not np.isfinite(found) or (above is not None and not found > above):
        more = "" if above is None else f" > {above:g}"
        raise InputError(f"{what} is {shown(given)}; expected one finite number{more}.")
    return float(found)
