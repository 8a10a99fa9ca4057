"""`Trajectory`: sampled states with units and names, in memory or read lazily from an archive."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping, Sequence
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
from astropy import units as u
from numpy.typing import NDArray

from orbits.body_names import Named, index_of
from orbits.checks import finite_numbers, place_in
from orbits.errors import InputError, shown
from orbits.export import Labelled, Tabular
from orbits.former_names import Renamed
from orbits.marching.clocks.clock import Clock
from orbits.marching.clocks.constant import clock_of
from orbits.system import OrbitalElements, System
from orbits.system.model import continued, most_inner
from orbits.system.presenting import NANOSECONDS
from orbits.trajectory.archived import identity_of
from orbits.trajectory.changes import Changes, Legs, at_time, no_changes
from orbits.trajectory.conservation import Conservation
from orbits.trajectory.events import Events, events_of
from orbits.trajectory.excursions import Excursions
from orbits.trajectory.marched_again import MarchedAgain
from orbits.trajectory.osculating import elements_of
from orbits.trajectory.parts import BodyTrajectory, Statistics, as_array
from orbits.trajectory.presented import as_line, as_table, labelled
from orbits.trajectory.retired import RetiredParticles, absent, moved
from orbits.trajectory.rotation import Rotation
from orbits.trajectory.stored import of_archive, reopened
from orbits.trajectory.work import accounts_of
from orbits.units import written

if TYPE_CHECKING:
    from astropy.time import Time

    from orbits.archive import Archive
    from orbits.certificate import Certificate
    from orbits.integrators.base import Integrator
    from orbits.marching.legs.record import Record
    from orbits.marching.stepping.kept_steps import KeptSteps
    from orbits.protocols import Samples
    from orbits.results.error_bars import ErrorBars
    from orbits.results.stop import Stop

Array = NDArray[np.float64]


class Trajectory(MarchedAgain, Conservation, Named, Tabular, Renamed):
    """The samples of a run.

    system : the initial state, which also determines names, GM, units and epoch
    times : (n,) float64, since the epoch, in the system's unit of time
    q, v : (n, bodies, 3) float64, in the system's units; arrays, or data sets of an archive
    step : the signed step that was used, in the unit of time, or the clock of the steps; NaN for a method with adaptive
        steps
    integrator, statistics : the method and the cost of the run
    complete : whether all requested samples are there
    path, archive : the archive that samples are read from, or None
    certificate : the certificate of the integrator, if it was measured before the run (see `orbits.certify`)
    stopped : why and where an event, a condition or a callback ended the run, or None
    retired : the retired massless particles; None to read them from the archive
    accounts : (n, forces, 7), what forces did up to each sample (see `orbits.trajectory.work`), or None
    kept : the states at the beginnings of all steps (see `orbits.marching.stepping.kept_steps`), or None

    run.t, run.q, run.v have units; run["Ceres"] is the trajectory of one body, run[-1] the `System` at the last sample,
    run[10:20] a `Trajectory` of some of the samples. Massless particles that could not be integrated any further are
    listed in run.retired; from then on they are NaN in run.q and run.v, and absent from run[k].
    Raises InputError for q and v of another shape, times that are not finite, and anything but a System and a method.
    """

    def __init__(
        self,
        system: System,
        times: Array,
        q: Samples,
        v: Samples,
        *,
        step: Clock | float,
        integrator: Integrator,
        statistics: Statistics | None = None,
        complete: bool = True,
        path: str | None = None,
        certificate: Certificate | None = None,
        stopped: Stop | None = None,
        retired: RetiredParticles | None = None,
        accounts: Array | None = None,
        kept: KeptSteps | None = None,
        close: Callable[[], None] | None = None,
    ) -> None:
        if not isinstance(system, System):
            raise InputError(f"system is {shown(system)}; expected the System at the start of the run.")
        if not hasattr(integrator, "label"):
            raise InputError(f"integrator is {shown(integrator)}; expected a method such as orbits.Gauss(stages=8).")
        self._times = finite_numbers(times, "times").copy()
        if self._times.ndim != 1:
            raise InputError(f"times has shape {self._times.shape}; expected one time for each sample, shape (n,).")
        expected = (len(self.times), len(system), 3)
        shapes = tuple(getattr(x, "shape", None) for x in (q, v))
        if shapes != (expected, expected):
            raise InputError(
                f"q and v have shapes {shapes[0]} and {shapes[1]}; expected {expected} for these times and bodies."
            )
        self.system = system
        self.integrator = integrator
        self.statistics = statistics
        self.clock = clock_of(step)
        self.complete = complete
        self.path = path
        self._place = None if path is None else os.path.abspath(path)
        self.certificate = certificate
        self._span: tuple[float, float] | None = None
        self._stopped = stopped
        self.archive: Archive | None = None
        self._record: Record | None = None  # of close passages, or what it is made of when it is asked for:
        self._ended: tuple[bool, Callable[[], Mapping[str, NDArray[Any]]]] | None = None
        self._passages: Any = None
        self.error_bars: ErrorBars | None = None
        self._retired = retired
        self._events: Events | None = None
        self._excursions: Excursions | None = None
        self._accounts = accounts
        self.changes: Changes | None = None
        self._kept = kept
        self._q, self._v, self._close = q, v, close

    @classmethod
    def open(cls, path: str | PathLike[str], *, statistics: Statistics | None = None) -> Trajectory:
        """Return the trajectory in an archive, complete or not; samples are read when they are used.

        Raises ArchiveError for a file that is missing, truncated, foreign or newer, or has an unknown method.
        """
        from orbits.archive import Archive

        return of_archive(cls, Archive.open(path), path=str(path), statistics=statistics)

    def close(self) -> None:
        """Close the archive behind this trajectory; nothing can be read from it afterwards."""
        if self._close is not None:
            self._close()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the bodies, in the order of the second axis of q and v."""
        return self.system.names

    @property
    def t(self) -> u.Quantity:
        """Times since the epoch, shape (n,)."""
        return u.Quantity(self.times, self.system.units.time)

    @property
    def span(self) -> tuple[float, float]:
        """The first and the last time at which `run.at` answers, since the epoch, in the unit of time.

        These are the start and the end of the run, which may lie beyond its samples; of samples alone, run[10:20], the
        times of the first and the last one, or zeros without any.
        """
        if self._span is not None:
            return self._span
        first, last = (float(self.times.min()), float(self.times.max())) if len(self) else (0.0, 0.0)
        return (first, last) if self.clock.direction > 0.0 else (last, first)

    @property
    def epochs(self) -> Time:
        """Times as astropy Time (TDB), shape (n,), printed with enough digits to distinguish samples, to a nanosecond.

        Raises InputError for a system without an epoch.
        """
        self._epoch()
        moments = written(self.system.epoch + self.t)
        gaps = np.abs(np.diff(self.t.to_value(u.s)))
        closest = float(gaps[gaps > 0.0].min(initial=1.0))
        moments.precision = int(np.clip(np.ceil(-np.log10(closest)) + 1, 3, NANOSECONDS))
        return moments

    @property
    def step(self) -> float:
        """The length of a step with the sign of the direction; NaN for adaptive steps."""
        return self.clock.h

    @property
    def dt(self) -> u.Quantity:
        """The step that was used, > 0: the requested step, rounded to 24 bits.

        Raises InputError for a run whose steps differ, or are unknown.
        """
        if math.isnan(self.step):
            steps = self.clock.describe(self.integrator) or "steps of unknown length"
            raise InputError(f"this run took {steps}, so it has no dt.")
        return u.Quantity(abs(self.step), self.system.units.time)

    @property
    def times(self) -> Array:
        """Times since the epoch in the system's unit of time, shape (n,), read-only."""
        return as_array(self._times)

    @property
    def q(self) -> u.Quantity:
        """Positions, shape (n, bodies, 3), read-only. Those in an archive are read when they are used: run.q[-1]."""
        return u.Quantity(as_array(self._q), self.system.units.length, copy=False)

    @property
    def v(self) -> u.Quantity:
        """Velocities, shape (n, bodies, 3), read-only. Those in an archive are read when they are used: run.v[-1]."""
        return u.Quantity(as_array(self._v), self.system.units.speed, copy=False)

    @property
    def retired(self) -> RetiredParticles:
        """The massless particles that could not be integrated any further: name, time, last state and reason of each.

        Afterwards their q and v are NaN, and they are absent from `run[k]`.
        """
        if self._retired is None:
            if self.archive is None:
                self._retired = RetiredParticles()
            else:
                self._retired = self._marches_again("run.retired").retired(self)
        return self._retired

    @property
    def events(self) -> Events:
        """The events that were sought in the run and found, in its order; empty if none were sought."""
        if self._events is None:
            self._events = Events() if self.archive is None else events_of(self.archive)
        return self._events

    @property
    def excursions(self) -> Excursions:
        """When all bodies left a Wisdom–Holman map that follows planets in encounters, and when they returned to it."""
        if self._excursions is None:
            self._excursions = Excursions.in_archive(self)
        return self._excursions

    @property
    def rotation(self) -> Rotation:
        """How rigid bodies, and those with `Tides`, turn: attitudes, angular velocities, obliquities, librations."""
        return Rotation(self)

    @property
    def legs(self) -> tuple[Legs, ...]:
        """The parts of the run in which bodies, masses and radii stay the same: each with its time, names, GM, radii.

        A run in which no bodies merge, and no event changes masses or radii, has one.
        """
        changes = self.changes or Changes(self.system, no_changes(), self.clock.direction)
        return changes.legs()

    @property
    def made_by(self) -> str:
        """The method and its steps in words: Gauss(stages=8), dt = 6 d; or for a run without dt: Gauss(stages=8),
        adaptive steps (tolerance 1e-09).
        """
        steps = self.clock.describe(self.integrator, self.system.units.time)
        return f"{self.integrator.label}, {steps}" if steps else self.integrator.label

    def __len__(self) -> int:
        """Return the number of samples."""
        return len(self.times)

    def __getitem__(self, key: str | int | slice) -> Any:
        """Return the trajectory of a body by name, the `System` at a sample by index, or a `Trajectory` by a slice.

        Negative indices count from the end. Times of a slice still count from the epoch of the run.
        Raises UnknownNameError or OutOfRangeError, and InputError for other keys.
        """
        units = self.system.units
        if isinstance(key, str):
            i = index_of(key, self.names, "body")
            q, v = self._q[:, i], self._v[:, i]
            return BodyTrajectory(self.names[i], self.t, u.Quantity(q, units.length), u.Quantity(v, units.speed))
        if isinstance(key, slice):
            return self._some(key)
        expected = 'a name, run["Sun"], a sample, run[-1], or a slice, run[10:20]'
        k = place_in(len(self), key, "run", "samples", expected)
        accounts = accounts_of(self)[k] if most_inner(self.system) else None
        return self._system_of(self._q[k], self._v[k], float(self.times[k]), accounts)

    def _system_of(self, q: Array, v: Array, time: float, accounts: Array | None = None) -> System:
        """Return the `System` of a state of this run, (bodies, 3) each, without particles that are retired by then.

        accounts : (forces, 7 + inner), those of a state of forces with internal variables

        Raises InputError for other states that are not finite.
        """
        if self.changes is not None:
            return at_time(self.system, self.changes, q, v, time)
        gone = absent(q, v, self.system.massive)
        # A particle may fail in the partial step to a sample, which the march itself does not take.
        if gone.any() and self.clock.place(time).rest == 0.0:
            gone &= np.isin(self.names, self.retired.names)
        return moved(self.system if accounts is None else continued(self.system, accounts), q, v, time, gone)

    def elements(self, primary: str | None = None, frame: str | None = None) -> OrbitalElements:
        """Return the osculating elements of all other bodies at all samples, shape (n, bodies - 1).

        primary : a body, "barycentre" or "jacobi"; optional if only one body has mass
        frame : "ecliptic" (of J2000), "icrf", "sky" or "system" (the system's own axes); by default
            that of `System.frame`
        Bodies that merged before the first of these samples are left out.
        Raises as `System.elements` does.
        """
        return elements_of(self, primary, self.system.frame if frame is None else frame)

    def plot(self, kind: str = "paths", **options: Any) -> Any:
        """Return a picture of the run, a matplotlib Figure.

            run.plot()
            run.plot("elements", elements=("a", "e", "pomega"), bodies=["Mercury"])
            run.plot("resonance", resonance="3:1", planet="Jupiter")

        kind : "paths", "elements", "phase", "resonance", "error", "energy" or "rotation"; see
            `orbits.plotting.plot_run`
        options : bodies, title, frame, and those of the kind
        Raises UnknownNameError for another kind, InputError for what it does not take or cannot draw of this run.
        """
        from orbits.plotting import plot_run

        return plot_run(self if kind == "error" else self._in_order(), kind, **options)

    def _in_order(self) -> Trajectory:
        """Return the samples in the order of the run, in which lines join them, if they are in neither direction."""
        gaps = np.diff(self.times)
        if not np.min(gaps, initial=0.0) < 0.0 < np.max(gaps, initial=0.0):
            return self
        return self._some(np.argsort(self.times * self.clock.direction, kind="stable"))

    def _some(self, samples: slice | NDArray[np.intp]) -> Trajectory:
        try:
            times = self.times[samples]
        except (TypeError, ValueError) as error:
            raise InputError(f"run[{shown(samples)}]: expected whole numbers, such as run[10:20] ({error}).") from None
        some = self._with_samples(
            times, as_array(self._q)[samples], as_array(self._v)[samples], certificate=self.certificate
        )
        some._accounts = self._own_accounts()
        some._accounts = None if some._accounts is None else some._accounts[samples]
        return some

    def _own_accounts(self) -> Array | None:
        """What forces did up to each sample, also of an archive, or None where it is not known."""
        known = self._accounts is not None or self.archive is not None
        return accounts_of(self) if known and self.system.forces else None

    def _with_samples(self, times: Array, q: Array, v: Array, *, certificate: Certificate | None = None) -> Trajectory:
        """Return other states of the same run as a trajectory: times (n,), q and v (n, bodies, 3), floats."""
        other = Trajectory(
            self.system,
            times,
            q,
            v,
            step=self.clock,
            integrator=self.integrator,
            certificate=certificate,
            retired=self.retired,
            kept=self._kept,
        )
        other.changes, other._events = self.changes, self.events.between(other.times)
        other._excursions = self.excursions
        return other

    def _ipython_key_completions_(self) -> list[str]:
        return list(self.names)

    def _labelled(self, bodies: Sequence[str] | None) -> Labelled:
        return labelled(self, bodies)

    def __reduce__(self) -> Any:
        """Copy and pickle samples in memory, or the path of an archive, so that both read the same file."""
        if self._place is None:
            return super().__reduce__()
        known: dict[str, Any] = {"_stopped": self.stopped, "_span": self._span, "_record": self._record}
        known |= {"_retired": self.retired, "_events": self.events, "_excursions": self.excursions}
        own = type(self), self._place, len(self), self.statistics, identity_of(self, len(self))
        return reopened, own, known

    def __getstate__(self) -> dict[str, Any]:
        """Leave out the open file; the samples themselves are copied if it has no path."""
        known: dict[str, Any] = {"_retired": self.retired, "_accounts": self._own_accounts()}
        known |= {"_events": self.events, "_excursions": self.excursions, "archive": None, "_close": None}
        return vars(self) | known

    def _repr_html_(self) -> str:
        return as_table(self)

    def __repr__(self) -> str:
        return as_line(self)

    def _sample(self, k: int) -> tuple[Array, Array]:
        """Return q and v of sample k, (bodies, 3), as numbers in the system's units."""
        return self._q[k], self._v[k]

    def _epoch(self) -> None:
        if self.system.epoch is None:
            raise InputError("this system has no epoch; use System(..., epoch=...) to get dates instead of times.")
