"""The error of a run, from two companions: one with finer steps, and one with other rounding errors.

The first has steps of 0.7 times the length; with a method of order p, its difference from the run, divided by
1 - 0.7^p, is the error that the steps cause. The second has steps that are shorter by a thousandth: all its rounding
errors are others, also those of the coefficients, and of the same size; the p thousandths of the error of the steps by
which it differs, too, are taken off. Both start from the floats of the run. (A start changed beyond its last bit would
have other rounding errors, too, but the run's response to the change is not round-off: that of a moon, whose
coordinates about the barycentre of the system are a thousand times its distance from its planet, was a hundred times
larger than its error.)

Round-off is a random walk, on which the flow acts as on any other error, so that the difference of two runs is as large
as the error of each, wherever that has grown to. See `SAFETY` in `error_bars` for what is left to chance.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from orbits.errors import InputError, IntegrationError, Interrupted
from orbits.integrators.forms import Array
from orbits.propagation.checks.available_memory import MEMORY_SHARE, memory
from orbits.propagation.control.signals import StopRequest
from orbits.propagation.marchers import bound
from orbits.results.error_bars import ErrorBars
from orbits.system.model import model

if TYPE_CHECKING:
    from orbits.marching.clocks.clock import Clock
    from orbits.trajectory import Trajectory


FINER = 0.7
"""The steps of the first companion, as a fraction of those of the run. Not a power of two, with which multiples of h
would have the rounding errors of the run."""

ALIKE = 0.999
"""The same for the second companion: its error of the steps is nearly that of the run, so that it cancels."""


def error_bars(run: Trajectory, threads: int | None = None) -> ErrorBars:
    """Return the error bars of a run, at the cost of 2.4 such runs; see `Trajectory.error_estimate`."""
    _check(run)
    clock, order = run.clock, run.integrator.order_with(model(run.system).lagrangian)
    with StopRequest() as stop:
        finer, one = _followed(run, clock.finer(run.integrator, FINER), threads, stop)
        finer /= 1.0 - FINER**order
        other, two = _followed(run, clock.finer(run.integrator, ALIKE), threads, stop)
        other -= (1.0 - ALIKE**order) * finer
    if stop.name:
        raise Interrupted(f"{stop.name} came while the error was estimated, after the run", trajectory=run)
    failures = {"finer steps": one, "other rounding": two}
    notes = [f"the companion with {what} failed: {failure}" for what, failure in failures.items() if failure]
    q, v = (np.asarray(x[:]) for x in (run._q, run._v))
    return ErrorBars(run.system, run.times, q, v, finer, other, made_by=run.made_by, notes=notes)


def _check(run: Trajectory) -> None:
    """Raise InputError for a run that cannot be followed by companions."""
    if not len(run):
        raise InputError(f"{run!r} has no samples yet, so there is no error to estimate; expected at least one.")
    if not run.clock.changes and not math.isfinite(run.clock.h):
        raise InputError(f"{run!r} has no known steps, so no companion can be marched; expected a run of propagate.")
    needed = 2 * 48 * len(run) * len(run.names)
    if needed > MEMORY_SHARE * memory():
        raise InputError(
            f"the error bars of {len(run):,} samples of {len(run.names):,} bodies need {needed / 2**30:.1f} GiB of "
            "memory, more than this machine has; estimate those of some samples: run[::10].error_estimate()"
        )


def _followed(run: Trajectory, clock: Clock, threads: int | None, stop: StopRequest) -> tuple[Array, str]:
    """Return how far a companion with this clock is from the run at its samples, (n, bodies, 6), NaN from where it
    failed, and why it did.
    """
    out = np.full((len(run), len(run.names), 6), np.nan)
    marcher = bound(run.system, run.integrator, clock, threads)
    try:
        order = np.argsort(run.times * clock.direction, kind="stable")
        for some, q, v in marcher.along(clock.places(run.times[order])):
            for k, *states in zip(order[some].tolist(), q, v, strict=True):
                for at, x, known in zip((0, 3), states, run._sample(k), strict=True):
                    out[k, :, at : at + 3] = x - known
            if stop.name:
                break
    except IntegrationError as error:
        return out, str(error)
    finally:
        marcher.close()
    return out, ""
