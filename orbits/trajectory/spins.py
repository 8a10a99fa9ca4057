"""Spins of bodies, which forces such as tides change, at the samples of a run."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from astropy import units as u
from numpy.typing import NDArray

from orbits.body_names import few
from orbits.errors import InputError, shown
from orbits.kernels.gravity.terms_and_forces import FIGURES
from orbits.trajectory.work import accounts_of

if TYPE_CHECKING:
    from orbits.system import System
    from orbits.trajectory.trajectory import Trajectory

Array = NDArray[np.float64]

NO_TIDES = "a system with forces orbits.terms.Tides(...)"


class Spins:
    """The methods of `Trajectory` for the spins of bodies."""

    if TYPE_CHECKING:  # set by `Trajectory`
        system: System

    def spin(self, body: str) -> u.Quantity:
        """Return the angular velocity of a rigid body, or of one with `Tides`, at each sample, shape (n, 3), in the
        axes of the system.

        Raises InputError for another body, and for a trajectory that has only samples of a run.
        """
        if isinstance(body, str) and body in self.system.rigid:
            run: Trajectory = self  # type: ignore[assignment]
            return run.angular_velocity(body)
        found = {force.source: k for k, force in self._spinning().items()}
        if not isinstance(body, str) or body not in found:
            those = f"those with Tides, {few(sorted(found))}" if found else NO_TIDES
            raise InputError(f"the spin of {shown(body)} is not known in this run; expected {those}.")
        return u.Quantity(self._spin(found[body]), self.system.units.rate)

    def spin_angular_momentum(self) -> u.Quantity:
        """Return the sum of the angular momenta of the spins of all bodies with `Tides` at each sample, shape (n, 3).

        With it, the angular momentum of the massive bodies, `run.angular_momentum()`, keeps its first value. A spin
        that is held, by inertia=math.inf, does not contribute. Zero without tides. Raises InputError as `spin` does,
        and for rigid bodies, whose spins are in `run.angular_momentum()` already.
        """
        if self.system.rigid:
            raise InputError(
                "the spins of rigid bodies are in run.angular_momentum() already, and would be counted twice; "
                f"run.spin(body) is the angular velocity of {few(list(self.system.rigid), 3)}."
            )
        units, spinning = self.system.units, self._spinning()
        total = np.zeros((len(self), 3))  # type: ignore[arg-type]
        for k, force in spinning.items():
            moment = force.moment(float(self.system.values.gm[self.system.index(force.source)]), units)
            if np.isfinite(moment):
                total += moment * self._spin(k)
        return u.Quantity(total / units.G, units.angular_momentum)

    def _spinning(self) -> dict[int, Any]:
        """Return the forces that change a spin, by their numbers."""
        return {k: force for k, force in enumerate(self.system.forces) if hasattr(force, "moment")}

    def _spin(self, k: int) -> Array:
        run: Trajectory = self  # type: ignore[assignment]
        return accounts_of(run)[:, k, FIGURES : FIGURES + 3]


__all__ = ["Spins"]
