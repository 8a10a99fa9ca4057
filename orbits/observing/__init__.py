"""What an observer sees of the bodies of a run: places in the sky, distances, light time, angles, magnitudes."""

from orbits.observing.seen import ephemeris_of
from orbits.observing.table import Ephemeris

__all__ = ["Ephemeris", "ephemeris_of"]
