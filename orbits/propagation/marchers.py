"""Marchers made from systems, their restoration from checkpoints, and the provenance of the bits of a run."""

from __future__ import annotations

import platform
from collections.abc import Mapping
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbits._version import __version__
from orbits.archive.ended import ENDED
from orbits.archive.pace import PACE
from orbits.checks import whole_number
from orbits.errors import ArchiveError, InputError
from orbits.integrators import named
from orbits.integrators.base import Integrator
from orbits.kernels.compile import cpu_features, cpu_name
from orbits.kernels.compile.source_hash import source_stamp
from orbits.lagrangians.newtonian import newtonian, parameters
from orbits.marching.clocks.clock import Clock
from orbits.marching.clocks.constant import clock_of
from orbits.marching.legs.excursions.planet_excursions import Legs, PlanetExcursions
from orbits.marching.legs.leg import Leg, available_threads
from orbits.marching.legs.march import March
from orbits.marching.legs.problem import Ends, Problem
from orbits.point_masses import PointMasses
from orbits.propagation.control.stop_conditions import Conditions
from orbits.propagation.events.log import EVENTS, PARTICLE_EVENTS
from orbits.propagation.resuming.sample_store import ACCOUNTS
from orbits.system import System
from orbits.system.derived import derived
from orbits.system.model import Model, model, require_newtonian
from orbits.trajectory.changes import CHANGES, COUNTS

BITS_DEPEND_ON = ("cpu_features", "kernel_sources", "numba", "llvmlite")
"""Entries of the provenance that must agree for a resumed run to give the same bits."""

WORK = "change_work"
"""The array of a checkpoint for what forces did in earlier legs of a run whose bodies change."""

PASSAGES = frozenset({"passages", "passage_counts"})
"""Arrays of a checkpoint that list the passages of a march."""

RETIRED = frozenset({"retired"})
"""The array of a checkpoint that lists the retired particles."""

LIGHT = 1e-36
"""The mass of a followed body as a fraction of the lightest massive one: it moves no last bit of any."""


def bound(
    system: System,
    integrator: Integrator,
    clock: Clock | float,
    threads: int | None = None,
    conditions: Conditions | None = None,
    state: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None,
    start: float = 0.0,
    radii: NDArray[np.float64] | None = None,
    dense: bool = False,
    underway: bool = False,
    stops: NDArray[np.float64] | None = None,
    approaches: bool | None = None,
) -> Legs:
    """Return `system` bound to `integrator` and a clock, with massive bodies and massless particles separated.

    state : q and v, (n, 3) floats, if the march begins in another state than that of the system
    start : the time since the epoch at which it begins
    radii : (n,), if it ends where two bodies may come closer than the sum of theirs
    dense : whether the motion within its steps is recorded, block by block
    underway : whether the state is one of a run that is over, which decided which particles are retired in encounters
    stops : the pairs for which it stops; see `Leg`
    approaches : as in `propagate`

    Raises InputError if the integrator does not support the terms and forces of the system.
    """
    integrator = named(integrator)
    threads = available_threads() if threads is None else whole_number(threads, "threads, if given,")
    if conditions is not None and conditions.energy < np.inf:
        require_newtonian(system, "EnergyErrorAbove")
    bodies = system.values if state is None else system.values._replace(q=state[0], v=state[1])
    acting = derived(system, model)
    acting.check()
    surfaces = None if system.radii is None else np.asarray(system.radii.value)
    marcher = march_of(
        bodies,
        integrator,
        clock,
        acting,
        start=start,
        dense=dense,
        underway=underway,
        names=system.names,
        threads=threads,
        approaches=looks_for_approaches(approaches, integrator, system),
        ends=Ends(stops, None if conditions is None or conditions.energy == np.inf else conditions.energy, radii),
        surfaces=surfaces if integrator.in_encounters.follow_particles else None,
    )
    if state is None:  # a march from a state of a run must not be refused where the run itself was not
        for term in system.terms:
            term.check_start(system)
        marcher.clock.check_bodies(marcher.problem.strength, bodies, system.names)
    return marcher


