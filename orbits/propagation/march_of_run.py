"""The march of a run, by what its events may do to the bodies."""

from __future__ import annotations

import numpy as np

from orbits.errors import InputError
from orbits.integrators.base import Integrator
from orbits.marching.clocks.adaptive import Adaptive
from orbits.marching.clocks.clock import Clock
from orbits.marching.clocks.constant import ConstantSteps
from orbits.marching.legs.march import March
from orbits.propagation.control.stop_conditions import Conditions
from orbits.propagation.events.seeking import Seeking
from orbits.propagation.marchers import bound
from orbits.system import System


def march_of_run(
    system: System,
    integrator: Integrator,
    clock: Clock,
    threads: int | None,
    events: Seeking,
    conditions: Conditions | None = None,
    approaches: bool | None = None,
) -> March:
    """Return the march of a run of a system. Raises InputError for what cannot be sought together.

    approaches : as in `propagate`
    """
    if not events.touching and not events.act:
        stops = None if events.stops is None else events.stops.rows
        dense = bool(events.of_bodies)
        march = bound(system, integrator, clock, threads, conditions, dense=dense, stops=stops, approaches=approaches)
        events.check(march)
        return march
    if conditions is not None and conditions.distances:
        kind = type(conditions.distances[0]).__name__
        raise InputError(
            f"stop={kind}(...) looks at bodies that stay the same, but events may change them. Give it in events=, "
            "with then='stop', where any body means any with mass; or leave one of the two out."
        )
    if conditions is not None and conditions.energy < np.inf:
        raise InputError(
            "stop=EnergyErrorAbove(...) is tested in steps of the same bodies, but events may change them. End the run "
            "from callback=..., which has the state at each sample, or leave one of the two out."
        )
    if not isinstance(clock, Adaptive | ConstantSteps):
        raise InputError(
            "the bodies of a run change in the time of the system, not in transformed time: leave dt out, or give a "
            "step."
        )
    if events.touching and integrator.follows_kepler:
        raise InputError(
            f"collisions are sought in steps, which {integrator.label} leaves, or does not resolve, where bodies come "
            "close to each other. Use Gauss(stages=8), the default, without dt: steps are then chosen one by one."
        )
    from orbits.propagation.chain_of_legs import ChainOfLegs
    from orbits.propagation.collisions.bodies_of_run import BodiesOfRun
    from orbits.propagation.collisions.of_a_run import Collisions

    collisions = Collisions(system, events.touching) if events.touching else None
    bodies = BodiesOfRun(system, integrator, clock, threads, collisions, bool(events.of_bodies), approaches)
    chain = ChainOfLegs(bodies, events)
    events.check(chain.current)
    return chain
