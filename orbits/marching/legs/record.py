"""What a leg has seen of passages: the closest approaches, and the passages that are listed."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from orbits.errors import IntegrationError
from orbits.integrators.forms import Array
from orbits.kernels.search.record import DISTANCE2, OTHER, PARTNER, STEP, TIME, WHEN
from orbits.marching.legs import within_step
from orbits.marching.watching.passage_list import UNKNOWN

if TYPE_CHECKING:
    from orbits.marching.legs.leg import Leg


class Record(NamedTuple):
    """The record of a leg: `closest` (4, 2, rows), or None if closest approaches were not looked for, and `listed`
    (n, columns), see `orbits.kernels.search.record`; the number of passages left out; the row, in the kernels' order,
    of the body that dominates the system, or -1; the distance from each massive body within which flybys are listed;
    and the reading of the clock.
    """

    closest: Array | None
    listed: Array
    left_out: int
    dominant: int
    reaches: Array
    end: float


def approaches(leg: Leg) -> Array:
    """Return the closest approaches so far, (4, 2, rows + padding), of a leg that looks for them; see
    `orbits.kernels.search.record`.
    """
    retired, state = leg.losses.retired, leg.stepper.state
    if len(leg.problem.particles):
        retired.begin()
        q = state["particle_q"].copy()
        q[:, : len(leg.problem.particles)][:, retired.gone()] = np.nan
        state = {**state, "particle_q": q}
    track = leg.stepper.loops.tracks[0]
    return leg.observers.approaches(state["approaches"], leg.step, leg.times.origin_now, track, state)


def seen_by(leg: Leg, *, noting_end: bool = True) -> Record:
    """Return the record of a leg up to where it is; noting_end : whether with the distances there."""
    closest = None
    if leg.problem.approaches:
        closest = approaches(leg) if noting_end else leg.stepper.state["approaches"].copy()
    listed, reaches = leg.listing.passages, leg.observers.listed_within[: len(leg.problem.bodies)].copy()
    return Record(closest, listed.passages, listed.left_out, leg.observers.dominant, reaches, leg.times.reading)


def record(leg: Leg, end: float) -> Record:
    """Return the record of a leg up to a time: it marches on to the last whole step before it, and where steps are
    chosen it ends there, and cannot go on; of constant steps, a partial step is added.
    """
    with suppress(IntegrationError):  # where the run itself failed
        if (end - leg.time) * leg.clock.direction > 0.0:  # it was stopped behind its last sample
            leg.advance_to(leg.clock.place(end))
            within_step.end_at(leg, end)  # nothing with constant steps
    known = seen_by(leg)
    if not 0.0 < leg.times.part_until(end) < 1.0:
        return known
    try:
        part = seen_by(within_step.ended_at(leg, end))
    except IntegrationError:  # where the run itself failed
        return known
    closest, more = known.closest, part.listed.copy()
    if closest is not None and part.closest is not None:
        later = part.closest
        later[TIME] = leg.times.reading_in_part(later[TIME], end)
        closest = np.where(later[DISTANCE2] < closest[DISTANCE2], later, closest)
    more[:, STEP] = leg.step
    more[:, WHEN] = leg.times.reading_in_part(more[:, WHEN], end)
    return known._replace(closest=closest, listed=np.concatenate([known.listed, more]))


def joined(mine: Record, other: Record, read: Callable[[Any], Any], particles: slice) -> Record:
    """Return two records of the same bodies as one, with all but the passages of the first.

    read : returns the reading of the first one's clock for that of the other's; particles : the rows of massless ones
    """
    listed, closest = other.listed.copy(), None
    listed[:, [STEP, WHEN]] = read(listed[:, [STEP, WHEN]])
    both = np.concatenate([mine.listed, listed])
    in_order = both[np.argsort(both[:, WHEN], kind="stable")]
    left_out = UNKNOWN if mine.left_out == UNKNOWN else mine.left_out + other.left_out
    if mine.closest is not None and other.closest is not None:
        own = other.closest.copy()
        own[TIME] = read(own[TIME])
        ranks = [_rank(known, mine.reaches, particles) for known in (mine.closest, own)]
        closest = np.where(ranks[1] < ranks[0], own, mine.closest)
    return mine._replace(closest=closest, listed=in_order, left_out=left_out)


def _rank(closest: Array, reaches: Array, particles: slice) -> Array:
    """Return by what approaches are compared: the squares of distances; of particles, by the other's reach."""
    rank = closest[DISTANCE2].copy()
    reach = np.append(reaches, 1.0)[closest[PARTNER, OTHER].astype(int)]
    with np.errstate(divide="ignore", invalid="ignore"):
        rank[OTHER, particles] /= reach[particles] ** 2
    return np.where(np.isfinite(closest[DISTANCE2]), rank, np.inf)
