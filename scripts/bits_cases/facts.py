"""What is kept of a run: samples, costs, and all that happened on the way."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np

import orbits

Facts = dict[str, Any]
"""Quantities by name: arrays of float64, one row for each sample or happening; numbers and words."""

Case = tuple[str, Callable[[], Facts]]
"""A name, and what computes its quantities."""


class Skipped(Exception):
    """A case cannot be run here, because a package is missing."""


COSTS = ("steps", "evaluations", "particle evaluations", "seconds")


def states(run: Any) -> Facts:
    """Return samples and costs of a run."""
    found: Facts = {"t": run.t.value, "q": run.q.value, "v": run.v.value}
    if run.statistics is not None:
        found["steps"] = run.statistics.steps
        found["evaluations"] = run.statistics.evaluations
        found["particle evaluations"] = run.statistics.particle_evaluations
        found["seconds"] = run.statistics.wall_time
    return found | stopped(run)


def stopped(run: Any) -> Facts:
    """Return why and where a run was ended."""
    if run.stopped is None:
        return {}
    stop = run.stopped
    return {
        "stopped by": stop.reason,
        "stopped at": np.array([stop.time.value]),
        "stopped q": stop.system.q.value[None],
        "stopped v": stop.system.v.value[None],
    }


def approaches(run: Any) -> Facts:
    """Return the closest approaches of a run: the closest of each body, all flybys, and those not resolved."""
    closest, table = run.closest_approaches(), run.closest_approaches().to_table()
    found: Facts = {f"closest {name}": getattr(closest, name).value for name in ("distance", "time", "speed")}
    found |= {"closest partner": closest.partner, "reach": closest.reach.value, "left out": closest.left_out}
    found |= {f"passage {name}": np.asarray(table[name]) for name in ("distance", "time", "speed", "error")}
    found["passages"] = " ".join(f"{row['body']}~{row['other']}" for row in table)
    found["unresolved"] = " ".join(f"{one.body}~{one.other}" for one in run.unresolved())
    return found


def happenings(run: Any) -> Facts:
    """Return all that happened in a run: events, retired particles, excursions from a map, and closest approaches."""
    found = tabled("events", run.events.to_table()) | tabled("retired", run.retired.to_table())
    found |= tabled("excursions", run.excursions.to_table()) | stopped(run)
    try:
        return found | approaches(run)
    except orbits.errors.InputError:  # of bodies that merged, or were changed
        return {**found, "closest": "refused"}


def end(run: Any) -> Facts:
    """Return all that happened in a run, and its last state, which do not depend on the samples."""
    last = {} if run.stopped else {f"last {name}": getattr(run, name).value[-1:] for name in "tqv"}
    return last | happenings(run)


def turning(run: Any) -> Facts:
    """Return attitudes and spins at the samples, of the bodies that have them."""
    found: Facts = {}
    for name in run.names:
        for quantity in (run.rotation.attitude, run.rotation.spin):
            with suppress(orbits.errors.InputError):
                found[f"{quantity.__name__} of {name}"] = np.asarray(getattr(value := quantity(name), "value", value))
    return found


def tabled(name: str, table: Any) -> Facts:
    """Return the columns of a table: numbers as arrays, all else as words."""
    found: Facts = {f"{name}": len(table)}
    for column in table.colnames:
        values = np.ma.filled(np.ma.asarray(getattr(table[column], "value", table[column])))
        is_number = np.issubdtype(values.dtype, np.number)
        found[f"{name} {column}"] = values.astype(float) if is_number else " ".join(map(str, values))
    return found
