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
from orbits.system.model import (
    ANGULAR_MOMENTUM,
    ENERGY,
    MOMENTUM,
    acts_on_massive,
    axis,
    centre,
    centre_velocity,
    depends_on_time,
    given_bodies,
    inertia,
    whole,
)
from orbits.trajectory.changes import Changes, of_bodies
from orbits.trajectory.work import ForceEffect, accounts_of, effects

if TYPE_CHECKING:
    from orbits.marching.clocks.clock import Clock
    from orbits.protocols import Samples
    from orbits.system import System
    from orbits.trajectory.trajectory import Trajectory

Array = NDArray[np.float64]

NONE = diagnostics.Drift(math.nan, math.nan, math.nan, math.nan)
"""The drift of a quantity that is not conserved."""

NO_ENERGY = "there is no energy to keep: a term depends on time"

GIVEN = "the massive bodies are read from an ephemeris: nothing of theirs is integrated, or conserved by it"

NO_CENTRE = "the centre of mass was set in motion, or moved, by a change of the bodies"

NOT_KEPT = "angular momentum is not conserved: terms have different poles, or turn about one"

ULPS = "ulp: the unit in the last place of a float64, 1.1e-16 to 2.2e-16 of it"

BLOCK_BYTES = 32 * 1024 * 1024
"""The part of a run that is in memory at a time while a quantity of all samples is computed."""


@dataclass(frozen=True, repr=False)
class ConservedQuantities:
    """The drifts of the conserved quantities from their values at the start of the run, as `diagnostics.Drift`.

    The scale of energy and angular momentum is their value at the start, or sum m v^2 / 2 and sum m |q| |v| where this
    cancels to less than a millionth of its terms. The scale of linear momentum is sum m |v|; that of the centre of
    mass, measured relative to its uniform motion, is the largest distance of a body from it.

    What forces without a Lagrangian gave to the massive bodies is taken off, as the steps accounted for it
    (`run.work`): what is left of the angular momentum is round-off, of the energy an error of the order of the method.
    With forces the centre of mass moves freely, and Lagrangians that depend on time have no energy: these are NaN.

    Terms of the system are included: the energy is that of the whole Lagrangian. If terms distinguish a `pole`, a unit
    vector, the angular momentum is the component along it; zeros mean that terms with different poles conserve none.

    massive : the bodies that the quantities belong to
    particles : number of massless particles in the run; these quantities say nothing about their orbits
    forces : the kinds of the forces that act on massive bodies
    given : whether the massive bodies are read from an ephemeris: all drifts are then NaN
    """

    energy: diagnostics.Drift
    angular_momentum: diagnostics.Drift
    linear_momentum: diagnostics.Drift
    centre_of_mass: diagnostics.Drift
    massive: tuple[str, ...] = ()
    particles: int = 0
    pole: tuple[float, float, float] | None = None
    forces: tuple[str, ...] = ()
    given: bool = False

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
        rows += [f"({ULPS})", *self.remarks]
        rows += [self.covers] if self.particles else []
        return "\n".join(rows)

    __repr__ = __str__

    def _repr_html_(self) -> str:
        head = ["", "max change", "in ulps", "at the end"]
        rows = [
            [name, f"{d.max_fraction:.2e}", f"{d.max_ulps:.3g}", f"{d.last_fraction:.2e}"]
            for name, d in self._drifts.items()
        ]
        covers = "".join(f"; {remark}" for remark in self.remarks) + (f"; {self.covers}" if self.particles else "")
        return html_table(f"change since the first sample, as a fraction; {ULPS}{covers}", head, rows)

    @property
    def _lost(self) -> bool:
        return self.pole is not None and not any(self.pole)

    @property
    def remarks(self) -> list[str]:
        """What is not conserved, or was taken off, in words."""
        if self.given:
            return [GIVEN]
        remarks = [NOT_KEPT] if self._lost else []
        remarks += [f"less what {few(sorted(set(self.forces)))} gave"] if self.forces else []
        if math.isnan(self.centre_of_mass.max_fraction) and not self.forces:
            remarks.append(NO_CENTRE)
        return remarks + ([NO_ENERGY] if math.isnan(self.energy.max_fraction) else [])

    @property
    def _drifts(self) -> dict[str, diagnostics.Drift]:
        names = ["energy", "angular_momentum", "linear_momentum", "centre_of_mass"]
        words = {"angular_momentum": "ang. mom. of pole" if self.pole else "angular momentum"}
        for name in [name for name in names if math.isnan(getattr(self, name).max_fraction)]:
            names.remove(name)
        return {words.get(name, name.replace("_", " ")): getattr(self, name) for name in names}


