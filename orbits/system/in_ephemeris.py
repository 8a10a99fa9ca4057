"""Systems whose massive bodies are read from an ephemeris, for small bodies among them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from astropy import units as u

from orbits import ephemeris
from orbits.body_names import few
from orbits.checks import checked_flag
from orbits.errors import InputError, shown
from orbits.lagrangians.terms.in_ephemeris import ASTEROIDS_16, InEphemeris
from orbits.lagrangians.terms.post_newtonian import PostNewtonian
from orbits.lagrangians.terms.zonal_harmonics import ZonalHarmonics
from orbits.spk.bodies import ASTEROIDS, PLANETS
from orbits.units import as_epoch

if TYPE_CHECKING:
    from orbits.lagrangians.terms.base import Term

BODIES = tuple(name for name in ephemeris.BODIES if name != "Earth-Moon barycenter")
"""The bodies that are read by default: with the Earth and the Moon apart, as small bodies pass them."""

SIXTEEN = {
    "Ceres": (1, 1.396451812308107e-13),
    "Pallas": (2, 3.04711463300432e-14),
    "Juno": (3, 4.282343967799501e-15),
    "Vesta": (4, 3.8548000225257904e-14),
    "Iris": (7, 2.5416014973471498e-15),
    "Hygiea": (10, 1.254253076164081e-14),
    "Eunomia": (15, 4.5107799051436795e-15),
    "Psyche": (16, 3.5445002842488978e-15),
    "Euphrosyne": (31, 2.4067012218937576e-15),
    "Europa": (52, 5.982431526486984e-15),
    "Cybele": (65, 2.0917175955133682e-15),
    "Sylvia": (87, 4.834560654610552e-15),
    "Thisbe": (88, 2.6529436610356353e-15),
    "Camilla": (107, 3.219139207587859e-15),
    "Davida": (511, 8.683625349228654e-15),
    "Interamnia": (704, 6.311034342087889e-15),
}
"""The asteroids of JPL's sb441-n16: number, and GM in au^3/d^2 from the comments of DE440."""


class Figure(NamedTuple):
    """The zonal harmonics of a body in DE440, its radius in km, and its pole, (right ascension, declination) in
    degrees.
    """

    J2: float
    J3: float
    J4: float
    radius: float
    pole: tuple[float, float]


FIGURES = {
    "Sun": Figure(2.1961391516529825e-7, 0.0, 0.0, 696000.0, (286.13, 63.87)),
    "Earth": Figure(1.08262539e-3, -2.53241e-6, -1.619898e-6, 6378.1366, (0.0, 90.0)),
}
"""The pole of the Earth is that of J2000, as in JPL's integrations of small bodies, from which the orbits of catalogues
come. Source: the comments of DE440; Park, Folkner, Williams & Boggs (2021), AJ 161, 105."""


def arguments(
    kernel: Any, epoch: Any, asteroids: Any, bodies: Any, without: Any, relativity: Any, figures: Any
) -> dict[str, Any]:
    """Return the arguments of `System` for a system in an ephemeris; see `System.in_ephemeris`."""
    if not isinstance(kernel, str):
        raise InputError(f"kernel is {shown(kernel)}; expected 'de440', or the path of an SPK file.")
    when = as_epoch(epoch)
    second = _second(asteroids)
    if isinstance(bodies, list | tuple) and not bodies:
        raise InputError(f"bodies is empty; expected the Sun and others of {', '.join(BODIES)}, or None for all.")
    names = _chosen(BODIES if bodies is None else bodies, BODIES, "bodies")
    if "Sun" not in names:
        raise InputError(f"bodies are {few(names)}; expected the Sun among them, which all others are attracted by.")
    gone = _chosen(without, tuple(SIXTEEN), "without")
    if gone and second is None:
        raise InputError(f"without names {few(gone)}, but there are no asteroids to leave out: asteroids=16.")
    minor = [name for name in SIXTEEN if second is not None and name not in gone]
    targets = [PLANETS[name] for name in names] + [ASTEROIDS + SIXTEEN[name][0] for name in minor]
    gm = np.concatenate([ephemeris.gm(names), [SIXTEEN[name][1] for name in minor]])
    whole = (*names, *minor)
    jd1, jd2 = float(when.jd1), float(when.jd2)
    found = InEphemeris("Sun", kernel, second, whole, tuple(targets), jd1, jd2)
    found = InEphemeris("Sun", kernel, second, whole, tuple(targets), jd1, jd2, found.series().digest)
    q, v = found.states(np.zeros(1))
    terms: list[Term] = [found]
    if checked_flag(relativity, "relativity"):
        terms.append(PostNewtonian(sources=names))
    if checked_flag(figures, "figures"):
        terms += [_zonal(name, figure) for name, figure in FIGURES.items() if name in names]
    return {"names": whole, "gm": gm, "q": q[0], "v": v[0], "epoch": when, "terms": terms}


def _second(asteroids: Any) -> str | None:
    """Return the kernel of the asteroids, None for none."""
    if isinstance(asteroids, str) and not asteroids.strip().isdigit():
        return asteroids
    if isinstance(asteroids, bool) or not isinstance(asteroids, int) or asteroids not in (0, len(SIXTEEN)):
        raise InputError(
            f"asteroids is {shown(asteroids)}; expected 0, 16 (those of JPL's {ASTEROIDS_16}), or the path of an SPK "
            "file with these 16. There is no file of more to read: add others with a mass, system.add(name, gm=...), "
            "and they are integrated along."
        )
    return ASTEROIDS_16 if asteroids else None


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


def _zonal(name: str, figure: Figure) -> ZonalHarmonics:
    """Return the zonal harmonics of a body."""
    radius, pole = figure.radius * u.km, figure.pole * u.deg
    return ZonalHarmonics(name, J2=figure.J2, J3=figure.J3, J4=figure.J4, radius=radius, pole=pole)
