"""Belts of massless particles among the giant planets, and how their campaigns are integrated."""

from __future__ import annotations

from typing import Any

import numpy as np
from astropy import units as u

import orbits
from orbits.ensemble import Ensemble, particles

OPTIONS: dict[str, Any] = {
    "duration": 20 * u.yr,
    "dt": "30 d",
    "integrator": orbits.WisdomHolman(encounters="retire"),
    "samples": 5,
    "progress": False,
}


def giants() -> orbits.System:
    """Sun, Jupiter and Saturn."""
    return orbits.System.solar_system(epoch="2022-08-09", bodies=["Sun", "Jupiter", "Saturn"])


def system(count: int, outermost: float = 3.4) -> orbits.System:
    """The planets with particles; up to 5 au some of them come near Jupiter."""
    rng = np.random.default_rng(1)
    a, e, inc = rng.uniform(2.1, outermost, count), rng.uniform(0, 0.3, count), rng.uniform(0, 0.3, count)
    Omega, omega, M = rng.uniform(0, 6.28, (3, count))
    names = [f"p{k}" for k in range(count)]
    return giants().add(names, primary="Sun", a=a * u.au, e=e, inc=inc, Omega=Omega, omega=omega, M=M)


def belt(count: int, outermost: float = 3.4) -> Ensemble:
    """The particles as members."""
    return particles(giants(), system(count, outermost))
