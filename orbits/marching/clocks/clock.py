"""What all clocks have in common: the times of the steps of a run, for its loop, samples, archive and records.

The compiled part of a clock is described in `orbits.kernels.clocks`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any, ClassVar, TypeVar

from numpy.typing import ArrayLike

from orbits.errors import InputError, IntegrationError
from orbits.forces.base import BoundForce
from orbits.integrators.base import Integrator
from orbits.integrators.forms import Array, Form
from orbits.kernels.binding import Tag
from orbits.lagrangians.base import Lagrangian
from orbits.marching.clocks.step_times import Place, Places, StepTimes
from orbits.point_masses import PointMasses

T = TypeVar("T")

SHARED, OWN = "shared", "own"
"""The steps that massless particles may take: those of the bodies, or their own."""


class Clock:
    """The times of the steps of a run: a frozen value.

    timing : the tag by which compiled code identifies it
    changes : whether steps differ in length
    refined_by : what is made smaller for more accuracy, in words
    particle_steps : which steps massless particles take: `SHARED`, or their `OWN`, by clocks of their own
    passage_limits : which passages are listed, see `thresholds` in `orbits.marching.watching.leg_observers`, if that
        does not depend on the method
    direction : 1 forwards in time, -1 backwards
    h : the length of its steps, with that sign; NaN if they differ

    The *reading* of a clock is a number of steps if all have the same length, and otherwise a time. The records of a
    run contain readings, and `time` converts them to times.
    """

    timing: ClassVar[Tag]
    changes: ClassVar[bool] = False
    refined_by: ClassVar[str] = "dt"
    passage_limits: ClassVar[tuple[float, float, float] | None] = None
    particle_steps: ClassVar[str] = SHARED
    direction: float
    h: float

    def at(self, time: float) -> str:
        """Return a time in words, for messages about a step that begins there."""
        return f"t = {time:.10g}"

    def failure(
        self, status: int, integrator: Integrator, names: Sequence[str], *, momenta: bool, forces: bool
    ) -> tuple[type[IntegrationError], str] | None:
        """Return the kind of error, and its words, for a step that cannot be taken for reasons that depend on the
        clock; the arguments are those of `orbits.marching.stepping.failures.failure_of_bodies`.
        """
        return None

    def own_form(
        self, integrator: Integrator, lagrangian: Lagrangian, forces: Sequence[BoundForce], *, with_particles: bool
    ) -> Form | None:
        """Return the form of a method for these steps if the clock makes it; None for that of the method."""
        return None

    @staticmethod
    def adapted(form: Any) -> Form:
        """Return the form of a method for these steps."""
        known: Form = form
        return known

    def coefficients(self, form: Form) -> Any:
        """Return the coefficients of a form for the steps of a march."""
        raise NotImplementedError

    def rate(self, angle: float) -> float:
        """Return the angular rate from which on a step covers more than an angle; infinite if steps adapt to it."""
        return math.inf

    def are_readings(self, steps: Array, when: Array, taken: int) -> bool:
        """Return whether these can be readings at the beginnings of steps, and within them.

        taken : how many steps were taken by then
        """
        raise NotImplementedError

    def check(self, integrator: Integrator) -> None:
        """Raise InputError for a method whose steps this clock cannot choose."""

    def to_be_judged(self, record: Callable[[], T]) -> T | None:
        """Return the record of passages by which a march of these steps is judged; None for steps that resolve all of
        them, whose record is made when it is asked for.
        """
        return record()

    def finer(self, integrator: Any, factor: float) -> Clock:
        """Return a clock whose steps are about `factor` < 1 times as long, for a companion of a run by that method.

        Raises InputError for a clock that has none.
        """
        raise InputError(f"the steps of {type(self).__name__} have no finer ones, with which a run could be compared.")

    @staticmethod
    def check_particles(forces: Sequence[BoundForce], *, all_given: bool) -> None:
        """Raise InputError for what acts on bodies whose massless particles cannot take these steps.

        all_given : whether no body is integrated beside bodies whose motion is given
        """

    def check_bodies(self, strength: Array, bodies: PointMasses, names: Sequence[str]) -> None:
        """Raise InputError for massive bodies at the start of a run for which this clock is unsuitable.

        strength : of these, see `orbits.kernels.gravity.pair_sums`; bodies, names : all, with massless ones
        """

    def describe(self, integrator: Any, unit: object = "") -> str:
        """Return the steps of a method in words, as in: adaptive steps (tolerance 1e-09); "" if they are unknown.

        unit : of time
        """
        return ""

    def step_times(self, start: float) -> StepTimes:
        """Return what tells a leg that begins at `start` when its steps are."""
        raise NotImplementedError

    def most_steps(self, time: float) -> float:
        """Return the most steps that a march may have taken at a time."""
        return math.inf

    def step_begin(self, time: float) -> float:
        """Return the latest time, not after this one, at which a march can begin and take the steps of the run."""
        return time

    def begun_within(self, step: int, time: float) -> tuple[Clock, float, int]:
        """Return how a march goes on from a time in a step of which the bodies change there, so that later steps are
        where they would have been: its clock, the time from which it is counted, and the steps of that clock taken.
        """
        raise NotImplementedError

    def array(self, integrator: Integrator, *, alone: bool, given: bool) -> dict[str, Array]:
        """Return the array of the state of the clock, by its name, that a leg changes and archives have; {} for none.

        alone : whether a massive body is alone, among particles or under forces; given : whether the motion of bodies
            is given
        """
        return {}

    def room(self, block: int, size: int) -> int:
        """Return the length of the workspace for a block of `block` steps and a state of `size` numbers."""
        return 0

    def time(self, reading: Any) -> Any:
        """Return the time, since the start of the run, of a reading or of an array of them."""
        raise NotImplementedError

    def places(self, times: ArrayLike) -> Places:
        """Return the places of times in a march."""
        raise NotImplementedError

    def place(self, time: float | Fraction) -> Place:
        """Return the place of a time in a march."""
        raise NotImplementedError

    def time_at(self, place: Place) -> float:
        """Return the time, since the start of the run, of a place: of no whole steps its rest."""
        return float(self.time(place.steps)) + place.rest
