"""Results that need the run to be integrated again: states between its samples, close approaches, variations."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from orbits.archive.ended import STOPPED
from orbits.errors import InputError
from orbits.observing.line_of_sight import SKY, LineOfSight

if TYPE_CHECKING:
    from astropy import units as u
    from astropy.coordinates import EarthLocation
    from astropy.table import QTable

    from orbits.observing import Ephemeris
    from orbits.protocols import March
    from orbits.results.approach import Approach
    from orbits.results.approaches import Approaches
    from orbits.results.error_bars import ErrorBars
    from orbits.results.megno import Megno
    from orbits.results.state_transition import StateTransition
    from orbits.results.stop import Stop
    from orbits.spk import SpkFile
    from orbits.trajectory.retired import RetiredParticles
    from orbits.trajectory.trajectory import Trajectory

Array = NDArray[np.float64]


class MarchesAgain(Protocol):
    """Integrates runs again, as `orbits.propagation` implements it."""

    def begun(self, run: Trajectory) -> March:
        """Return a march of the run from its initial state."""

    def at(self, run: Trajectory, t: Any) -> Any:
        """Return the state at a time, or the states at several; see `Trajectory.at`."""

    def before(self, run: Trajectory, times: Array) -> tuple[Array, Array]:
        """Return q and v, (m, bodies, 3), at m times before the earliest one of a run."""

    def closest_approaches(self, run: Trajectory, covariance: Any = None, body: str | None = None) -> Approaches:
        """Return the closest approaches of bodies; see `Trajectory.closest_approaches`."""

    def unresolved(self, run: Trajectory) -> list[Approach]:
        """Return the passages that the step could not resolve; see `Trajectory.unresolved`."""

    def error_estimate(self, run: Trajectory) -> ErrorBars:
        """Return the error bars of a run; see `Trajectory.error_estimate`."""

    def megno(self, run: Trajectory, *, coupled: bool, seed: int) -> Megno:
        """Return MEGNO and Lyapunov exponents along a run; see `Trajectory.megno`."""

    def state_transition(self, run: Trajectory, *, coupled: bool, parameters: Sequence[str]) -> StateTransition:
        """Return the state-transition matrices at the samples of a run; see `Trajectory.state_transition`."""

    def retired(self, run: Trajectory) -> RetiredParticles:
        """Return the retired particles of a run in an archive."""

    def stopped(self, run: Trajectory) -> Stop:
        """Return why and where a run in an archive was ended."""


class MarchedAgain:
    """The methods of `Trajectory` for states between its samples and for close approaches."""

    _marched_again_by: ClassVar[MarchesAgain | None] = None
    """What `orbits.propagation`, an upper layer, sets when it is loaded, which `orbits.Trajectory` causes."""

    @property
    def _run(self) -> Trajectory:
        """The run whose methods these are."""
        return self  # type: ignore[return-value]

    @property
    def _last_time(self) -> float:
        """The time of the last sample, in the unit of time of the system; 0 without samples."""
        run = self._run
        return float(run.times[-1]) if len(run) else 0.0

    @property
    def _reached(self) -> float:
        """The time up to which the run was marched, which may lie behind its last sample; of samples alone, the last
        time.
        """
        run = self._run
        return self._last_time if run._span is None else run._span[1]

    @property
    def _earliest(self) -> float:
        """The earliest time of which there is a state: that of the start of the run or its end, or of a sample."""
        run = self._run
        return float(np.min(run.times, initial=self._last_time)) if run._span is None else min(run._span)

    @property
    def _has_stopped(self) -> bool:
        """Whether an event, a condition or a callback ended the run."""
        run = self._run
        return run._stopped is not None or (run.archive is not None and run.archive.ended.how == STOPPED)

    @property
    def stopped(self) -> Stop | None:
        """Why and where an event, a condition or a callback ended the run, or None: its reason, time and system.

        From an archive the state is that of run.at, and its condition is None.
        """
        run = self._run
        if run._stopped is None and self._has_stopped:
            run._stopped = self._marches_again("run.stopped").stopped(run)
        return run._stopped

    @stopped.setter
    def stopped(self, stopped: Stop | None) -> None:
        self._run._stopped = stopped

    def at(self, t: Any) -> Any:
        """Return the state at any time within the run, a `System`, or the states at several times, a `Trajectory`.

        They are computed by the run's own method, along its own steps, from the preceding samples, or, if the run was
        made with dense=True, from the preceding steps, at once; and are in the order of the times. A run answers from
        its start up to where it ended, also before its first sample and after its last one; some samples of a run,
        run[10:20], between them.
        t : a date (a Time, "2030-01-01") or a time since the epoch (a quantity, a number in the system's unit of time),
            or an array or list of these; many times at once take about a ninth of the time of single calls
        Raises InputError outside these times.
        """
        self._require_method("run.at")
        return self._marches_again("run.at").at(self._run, t)

    def closest_approaches(self, *, covariance: Any = None, body: str | None = None) -> Approaches:
        """Return the closest approaches of bodies between the start and the last step.

            run.closest_approaches(covariance=fit)  # with the standard deviations of distances and times

        covariance : of the start of one body: a fit, whose orbit the run begins with, its `covariance()`, or a matrix
            (6, 6) in the units and axes of the system. It is carried along to first order by the state transition
        body : whose covariance it is; by default that of the fit, or the only massless one
        They include all flybys within the reach of a body, each with the error it causes at the end of the run.
        The search samples the motion of each body on its own time scale: where inner planets make a star swing, the
        distance of a body far out is known to the amplitude of this swing.
        Raises InputError for a run that did not look for them (see `approaches` of `propagate`), and for a trajectory
        that was not made by `propagate` or `resume`.
        """
        return self._marches_again("run.closest_approaches").closest_approaches(self._run, covariance, body)

    def unresolved(self) -> list[Approach]:
        """Return the close passages that the step did not resolve, worst first; `propagate` warns of them.

        The motion after them is not reliable. A passage is listed if the position error that it causes at the end of
        the run (`.error`) exceeds 1e-9 of the distance from the primary and is a hundred times the method's error on an
        unperturbed orbit with this step and duration. On an open orbit without a primary it is listed if more than a
        tenth of its deflection is wrong.
        """
        return self._marches_again("run.unresolved").unresolved(self._run)

    def error_estimate(self) -> ErrorBars:
        """Return the error bars of all bodies at all samples: what the steps and round-off may have done to them.

            bars = run.error_estimate()
            bars.position, bars.velocity  # (samples, bodies), with units
            bars["Mercury"], bars.relative_to("Earth")["Moon"], bars.growth, bars.lost

        Two companions are marched from the start, at 2.4 times the cost of the run: one with steps of 0.7 times the
        length, and one whose rounding errors are others. Their differences from the run tell its error; see
        `orbits.results.error_bars.ErrorBars`. It is that of the integration: what the model leaves out, and
        what the start is wrong by, is not in it. The result is kept with this trajectory, not in archives.
        Raises InputError for a trajectory without samples, and for one that cannot be integrated again.
        """
        run = self._run
        if run.error_bars is None:
            self._require_method("run.error_estimate")
            run.error_bars = self._marches_again("run.error_estimate").error_estimate(run)
        return run.error_bars

    def megno(self, *, coupled: bool = False, seed: int = 0) -> Megno:
        """Return MEGNO and Lyapunov exponents at the samples of the run, which is marched again for it; NaN for
        particles that are retired by then.

        coupled, seed : as in `orbits.megno`
        Raises InputError as that does, and for a trajectory that cannot be integrated again.
        """
        self._require_method("run.megno")
        found = self._marches_again("run.megno").megno(self._run, coupled=coupled, seed=seed)
        return found.until(np.isnan(self._run.q.value).any(axis=2))

    def state_transition(self, *, coupled: bool = True, parameters: Sequence[str] = ()) -> StateTransition:
        """Return the state-transition matrices at the samples of the run, which is marched again for it; NaN for
        particles that are retired by then.

        coupled, parameters : as in `orbits.state_transition`
        Raises InputError as that does, and for a trajectory that cannot be integrated again.
        """
        self._require_method("run.state_transition")
        again = self._marches_again("run.state_transition")
        found = again.state_transition(self._run, coupled=coupled, parameters=parameters)
        return found.until(np.isnan(self._run.q.value).any(axis=2))

    def ephemeris(
        self,
        bodies: str | Sequence[str] | None = None,
        observer: str | EarthLocation = "Earth",
        times: Any = None,
        *,
        H: Any = None,
        G: Any = None,
    ) -> Ephemeris:
        """Return what an observer sees of bodies: a table like those of JPL's Horizons.

            eph = run.ephemeris("Ceres", times=Time("2026-03-01") + np.arange(30) * u.day)
            eph.ra, eph.dec, eph.distance, eph.range_rate, eph.light_time, eph.elongation, eph.phase, eph.V
            print(eph), eph.to_table(), eph.to_pandas(), eph.text()

        bodies : names; by default all but the observer's. Of one name quantities are (m,), otherwise (m, bodies)
        observer : a body of the run or of DE440 ("Earth" or "geocentre", "Sun" or "heliocentric", "Mars"),
            "barycentre", a place on the Earth, an `EarthLocation`, or the MPC's code of an observatory, such as "568".
            The Earth is that of the run; if it has only the barycentre of Earth and Moon, DE440 places it relative to
            this; if it has neither, it is DE440's
        times : of the observation, as for `run.at`: a `Time` of any scale, which is shown if it is UTC; texts and
            datetime64 are TDB; numbers and quantities count from the epoch. By default those of the samples
        H, G : absolute magnitude and slope, numbers for one body or by name; or H alone, a catalogue as read by
            `orbits.read_mpcorb`. By default those of the catalogue of the package, for bodies of its names

        Right ascension and declination `ra`, `dec` are astrometric, in the ICRF; `apparent_ra`, `apparent_dec` have the
        deflection of light by the Sun and aberration, and on the Earth refer to its true equator and equinox of date
        (IAU 2006/2000A), without refraction. See `orbits.observing.Ephemeris` for all columns.
        Raises InputError for times outside the run, units or a system without an epoch, a body seen from itself, and H
        without G; UnknownNameError for unknown bodies and observers; EpochError for a time outside DE440 if that is
        needed. Warns of places on the Earth at times for which its rotation is not known.
        """
        from orbits.observing import ephemeris_of
        from orbits.system.presenting import attributes

        run = self._run
        self._require_method("run.ephemeris")
        self._marches_again("run.ephemeris")
        return ephemeris_of(run, bodies, observer, times, H=H, G=G, attributes=attributes(run.system))

    def radial_velocity(self, body: str, along: LineOfSight = SKY, times: Any = None) -> u.Quantity:
        """Return the radial velocity of a body as an observer at infinity measures it: positive if it recedes.

            run.radial_velocity("star")                                     # of elements given in frame="sky"
            run.radial_velocity("star", orbits.along(inc=60 * u.deg), times)

        body : its name; along : the line of sight, see `orbits.along`, by default z
        times : as for `run.at`; by default those of the samples

        It is relative to the barycentre, in m/s (in the unit of speed of a system without physical units), of the shape
        of the times, which are those of the body: without light time and relativity. Raises InputError for times
        outside the run, and if bodies merge or are changed; UnknownNameError.
        """
        from orbits.observing.line_of_sight import radial_velocity_of

        return radial_velocity_of(self._run, body, along, times)

    def transits(self, body: str, along: LineOfSight | None = None, star: str | None = None) -> QTable:
        """Return a table of the transits of a body that `orbits.events.Transit` found, as seen from infinity.

            run = orbits.propagate(system, ..., events=orbits.events.Transit("b", "star", observer=orbits.along()))
            print(run.transits("b"))

        body : its name; along, star : the line of sight and the body behind it, if there are several such events

        The columns are number, date (TDB, if there is an epoch) and time of the middle, where both are closest on the
        sky; duration, from first to fourth contact, and full_duration, from second to third (NaN without them);
        impact_parameter, the least distance in radii of the star; and o_minus_c, the time less that of the linear
        ephemeris with the least squares, whose t0 (a time since the epoch) and period are in its meta.
        Raises InputError if there are no transits, or those of several events; UnknownNameError.
        """
        from orbits.observing.transits import transits_of

        return transits_of(self._run, body, along, star)

    def _before(self, times: Array) -> tuple[Array, Array]:
        """Return q and v, (m, bodies, 3), at m times before the earliest one of the run, by its own method."""
        return self._marches_again("run.ephemeris").before(self._run, times)

    def _begun(self) -> March:
        """Return a march of the run from its initial state, with its method and its step."""
        return self._marches_again("run.to_spk").begun(self._run)

    def to_spk(self, path: str | PathLike[str], **options: Any) -> SpkFile:
        """Write the run as an SPK ephemeris for SPICE, jplephem, Skyfield and astropy; see `orbits.spk.write`."""
        from orbits.spk import write

        self._require_method("run.to_spk")
        return write(self._run, path, **options)

    def _marches_again(self, what: str) -> MarchesAgain:
        if self._marched_again_by is None:
            raise InputError(
                f"{what} integrates the run again, which this trajectory cannot; expected a run of orbits.propagate or "
                "orbits.Trajectory, or orbits.propagation imported before."
            )
        return self._marched_again_by

    def _require_method(self, what: str) -> None:
        integrator = self._run.integrator
        if not hasattr(integrator, "declares"):
            raise InputError(
                f"{what} integrates from sample to sample with the run's own method, but {integrator.label} is not "
                "a method of this package. Use a sample, run[k], or start from one: orbits.propagate(run[k], ...)."
            )
