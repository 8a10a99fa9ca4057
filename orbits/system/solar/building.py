"""What the models of the Solar System are made of: terms and forces with the constants of DE440, and small bodies."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from astropy import units as u
from numpy.typing import NDArray

from orbits import elements as kepler
from orbits import ephemeris
from orbits.system.solar import constants
from orbits.system.solar.constants import constant
from orbits.system.solar.small_bodies import small_bodies

if TYPE_CHECKING:
    from orbits.lagrangians.terms.base import Term
    from orbits.system.system import System

Floats = NDArray[np.float64]

APART = tuple(name for name in ephemeris.BODIES if name != "Earth-Moon barycenter")
"""Sun, planets, Moon and Pluto: the bodies of the models beyond Newton's, with Earth and Moon apart."""

RING_RADIUS = 44.0
"""Distance of DE440's ring from the Sun, au."""

LARGEST = 2e-15
"""GM in au^3/d^2 from which on an asteroid attracts the other small bodies: sixteen of them."""


def full(cls: type[System], day: float, small: tuple[Floats, Floats]) -> System:
    """Return the Solar System by the model "full" at a Julian date, from heliocentric states of the small bodies.

    cls : the class `System`
    """
    from orbits.system.new_bodies import from_ephemeris
    from orbits.units import SOLAR, as_epoch

    return with_all(cls(**from_ephemeris(as_epoch(day), APART), units=SOLAR), day, small)


def relativistic_terms(names: Sequence[str], day: float) -> list[Term]:
    """Return the terms of the model "relativistic" for some of its bodies at a Julian date."""
    from orbits.lagrangians.terms.degree_two import DegreeTwo
    from orbits.lagrangians.terms.post_newtonian import PostNewtonian

    terms: list[Term] = []
    sources = [name for name in names if name in APART]
    terms.append(PostNewtonian(sources=sources))
    if "Sun" in names:
        terms.append(figure_of_sun())
    if "Earth" in names:
        terms.append(figure_of_earth(constants.earth_pole(day)))
    if "Moon" in names:
        J2, C22, pole = constant("J2M"), constant("C22M"), constants.MOON_POLE * u.deg
        terms.append(
            DegreeTwo("Moon", J2=J2, C22=C22, radius=constant("AM") * u.km, pole=pole, attitude="Earth")
        )
    return terms


def figure_of_sun() -> Term:
    """Return the flattening of the Sun in DE440."""
    from orbits.lagrangians.terms.zonal_harmonics import ZonalHarmonics

    radius, pole = constant("ASUN") * u.km, constants.SUN_POLE * u.deg
    return ZonalHarmonics("Sun", J2=constant("J2SUN"), radius=radius, pole=pole)


def figure_of_earth(pole: Any) -> Term:
    """Return the zonal harmonics of the Earth in DE440; pole : as in `ZonalHarmonics`."""
    from orbits.lagrangians.terms.zonal_harmonics import ZonalHarmonics

    J2, J3, J4 = (constant(name) for name in ("J2E", "J3E", "J4E"))
    return ZonalHarmonics("Earth", J2=J2, J3=J3, J4=J4, radius=constant("RE") * u.km, pole=pole)


def largest_asteroids() -> dict[str, tuple[int, float]]:
    """Return number and GM in au^3/d^2 by name of the sixteen asteroids from `LARGEST` on, those of JPL's sb441-n16."""
    known = small_bodies()
    rows = zip(known.names, known.keys, known.gm.tolist(), strict=True)
    return {name: (int(key[2:]), gm) for name, key, gm in rows if key < "MA8" and gm >= LARGEST}


def with_all(system: System, day: float, small: tuple[Floats, Floats]) -> System:
    """Return Sun, planets and Moon, relative to the Solar System barycentre, with all else that acts in DE440."""
    from orbits.forces.mass_loss import MassLoss
    from orbits.lagrangians.terms.frame_dragging import FrameDragging
    from orbits.lagrangians.terms.minor_bodies import MinorBodies

    known, sun = small_bodies(), system.index("Sun")
    gm, q, v, _ = system.values
    own = gm.copy()
    own[sun] = constants.solar_gm(float(gm[sun]), day)
    ring_gm = np.array(constants.ring())
    ring_q, ring_v = ring(float(own[sun]), len(ring_gm))
    ring_names = [f"ring {k + 1}" for k in range(len(ring_gm))]
    more_q, more_v = np.vstack([small[0], ring_q]) + q[sun], np.vstack([small[1], ring_v]) + v[sun]
    names = [*system.names, *known.names, *ring_names]
    large = largest_asteroids()
    minor = [name for name in known.names if name not in large]
    spin = constants.solar_spin() * own[sun] / system.units.G
    return system.replaced(
        names=names,
        gm=np.concatenate([own, known.gm, ring_gm]),
        q=np.vstack([q, more_q]),
        v=np.vstack([v, more_v]),
        terms=[
            *relativistic_terms(system.names, day),
            FrameDragging("Sun", spin=spin, pole=constants.SUN_POLE * u.deg),
            MinorBodies(bodies=[*minor, *ring_names]),
        ],
        forces=[MassLoss(source="Sun", fraction=constant("GMSDOT") / u.yr)],
    )


def ring(gm: float, count: int) -> tuple[Floats, Floats]:
    """Return heliocentric states of bodies on a circle in the ecliptic, evenly spaced, (n, 3)."""
    angles = 2.0 * math.pi * np.arange(count) / count
    c, s, zero = np.cos(angles), np.sin(angles), np.zeros(count)
    speed = math.sqrt(gm / RING_RADIUS)
    q, v = RING_RADIUS * np.stack([c, s, zero], axis=1), speed * np.stack([-s, c, zero], axis=1)
    return kepler.from_frame(q, "ecliptic"), kepler.from_frame(v, "ecliptic")
