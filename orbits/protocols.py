"""What pictures, tables for observers, ephemeris files and grids of times take: the part of a `System`, and of a
`Trajectory`, that they ask for.

Systems and trajectories offer pictures and files as methods, and so stand above those who make them.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, Protocol, Self, overload

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from astropy import units as u
    from astropy.time import Time

    from orbits.diagnostics import Drift
    from orbits.integrators.base import Integrator
    from orbits.lagrangians.terms.base import Term
    from orbits.marching.clocks.clock import Clock
    from orbits.marching.clocks.step_times import Places
    from orbits.point_masses import PointMasses
    from orbits.units import UnitSystem

Array = NDArray[np.float64]


class State(Protocol):
    """Bodies at one time; see `System`."""

    @property
    def names(self) -> tuple[str, ...]: ...

    @property
    def values(self) -> PointMasses: ...

    @property
    def massive(self) -> NDArray[np.bool_]: ...

    @property
    def units(self) -> UnitSystem: ...

    @property
    def epoch(self) -> Time | None: ...

    @property
    def frame(self) -> str: ...

    @property
    def terms(self) -> tuple[Term, ...]: ...

    @property
    def forces(self) -> tuple[Any, ...]: ...

    @property
    def rigid(self) -> Collection[str]: ...

    def index(self, name: str) -> int: ...

    def replaced(self, **values: Any) -> Self: ...

    def __len__(self) -> int: ...


class Samples(Protocol):
    """States of shape (samples, bodies, 3): a NumPy array, or a data set of an archive that is read when indexed."""

    @property
    def shape(self) -> tuple[int, ...]:
        """(samples, bodies, 3)."""

    def __getitem__(self, index: Any) -> Array:
        """Return some of the samples."""


class March(Protocol):
    """An integration from the initial state of a run, with its method and its step."""

    @property
    def step(self) -> int:
        """Whole steps taken."""

    def along(self, places: Places) -> Iterator[tuple[slice, Array, Array]]:
        """March on to ascending places, and yield which come next, or none, and q and v there, (m, bodies, 3)."""

    def close(self) -> None:
        """Release its resources."""


class Lost(Protocol):
    """A massless particle that could not be integrated any further; see `RetiredParticle`."""

    @property
    def name(self) -> str: ...

    @property
    def time(self) -> u.Quantity: ...

    @property
    def q(self) -> u.Quantity: ...

    @property
    def v(self) -> u.Quantity: ...


class Path(Protocol):
    """The samples of one body; see `BodyTrajectory`."""

    @property
    def q(self) -> u.Quantity: ...

    @property
    def v(self) -> u.Quantity: ...


class Drifts(Protocol):
    """The drifts of conserved quantities; see `ConservedQuantities`."""

    @property
    def energy(self) -> Drift: ...

    @property
    def angular_momentum(self) -> Drift: ...

    @property
    def remarks(self) -> list[str]: ...

    @property
    def covers(self) -> str: ...


class Happenings(Protocol):
    """The events of a run; see `Events`."""

    @property
    def kind(self) -> NDArray[Any]: ...

    def __getitem__(self, key: slice) -> Iterable[Any]: ...

    def __len__(self) -> int: ...


class Turning(Protocol):
    """How rigid bodies turn; see `Rotation`."""

    def attitude(self, body: str, *, matrix: bool = False) -> Array: ...

    def rate(self, body: str) -> u.Quantity: ...

    def libration_angle(self, body: str, about: str) -> u.Quantity: ...

    def obliquity(self, body: str, about: str) -> u.Quantity: ...


class Run(Protocol):
    """A run and its samples; see `Trajectory`."""

    @property
    def times(self) -> Array: ...

    @property
    def integrator(self) -> Integrator: ...

    @property
    def clock(self) -> Clock: ...

    @property
    def _span(self) -> tuple[float, float] | None: ...

    @property
    def error_bars(self) -> Any: ...

    @property
    def changes(self) -> Any: ...

    @property
    def _q(self) -> Samples: ...

    @property
    def _v(self) -> Samples: ...

    @property
    def system(self) -> State: ...

    @property
    def names(self) -> tuple[str, ...]: ...

    @property
    def q(self) -> u.Quantity: ...

    @property
    def v(self) -> u.Quantity: ...

    @property
    def step(self) -> float: ...

    @property
    def made_by(self) -> str: ...

    @property
    def _earliest(self) -> float: ...

    @property
    def _last_time(self) -> float: ...

    @property
    def _reached(self) -> float: ...

    @property
    def retired(self) -> Sequence[Lost]: ...

    @property
    def events(self) -> Happenings: ...

    def __len__(self) -> int: ...

    @overload
    def __getitem__(self, key: str) -> Path: ...
    @overload
    def __getitem__(self, key: int) -> State: ...

    def _sample(self, k: int) -> tuple[Array, Array]: ...

    def at(self, t: Any) -> Any: ...

    def _before(self, times: Array) -> tuple[Array, Array]: ...

    def _begun(self) -> March: ...

    def drift(self) -> Drifts: ...

    def conserved(self) -> tuple[Array, Array, Array]: ...

    def closest_approaches(self) -> Iterable[Any]: ...

    @property
    def rotation(self) -> Turning: ...
