"""What a leg marches: the bodies, what acts on them, the method, and what is asked for along the way."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbits.forces.base import BoundForce
from orbits.integrators.base import Integrator
from orbits.integrators.forms import Array, Form
from orbits.kernels.binding import Tag
from orbits.kernels.gravity.terms_and_forces import acted_on
from orbits.lagrangians.base import GIVEN, NEWTONIAN, SEPARABLE, Lagrangian
from orbits.marching.clocks.clock import Clock
from orbits.marching.stepping.choice_of_form import form_of_bodies


class Ends(NamedTuple):
    """What ends a leg besides what it cannot follow.

    stops : (conditions, 4), see `orbits.kernels.search.stopping`, with rows numbered in the order of the caller: the
        leg stops after each step in which a pair may come to its bound, until it is told to `pass_by`
    energy_bound : relative energy error that ends the leg
    radii : (n,), of the bodies: a leg then ends after a step in which two may have come closer than their sum
    """

    stops: Array | None = None
    energy_bound: float | None = None
    radii: Array | None = None


NO_ENDS = Ends()


@dataclass(frozen=True, eq=False)
class Problem:
    """The problem of a leg: a frozen value.

    lagrangian, integrator : the problem and the method
    parameters : vector of the Lagrangian's kernels, for the massive bodies; for a sum of terms a tuple, Newton's first
    massive : (n,) bool; which bodies are massive
    clock : the times of the steps (see `orbits.marching.clocks.clock`)
    names : (n,) names for messages
    threads : how many threads massless particles, and thousands of massive bodies, may use
    ends : what ends the leg besides what it cannot follow
    retire : whether a massless particle that cannot be stepped is retired alone; otherwise it is an error
    forces : the forces without a Lagrangian, bound to these bodies
    start : the time at which the leg begins; with a clock whose steps differ, which counts from 0, that which terms
        and forces see when it reads 0
    dense : whether each step is recorded for `motion`
    surfaces : (n,), radii of the bodies, if massless particles that are followed in encounters, by steps of their own,
        are retired where they hit one
    underway : whether it begins in a state of a run that is over, which decided which particles are retired before
        encounters: here they are not, and may be in one
    approaches : whether closest approaches are looked for; passages that the steps may not resolve are in any case

    bodies, particles : the numbers of the massive bodies, in the order of the kernels, and of the massless particles
        among all, (massive,) and (particles,)
    strength : Newton's vector: the square of the softening, then GM of the massive bodies
    gm : GM of the massive bodies, then zeros of the particles, (n,)
    """

    lagrangian: Lagrangian
    integrator: Integrator
    parameters: Array | tuple[Array, ...]
    massive: NDArray[np.bool_]
    clock: Clock
    names: Sequence[str] = ()
    threads: int = 1
    ends: Ends = NO_ENDS
    retire: bool = False
    forces: Sequence[BoundForce] = ()
    start: float = 0.0
    dense: bool = False
    surfaces: Array | None = None
    underway: bool = False
    approaches: bool = True
    bodies: NDArray[np.intp] = field(init=False)
    particles: NDArray[np.intp] = field(init=False)
    strength: Array = field(init=False)
    gm: Array = field(init=False)

    def __post_init__(self) -> None:
        self.clock.check(self.integrator)
        massive = np.asarray(self.massive)
        bodies, particles = massive.nonzero()[0], (~massive).nonzero()[0]
        first = self.parameters[0] if isinstance(self.parameters, tuple) else self.parameters
        strength = np.ascontiguousarray(first)
        gm = strength[1 : 1 + len(bodies)]
        if len(particles):
            gm = np.concatenate([gm, np.zeros(len(particles))])
        # Not cached properties: all of it is asked of each problem, and their locks take longer.
        for name, value in (("bodies", bodies), ("particles", particles), ("strength", strength), ("gm", gm)):
            object.__setattr__(self, name, value)

    def but(self, **changes: Any) -> Problem:
        """Return the problem with some fields changed."""
        return replace(self, **changes)

    @property
    def surfaces_of_bodies(self) -> Array | None:
        """Radii of the massive bodies on which particles that take steps of their own may fall, (massive,), or None."""
        if self.surfaces is None or not len(self.particles):
            return None
        return np.asarray(self.surfaces, dtype=np.float64)[self.bodies]

    @cached_property
    def acting(self) -> tuple[Tag, Any]:
        """The tag and the vectors of all that acts, for compiled code."""
        if self.forces or SEPARABLE not in self.lagrangian.traits:
            return acted_on(self.lagrangian.tag, self.parameters, self.forces)
        return self.lagrangian.tag, self.parameters

    @cached_property
    def form(self) -> Form:
        """The form of the method that marches it. Raises InputError if there is none."""
        with_particles, given = len(self.particles) > 0, (self.integrator, self.lagrangian, self.clock)
        form = form_of_bodies(*given, with_particles=with_particles, forces=self.forces)
        if with_particles:
            all_given = not self.has_given or form.held(self.parameters) == len(self.bodies)
            self.clock.check_particles(self.forces, all_given=all_given)
        return form.for_bodies(len(self.bodies))

    @property
    def sees_all_steps(self) -> bool:
        """Whether the state at the end of each step is needed, whatever else is looked for."""
        return self.dense or self.ends.energy_bound is not None or self.integrator.in_encounters.follow_planets

    @property
    def exact(self) -> bool:
        """Whether a map on Kepler orbits is exact: about a body that is alone."""
        return len(self.bodies) == 1 and NEWTONIAN in self.lagrangian.traits

    @property
    def has_given(self) -> bool:
        """Whether the motion of bodies is given."""
        return GIVEN in self.lagrangian.traits

    @property
    def has_momenta(self) -> bool:
        """Whether a term adds to the momenta m v."""
        return SEPARABLE not in self.lagrangian.traits

    def name(self, body: int) -> str:
        """Return the name of a body, numbered as by the caller."""
        return self.names[body] if self.names else f"body {body}"
