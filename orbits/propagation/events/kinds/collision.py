"""Collisions: two bodies come closer than the sum of their radii. They are sought by the march itself."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from orbits.body_names import index_of
from orbits.errors import InputError, shown
from orbits.propagation.collisions.merge_and_bounce import Bounce, Merge
from orbits.propagation.events.base import RECORD, STOP, Bound, Sought, Touching

if TYPE_CHECKING:
    from orbits.system import System


@dataclass(frozen=True)
class Collision(Sought):
    """Two bodies come closer than the sum of their radii.

        orbits.propagate(system, duration="100 yr", events=orbits.events.Collision(then=orbits.events.Merge()))

    body, other : names; None means any body. One of the two must have mass: massless bodies hit massive ones only
    then : "record" (the bodies pass through each other, as points do), "stop", `Merge()` or `Bounce(restitution=...)`

    The radii are those of the system: `System(..., radii=...)`, `system.add(..., radius=...)`. Of several collisions
    that concern a pair, the first one given counts. The relative motion of two bodies may have one closest approach
    within a step: then no collision is missed, and its time is as exact as the orbit.
    """

    body: str | None = None
    other: str | None = None

    named = "body", "other"
    collides: ClassVar[bool] = True

    def __post_init__(self) -> None:
        super().__post_init__()
        if not (self.then in (RECORD, STOP) or isinstance(self.then, Merge | Bounce)):
            given = shown(getattr(self.then, "function", self.then))
            raise InputError(
                f"Collision(then={given}); expected 'record', 'stop', orbits.events.Merge() or "
                "orbits.events.Bounce(...). A function of your own acts at other events, such as "
                "orbits.events.CloserThan(..., then=function)."
            )

    def bound(self, system: System) -> list[Bound]:
        """Return what the march seeks: it has no function."""
        rows = [None if name is None else index_of(name, system.names) for name in (self.body, self.other)]
        named = [row for row in rows if row is not None]
        if len(named) == 2:
            if named[0] == named[1]:
                raise InputError(f"Collision: {self.body!r} twice; expected two bodies.")
            if not system.massive[named].any():
                raise InputError(
                    f"Collision: {self.body} and {self.other} are both massless, and do not feel each other; expected "
                    "a body with mass among the two."
                )
        word = "merger" if isinstance(self.then, Merge) else "bounce" if isinstance(self.then, Bounce) else "collision"
        return [Touching(word, rows[0], rows[1], self.then)]
