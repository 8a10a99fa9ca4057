"""Functions of arrays that measure conserved quantities and the properties of a step. Floats in, floats out: no units.

Only bodies with gm > 0 contribute to conserved quantities; massless particles only move in their field.
`reversibility`, `symplecticity` and `order` take bodies, a method and a step, and measure the compiled step itself. The
arrays of a system are `system.values.gm`, `.q` and `.v`. `frequency_analysis` takes any series in time.
"""

from orbits.diagnostics.convergence import Convergence, convergence, order
from orbits.diagnostics.drift import Drift, centre_of_mass_drift, drift
from orbits.diagnostics.energy import energy
from orbits.diagnostics.frequencies import Frequencies, frequency_analysis
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
    "Frequencies",
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
    "frequency_analysis",
    "growth",
    "linear_momentum",
    "noether_charges",
    "order",
    "reversibility",
    "symplecticity",
]


def __dir__() -> list[str]:
    """Return the public names."""
    return __all__
