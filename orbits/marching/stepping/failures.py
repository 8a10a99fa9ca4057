"""Steps that cannot be taken: how they are located, and their messages."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from orbits.errors import ConvergenceError, IntegrationError, SingularityError
from orbits.integrators.base import Integrator
from orbits.kernels.steps import INNER_NOT_CONVERGED, NO_MULTIPLIERS, NOT_CONVERGED, NOT_REGULAR
from orbits.marching.clocks.clock import Clock
from orbits.marching.watching.kepler_passages import HILL_RADII

Array = NDArray[np.float64]


def last_good(is_good: Callable[[int], bool], bad: int, good: int = 0) -> int:
    """Return the last number that is good before one that is bad, by bisection between `good` and `bad`."""
    while bad - good > 1:
        middle = (good + bad) // 2
        if is_good(middle):
            good = middle
        else:
            bad = middle
    return good


def meeting(q: Array, body: int | None) -> list[int]:
    """Return a body and its nearest neighbour, or the two closest of all; q : (3, n)."""
    n = q.shape[1]
    if n == 1:
        return [0]
    bodies = np.arange(n) if body is None else np.array([body])
    distance = np.stack([np.sum((q - q[:, [b]]) ** 2, axis=0) for b in bodies])
    distance[np.arange(len(bodies)), bodies] = np.inf
    nearest = int(np.argmin(np.min(distance, axis=1)))
    return [int(bodies[nearest]), int(np.argmin(distance[nearest]))]


def refused_meeting(
    step: int, time: float, names: Sequence[str], distance: float, integrator: Integrator
) -> SingularityError:
    """Return the error for two planets that come too close to each other in the step after `step` steps."""
    one, other = names
    return SingularityError(
        f"step {step + 1} (t = {time:.10g}): {one} passes {other} at {distance:.6g}, within {HILL_RADII:.0f} mutual "
        f"Hill radii, where {integrator.name} does not follow them; encounters='refuse' ends the run there. Go on, or "
        "begin again, by Gauss(stages=8), the default, without dt: steps are then chosen one by one.",
        step=step,
        time=time,
        bodies=names,
    )


def failure_of_bodies(
    status: int,
    step: int,
    time: float,
    clock: Clock,
    integrator: Integrator,
    names: Sequence[str],
    *,
    momenta: bool = False,
    forces: bool = False,
) -> IntegrationError:
    """Return the error for bodies that cannot take the step after `step` steps, at this time.

    momenta : whether a term adds to the momenta m v; forces : whether there are forces without a Lagrangian
    """
    where = f"step {step + 1} ({clock.at(time)})"
    kind: type[IntegrationError] = SingularityError
    own = clock.failure(status, integrator, names, momenta=momenta, forces=forces)
    whom = f" of {', '.join(names)}" if names else ""
    why = (
        f"the state{whom} is no longer finite; two bodies met, or dt is far too long. Use a smaller dt, "
        f"or {integrator.instead_of_meeting}."
    )
    if status == INNER_NOT_CONVERGED:
        kind, why = ConvergenceError, (
            "the internal variables of a force, such as the spin of a body in tides, did not converge: they change "
            "faster than the step can follow. Use a smaller dt."
        )
    elif own is not None:
        kind, why = own
    elif status == NOT_REGULAR:
        why = f"the equations{whom} have no solution there. Use a smaller dt, or start elsewhere."
    return kind(f"{where}: {why}", step=step, time=time, bodies=list(names))


def failure_of_coordinates(
    status: int,
    step: int,
    time: float,
    where: str,
    integrator: Integrator,
    *,
    newton: bool,
    transformed: bool,
    reason: str | None = None,
) -> IntegrationError:
    """Return the error for the coordinates of a Lagrangian.

    where : step, time and state, for the message
    newton : whether Newton's method was tried
    transformed : whether the Lagrangian is one of transformed time
    reason : why equations that did not converge have no solution, if the method knows
    """
    if reason is not None:
        return ConvergenceError(f"{where}: {reason}", step=step, time=time)
    monitor = " Or the monitor vanishes there, where time stands still: choose one that is positive all the way."
    if status == NOT_CONVERGED:
        tried = "neither by fixed point nor by Newton's method" if newton else "by fixed point"
        return ConvergenceError(
            f"{where}: the stages of {integrator.label} did not converge, {tried}; the result would not be "
            "symplectic. Use a smaller dt." + transformed * monitor,
            step=step,
            time=time,
        )
    if status == NOT_REGULAR:
        return SingularityError(
            f"{where}: the matrix d2L/dv dv has no inverse, so momenta do not determine velocities. Use "
            "coordinates that are regular there, or start elsewhere.",
            step=step,
            time=time,
        )
    if status == NO_MULTIPLIERS:
        return ConvergenceError(
            f"{where}: the step leads so far from the constraints that no multipliers bring it back to them, or to "
            "where they are dependent: G M^-1 G^T, G being their gradients, has no inverse. Use a smaller dt; if that "
            "does not help, avoid this configuration.",
            step=step,
            time=time,
        )
    return SingularityError(
        f"{where}: the state is no longer finite; the motion met a singularity, or dt is far too long. Use a "
        "smaller dt." + transformed * monitor,
        step=step,
        time=time,
    )
