"""States at any times of a run, computed by its own method from the preceding samples."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from orbits.errors import InputError
from orbits.propagation.available_memory import MEMORY_SHARE, memory
from orbits.propagation.marchers import bound
from orbits.time_grid import snapped, times_since

if TYPE_CHECKING:
    from orbits.system import System
    from orbits.trajectory import Trajectory

Array = NDArray[np.float64]


def state_at(trajectory: Trajectory, t: Any) -> System | Trajectory:
    """Return the state at time t, or the states at several, within the span of the samples.

    t : a time as for `until` of `propagate`, or an array or list of times in any order

    The preceding sample is propagated with the run's own integrator and step, so the error is that of the run. For
    several times the march continues from one to the next, which does not change the result. A single time gives a
    `System`, several give a `Trajectory` with these times as its samples, in the given order.
    Raises InputError for a time outside the run.
    """
    times = times_since(trajectory.system, t, "t")
    if times.ndim > 1:
        raise InputError(f"t has shape {times.shape}; expected one time, or several in a row.")
    one = times.ndim == 0
    q, v, times = _states(trajectory, np.atleast_1d(times), "t" if one else "t[{}]")
    if one:
        return trajectory.system_of(q[0], v[0], float(times[0]))
    return trajectory.with_samples(times, q, v)


def _states(trajectory: Trajectory, times: Array, what: str) -> tuple[Array, Array, Array]:
    """Return q and v, (n, bodies, 3), at n times, and the times, snapped to the ends of the run within rounding."""
    if not len(trajectory):
        raise InputError(f"{trajectory!r} has no samples yet, so there is no state at any time; expected at least one.")
    clock = trajectory.clock
    direction = clock.direction
    order = np.argsort(trajectory.times * direction, kind="stable")  # samples may be in any order
    known = trajectory.times[order]
    times = snapped(times, float(known[0]), float(known[-1]))
    inside = ((known[0] - times) * direction <= 0.0) & ((known[-1] - times) * direction >= 0.0)
    if not inside.all():
        k = int(np.argmin(inside))
        unit = trajectory.system.units.time
        raise InputError(
            f"{what.format(k)} = {times[k]:.10g} lies outside the samples, "
            f"{known[0]:.10g} ... {known[-1]:.10g} {unit}".rstrip()
        )
    needed = 48 * len(times) * len(trajectory.names)
    if needed > MEMORY_SHARE * memory():
        raise InputError(
            f"{len(times)} states of {len(trajectory.names)} bodies need {needed / 2**30:.1f} GiB of memory, more than "
            "this machine has available; ask for fewer at a time"
        )
    before = order[np.searchsorted(known * direction, times * direction, side="right") - 1]
    q, v = np.empty((2, len(times), len(trajectory.names), 3))
    marcher, begun = None, -1
    for k in np.argsort(times * direction, kind="stable").tolist():
        if marcher is None or before[k] != begun:
            begun = int(before[k])
            state = (trajectory._q[begun], trajectory._v[begun])
            begin = float(trajectory.times[begun])
            marcher = bound(trajectory.system, trajectory.integrator, clock, threads=1, state=state, start=begin)
        place = clock.place(float(times[k] - trajectory.times[begun]))
        marcher.advance_to(place)
        q[k], v[k] = marcher.state_at(place)
    whole, _ = clock.places(times)
    for particle in trajectory.retired:  # a march that starts from a sample may get a step farther
        later, body = whole > particle.step, trajectory.names.index(particle.name)
        if clock.changes:
            later = np.abs(times) > abs(particle.time.value)
        q[later, body] = v[later, body] = np.nan
    return q, v, times
