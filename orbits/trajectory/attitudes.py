"""Attitudes and spins of rigid bodies at the samples of a run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from astropy import units as u
from numpy.typing import NDArray

from orbits import rotations
from orbits.body_names import few, index_of, orbited
from orbits.checks import is_one_of
from orbits.errors import InputError, shown
from orbits.export.labelled import Variable
from orbits.trajectory.work import accounts_of

if TYPE_CHECKING:
    from orbits.protocols import Samples
    from orbits.system import System
    from orbits.trajectory.trajectory import Trajectory

Array = NDArray[np.float64]


class Attitudes:
    """The methods of `Trajectory` for rigid bodies."""

    if TYPE_CHECKING:  # set by `Trajectory`
        system: System
        _q: Samples
        _v: Samples

        def __len__(self) -> int: ...

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
        return u.Quantity(rates if axes == "body" else np.einsum("nij,nj->ni", R, rates), self.system.units.rate)

    def rotation_rate(self, body: str) -> u.Quantity:
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

    def plot_rotation(self, body: str | None = None, **options: Any) -> Any:
        """Draw how a rigid body turns: `run.plot("rotation", body=...)`; see `orbits.plotting.plot_rotation`."""
        from orbits.plotting import plot_rotation

        run: Trajectory = self  # type: ignore[assignment]
        return plot_rotation(run, body, **options)

    def _labelled_attitudes(self, names: Sequence[str]) -> dict[str, Variable]:
        """Return attitudes and spins of bodies at the samples, for export; NaN for those that are not rigid."""
        attitudes, spins = np.full((len(self), len(names), 4), np.nan), np.full((len(self), len(names), 3), np.nan)
        for k, name in enumerate(names):
            if name in self.system.rigid:
                attitudes[:, k], spins[:, k] = self.attitude(name), self.angular_velocity(name).value
        return {
            "attitude": Variable(attitudes, u.dimensionless_unscaled, ("time", "body", "quaternion")),
            "spin": Variable(spins, self.system.units.rate, ("time", "body", "component")),
        }

    def _states(self, body: str) -> tuple[Array, Array]:
        """Return the moments of a rigid body and its states at the samples, (n, 16)."""
        from orbits.system.rigid_bodies import rigid_bodies_of, states_in

        run: Trajectory = self  # type: ignore[assignment]
        i, rigid = index_of(body, self.system.names), rigid_bodies_of(self.system)
        name = self.system.names[i]
        if rigid is None or name not in rigid.names:
            those = f"those that are rigid, {few(rigid.names)}" if rigid else "one made rigid by system.with_rigid(...)"
            raise InputError(f"{name!r} is not a rigid body in this run; expected {those}.")
        states = states_in(accounts_of(run), self.system)[:, rigid.names.index(name)]
        gone: Any = np.isnan(self._q[:, i]).any(axis=-1)
        return rigid.turning(self.system.units)[name].moments, np.where(gone[:, None], np.nan, states)

    def _line(self, body: str, about: str | None) -> tuple[Array, Array]:
        """Return place and velocity of a body relative to another one, (n, 3)."""
        i, j = orbited(self.system.names, self.system.values.gm, body, about)
        return self._q[:, i] - self._q[:, j], self._v[:, i] - self._v[:, j]


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


__all__ = ["Attitudes"]
