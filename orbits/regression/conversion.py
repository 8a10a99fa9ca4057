"""Systems to REBOUND simulations and back, without changing a bit of the numbers."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from orbits.body_names import few
from orbits.checks import is_whole
from orbits.errors import ArchiveError, EpochError, InputError, shown
from orbits.finding import Finding
from orbits.point_masses import PointMasses
from orbits.regression import snapshot as snapshots
from orbits.regression.peers import simulation
from orbits.regression.snapshot import Array, Particles
from orbits.system import System
from orbits.system.model import require_newtonian
from orbits.system.state_checks import checked_units
from orbits.trajectory import Trajectory
from orbits.units import DIMENSIONLESS, SOLAR, UnitSystem, as_epoch

if TYPE_CHECKING:
    import rebound
    from astropy.time import Time

    from orbits.lagrangians.terms.base import Term

T = TypeVar("T")

GRAVITIES = ("basic", "compensated", "tree", "mercurius", "jacobi")
"""REBOUND's algorithms for the same Newtonian gravity."""

ADAPTIVE = ("ias15", "bs")
"""REBOUND's methods with adaptive steps."""

NAMED = "REBOUND "
"""Prefix of the names of unit systems made from those of a simulation."""

SAME_UNIT = 1e-9
"""By how much units may differ that are the same: REBOUND has fewer digits of some than astropy."""

SOLAR_UNITS = ("au", "d", "massist")
"""REBOUND's names of the units of `SOLAR`, in which GM is the mass; "massist" is its unit of mass that makes G = 1."""


def to_rebound(system: System | Trajectory, sample: int = -1) -> rebound.Simulation:
    """Return a `rebound.Simulation` with exactly the floats of `system`.

    system : a state, or a run, of which `sample` is taken, by default the last

    A system from `from_rebound` is converted back unchanged: G, units, masses and t are the simulation's, and for a
    run from there t increases with the run's time. States in the units of a simulation also keep its units and G.

    For other systems G is 1 and the mass of a particle is its GM, in the units of the system; t is 0 at the epoch, and
    the time since then in a run. The units of `SOLAR` are named ("au", "d", "massist"). Names, the softening length and
    known radii are kept. Massless bodies become test particles (`N_active`, `testparticle_type = 0`), and minor bodies
    (`MinorBodies`) those of type 1. REBOUND requires them at the end, so the other bodies come first, otherwise in the
    system's order. Integrator and step are REBOUND's defaults.

    Raises InputError for anything but a System or a Trajectory, a sample that does not exist, other terms and forces,
    and for massless bodies beside minor ones, which these would not attract in REBOUND.
    """
    time = 0.0
    if isinstance(system, Trajectory):
        if isinstance(sample, str | slice):
            raise InputError(f"sample is {shown(sample)}; expected the number of a sample, -1 for the last.")
        state: System = system[sample]
        time = float(system.times[sample]) + (system.system.t if isinstance(system.system, FromRebound) else 0.0)
    elif isinstance(system, System):
        state = system
        time = system.t if isinstance(system, FromRebound) else 0.0
    else:
        raise InputError(f"to_rebound got a {type(system).__name__}; expected a System or a Trajectory.")
    minor = _minor(state)
    gm, q, v, softening = state.values
    order = np.argsort((gm == 0) + minor.astype(int), kind="stable")
    names = [state.names[i] for i in order]
    units, G, m = _masses(state)
    sim = simulation(PointMasses(m[order], q[order], v[order], float(softening)), names)
    if units is not None:
        sim.update_units(units)
    sim.G = G  # to the last bit; of SOLAR from the units' own values it would be 26 units in the last place less
    sim.t = time
    if minor.any():
        sim.N_active, sim.testparticle_type = int(np.count_nonzero(~minor)), 1
    if state.radii is not None:
        radii = state.radii.value
        for particle, radius in zip(sim.particles, radii[order].tolist(), strict=True):
            particle.r = radius
    return sim


def _minor(state: System) -> NDArray[np.bool_]:
    """Return which bodies are minor ones, (n,). Raises InputError for other terms and forces, and for massless bodies
    beside minor ones, which in REBOUND they would not feel.
    """
    from orbits.lagrangians.terms.minor_bodies import MinorBodies

    pairs = [term for term in state.terms if isinstance(term, MinorBodies)]
    left = state.replaced(terms=[term for term in state.terms if term not in pairs]) if pairs else state
    require_newtonian(left, "a simulation of REBOUND")
    minor = np.isin(state.names, [name for term in pairs for name in term.bodies])
    if minor.any() and not state.massive.all():
        massless = [name for name, heavy in zip(state.names, state.massive, strict=True) if not heavy]
        raise InputError(
            f"the system has minor bodies and massless ones, {few(massless)}; in REBOUND test particles of one type do "
            "not attract each other, so these would not feel the minor bodies. Remove the ones or the others."
        )
    return minor


