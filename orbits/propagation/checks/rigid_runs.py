"""Runs of systems with rigid bodies: their default method, and what is refused before they begin."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from orbits.errors import InputError, StepWarning, with_unit
from orbits.finding import Finding
from orbits.integrators.base import Integrator
from orbits.integrators.gauss import Gauss
from orbits.propagation.checks.step_check import in_digits
from orbits.system import System
from orbits.system.rigid_body import RIGID

if TYPE_CHECKING:
    from orbits.results.passages import Seen
    from orbits.time_grid import TimeGrid
    from orbits.trajectory import Trajectory

USUAL = Gauss()
"""The method of most runs for which none is given."""

FEWEST = 8
"""Steps in a rotation of a rigid body: fewer do not sample its torques, which repeat twice in a rotation."""


def default_method(*systems: System) -> Integrator:
    """Return the method of runs for which none is given: kicks and drifts of order 8 if bodies are rigid."""
    if not any(is_rigid(system) for system in systems):
        return USUAL
    from orbits.integrators.composition import Composition

    return Composition(order=8)


def is_rigid(system: System) -> bool:
    """Return whether a system has rigid bodies."""
    return bool(system.forces) and any(force.kind == RIGID for force in system.forces)


def check_rigid(system: System, grid: TimeGrid) -> None:
    """Raise InputError for rigid bodies that overlap another body, and for steps that are chosen."""
    if not is_rigid(system):
        return
    if grid.clock.changes:
        raise InputError(
            "a run with rigid bodies needs steps of one length: give dt=..., short beside the shortest orbital period "
            "and beside a rotation of each rigid body."
        )
    _check_overlaps(system)


def turning_fast(system: System, h: float) -> Iterator[Finding]:
    """Find whether a rigid body turns too far in a step of h."""
    if not is_rigid(system):
        return
    from orbits.system.rigid_bodies import angular_velocities

    fast = {name: float(np.linalg.norm(angular_velocities(*one))) for name, one in turnings(system).items()}
    name, rate = max(fast.items(), key=lambda item: item[1])
    if abs(h) * rate * FEWEST <= 2.0 * np.pi:
        return
    step, period = (in_digits(x, system.units.time, 3) for x in (abs(h), 2.0 * np.pi / rate))
    enough = in_digits(2.0 * np.pi / rate / FEWEST, system.units.time, 2)
    yield Finding(
        f"dt = {step} is {abs(h) * rate / (2.0 * np.pi):.2g} rotations of {name!r}, which turns in {period}. The "
        "rotation itself is exact, but the torques on it, and its pull on others, are seen at too few attitudes, and "
        f"its spin and the orbits change by wrong amounts; dt <= {enough} has {FEWEST} steps in a rotation.",
        StepWarning,
        "rotation too fast",
    )


def overlaps(run: Trajectory, seen: Seen) -> Iterator[Finding]:
    """Find whether a rigid body came so near to another body in a run that they may have touched."""
    system = run.system
    sizes, rigid = _sizes(system)
    met = [
        one
        for one in seen.passages
        if (one.body in rigid or one.other in rigid)
        and (system.massive[one.body] or system.massive[one.other])
        and one.distance < sizes[one.body] + sizes[one.other]
    ]
    if not met:
        return
    first = min(met, key=lambda one: abs(run.clock.time(one.steps)))
    one, other = (system.names[k] for k in (first.body, first.other))
    apart, reach = (
        in_digits(x, system.units.length, 3) for x in (first.distance, sizes[first.body] + sizes[first.other])
    )
    when = in_digits(run.clock.time(first.steps), system.units.time, 6)
    yield Finding(
        f"{one!r} and {other!r} came to {apart} of each other at t = {when}, but reach {reach} together, as "
        "homogeneous ellipsoids with their moments of inertia: they may have touched, and the second degree of gravity "
        "is not that of bodies so near. The rest of the run is not to be trusted for them.",
        StepWarning,
        "bodies touch",
    )


def _sizes(system: System) -> tuple[Any, list[int]]:
    """Return how far each body reaches from its centre, 0 where it is not known, and the numbers of rigid ones."""
    sizes = np.zeros(len(system)) if system.radii is None else np.array(system.radii.value)
    rigid = []
    for name, body in turnings(system).items():
        rigid.append(system.index(name))
        sizes[rigid[-1]] = longest(body)
    return sizes, rigid


def _check_overlaps(system: System) -> None:
    """Raise InputError if a body is within a rigid one, as far as the size of that is known from its moments."""
    q = system.values.q
    sizes, rigid = _sizes(system)
    for i in rigid:
        others = np.flatnonzero(system.massive | system.massive[i])  # of two massless bodies neither feels the other
        distances = np.linalg.norm(q[others] - q[i], axis=-1)
        for j, distance in zip(others, distances, strict=True):
            if i != j and distance < sizes[i] + sizes[j]:
                apart, reach = (with_unit(f"{x:.6g}", system.units.length) for x in (distance, sizes[i]))
                raise InputError(
                    f"the rigid body {system.names[i]!r} overlaps {system.names[j]!r}: their centres are {apart} "
                    f"apart, and {system.names[i]!r} reaches {reach} from its own, as a homogeneous ellipsoid with its "
                    "moments of inertia; expected bodies apart from each other."
                )


def turnings(system: System) -> Any:
    """Return moments, attitude and spin of each rigid body, as `orbits.system.rigid_body.Turning`."""
    from orbits.system.rigid_bodies import rigid_bodies_of

    rigid = rigid_bodies_of(system)
    return {} if rigid is None else rigid.turning(system.units)


def longest(turning: Any) -> float:
    """Return the longest semi-axis of the homogeneous ellipsoid with these moments of inertia per unit of mass."""
    j = turning.moments
    return float(np.sqrt(max(0.0, 2.5 * (j.sum() - 2.0 * j.min()))))
