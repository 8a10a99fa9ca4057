"""The events of the bodies that are left after collisions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from copy import copy
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbits.errors import InputError, with_unit
from orbits.propagation.events.base import Array, Bound, Sought, Whole
from orbits.trajectory.changes import Bodies

if TYPE_CHECKING:
    from orbits.system import System

State = tuple[Array, Array]


class Left(NamedTuple):
    """The bodies after a collision: with their masses and radii, those with mass that are gone (n,), and the time."""

    bodies: Bodies
    gone: NDArray[np.bool_]
    time: float


def bounds_left(
    system: System, events: Sequence[Sought], bounds: Sequence[Bound], left: Left
) -> Iterator[tuple[int, Bound, str | None]]:
    """Yield the functions of all events for the bodies that are left, with their numbers, and what is to be said of
    one that is over, or None. Those of bodies that are gone have no columns.

    system : at the start; bounds : before the collision

    A function of the user depends on a body that is gone if it is not finite with NaN for that body, in the state of
    the start: a run that is resumed comes to the same answer.
    """
    gm = np.where(left.gone, 0.0, left.bodies.gm)
    radii = None if system.radii is None else left.bodies.radii
    now = system.replaced(gm=gm, radii=radii, terms=(), forces=())  # terms may be of bodies that are gone
    number = 0
    for event in events:
        size = len(event.bound(system)) if event.stored and not event.collides else 1
        own = list(bounds[number : number + size])
        if event.stored and not event.collides:
            try:
                own = event.bound(now)
            except InputError:  # as the ejection of the last body
                own = [_over(bound) for bound in own]
        for bound in own:
            over = None
            if not event.collides:
                bound = _without(bound, left.gone)
                if not event.stored and len(bound.pairs) and not _is_finite(bound, system, left):
                    names = " and ".join(
                        name for name, gone in zip(system.names, left.gone, strict=True) if gone
                    )
                    when = with_unit(f"{left.time:.10g}", system.units.time)
                    over = (
                        f"is not sought after t = {when}, as its function is not finite without {names}. Positions and "
                        "velocities of bodies that are gone are NaN; np.nanmin, np.nansum and the like pass over them."
                    )
                    bound = _over(bound)
            yield number, bound, over
            number += 1


def sides_of(bound: Bound, former: Bound, t: Array, before: State, after: State) -> tuple[Array, Array, Whole]:
    """Return a function just before and just after a collision at a time (1,), and the columns of these, (m,) each.

    former : the function before the collision, which may have more columns
    """
    places = {tuple(sorted(pair)): k for k, pair in enumerate(former.pairs.tolist())}
    pairs = [tuple(sorted(pair)) for pair in bound.pairs.tolist()]
    columns = np.array([k for k, pair in enumerate(pairs) if pair in places], dtype=np.int64)
    own = np.array([places[pairs[k]] for k in columns], dtype=np.int64)
    (q, v), (q1, v1) = (before[0][None], before[1][None]), (after[0][None], after[1][None])
    return former.values(t, q, v, own)[0], bound.values(t, q1, v1, columns)[0], columns


def _without(bound: Bound, gone: NDArray[np.bool_]) -> Bound:
    """Return a function without the columns of bodies that are gone."""
    needed = bound.bodies()
    if needed is not None and gone[np.setdiff1d(needed, bound.pairs)].any():  # of all columns, such as an observer
        return _over(bound)
    concerned = np.asarray(np.append(gone, False)[bound.pairs].any(axis=1))  # `NOBODY` is the last place
    return _of_columns(bound, ~concerned) if concerned.any() else bound


def _over(bound: Bound) -> Bound:
    """Return a function without columns."""
    return _of_columns(bound, np.zeros(len(bound.pairs), dtype=bool))


def _of_columns(bound: Bound, which: NDArray[np.bool_]) -> Bound:
    some = copy(bound)
    some.pairs = bound.pairs[which]
    return some


def _is_finite(bound: Bound, system: System, left: Left) -> bool:
    q, v = (np.where(left.gone[:, None], np.nan, x)[None] for x in (system.values.q, system.values.v))
    found = bound.values(np.array([left.time]), q, v, np.arange(len(bound.pairs)))
    return bool(np.isfinite(found).all())
