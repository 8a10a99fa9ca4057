"""The rigid bodies of a system among what acts on it: their second degree of gravity, attitudes and spins."""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
from astropy import units as u
from numpy.typing import NDArray

from orbits import rotations
from orbits.body_names import few, index_of
from orbits.errors import InputError, shown
from orbits.forces.base import BoundForce, Force
from orbits.integrators.forms import padded
from orbits.kernels.gravity.rigid_bodies import BLOCK, COUNT, FIRST, OF_EACH, PLACE, STATE_ROWS, TAG
from orbits.kernels.gravity.terms_and_forces import FIGURES
from orbits.kernels.lanes import WIDTH
from orbits.system.rigid_body import RIGID, RigidBody, Turning

if TYPE_CHECKING:
    from orbits.system.system import System

Array = NDArray[np.float64]

STATE = STATE_ROWS * WIDTH
"""The numbers of the state of a rigid body in a march, see `orbits.kernels.gravity.rigid_bodies`."""

SPIN = 4
"""The index of the first number of the spin in it."""


@dataclass(frozen=True, eq=False)
class BoundRigidBodies(BoundForce):
    """The rigid bodies of a march; rigid : the number of those with mass, tops : which massless particles are rigid."""

    rigid: int = 0
    tops: tuple[int, ...] = ()


