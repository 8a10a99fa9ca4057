"""Which massless bodies events are about."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from orbits.errors import InputError
from orbits.propagation.events.base import NOBODY, Bound, Sought

if TYPE_CHECKING:
    from orbits.system import System

MOST_PARTICLES = 64
"""The most massless bodies whose events are sought: each is marched again with the bodies that have mass."""


def by_particles(
    numbers: Iterable[int], bounds: Sequence[Bound], of: Sequence[Sought], system: System, act: bool
) -> dict[tuple[int, ...], list[int]]:
    """Return the numbers of the functions of the same massless bodies, by the numbers of these bodies.

    numbers : of the functions

    Raises InputError for what cannot be sought of massless bodies.
    """
    groups: dict[tuple[int, ...], list[int]] = {}
    for number in numbers:
        bound, event = bounds[number], of[number]
        needed = bound.bodies()
        concerned = np.unique(np.concatenate([bound.pairs.ravel(), [] if needed is None else needed]).astype(int))
        particles = tuple(int(k) for k in concerned if k != NOBODY and not system.massive[k])
        groups.setdefault(particles, []).append(number)
        if not particles:
            continue
        what, name = type(event).__name__, system.names[particles[0]]
        if not isinstance(event.then, str):
            raise InputError(
                f"{what}: {name} is a massless particle, on which nothing acts in a run: its events are recorded, or "
                "end the run (then='stop'). Give it a small mass, such as gm=1e-20, or leave out then=..."
            )
        if act:
            raise InputError(
                f"{what}: {name} is a massless particle, whose events are not sought in a run whose bodies may be "
                "changed by others (then=...) or collide. Give it a small mass, such as gm=1e-20, or seek its events "
                "in a run of their own."
            )
    if len(groups) - (() in groups) > MOST_PARTICLES:
        raise InputError(
            f"events of {len(groups) - (() in groups)} massless bodies; at most {MOST_PARTICLES} are followed one by "
            "one between the samples. Seek those of fewer, or in several runs."
        )
    return groups
