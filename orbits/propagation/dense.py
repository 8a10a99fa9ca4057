"""The state at any time of a run, by the method itself from the sample before."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from orbits.errors import InputError
from orbits.propagation.binding import bound
from orbits.propagation.grid import single_number, split

if TYPE_CHECKING:
    from orbits.system import System
    from orbits.trajectory import Trajectory


def state_at(trajectory: Trajectory, t: Any) -> System:
    """Return the state at time t, a quantity or a number in the run's time unit, within the span of the samples.

    The nearest sample before t is propagated with the run's own integrator and step, so the error is that of the run.
    Raises InputError if t lies outside the run.
    """
    units = trajectory.system.units
    time = single_number(units.time_value(t, "t"), "t")
    times = trajectory.times
    direction = -1.0 if trajectory.step < 0 else 1.0
    if not (times[0] - time) * direction <= 0.0 <= (times[-1] - time) * direction:
        raise InputError(f"t = {time:g} lies outside the samples, {times[0]:g} ... {times[-1]:g} {units.time}")
    k = int(np.searchsorted(times * direction, time * direction, side="right")) - 1
    start = trajectory[k]
    marcher = bound(start, trajectory.integrator, trajectory.step, threads=1)
    (steps,), (rest,) = split(np.array([time - times[k]]), trajectory.step)
    marcher.advance(int(steps))
    q, v = marcher.state_after(float(rest))
    moved: System = start.replaced(q=q, v=v, epoch=trajectory.epoch_at(time))
    return moved
