"""The next steps of a march of the same bodies: how they are taken whatever is met in them, and what lies in them."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from orbits.marching.legs.excursions.planet_excursions import Legs

T = TypeVar("T")


def step_back(march: Legs) -> None:
    """Return to the state before the last step of the last block, in which a pair may come to its bound."""
    march.last.bounds.beware()
    march.go_back(march.last.loop.taken - 1)


def pass_by(march: Legs) -> None:
    """Let a march take its next step whatever pairs come to their bounds in it."""
    march.leg.bounds.passes = True


def take_step(march: Legs) -> bool:
    """Take the next step, whatever pairs come to their bounds in it; return whether there is one."""
    begun = march.time
    for _ in range(4):  # all bodies may enter a map first, find that they cannot take a step of it, and leave it
        pass_by(march)
        march.approach(march.leg.times.next_place())
        if march.time != begun:
            return True
    return False


def in_next_steps(march: Legs, time: float, read: Callable[[], T | None]) -> T | None:
    """Return what a function first returns after one of the next steps, up to that which leads to a time or beyond;
    None if it returns nothing else. The march does not change. Raises what `approach` raises.
    """
    loop, kept = march.home.loop, march.checkpoint()
    listeners, loop.listeners = loop.listeners, []
    try:
        found = None
        while found is None and (time - march.time) * march.clock.direction > 0.0 and take_step(march):
            found = read()
        return found
    finally:
        march.restore(kept)
        loop.listeners, march.last.bounds.met = listeners, None
