"""Functions of arrays that say what states conserve, and what a step is. Floats in, floats out: no units.

Of what is conserved, only bodies with gm > 0 count: a massless particle moves in their field and carries no charge of
the whole. `reversibility`, `symplecticity` and `order` take bodies, a method and a step, and look at the compiled step
itself; a system's arrays are `system.values.gm`, `.q` and `.v`.
"""

from orbits.diagnostics.convergence import Convergence, convergence, order
from orbits.diagnostics.drift import Drift, centre_of_mass_drift, drift
from orbits.diagnostics.energy import energy
from orbits.diagnostics.growth import Growth, growth
from orbits.diagnostics.momenta import (
    NoetherCharges,
    angular_momentum,
    centre_of_mass,
    linear_momentum,
    noether_charges,
)
from orbits.diagnostics.reversal import Reversal, reversibility
from orbits.diagnostics.symplecticity import Symplecticity, symplecticity

__all__ = [
    "Convergence",
    "Drift",
    "Growth",
    "NoetherCharges",
    "Reversal",
    "Symplecticity",
    "angular_momentum",
    "centre_of_mass",
    "centre_of_mass_drift",
    "convergence",
    "drift",
    "energy",
    "growth",
    "linear_momentum",
    "noether_charges",
    "order",
    "reversibility",
    "symplecticity",
]
