"""Parts of a `Trajectory`: the cost of a run, the trajectory of one body, all samples as one array."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from astropy import units as u
from numpy.typing import NDArray

from orbits.errors import counted
from orbits.system.presenting import span

if TYPE_CHECKING:
    from orbits.protocols import Samples

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Statistics:
    """The cost of a run.

    steps : whole steps since the epoch
    evaluations : evaluations of the forces among the massive bodies; an implicit step has one for each iteration
    particle_evaluations : evaluations of the field at massless particles, summed over the particles
    wall_time : seconds for marching and writing; for a resumed run those of the last call
    compile_time : seconds for compiling the kernels, or loading them from the cache
    """

    steps: int
    evaluations: int
    particle_evaluations: int
    wall_time: float
    compile_time: float


@dataclass(frozen=True, repr=False)
class BodyTrajectory:
    """The trajectory of one body: q and v of shape (samples, 3), t of shape (samples,), with units."""

    name: str
    t: u.Quantity
    q: u.Quantity
    v: u.Quantity

    def __repr__(self) -> str:
        return f"BodyTrajectory({self.name}, {counted(len(self.t), 'sample')}, {span(self.t)})"


def as_array(samples: Samples) -> Array:
    """Return all samples as one read-only array; those in an archive are memory-mapped, not read."""
    mapped = getattr(samples, "mapped", None)
    array: Array = samples[:] if mapped is None else mapped()
    array.flags.writeable = False
    return array
