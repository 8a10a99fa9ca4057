"""What is measured of a star and its planets, computed: times of transits, and radial velocities of the star."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from astropy import units as u
from numpy.typing import NDArray

from orbits.errors import InputError, shown
from orbits.integrators.forms import Array
from orbits.observing.line_of_sight import SKY
from orbits.observing.measured import TransitTimes
from orbits.observing.placing import barycentre
from orbits.observing.transits import mean_anomaly, mid_transits
from orbits.propagation.run import propagate
from orbits.system import System

Whole = NDArray[np.int64]

ELEMENTS = ("mass_ratio", "P", "t0", "ecosw", "esinw", "inc", "Omega")
"""The elements of a planet: the ratio of its mass to that of the star; the period; the time after the epoch of the
transit nearest to it; e cos and e sin omega; inclination and node, radians, in the frame of the sky. They are those of
the osculating orbit about the centre of mass of the bodies before it. Times are in the unit of the system.
"""

GUESS = 3e-5
"""The mass ratio from which a fit begins that is given the star alone: ten masses of the Earth to that of the Sun."""

MOST_E = 0.999
"""Orbits with a larger e are not sought."""

TOWARDS = np.array(SKY)


@dataclass(frozen=True)
class Model:
    """What is computed for a system: a star, the first body, and its planets.

    times : of the transits since the epoch; planet : the number of the planet of each, from 1
    at : times of the velocities; groups : the planets that move together, all or each alone
    """

    system: System
    times: Array
    planet: Whole
    at: Array
    groups: tuple[Whole, ...]

    def computed(self, elements: Sequence[Array]) -> Array:
        """Return times of transits and velocities, m/s, (k, m), for k sets of elements, (planets, 7) each.

        Raises InputError and IntegrationError for those that do not move, and returns NaN for transits that are not
        near.
        """
        count = len(self.times)
        out = np.zeros((len(elements), count + len(self.at)))
        for group in self.groups:
            rows = np.flatnonzero(np.isin(self.planet, group))
            place = np.searchsorted(group, self.planet[rows]) + 1
            systems = [self.made(one, group) for one in elements]
            q, v = states(systems, np.concatenate([self.times[rows], self.at]))
            for k, system in enumerate(systems):
                here, gm = np.arange(len(rows)), system.values.gm
                way, speed = (x[k, here, place] - x[k, here, 0] for x in (q, v))
                out[k, rows] = self.times[rows] + mid_transits(gm[0] + gm[place], way, speed, TOWARDS)
                along = (v[k, len(rows) :, 0] - barycentre(gm, v[k, len(rows) :])) @ TOWARDS
                out[k, count:] -= u.Quantity(along, system.units.speed).to_value(u.m / u.s)
        return out

    def made(self, elements: Array, group: Whole | None = None) -> System:
        """Return the system with these elements, (planets, 7), or with some of its planets alone."""
        planets = np.arange(1, len(self.system)) if group is None else group
        gm = self.system.values.gm[0]
        bodies: dict[str, dict[str, Any]] = {self.system.names[0]: {"gm": gm}}
        for number in planets:
            mass, P, t0, k, h, inc, Omega = elements[number - 1]
            e, omega = np.hypot(k, h), np.arctan2(h, k)
            M = mean_anomaly(e, 0.5 * np.pi - omega) - 2.0 * np.pi * t0 / P
            own = {"P": P, "e": e, "inc": inc, "Omega": Omega, "omega": omega, "M": M}
            bodies[self.system.names[number]] = {"gm": mass * gm, "primary": "jacobi", **own}
        made = System.from_elements(bodies, epoch=self.system.epoch, units=self.system.units, frame="sky")
        others = [name for name in self.system.names if name not in bodies]
        alone = self.system.remove(*others) if others else self.system
        gm, q, v = made.values[:3]
        begun = self.system.values
        shift = (barycentre(begun.gm, x[None]) - barycentre(gm, y[None]) for x, y in ((begun.q, q), (begun.v, v)))
        q, v = (x + by for x, by in zip((q, v), shift, strict=True))
        return alone.replaced(gm=gm, q=q, v=v)


def with_planets(system: Any, transits: TransitTimes | None) -> Any:
    """Return the system of a star alone with planets on circular orbits through the transits."""
    if transits is None or not isinstance(system, System) or len(system) != 1 or system.epoch is None:
        return system
    for name in sorted(transits.planets, key=lambda name: transits.linear(name).period):
        t0, P = transits.linear(name)
        if not P > 0.0:
            raise InputError(f"one transit of {name!r} does not tell its period; give the star with its planets.")
        M = (0.25 - (t0 - system.epoch.jd) / P) % 1.0 * 360.0 * u.deg  # from the node
        orbit = {"P": P * u.day, "inc": 90.0 * u.deg, "M": M}
        system = system.add(name, gm=GUESS * system.gm[0], primary="jacobi", frame="sky", **orbit)
    return system


def checked_start(system: Any) -> System:
    """Return a system of a star and its planets. Raises InputError for anything else."""
    if not isinstance(system, System) or len(system) < 2 or system.epoch is None or not system.units.is_physical:
        raise InputError(
            f"system is {shown(system)}; expected the star and its planets about where they are: "
            'orbits.System.from_elements({...}, epoch=..., frame="sky").'
        )
    gm = system.values.gm
    if gm[0] != gm.max() or not (gm > 0.0).all():
        raise InputError("the star is to be the first body of the system, and all planets need a mass, if a guess.")
    for name, e in zip(system.names[1:], system.elements("jacobi", frame="sky").e.value, strict=True):
        if not e <= MOST_E:
            raise InputError(f"{name} of the start has e = {e:.6g}; expected at most {MOST_E}.")
    return system


def states(systems: Sequence[System], times: Array) -> tuple[Array, Array]:
    """Return q and v of all systems at times before and after their epoch, (systems, m, bodies, 3)."""
    q, v = np.empty((2, len(systems), len(times), len(systems[0]), 3))
    for side in (times < 0.0, times >= 0.0):
        if not side.any():
            continue
        at, back = np.unique(np.abs(times[side]), return_inverse=True)
        sign = 1.0 if times[side][0] >= 0.0 else -1.0
        how: dict[str, Any] = {"samples": sign * at, "duration": sign * (at[-1] or 1.0)}
        runs = propagate(systems, **how, approaches=False, check_step=False, progress=False)
        for k, run in enumerate(runs):
            q[k, side], v[k, side] = run.q.value[back], run.v.value[back]
    return q, v


def elements_of(system: System) -> Array:
    """Return the elements of the planets of a system, (planets, 7)."""
    found = system.elements(primary="jacobi", frame="sky")
    omega, M, inc, Omega = (x.to_value(u.rad) for x in (found.omega, found.M, found.inc, found.Omega))
    e = found.e.value
    P, gm = found.P.to_value(system.units.time), system.values.gm
    ahead = mean_anomaly(e, 0.5 * np.pi - omega) - M
    t0 = P * ((ahead / (2.0 * np.pi) + 0.5) % 1.0 - 0.5)
    return np.stack([gm[1:] / gm[0], P, t0, e * np.cos(omega), e * np.sin(omega), inc, Omega], axis=1)