class FromRebound(System):
    """A `System` from a simulation, with its t and the masses of its particles.

    `replaced`, `add` and similar methods return a plain `System`.
    """

    __slots__ = ("_m", "_t")

    _m: Array
    _t: float

    @classmethod
    def of(cls, m: Array, t: float, *arguments: Any) -> FromRebound:
        """Return the system with these arguments of `System` in their order."""
        made = cls(*arguments)
        for attribute, value in (("_m", m), ("_t", t)):
            object.__setattr__(made, attribute, value)
        return made

    @property
    def t(self) -> float:
        """The time t of the state in the simulation."""
        return self._t

    @property
    def m(self) -> Array:
        """The masses m with gm = G m, (n,)."""
        return self._m

    def replaced(self, **changes: Any) -> Any:
        """Return a plain `System` with some values changed, as `System.replaced` does."""
        return System(**self._arguments()).replaced(**changes)

    def __reduce__(self) -> Any:
        return FromRebound.of, (self._m, self._t, *self._arguments().values())


def _masses(state: System) -> tuple[tuple[str, str, str] | None, float, Array]:
    """Return the names of REBOUND's units, G, and masses for which G m is exactly gm."""
    gm, units = state.values.gm, state.units
    if units == SOLAR:
        return SOLAR_UNITS, 1.0, gm
    _, _, given = units.name.partition(NAMED)
    names = cast("tuple[str, str, str]", tuple(given.split(", "))) if given else None
    try:
        made_here = _unit_system(names, units.G) == units
    except (KeyError, ValueError):
        made_here = False
    if made_here:
        near = gm / units.G
        tried = [near, np.nextafter(near, 0.0), np.nextafter(near, np.inf)]
        if isinstance(state, FromRebound):
            tried = [state.m]
        fits = np.array([units.G * m == gm for m in tried])
        if fits.any(axis=0).all():
            return names, units.G, np.choose(fits.argmax(axis=0), tried)
    return None, 1.0, gm


def from_rebound(
    source: rebound.Simulation | rebound.Simulationarchive | str | os.PathLike[str],
    *,
    units: UnitSystem | None = None,
    epoch: Time | str | float | None = None,
    zero: Time | str | float | None = None,
    snapshot: int = -1,
    time: float | None = None,
) -> System:
    """Return a `System` with the particles of a REBOUND simulation: gm = G m, the same q, v, softening and radii.

    source : a Simulation, a Simulationarchive, or the path of its file
    units : the unit system of the numbers, which are not converted. By default the simulation's own units if they are
        set, otherwise pure numbers: `DIMENSIONLESS` if G is 1, else a similar system with the simulation's G. ("au",
        "d", "massist") with G = 1 are `SOLAR`
    epoch : the epoch of the state, as simulations have none
    zero : instead, the epoch of t = 0, to which the simulation's t is added
    snapshot : the index in an archive, by default the last;  time : instead, the t of a snapshot

    Softening has the same formula, -gm/sqrt(r^2 + eps^2). Particles without a name are called "particle 0",
    "particle 1", ... by their index. If all radii are 0, the system has none. A simulation that is not synchronized is
    synchronized on a copy, and not changed.

    Test particles (beyond `N_active`) of type 0 attract nothing: they become massless, and an OrbitsWarning names those
    with a mass. Those of type 1 attract active particles but not each other: several of them, all with mass, become
    `MinorBodies`; a single one is like any other body; without mass they are massless. Collisions are not detected
    here, and functions of the user are not stored in files: an OrbitsWarning says so if a simulation had them.

    The axes are those of the simulation, in which REBOUND has its elements: elements(frame="system"). Among physical
    units and with a body "Sun" the default is another one, `System.frame`.

    Raises InputError for simulations that a System cannot represent: forces, gravity or boundaries other than Newton's
    in open space, variational particles, test particles of type 1 with mass beside massless ones, and everything that
    `System` refuses; ArchiveError for a file that is missing, foreign, damaged or from another version of REBOUND, or
    lacks the snapshot. Files are opened in a separate process, as a damaged one may crash it.
    """
    return _system(_particles(source, snapshot, time), units, epoch, zero)


