"""The orbit classes of JPL's Small-Body Database: codes, groups, and the classification of orbits.

Source: the class definitions of the SBDB Filter documentation, https://ssd-api.jpl.nasa.gov/doc/sbdb_filter.html.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

CLASSES = {
    "IMB": "inner belt",
    "MBA": "main belt",
    "OMB": "outer belt",
    "MCA": "Mars crosser",
    "TJN": "Jupiter Trojan",
    "IEO": "Atira",
    "ATE": "Aten",
    "APO": "Apollo",
    "AMO": "Amor",
    "CEN": "Centaur",
    "TNO": "beyond Neptune",
    "AST": "other asteroid",
    "PAA": "parabolic asteroid",
    "HYA": "hyperbolic asteroid",
    "JFC": "Jupiter-family comet, period < 20 years",
    "HTC": "Halley-type comet, period 20 to 200 years",
    "COM": "other comet",
    "PAR": "parabolic comet",
    "HYP": "hyperbolic comet",
    "ETc": "Encke-type comet",
    "JFc": "Jupiter-family comet by its Tisserand parameter",
    "CTc": "Chiron-type comet",
}
"""The classes of the Small-Body Database."""

NEAR_EARTH = ("IEO", "ATE", "APO", "AMO")
GROUPS = {
    "belt": ("IMB", "MBA", "OMB", "MCA"),
    "trojan": ("TJN",),
    "trojans": ("TJN",),
    "neo": NEAR_EARTH,
    "comet": ("JFC", "HTC", "COM", "PAR", "HYP", "ETc", "JFc", "CTc"),
}
"""Names for several classes at once: the main belt, Trojans, near-Earth objects, comets."""


def orbit_classes(a: Floats, e: Floats, comet: NDArray[np.bool_]) -> list[str]:
    """Return the class of each orbit, shape (n,); a in au, e, and which bodies are comets.

    Comets are classified by eccentricity and period alone, so never as ETc, JFc or CTc.
    """
    with np.errstate(invalid="ignore"):
        q, aphelion = a * (1.0 - e), a * (1.0 + e)
        years = np.where(e < 1.0, np.abs(a), np.inf) ** 1.5
        asteroid = ~comet
        # The first condition that holds counts. Unbound orbits come first, as they cannot be classified by a.
        cases = {
            "PAR": comet & (e == 1.0),
            "HYP": comet & (e > 1.0),
            "JFC": comet & (years < 20.0),
            "HTC": comet & (years < 200.0),
            "COM": comet,
            "PAA": asteroid & (e == 1.0),
            "HYA": asteroid & (e > 1.0),
            "IEO": aphelion < 0.983,
            "ATE": a < 1.0,
            "APO": (a > 1.0) & (q < 1.017),
            "AMO": (a > 1.0) & (q < 1.3),
            "MCA": (a < 3.2) & (q > 1.3) & (q < 1.666),
            "IMB": (a < 2.0) & (q > 1.666),
            "MBA": (a > 2.0) & (a < 3.2) & (q > 1.666),
            "OMB": (a > 3.2) & (a < 4.6),
            "TJN": (a > 4.6) & (a < 5.5) & (e < 0.3),
            "CEN": (a > 5.5) & (a < 30.1),
            "TNO": a > 30.1,
        }
    codes = np.select(list(cases.values()), list(range(len(cases))), default=len(cases))
    names = [*cases, "AST"]
    return [names[code] for code in codes.tolist()]
