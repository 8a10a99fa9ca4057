"""How far a run is from an ephemeris: residuals of each body over time, as a table and a picture."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
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
from orbits.checks import check_physical
from orbits.errors import EpochError, InputError, shown
from orbits.export import html_table, text_table
from orbits.json_text import json_text, plain
from orbits.regression.kernels import DE440, Kernel, dates, is_kernel, opened
from orbits.spk.bodies import checked_ids, known_number
from orbits.trajectory import Trajectory

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from orbits.system import System

Array = NDArray[np.float64]

SUN, EARTH = 10, 399
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
        """Return the largest length by body, km, of all samples or of those within some years since the epoch; NaN if
        there are none.
        """
        some = np.abs(self.years) <= (np.inf if within is None else within)
        return {name: float(x[some].max()) if some.any() else np.nan for name, x in self.distances.items()}

    def last_tenth(self) -> dict[str, float]:
        """Return the largest length by body, km, in the last tenth of the time."""
        late = np.abs(self.years) >= 0.9 * np.abs(self.years).max()
        return {name: float(x[late].max()) for name, x in self.distances.items()}

    @property
    def _columns(self) -> list[tuple[str, dict[str, float]]]:
        span = float(np.abs(self.years).max())
        marks = [y for y in (1.0, 10.0, 100.0) if np.abs(self.years).min() <= y < 0.99 * span]
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

    @property
    def stem(self) -> str:
        """The ephemeris and the method in a form for file names."""
        return re.sub(r"[^a-z0-9]+", "-", f"{self.kernel.removesuffix('.bsp')} {self.method}".lower()).strip("-")

    def record(self) -> dict[str, Any]:
        """Return what the table has, by name; None for a body that was lost."""
        found = {
            "format": "orbits-residuals",
            "version": 1,
            "kernel": self.kernel,
            "method": self.method,
            "largest_km": self.largest(),
            "last_tenth_km": self.last_tenth(),
            "not_in_kernel": self.left_out,
        }
        return {key: plain(value, "residuals") for key, value in found.items()}

    def to_json(self, path: str | PathLike[str] | None = None) -> str:
        """Return the residuals as JSON, with those of all samples, null for those of a body that was lost; also written
        to `path` if one is given.
        """
        text = json_text(self.record() | plain({"years": self.years, "km": self.km}, "residuals"), allow_nan=False)
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
    """Return how far a run is from an ephemeris, at its samples: positions from the Sun, of the Moon from the Earth.

        system = orbits.System.solar_system(model="relativistic")
        run = orbits.propagate(system, dt="3 d", duration="20 yr", samples=500)
        print(orbits.residuals(run))

    run : of a system with an epoch and a body "Sun"
    against : "de440", or the path of an SPK kernel of Chebyshev series, such as "sb441-n16.bsp"
    bodies : names; by default all that the ephemeris has. Where Earth and Moon are apart, their barycentre is one more
    ids : NAIF's numbers of bodies by name, for those that are not known by theirs
    title : of table and picture

    Raises InputError for a run in pure numbers, or without an epoch or a Sun, a file that is no such kernel, and a body
    asked for that it does not have; EpochError for times that it does not cover.
    """
    if not isinstance(run, Trajectory):
        raise InputError(f"run is {shown(run)}; expected a run of orbits.propagate.")
    if not len(run):
        raise InputError(f"{run!r} has no samples yet, so there is nothing to compare; expected at least one.")
    check_physical(run.system.units, "orbits.residuals")
    days = np.asarray(run.t.to_value(u.day))
    with _common(run.system, against, days, bodies, ids) as (kernel, known, missing, whole, rests):
        found = _differences(run, kernel, known, whole, rests)
    return Residuals(kernel.name, run.integrator.label, days / YEAR, found, missing, title)


def check_covered(system: System, against: str | PathLike[str], days: Array) -> None:
    """Raise what `residuals` would raise for a run of a system with samples at these days since its epoch."""
    check_physical(system.units, "a comparison with an ephemeris")
    ends = np.array([days.min(), days.max()])
    with _common(system, against, ends, None, None) as (kernel, known, _, whole, rests):
        for number in known.values():
            kernel.relative(number, SUN, whole, rests)


@contextmanager
def _common(
    system: System,
    against: str | PathLike[str],
    days: Array,
    bodies: Sequence[str] | None,
    ids: Mapping[str, int] | None,
) -> Iterator[tuple[Kernel, dict[str, int], tuple[str, ...], Array, Array]]:
    """Open an ephemeris, and find the bodies that it has of a system, and the dates at days since the epoch."""
    epoch = system.epoch
    if epoch is None:
        raise EpochError("the run has no epoch, so that an ephemeris has no times for it; give the system an epoch.")
    if "Sun" not in system.names:
        raise InputError("the run has no body 'Sun', from which positions are compared; name the star so.")
    names = np.array(system.names, dtype=object)[chosen(system.names, bodies)].tolist()
    if not names:
        raise InputError("bodies is empty; expected names, or None for all that the ephemeris has.")
    given = checked_ids(system.names, ids)
    numbers = {name: known_number(name, given) for name in names if name != "Sun"}
    if not numbers:
        raise InputError("there is only the Sun, from which positions are compared; expected other bodies.")
    whole, rests = dates(epoch.jd1, epoch.jd2, days)
    first, last = float((whole + rests).min()), float((whole + rests).max())
    with opened(against, first, last) as kernel:
        known = {name: number for name, number in numbers.items() if number is not None and kernel.has(number)}
        missing = tuple(name for name in numbers if name not in known)
        if bodies is not None and missing:
            raise InputError(f"{kernel.name} does not have {few(missing)}. Leave them out of bodies, or give ids=...")
        if not known:
            raise InputError(
                f"{kernel.name} has none of the bodies of the run: {few([*numbers])}. Give their numbers, ids=..."
            )
        yield kernel, known, missing, whole, rests


def _differences(
    run: Trajectory, kernel: Kernel, known: Mapping[str, int], whole: Array, rests: Array
) -> dict[str, Array]:
    """Return the differences by body, (n, 3), km."""
    names = run.system.names
    q = np.asarray(run.q.to_value(u.km))

    def here(name: str, centre: str) -> Array:
        return np.asarray(q[:, names.index(name)] - q[:, names.index(centre)])

    found: dict[str, Array] = {}
    for name, number in known.items():
        geocentric = name == "Moon" and "Earth" in names
        centre = EARTH if geocentric else SUN
        there = kernel.relative(number, centre, whole, rests)
        found[name] = here(name, "Earth" if geocentric else "Sun") - there
    if {"Earth", "Moon"} <= found.keys() and TOGETHER not in found:
        earth, moon = ephemeris.gm(["Earth", "Moon"])
        share = moon / (earth + moon)
        order = list(found)
        found[TOGETHER] = found["Earth"] + share * found["Moon"]
        order.insert(order.index("Moon") + 1, TOGETHER)
        found = {name: found[name] for name in order}
    return found


def split(against: str) -> tuple[str, list[str]]:
    """Return the peers and the ephemerides of a text with commas, such as "de440,whfast:corrector=17", these once."""
    pieces = [piece.strip() for piece in against.split(",")]
    kernels = [*dict.fromkeys(piece for piece in pieces if is_kernel(piece))]
    return ",".join(piece for piece in pieces if piece not in kernels), kernels
