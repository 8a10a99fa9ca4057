"""What an encounter with a planet looks like on its target plane, with the uncertainty of the orbit."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from astropy import units as u
from numpy.typing import NDArray

from orbits.checks import positive_number
from orbits.errors import InputError
from orbits.export import Valued
from orbits.results.chance import probability_in_disc

if TYPE_CHECKING:
    from astropy.time import Time
    from matplotlib.figure import Figure

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class TargetPlane(Valued):
    """Where a body passes a planet: on the plane through the planet perpendicular to the incoming asymptote.

    body, planet : names; date : of the closest approach, or of reaching the surface if it hits, TDB
    xi, zeta : coordinates, km: zeta against the motion of the planet, so that it grows with the delay of the body
    distance : of the pericentre, km; speed : relative, at the date, km/s; v_infinity : km/s, None for a body that is
        bound to the planet, whose plane is the modified one, perpendicular to the velocity at the pericentre
    radius : of the planet, km
    matrix : the covariance of xi, zeta, distance and time, in km and s, (4, 4), to first order; None without one
    axes : (3, 3), rows xi, eta (along the incoming asymptote), zeta, in the axes of the system
    """

    body: str
    planet: str
    date: Time
    xi: u.Quantity
    zeta: u.Quantity
    distance: u.Quantity
    speed: u.Quantity
    v_infinity: u.Quantity | None
    radius: u.Quantity
    matrix: Array | None
    axes: Array

    @property
    def b(self) -> u.Quantity:
        """The distance from the planet on the plane, km: the impact parameter."""
        return np.hypot(self.xi, self.zeta)

    @property
    def capture_radius(self) -> u.Quantity:
        """The largest b of what hits the planet, km: its radius times sqrt(1 + (v_escape / v_infinity)^2)."""
        if self.v_infinity is None:
            return self.radius
        # b^2 = r^2 + 2 GM r / v_infinity^2 holds of each hyperbola with its pericentre r.
        focus = (self.b**2 - self.distance**2) / self.distance
        return np.sqrt(self.radius**2 + self.radius * focus)

    @property
    def sigma(self) -> dict[str, u.Quantity]:
        """Standard deviations of xi, zeta and distance, km, and of the time, s."""
        units = {"xi": u.km, "zeta": u.km, "distance": u.km, "time": u.s}
        values = np.sqrt(np.diag(self._known()))
        return {name: u.Quantity(x, unit) for x, (name, unit) in zip(values, units.items(), strict=True)}

    def ellipse(self, sigmas: float = 3.0) -> tuple[u.Quantity, u.Quantity, u.Quantity]:
        """Return the semi-axes of the uncertainty on the plane, km, and the angle of the longer one from xi to zeta."""
        values, vectors = np.linalg.eigh(self._known()[:2, :2])
        small, large = sigmas * np.sqrt(np.maximum(values, 0.0))
        angle = math.atan2(vectors[1, 1], vectors[0, 1]) % math.pi
        return u.Quantity(large, u.km), u.Quantity(small, u.km), u.Quantity(angle, u.rad).to(u.deg)

    @property
    def impact_probability(self) -> float:
        """The probability that b is less than the capture radius, of the normal distribution on the plane.

        It is as good as the linear ellipse: compare it with clones (`orbits.ensemble.impact_probability`).
        """
        centre = np.array([self.xi.to_value(u.km), self.zeta.to_value(u.km)])
        return probability_in_disc(centre, self._known()[:2, :2], float(self.capture_radius.to_value(u.km)))

    def clones_needed(self, error: float = 0.1) -> int:
        """Return how many clones give the impact probability to a relative error of one sigma: (1 - p) / (p error^2).

        Raises InputError where the probability is 0, which no number of clones confirms.
        """
        p, error = self.impact_probability, positive_number(error, "error")
        if p <= 0.0:
            raise InputError("the impact probability is 0 to all digits; no number of clones would show one that hits.")
        return max(1, math.ceil((1.0 - p) / (p * error**2)))

    def plot(self) -> Figure:
        """Return a picture: the planet, the disc of what hits it, and the point with its ellipse of three sigmas."""
        from orbits.plotting.target_planes import of_target_planes

        return of_target_planes({self.body: self})

    def _known(self) -> Array:
        if self.matrix is None:
            raise InputError("this target plane has no covariance; expected target_plane(..., covariance=fit).")
        return self.matrix

    def _caption(self) -> str:
        kind = "target plane" if self.v_infinity is not None else "modified target plane"
        how = "reaches the surface" if self.distance < self.radius else "is closest"
        return f"{kind} of {self.planet}: {self.body} {how} on {self.date.iso[:19]} TDB"

    def _shown(self) -> tuple[list[str], list[list[str]], int]:
        values = {"xi": self.xi, "zeta": self.zeta, "b": self.b, "distance": self.distance, "time": None}
        known = {} if self.matrix is None else self.sigma
        rows = [
            [name, str(known[name].unit if x is None else x.unit), "" if x is None else f"{x.value:,.3f}",
             f"{known[name].value:.3g}" if name in known else ""]
            for name, x in values.items() if x is not None or name in known
        ]  # fmt: skip
        rows.append(["capture radius", "km", f"{self.capture_radius.value:,.1f}", ""])
        if self.v_infinity is not None:
            rows.append(["v_infinity", "km / s", f"{self.v_infinity.value:.6f}", ""])
        if self.matrix is not None:
            large, small, angle = self.ellipse()
            size = f"{large.value:.4g} x {small.value:.3g} at {angle.value:.2f} deg"
            rows.append(["ellipse, 3 sigma", "km", size, ""])
            rows.append(["impact probability", "", f"{self.impact_probability:.4g}", ""])
        return ["", "unit", "value", "sigma"], rows, 0
