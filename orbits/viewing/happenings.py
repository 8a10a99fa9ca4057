"""What happens along a run, for its time line: events that were sought, collisions, retired particles."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from orbits.plotting import words
from orbits.viewing.layout import Layout

if TYPE_CHECKING:
    from orbits.trajectory import Trajectory

MOST = 2000
"""The most events of a page, the first ones of the run; the page says how many there are."""


def happenings(run: Trajectory, layout: Layout) -> dict[str, Any]:
    """Return the events of a run in its order, backward runs from the latest time on, at most `MOST`, and how many
    there are.

    Each has its time, its kind, its text, and the places of its bodies among those of the page, for picking them.
    """
    place = {run.names[i]: k for k, i in enumerate((*layout.bodies, *layout.points))}
    listed = []
    for event in run.events.to_records():
        bodies = [name for name in (event["body"], event["other"]) if name is not None]
        said = " and ".join(words.shortened(name) for name in bodies)
        text = f"{event['kind']} of {said}" if said else str(event["kind"])
        if event["distance"] is not None:
            text += f", {event['distance']:.4g} {run.system.units.length}".replace("AU", "au").rstrip()
        kind = "collision" if "collision" in str(event["kind"]) or "merge" in str(event["kind"]) else "event"
        listed.append((event["time"], kind, text, [place[name] for name in bodies if name in place]))
    for gone in run.retired.to_records():
        known = [place[gone["body"]]] if gone["body"] in place else []
        listed.append((gone["time"], "retired", f"{words.shortened(gone['body'])} retired: {gone['reason']}", known))
    listed.sort(key=lambda row: abs(row[0]))
    kept = [{"time": t, "kind": kind, "text": text, "bodies": bodies} for t, kind, text, bodies in listed[:MOST]]
    return {"list": kept, "count": len(listed)}