@dataclass(frozen=True, eq=False)
class RigidBodies(Force):
    """All rigid bodies of a system, those with mass first; made by `System.with_rigid`.

    bodies : their names; moments : (n, 3), A, B, C of each per unit of mass; attitudes : (n, 4), unit quaternions
    spins : (n, 3), their angular momenta per unit of mass in the axes of the system

    They have a Lagrangian, but of more than places: it enters marches as a force with the internal variables R and l.
    """

    kind: ClassVar[str] = RIGID
    moments: Any = ()
    attitudes: Any = ()
    spins: Any = ()

    def __eq__(self, other: object) -> bool:
        """Whether other rigid bodies have the same names and numbers."""
        if not isinstance(other, RigidBodies):
            return NotImplemented
        return self.names == other.names and all(
            bool(np.all(getattr(self, x) == getattr(other, x))) for x in ("moments", "attitudes", "spins")
        )

    __hash__ = None  # type: ignore[assignment]

    def seen_from(self, place: Any, velocity: Any) -> Self:
        """Return them: attitudes and spins are the same from any origin."""
        return self

    @property
    def variables(self) -> int:  # type: ignore[override]
        """The number of internal variables: two rows of eight for each body."""
        return STATE * len(self.names)

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the bodies."""
        return tuple(self.bodies or ())

    @property
    def whom(self) -> str:
        """The rigid bodies, in words."""
        return f"of {few(self.names, 3)}"

    @classmethod
    def made(cls, bodies: Mapping[str, RigidBody], system: System) -> Self:
        """Return rigid bodies of a system from what users give. Raises InputError and UnknownNameError."""
        found: dict[str, Turning] = {}
        for given, body in bodies.items():
            name = system.names[index_of(given, system.names, of="with_rigid")]
            if not isinstance(body, RigidBody):
                raise InputError(f"with_rigid: {given!r} is {shown(body)}; expected an orbits.RigidBody(...).")
            if name in found:
                raise InputError(f"with_rigid names {name!r} twice; expected each body once.")
            found[name] = body.of(name, system)
        return cls(tuple(found), *(np.array(column) for column in zip(*found.values(), strict=True)))

    def turning(self, units: Any) -> dict[str, Turning]:
        """Return moments, attitude and spin of each body, in the units of the system."""
        moments, spins = units.area_value(self.moments), units.areal_rate_value(self.spins)
        columns = zip(self.names, moments, np.asarray(self.attitudes, dtype=np.float64), spins, strict=True)
        return {name: Turning(j, q, spin) for name, j, q, spin in columns}

    def in_units(self, units: Any) -> Self:
        """Return it with quantities in the units of the system. Raises InputError for what is not finite."""
        n = len(self.names)
        attitudes = np.array(self.attitudes, dtype=np.float64)
        moments, spins = units.area_value(self.moments), units.areal_rate_value(self.spins)
        shapes = moments.shape == (n, 3) and attitudes.shape == (n, 4) and spins.shape == (n, 3)
        if not shapes or not all(np.all(np.isfinite(x)) for x in (moments, attitudes, spins)):
            raise InputError("rigid bodies have numbers that are not finite, or not 3 + 4 + 3 for each.")
        made = u.Quantity(moments, units.length**2), attitudes, u.Quantity(spins, units.length * units.speed)
        return type(self)(self.names, *made)

    def _some(self, order: Sequence[int]) -> Self:
        rows = list(order)
        return type(self)(
            tuple(self.names[k] for k in rows), self.moments[rows], self.attitudes[rows], self.spins[rows]
        )

    def among(self, names: Sequence[str], gm: Array) -> Self:
        """Return it with those with mass first, each kind in the order of the system."""
        places = {name: k for k, name in enumerate(names)}
        rows = [places[name] for name in self.names]
        return self._some(sorted(range(len(rows)), key=lambda k: (not gm[rows[k]] > 0.0, rows[k])))

    def joined(self, other: RigidBodies) -> Self:
        """Return these and other rigid bodies; of a body in both, the other replaces this one."""
        kept, fields = self.without(set(other.names)), ("moments", "attitudes", "spins")
        if kept is None:
            return type(self)(other.names, *(getattr(other, x) for x in fields))
        pairs = ((getattr(kept, x), getattr(other, x)) for x in fields)
        return type(self)((*kept.names, *other.names), *(np.concatenate(pair) for pair in pairs))

    def without(self, gone: Set[str]) -> Self | None:
        """Return the rigid bodies of a system without some bodies."""
        left = [k for k, name in enumerate(self.names) if name not in gone]
        return self._some(left) if left else None

    def continued(self, inner: Array, units: Any) -> Self:
        """Return it with attitudes and spins from a march."""
        rows = np.asarray(inner).reshape(-1, STATE)
        spins = u.Quantity(rows[:, SPIN : SPIN + 3], units.length * units.speed)
        return replace(self, attitudes=rows[:, :SPIN].copy(), spins=spins)

    def continued_some(self, inner: Array, names: Sequence[str], units: Any) -> Self:
        """Return it with attitudes and spins of some bodies from a march of these."""
        there = np.isin(self.names, list(names))
        attitudes, spins = self.attitudes.copy(), self.spins.copy()
        some = self._some(np.flatnonzero(there).tolist()).continued(inner, units)
        attitudes[there], spins[there] = some.attitudes, some.spins
        return replace(self, attitudes=attitudes, spins=spins)

    def bound_to(self, heavy: Sequence[str], light: Sequence[str], units: Any) -> BoundRigidBodies:
        """Return it bound to massive bodies and to massless particles of these names."""
        known = self.turning(units)
        massive = [name for name in heavy if name in known]
        tops = [k for k, name in enumerate(light) if name in known]
        block = padded(len(light)) if tops else 0
        own = np.zeros(FIRST + OF_EACH * len(massive) + 3 * block)
        own[[COUNT, PLACE, BLOCK]] = len(massive), padded(3 * len(heavy)), block
        for i, name in enumerate(massive):
            own[FIRST + OF_EACH * i : FIRST + OF_EACH * (i + 1)] = heavy.index(name), *known[name].moments
        of_light = own[FIRST + OF_EACH * len(massive) :].reshape(3, block) if tops else np.zeros((3, 0))
        of_light[...] = 1.0  # of points, which do not turn
        for k in tops:
            of_light[:, k] = known[light[k]].moments
        inner = np.zeros((len(massive) + len(tops), STATE))
        for row, name in zip(inner, [*massive, *(light[k] for k in tops)], strict=True):
            row[:SPIN], row[SPIN : SPIN + 3] = known[name].attitude, known[name].spin
        return BoundRigidBodies("rigid bodies", TAG, own, inner.reshape(-1), len(massive), tuple(tops))

    def given(self, units: Any) -> dict[str, RigidBody]:
        """Return the bodies by name, as users give them: moments per unit of mass, and spins as angular velocities."""
        out = {}
        for name, (moments, attitude, spin) in self.turning(units).items():
            rates = angular_velocities(moments, attitude, spin) * units.rate
            A, B, C = moments * units.length**2 if units.is_physical else moments.tolist()
            R = None if units.is_physical else 1.0
            out[name] = RigidBody(A=A, B=B, C=C, radius=R, attitude=attitude, spin=rates)
        return out


def angular_velocities(moments: Array, attitudes: Array, spins: Array) -> Array:
    """Return angular velocities in the axes of the system, (..., 3), of one body."""
    R = rotations.matrices(attitudes)
    return np.asarray(np.einsum("...ij,...j->...i", R, np.einsum("...ji,...j->...i", R, spins) / moments))


def rigid_bodies_of(system: Any) -> RigidBodies | None:
    """Return the rigid bodies of a system, or None."""
    return next((force for force in system.forces if isinstance(force, RigidBodies)), None)


def states_in(accounts: Array, system: Any) -> Array:
    """Return the states of the rigid bodies, (..., bodies, 16), from accounts of samples, (..., forces, 7 + inner)."""
    k = next(k for k, force in enumerate(system.forces) if isinstance(force, RigidBodies))
    found = accounts[..., k, FIGURES : FIGURES + system.forces[k].variables]
    return np.asarray(found.reshape(*found.shape[:-1], -1, STATE))


def energy(system: Any, q: Array, states: Array) -> Array:
    """Return the energy of rotation and the potential of the second degree, times G, (...).

    q : (..., n, 3), of the massive bodies; states : (..., bodies, 16), of the rigid bodies
    """
    gm, softening2 = system.values.gm[system.massive], system.values.softening**2
    total = np.zeros(q.shape[:-2])
    for b, turning, state in _massive(system, states):
        R, spin = rotations.matrices(state[..., :SPIN]), state[..., SPIN : SPIN + 3]
        of_body = np.einsum("...ji,...j->...i", R, spin)
        total = total + 0.5 * gm[b] * (of_body**2 / turning.moments).sum(axis=-1)
        x = np.delete(q, b, axis=-2) - q[..., [b], :]
        r2 = (x**2).sum(axis=-1) + softening2
        n = np.einsum("...ji,...kj->...ki", R, x)
        along = (turning.moments * n**2).sum(axis=-1) / r2
        size = 0.5 * gm[b] * np.delete(gm, b) / r2**1.5
        total = total - (size * (turning.moments.sum() - 3.0 * along)).sum(axis=-1)
    return total


def angular_momentum(system: Any, q: Array, states: Array) -> Array:
    """Return the sum of the angular momenta of the spins of rigid bodies with mass, times G, (..., 3); as `energy`."""
    gm = system.values.gm[system.massive]
    spins = (gm[b] * (state[..., SPIN : SPIN + 3] + state[..., 12:15]) for b, _, state in _massive(system, states))
    return np.asarray(sum(spins, np.zeros((*states.shape[:-2], 3))))


def _massive(system: Any, states: Array) -> Any:
    """Yield the row among the massive bodies, the moments and the states of each rigid body with mass."""
    rigid = rigid_bodies_of(system)
    assert rigid is not None
    names = [name for name, heavy in zip(system.names, system.massive, strict=True) if heavy]
    for k, (name, turning) in enumerate(rigid.turning(system.units).items()):
        if name in names:
            yield names.index(name), turning, states[..., k, :]


def start_states(system: Any) -> Array:
    """Return the states of the rigid bodies of a system, (bodies, 16)."""
    rigid = rigid_bodies_of(system)
    assert rigid is not None
    out = np.zeros((len(rigid.names), STATE))
    for row, turning in zip(out, rigid.turning(system.units).values(), strict=True):
        row[:SPIN], row[SPIN : SPIN + 3] = turning.attitude, turning.spin
    return out
