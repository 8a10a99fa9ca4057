"""The steps of a run kept for dense output: on their way to memory or to an archive."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from orbits.errors import ArchiveError, InputError, StorageError
from orbits.integrators.base import Integrator
from orbits.integrators.forms import Array
from orbits.marching.legs.step_keeping import keep_steps, steps_apart
from orbits.marching.stepping.kept_steps import PIECE_BYTES, StepsInMemory
from orbits.propagation.checks.available_memory import MEMORY_SHARE, memory
from orbits.time_grid import TimeGrid, dynamical_time

if TYPE_CHECKING:
    from orbits.archive import Archive
    from orbits.marching.legs.excursions.planet_excursions import Legs
    from orbits.system import System


FIRST_BYTES = 16 * 1024 * 1024
"""The most room for steps that are not known beforehand, when an archive is created."""

SHORT = 0.2
"""A step that is chosen, as a fraction of the dynamical time: most are longer."""


class StepStore:
    """Collects the states at the beginnings of the steps of a march, the first one included.

    marcher : at its start, or where an archived run is resumed; fresh : whether nothing is kept yet
    in_memory : whether they stay in memory; else what is `kept` is written to an archive, and then cleared
    """

    def __init__(self, marcher: Legs, *, fresh: bool = True, in_memory: bool) -> None:
        q, v = marcher.state()
        self.kept, self._in_memory = StepsInMemory(len(q)), in_memory
        if fresh:
            self.kept.add(np.zeros((1, 2)), q[None], v[None])
        keep_steps(marcher.home, self._add, self.kept.take_back)

    def _add(self, times: Array, q: Array, v: Array) -> None:
        if self._in_memory and self.kept.nbytes + q.nbytes + v.nbytes > MEMORY_SHARE * memory():
            raise StorageError(
                f"the {len(self.kept):,} steps kept so far for dense output need {self.kept.nbytes / 2**30:.1f} GiB of "
                "memory, nearly all that this machine has; use archive=... to write them to a file during the run"
            )
        self.kept.add(times, q, v)

    @property
    def full(self) -> bool:
        """Whether they should be written to the archive."""
        return not self._in_memory and self.kept.nbytes >= PIECE_BYTES


def check_memory(system: System, integrator: Integrator, grid: TimeGrid) -> None:
    """Refuse to keep in memory the steps of a run that has more than fit; those of one length are known beforehand."""
    if grid.clock.changes:
        return
    rows, bodies = _rows(system, integrator, grid.whole_steps), len(system)
    needed = rows * (48 * bodies + 16)
    if needed > MEMORY_SHARE * memory():
        raise InputError(
            f"dense=True keeps {rows:,} steps of {bodies} bodies, which need {needed / 2**30:.1f} GiB of memory, more "
            "than this machine has available; use archive=... to write them to a file during the run"
        )


def _rows(system: System, integrator: Integrator, steps: int) -> int:
    """Return the number of states that are kept of so many steps."""
    return 1 + steps // steps_apart(integrator, system.massive)


def room_for_steps(system: System, integrator: Integrator, grid: TimeGrid) -> int:
    """Return for how many states a new archive has room: for all, if the steps are of one length; else for some,
    estimated from the dynamical time at the start.
    """
    if not grid.clock.changes:
        return _rows(system, integrator, grid.whole_steps)
    expected = _rows(system, integrator, math.ceil(abs(grid.end) / (SHORT * dynamical_time(system))))
    return max(64, min(expected, FIRST_BYTES // (48 * len(system) + 16)))


def continued(archive: Archive, marcher: Legs) -> StepStore | None:
    """Return the store that continues the kept steps of an archive, if it has any, from its checkpoint.

    Raises ArchiveError if they do not lead up to the checkpoint.
    """
    if archive.steps is None:
        return None
    rows = len(archive.steps)
    if rows != _rows(archive.system, marcher.problem.integrator, marcher.step) and (rows or marcher.step):
        raise ArchiveError(
            f"{archive.path} is damaged: it keeps {rows} steps, but its checkpoint is after {marcher.step}. Restore it "
            "from a copy."
        )
    return StepStore(marcher, fresh=not rows, in_memory=False)
