"""What each model of the Solar System contains, and how far it is from DE440."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from orbits.export import html_table, text_table
from orbits.system.solar.building import LARGEST, RING_RADIUS
from orbits.system.solar.constants import MOON_POLE, SUN_POLE, constant
from orbits.system.solar.models import FULL, NEWTONIAN, RELATIVISTIC, checked_model


def _number(name: str, digits: int) -> str:
    """Return a constant of DE440 as it is written here, such as 2.1961e-7: with that many significant digits."""
    size, _, power = f"{constant(name):.{digits - 1}e}".partition("e")
    return f"{size}e{int(power)}"


def _pole(pole: tuple[float, float]) -> str:
    return f"pole {pole[0]}, {pole[1]} degrees"


POINTS = (
    "Newton's attraction of Sun, planets and Pluto",
    "GM and initial states of DE440; from Mars outwards planets with their moons",
    "Park et al. (2021), AJ 161, 105",
)
BEYOND = (
    (
        "relativity by Sun, planets, Moon and Pluto (PostNewtonian)",
        f"c = {constant('CLIGHT')} km/s; first post-Newtonian order, in harmonic coordinates and TDB",
        "Einstein, Infeld & Hoffmann (1938)",
    ),
    (
        "flattening of the Sun (ZonalHarmonics)",
        f"J2 = {_number('J2SUN', 5)}, R = {constant('ASUN'):.10g} km; {_pole(SUN_POLE)}, fixed",
        "DE440; Archinal et al. (2018)",
    ),
    (
        "figure of the Earth (ZonalHarmonics)",
        f"J2 = {_number('J2E', 6)}, J3 = {_number('J3E', 4)}, J4 = {_number('J4E', 4)}, R = {constant('RE')} km; "
        "mean pole of the epoch, fixed",
        "DE440; Capitaine et al. (2003)",
    ),
    (
        "figure of the Moon (DegreeTwo)",
        f"J2 = {_number('J2M', 5)}, C22 = {_number('C22M', 5)}, R = {constant('AM'):.10g} km; {_pole(MOON_POLE)}, "
        "fixed, long axis to the Earth",
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
    ("ring of 36 bodies", f"GM of DE440, on a circle of {RING_RADIUS:g} au in the ecliptic", "DE440"),
    (
        "no attraction among these (MinorBodies)",
        f"but by the 16 asteroids of GM >= {LARGEST:.0g} au^3/d^2; nor relativity by any of them",
        "effect on planets in 30 years: less than a metre",
    ),
    (
        "frame dragging by the Sun (FrameDragging)",
        f"moment of inertia {constant('MOISUN')} M R^2, rotation {constant('OMGSUN'):.5f} rad/d",
        "DE440",
    ),
    ("loss of mass by the Sun (MassLoss)", f"{_number('GMSDOT', 1)} a year; its GM is that of the epoch", "DE440"),
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
        _misses(0.616, 0.468, 3.36, 5.58, 10.4, 6.76, 4.92, 40.7, 65.4, 64.7),
    ),
    FULL: SolarModel(
        FULL,
        (POINTS, *BEYOND, *MORE),
        "tides, librations of the Moon, higher harmonics of Earth and Moon, the change of the Earth's pole",
        _misses(8.5e-4, 2.0e-4, 1.37e-3, 5.58, 5.7e-5, 6.4e-4, 5.7e-3, 0.0132, 0.130, 0.255),
    ),
}


def solar_model(name: str) -> SolarModel:
    """Return what a model of the Solar System contains, with constants and sources, and how far it is from DE440.

        print(orbits.solar_model("full"))

    name : "newtonian", "relativistic" or "full", as in `System.solar_system(model=...)`

    Raises UnknownNameError for another.
    """
    return _MODELS[checked_model(name)]
