"""Conserved quantities over all samples of a run, and their drift."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from astropy import units as u
from numpy.typing import NDArray

from orbits import diagnostics
from orbits.body_names import few
from orbits.diagnostics.drift import kinetic_energies, momenta, moments, own_scale, uniform_motion_drift
from orbits.errors import InputError
from orbits.export import html_table
from orbits.system.model import ANGULAR_MOMENTUM, ENERGY, MOMENTUM, axis, whole

if TYPE_CHECKING:
    from orbits.system import System
    from orbits.trajectory.parts import Samples

Array = NDArray[np.float64]

NONE = diagnostics.Drift(math.nan, math.nan, math.nan, math.nan)
"""The drift of a quantity that is not conserved."""

NOT_KEPT = "angular momentum is not conserved: terms have different poles"

BLOCK_BYTES = 32 * 1024 * 1024
"""The part of a run that is in memory at a time while a quantity of all samples is computed."""


@dataclass(frozen=True)
class ConservedQuantities:
    """The drifts of the conserved quantities from their first values, as `diagnostics.Drift`.

    The scale of energy and angular momentum is their first value, or sum m v^2 / 2 and sum m |q| |v| where this
    cancels to less than a millionth of its terms. The scale of linear momentum is sum m |v|; that of the centre of
    mass, measured relative to its uniform motion, is the largest distance of a body from it.

    Terms of the system are included: the energy is that of the whole Lagrangian. If terms distinguish a `pole`, a unit
    vector, the angular momentum is the component along it; zeros mean that terms with different poles conserve none.

    massive : the bodies that the quantities belong to
    particles : number of massless particles in the run; these quantities say nothing about their orbits
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
        """The bodies that these quantities cover and those that they do not, in words."""
        if not self.particles:
            return f"of {few(self.massive)}"
        some = "one massless particle" if self.particles == 1 else f"{self.particles:,} massless particles"
        unseen = f"this says nothing about the orbits of the {some}"
        if len(self.massive) == 1:
            return f"of {self.massive[0]} alone, which nothing perturbs; {unseen}"
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


class Conservation:
    """The methods of `Trajectory` for conserved quantities."""

    if TYPE_CHECKING:  # set by `Trajectory`
        system: System
        times: Array
        _q: Samples
        _v: Samples

        def __len__(self) -> int: ...

    def energy(self) -> u.Quantity:
        """Return the energy of the massive bodies, of the whole Lagrangian, shape (n,)."""
        gm, softening, system = self._gm(), self.system.values.softening, self.system
        values = self._of_massive(lambda q, v: whole(system, ENERGY, diagnostics.energy(gm, q, v, softening), q, v))
        return u.Quantity(values / self.system.units.G, self.system.units.energy)

    def linear_momentum(self) -> u.Quantity:
        """Return the momentum of the massive bodies, shape (n, 3), from the step's own velocities."""
        gm, system = self._gm(), self.system
        values = self._of_massive(lambda q, v: whole(system, MOMENTUM, diagnostics.linear_momentum(gm, v), q, v))
        return u.Quantity(values / self.system.units.G, self.system.units.momentum)

    def angular_momentum(self) -> u.Quantity:
        """Return the angular momentum of the massive bodies about the origin, shape (n, 3)."""
        gm, system = self._gm(), self.system
        values = self._of_massive(
            lambda q, v: whole(system, ANGULAR_MOMENTUM, diagnostics.angular_momentum(gm, q, v), q, v)
        )
        return u.Quantity(values / self.system.units.G, self.system.units.angular_momentum)

    def centre_of_mass(self) -> u.Quantity:
        """Return the centre of mass of the massive bodies, shape (n, 3)."""
        values = self._of_massive(lambda q, v: diagnostics.centre_of_mass(self._gm(), q))
        return u.Quantity(values, self.system.units.length)

    def drift(self) -> ConservedQuantities:
        """Return the drifts of energy, momenta and centre of mass over the samples, as fractions and in ulps.

        They belong to the massive bodies, and include the terms of the system. If terms distinguish an axis, the
        angular momentum is the component along it: the rest is exchanged with a spin that is not integrated. A quantity
        that is not conserved at all is NaN. Massless particles do not contribute, so this says nothing about their
        orbits. Raises InputError for a run without samples.
        """
        if not len(self):
            raise InputError(f"{self!r} has no samples yet, so nothing can drift; expected at least one.")
        gm, start, massive = self._gm(), self.system.values, self.system.massive
        q, v = start.q[massive], start.v[massive]
        energy, angular, linear = self.energy().value, self.angular_momentum().value, self.linear_momentum().value
        pole = axis(self.system)
        lost = pole is not None and not any(pole)
        angular = angular if pole is None else angular @ np.array(pole)
        return ConservedQuantities(
            energy=self._drift(energy, lambda q, v: kinetic_energies(gm, v)),
            angular_momentum=NONE if lost else self._drift(angular, lambda q, v: moments(gm, q, v)),
            linear_momentum=self._drift(linear, lambda q, v: momenta(gm, v), first=0.0),
            centre_of_mass=uniform_motion_drift(gm, self.times, self.centre_of_mass().value, q, v),
            massive=tuple(name for name, has_mass in zip(self.system.names, massive, strict=True) if has_mass),
            particles=int(np.count_nonzero(~massive)),
            pole=pole,
        )

    def blocks(self) -> Iterator[tuple[slice, Array, Array]]:
        """Yield (samples, q, v) of the massive bodies block by block, so that memory stays bounded."""
        massive = np.flatnonzero(self.system.massive)
        contiguous = massive[-1] - massive[0] + 1 == len(massive)
        columns: Any = slice(massive[0], massive[-1] + 1) if contiguous else massive
        rows = max(1, BLOCK_BYTES // (48 * len(self.system.names)))
        for start in range(0, len(self), rows):
            block = slice(start, min(start + rows, len(self)))
            yield block, self._q[block, columns], self._v[block, columns]

    def _gm(self) -> Array:
        return self.system.values.gm[self.system.massive]

    def _of_massive(self, function: Callable[[Array, Array], Array]) -> Array:
        nothing = np.empty((0, int(self.system.massive.sum()), 3))
        return np.concatenate([function(nothing, nothing), *(function(q, v) for _, q, v in self.blocks())])

    def _drift(self, values: Array, terms: Callable[[Array, Array], Array], first: Any = None) -> diagnostics.Drift:
        """Return the drift of a quantity; `terms` (of q and v) is the sum of the sizes of its terms, times G."""
        start, massive, G = self.system.values, self.system.massive, self.system.units.G
        begin = float(terms(start.q[massive], start.v[massive])) / G
        scale = own_scale(
            values[0] if first is None else first, begin, lambda: float(self._of_massive(terms).max()) / G
        )
        return diagnostics.drift(values, scale)
