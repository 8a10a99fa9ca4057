"""Systems to REBOUND simulations and back, without changing a bit of the numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from orbits.errors import InputError
from orbits.regression.peers import Start, simulation
from orbits.system import System
from orbits.units import DIMENSIONLESS, UnitSystem

if TYPE_CHECKING:
    import rebound
    from astropy.time import Time

_EVERY_BODY = np.iinfo(np.uintp).max  # REBOUND's N_active when all particles attract


def to_rebound(system: System) -> rebound.Simulation:
    """A `rebound.Simulation` that holds exactly the floats of `system`.

    G is 1 and the mass of a particle is its GM, in the units of the system; t is 0 at the epoch. Names and the
    softening length are kept, radii where the system has them. Massless bodies are test particles (`N_active`,
    `testparticle_type = 0`); REBOUND wants them last, so massive bodies come first, otherwise in the system's order.
    Integrator and step are REBOUND's defaults.
    """
    gm, q, v, softening = system.values
    order = np.argsort(gm == 0, kind="stable")
    names = [system.names[i] for i in order]
    sim = simulation(Start(gm[order], q[order], v[order], float(softening)), names)
    if system.radii is not None:
        radii = system.units.length_value(system.radii, what="radii")
        for particle, radius in zip(sim.particles, radii[order].tolist(), strict=True):
            particle.r = radius
    return sim


def from_rebound(
    sim: rebound.Simulation, *, units: UnitSystem | None = None, epoch: Time | str | float | None = None
) -> System:
    """A `System` with the particles of `sim`: gm = G m, the same positions, velocities, softening and radii.

    units : the unit system that the numbers are in. By default `sim.units` where they are set, and otherwise pure
        numbers: `DIMENSIONLESS` when G is 1, else its like with the simulation's G. A simulation made by `to_rebound`
        carries no units, so say `units=orbits.SOLAR` to come back to the system it was made from, bit for bit.
    epoch : the epoch of the state that the simulation is in now; REBOUND knows none.
    Particles without a name are called "particle 0", "particle 1", ... by their index. A simulation whose steps are
    not synchronized is synchronized on a copy; `sim` itself is left as it is.

    Raises InputError for what a System cannot be: test particles with mass (beyond `N_active`), no gravity, forces or
    boundaries other than Newton's, and for whatever `System` refuses.
    """
    if not sim.is_synchronized:
        sim = sim.copy()
        sim.integrator.keep_unsynchronized = 0
        sim.synchronize()
    n = int(sim.N)
    m, radii, q, v = np.empty(n), np.empty(n), np.empty((n, 3)), np.empty((n, 3))
    if n:
        sim.serialize_particle_data(m=m, r=radii, xyz=q, vxvyvz=v)
    names = [particle.name or f"particle {i}" for i, particle in enumerate(sim.particles)]
    _refuse(sim, m, names)
    if units is None:
        units = _units_of(sim)
    return System(
        names=tuple(names),
        gm=float(sim.G) * m,
        q=q,
        v=v,
        epoch=epoch,
        units=units,
        radii=radii if np.any(radii) else None,
        softening=float(sim.softening),
    )


def _refuse(sim: Any, m: np.ndarray, names: list[str]) -> None:
    active = min(int(sim.N_active), len(m)) if int(sim.N_active) != _EVERY_BODY else len(m)
    heavy = [i for i in range(active, len(m)) if m[i] != 0.0]
    if heavy:
        i = heavy[0]
        raise InputError(
            f"{names[i]!r} is a test particle (index {i}, N_active = {active}) with mass {float(m[i])!r}; here a body "
            "that attracts nothing has no mass. Set its mass to 0, or let it attract by raising N_active."
        )
    if sim.gravity not in ("basic", "compensated", "tree", "jacobi"):
        raise InputError(f"the simulation's gravity is {sim.gravity!r}; a System has Newton's. Set 'basic'.")
    if sim.boundary != "none":
        raise InputError(f"the simulation's boundary is {sim.boundary!r}; a System lives in open space. Set 'none'.")
    if sim._additional_forces:
        raise InputError("the simulation has additional forces; a System knows Newton's gravity only. Remove them.")


def _units_of(sim: Any) -> UnitSystem:
    named = sim.units
    if all(named.values()):
        from astropy import units as u
        from rebound import units as table

        return UnitSystem(
            name="REBOUND " + ", ".join(named[kind] for kind in ("length", "time", "mass")),
            length=u.Unit(table.lengths_SI[named["length"]] * u.m),
            time=u.Unit(table.times_SI[named["time"]] * u.s),
            mass=u.Unit(table.masses_SI[named["mass"]] * u.kg),
            G=float(sim.G),
        )
    if sim.G == 1.0:
        return DIMENSIONLESS
    plain = DIMENSIONLESS
    return UnitSystem(name=f"G = {sim.G!r}", length=plain.length, time=plain.time, mass=plain.mass, G=float(sim.G))
