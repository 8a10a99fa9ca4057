"""`Trajectory`: sampled states with units and names, in memory or read lazily from an archive."""

from __future__ import annotations

import hashlib
import json
import math
import os
from collections.abc import Callable, Iterator, Sequence
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
from astropy import units as u
from numpy.typing import NDArray

from orbits import diagnostics
from orbits.diagnostics.drift import kinetic_energies, momenta, moments, own_scale, uniform_motion_drift
from orbits.diagnostics.states import finite, numbers
from orbits.errors import ArchiveError, InputError, shown
from orbits.system import OrbitalElements, System, osculating
from orbits.system.checks import few, index_of
from orbits.system.making import primary_name
from orbits.system.model import ANGULAR_MOMENTUM, ENERGY, MOMENTUM, axis, whole
from orbits.system.presenting import NANOSECONDS, labelled_run, span
from orbits.tables import Labelled, Tabular, html_pairs
from orbits.trajectory.values import BodyTrajectory, ConservedQuantities, Samples, Statistics

if TYPE_CHECKING:
    from astropy.time import Time

    from orbits.archive import Archive
    from orbits.certificate import Certificate
    from orbits.integrators.base import Integrator
    from orbits.propagation.approach import Approach
    from orbits.propagation.approaches import Approaches
    from orbits.propagation.passages_seen import Record, Seen
    from orbits.propagation.stopping import Stop
    from orbits.spk import SpkFile

Array = NDArray[np.float64]

NONE = diagnostics.Drift(math.nan, math.nan, math.nan, math.nan)
"""Of what is not conserved."""

BLOCK_BYTES = 32 * 1024 * 1024
"""How much of a run is in memory at a time while a quantity of all samples is computed."""


