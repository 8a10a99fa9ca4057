"""Functions of arrays that say what a set of states conserves. Floats in, floats out: no units.

Only bodies with gm > 0 count: a massless particle moves in their field and carries no charge of the whole.
"""

from orbits.diagnostics.drift import Drift, drift
from orbits.diagnostics.energy import energy
from orbits.diagnostics.momenta import (
    NoetherCharges,
    angular_momentum,
    centre_of_mass,
    linear_momentum,
    noether_charges,
)

__all__ = [
    "Drift",
    "NoetherCharges",
    "angular_momentum",
    "centre_of_mass",
    "drift",
    "energy",
    "linear_momentum",
    "noether_charges",
]
