"""The planar spin–orbit problem: spins of moons about the axis of an orbit that they do not change, in any number.

    spins = orbits.spin_orbit.PlanarSpins(eccentricity=0.1, alpha=0.89)
    section = spins.section(theta=0.0, rate=np.linspace(0.0, 3.0, 30), revolutions=2000)

Source: Goldreich & Peale (1966), AJ 71, 425; Wisdom, Peale & Mignard (1984), Icarus 58, 137.
"""

from orbits.spin_orbit.libration import Libration
from orbits.spin_orbit.path import SpinPath
from orbits.spin_orbit.planar import PlanarSpins

__all__ = ["Libration", "PlanarSpins", "SpinPath"]


def __dir__() -> list[str]:
    """Return the public names."""
    return __all__
