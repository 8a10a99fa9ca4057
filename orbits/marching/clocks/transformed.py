"""Constant steps of transformed time tau, dt = g dtau, with the dynamical time g of the bodies as the monitor.

The method marches the Lagrangian L~(q, q') = q'.M q' / (2 g) - g (V - E0), which has the same orbits at the energy E0
of the start: it is symplectic at equal tau, while the steps in t are as short as the closest pair needs.

A step is taken before it is known when it ends. One that would pass the goal of the march is taken back; where the
march must end at the goal, for a sample on a copy, the method takes the part of the step at whose end t is the goal.

Source: Hairer, Lubich & Wanner (2006), sec. VIII.2.1; Leimkuhler & Reich (2004), sec. 9.2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from orbits.errors import ConvergenceError, InputError, IntegrationError, shown
from orbits.forces.base import BoundForce
from orbits.integrators.base import Integrator
from orbits.integrators.collocation.transformed_bodies import TransformedBodies
from orbits.integrators.collocation.variational import VariationalRungeKutta
from orbits.integrators.forms import Array, Form
from orbits.kernels.binding import Tag
from orbits.kernels.compile import kernel
from orbits.kernels.lanes import WIDTH
from orbits.kernels.steps import BEYOND, NOT_CONVERGED, OK, TOO_SHORT, elapsed, part, prepare, step
from orbits.kernels.sums.summation import two_sum
from orbits.lagrangians.base import SEPARABLE, Lagrangian
from orbits.marching.clocks.variable_steps import (
    DIRECTION,
    EXACT,
    FARTHEST,
    LENGTH,
    LIMIT,
    NEXT,
    TIME,
    TIME_LO,
    ChangingSteps,
    ChosenTimes,
    is_number,
    keep,
    put_back,
    step_of,
)
from orbits.point_masses import PointMasses

STEP = 3
"""The own number of this clock: the step of tau, with the sign of the direction."""

SHORTEST = 2.0**-90
"""The fraction of the time reached below which a step ends the march: only bodies that collide come so close."""


@kernel(inline=True)
def take_step(clock, method, model, k, state, storage):
    """Take a step, if it ends before the limit; or the part of it that ends there."""
    numbers, room = clock.numbers, clock.room
    kept = room.shape[0] - 4 * state.q.shape[0] - WIDTH * storage.carry.shape[0]
    direction, whole = numbers[DIRECTION], numbers[STEP]
    left = (numbers[LIMIT] - numbers[TIME]) - numbers[TIME_LO]
    if direction * left <= 0.0:
        return BEYOND, 0, 0
    keep(room, kept, state, storage.carry)
    prepare(method, whole, whole, storage)
    status, where, evaluations = step(method, model, numbers[TIME], whole, state, storage)
    dt, dt_lo = elapsed(method, state, storage)
    if status == OK and direction * ((dt - left) + dt_lo) > 0.0:
        put_back(room, kept, state, storage.carry)
        if numbers[EXACT] == 0.0:
            numbers[NEXT] = min(max(numbers[TIME] + dt, -FARTHEST), FARTHEST)
            return BEYOND, 0, evaluations
        status, where, count = part(method, model, numbers[TIME], left, state, storage)
        evaluations += count
        dt, dt_lo = left, 0.0
    if status == OK and not abs(dt) > SHORTEST * abs(numbers[TIME]):
        status, where = TOO_SHORT, 0
    if status != OK:
        put_back(room, kept, state, storage.carry)
        return status, where, evaluations
    time, lost = two_sum(numbers[TIME], dt)
    numbers[TIME], numbers[TIME_LO] = two_sum(time, lost + (dt_lo + numbers[TIME_LO]))
    numbers[NEXT], numbers[LENGTH] = numbers[TIME], dt
    room[k + 1], room[kept // 3 + k], room[2 * (kept // 3) + k] = room[k] + dt, dt, dt_lo
    return OK, 0, evaluations


TRANSFORMED = Tag("transformed-time", {"step_of": step_of, "take_step": take_step})

LONGEST = 2.0
"""The longest step of tau: beyond, no orbit is resolved."""

MOST_AMPLIFIED = 100.0
"""How much larger than in the forces themselves rounding errors may be."""


@dataclass(frozen=True)
class TimeTransformed(ChangingSteps):
    """Constant steps of transformed time: symplectic, while steps in time are as short as close bodies need.

        orbits.propagate(system, dt=orbits.TimeTransformed(step=0.3), duration=10 * u.yr)

    step : of tau, with dt = g dtau and g = (sum over pairs of G (m_i + m_j) / r_ij^3)^(-1/2), the dynamical time of the
        bodies; a pure number. An orbit of e = 0.9 takes 24 steps of 0.38, one of e = 0.9999 36 steps of 0.5
    direction : 1 forwards in time, -1 backwards; set by the run

    For a few massive bodies of comparable masses, near-collisions above all, and Gauss or another variational
    Runge–Kutta method of at most 8 stages; others leave dt out. Raises InputError for a step that is not a positive
    number, or longer than 2.
    """

    step: float = 0.3
    direction: float = field(default=1.0, init=False, repr=False)

    timing: ClassVar[Tag] = TRANSFORMED
    refined_by: ClassVar[str] = "step of transformed time"

    def __post_init__(self) -> None:
        step = self.step
        if not is_number(step):
            raise InputError(
                f"step is {shown(step)}; expected a number such as 0.3: transformed time is counted in dynamical times "
                "of the bodies and has no unit."
            )
        if not 0.0 < step <= LONGEST:
            raise InputError(
                f"step is {shown(step)}; expected a positive number up to {LONGEST:g}, such as 0.3. For a run "
                "backwards give a negative duration."
            )
        object.__setattr__(self, "step", float(step))

    def finer(self, integrator: Any, factor: float) -> TimeTransformed:
        """Return the clock of steps of transformed time of `factor` times this length."""
        return TimeTransformed(factor * self.step).towards(self.direction)

    def check(self, integrator: Integrator) -> None:
        """Raise InputError, naming suitable methods, for a method that cannot march in transformed time."""
        if not isinstance(integrator, VariationalRungeKutta) or integrator.tableau.stages > WIDTH:
            raise InputError(
                f"{integrator.label} cannot march in transformed time, where velocities and positions depend on each "
                f"other; variational Runge–Kutta methods of at most {WIDTH} stages can. Use Gauss(stages=8), or give "
                "dt=... a length."
            )

    def failure(
        self, status: int, integrator: Integrator, names: Sequence[str], *, momenta: bool, forces: bool
    ) -> tuple[type[IntegrationError], str] | None:
        """Return the error for stages that did not converge, or for steps none of which is short enough."""
        if status != NOT_CONVERGED:
            return super().failure(status, integrator, names, momenta=momenta, forces=forces)
        return ConvergenceError, (
            f"the stages of {integrator.name} did not converge for {', '.join(names)}; the result would not be "
            f"symplectic. Use a smaller step than {self.step:g}: dt=orbits.TimeTransformed(step=...)."
        )

    def own_form(
        self, integrator: Any, lagrangian: Lagrangian, forces: Sequence[BoundForce], *, with_particles: bool
    ) -> Form:
        """Return the form for bodies in transformed time. Raises InputError for what it has no place for."""
        more = [f"the force of {force.name}" for force in forces]
        more += [f"the term '{term.name}'" for term in getattr(lagrangian, "summands", ())]
        if more:
            raise InputError(
                f"transformed time is for bodies that attract each other and nothing else, so far, not with {more[0]}. "
                + ("Give dt=... a length." if forces or SEPARABLE not in lagrangian.traits else "Leave dt out.")
            )
        if with_particles:
            raise InputError(
                "massless particles have no part in the energy that transformed time needs, and would be moved by its "
                "rounding errors alone: leave dt out, or leave the particles out."
            )
        return TransformedBodies(integrator.tableau)

    def step_times(self, start: float) -> TransformedTimes:
        """Return what tells a leg when its steps are."""
        return TransformedTimes(self, start)

    def check_bodies(self, strength: Array, bodies: PointMasses, names: Sequence[str]) -> None:
        """Raise InputError for massive bodies that are too light, or too few.

        strength : of these, see `orbits.kernels.gravity.pair_sums`; bodies, names : all, with massless ones
        """
        massive = np.flatnonzero(bodies.massive)
        q, v = bodies.q[massive], bodies.v[massive]
        if len(q) < 2:
            raise InputError(
                f"transformed time is counted in dynamical times of pairs of massive bodies; this system has {len(q)}. "
                "Leave dt out, or give it a length."
            )
        amplified = rounding_amplified(strength, q, v)
        worst = int(np.argmax(amplified))
        if not amplified[worst] <= MOST_AMPLIFIED:
            raise InputError(
                f"{names[massive[worst]]} is too light for transformed time: rounding errors of the energy of the "
                f"whole system, divided by its mass, would act on it with {amplified[worst]:,.0f} times those of its "
                f"own force (at most {MOST_AMPLIFIED:g} are accepted). Leave dt out: steps are then chosen one by one."
            )

    def numbers_for(self, integrator: Any) -> Array:
        """Return the state of the clock at the start of a march."""
        numbers = super().numbers_for(integrator)
        numbers[STEP] = self.step * self.direction
        return numbers

    def describe(self, integrator: Any, unit: object = "") -> str:
        """Return the steps of a method in words."""
        return f"steps of {self.step:g} in transformed time"


class TransformedTimes(ChosenTimes):
    """When steps of transformed time are, whose lengths come out in doubled precision."""

    def note(self, count: int, numbers: Array) -> None:
        """Take note of a block of `count` steps, and of its lengths with their low parts."""
        super().note(count, numbers)
        first = 2 * (self._block + 1)
        self._lows = self._room[first : first + count].copy()


def rounding_amplified(strength: Array, q: Array, v: Array) -> Array:
    """Return, for each body, the rounding error of (H - E0) grad g / m as a multiple of that of g a, (n,).

    The rounding error of H is that of its terms, which is divided by the mass of a body that may have no part in them;
    that of g a is that of the attractions, which may cancel.
    """
    gm, n = strength[1:], len(q)
    apart = q[None] - q[:, None]
    r2 = np.sum(apart**2, axis=2) + strength[0] + np.eye(n)
    away = 1.0 - np.eye(n)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        pulls = away / r2**1.5
        rates = pulls * (gm[:, None] + gm[None])
        steep = np.linalg.norm(np.einsum("ij,ijk->ik", 3.0 * rates / r2, apart), axis=1)
        gross = (pulls * np.linalg.norm(apart, axis=2)) @ gm
        energy = 0.5 * float(gm @ np.sum(v**2, axis=1)) + 0.5 * float(np.sum(away * np.outer(gm, gm) / np.sqrt(r2)))
        rate = 0.5 * float(np.sum(rates))
        amplified = 0.5 * steep / rate * energy / (gm * gross)
    return np.where(np.isfinite(amplified), amplified, 0.0)
