"""Attributes of classes that have moved or gone, for one release: where each is now.

An attribute that is asked for and not there is looked up here, and the error says the new one.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

ROTATION = (
    "attitude",
    "angular_velocity",
    "euler_angles",
    "obliquity",
    "libration_angle",
    "spin",
    "spin_angular_momentum",
)
"""What runs say of the rotation of bodies."""

NOW: Mapping[str, Mapping[str, str]] = {
    "System": {
        "from_states": "System(names, gm, q, v, ...)",
        "from_mpcorb": "System.from_catalogue(orbits.read_mpcorb(...))",
        "from_sbdb": "System.from_catalogue(orbits.read_sbdb(...))",
    },
    "Trajectory": {
        **{name: f"run.rotation.{name}" for name in ROTATION},
        "rotation_rate": "run.rotation.rate",
        "plot_rotation": 'run.plot("rotation", body=...)',
        "sample": "run[k], a System, or run.q[k] and run.v[k]",
        "reached": "run.span[1]",
        "earliest": "min(run.span)",
        "last_time": "run.times[-1]",
        "has_stopped": "run.stopped is not None",
    },
}
"""The new names, by the class that had the old ones."""

INTERNAL: Mapping[str, Mapping[str, str]] = {
    "Trajectory": {
        "record": "run.closest_approaches() and run.unresolved()",
        "passages": "run.closest_approaches() and run.unresolved()",
        "kept": "run.at(times), which reads the steps of a run with dense=True",
        "accounts": "run.work(), and run.rotation for attitudes and spins",
        "begun": "run.at(times), or orbits.propagate(run.system, ...) for another run from the same start",
        "before": "run.at(times), which answers from the start of the run",
        "blocks": "run[10:20], or run.q[10:20] and run.v[10:20]",
        "of_archive": "orbits.Trajectory.open(path)",
        "system_of": "run[k] or run.at(time)",
        "marched_again_by": "orbits.Trajectory.open(path) or orbits.propagate(...), whose runs can be marched again",
    },
}
"""What to use instead of names that are internal now, by their owner."""


def moved(owner: str, name: str) -> str | None:
    """Return where a former name is now, or what to use instead, as the end of a sentence; None for a name that there
    never was.

    owner : the name of a class
    """
    if (now := NOW.get(owner, {}).get(name)) is not None:
        return f": it is {now} now."
    if (instead := INTERNAL.get(owner, {}).get(name)) is not None:
        return f", which is internal now: use {instead}."
    return None


class _Names(type):
    """Answers for the class itself."""

    if not TYPE_CHECKING:

        def __getattr__(cls, name: str) -> None:
            where = moved(cls.__name__, name) or "."
            raise AttributeError(f"the class {cls.__name__} has no attribute {name!r}{where}")


class Renamed(metaclass=_Names):
    """A class some of whose attributes have moved: the error for one of them says the new name."""

    __slots__ = ()

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> None:
            cls = type(self).__name__
            raise AttributeError(f"this {cls} has no attribute {name!r}{moved(cls, name) or '.'}")
