"""Systems of bodies: names, GM, positions, velocities, an epoch and units, checked where they are made."""

from __future__ import annotations

from orbits.system.body import Body
from orbits.system.osculating import OrbitalElements, osculating
from orbits.system.value import System

__all__ = ["Body", "OrbitalElements", "System", "osculating"]