def march_of(
    bodies: PointMasses,
    integrator: Integrator,
    clock: Clock | float,
    acting: Model | None = None,
    approaches: bool | None = None,
    **options: Any,
) -> Legs:
    """Return bodies bound to a method and a clock or a step, with `retire` set: a massless particle that cannot be
    stepped is retired alone. The options are those of `Leg`.

    acting : the model of these bodies, from `orbits.system.model.model`; None for Newton's gravity alone
    approaches : whether closest approaches are recorded; None for what the method does by default
    """
    gm, q, v, softening = bodies
    massive = bodies.massive
    lagrangian, vectors, forces = acting or Model(newtonian, parameters(gm[massive], softening), ())
    options["approaches"] = integrator.looks_for_approaches if approaches is None else approaches
    problem = Problem(
        lagrangian, integrator, vectors, massive, clock_of(clock), retire=True, forces=forces, **options
    )
    return PlanetExcursions(problem, q, v) if integrator.in_encounters.follow_planets else Leg(problem, q, v)


def with_light(system: System, particles: tuple[int, ...]) -> tuple[System, NDArray[np.bool_]]:
    """Return the massive bodies of a system and these particles, with a mass, and which of all bodies these are."""
    there = system.massive.copy()
    there[list(particles)] = True
    gone = [name for name, stays in zip(system.names, there, strict=True) if not stays]
    left = system.remove(*gone) if gone else system
    gm = left.values.gm.copy()
    gm[gm == 0.0] = LIGHT * gm[gm > 0.0].min()
    return left.replaced(gm=gm), there


def looks_for_approaches(asked: bool | None, integrator: Integrator, system: System) -> bool:
    """Return whether a run records closest approaches; asked : as in `propagate`."""
    return integrator.looks_for_approaches or bool(system.rigid) if asked is None else asked


def restore(marcher: March, checkpoint: Mapping[str, NDArray[Any]], path: str | PathLike[str]) -> None:
    """Restore the checkpoint of the archive at `path` in a marcher of its run.

    Raises ArchiveError if the checkpoint does not belong to this run.
    """
    expected = {name: (array.dtype, array.shape) for name, array in marcher.checkpoint().items()}
    beside = {ACCOUNTS, ENDED, PACE, *EVENTS, *PARTICLE_EVENTS}
    found = {name: (array.dtype, array.shape) for name, array in checkpoint.items() if name not in beside}
    for later in (PASSAGES, RETIRED):  # missing in runs of earlier versions
        if not found.keys() & later:
            expected = {name: kind for name, kind in expected.items() if name not in later}
    wrong = [name for name in sorted(expected.keys() | found.keys()) if expected.get(name) != found.get(name)]
    if wrong:
        raise ArchiveError(
            f"{path}: the checkpoint is not one of this run, {wrong[0]!r} does not fit. The samples can be read, but "
            "the run cannot be resumed; it may come from another version of orbits."
        )
    if min(checkpoint["counts"]) < 0:
        raise ArchiveError(f"{path} is damaged: its checkpoint counts {checkpoint['counts'].tolist()} steps.")
    try:
        marcher.restore(checkpoint)
    except InputError as error:
        raise ArchiveError(f"{path} is damaged: {error}") from error


def unchanged(checkpoint: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Return the checkpoint of a run whose massive bodies could have changed, but did not, as that of a plain march."""
    return {name: array for name, array in checkpoint.items() if name not in (CHANGES, COUNTS, WORK)}


def provenance() -> dict[str, str]:
    """Return the versions and the processor on which the bits of a run depend."""
    import h5py
    import llvmlite
    import numba

    return {
        "orbits": __version__,
        "kernel_sources": source_stamp(),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "numba": numba.__version__,
        "llvmlite": llvmlite.__version__,
        "h5py": h5py.__version__,
        "platform": platform.platform(),
        "cpu_name": cpu_name(),
        "cpu_features": " ".join(sorted(cpu_features())),
    }


def differences(recorded: Any) -> list[str]:
    """Return descriptions of the changes since `recorded` was written that affect the bits."""
    now = provenance()
    found = []
    for key in BITS_DEPEND_ON:
        if recorded.get(key) != now[key]:
            brief = key in ("cpu_features", "kernel_sources")
            found.append(key.replace("_", " ") if brief else f"{key} {recorded.get(key)} -> {now[key]}")
    return found
