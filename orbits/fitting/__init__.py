"""From observations to an orbit: an initial orbit, differential correction, outliers, covariances."""

from orbits.astrometry.observations import Observations
from orbits.astrometry.record import Ignored, Place, Record
from orbits.fitting.fitted_orbit import fit
from orbits.fitting.initial import Root
from orbits.fitting.planets import fit_planets
from orbits.fitting.result import Fit
from orbits.results.covariance import Covariance
from orbits.results.planet_fit import PlanetFit

__all__ = ["Covariance", "Fit", "Ignored", "Observations", "Place", "PlanetFit", "Record", "Root", "fit", "fit_planets"]
