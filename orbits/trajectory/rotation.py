"""Attitudes and spins of bodies, rigid ones and those that forces such as tides turn, at the samples of a run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from astropy import units as u
from numpy.typing import NDArray

from orbits import rotations
from orbits.body_names import few, index_of, orbited
from orbits.checks import is_one_of
from orbits.errors import InputError, counted, shown
from orbits.export.labelled import Variable
from orbits.kernels.gravity.terms_and_forces import FIGURES
from orbits.trajectory.work import accounts_of

if TYPE_CHECKING:
    from orbits.trajectory.trajectory import Trajectory

Array = NDArray[np.float64]


NO_TIDES = "a system with forces orbits.terms.Tides(...)"


class Rotation:
    """How bodies turn, at the samples of a run: `run.rotation`.

        run.rotation.attitude("Hyperion"), run.rotation.obliquity("Hyperion", about="Saturn")
    """

    def __init__(self, run: Trajectory) -> None:
        self._run, self._system = run, run.system

    def __repr__(self) -> str:
        turning = [*self._system.rigid, *sorted(force.source for force in self._spinning().values())]
        return f"Rotation({few(turning) if turning else 'of no body'}; {counted(len(self._run), 'sample')})"

    def attitude(self, body: str, *, matrix: bool = False) -> Array:
        """Return the attitude of a rigid body at each sample: unit quaternions, (n, 4), of the rotation from the axes
        of the body to those of the system; with matrix=True matrices, (n, 3, 3), whose columns are the axes of the
        body.

        NaN for a massless body that is retired. Raises InputError for a body that is not rigid, and for a trajectory
        that has only samples of a run.
        """
        found = self._states(body)[1][:, :4]
        return _matrices(found) if matrix else found

    def angular_velocity(self, body: str, *, axes: str = "system") -> u.Quantity:
        """Return the angular velocity of a rigid body at each sample, (n, 3), in the axes of the system, or with
        axes="body" in those of the body. Raises InputError as `attitude`.
        """
        if not is_one_of(axes, ("system", "body")):
            raise InputError(f"axes is {shown(axes)}; expected 'system' or 'body'.")
        moments, states = self._states(body)
        R = _matrices(states[:, :4])
        rates = np.einsum("nji,nj->ni", R, states[:, 4:7]) / moments
        return u.Quantity(rates if axes == "body" else np.einsum("nij,nj->ni", R, rates), self._system.units.rate)

    def rate(self, body: str) -> u.Quantity:
        """Return the size of the angular velocity of a rigid body at each sample, (n,). Raises as `attitude`."""
        rates = self.angular_velocity(body)
        return u.Quantity(np.linalg.norm(rates.value, axis=-1), rates.unit)

    def euler_angles(self, body: str) -> u.Quantity:
        """Return (node, tilt, turn) of a rigid body at each sample, (n, 3): the attitude is a rotation by `turn` about
        axis 3, then by `tilt`, 0 to 180 degrees, about x, then by `node` about z, of the axes of the system.

        At a tilt of 0 or 180 degrees, where only their sum or difference is determined, the node is 0. Raises as
        `attitude`.
        """
        R = self.attitude(body, matrix=True)
        across = np.hypot(R[:, 0, 2], R[:, 1, 2])
        tilt = np.arctan2(across, R[:, 2, 2])
        level = across < LEVEL
        node = np.where(level, 0.0, np.arctan2(R[:, 0, 2], -R[:, 1, 2]))
        both = np.arctan2(R[:, 1, 0] * np.sign(R[:, 2, 2]), R[:, 0, 0])
        turn = np.where(level, both, np.arctan2(R[:, 2, 0], R[:, 2, 1]))
        return u.Quantity(np.stack([node, tilt, turn], axis=-1), u.rad).to(u.deg)

    def obliquity(self, body: str, about: str | None = None) -> u.Quantity:
        """Return the angle between axis 3 of a rigid body and the normal of its orbit about another body, (n,).

        about : that body; by default the heaviest of the others. Raises as `attitude`, and UnknownNameError
        """
        normal, third = np.cross(*self._line(body, about)), self.attitude(body, matrix=True)[:, :, 2]
        return u.Quantity(_angle(third, normal), u.rad).to(u.deg)

    def libration_angle(self, body: str, about: str | None = None) -> u.Quantity:
        """Return by how much axis 1 of a rigid body is ahead of the direction to another body, in its equator and in
        the sense of its axis 3, at each sample, (n,): -180 to 180 degrees. Raises as `obliquity`.
        """
        place = -self._line(body, about)[0]
        towards = np.einsum("nji,nj->ni", self.attitude(body, matrix=True), place)
        return u.Quantity(-np.arctan2(towards[:, 1], towards[:, 0]), u.rad).to(u.deg)

    def spin(self, body: str) -> u.Quantity:
        """Return the angular velocity of a rigid body, or of one with `Tides`, at each sample, shape (n, 3), in the
        axes of the system.

        Raises InputError for another body, and for a trajectory that has only samples of a run.
        """
        if isinstance(body, str) and body in self._system.rigid:
            return self.angular_velocity(body)
        found = {force.source: k for k, force in self._spinning().items()}
        if not isinstance(body, str) or body not in found:
            those = f"those with Tides, {few(sorted(found))}" if found else NO_TIDES
            raise InputError(f"the spin of {shown(body)} is not known in this run; expected {those}.")
        return u.Quantity(self._spin(found[body]), self._system.units.rate)

    def spin_angular_momentum(self) -> u.Quantity:
        """Return the sum of the angular momenta of the spins of all bodies with `Tides` at each sample, shape (n, 3).

        With it, the angular momentum of the massive bodies, `run.angular_momentum()`, keeps its first value. A spin
        that is held, by inertia=math.inf, does not contribute. Zero without tides. Raises InputError as `spin` does,
        and for rigid bodies, whose spins are in `run.angular_momentum()` already.
        """
        if self._system.rigid:
            raise InputError(
                "the spins of rigid bodies are in run.angular_momentum() already, and would be counted twice; "
                f"run.rotation.spin(body) is the angular velocity of {few(list(self._system.rigid), 3)}."
            )
        units, spinning = self._system.units, self._spinning()
        total = np.zeros((len(self._run), 3))
        for k, force in spinning.items():
            moment = force.moment(float(self._system.values.gm[self._system.index(force.source)]), units)
            if np.isfinite(moment):
                total += moment * self._spin(k)
        return u.Quantity(total / units.G, units.angular_momentum)

    def labelled(self, names: Sequence[str]) -> dict[str, Variable]:
        """Return attitudes and spins of bodies at the samples, for export; NaN for those that are not rigid."""
        shape = len(self._run), len(names)
        attitudes, spins = np.full((*shape, 4), np.nan), np.full((*shape, 3), np.nan)
        for k, name in enumerate(names):
            if name in self._system.rigid:
                attitudes[:, k], spins[:, k] = self.attitude(name), self.angular_velocity(name).value
        return {
            "attitude": Variable(attitudes, u.dimensionless_unscaled, ("time", "body", "quaternion")),
            "spin": Variable(spins, self._system.units.rate, ("time", "body", "component")),
        }

    def _states(self, body: str) -> tuple[Array, Array]:
        """Return the moments of a rigid body and its states at the samples, (n, 16)."""
        from orbits.system.rigid_bodies import rigid_bodies_of, states_in

        i, rigid = index_of(body, self._system.names), rigid_bodies_of(self._system)
        name = self._system.names[i]
        if rigid is None or name not in rigid.names:
            those = f"those that are rigid, {few(rigid.names)}" if rigid else "one made rigid by system.with_rigid(...)"
            raise InputError(f"{name!r} is not a rigid body in this run; expected {those}.")
        states = states_in(accounts_of(self._run), self._system)[:, rigid.names.index(name)]
        gone: Any = np.isnan(self._run._q[:, i]).any(axis=-1)
        return rigid.turning(self._system.units)[name].moments, np.where(gone[:, None], np.nan, states)

    def _line(self, body: str, about: str | None) -> tuple[Array, Array]:
        """Return place and velocity of a body relative to another one, (n, 3)."""
        i, j = orbited(self._system.names, self._system.values.gm, body, about)
        return self._run._q[:, i] - self._run._q[:, j], self._run._v[:, i] - self._run._v[:, j]

    def _spinning(self) -> dict[int, Any]:
        """Return the forces that change a spin, by their numbers."""
        return {k: force for k, force in enumerate(self._system.forces) if hasattr(force, "moment")}

    def _spin(self, k: int) -> Array:
        return accounts_of(self._run)[:, k, FIGURES : FIGURES + 3]


LEVEL = 1e-12
"""The sine of the tilt below which the node of an attitude is not determined."""


def _matrices(quaternions: Array) -> Array:
    """Return matrices, NaN where the quaternions are."""
    gone: Any = np.isnan(quaternions).any(axis=-1)
    found = rotations.matrices(np.where(gone[:, None], [1.0, 0.0, 0.0, 0.0], quaternions))
    found[gone] = np.nan
    return found


def _angle(one: Array, other: Array) -> Array:
    """Return the angles between vectors, (n,)."""
    return np.asarray(np.arctan2(np.linalg.norm(np.cross(one, other), axis=-1), (one * other).sum(axis=-1)))
