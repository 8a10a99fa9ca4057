"""The observers of a march: closest approaches, and what may end it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from orbits.integrators.base import Integrator
from orbits.integrators.forms import Array, Form, padded
from orbits.integrators.maps.dominant import DOMINANT
from orbits.kernels.lanes import WIDTH
from orbits.kernels.maps.nearest import closest_in
from orbits.kernels.search import collisions
from orbits.kernels.search.approaches import follow_bodies, follow_particles, note_annuli, search
from orbits.kernels.search.apsides import OPEN, apsides_of
from orbits.kernels.search.context import Contexts
from orbits.kernels.search.observers import ENTER, SEARCH, observe, observer_address
from orbits.kernels.search.record import QUANTITIES, REACH, enter_passage, note_end
from orbits.kernels.search.stopping import find_suspect, first_energy_error, path_energy
from orbits.marching.clocks.clock import Clock
from orbits.marching.stepping.alignment import unwritten
from orbits.marching.watching.kepler_passages import FLYBY, HILL_RADII
from orbits.marching.watching.passage_list import BlockList

TOUCHED, ENERGY, SUSPECT = -2, -1, 0
"""Why a march stops: two bodies may have touched; the energy error is above its bound; a pair may come to its bound."""

SHARE_OF_ORBIT = 0.05
"""The reach of a body: within it every flyby is listed; outside it, flybys of massless particles are not recorded. It
is `HILL_RADII`, or a fraction of the distance between the body and the dominant one, whichever is larger."""

PASSAGE_ANGLE_PER_ORDER, LEAST_PASSAGE_ANGLE, LARGEST_PASSAGE_ANGLE = 0.05, 0.1, 0.8
"""The angle of a step above which passages are listed at any distance, per order of the method, and its bounds: 0.8 for
Gauss with 8 stages, at which a flyby of the Earth causes an error of 1 m in a year, and 0.1 for orders up to 2."""

PERICENTRE_ANGLE_RATIO = 0.65
"""The factor by which each order below 16 reduces the angle of a step above which pericentres of eccentric orbits about
the dominant body are listed: 0.8 for Gauss with 8 stages, 0.002 for methods of order 2."""

USUAL = 30.0
"""The largest ratio of the error at a pericentre to that on a circle at which it does not count as a passage."""


if TYPE_CHECKING:
    from orbits.marching.legs.problem import Problem
    from orbits.marching.stepping.parallel import Parallel


@lru_cache(maxsize=64)
def thresholds(order: int) -> tuple[float, float, float]:
    """Return the limits that `orbits.kernels.search.context` calls `passage_angle`, `least_eccentricity` and
    `pericentre_angle`, for a method of this order.
    """
    passage_angle = min(max(PASSAGE_ANGLE_PER_ORDER * order, LEAST_PASSAGE_ANGLE), LARGEST_PASSAGE_ANGLE)
    pericentre_angle = LARGEST_PASSAGE_ANGLE * PERICENTRE_ANGLE_RATIO ** max(16 - order, 0)
    return passage_angle, _least_eccentricity(order), pericentre_angle


def limits_of(integrator: Integrator, clock: Clock, sees_dominant: bool) -> tuple[float, float, float]:
    """Return these limits for the steps of a method on a clock.

    sees_dominant : whether all pericentres about the dominant body are to be seen, as particles may fall on it
    """
    if integrator.follows_kepler:
        # All flybys within the reach of a planet, and all flybys and pericentres that steps do not resolve.
        fast = math.inf if integrator.in_encounters.follow_particles else FLYBY / integrator.least_steps
        return fast, 0.0, 2.0 * math.pi / integrator.least_steps
    if sees_dominant:
        return math.inf, 0.0, 0.0
    return clock.passage_limits or thresholds(integrator.order)


def _least_eccentricity(order: int) -> float:
    """Return the eccentricity at which (speed / distance)^order at the pericentre is `USUAL` times that of the circle
    with the same period.
    """
    low, high = 0.0, 1.0
    for _ in range(50):
        e = 0.5 * (low + high)
        low, high = (e, high) if math.sqrt(1.0 + e) / (1.0 - e) ** 1.5 < USUAL ** (1.0 / order) else (low, e)
    return low


def empty_record(rows: int, wanted: bool = True) -> Array:
    """Return an empty record of closest approaches, for massive bodies and particles together.

    wanted : whether these are looked for; else no approach is closer than those on record, at distance 0
    """
    record = np.zeros((QUANTITIES, 2, padded(rows)))
    record[0] = np.inf if wanted else 0.0
    return record


class Observers:
    """What may end the march of one bound system, and its closest approaches.

    problem : what is marched; form : of the method; state : its arrays at the start
    times : those of the steps of a block, see `orbits.kernels.search.context`
    tasks : the number of tasks that march particles at the same time
    limits : what passages are listed, see `limits_of`

    contexts, lists : of the massive bodies, then of each task
    sees_path : whether all states of the next block are to be recorded
    records_all : whether all states of all blocks are
    dominant : the body that dominates the others, or -1
    given : whether the motion of all massive bodies is given: approaches among these are not looked for
    """

    def __init__(
        self,
        problem: Problem,
        form: Form,
        state: Mapping[str, Array],
        times: Array,
        tasks: int,
        limits: tuple[float, float, float],
    ) -> None:
        parameters, massive, particles, radii = problem.strength, problem.bodies, problem.particles, problem.ends.radii
        q, v, on_kepler_orbits = state["q"], state["v"], problem.integrator.follows_kepler
        passage_angle, least_eccentricity, pericentre_angle = limits
        self._parameters, self._stride = parameters, len(q)
        self.given = form.held(problem.parameters) == len(massive)
        self._path, self._massive, self._particles = _NOTHING, massive, particles
        stops = problem.ends.stops
        rows = np.concatenate([massive, particles])  # the numbers of the bodies in the order of the kernels
        self._stops = _NO_STOPS if stops is None or not len(stops) else _in_rows(stops, rows)
        self._hits = np.zeros((len(particles) + WIDTH - 1) // WIDTH + 1, dtype=np.int64)
        self._collide = radii is not None
        gm = parameters[1:]
        self.dominant = int(gm.argmax()) if gm.max() > DOMINANT * gm.sum() else -1
        of_bodies = slice(0, 3 * len(massive))
        annuli = self._reaches(q[of_bodies].reshape(3, -1), v[of_bodies].reshape(3, -1), on_kepler_orbits)
        self.listed_within = np.zeros(padded(len(massive)))
        if self.dominant >= 0:
            self.listed_within[: len(massive)] = annuli[:, REACH]
        self._listed = np.zeros((1 + tasks, 2), dtype=np.int64)
        self.lists = [BlockList.empty(listed) for listed in self._listed]
        self.contexts = Contexts(1 + tasks)
        self.contexts.enter(
            stride=self._stride,
            bodies=len(massive),
            dominant=self.dominant,
            mu=float(gm[self.dominant]) if self.dominant >= 0 else 0.0,
            annuli=annuli,
            reaches=self.listed_within,
            hits=self._hits,
            passage_angle=passage_angle,
            least_eccentricity=least_eccentricity,
            pericentre_angle=pericentre_angle,
            times=times,
            pace=1.0,
            every=int(on_kepler_orbits),
        )
        self.contexts.enter_each("passages", [passages for passages, _ in self.lists])
        self.contexts.enter_each("listed", [listed for _, listed in self.lists])
        if len(self._stops):
            self.contexts.enter(stops=self._stops)
            self.contexts.enter_each("speeds", [np.zeros(padded(len(massive))) for _ in range(1 + tasks)])
        if radii is not None:
            within = np.full(padded(len(rows)), -np.inf)
            within[: len(rows)] = radii[rows]
            self._touched = np.zeros(len(particles) + 1, dtype=np.int64)
            self._touched_own = np.zeros(len(particles), dtype=np.int64)
            rough = collisions.roughness(problem.integrator.order)
            self.contexts.enter(radii=within, strength=parameters[: 1 + len(massive)].copy(), rough=rough)
            self.contexts.enter(touched=self._touched, touched_own=self._touched_own)
        self._compiled, self._find_suspect, self._find_touch = False, 0, 0
        observed = len(self._stops) or self._collide or problem.approaches or problem.sees_all_steps
        self.records_all = self.sees_path = bool(observed) or not form.notes_nearest(3 * len(massive))

    @cached_property
    def own_steps(self) -> Contexts:
        """The contexts of tasks for particles that take steps of their own."""
        return Contexts(len(self._listed) - 1)

    @property
    def observer(self) -> int:
        """The address of the observer that a task calls after each block with its context and the states of eight
        particles.
        """
        return observer_address(follow_particles)

    def begin(self, record: Array, first: int, origin: float = 0.0) -> None:
        """Prepare for a block after `first` steps, at the time `origin`, with this `record` and empty lists."""
        if not self._compiled:
            self._compile()
        self.contexts.enter(record=record, first=first, origin=origin)
        self._listed[:] = 0
        if self._collide:
            self._touched_own[:] = 0

    def _compile(self) -> None:
        """Compile, or load from the cache, the kernels shared by the observers."""
        self._find_suspect = observer_address(find_suspect) if len(self._stops) else 0
        self._find_touch = observer_address(collisions.find_touch) if self._collide else 0
        self.contexts.enter(
            search=observer_address(search, SEARCH),
            enter=observer_address(enter_passage, ENTER),
            then=self._find_suspect,
            collide=self._find_touch,
        )
        self._compiled = True

    def path(self, steps: int) -> Array:
        """Return the array in which a block of steps is recorded; it grows only as needed, as new memory is slow."""
        size = 2 * (steps + 1) * self._stride
        if len(self._path) < size:
            (self._path,) = unwritten((size,))
            self.contexts.enter(path=self._path)
        return self._path

    def recorded(self, steps: int) -> Array:
        """Return the record of a block of steps: (steps + 1, 2, padded), q and v of the massive bodies."""
        return self._path[: 2 * (steps + 1) * self._stride].reshape(steps + 1, 2, self._stride)

    def follow(self, h: float, steps: int) -> None:
        """Search for closest approaches among the massive bodies."""
        follow_bodies(self.contexts.addresses[0], h, steps)

    def may_pass(self, room: Array) -> bool:
        """Return whether planets may have passed each other in the block just marched, so that all its states have to
        be seen: from now on, until they may not; room : the scratch of the march
        """
        if self.records_all:
            return False
        seen, self.sees_path = self.sees_path, not closest_in(room) <= 1.0
        return self.sees_path and not seen

    def look(self, h: float, steps: int, q: Array, v: Array, parallel: Parallel | None = None) -> None:
        """Observe the massive bodies in the block of `steps` steps just marched, which ended at q and v.

        parallel : searches for closest approaches with several threads, for thousands of bodies
        """
        self._set_state(steps, q, v)
        if parallel is not None:
            parallel.follow(self, h, steps)
        elif not self.given:
            self.follow(h, steps)
        for observer in (self._find_suspect, self._find_touch):
            if observer:
                observe(observer, self.contexts.addresses[0], _NO_TRACK, h, steps, 0, len(self._massive))
        if len(self._particles) and self.dominant >= 0:
            note_annuli(self.contexts.addresses[0], steps)

    @cached_property
    def own_lists(self) -> list[BlockList]:
        """The lists of passages that particles take by steps of their own among constant steps, of each task."""
        counts = np.zeros((len(self.lists) - 1, 2), dtype=np.int64)
        return [BlockList.empty(count) for count in counts]

    def follow_own_steps(
        self,
        arrays: Sequence[Mapping[str, Array]],
        among: tuple[int, float] | None = None,
        surfaces: Array | None = None,
    ) -> None:
        """Prepare to observe particles at steps of their own; arrays : the path and the times of each task.

        among : for those among constant steps, the number of these before the block, and their length. Passages are
            then listed in lists of their own: those within the `surfaces` of bodies, (n,) radii
        """
        self.own_steps.follow(self.contexts, arrays)
        if among is not None:
            within, sharp = np.zeros_like(self.listed_within), math.inf
            if surfaces is not None:
                within[: len(surfaces)] = surfaces
                sharp = 0.0 if surfaces[self.dominant] > 0.0 else math.inf
            self.own_steps.enter(origin=float(among[0]), pace=1.0 / among[1], reaches=within, pericentre_angle=sharp)
            self.own_steps.enter_each("passages", [passages for passages, _ in self.own_lists])
            self.own_steps.enter_each("listed", [listed for _, listed in self.own_lists])
            for _, listed in self.own_lists:
                listed[:] = 0

    def met(self, steps: int, pairs: bool = True) -> tuple[int, int] | None:
        """Return the number of steps, of the `steps` just observed, after which the march stops, and why: `SUSPECT`
        where a pair may come to its bound in the last of them, `TOUCHED` where two bodies may have touched. None if it
        goes on.

        pairs : whether to stop for pairs
        """
        found = steps + 1
        if not steps:
            return None
        if pairs and len(self._stops):
            found = int(self._hits.min())
        if pairs and self._collide and self._touched.min() <= min(found, steps):
            return int(self._touched.min()), TOUCHED
        return None if found > steps else (found, SUSPECT)

    def energy(self, q: Array, v: Array) -> float:
        """Return G times the energy of the massive bodies in a state."""
        self._set_state(0, q, v)
        return float(path_energy(self.contexts.addresses[0], self._parameters, 0))

    def first_energy_error(self, steps: int, energy: float, bound: float) -> int:
        """Return after how many of the `steps` steps just observed the energy first differs from another one by more
        than a bound, or steps + 1.
        """
        return int(first_energy_error(self.contexts.addresses[0], self._parameters, steps, energy, bound))

    def touching(self, step: int) -> NDArray[np.intp] | None:
        """Return the particles, in the numbers of the caller, that may have touched a body in a step, of those just
        observed, counted from 1; None unless it is the first one in which two bodies may have touched.
        """
        if not self._collide or self._touched.min() != step:
            return None
        return np.asarray(self._particles[self._touched[:-1] <= step])

    def approaches(self, record: Array, first: int, now: float, track: Array, state: dict[str, Array]) -> Array:
        """Return a copy of a record that includes the distances at the end of the run."""
        record = record.copy()
        self.begin(record, first, now)
        self._set_state(0, state["q"], state["v"])
        count = len(self._particles)
        note_end(self.contexts.addresses[0], track, state["particle_q"], state["particle_v"], count)
        return record

    def _set_state(self, step: int, q: Array, v: Array) -> None:
        path, start = self.path(step), 2 * step * self._stride
        path[start : start + self._stride] = q
        path[start + self._stride : start + 2 * self._stride] = v

    def _reaches(self, q: Array, v: Array, on_kepler_orbits: bool) -> Array:
        """Return `annuli` with the reach of each body: of planets that steps on Kepler orbits do not follow there, with
        their mutual Hill radius at their apocentres.
        """
        gm, dominant = self._parameters[1:], self.dominant
        annuli = np.zeros((len(gm), 3))
        if dominant < 0:
            annuli[:, REACH] = np.inf
            return annuli
        distance = np.sqrt(((q - q[:, dominant : dominant + 1]) ** 2).sum(axis=0))
        farthest, masses = distance, gm
        if on_kepler_orbits:
            place, velocity = (x - x[:, dominant : dominant + 1] for x in (q, v))
            apocentre = apsides_of(place.T, velocity.T, gm[dominant] + gm).largest
            farthest = np.where(apocentre < OPEN, np.maximum(distance, apocentre), distance)
            others = np.sort(gm)[-2::-1]
            if len(others) > 1:
                masses = gm + np.where(gm == others[0], others[1], others[0])
        hill = farthest * np.cbrt(masses / (3.0 * gm[dominant]))
        annuli[:, REACH] = np.maximum(HILL_RADII * hill, SHARE_OF_ORBIT * distance)
        annuli[dominant, REACH] = 0.0
        return annuli


def _in_rows(stops: Array, rows: NDArray[np.intp]) -> Array:
    """Return conditions with the bodies numbered by their rows."""
    row = np.empty(len(rows) + 1)
    row[rows], row[-1] = np.arange(len(rows)), -1
    out = np.array(stops, dtype=np.float64)
    out[:, 1:3] = row[out[:, 1:3].astype(int)]
    return out


_NOTHING, _NO_STOPS = np.zeros(0), np.zeros((0, 4))
_NO_TRACK = np.zeros((0, WIDTH))
