"""Spins at the same places of many revolutions: what `PlanarSpins.section` and `PlanarSpins.march` return."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from orbits.spin_orbit.orbit_table import place

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from orbits.spin_orbit.planar import PlanarSpins

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SpinPath:
    """Angles and rates of spins, (starts, samples), with the starts in column 0.

    spins : the problem
    eccentric_anomaly : of the orbit, (samples,), radians, from 0 at the pericentre of the start
    theta : the direction of the long axis from that of the pericentre, radians; whole turns are kept
    rate : theta' / n, of which 1 is one turn in a revolution of the orbit
    """

    spins: PlanarSpins
    eccentric_anomaly: Array
    theta: Array
    rate: Array

    @property
    def mean_anomaly(self) -> Array:
        """The time, as an angle that grows by 2 pi in a revolution, (samples,)."""
        E = self.eccentric_anomaly
        return np.asarray(E - self.spins.eccentricity * np.sin(E))

    @property
    def revolutions(self) -> Array:
        """The time in revolutions of the orbit, (samples,)."""
        return self.mean_anomaly / (2.0 * np.pi)

    @property
    def true_anomaly(self) -> Array:
        """The direction of the planet's side of the orbit: where the moon is, (samples,), radians, whole turns kept."""
        _, f = place(self.spins.eccentricity, self.eccentric_anomaly)
        return np.asarray(f + 2.0 * np.pi * np.rint((self.eccentric_anomaly - f) / (2.0 * np.pi)))

    @property
    def folded(self) -> Array:
        """Theta without whole half turns, which do not change the problem, within [-pi/2, pi/2]."""
        return _folded(self.theta)

    @property
    def off_planet(self) -> Array:
        """The angle between the long axis and the line to the planet, within [-pi/2, pi/2]."""
        return _folded(self.theta - self.true_anomaly)

    def plot(self, **look: Any) -> Figure:
        """Draw the section: the rate against the angle, a dot for each sample, a colour for each start.

        look : options of matplotlib's `plot` for the dots, such as ms=2
        """
        from matplotlib.cbook import normalize_kwargs
        from matplotlib.lines import Line2D

        from orbits import plotting

        figure = plotting.figure(10, 8)
        axis = figure.subplots()
        wanted = {"markersize": 1.5, "markeredgewidth": 0, **normalize_kwargs(look, Line2D)}  # markersize for ms
        for k, (theta, rate) in enumerate(zip(self.folded, self.rate, strict=True)):
            colour = plotting.style.PALETTE[k % len(plotting.style.PALETTE)]
            axis.plot(np.degrees(theta), rate, ".", **{"color": colour, **wanted})
        axis.set(xlabel="θ [°]", ylabel="θ′/n", xlim=(-90, 90), xticks=range(-90, 91, 30))
        axis.set_title(self.spins.title)
        return figure

    def __repr__(self) -> str:
        starts, samples = self.theta.shape
        return f"<SpinPath: {starts:,} starts, {self.revolutions[-1]:g} revolutions, {samples:,} samples>"


def _folded(angles: Array) -> Array:
    return np.asarray(angles - np.pi * np.rint(angles / np.pi))
