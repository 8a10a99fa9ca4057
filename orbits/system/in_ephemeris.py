"""Systems whose massive bodies are read from an ephemeris, for small bodies among them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from astropy import units as u

from orbits import ephemeris
from orbits.body_names import few
from orbits.checks import checked_flag
from orbits.errors import InputError, shown
from orbits.lagrangians.terms.in_ephemeris import ASTEROIDS_16, InEphemeris
from orbits.lagrangians.terms.post_newtonian import PostNewtonian
from orbits.spk.bodies import ASTEROIDS, PLANETS
from orbits.system.solar.building import APART, figure_of_earth, figure_of_sun, largest_asteroids
from orbits.system.solar.small_bodies import small_bodies
from orbits.system.solar.small_body_states import states
from orbits.units import as_epoch

if TYPE_CHECKING:
    from orbits.lagrangians.terms.base import Term
    from orbits.system.system import System

EARTH_POLE = (0.0, 90.0)
"""The pole of the Earth, right ascension and declination in degrees: that of J2000, as in JPL's integrations of small
bodies, from which the orbits of catalogues come."""

ALL = 343
"""The number of asteroids in DE440."""


def arguments(
    kernel: Any, epoch: Any, asteroids: Any, bodies: Any, without: Any, relativity: Any, figures: Any
) -> dict[str, Any]:
    """Return the arguments of `System` for a system in an ephemeris; see `System.in_ephemeris`."""
    if not isinstance(kernel, str):
        raise InputError(f"kernel is {shown(kernel)}; expected 'de440', or the path of an SPK file.")
    when = as_epoch(epoch)
    sixteen = largest_asteroids()
    second = _second(asteroids, len(sixteen))
    if isinstance(bodies, list | tuple) and not bodies:
        raise InputError(f"bodies is empty; expected the Sun and others of {', '.join(APART)}, or None for all.")
    names = _chosen(APART if bodies is None else bodies, APART, "bodies")
    if "Sun" not in names:
        raise InputError(f"bodies are {few(names)}; expected the Sun among them, which all others are attracted by.")
    gone = _chosen(without, tuple(sixteen), "without")
    if gone and second is None:
        raise InputError(f"without names {few(gone)}, but there are no asteroids to leave out: asteroids=16.")
    minor = [name for name in sixteen if second is not None and name not in gone]
    targets = [PLANETS[name] for name in names] + [ASTEROIDS + sixteen[name][0] for name in minor]
    gm = np.concatenate([ephemeris.gm(names), [sixteen[name][1] for name in minor]])
    whole = (*names, *minor)
    jd1, jd2 = float(when.jd1), float(when.jd2)
    found = InEphemeris("Sun", kernel, second, whole, tuple(targets), jd1, jd2)
    found = InEphemeris("Sun", kernel, second, whole, tuple(targets), jd1, jd2, found.series().digest)
    q, v = found.states(np.zeros(1))
    terms: list[Term] = [found]
    if checked_flag(relativity, "relativity"):
        terms.append(PostNewtonian(sources=names))
    if checked_flag(figures, "figures"):
        terms += [figure_of_sun()] + ([figure_of_earth(EARTH_POLE * u.deg)] if "Earth" in names else [])
    return {"names": whole, "gm": gm, "q": q[0], "v": v[0], "epoch": when, "terms": terms}


def _second(asteroids: Any, known: int) -> str | None:
    """Return the kernel of the asteroids, None for none; known : how many there are."""
    if isinstance(asteroids, str) and not asteroids.strip().isdigit():
        return asteroids
    if isinstance(asteroids, bool) or not isinstance(asteroids, int) or asteroids not in (0, known, ALL):
        raise InputError(
            f"asteroids is {shown(asteroids)}; expected 0, 16 (those of JPL's {ASTEROIDS_16}), {ALL} (these, and the "
            "others of DE440, which are integrated along), or the path of an SPK file with these 16. Add others with a "
            "mass, system.add(name, gm=...), and they are integrated along, too."
        )
    return ASTEROIDS_16 if asteroids else None


def with_the_others(system: System) -> System:
    """Return a system in an ephemeris with those asteroids of DE440 that are not read, to be integrated."""
    known, sixteen, epoch = small_bodies(), largest_asteroids(), system.epoch
    assert epoch is not None
    named = enumerate(zip(known.keys, known.names, strict=True))
    rows = [k for k, (key, name) in named if key < "MA8" and name not in sixteen]
    q, v = states(type(system), float(epoch.jd1), float(epoch.jd2))
    length, speed = u.au, u.au / u.day
    gm = known.gm[rows] * (length**3 / u.day**2)
    return system.add([known.names[k] for k in rows], primary="Sun", gm=gm, q=q[rows] * length, v=v[rows] * speed)


def _chosen(given: Any, known: Sequence[str], what: str) -> tuple[str, ...]:
    """Return names in the order of those that are known."""
    names = [given] if isinstance(given, str) else given
    if not isinstance(names, list | tuple) or not all(isinstance(name, str) for name in names):
        raise InputError(f"{what} is {shown(given)}; expected names, such as {[*known[:2]]}.")
    asked = {name.casefold() for name in names}
    unknown = [name for name in names if name.casefold() not in {each.casefold() for each in known}]
    if unknown:
        raise InputError(f"{what} has {few(unknown)}; expected some of {', '.join(known)}.")
    return tuple(name for name in known if name.casefold() in asked)
