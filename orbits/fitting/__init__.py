"""From observations to an orbit: readers of astrometry, weights, an initial orbit, differential correction."""

from orbits.fitting.fitted_orbit import fit
from orbits.fitting.initial import Root
from orbits.fitting.observations import Observations
from orbits.fitting.planets import fit_planets
from orbits.fitting.record import Ignored, Place, Record
from orbits.fitting.result import Fit
from orbits.results.covariance import Covariance
from orbits.results.planet_fit import PlanetFit

__all__ = ["Covariance", "Fit", "Ignored", "Observations", "Place", "PlanetFit", "Record", "Root", "fit", "fit_planets"]