def run_from_rebound(
    source: rebound.Simulationarchive | str | os.PathLike[str],
    *,
    units: UnitSystem | None = None,
    zero: Time | str | float | None = None,
) -> Trajectory:
    """Return a `Trajectory` of all snapshots of a REBOUND Simulationarchive, to be analysed like a run of this package.

    source, units, zero : as in `from_rebound`; times of the run count from the first snapshot

    Its integrator is only a label, such as "REBOUND ias15", so methods that need the integrator, `run.at` and
    `run.to_spk`, raise InputError. `run.dt` is REBOUND's step; IAS15 and BS, which have adaptive steps, have none.

    Raises as `from_rebound` does, and ArchiveError if particles are added or removed or change mass, or if time
    reverses.
    """
    import rebound

    def read() -> tuple[Particles, Array, Array, Array]:
        if isinstance(source, rebound.Simulationarchive):
            return snapshots.all_of_opened(source)
        if isinstance(source, str | os.PathLike):
            return snapshots.all_of_file(source)
        raise InputError(
            f"run_from_rebound got a {type(source).__name__}; expected a rebound.Simulationarchive or the path of its "
            "file."
        )

    found, times, q, v = _readable(read, source)
    system = _system(found, units, None, zero)
    made_by = MadeByRebound(f"REBOUND {found.integrator}")
    step = np.nan if found.integrator in ADAPTIVE else found.dt
    return Trajectory(system, times - times[0], q, v, step=step, integrator=cast(Any, made_by))


@dataclass(frozen=True)
class MadeByRebound:
    """The label of a run's method in REBOUND, in place of an integrator."""

    label: str


def _system(found: Particles, units: UnitSystem | None, epoch: Any, zero: Any) -> System:
    names = [name or f"particle {i}" for i, name in enumerate(found.names)]
    _refuse(found)
    attracting = found.m.copy()
    attracting[_massless(found, names) :] = 0.0
    terms = _rule(found, names)
    units = _units_of(found, units)
    when, radii = _epoch(found, units, epoch, zero), found.r if np.any(found.r) else None
    gm = found.G * attracting
    state = tuple(names), gm, found.q, found.v, when, units, radii, found.softening, terms
    return FromRebound.of(attracting, found.t, *state)


def _particles(source: Any, index: int, time: float | None) -> Particles:
    import rebound

    if isinstance(source, rebound.Simulation):
        if index != -1 or time is not None:
            raise InputError("a Simulation has one state only; snapshot= and time= choose from a Simulationarchive.")
        return _readable(lambda: snapshots.of_simulation(source), "the Simulation")
    if not is_whole(index):
        raise InputError(
            f"snapshot is {shown(index)}; expected the number of a snapshot, -1 for the last (time= takes a t)."
        )
    if time is not None and index != -1:
        raise InputError("snapshot and time are both given; expected one of them.")
    if time is not None and not (is_whole(time) or isinstance(time, float | np.floating)):
        raise InputError(f"time is {shown(time)}; expected a plain number, t as the simulation counts it.")
    index, time = int(index), None if time is None else float(time)
    if isinstance(source, rebound.Simulationarchive):
        return _readable(lambda: snapshots.of_opened(source, index=index, time=time), source)
    if isinstance(source, str | os.PathLike):
        return _readable(lambda: snapshots.of_file(source, index=index, time=time), source)
    raise InputError(
        f"from_rebound got a {type(source).__name__}; expected a rebound.Simulation, a rebound.Simulationarchive or "
        "the path of its file."
    )


def _readable(read: Callable[[], T], source: Any) -> T:
    """Return the result of reading a file. Raises ArchiveError, naming the file, if it cannot be read."""
    try:
        return read()
    except snapshots.UnreadableError as error:
        what = os.fspath(source) if isinstance(source, str | os.PathLike) else "the Simulationarchive"
        raise ArchiveError(f"{what}: {error}.") from error


