"""What a run needs of those that can march it again: states between its samples, and what it passed."""

from __future__ import annotations

from os import PathLike
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from orbits.errors import InputError

if TYPE_CHECKING:
    from orbits.marching.clocks import Place
    from orbits.propagation.approach import Approach
    from orbits.propagation.approaches import Approaches
    from orbits.spk import SpkFile
    from orbits.trajectory.retired import RetiredParticles
    from orbits.trajectory.trajectory import Trajectory

Array = NDArray[np.float64]


class March(Protocol):
    """A march under way, from the initial state of a run, with its method and its step."""

    @property
    def step(self) -> int:
        """Whole steps taken."""

    def advance_to(self, place: Place) -> Any:
        """Take all whole steps before a place that is not behind."""

    def state_at(self, place: Place) -> tuple[Array, Array]:
        """Return q and v, (bodies, 3), at a place to which the march has advanced, which changes nothing."""

    def close(self) -> None:
        """Give back what it holds."""


class MarchesAgain(Protocol):
    """What marches a run again, handed to a `Trajectory` by what made it; `orbits.propagation` has one."""

    def begun(self, run: Trajectory) -> March:
        """Return the march of the run from its initial state."""

    def at(self, run: Trajectory, t: Any) -> Any:
        """Return the state at a time, or the states at several; see `Trajectory.at`."""

    def closest_approaches(self, run: Trajectory) -> Approaches:
        """Return how close bodies came to one another; see `Trajectory.closest_approaches`."""

    def unresolved(self, run: Trajectory) -> list[Approach]:
        """Return the passages that the step could not resolve; see `Trajectory.unresolved`."""

    def retired(self, run: Trajectory) -> RetiredParticles:
        """Return the particles that the run in an archive retired."""


class MarchedAgain:
    """What `Trajectory` has for states between its samples, and for what bodies passed."""

    marched_again_by: ClassVar[MarchesAgain | None] = None
    """What marches those again that are opened or made by hand. `orbits.propagation`, which stands above this file,
    sets it when it loads, as it does with `orbits.Trajectory`."""

    def at(self, t: Any) -> Any:
        """Return the state at any time within the run, by the run's own method from the sample before it: a `System`;
        or those at several times, a `Trajectory` with these as its samples, in the order given.

        t : a date (a Time, "2030-01-01") or a time since the epoch (a quantity, a number in the system's unit of time),
            or an array or list of such; many at once take about a ninth of the time of as many single calls
        Raises InputError outside the samples.
        """
        run: Trajectory = self  # type: ignore[assignment]
        self._require_method("run.at")
        return self._marches_again("run.at").at(run, t)

    def closest_approaches(self) -> Approaches:
        """Return how close bodies came to one another between the start and the last step, and when: a table of all
        flybys within the reach of a body, each with the error that it causes by the end of the run.

        Raises InputError for a trajectory that was not made by `propagate` or `resume`.
        """
        run: Trajectory = self  # type: ignore[assignment]
        return self._marches_again("run.closest_approaches").closest_approaches(run)

    def unresolved(self) -> list[Approach]:
        """Return the close passages that the step could not resolve, worst first: what comes after is not to be
        trusted. `propagate` warns of them.

        A passage counts if the position error at the end of the run that it causes (`.error`) is more than 1e-9 of the
        distance from the primary and a hundred times what the method makes of an undisturbed orbit with this step in
        this time; on an open orbit without a primary, if more than a tenth of its turn is wrong.
        """
        run: Trajectory = self  # type: ignore[assignment]
        return self._marches_again("run.unresolved").unresolved(run)

    def begun(self) -> March:
        """Return a march of the run from its initial state, with its method and its step."""
        run: Trajectory = self  # type: ignore[assignment]
        return self._marches_again("run.begun").begun(run)

    def to_spk(self, path: str | PathLike[str], **options: Any) -> SpkFile:
        """Write the run as an SPK ephemeris for SPICE, jplephem, Skyfield and astropy; see `orbits.spk.write`."""
        from orbits.spk import write

        run: Trajectory = self  # type: ignore[assignment]
        self._require_method("run.to_spk")
        return write(run, path, **options)

    def _marches_again(self, what: str) -> MarchesAgain:
        run: Trajectory = self  # type: ignore[assignment]
        if run._again is None:
            raise InputError(
                f"{what} marches the run again, and nothing was given that can; expected a run of orbits.propagate or "
                "orbits.Trajectory, or orbits.propagation imported before."
            )
        return run._again

    def _require_method(self, what: str) -> None:
        run: Trajectory = self  # type: ignore[assignment]
        if not hasattr(run.integrator, "declares"):
            raise InputError(
                f"{what} marches from sample to sample with the run's own method, and {run.integrator.label} is none "
                "of this package. Take a sample, run[k], or march from one: orbits.propagate(run[k], ...)."
            )
