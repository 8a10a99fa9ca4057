"""Systems of bodies: names, GM, positions, velocities, an epoch and units, checked when they are made."""

from __future__ import annotations

from orbits.system.body import Body
from orbits.system.orbital_elements import OrbitalElements, osculating
from orbits.system.system import System

__all__ = ["Body", "OrbitalElements", "System", "osculating"]
