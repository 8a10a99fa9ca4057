"""Systems in which something happens, with starts that are the same for every test that uses them."""

import numpy as np
from astropy import units as u
from astropy.time import Time

import orbits

MASSIVE = ["Sun", "Mercury", "Venus", "Earth", "Moon", "Mars", "Jupiter", "Saturn", "Uranus", "Neptune"]

APOPHIS_MISS = 38_012.88
"""Geocentric miss distance of `apophis_2029`, km, of any run that resolves it: Newtonian point masses."""


def apophis_2029() -> orbits.System:
    """Apophis among Sun, planets and Moon on 2029-01-02, a hundred days before it passes the Earth.

    Heliocentric state in ICRF of JPL's solution 199, as printed in public tests of ephemeris programs.
    """
    system = orbits.System.solar_system(epoch=Time(2462138.5359989386, format="jd", scale="tdb"), bodies=MASSIVE)
    q = np.array([-0.5594653855048851, 0.8564756475757451, 0.30415066217102493]) * u.au
    v = np.array([-0.013818324735921638, -0.006008827559793919, -0.0025805044631309632]) * u.au / u.day
    return system.add("Apophis", primary="Sun", q=q, v=v)


def comet(q: float, e: float, T: float = 203.3) -> orbits.System:
    """The Sun and a massless comet with its perihelion, q in au, after T days: no symmetry favours that."""
    sun = orbits.System(["Sun"], [0.00029591220828411956], np.zeros((1, 3)), np.zeros((1, 3)), units=orbits.SOLAR)
    return sun.add("comet", primary="Sun", q=q * u.au, e=e, T=T * u.day)