class Conservation:
    """The methods of `Trajectory` for conserved quantities."""

    if TYPE_CHECKING:  # set by `Trajectory`
        system: System
        changes: Changes | None
        clock: Clock
        _q: Samples
        _v: Samples

        @property
        def times(self) -> Array: ...

        def __len__(self) -> int: ...

    def work(self) -> tuple[ForceEffect, ...]:
        """Return what each force without a Lagrangian did to the massive bodies up to each sample, in the order of
        `run.system.forces`: work (n,), torque (n, 3) and impulse (n, 3), with the units of energy, angular momentum and
        momentum. What forces do to massless particles is not among it. Empty for a system without forces.

        Raises InputError for samples of a run alone, such as those of `run.at`.
        """
        run: Trajectory = self  # type: ignore[assignment]
        return effects(run)

    def energy(self) -> u.Quantity:
        """Return the energy of the massive bodies, of the whole Lagrangian, shape (n,): with rigid bodies also that of
        rotation, and the potential of the second degree.
        """
        softening = self.system.values.softening
        values = self._of_massive(
            lambda s, q, v, t: whole(s, ENERGY, diagnostics.energy(gm_of(s), q, v, softening), q, v, t)
        )
        if self.system.rigid:
            values = values + self._of_rigid(rigid_bodies().energy)
        return u.Quantity(values / self.system.units.G, self.system.units.energy)

    def linear_momentum(self) -> u.Quantity:
        """Return the momentum of the massive bodies, shape (n, 3), from the step's own velocities."""
        values = self._of_massive(
            lambda s, q, v, t: whole(s, MOMENTUM, diagnostics.linear_momentum(gm_of(s), v), q, v, t)
        )
        return u.Quantity(values / self.system.units.G, self.system.units.momentum)

    def angular_momentum(self) -> u.Quantity:
        """Return the angular momentum of the massive bodies about the origin, shape (n, 3), with the spins of those
        that are rigid.
        """
        values = self._of_massive(
            lambda s, q, v, t: whole(s, ANGULAR_MOMENTUM, diagnostics.angular_momentum(gm_of(s), q, v), q, v, t)
        )
        if self.system.rigid:
            values = values + self._of_rigid(rigid_bodies().angular_momentum)
        return u.Quantity(values / self.system.units.G, self.system.units.angular_momentum)

    def centre_of_mass(self) -> u.Quantity:
        """Return the centre of mass of the massive bodies, shape (n, 3).

        With `PostNewtonian` of several bodies, energies weigh too: sum m* q / sum m*, where m* is m [1 + (v^2 - Phi) /
        (2 c^2)] and Phi is the sum of GM / r over the other bodies.
        """
        values = self._of_massive(lambda s, q, v, t: centre(s, q, v, t))
        return u.Quantity(values, self.system.units.length)

    def drift(self) -> ConservedQuantities:
        """Return the drifts of energy, momenta and centre of mass from the start of the run over these samples, as
        fractions and in ulps; "at the end" is at the latest of these, in whatever order they are.

        They belong to the massive bodies, and include the terms of the system. If terms distinguish an axis, the
        angular momentum is the component along it: the rest is exchanged with a spin that is not integrated. A quantity
        that is not conserved at all is NaN. Massless particles do not contribute, so this says nothing about their
        orbits. Raises InputError for a run without samples.
        """
        if not len(self):
            raise InputError(f"{self!r} has no samples yet, so nothing can drift; expected at least one.")
        massive = self.system.massive
        if given_bodies(self.system):
            named = tuple(name for name, has_mass in zip(self.system.names, massive, strict=True) if has_mass)
            light = int(np.count_nonzero(~massive))
            return ConservedQuantities(NONE, NONE, NONE, NONE, named, light, given=True)
        energy, angular, linear = (values[self._from_the_start()] for values in self.conserved())
        forces, timed = acts_on_massive(self.system), depends_on_time(self.system)
        pole = axis(self.system)
        lost = pole is not None and not any(pole)
        angular = angular if pole is None else angular @ np.array(pole)
        return ConservedQuantities(
            energy=NONE if timed else self._drift(energy, lambda gm, q, v: kinetic_energies(gm, v)),
            angular_momentum=NONE if lost else self._drift(angular, moments),
            linear_momentum=self._drift(linear, lambda gm, q, v: momenta(gm, v), first=0.0),
            centre_of_mass=NONE if forces or self._kicked() else self._uniform_motion(),
            massive=tuple(name for name, has_mass in zip(self.system.names, massive, strict=True) if has_mass),
            particles=int(np.count_nonzero(~massive)),
            pole=pole,
            forces=forces,
        )

    def conserved(self) -> tuple[Array, Array, Array]:
        """Return what an exact run would keep, in the units of the system: energy (1 + n,), angular momentum and
        momentum (1 + n, 3), at the start of the run and at each sample, less what forces gave and changes of bodies
        took.
        """
        run: Trajectory = self  # type: ignore[assignment]
        start, G = self.system, self.system.units.G
        given = accounts_of(run).sum(axis=1) / G if acts_on_massive(start) else np.zeros((len(self), 7))
        taken = self._lost() / G

        def since_start(first: u.Quantity, values: u.Quantity, columns: Any) -> Array:
            return np.concatenate([first.value[None], values.value - given[:, columns] + taken[:, columns]])

        return (
            since_start(start.energy(), self.energy(), 0),
            since_start(start.angular_momentum(), self.angular_momentum(), slice(1, 4)),
            since_start(start.linear_momentum(), self.linear_momentum(), slice(4, 7)),
        )

    def _of_rigid(self, function: Callable[[System, Array, Array], Array]) -> Array:
        """Return what rigid bodies with mass add to a quantity, from their states at the samples."""
        run: Trajectory = self  # type: ignore[assignment]
        states = rigid_bodies().states_in(accounts_of(run), self.system)
        return np.concatenate([function(system, q, states[block]) for block, system, q, _ in self._blocks()])

    def _uniform_motion(self) -> diagnostics.Drift:
        """The drift of the centre of mass from its uniform motion at the start."""
        start, massive = self.system, self.system.massive
        q, v = start.values.q[massive], start.values.v[massive]
        order = self._from_the_start()
        centres = np.concatenate([start.centre_of_mass().value[None], self.centre_of_mass().value])[order]
        times = np.concatenate([[0.0], self.times])[order]
        return uniform_motion_drift(gm_of(start), times, centres, q, centre_velocity(start, q, v))

    def _from_the_start(self) -> NDArray[np.intp]:
        """Return the order in which the run passes its start and these samples, which may be in any."""
        return np.append(0, 1 + np.argsort(self.times * self.clock.direction, kind="stable"))

    def energy_lost(self) -> u.Quantity:
        """Return the energy that the massive bodies lost in mergers and bounces up to each sample, shape (n,).

        With it, `run.energy()` keeps its first value.
        """
        return u.Quantity(self._lost()[:, 0] / self.system.units.G, self.system.units.energy)

    def angular_momentum_lost(self) -> u.Quantity:
        """Return the angular momentum that mergers turned into spin up to each sample, shape (n, 3)."""
        return u.Quantity(self._lost()[:, 1:4] / self.system.units.G, self.system.units.angular_momentum)

    def _lost(self) -> Array:
        """What changes of bodies took up to each sample, times G, (n, 7)."""
        return np.zeros((len(self), 7)) if self.changes is None else self.changes.lost(self.times)

    def _kicked(self) -> bool:
        """Whether changes of bodies moved the centre of mass: by a function, or by the weight of the energy lost."""
        return self.changes is not None and (self.changes.kicks or (bool(len(self.changes.rows)) and self._weighs))

    @property
    def _weighs(self) -> bool:
        values, massive = self.system.values, self.system.massive
        return inertia(self.system, values.q[massive], values.v[massive]) is not None

    def _blocks(self) -> Iterator[tuple[slice, System, Array, Array]]:
        """Yield (samples, system, q, v) of the massive bodies block by block, so that memory stays bounded.

        system : at the start of the run; after mergers, one of the bodies that are there, with their masses
        """
        whole_run = [(slice(0, len(self)), None)]
        for part, bodies in whole_run if self.changes is None else self.changes.parts(self.times):
            system = self.system if bodies is None else of_bodies(self.system, bodies)
            there = self.system.massive if bodies is None else bodies.present & self.system.massive
            massive = np.flatnonzero(there)
            contiguous = massive[-1] - massive[0] + 1 == len(massive)
            columns: Any = slice(massive[0], massive[-1] + 1) if contiguous else massive
            rows = max(1, BLOCK_BYTES // (48 * len(self.system.names)))
            for start in range(part.start, part.stop, rows):
                block = slice(start, min(start + rows, part.stop))
                yield block, system, self._q[block, columns], self._v[block, columns]

    def _of_massive(self, function: Callable[[System, Array, Array, Array], Array]) -> Array:
        nothing, never = np.empty((0, int(self.system.massive.sum()), 3)), np.empty(0)
        found = (function(system, q, v, self.times[block]) for block, system, q, v in self._blocks())
        return np.concatenate([function(self.system, nothing, nothing, never), *found])

    def _drift(
        self, values: Array, terms: Callable[[Array, Array, Array], Array], first: Any = None
    ) -> diagnostics.Drift:
        """Return the drift of a quantity from its first value, that at the start of the run.

        terms : of gm, q and v, the sum of the sizes of its terms, times G; first : what stands for the first value in
            the scale
        """
        start, massive, G = self.system.values, self.system.massive, self.system.units.G
        begin = float(terms(start.gm[massive], start.q[massive], start.v[massive])) / G

        def largest() -> float:
            return float(self._of_massive(lambda s, q, v, t: terms(gm_of(s), q, v)).max()) / G

        scale = own_scale(values[0] if first is None else first, begin, largest)
        return diagnostics.drift(values, scale)


def rigid_bodies() -> Any:
    """Return the module of rigid bodies, which loads kernels and is needed by few runs."""
    from orbits.system import rigid_bodies

    return rigid_bodies


def gm_of(system: System) -> Array:
    """Return the GM of the massive bodies of a system."""
    return system.values.gm[system.massive]
