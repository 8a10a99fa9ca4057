"""Astrometry and radar of small bodies as observatories publish them: formats, uncertainties, sets of observations."""