class Trajectory(Tabular):
    """The samples of a run.

    system : the initial state, which also gives names, GM, units and epoch
    times : (n,) float64, since the epoch, in the system's unit of time
    q, v : (n, bodies, 3) float64, in the system's units; arrays, or what an archive reads from
    step : the signed step actually used, in the unit of time; NaN of a method that chooses its steps as it goes
    integrator, statistics : how it was made and what it cost
    complete : whether every sample that was asked for is there
    path, archive : the archive it reads from, if it does
    certificate : what was measured of the integrator before the run, if it was (see `orbits.certify`)
    stopped : why and where a condition or a callback ended the run, or None

    run.t, run.q, run.v have units; run["Ceres"] is one body's path, run[-1] the `System` at the last sample, run[10:20]
    a `Trajectory` of some of the samples.
    Raises InputError for q and v of another shape, for times that are not finite, and for what is no system or method.
    """

    def __init__(
        self,
        system: System,
        times: Array,
        q: Samples,
        v: Samples,
        *,
        step: float,
        integrator: Integrator,
        statistics: Statistics | None = None,
        complete: bool = True,
        path: str | None = None,
        certificate: Certificate | None = None,
        stopped: Stop | None = None,
        record: Record | None = None,
        close: Callable[[], None] | None = None,
    ) -> None:
        if not isinstance(system, System):
            raise InputError(f"system is {shown(system)}; expected the System at the start of the run.")
        if not hasattr(integrator, "label"):
            raise InputError(f"integrator is {shown(integrator)}; expected a method such as orbits.Gauss(stages=8).")
        self.times = finite(numbers(times, "times"), "times")
        if self.times.ndim != 1:
            raise InputError(f"times has shape {self.times.shape}; expected one time for each sample, shape (n,).")
        expected = (len(self.times), len(system), 3)
        shapes = tuple(getattr(x, "shape", None) for x in (q, v))
        if shapes != (expected, expected):
            raise InputError(
                f"q and v have shapes {shapes[0]} and {shapes[1]}; {expected} fits these times and bodies."
            )
        self.system = system
        self.integrator = integrator
        self.statistics = statistics
        self.step = step
        self.complete = complete
        self.path = path
        self._place = None if path is None else os.path.abspath(path)
        self.certificate = certificate
        self.stopped = stopped
        self.archive: Archive | None = None
        self._record = record
        self._passages: Seen | None = None
        self._q, self._v, self._close = q, v, close

    @classmethod
    def open(cls, path: str | PathLike[str], *, statistics: Statistics | None = None) -> Trajectory:
        """Return the trajectory in an archive, complete or not; it is read when it is asked for.

        Raises ArchiveError for a file that is missing, truncated, foreign or newer, or of a method that is not known.
        """
        from orbits.archive import Archive

        return cls.of_archive(Archive.open(path), path=str(path), statistics=statistics)

    @classmethod
    def of_archive(cls, archive: Archive, *, path: str | None, statistics: Statistics | None = None) -> Trajectory:
        """Return the trajectory in an open archive, which is closed with it, or at once where this fails.

        path : where it can be opened again, or None where it cannot
        Raises ArchiveError for a method that is not known, and for a certificate that is none.
        """
        try:
            integrator, certificate = made_by(archive)
            run = cls(
                archive.system,
                archive.times[: archive.committed],
                archive.q,
                archive.v,
                step=archive.dt,
                integrator=integrator,
                statistics=statistics,
                complete=archive.complete,
                path=path,
                certificate=certificate,
                close=archive.close,
            )
        except BaseException:
            archive.close()
            raise
        run.archive = archive
        return run

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
    def epochs(self) -> Time:
        """Times as astropy Time (TDB), shape (n,), printed with as many digits as tell samples apart, to a nanosecond.

        Raises InputError for a system without an epoch.
        """
        self._epoch()
        moments = self.system.epoch + self.t
        gaps = np.abs(np.diff(self.t.to_value(u.s)))
        closest = float(gaps[gaps > 0.0].min(initial=1.0))
        moments.precision = int(np.clip(np.ceil(-np.log10(closest)) + 1, 3, NANOSECONDS))
        return moments

    def epoch_at(self, time: float) -> Time | None:
        """Return the epoch `time` (a number in the unit of time) after the start, or None for a system without one."""
        return None if self.system.epoch is None else self.system.epoch + u.Quantity(time, self.system.units.time)

    @property
    def dt(self) -> u.Quantity:
        """The step actually used, > 0: the one asked for, rounded to 24 bits.

        Raises InputError for a run of a method that chooses its steps as it goes.
        """
        if math.isnan(self.step):
            raise InputError(f"{self.integrator.label} chooses its steps as it goes, so there is no dt of this run.")
        return u.Quantity(abs(self.step), self.system.units.time)

    @property
    def q(self) -> u.Quantity:
        """Positions, shape (n, bodies, 3), read-only. From an archive they are read where they are used: run.q[-1]."""
        return u.Quantity(_as_array(self._q), self.system.units.length, copy=False)

    @property
    def v(self) -> u.Quantity:
        """Velocities, shape (n, bodies, 3), read-only. From an archive they are read where they are used: run.v[-1]."""
        return u.Quantity(_as_array(self._v), self.system.units.speed, copy=False)

    @property
    def made_by(self) -> str:
        """The method, and its step where it has one, in words: Gauss(stages=8), dt = 6 d."""
        if math.isnan(self.step):
            return self.integrator.label
        return f"{self.integrator.label}, dt = {abs(self.step):g} {self.system.units.time}".rstrip()

    def __len__(self) -> int:
        """Return the number of samples."""
        return len(self.times)

    def __getitem__(self, key: str | int | slice) -> Any:
        """Return the path of a body by name, the `System` at a sample by number (negative ones from the end), or a
        `Trajectory` of the samples of a slice, whose times still count from the epoch of the run.

        Raises UnknownNameError, or IndexError.
        """
        units = self.system.units
        if isinstance(key, str):
            i = index_of(key, self.names, "body")
            q, v = self._q[:, i], self._v[:, i]
            return BodyTrajectory(self.names[i], self.t, u.Quantity(q, units.length), u.Quantity(v, units.speed))
        if isinstance(key, slice):
            return self._some(key)
        if isinstance(key, bool | np.timedelta64) or not isinstance(key, int | np.integer):
            raise InputError(
                f'run[{shown(key)}]: give a name, run["Sun"], the number of a sample, run[-1], or a slice, run[10:20].'
            )
        if not -len(self) <= key < len(self):
            raise IndexError(f"sample {shown(key)} of a run with {len(self)} samples")
        k = int(key) % len(self)
        return self.system.replaced(q=self._q[k], v=self._v[k], epoch=self.epoch_at(float(self.times[k])))

    def at(self, t: Any) -> Any:
        """Return the state at any time within the run, by the run's own method from the sample before it: a `System`;
        or those at several times, a `Trajectory` with these as its samples, in the order given.

        t : a date (a Time, "2030-01-01") or a time since the epoch (a quantity, a number in the system's unit of time),
            or an array or list of such; many at once take about a ninth of the time of as many single calls
        Raises InputError outside the samples.
        """
        from orbits.propagation import state_at

        self._require_method("run.at")
        return state_at(self, t)

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
        """Return how far energy, momenta and centre of mass stray over the samples, as fractions and in ulps.

        Terms of the system count in all of them. Where they single out an axis, the angular momentum is that about it:
        the rest is exchanged with a spin that is not followed. What a term does not conserve at all is NaN, and said.
        They are those of the massive bodies: a massless particle moves in their field and carries no charge of the
        whole, so nothing here judges its orbit. Raises InputError for a run without samples.
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
            massive=tuple(name for name, has_mass in zip(self.names, massive, strict=True) if has_mass),
            particles=int(np.count_nonzero(~massive)),
            pole=pole,
        )

    def elements(self, primary: str | None = None, frame: str | None = None) -> OrbitalElements:
        """Return the osculating elements of all other bodies at all samples, shape (n, bodies - 1).

        primary : a body, "barycentre" or "jacobi"; may be left out where only one body has mass
        frame : "ecliptic" (of J2000) or "icrf" (the system's own axes); by default as of `System.add`
        """
        values = self.system.values
        primary = primary_name(self.names, values.gm, primary)
        return osculating(
            self.names,
            values.gm,
            _as_array(self._q),
            _as_array(self._v),
            units=self.system.units,
            primary=primary,
            frame=frame,
            t=self.times,
            epoch=self.system.epoch,
        )

    def closest_approaches(self) -> Approaches:
        """Return how close bodies came to one another between the start and the last step, and when: a table of all
        flybys within the reach of a body, each with the error that it causes by the end of the run.

        Raises InputError for a trajectory that was not made by `propagate` or `resume`.
        """
        from orbits.propagation.approaches import Approaches

        return Approaches(self, self._seen())

    def unresolved(self) -> list[Approach]:
        """Return the close passages that the step could not resolve, worst first: what comes after is not to be
        trusted. `propagate` warns of them.

        A passage counts if the position error at the end of the run that it causes (`.error`) is more than 1e-9 of the
        distance from the primary and a hundred times what the method makes of an undisturbed orbit with this step in
        this time; on an open orbit without a primary, if more than a tenth of its turn is wrong.
        """
        from orbits.propagation.approaches import Approaches
        from orbits.propagation.judgement import spoiling
        from orbits.propagation.refinement import refine

        seen = self._seen()
        approaches = Approaches(self, seen)
        if seen.left_out < 0:  # a run of an earlier version, which kept no states of the passages
            approaches.know_all()
        found = [k for k, _ in spoiling(self, seen)]
        refine(self, seen, found)
        return [approaches.one(k) for k in found]

    def plot(self, **options: Any) -> Any:
        """Draw the paths; see `orbits.plotting.plot_trajectory`."""
        from orbits.plotting import plot_trajectory

        return plot_trajectory(self, **options)

    def to_spk(self, path: str | PathLike[str], **options: Any) -> SpkFile:
        """Write the run as an SPK ephemeris for SPICE, jplephem, Skyfield and astropy; see `orbits.spk.write`."""
        from orbits.spk import write

        self._require_method("run.to_spk")
        return write(self, path, **options)

    def _some(self, samples: slice) -> Trajectory:
        try:
            times = self.times[samples]
        except (TypeError, ValueError) as error:
            raise InputError(f"run[{shown(samples)}]: expected whole numbers, such as run[10:20] ({error}).") from None
        return Trajectory(
            self.system,
            times,
            _as_array(self._q)[samples],
            _as_array(self._v)[samples],
            step=self.step,
            integrator=self.integrator,
            certificate=self.certificate,
        )

    def _ipython_key_completions_(self) -> list[str]:
        return list(self.names)

    def _labelled(self, bodies: Sequence[str] | None) -> Labelled:
        known: dict[str, str | float] = {"integrator": self.integrator.label}
        known |= {} if math.isnan(self.step) else {"dt": abs(self.step)}
        return labelled_run(self.system, self.times, _as_array(self._q), _as_array(self._v), bodies, known)

    def __reduce__(self) -> Any:
        """Copy and pickle the samples in memory; of an archive its path, so that both read the same file."""
        if self._place is None:
            return super().__reduce__()
        known = {"stopped": self.stopped, "_record": self._record}
        return _reopened, (self._place, len(self), self.statistics, _identity(self, len(self))), known

    def __getstate__(self) -> dict[str, Any]:
        """Leave the open file behind: the samples themselves are copied where no path leads to it."""
        return {**vars(self), "archive": None, "_close": None}

    def _repr_html_(self) -> str:
        epoch = self.system.epoch
        pairs = {"bodies": few(self.names), "epoch": "none" if epoch is None else f"{epoch.isot} TDB"}
        pairs |= {"units": self.system.units.name}
        if self.statistics is not None:
            pairs |= {"steps": f"{self.statistics.steps:,} in {self.statistics.wall_time:.3g} s"}
        if self.certificate is not None:
            pairs |= {"certificate": "holds" if self.certificate.ok else "; ".join(self.certificate.failures)}
        return html_pairs(repr(self), pairs.items())

    def __repr__(self) -> str:
        where = f", in {self.path}" if self.path else ""
        state = "" if self.complete else ", incomplete"
        what = f"{len(self.names)} bodies, {len(self)} samples, {span(self.t)}"
        return f"Trajectory({what}; {self.made_by}{state}{where})"

    def blocks(self) -> Iterator[tuple[slice, Array, Array]]:
        """Yield (samples, q, v) of the massive bodies block by block, so that memory stays bounded."""
        massive = np.flatnonzero(self.system.massive)
        contiguous = massive[-1] - massive[0] + 1 == len(massive)
        columns: Any = slice(massive[0], massive[-1] + 1) if contiguous else massive
        rows = max(1, BLOCK_BYTES // (48 * len(self.names)))
        for start in range(0, len(self), rows):
            block = slice(start, min(start + rows, len(self)))
            yield block, self._q[block, columns], self._v[block, columns]

    def sample(self, k: int) -> tuple[Array, Array]:
        """Return q and v of sample k, (bodies, 3), as numbers in the system's units."""
        return self._q[k], self._v[k]

    def _seen(self) -> Seen:
        from orbits.propagation.passages_seen import Seen

        if self._record is None and self.archive is None:
            raise InputError(
                f"{self!r} holds samples alone, and closest approaches are found while a run goes on; expected the "
                "whole run as orbits.propagate or orbits.resume returned it."
            )
        if self._passages is None:
            self._passages = Seen.by(self, self._record)
        return self._passages

    def _gm(self) -> Array:
        return self.system.values.gm[self.system.massive]

    def _of_massive(self, function: Callable[[Array, Array], Array]) -> Array:
        nothing = np.empty((0, int(self.system.massive.sum()), 3))
        return np.concatenate([function(nothing, nothing), *(function(q, v) for _, q, v in self.blocks())])

    def _drift(self, values: Array, terms: Callable[[Array, Array], Array], first: Any = None) -> diagnostics.Drift:
        """The drift of a quantity; `terms` (of q and v) are the sizes of what it is the sum of, times G."""
        start, massive, G = self.system.values, self.system.massive, self.system.units.G
        begin = float(terms(start.q[massive], start.v[massive])) / G
        scale = own_scale(
            values[0] if first is None else first, begin, lambda: float(self._of_massive(terms).max()) / G
        )
        return diagnostics.drift(values, scale)

    def _require_method(self, what: str) -> None:
        if not hasattr(self.integrator, "declares"):
            raise InputError(
                f"{what} marches from sample to sample with the run's own method, and {self.integrator.label} is none "
                "of this package. Take a sample, run[k], or march from one: orbits.propagate(run[k], ...)."
            )

    def _epoch(self) -> None:
        if self.system.epoch is None:
            raise InputError("this system has no epoch; give System(..., epoch=...) to have dates instead of times.")


def made_by(archive: Archive) -> tuple[Integrator, Certificate | None]:
    """Return the method that the run in an archive was made with, and what was measured of it before, if it was.

    Raises ArchiveError for a method that is not known, and for a certificate that is none.
    """
    from orbits import integrators
    from orbits.certificate import Certificate

    try:
        text = archive.certificate_text
        return integrators.build(archive.integrator), Certificate.from_record(json.loads(text)) if text else None
    except InputError as error:
        raise ArchiveError(
            f"{archive.path}: {str(error).rstrip('.')}. Read the samples themselves with orbits.Archive.open(path), or "
            "get a version of orbits that knows this method."
        ) from error


def _identity(run: Trajectory, samples: int) -> str:
    """Return a digest of what a run began from, how it was made, and its first so many times."""
    values = run.system.values
    digest = hashlib.sha256(repr((run.names, run.integrator.label, run.step, values.softening)).encode())
    for array in (values.gm, values.q, values.v, run.times[:samples]):
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


def _reopened(path: str, samples: int, statistics: Statistics | None, identity: str) -> Trajectory:
    """Return the run in an archive where a copy of it is wanted, as it was with that many samples."""
    run = Trajectory.open(path, statistics=statistics)
    try:
        if len(run) < samples:
            raise ArchiveError(f"{path} holds {len(run)} samples; expected the {samples} of the run that was copied.")
        if _identity(run, samples) != identity:
            raise ArchiveError(f"{path} holds another run by now; expected the one that was copied.")
    except BaseException:
        run.close()
        raise
    return run


def _as_array(samples: Samples) -> Array:
    """Return all samples as one read-only array; those in an archive are mapped, not read."""
    mapped = getattr(samples, "mapped", None)
    array: Array = samples[:] if mapped is None else mapped()
    array.flags.writeable = False
    return array
