"""What is kept of each member in the table of a campaign: survival, extremes of its orbit, its closest approach."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbits.errors import OrbitsError
from orbits.propagation.results.refinement import refine
from orbits.propagation.resuming.marching_again import seen_by
from orbits.system import System
from orbits.trajectory import Trajectory

Array = NDArray[Any]
Columns = dict[str, Array]

SURVIVED, STOPPED, LOST, FAILED = "survived", "stopped", "lost", "failed"
"""What became of a member: it was integrated to the end; an event or a condition stopped it, or its block; it was lost
on the way; it could not be integrated.
"""

AT_ONCE = 1 << 22
"""The most numbers of positions from which elements are computed at once."""

ELEMENTS = "a", "e", "inc"


def of_particles(run: Trajectory, first: int) -> Columns:
    """Return the columns of the massless bodies of a run from the body `first` on, (members,) each."""
    system, members = run.system, slice(first, None)
    count = len(system) - first
    out: Columns = {
        "state": np.full(count, SURVIVED if run.stopped is None else STOPPED, dtype=f"U{len(SURVIVED)}"),
        "end": np.full(count, run._reached),
        "reason": np.full(count, "" if run.stopped is None else run.stopped.reason),
    }
    lost = {one.name: one for one in run.retired}
    reasons = out["reason"].tolist()
    for k, name in enumerate(system.names[members]):
        if name in lost:
            out["state"][k], out["end"][k] = LOST, lost[name].time.value
            reasons[k] = lost[name].reason
    out["reason"] = np.array(reasons)
    out |= {name: found[members] for name, found in _extremes(run).items()}
    return out | {name: found[members] for name, found in _approaches(run).items()}


def of_systems(
    runs: list[Trajectory | OrbitsError | None], reasons: dict[int, str], bodies: Sequence[str] = ()
) -> Columns:
    """Return the columns of systems, (members,) or (members, bodies) each.

    runs : of the members that could be integrated, or the samples before a failure; None without any
    reasons : of the failures, by the number of the member
    bodies : the names of the first columns of bodies; a member's bodies of other names come after them
    """
    count = len(runs)
    rows: list[dict[str, Any]] = []
    for k, run in enumerate(runs):
        row: dict[str, Any] = {"state": SURVIVED, "end": np.nan, "reason": ""}
        if isinstance(run, Trajectory):
            row["end"] = run._reached
            if run.stopped is not None:
                row["state"], row["reason"] = STOPPED, run.stopped.reason
            row |= _by_name(_extremes(run), run.names, bodies) | _energy(run) | _closest_pair(run)
        if k in reasons:
            row["state"], row["reason"] = FAILED, reasons[k]
        rows.append(row)
    keys = dict.fromkeys(key for row in rows for key in row)
    out: Columns = {}
    for key in keys:
        known = next(row[key] for row in rows if key in row)
        if isinstance(known, str):
            out[key] = np.array([row.get(key, "") for row in rows])
            continue
        shape = max((np.shape(row[key]) for row in rows if key in row), key=lambda shape: (len(shape), shape))
        column = np.full((count, *shape), np.nan)
        for k, row in enumerate(rows):
            if key in row:
                value = np.asarray(row[key])
                place: tuple[Any, ...] = (k, *(slice(0, size) for size in value.shape))
                column[place] = value
        out[key] = column
    return out


def _by_name(columns: Columns, names: Sequence[str], bodies: Sequence[str]) -> Columns:
    """Return values of bodies, each in the column of its name or, if there is none, after these."""
    order = [*bodies, *(name for name in names if name not in bodies)]
    places = [order.index(name) for name in names]
    out = {key: np.full(max(places) + 1, np.nan) for key in columns}
    for key, values in columns.items():
        out[key][places] = values
    return out


def units_of_table(system: System) -> dict[str, str]:
    """Return the units of the table of a campaign: those of a system of its members."""
    return {"length": str(system.units.length), "time": str(system.units.time)}


def primary_of(system: System) -> str:
    """Return the body about which orbits are told: the most massive one."""
    return system.names[int(np.argmax(system.values.gm))]


def _extremes(run: Trajectory) -> Columns:
    """Return the least and the largest a, e and i of each body at the samples, (bodies,); NaN for the primary."""
    system = run.system
    place = int(np.argmax(system.values.gm))
    others = np.delete(np.arange(len(system)), place)
    out = {f"{name}_{end}": np.full(len(system), np.nan) for name in ELEMENTS for end in ("min", "max")}
    if not len(others):
        return out
    slab = max(1, AT_ONCE // (3 * len(system)))
    for k in range(0, len(run), slab):
        try:
            elements = run[k : k + slab].elements(primary=system.names[place])
        except OrbitsError:  # of bodies that merge there is no common mass
            return {}
        if len(elements.names) != len(others):
            return {}
        for name in ELEMENTS:
            values = np.asarray(getattr(elements, name).value)
            for end, extreme in (("min", np.fmin), ("max", np.fmax)):
                column = out[f"{name}_{end}"]
                column[others] = extreme(column[others], extreme.reduce(values, axis=0))
    return out


def _approaches(run: Trajectory) -> Columns:
    """Return the closest approach of each body to one other than the dominant one, (bodies,): distance, the other body,
    time; infinity if there was none, and for the dominant one; NaN if massive bodies change. Nothing if the run did not
    look for them.

    They are as they were recorded during the march, from the two-body orbit within the step: over a century of
    near-Earth asteroids by WisdomHolman and Gauss to 1e-6 of the distance, 2e-3 at worst. To march through them again,
    as `run.closest_approaches()` does, takes 0.02 to 0.08 s for each.
    """
    names, count = np.array(run.names), len(run.names)
    out: Columns = {
        "closest": np.full(count, np.inf),
        "closest_to": np.full(count, "", dtype=names.dtype),
        "closest_at": np.full(count, np.nan),
    }
    try:
        seen = seen_by(run)
    except OrbitsError:  # massive bodies merged, or there are samples only
        return out | {"closest": np.full(count, np.nan)}
    if not seen.looked:
        return {}
    numbers = {body: int(k) for body, k in enumerate(seen.closest[:, 1]) if k >= 0 and body != seen.dominant}
    refine(run, seen, [number for number in set(numbers.values()) if not np.isfinite(seen.passages[number].distance)])
    for body, number in numbers.items():
        passage = seen.passages[number]
        other = passage.other if passage.body == body else passage.body
        out["closest"][body], out["closest_to"][body] = passage.distance, names[other]
        out["closest_at"][body] = run.clock.time(passage.steps)
    return out


def _closest_pair(run: Trajectory) -> dict[str, Any]:
    found = _approaches(run)
    if not found:
        return {}
    k = int(np.argmin(found["closest"]))
    pair = "" if not np.isfinite(found["closest"][k]) else f"{run.names[k]}, {found['closest_to'][k]}"
    return {"closest": float(found["closest"][k]), "closest_to": pair, "closest_at": float(found["closest_at"][k])}


def _energy(run: Trajectory) -> dict[str, Any]:
    """Return the largest relative deviation of the energy at the samples, where the energy is conserved, with what
    mergers and bounces took.
    """
    if run.system.forces or not len(run):
        return {}
    try:
        energy = (run.energy() + run.energy_lost()).value
    except OrbitsError:
        return {}
    return {"energy_error": float(np.nanmax(np.abs(energy / energy[0] - 1.0))) if energy[0] else np.nan}
