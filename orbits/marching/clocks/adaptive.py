"""Steps that are chosen one by one: long in quiet phases, short in encounters, with errors at the level of round-off.

A step is h = theta g, where g is the dynamical time of the bodies, extrapolated by half a step; theta is controlled by
the error signal of the step just taken: the last Legendre coefficient of the forces, as a fraction w of the largest.
With s stages and f = (tolerance / w)^(1 / (s - 1)), a step with f < 3/4 is repeated with 0.95 f times its length;
otherwise theta is multiplied by f, but at most by 3/2.

The steps depend on the state alone, not on the samples: a march stops before the step that would pass its goal.
The method is then not symplectic, as the steps depend on the state; at the level of round-off, no energy drift is seen.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np

from orbits.errors import InputError, shown
from orbits.integrators.base import Integrator
from orbits.integrators.forms import Array, Form
from orbits.kernels.binding import Tag, dynamical_rate
from orbits.kernels.compile import kernel
from orbits.kernels.lanes import WIDTH, fma
from orbits.kernels.steps import BEYOND, OK, TOO_SHORT, end_late, prepare, signal, step
from orbits.kernels.sums.summation import two_sum
from orbits.marching.clocks.variable_steps import (
    DIRECTION,
    EXACT,
    FARTHEST,
    LENGTH,
    LIMIT,
    NEXT,
    NUMBERS,
    TIME,
    TIME_LO,
    ChangingSteps,
    is_number,
    keep,
    put_back,
    step_of,
)

THETA, TOLERANCE, POWER, LONGEST = 3, 4, 5, NUMBERS
"""The own numbers of this clock: theta, the tolerance, the power 1 / (s - 1), and the longest step (0: any length)."""

ALONE = 64.0
"""The longest step of a massive body alone, whose motion sets none, in units of time."""

LONGEST_OF_GIVEN = 8.0
"""The longest step of bodies whose motion is given, in days, at whose ends observers see them. Particles take this one,
or steps of their own within it: those of the asteroid belt would be resolved by 16 days too, in half the time, but an
observer that sees the Moon every 16 days does not know where it is in between."""

FIRST_THETA = 0.2

REFUSED, CAUTION, GROWTH = 0.75, 0.95, 1.5
LEAST, MOST = 0.3, 2.0
"""The f below which a step is repeated, the safety factor of its length, the largest growth of theta; its bounds."""

ATTEMPTS = 100

SMALLEST = 1e-9
"""The roots of smaller ratios of tolerance and error signal are taken to be the same."""


@kernel(inline=True)
def exponential(x):
    """Return e^x for |x| <= 1 within 0.2 %, which lengths of steps do not need better: its Padé approximant [2/2]."""
    even, odd = fma(x, x, 12.0), 6.0 * x
    return (even + odd) / (even - odd)


@kernel(inline=True)
def root(x, power):
    """Return x^power, for x > 0 and power = 1 / n, by two of Halley's iterations from 1; increasing with x.

    Within 4e-7 for roots of 0.95 ... 1.05 and n <= 16, within 0.3 % for those of 0.75 ... 1.3 and n <= 8; those further
    away come out nearer to 1. Unlike the power of the C library, it has the same bits everywhere.
    """
    n = 1.0 / power
    x = min(max(x, SMALLEST), 1.0 / SMALLEST)
    y = (n - 1.0 + (n + 1.0) * x) / (n + 1.0 + (n - 1.0) * x)
    whole = y
    for _ in range(1, int(n + 0.5)):
        whole *= y
    return y * ((n - 1.0) * whole + (n + 1.0) * x) / ((n + 1.0) * whole + (n - 1.0) * x)


@kernel(inline=True)
def take_step(clock, method, model, k, state, storage):
    """Take a step, if it ends before the limit; repeat it with shorter lengths until it resolves the forces."""
    numbers, room = clock.numbers, clock.room
    kept = room.shape[0] - 4 * state.q.shape[0] - WIDTH * storage.carry.shape[0]
    direction, theta, before = numbers[DIRECTION], numbers[THETA], numbers[LENGTH]
    left = (numbers[LIMIT] - numbers[TIME]) - numbers[TIME_LO]
    if numbers[TIME] + left == numbers[TIME]:
        return BEYOND, 0, 0
    rate, change = dynamical_rate(model.tag, model.parameters, state.q, state.p)
    scale, slope = math.inf, 0.0
    if rate > 0.0:
        scale = 1.0 / math.sqrt(rate)
        slope = -0.5 * direction * change * scale * scale * scale
    else:  # a body alone, among particles or under forces
        theta, scale = 1.0, GROWTH * abs(before) if before != 0.0 else math.inf
    longest = numbers[LONGEST] if numbers[LONGEST] > 0.0 else math.inf
    status, where, evaluations = TOO_SHORT, 0, 0
    seen = room[kept - 1] + numbers[TIME]
    for attempt in range(ATTEMPTS):
        h = direction * theta * scale * exponential(min(max(0.5 * theta * slope, -1.0), 1.0))
        h = min(max(h, -longest), longest)
        if not direction * (h - left) <= 0.0:
            if numbers[EXACT] == 0.0:
                numbers[NEXT] = min(max(numbers[TIME] + h, -FARTHEST), FARTHEST)
                return BEYOND, 0, evaluations
            h = left
        if numbers[TIME] + h == numbers[TIME]:
            return TOO_SHORT if status == OK else status, where, evaluations
        if attempt == 0:
            keep(room, kept, state, storage.carry)
        prepare(method, h, before if before != 0.0 else h, storage)
        time, lost = two_sum(numbers[TIME], h)
        time, lost = two_sum(time, lost + numbers[TIME_LO])
        end = room[kept - 1] + time
        end_late(method, end - (seen + h))
        status, where, count = step(method, model, seen, h, state, storage)
        evaluations += count
        factor = 0.5 / CAUTION
        if status == OK:
            missed = signal(method, model, h, state, storage)
            factor = MOST if missed == 0.0 else root(numbers[TOLERANCE] / missed, numbers[POWER])
            factor = min(max(factor, LEAST), MOST)
            if factor >= REFUSED:
                numbers[TIME], numbers[TIME_LO] = time, lost
                numbers[NEXT], numbers[LENGTH] = numbers[TIME], h
                if rate > 0.0 and abs(h) < longest:
                    numbers[THETA] = theta * min(factor, GROWTH)
                room[k + 1], room[kept // 3 + k] = room[k] + h, h
                room[2 * (kept // 3) + k], room[2 * (kept // 3) + k + 1] = seen, end
                return OK, 0, evaluations
        put_back(room, kept, state, storage.carry)
        if not rate > 0.0:
            theta, scale = 1.0, abs(h)
        theta *= CAUTION * factor
    return TOO_SHORT if status == OK else status, where, evaluations


ADAPTIVE = Tag("adaptive-steps", {"step_of": step_of, "take_step": take_step})

DEFAULT = 1e-9
"""The default tolerance with 8 stages, which leaves only round-off. The error of a step of order 2s is about
w^(2s / (s - 1)): with fewer stages the default is the tolerance with the same error."""

TIGHTEST, LOOSEST = 1e-12, 1e-3
"""Below the first, the error signal of close bodies is round-off, which no shorter step makes smaller; above the
second, orbits are qualitatively wrong: with 8 stages and 3e-3, the energy of an orbit of e = 0.9 is 3 % off after a
hundred turns, and that of three bodies by a third."""

STRICT = 0.1
"""The fraction of its default below which a tolerance is far below it."""

FEWEST_STAGES, MOST_STAGES = 3, WIDTH


@dataclass(frozen=True)
class Adaptive(ChangingSteps):
    """Steps chosen one by one, so that each resolves the motion; the clock of a run without dt.

        orbits.propagate(system, dt=orbits.Adaptive(tolerance=1e-9), duration=10 * u.yr)

    tolerance : bound of the last Legendre coefficient of the forces in a step, as a fraction of the forces. The
        default, 1e-9 with 8 stages, leaves only round-off; 1e-8 takes a quarter less time. From 1e-12 to 1e-3; the
        error of a run is about its power 16/7, times the number of steps, and grows as the motion lets it
    direction : 1 forwards in time, -1 backwards; set by the run

    For Gauss with 3 to 8 stages. Raises InputError for a tolerance that is not a number or out of range.
    """

    tolerance: float | None = None
    direction: float = field(default=1.0, init=False, repr=False)

    timing: ClassVar[Tag] = ADAPTIVE
    refined_by: ClassVar[str] = "tolerance"

    def __post_init__(self) -> None:
        tolerance = self.tolerance
        if tolerance is None:
            return
        if not is_number(tolerance):
            raise InputError(f"tolerance is {shown(tolerance)}; expected a number such as 1e-9.")
        if not TIGHTEST <= tolerance <= LOOSEST:
            reason = "With 8 stages 1e-9 leaves nothing but round-off, and a smaller tolerance is not more accurate."
            if tolerance > LOOSEST:
                reason = (
                    "It is not the error of the run: with 8 stages, 1e-3 makes the energy of an eccentric orbit wrong "
                    "by 2e-3 in a hundred turns, and 3e-3 by 3 %; 1e-9 leaves only round-off, in three times the time."
                )
            elif 0.0 <= tolerance < TIGHTEST:
                reason = f"Below {TIGHTEST:g}, it is round-off that would be resolved. {reason}"
            raise InputError(f"tolerance is {shown(tolerance)}; expected {TIGHTEST:g} ... {LOOSEST:g}. {reason}")
        object.__setattr__(self, "tolerance", float(tolerance))

    def check(self, integrator: Integrator) -> None:
        """Raise InputError, naming suitable methods, for a method whose steps this clock cannot choose."""
        stages = getattr(integrator, "stages", 0)
        if integrator.name != "gauss" or not FEWEST_STAGES <= stages <= MOST_STAGES:
            raise InputError(
                f"{integrator.label} needs a dt: steps are chosen by the last coefficient of the polynomial through "
                f"the forces, which Gauss(stages={FEWEST_STAGES}) ... Gauss(stages={MOST_STAGES}) have. Give dt=..., "
                "or use Gauss(stages=8)."
            )

    @staticmethod
    def adapted(form: Any) -> Form:
        """Return the form with distances accurate in close encounters, whose steps can differ in length."""
        known: Form = replace(form, close=True)
        return known

    def tolerance_for(self, integrator: Any) -> float:
        """Return the tolerance of the steps of a method: the one given, or its default."""
        stages = integrator.stages
        if self.tolerance is not None:
            return self.tolerance
        power: float = 16 * (stages - 1) / (14 * stages)  # exactly 1 for 8 stages: the default is Adaptive(1e-9)
        return DEFAULT**power

    def finer(self, integrator: Any, factor: float) -> Adaptive:
        """Return the clock of a tolerance that makes steps `factor` < 1 times as long.

        With a tolerance far below the default, at which round-off is all that is left, they are longer by as much:
        shorter ones would tell no more.
        """
        own, usual = self.tolerance_for(integrator), Adaptive().tolerance_for(integrator)
        change = factor if own > STRICT * usual else 1.0 / factor
        return Adaptive(own * change ** (integrator.stages - 1)).towards(self.direction)

    def numbers_for(self, integrator: Any) -> Array:
        """Return the state of the clock at the start of a march by a method whose steps it can choose."""
        numbers = np.zeros(NUMBERS + 1)
        numbers[:NUMBERS] = super().numbers_for(integrator)
        numbers[THETA], numbers[TOLERANCE] = FIRST_THETA, self.tolerance_for(integrator)
        numbers[POWER] = 1.0 / (integrator.stages - 1)
        return numbers

    def array(self, integrator: Any, *, alone: bool, given: bool) -> dict[str, Array]:
        """Return the array of the state of the clock; bodies alone, and given ones, set no length of steps."""
        numbers = self.numbers_for(integrator)
        if alone or given:
            numbers[LONGEST] = ALONE if alone else LONGEST_OF_GIVEN
        return {"clock": numbers}

    def describe(self, integrator: Any, unit: object = "") -> str:
        """Return the steps of a method in words."""
        return f"adaptive steps (tolerance {self.tolerance_for(integrator):g})"
