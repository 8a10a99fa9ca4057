"""What a `Trajectory` is made of and gives out: samples, what a run cost, the path of one body."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from astropy import units as u
from numpy.typing import NDArray

from orbits.system.presenting import span

Array = NDArray[np.float64]


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


@dataclass(frozen=True, repr=False)
class BodyTrajectory:
    """One body's path: q and v of shape (samples, 3), t of shape (samples,), with units."""

    name: str
    t: u.Quantity
    q: u.Quantity
    v: u.Quantity

    def __repr__(self) -> str:
        return f"BodyTrajectory({self.name}, {len(self.t)} samples, {span(self.t)})"
