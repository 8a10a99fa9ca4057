"""Events: what is sought in a run, on the motion itself, and what happens then.

    orbits.propagate(system, ..., events=[orbits.events.CloseApproach("Apophis", "Earth")])

`CloserThan`, `FartherThan`, `EnergyErrorAbove` and `WallTimeOver` end a run, as its `stop`.
"""

from __future__ import annotations

from orbits.propagation.collisions.merge_and_bounce import Bounce, Merge
from orbits.propagation.control.stop_conditions import CloserThan, EnergyErrorAbove, FartherThan, WallTimeOver
from orbits.propagation.events.base import Action, Happening
from orbits.propagation.events.kinds.collision import Collision
from orbits.propagation.events.kinds.from_observer import Conjunction, Occultation, Opposition, Transit
from orbits.propagation.events.kinds.of_pairs import Apocentre, CloseApproach, Pericentre
from orbits.propagation.events.kinds.orbital import Ejection, ElementCrossing
from orbits.propagation.events.kinds.own import Event
from orbits.propagation.events.kinds.planes import NodeCrossing, PlaneCrossing

__all__ = [
    "Action",
    "Apocentre",
    "Bounce",
    "CloseApproach",
    "CloserThan",
    "Collision",
    "Conjunction",
    "Ejection",
    "ElementCrossing",
    "EnergyErrorAbove",
    "Event",
    "FartherThan",
    "Happening",
    "Merge",
    "NodeCrossing",
    "Occultation",
    "Opposition",
    "Pericentre",
    "PlaneCrossing",
    "Transit",
    "WallTimeOver",
]


def __dir__() -> list[str]:
    """Return the public names."""
    return __all__
