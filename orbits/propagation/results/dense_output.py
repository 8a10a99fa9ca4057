"""States at any times of a run, computed by its own method from the preceding steps, if they are kept, or samples."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from orbits.errors import EpochError, InputError, with_unit
from orbits.integrators.forms import Array, padded
from orbits.marching.legs.step_keeping import steps_apart
from orbits.propagation.checks.available_memory import MEMORY_SHARE, memory
from orbits.propagation.checks.before_the_start import check_span
from orbits.propagation.marchers import bound
from orbits.propagation.results.marched_again import MarchedAgain
from orbits.system.model import most_inner
from orbits.time_grid import TimeGrid, snapped, times_since
from orbits.trajectory.work import accounts_of
from orbits.units import date_text, told_apart

if TYPE_CHECKING:
    from orbits.marching.stepping.kept_steps import KeptSteps
    from orbits.system import System
    from orbits.trajectory import Trajectory


START = -1
"""Stands among the numbers of samples for the start of a run."""

MOST_AT_ONCE = 65536
"""Number of states computed at a time, whose preceding steps are in memory."""


def state_at(trajectory: Trajectory, t: Any) -> System | Trajectory:
    """Return the state at time t, or the states at several, within the span of the samples.

    t : a time as for `until` of `propagate`, or an array or list of times in any order

    The preceding sample is propagated with the run's own integrator, along its steps: a partial step to the sample is
    taken back. The states are those of the run to round-off; with transformed time, and methods that are not symmetric,
    to the error of one partial step. For several times the march continues from one to the next, which does not change
    the result. If the run has kept its steps, each state is a partial step from the preceding one. A single time gives
    a `System`, several give a `Trajectory` with these times as its samples, in the given order.
    Raises InputError for a time outside the run.
    """
    times = times_since(trajectory.system, t, "t")
    if times.ndim > 1:
        raise InputError(f"t has shape {times.shape}; expected one time, or several in a row.")
    one = times.ndim == 0
    q, v, times, accounts = _states(trajectory, np.atleast_1d(times), "t" if one else "t[{}]")
    if one:
        return trajectory._system_of(q[0], v[0], float(times[0]), None if accounts is None else accounts[0])
    some = trajectory._with_samples(times, q, v)
    some._accounts = accounts
    return some


def _states(trajectory: Trajectory, times: Array, what: str) -> tuple[Array, Array, Array, Array | None]:
    """Return q and v, (n, bodies, 3), at n times, and the times, snapped to the ends of the run within rounding; and
    the accounts there of forces, if some have internal variables.
    """
    direction, kept, span = trajectory.clock.direction, trajectory._kept, trajectory._span
    if not len(trajectory) and (span is None or span[1] == 0.0):
        raise InputError(f"{trajectory!r} has no samples yet, so there is no state at any time; expected at least one.")
    order = np.argsort(trajectory.times * direction, kind="stable")  # samples may be in any order
    known = trajectory.times[order]
    if span is not None and (not len(known) or known[0] != span[0]):
        known, order = np.append(span[0], known), np.append(START, order)
    first, last = (float(known[0]), float(known[-1])) if span is None else span
    if kept is not None and len(kept) and not trajectory.complete:  # an interrupted run has more steps than samples
        last = max(last * direction, float(kept.times[-1, 0]) * direction) * direction
    times = snapped(times, first, last)
    inside = ((first - times) * direction <= 0.0) & ((last - times) * direction >= 0.0)
    if not inside.all():
        k = int(np.argmin(inside))
        system, of = trajectory.system, "samples" if span is None else "run"
        time, begin, end = told_apart(times[k], first, last, digits=10)
        within = with_unit(f"{begin} ... {end}", system.units.time)
        if system.epoch is not None:
            dates = (date_text(system.epoch + x * system.units.time, 16) for x in (first, last))
            within += f" ({' ... '.join(dates)} TDB)"
        raise InputError(f"{what.format(k)} = {time} lies outside the {of}, {within}")
    needed = 48 * len(times) * len(trajectory.names)
    if needed > MEMORY_SHARE * memory():
        raise InputError(
            f"{len(times)} states of {len(trajectory.names)} bodies need {needed / 2**30:.1f} GiB of memory, more than "
            "this machine has available; ask for fewer at a time"
        )
    place = np.searchsorted(known * direction, times * direction, side="right") - 1
    before, begun = order[place], known[place]
    q, v = np.empty((2, len(times), len(trajectory.names), 3))
    missing = (begun != times) | (before == START)
    q[~missing], v[~missing] = trajectory._q[before[~missing]], trajectory._v[before[~missing]]
    changes = trajectory.changes is not None and len(trajectory.changes) > 0
    if changes or kept is None or not len(kept):
        place = _outside_excursions(trajectory, known)[place]
        before, begun = order[place], known[place]
        accounts = _accounts(trajectory, before) if most_inner(trajectory.system) and not changes else None
        _marched(trajectory, begun, before, lambda k: state_of(trajectory, k), times, missing, q, v, accounts)
        return q, v, times, accounts
    starts, marched = kept.times[:, 0], missing
    if steps_apart(trajectory.integrator, trajectory.system.massive) == 1:
        # Behind the last step, one that is chosen may have to be shorter than up to the end of the run.
        marched = missing & ((times - starts[-1]) * direction > 0.0) & trajectory.clock.changes
        if (missing & ~marched).any():
            _part_of_steps(trajectory, kept, times, missing & ~marched, q, v)
    if marched.any():
        rows = np.searchsorted(starts * direction, times * direction, side="right") - 1
        _marched(trajectory, starts[rows], rows, lambda k: _one(kept, k), times, marched, q, v)
    return q, v, times, None


def _outside_excursions(trajectory: Trajectory, times: Array) -> NDArray[np.intp]:
    """Return for each of the times of known states (m,) the last one up to it that lies outside the excursions of all
    bodies from a map, which begin and end as in the run only if the march begins before them; itself if there is none.
    """
    if not len(trajectory.excursions):
        return np.arange(len(times))
    readings = times / trajectory.clock.h
    outside = [not trajectory.excursions.include(reading) for reading in readings.tolist()]
    last = np.maximum.accumulate(np.where(outside, np.arange(len(times)), -1))
    return np.where(last >= 0, last, np.arange(len(times)))


def state_of(trajectory: Trajectory, sample: int) -> tuple[Array, Array]:
    """Return q and v, (bodies, 3), of a sample, or of the `START` of the run."""
    if sample == START:
        return trajectory.system.values.q, trajectory.system.values.v
    return trajectory._sample(sample)


def _accounts(trajectory: Trajectory, samples: NDArray[np.intp]) -> Array:
    """Return the accounts of forces at samples, or at the start of the run, (n, forces, 7 + inner)."""
    known = accounts_of(trajectory)
    start = bound(trajectory.system, trajectory.integrator, trajectory.clock, threads=1).accounts()
    return np.array([start if sample == START else known[sample] for sample in samples])


def _one(kept: KeptSteps, row: int) -> tuple[Array, Array]:
    q, v = kept.states(np.array([row]))
    return q[0], v[0]


def _part_of_steps(
    trajectory: Trajectory, kept: KeptSteps, times: Array, missing: NDArray[np.bool_], q: Array, v: Array
) -> None:
    """Write the `missing` states, by partial steps from kept ones."""
    direction, begun, n = trajectory.clock.direction, kept.times, len(trajectory.names)
    home = bound(trajectory.system, trajectory.integrator, trajectory.clock, threads=1).home
    partial = home.stepper.partial_steps()
    for some in np.array_split(np.flatnonzero(missing), np.arange(MOST_AT_ONCE, missing.sum(), MOST_AT_ONCE)):
        asked = times[some]
        rows = np.searchsorted(begun[:, 0] * direction, asked * direction, side="right") - 1
        parts = (asked - begun[rows, 0]) - begun[rows, 1]
        early = (parts * direction < 0.0) & (rows > 0)  # the sum of both numbers is a little later than the first
        rows[early] -= 1
        parts[early] = (asked[early] - begun[rows[early], 0]) - begun[rows[early], 1]
        found, starts = np.unique(rows, return_inverse=True)
        path = np.zeros((len(found), 2, padded(3 * n)))
        for k, states in enumerate(kept.states(found)):
            path[:, k, : 3 * n] = states.transpose(0, 2, 1).reshape(len(found), 3 * n)
        at = np.empty((2, len(some), 3 * n))
        partial.take(path, starts, begun[rows, 0], parts, np.ones(len(some), dtype=bool), *at)
        q[some], v[some] = at.reshape(2, len(some), 3, n).transpose(0, 1, 3, 2)


def _marched(
    trajectory: Trajectory,
    begun: Array,
    before: NDArray[np.intp],
    state: Callable[[int], tuple[Array, Array]],
    times: Array,
    missing: NDArray[np.bool_],
    q: Array,
    v: Array,
    accounts: Array | None = None,
) -> None:
    """Write the `missing` states, by marches from known ones.

    before : the number of the known state before each time, and `begun` its time; state : returns q and v
    accounts : of forces with internal variables, those at the known states, which those at the times replace
    """
    clock = trajectory.clock
    order = np.argsort(times * clock.direction, kind="stable")
    order = order[missing[order]]
    for some in np.split(order, np.flatnonzero(np.diff(before[order])) + 1) if len(order) else ():
        given = None if accounts is None else accounts[some[0]].copy()
        again = MarchedAgain(trajectory, float(begun[some[0]]), *state(int(before[some[0]])), given)
        for which, *states in again.along(times[some]):
            rows = some[which]
            q[rows], v[rows] = states
            if accounts is not None and len(rows):
                accounts[rows] = again.accounts()
    whole, _ = clock.places(times)
    for particle in trajectory.retired:  # a march that starts from a sample may get a step farther
        later, body = whole > particle.step, trajectory.names.index(particle.name)
        if clock.changes:
            later = np.abs(times) > abs(particle.time.value)
        q[later, body] = v[later, body] = np.nan


def states_before(run: Trajectory, times: Array) -> tuple[Array, Array]:
    """Return q and v, (m, bodies, 3) each, at m times before the earliest one of a run; NaN for bodies not there yet.

    The run is continued backwards with its own method and steps from its earliest state. Neither events nor collisions
    are sought there. Raises EpochError if an ephemeris of the run begins later.
    """
    first = run._earliest
    system = run.at(first)
    dt = run.clock if run.clock.changes else abs(run.step)
    grid = TimeGrid.of(system, dt, duration=float(np.min(times)) - first)
    try:
        check_span(system, grid)
    except EpochError as error:
        early = with_unit(f"{abs(grid.end):.3g}", system.units.time)
        raise EpochError(
            f"light that is seen at the earliest time of the run left up to {early} before it, where it is marched "
            f"back to: {error} Or give times that are as much later."
        ) from None
    clock = grid.clock
    start = system.values.q, system.values.v
    march = bound(system, run.integrator, clock, threads=1, state=start)
    q, v = np.full((2, len(times), len(run.names), 3), np.nan)
    there = [run.names.index(name) for name in system.names]
    order = np.argsort(-times, kind="stable")
    for some, *states in march.along(clock.places(times[order] - first)):
        rows = order[some, None]
        q[rows, there], v[rows, there] = states
    return q, v
