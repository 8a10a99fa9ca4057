"""NAIF's numbers of the bodies of a run."""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from astropy import units as u

from orbits import ephemeris
from orbits.body_names import few, index_of
from orbits.catalogue.bundled import LARGEST_ASTEROID
from orbits.checks import is_whole
from orbits.errors import InputError, UnknownNameError, shown
from orbits.units import GM_SUN

if TYPE_CHECKING:
    from orbits.protocols import State

PLANETS = dict(zip(ephemeris.BODIES, (10, 1, 2, 3, 399, 301, 4, 5, 6, 7, 8, 9), strict=True))
"""Numbers of the Sun, the Earth, the Moon, and of the barycentres of the other planets with their moons."""

WITHOUT_MOONS = {1: 199, 2: 299}
"""Mercury and Venus coincide with their barycentres; ephemerides have both numbers."""

ASTEROIDS = 2_000_000
MANY_ASTEROIDS = 20_000_000
"""Added to the number of an asteroid; the second one from number 1,000,000 on."""

SOLAR_SYSTEM_BARYCENTRE = 0


def checked_ids(names: Sequence[str], ids: Any) -> dict[str, int]:
    """Return the numbers that a caller gives, by the names of bodies as they are written; none for None.

    Raises InputError for anything but whole numbers by name, UnknownNameError for a name that no body has.
    """
    if ids is not None and not isinstance(ids, Mapping):
        raise InputError(f"ids is {shown(ids)}; expected numbers by name, such as {{'probe': -1001}}.")
    found: dict[str, int] = {}
    for given, number in (ids or {}).items():
        name = names[index_of(given, names)]
        if not is_whole(number) or not -(2**31) < number < 2**31 or number == 0:
            raise InputError(
                f"ids[{name!r}] is {shown(number)}; expected a whole number of 32 bits, such as -1001, and not 0, "
                "the Solar System barycentre."
            )
        found[name] = int(number)
    return found


def light_ones(system: State) -> set[str]:
    """Return the names of the bodies that have no more mass than an asteroid, unlike Jupiter's Europa."""
    gm = u.Quantity(system.values.gm, system.units.gm).to_value(u.au**3 / u.day**2)
    return {name for name, x in zip(system.names, gm, strict=True) if x <= LARGEST_ASTEROID * GM_SUN}


def numbers(names: Sequence[str], given: Mapping[str, int], light: Container[str]) -> dict[str, int]:
    """Return the number of each body: as given, or known for DE440's bodies and numbered asteroids of the catalogue;
    light : those that may be asteroids.

    Raises InputError, naming the bodies, if a body has no number or two have the same.
    """
    found: dict[str, int] = {}
    missing = []
    for name in names:
        number = known_number(name, given, light)
        if number is None:
            missing.append(name)
        elif number in found.values():
            other = next(body for body in found if found[body] == number)
            raise InputError(f"{other!r} and {name!r} both have the NAIF number {number}; give ids for one of them.")
        else:
            found[name] = number
    if missing:
        raise InputError(
            f"no NAIF number is known for {few(missing)}; expected a body of DE440 or a numbered asteroid of the "
            f"catalogue. Give numbers, ids={{{missing[0]!r}: -1001}}, or leave them out: bodies=[...]."
        )
    return found


def known_number(name: str, given: Mapping[str, int], light: Container[str]) -> int | None:
    """Return the number of a body as given, or as known by its name; None if it is not. light : those that may be
    asteroids.
    """
    if name in given:
        return given[name]
    if name in PLANETS:
        return PLANETS[name]
    if name not in light:
        return None
    try:
        number = int(ephemeris.asteroids(names=name).numbers[0])
    except UnknownNameError:
        return None
    if number == 0:
        return None
    return number + (ASTEROIDS if number < ASTEROIDS // 2 else MANY_ASTEROIDS)
