"""What an observer sees of the bodies of a run: places in the sky, distances, light time, angles, magnitudes."""

from typing import TYPE_CHECKING

from orbits.later import later

if TYPE_CHECKING:
    from orbits.observing.ephemeris_of_run import ephemeris_of
    from orbits.observing.table import Ephemeris

__all__ = ["Ephemeris", "ephemeris_of"]

__getattr__ = later(
    __name__, {"orbits.observing.ephemeris_of_run": ["ephemeris_of"], "orbits.observing.table": ["Ephemeris"]}
)
