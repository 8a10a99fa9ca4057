"""What each model of the Solar System contains, and how far it is from DE440."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from orbits.export import html_table, text_table
from orbits.system.solar.models import FULL, NEWTONIAN, RELATIVISTIC, checked_model

POINTS = (
    "Newton's attraction of Sun, planets and Pluto",
    "GM and initial states of DE440; from Mars outwards planets with their moons",
    "Park et al. (2021), AJ 161, 105",
)
BEYOND = (
    (
        "relativity by Sun, planets, Moon and Pluto (PostNewtonian)",
        "c = 299792.458 km/s; first post-Newtonian order, in harmonic coordinates and TDB",
        "Einstein, Infeld & Hoffmann (1938)",
    ),
    (
        "flattening of the Sun (ZonalHarmonics)",
        "J2 = 2.1961e-7, R = 696000 km; pole 286.13, 63.87 degrees, fixed",
        "DE440; Archinal et al. (2018)",
    ),
    (
        "figure of the Earth (ZonalHarmonics)",
        "J2 = 1.08263e-3, J3 = -2.532e-6, J4 = -1.620e-6, R = 6378.1366 km; mean pole of the epoch, fixed",
        "DE440; Capitaine et al. (2003)",
    ),
    (
        "figure of the Moon (DegreeTwo)",
        "J2 = 2.0321e-4, C22 = 2.2381e-5, R = 1738 km; pole 269.9949, 66.5392 degrees, fixed, long axis to the Earth",
        "DE440",
    ),
)
MORE = (
    (
        "343 asteroids",
        "GM of DE440; elements of JPL's Small-Body Database at MJD 59800, integrated to the epoch; the 16 largest by "
        "sb441-n16",
        "DE440; JPL",
    ),
    (
        "30 trans-Neptunian objects",
        "GM of DE440; elements of JPL's Small-Body Database at MJD 59800, integrated to the epoch",
        "DE440; JPL",
    ),
    ("ring of 36 bodies", "GM of DE440, on a circle of 44 au in the ecliptic", "DE440"),
    (
        "no attraction among these (MinorBodies)",
        "but by the 16 asteroids of GM >= 2e-15 au^3/d^2; nor relativity by any of them",
        "effect on planets in 30 years: less than a metre",
    ),
    (
        "frame dragging by the Sun (FrameDragging)",
        "moment of inertia 0.06884 M R^2, rotation 0.24756 rad/d",
        "DE440",
    ),
    ("loss of mass by the Sun (MassLoss)", "-9e-14 a year; its GM is that of the epoch", "DE440"),
)

ORDER = ("Mercury", "Venus", "Earth-Moon barycenter", "Moon", "Mars", "Jupiter", "Saturn", "Uranus", "Neptune", "Pluto")


@dataclass(frozen=True)
class SolarModel:
    """A model of the Solar System in words.

    name : as in `System.solar_system(model=...)`
    contains : what acts, with its constants and their source
    left_out : what DE440 has and the model has not
    misses_km : largest distance from DE440 by body in the last tenth of thirty years from 2000-01-01, as measured:
        heliocentric, of the Moon geocentric; with Earth and Moon apart
    """

    name: str
    contains: tuple[tuple[str, str, str], ...]
    left_out: str
    misses_km: Mapping[str, float]

    def __str__(self) -> str:
        wide = [f"  {what}: {constants} [{source}]" for what, constants, source in self.contains]
        head, row = list(self.misses_km), [f"{km:.2g}" for km in self.misses_km.values()]
        title = "Largest distance from DE440 in the last three of thirty years from 2000-01-01, km:"
        rows = [[body, km] for body, km in zip(head, row, strict=True)]
        return "\n".join(
            [f"The model {self.name!r} of the Solar System", *wide, f"Left out: {self.left_out}.",
             text_table(title, ["body", "km"], rows)]
        )  # fmt: skip

    def _repr_html_(self) -> str:
        return html_table(f"The model {self.name!r}", ["what acts", "constants", "source"], self.contains, words=3)


def _misses(*km: float) -> Mapping[str, float]:
    return MappingProxyType(dict(zip(ORDER, km, strict=True)))


_MODELS = {
    NEWTONIAN: SolarModel(
        NEWTONIAN, (POINTS,), "all else", _misses(5330, 2800, 1830, 527, 1420, 148, 73.8, 54.1, 68.6, 67.2)
    ),
    RELATIVISTIC: SolarModel(
        RELATIVISTIC,
        (POINTS, *BEYOND),
        "asteroids, trans-Neptunian objects, frame dragging, the Sun's loss of mass; tides, librations of the Moon",
        _misses(0.616, 0.468, 3.36, 5.5, 10.4, 6.76, 4.92, 40.7, 65.4, 64.7),
    ),
    FULL: SolarModel(
        FULL,
        (POINTS, *BEYOND, *MORE),
        "tides, librations of the Moon, higher harmonics of Earth and Moon, the change of the Earth's pole",
        _misses(8.1e-4, 1.9e-4, 1.4e-3, 5.5, 6.1e-5, 6.4e-4, 5.7e-3, 0.0132, 0.130, 0.255),
    ),
}


def solar_model(name: str) -> SolarModel:
    """Return what a model of the Solar System contains, with constants and sources, and how far it is from DE440.

        print(orbits.solar_model("full"))

    name : "newtonian", "relativistic" or "full", as in `System.solar_system(model=...)`

    Raises UnknownNameError for another.
    """
    return _MODELS[checked_model(name)]
