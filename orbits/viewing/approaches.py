"""The closest approaches of the bodies of a run, for the panel of a body that is picked."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from orbits.errors import OrbitsError
from orbits.viewing.layout import Layout

if TYPE_CHECKING:
    from orbits.trajectory import Trajectory

MOST_EACH, MOST = 5, 4000
"""The most approaches of one body, the closest first, and of all."""

MOST_MASSIVE = 100
"""The most massive bodies that are marched again up to their approaches."""

AS_RECORDED = "of {:,} massive bodies: as recorded on the way, to about 1e-3 of the distance"


def approaches_of(run: Trajectory, layout: Layout) -> dict[str, Any]:
    """Return {"list": rows (body, other, time, distance, speed), "why": "", "said": ""}; the bodies by their places on
    the page.

    A run that has no record of its passages has an empty list, and says why. Many massive bodies would take as long to
    be marched again as the run took: their approaches are as recorded, and `said` says so.
    """
    if run.changes is not None and len(run.legs) > 1:
        return {"list": [], "why": "not sought in runs whose bodies merge, bounce or are changed; see the time line"}
    try:
        found, massive = run.closest_approaches(), int(run.system.massive.sum())
        many = massive > MOST_MASSIVE
        passages = found.as_recorded() if many else iter(found)
    except OrbitsError as error:
        return {"list": [], "why": str(error)}
    place = {run.names[i]: k for k, i in enumerate((*layout.bodies, *layout.points))}
    counts: dict[str, int] = {}
    rows: list[list[Any]] = []
    for one in passages:
        pair = [name for name in (one.body, one.other) if name in place]
        if len(pair) < 2 or all(counts.get(name, 0) >= MOST_EACH for name in pair):
            continue
        for name in pair:
            counts[name] = counts.get(name, 0) + 1
        rows.append([place[one.body], place[one.other], *(float(x.value) for x in (one.time, one.distance, one.speed))])
        if len(rows) == MOST:
            break
    return {"list": rows, "why": "", "said": AS_RECORDED.format(massive) if many else ""}
