"""Which elements may be combined: one each for the size, the shape, the orientation and the position on the orbit."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import NamedTuple

from orbits.errors import InputError

SIZES = ("a", "P", "n", "q")
PLACES = ("M", "f", "E", "u", "l", "theta", "T")
PAL = ("h", "k", "ix", "iy")
NOT_WITH_PAL = ("e", "inc", "Omega", "omega", "pomega", *(place for place in PLACES if place != "l"))
# Two sizes instead of one and e. q and n would not determine on which side of the parabola the orbit is.
PAIRS = (("a", "q"), ("P", "q"))


class Naming(NamedTuple):
    """How an orbit is given: the keys of its size, in the order of SIZES, and of its position; whether by Pal's."""

    sizes: tuple[str, ...]
    place: str
    pal: bool


def naming(given: Collection[str], names: Sequence[str] | None) -> Naming:
    """Return how elements with these keys determine an orbit.

    Raises InputError, naming the combination and the remedy, for too many or too few elements.
    """
    who = f"{names[0]}: " if names is not None and len(names) == 1 else ""
    sizes, places, pal, others = (
        tuple(key for key in keys if key in given) for keys in (SIZES, PLACES, PAL, NOT_WITH_PAL)
    )
    if pal and others:
        raise InputError(
            f"{who}{_listed(pal)} (Pal's elements) and {_listed(others)} are given together; expected either kind. "
            "With h, k, ix, iy the position on the orbit is given by l"
        )
    for what, keys in (("the direction of pericentre", ("omega", "pomega")), ("the position on the orbit", PLACES)):
        found = [key for key in keys if key in given]
        if len(found) > 1:
            raise InputError(
                f"{who}{what} is given by {_listed(found)}; expected at most one of {', '.join(keys)}. Leave out all "
                "but one"
            )
    if len(sizes) != 1 and sizes not in PAIRS:
        wrong = f"{who}the size of the orbit is given by {_listed(sizes)}; expected exactly one of {', '.join(SIZES)}"
        if sizes == ("n", "q"):
            raise InputError(f"{wrong}. n and q fit an ellipse and a hyperbola: give one of them with e, or a and q")
        raise InputError(f"{wrong}, or q with a or P instead of e")
    if sizes in PAIRS and ("e" in given or pal):
        said = "e" if "e" in given else _listed(pal)
        raise InputError(
            f"{who}{_listed(sizes)} and {said} are given together, but {_listed(sizes)} already determine the "
            "eccentricity, 1 - q/a. Leave out one of the three"
        )
    return Naming(sizes, places[0] if places else "M", bool(pal))


def _listed(keys: Sequence[str]) -> str:
    if not keys:
        return "nothing"
    return keys[0] if len(keys) == 1 else f"{', '.join(keys[:-1])} and {keys[-1]}"
