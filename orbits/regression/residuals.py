"""How far a run is from an ephemeris: residuals of each body over time, as a table and a picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from astropy import units as u
from numpy.typing import NDArray

from orbits import ephemeris
from orbits.body_names import chosen, few
from orbits.errors import EpochError, InputError
from orbits.export import html_table, text_table
from orbits.json_text import json_text
from orbits.regression.kernels import DE440, Kernel, dates, opened
from orbits.spk.bodies import known_number

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from orbits.trajectory import Trajectory

Array = NDArray[np.float64]

SUN, EARTH, MOON = 10, 399, 301
TOGETHER = "Earth-Moon barycenter"
YEAR = 365.25


@dataclass(frozen=True, eq=False)
class Residuals:
    """Differences of positions, of a run less an ephemeris, at the samples of the run.

    kernel : the name of the ephemeris; method : of the run; title : of table and picture
    years : (n,) Julian years since the epoch of the run
    km : by body, (n, 3), ICRF; seen from the Sun, and the Moon from the Earth
    left_out : bodies of the run that the ephemeris does not have
    """

    kernel: str
    method: str
    years: Array
    km: Mapping[str, Array] = field(repr=False)
    left_out: tuple[str, ...] = ()
    title: str = "Residuals"

    @cached_property
    def distances(self) -> dict[str, Array]:
        """The lengths of the residuals by body, (n,), km."""
        return {name: np.asarray(np.linalg.norm(x, axis=1)) for name, x in self.km.items()}

    def largest(self, within: float | None = None) -> dict[str, float]:
        """Return the largest length by body, km, of all samples or of those within some years since the epoch."""
        some = np.abs(self.years) <= (np.inf if within is None else within)
        return {name: float(x[some].max()) for name, x in self.distances.items()}

    def last_tenth(self) -> dict[str, float]:
        """Return the largest length by body, km, in the last tenth of the time."""
        late = np.abs(self.years) >= 0.9 * np.abs(self.years).max()
        return {name: float(x[late].max()) for name, x in self.distances.items()}

    @property
    def _columns(self) -> list[tuple[str, dict[str, float]]]:
        span = float(np.abs(self.years).max())
        marks = [y for y in (1.0, 10.0, 100.0) if y < 0.99 * span]
        within = [(f"within {y:g} yr", self.largest(y)) for y in marks]
        return [*within, (f"within {span:.4g} yr", self.largest()), ("in the last tenth", self.last_tenth())]

    def _rows(self) -> tuple[str, list[str], list[list[str]]]:
        columns = self._columns
        rows = [[called(name), *(f"{values[name]:.3g}" for _, values in columns)] for name in self.km]
        return f"{self.title}: km from {self.kernel}", ["body", *(head for head, _ in columns)], rows

    @property
    def table(self) -> str:
        """The largest residuals by body, km, as text."""
        missing = f"\nNot in {self.kernel}: {few(self.left_out)}." if self.left_out else ""
        return text_table(*self._rows()) + missing

    def __str__(self) -> str:
        return self.table

    def _repr_html_(self) -> str:
        return html_table(*self._rows())

    def to_json(self, path: str | PathLike[str] | None = None) -> str:
        """Return the residuals as JSON, with those of all samples; also written to `path` if one is given."""
        record = {
            "kernel": self.kernel,
            "method": self.method,
            "years": self.years.tolist(),
            "largest_km": self.largest(),
            "last_tenth_km": self.last_tenth(),
            "not_in_kernel": list(self.left_out),
            "km": {name: x.tolist() for name, x in self.km.items()},
        }
        text = json_text(record)
        if path is not None:
            Path(path).write_text(text + "\n", encoding="utf-8")
        return text

    def plot(self, path: str | PathLike[str] | None = None) -> Figure:
        """Return the residuals over time as a picture; also saved to `path` if one is given."""
        from orbits.plotting import save
        from orbits.regression.residuals_picture import picture

        made = picture(self)
        if path is not None:
            save(made, Path(path))
        return made


def called(name: str) -> str:
    """Return the name of a body, with the place from which it is seen if that is not the Sun."""
    return "Moon, from the Earth" if name == "Moon" else name


def residuals(
    run: Trajectory,
    against: str | PathLike[str] = DE440,
    *,
    bodies: Sequence[str] | None = None,
    ids: Mapping[str, int] | None = None,
    title: str = "Residuals",
) -> Residuals:
    """Return how far a run is from an ephemeris, at its samples: positions from the Sun, and of the Moon from the Earth.

        run = orbits.propagate(orbits.System.solar_system(model="relativistic"), dt="1 d", duration="20 yr", samples=500)
        print(orbits.residuals(run))

    run : of a system with an epoch and a body "Sun"
    against : "de440", or the path of an SPK kernel of Chebyshev series, such as "sb441-n16.bsp"
    bodies : names; by default all that the ephemeris has. Where Earth and Moon are apart, their barycentre is one more
    ids : NAIF's numbers of bodies by name, for those that are not known by theirs
    title : of table and picture

    Raises InputError for a run without an epoch or a Sun, a file that is no such kernel, and a body asked for that it
    does not have; EpochError for times that it does not cover.
    """
    system = run.system
    epoch = system.epoch
    if epoch is None:
        raise EpochError("the run has no epoch, so that an ephemeris has no times for it; give the system an epoch.")
    if "Sun" not in system.names:
        raise InputError("the run has no body 'Sun', from which positions are compared; name the star so.")
    names = [system.names[i] for i in chosen(system.names, bodies)]
    known = {name: known_number(name, ids) for name in names if name != "Sun"}
    days = np.asarray(run.t.to_value(u.day))
    whole, rests = dates(epoch.jd1, epoch.jd2, days)
    first, last = float((whole + rests).min()), float((whole + rests).max())
    with opened(against, first, last) as kernel:
        missing = [name for name, number in known.items() if number is None or not kernel.has(number)]
        if bodies is not None and missing:
            raise InputError(f"{kernel.name} does not have {few(missing)}. Leave them out of bodies, or give ids=...")
        known = {name: number for name, number in known.items() if name not in missing}
        if not known:
            raise InputError(f"{kernel.name} has none of the bodies of the run: {few(names)}. Give ids={{name: number}}.")
        found = _differences(run, kernel, known, whole, rests)
    return Residuals(kernel.name, run.integrator.label, days / YEAR, found, tuple(missing), title)


def _differences(run: Trajectory, kernel: Kernel, known: Mapping[str, int | None], whole: Array, rests: Array) -> dict[str, Array]:
    """Return the differences by body, (n, 3), km."""
    names = run.system.names
    q = np.asarray(run.q.to_value(u.km))

    def here(name: str, centre: str) -> Array:
        return q[:, names.index(name)] - q[:, names.index(centre)]

    found: dict[str, Array] = {}
    for name, number in known.items():
        geocentric = name == "Moon" and "Earth" in names
        centre = EARTH if geocentric else SUN
        there = kernel.relative(int(number or 0), centre, whole, rests)
        found[name] = here(name, "Earth" if geocentric else "Sun") - there
    if {"Earth", "Moon"} <= found.keys() and TOGETHER not in found:
        earth, moon = ephemeris.gm(["Earth", "Moon"])
        share = moon / (earth + moon)
        order = list(found)
        found[TOGETHER] = found["Earth"] + share * found["Moon"]
        order.insert(order.index("Moon") + 1, TOGETHER)
        found = {name: found[name] for name in order}
    return found
