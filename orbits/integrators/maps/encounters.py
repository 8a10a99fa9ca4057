"""What a map does in encounters that its steps cannot follow: one argument, for massless particles and for planets."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import wraps
from typing import Any, NamedTuple, TypeVar

from orbits.checks import is_one_of
from orbits.errors import InputError, shown

C = TypeVar("C", bound=type)

WARN, FOLLOW, RETIRE, REFUSE = "warn", "follow", "retire", "refuse"

OF_PARTICLES, OF_PLANETS = (WARN, FOLLOW, RETIRE), (WARN, FOLLOW, REFUSE)


class Encounters(NamedTuple):
    """What is done in encounters of massless particles with planets, and of planets with each other."""

    particles: str = WARN
    planets: str = WARN

    @property
    def follow_particles(self) -> bool:
        """Whether massless particles take steps of their own there."""
        return self.particles == FOLLOW

    @property
    def retire_particles(self) -> bool:
        """Whether massless particles are retired before them."""
        return self.particles == RETIRE

    @property
    def follow_planets(self) -> bool:
        """Whether all bodies take steps of another method there."""
        return self.planets == FOLLOW

    @property
    def refuse_planets(self) -> bool:
        """Whether they end a run."""
        return self.planets == REFUSE

    def __str__(self) -> str:
        """Return the text that `read` reads: "warn", "follow all", "retire", "retire particles, follow planets"."""
        asked = {kind: answer for kind, answer in self._asdict().items() if answer != WARN}
        if self.particles == self.planets:
            return f"{FOLLOW} all" if asked else WARN
        if list(asked.values()) in ([RETIRE], [REFUSE]):
            return next(iter(asked.values()))
        return ", ".join(f"{answer} {kind}" for kind, answer in asked.items())


WARNED = Encounters()
"""Of methods that do nothing besides a warning."""


def read(value: Any, particles: tuple[str, ...] = OF_PARTICLES, planets: tuple[str, ...] = OF_PLANETS) -> Encounters:
    """Return what a text asks for, of the answers that a method has.

    An answer is one word for all bodies that it is possible for ("follow", "retire", "refuse"), or is followed by
    "particles" or "planets"; two are separated by a comma. What is not named is warned of. Raises InputError.
    """
    able = {"particles": particles, "planets": planets}
    asked: dict[str, str] = {}
    for part in value.split(",") if isinstance(value, str) else [""]:
        answer, _, whom = " ".join(part.split()).partition(" ")
        named = able if whom in ("", "all") else {whom}
        kinds = [kind for kind in able if kind in named and answer in able[kind]]
        if not kinds or (whom and len(kinds) < len(named)) or not asked.keys().isdisjoint(kinds):
            raise InputError(f"encounters is {shown(value)}; expected {_expected(able)}")
        asked |= dict.fromkeys(kinds, answer)
    return Encounters(**asked)


def _expected(able: Mapping[str, tuple[str, ...]]) -> str:
    """Return what may be asked, in words."""
    of = {kind: [f"'{answer} {kind}'" for answer in answers if answer != WARN] for kind, answers in able.items()}
    choices = [f"'{WARN}'", f"'{FOLLOW}'"] if all(FOLLOW in answers for answers in able.values()) else [f"'{WARN}'"]
    both = f"{of['particles'][-1][1:-1]}, {of['planets'][0][1:-1]}"
    return f"{', '.join([*choices, *of['particles'], *of['planets']])}, or one for each, such as '{both}'"


def as_written_before(parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Return the parameters of a method in which two of them, of an archive made before there was one, are one."""
    given = dict(parameters)
    particles, planets = given.get("encounters", WARN), given.pop("planets", WARN)
    if is_one_of(particles, OF_PARTICLES) and is_one_of(planets, OF_PLANETS) and (particles, planets) != (WARN, WARN):
        given["encounters"] = str(Encounters(particles, planets))
    return given


def without_planets(cls: C) -> C:
    """Have a method say what became of its former parameter `planets`, for one release."""
    made: Callable[..., None] = cls.__init__  # type: ignore[misc]

    @wraps(made)
    def begin(self: Any, *args: Any, **kwargs: Any) -> None:
        if "planets" in kwargs:
            answer = kwargs["planets"]
            known = is_one_of(answer, (FOLLOW, REFUSE))
            instead = f"{answer} planets" if known else "follow planets"
            raise InputError(
                f"{cls.__name__} has no planets={shown(answer)} any more; what it does in encounters is one argument: "
                f'encounters="{instead}"'
            )
        made(self, *args, **kwargs)

    cls.__init__ = begin  # type: ignore[misc]
    return cls
