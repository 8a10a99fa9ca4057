"""Massless particles in the field of the massive bodies."""
