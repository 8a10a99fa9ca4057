"""What acts besides Newton's gravity: terms of the Lagrangian, and forces without one.

    system.with_terms(orbits.terms.PostNewtonian())
    system.with_forces(orbits.terms.Drag(...))
"""

from __future__ import annotations

from orbits.forces.damping import Damping
from orbits.forces.drag import Drag
from orbits.forces.gas_drag import GasDrag
from orbits.forces.mass_loss import MassLoss
from orbits.forces.non_gravitational import NonGravitational
from orbits.forces.radiation_pressure import RadiationPressure
from orbits.forces.tides import Tides
from orbits.lagrangians.terms.degree_two import DegreeTwo
from orbits.lagrangians.terms.frame_dragging import FrameDragging
from orbits.lagrangians.terms.minor_bodies import MinorBodies
from orbits.lagrangians.terms.nobili_roxburgh import NobiliRoxburgh
from orbits.lagrangians.terms.post_newtonian import PostNewtonian
from orbits.lagrangians.terms.zonal_harmonics import ZonalHarmonics

__all__ = [
    "Damping",
    "DegreeTwo",
    "Drag",
    "FrameDragging",
    "GasDrag",
    "MassLoss",
    "MinorBodies",
    "NobiliRoxburgh",
    "NonGravitational",
    "PostNewtonian",
    "RadiationPressure",
    "Tides",
    "ZonalHarmonics",
]


def __dir__() -> list[str]:
    """Return the public names."""
    return __all__