def _refuse(found: Particles) -> None:
    if found.functions:
        what = " and ".join(name.replace("_", " ") for name in found.functions)
        raise InputError(f"the simulation has {what}; a System knows Newton's gravity only. Remove them.")
    if found.gravity not in GRAVITIES or found.integrator == "sei":
        what = f"gravity is {shown(found.gravity)}" if found.gravity not in GRAVITIES else "integrator is 'sei'"
        raise InputError(f"the simulation's {what}; a System has Newton's. Set 'basic' (or another integrator).")
    if found.boundary != "none":
        raise InputError(
            f"the simulation's boundary is {shown(found.boundary)}; a System lives in open space. Set 'none'."
        )
    if found.variations:
        raise InputError(
            f"the simulation has {found.variations} variational particles; a System has bodies only. Convert a "
            "simulation without them."
        )
    if found.forgotten:
        Finding(
            "the simulation was saved with functions of its own, such as forces, which its file does not hold; the "
            "System has Newton's gravity only."
        ).warn()
    if found.collision != "none":
        what = f"the simulation looks for collisions ({found.collision!r})"
        Finding(
            f"{what}; bodies of a System pass through each other, unless a run has events=Collision(then=Merge()), "
            "say, of orbits.events."
        ).warn()


def _massless(found: Particles, names: list[str]) -> int:
    """Return the number of attracting particles, which come first."""
    n = len(found.m)
    heavy = [i for i in range(found.active, n) if found.m[i] != 0.0]
    if found.test_type == 0:
        if heavy:
            Finding(
                f"{few([names[i] for i in heavy])}: test particles with mass, which attract nothing in REBOUND; here "
                "they are massless (gm = 0)."
            ).warn()
        return found.active
    if heavy and len(heavy) < n - found.active:
        i = heavy[0]
        raise InputError(
            f"{names[i]!r} is a test particle (index {i}, N_active = {found.active}) of type 1 with mass "
            f"{float(found.m[i])!r}: it attracts active particles but none of the other {n - found.active - 1} test "
            "particles, of which some are massless, and those of a System feel all masses. Set testparticle_type to 0, "
            "or raise N_active to let it attract all."
        )
    return n


def _rule(found: Particles, names: list[str]) -> tuple[Term, ...]:
    """Return the term of several test particles of type 1 with mass, which do not attract each other."""
    from orbits.lagrangians.terms.minor_bodies import MinorBodies

    several = found.test_type == 1 and len(found.m) - found.active > 1 and np.any(found.m[found.active :])
    return (MinorBodies(bodies=names[found.active :]),) if several else ()


def _epoch(found: Particles, units: UnitSystem, epoch: Any, zero: Any) -> Time | None:
    if zero is None:
        return None if epoch is None else as_epoch(epoch)
    if epoch is not None:
        raise EpochError("epoch and zero are both given; expected that of the state or that of t = 0.")
    if not units.is_physical:
        raise EpochError(f"zero is {zero}, but {units.name} has no unit of time. Leave it out, or say units=...")
    from astropy import units as u

    return as_epoch(zero, "zero") + u.Quantity(found.t, units.time)


def _units_of(found: Particles, given: UnitSystem | None) -> UnitSystem:
    """Return the given units, or those of the simulation. Raises InputError if its numbers are in other units."""
    own = SOLAR if found.units == SOLAR_UNITS and found.G == 1.0 else _unit_system(found.units, found.G)
    if given is None:
        return own
    if found.units and checked_units(given).is_physical:
        sizes = own.length.to(given.length), own.time.to(given.time)
        if not np.allclose(sizes, 1.0, rtol=0.0, atol=SAME_UNIT):
            raise InputError(
                f"units is {given.name}, of {given.length} and {given.time}, but the simulation is in "
                f"{', '.join(found.units)}; expected the same, as numbers are not converted. Leave out units, or "
                "convert before: sim.convert_particle_units('au', 'd', 'massist') makes the numbers those of SOLAR."
            )
    return given


def _unit_system(names: tuple[str, str, str] | None, G: float) -> UnitSystem:
    """Return the unit system of a simulation with units of these names, or none, and this G."""
    if names is None:
        plain = DIMENSIONLESS
        if G == 1.0:
            return plain
        return UnitSystem(name=f"G = {shown(G)}", length=plain.length, time=plain.time, mass=plain.mass, G=G)
    from astropy import units as u
    from rebound import units as table

    length, time, mass = names
    return UnitSystem(
        name=NAMED + ", ".join(names),
        length=_unit(table.lengths_SI[length], u.m, (u.m, u.cm, u.km, u.au)),
        time=_unit(table.times_SI[time], u.s, (u.s, u.hr, u.day, u.yr)),
        mass=_unit(table.masses_SI[mass], u.kg, (u.kg, u.g)),
        G=G,
    )


def _unit(size: float, si: Any, known: tuple[Any, ...]) -> Any:
    """Return the unit of this size, a named one if it is exactly equal."""
    return next((unit for unit in known if unit.to(si) == size), size * si)
