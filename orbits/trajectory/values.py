"""What a `Trajectory` is made of and gives out: samples, what a run cost, what it keeps, the path of one body."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from astropy import units as u
from numpy.typing import NDArray

from orbits import diagnostics
from orbits.system.checks import few
from orbits.system.presenting import span
from orbits.tables import html_table

Array = NDArray[np.float64]

NOT_KEPT = "angular momentum is not conserved: terms have different poles"


class Samples(Protocol):
    """States of shape (samples, bodies, 3): a NumPy array, or an archive's data set that is read where it is
    indexed.
    """

    @property
    def shape(self) -> tuple[int, ...]:
        """(samples, bodies, 3)."""

    def __getitem__(self, index: Any) -> Array:
        """Read some of it."""


@dataclass(frozen=True)
class Statistics:
    """What a run cost.

    steps : whole steps taken since the epoch
    evaluations : evaluations of the forces among the massive bodies; an implicit step evaluates once an iteration
    particle_evaluations : evaluations of the field at massless particles, all particles together
    wall_time : seconds from sample to sample, writing included; of the last call where a run was resumed
    compile_time : seconds for compiling the kernels, or loading them from the cache
    """

    steps: int
    evaluations: int
    particle_evaluations: int
    wall_time: float
    compile_time: float


@dataclass(frozen=True)
class ConservedQuantities:
    """How far each quantity that gravity conserves strays from its first value; `diagnostics.Drift` values.

    Energy is compared with its own size, angular momentum with the size of its vector (where these vanish by
    cancellation, below a millionth of their terms: with sum m v^2 / 2 and sum m |q| |v|), linear momentum with
    sum m |v| and the centre of mass, whose uniform motion is taken off, with the largest distance from it.

    Terms of the system are counted in: the energy is that of the whole Lagrangian, and where terms single out a `pole`,
    a unit vector, the angular momentum is the component along it (zeros: terms with different poles keep none of it).

    massive : the bodies that these are the quantities of
    particles : how many massless ones the run has, whose orbits nothing here judges
    """

    energy: diagnostics.Drift
    angular_momentum: diagnostics.Drift
    linear_momentum: diagnostics.Drift
    centre_of_mass: diagnostics.Drift
    massive: tuple[str, ...] = ()
    particles: int = 0
    pole: tuple[float, float, float] | None = None

    @property
    def covers(self) -> str:
        """What these quantities are those of, in words, and what they say nothing of."""
        if not self.particles:
            return f"of {few(self.massive)}"
        some = "one massless particle" if self.particles == 1 else f"{self.particles:,} massless particles"
        unseen = f"nothing here judges the orbits of the {some}"
        if len(self.massive) == 1:
            return f"of {self.massive[0]} alone, which nothing disturbs; {unseen}"
        return f"of {few(self.massive)} only; {unseen}"

    def __str__(self) -> str:
        rows = [f"{'':18}{'max change':>12}{'in ulps':>10}{'at the end':>12}"]
        for name, d in self._drifts.items():
            rows.append(f"{name:18}{d.max_fraction:12.2e}{d.max_ulps:10.3g}{d.last_fraction:12.2e}")
        rows += [NOT_KEPT] if self._lost else []
        rows += [self.covers] if self.particles else []
        return "\n".join(rows)

    def _repr_pretty_(self, printer: Any, cycle: bool) -> None:
        printer.text(str(self))

    def _repr_html_(self) -> str:
        head = ["", "max change", "in ulps", "at the end"]
        rows = [
            [name, f"{d.max_fraction:.2e}", f"{d.max_ulps:.3g}", f"{d.last_fraction:.2e}"]
            for name, d in self._drifts.items()
        ]
        covers = (f"; {NOT_KEPT}" if self._lost else "") + (f"; {self.covers}" if self.particles else "")
        return html_table(f"change since the first sample, as a fraction{covers}", head, rows)

    @property
    def _lost(self) -> bool:
        return self.pole is not None and not any(self.pole)

    @property
    def _drifts(self) -> dict[str, diagnostics.Drift]:
        names = ["energy", "angular_momentum", "linear_momentum", "centre_of_mass"]
        words = {"angular_momentum": "ang. mom. of pole" if self.pole else "angular momentum"}
        if self._lost:
            names.remove("angular_momentum")
        return {words.get(name, name.replace("_", " ")): getattr(self, name) for name in names}


@dataclass(frozen=True, repr=False)
class BodyTrajectory:
    """One body's path: q and v of shape (samples, 3), t of shape (samples,), with units."""

    name: str
    t: u.Quantity
    q: u.Quantity
    v: u.Quantity

    def __repr__(self) -> str:
        return f"BodyTrajectory({self.name}, {len(self.t)} samples, {span(self.t)})"
