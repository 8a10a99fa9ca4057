"""The loss or gain of mass by a body, such as the Sun's by light and wind: GM that changes uniformly with time.

    f_i = -m_i k (t - t0) r / r^3

on all other bodies, with r the place relative to it, k = dGM/dt = fraction x GM, and t0 the time at which its GM is
that of the system. What it loses takes its momentum along: the body itself feels nothing. Numbers: the fraction, t0;
coefficients: 1. For slow loss, a of an orbit grows as 1 / GM, and e stays.

Source: Jeans (1924), MNRAS 85, 2; for the Sun, Park et al. (2021), AJ 161, 105.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from orbits.errors import InputError, shown
from orbits.forces.central import CentralForce
from orbits.kernels.binding import Tag
from orbits.kernels.compile import kernel
from orbits.kernels.gravity.central_forces import OWN
from orbits.kernels.lanes import rsqrt_cubed

RATE, NOMINAL = OWN, OWN + 1


@kernel(inline=True)
def acceleration(strength, own, t, b, A, r, w):
    """Return the acceleration by the mass that is gone."""
    x, y, z = r
    size = -1.0 * (strength[1 + b] * own[RATE] * (t - own[NOMINAL])) * rsqrt_cubed(strength[0] + x * x + y * y + z * z)
    return size * x, size * y, size * z


TAG = Tag("mass-loss", {"acceleration": acceleration, "numbers": 2, "coefficients": 1})


@dataclass(frozen=True)
class MassLoss(CentralForce):
    """A body whose GM changes uniformly with time, as the Sun's does by light and wind.

        system.with_forces(orbits.terms.MassLoss(fraction=-9e-14 / u.yr))

    source : the body that loses mass; by default the most massive one
    bodies : names of those that feel it, massive or not; by default all others
    fraction : (dGM/dt) / GM, a number per time; < 0 for loss
    since : the time after the epoch of the system at which its GM is that of the system; by default 0

    Elements of orbits are those of the GM at their time, unless `bodies` names some; events have that of the system.
    """

    kind: ClassVar[str] = "mass-loss"
    of_body: ClassVar[tuple[str, ...]] = ("fraction",)
    tag: ClassVar[Tag] = TAG
    source: str | None = field(default=None, kw_only=False)
    bodies: Sequence[str] | None = field(default=None, kw_only=True)
    fraction: Any = None
    since: Any = 0.0

    @classmethod
    def examples(cls) -> tuple[Self, ...]:
        """Return examples of it; see `Force`."""
        return (cls(fraction=-1e-3, since=-2.0),)

    def in_units(self, units: Any) -> Self:
        """Return it in the system's units."""
        if self.fraction is None:
            raise InputError("MassLoss: fraction is missing; expected a number per time, such as -9e-14 / u.yr.")
        rate = np.asarray(units.frequency_value(self.fraction, "fraction of MassLoss"))
        since = np.asarray(units.time_value(self.since, "since of MassLoss"))
        for name, value in (("fraction", rate), ("since", since)):
            if value.shape != () or not np.isfinite(value):
                raise InputError(f"MassLoss: {name} is {shown(value.tolist())}; expected one finite number.")
        return replace(self, fraction=float(rate) / units.time, since=float(since) * units.time)

    def later(self, time: Any) -> Self:
        """Return it for a system whose epoch is later by `time`."""
        return replace(self, since=self.since - time)

    def masses(self, gm: NDArray[np.float64], names: Sequence[str], t: Any, units: Any) -> NDArray[np.float64]:
        """Return the GM of the bodies at times t, if all feel the loss."""
        if self.bodies is not None or self.source is None or self.source not in names:
            return gm
        fraction, since = self.constants(0, units)
        now = np.array(np.broadcast_to(gm, (*np.shape(t), len(names))))
        now[..., list(names).index(self.source)] *= 1.0 + fraction * (np.asarray(t) - since)
        return now

    def constants(self, row: int, units: Any) -> Sequence[float]:
        """Return the fraction and t0."""
        return float(units.frequency_value(self.fraction)), float(units.time_value(self.since))

    def coefficients(self, units: Any) -> Sequence[float | tuple[float, ...]]:
        """Return 1."""
        return (1.0,)
