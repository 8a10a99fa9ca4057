"""A line of sight from infinity, as to the stars, and the radial velocities along it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from astropy import units as u
from numpy.typing import NDArray

from orbits.body_names import index_of
from orbits.checks import finite_number
from orbits.errors import InputError, shown
from orbits.point_masses import changed_masses
from orbits.time_grid import times_since
from orbits.units import SOLAR

if TYPE_CHECKING:
    from orbits.protocols import Run

Array = NDArray[np.float64]


class LineOfSight(NamedTuple):
    """The direction from a system to an observer at infinity, a vector of length 1 in the axes of the system."""

    x: float
    y: float
    z: float

    def __str__(self) -> str:
        return f"an observer at infinity towards ({', '.join(f'{x + 0.0:.6g}' for x in self)})"


SKY = LineOfSight(0.0, 0.0, 1.0)
"""The observer of a system whose x-y plane is that of the sky."""


def along(inc: Any = 0.0, node: Any = 0.0) -> LineOfSight:
    """Return the line of sight of an observer at infinity who sees the x-y plane of a system inclined.

        orbits.along()                                   # along z: orbits given with frame="sky"
        orbits.along(inc=89.9 * u.deg, node=30 * u.deg)  # a system given in a plane of its own

    inc : inclination of the x-y plane to the plane of the sky, an angle
    node : longitude in that plane, from x, at which bodies come through the plane of the sky, towards the observer: a
        body at the longitude node + 90 degrees is nearest to the observer

    The observer is at (-sin(node) sin(inc), cos(node) sin(inc), cos(inc)). Raises InputError for other units,
    for arrays, and for a plain number inc beyond half a turn, as of degrees without their unit.
    """
    angles = {"inc": inc, "node": node}
    i, longitude = (finite_number(SOLAR.angle_value(x, what), what) for what, x in angles.items())
    if abs(i) > np.pi and not isinstance(inc, u.Quantity):
        raise InputError(f"inc is {shown(inc)}, {i:g} radians; expected -pi to pi, or degrees: inc=89.9 * u.deg.")
    x, y, z = -np.sin(longitude) * np.sin(i), np.cos(longitude) * np.sin(i), np.cos(i)
    return LineOfSight(float(x + 0.0), float(y), float(z))  # no zero with a sign


def arrived(way: Array, speed: Array, towards: Array, delay: float) -> Array:
    """Return where bodies appear, (..., 3), whose light arrives with that of the origin: from a place nearer to the
    observer it left later.

    delay : the time that light takes for a unit of length
    """
    return np.asarray(way + delay * (way @ towards)[..., None] * speed)


def line_of_sight(given: Any, what: str) -> LineOfSight:
    """Return a line of sight from what `along` returned, or from three numbers of an archive. Raises InputError."""
    try:
        line = LineOfSight(*map(float, given))
    except (TypeError, ValueError):
        line = LineOfSight(np.nan, np.nan, np.nan)
    if not abs(np.hypot(np.hypot(line.x, line.y), line.z) - 1.0) < 1e-12:
        raise InputError(f"{what} is {shown(given)}; expected a line of sight, such as orbits.along(inc=90 * u.deg).")
    return line


def radial_velocity_of(run: Run, body: str, along: Any, times: Any) -> u.Quantity:
    """Return the radial velocity of a body; see `Trajectory.radial_velocity`."""
    towards = line_of_sight(along, "along")
    if run.changes is not None and run.changes.acted_on_massive:
        raise InputError(
            "run.radial_velocity is relative to the barycentre, but in this run massive bodies merge or are changed; "
            "expected a run without that, or one that ends before: see run.events and run.legs."
        )
    system, place = run.system, index_of(body, run.names, "body")
    since = run.times if times is None else times_since(system, times, "times")
    v = (run if times is None else run.at(since.ravel())).v.value
    from orbits.observing.placing import barycentre

    gm = changed_masses(since.ravel(), system.forces, system.values.gm, system.names, system.units)
    centre = barycentre(gm, v)
    speed = u.Quantity(-((v[:, place] - centre) @ np.array(towards)).reshape(since.shape), system.units.speed)
    return speed.to(u.m / u.s) if system.units.is_physical else speed
