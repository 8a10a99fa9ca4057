"""The massless particles that a leg loses in a block: which, before which step, where they have got to, and why."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbits.errors import IntegrationError
from orbits.integrators.base import APART
from orbits.integrators.forms import Array
from orbits.kernels.search.record import COLUMNS, MATE, ROW, WHEN
from orbits.kernels.steps import NEAR_A_PLANET, OK
from orbits.marching.clocks.step_times import UNLIMITED
from orbits.marching.following import losses
from orbits.marching.following.losses import Contact, Suspect
from orbits.marching.following.lost_particles import Reached
from orbits.marching.following.retirement import Lost, Retired, Retirement, earlier, hit, retirements
from orbits.marching.legs.interruptions import Block, Interruption, Kind, LegWatcher
from orbits.marching.watching import kepler_passages

if TYPE_CHECKING:
    from orbits.marching.legs.leg import Leg

SPAN, LEAST_SPAN = 3.0, 32
"""The length of a block in which particles may be retired, as a multiple of the square root of the number of steps from
one retirement to the next; and the least."""


class _Found(NamedTuple):
    """Lost particles: after how many steps of the leg, where they have got to, and contacts with bodies."""

    lost: Lost
    step: int
    reached: Reached
    contacts: dict[int, Contact]


class ParticleLosses(LegWatcher):
    """Retires the massless particles of a leg that cannot be stepped, hit a body, leave the others, or come to where
    the method does not follow them. The bits of the others do not change.

    leg : before its first step; q : (n, 3), the positions of all bodies there
    surfaces : (massive,), radii of the bodies, which particles hit that take steps of their own; None if none does
    dominant : the row of the body that dominates the others, or -1
    """

    def __init__(self, leg: Leg, q: Array, surfaces: Array | None, dominant: int) -> None:
        problem, integrator = leg.problem, leg.problem.integrator
        self.retired = Retired(len(problem.particles))
        self._surfaces, self._dominant = surfaces, dominant
        self._encountered: Lost | None = None
        self._found: _Found | None = None
        self._before: NDArray[np.int64] | None = None  # the retired particles before those of the last block
        self._deep = np.zeros((0, COLUMNS))
        judges = problem.retire and not (problem.underway or problem.exact)
        self._judges = judges and integrator.in_encounters.retire_particles
        self._departs = integrator.departures != (None, None)
        self._starts_close = self._close(leg, q) if self._judges else np.zeros(0, dtype=np.intp)

    def _close(self, leg: Leg, q: Array) -> NDArray[np.intp]:
        """Return the particles that begin within the reach of a planet."""
        problem, x = leg.problem, q[leg.problem.bodies]
        return close_to_planets(q[problem.particles], x, problem.gm[: len(x)], self._dominant)

    def most(self, leg: Leg) -> int:
        """Return the most steps of the next block: fewer while particles are retired often, and up to the next step
        after which departures are looked for.
        """
        most = APART - leg.step % APART if self._departs else UNLIMITED
        if self._judges:
            # A retirement costs a block, and a block about SPAN^2 steps: their sum is least for blocks of this length.
            between = leg.step / (1 + int(self.retired.gone().sum()))
            most = min(most, max(LEAST_SPAN, int(SPAN * math.sqrt(between))))
        return most

    def forget(self) -> None:
        """Forget what was lost in the last block."""
        self.retired.begin()
        self._encountered, self._deep = None, np.zeros((0, COLUMNS))

    def see(self, leg: Leg, block: Block) -> None:
        """Note the passages that end the way of particles in the block that was just marched."""
        problem, lists = leg.problem, leg.observers.lists
        if self._surfaces is not None:
            own = leg.follower.lists(leg.observers)
            self._deep = losses.passages_within(own, self._surfaces)
            if leg.follower.sees_falls(self._surfaces[self._dominant]):
                losses.without_dominant(own, len(problem.bodies), self._dominant)
        if self._judges and leg.listing.is_complete:  # not from a list that is not complete: shorter blocks follow
            where = len(problem.bodies), self._dominant, block.h, leg.step, problem.integrator.least_steps
            self._encountered = kepler_passages.lost_in(lists, problem.gm, *where)
        if problem.retire and (self._departs or len(self._starts_close)):
            self._encountered = self._lost_anyhow(leg, block.steps)

    def _lost_anyhow(self, leg: Leg, count: int) -> Lost | None:
        """Return the particles that are lost first in the block just marched, though they can be stepped."""
        found = self._encountered
        if not leg.step and len(self._starts_close):  # most have no passage to be seen by
            known = self.retired.table()[self._starts_close, 0]
            begun = self._starts_close[known == OK]
            if len(begun):
                found = earlier(Lost(0, begun, np.full(len(begun), NEAR_A_PLANET)), found)
        if self._departs and (leg.step + count) % APART == 0:
            state, n, m = leg.stepper.state, len(leg.problem.bodies), len(leg.problem.particles)
            x, w = (state[name][: 3 * n].reshape(3, n)[:, self._dominant] for name in "qv")
            q, v = state["particle_q"][:, :m], state["particle_v"][:, :m]
            limits = leg.problem.integrator.departures
            which, status = losses.departures(q, v, (x, w), float(leg.problem.gm[self._dominant]), *limits)
            there = self.retired.block[which, 0] == OK
            if there.any():
                found = earlier(found, Lost(count, which[there], status[there]))
        return found

    def look(self, leg: Leg, count: int) -> Interruption | None:
        """Return before which step of the block particles are lost."""
        self._found = None
        hits, contacts = self._impacts(leg, count)
        lost = earlier(hits, self.retired.lost_or(self._encountered))
        if lost is None:
            return None
        if 0 < lost.steps < count and leg.samples.come_before(lost.steps):
            return Interruption(lost.steps, Kind.LOST)
        self._found = _Found(lost, leg.step + lost.steps, leg.follower.reached(leg.stepper.state, lost), contacts)
        return Interruption(leg.follower.ended_by(lost, count) if leg.problem.retire else lost.steps, Kind.LOST)

    def commit(self, leg: Leg, begun: int, last: Interruption | None) -> IntegrationError | None:
        """Retire the particles that were lost; or return the error for the first, where they are not retired."""
        found, self._before = self._found, None
        if found is None or not (leg.step > found.step or (last is not None and last.kind is Kind.LOST)):
            return None
        self._before = self.retired.table().copy()
        return self.lose(leg, found.lost, found.step, found.reached, found.contacts)

    def lose(
        self, leg: Leg, lost: Lost, step: int, reached: Reached, contacts: dict[int, Contact]
    ) -> IntegrationError | None:
        """Retire particles after `step` steps, where they have got to; or return the error for the first one, if
        particles are not retired.

        contacts : of those that hit a body
        """
        if not leg.problem.retire:
            body = int(leg.problem.particles[lost.particles[0]])
            return leg.stepper.failure(int(lost.status[0]), 0, [body])
        leg.follower.put(leg.stepper.state, leg.as_seen(lost.particles), lost, reached, contacts)
        self.retired.add(lost, step)
        return None

    def begin_at(self, steps: int) -> None:
        """Prepare for marching copies of the particles that were not retired `steps` steps before the end of the last
        block: there, or before.
        """
        self.retired.begin(self._before if steps else None)

    def go_back(self, leg: Leg, steps: int, count: int) -> None:
        """Take back the particles that were retired in the last block, but not in its first `steps` steps."""
        if self._before is not None:
            self.retired.take_back(self._before, leg.step - count + steps)

    def retire(self, leg: Leg, body: int, status: int, step: int, time: float, q: Array, v: Array) -> None:
        """Retire a massless particle, numbered as by the caller, after `step` steps, with its last q and v, (3,), at a
        time within the next step.
        """
        k = np.searchsorted(leg.problem.particles, [body])
        state = leg.stepper.state
        leg.follower.stop(state, k, time)
        state["particle_q"][:, k], state["particle_v"][:, k] = q[:, None], v[:, None]
        self.retired.add(Lost(0, k, np.array([status])), step)

    def go_on_from(self, leg: Leg, other: Leg) -> None:
        """Take over the retired particles of another leg of the same particles, which this leg continues."""
        self.retired.follow(other.losses.retired)
        gone, state = np.flatnonzero(self.retired.gone()), leg.stepper.state
        for name in ("particle_q", "particle_v"):
            state[name][:, gone] = other.stepper.state[name][:, gone]
        if "particle_clock" in state:
            state["particle_clock"][gone] = other.stepper.state["particle_clock"][gone]

    # ------------------------------------------------------------------------------------------------- impacts

    def _impacts(self, leg: Leg, count: int) -> tuple[Lost | None, dict[int, Contact]]:
        """Return the particles that hit a body first in the block of `count` steps just marched, and their contacts;
        None and {} if none does, or if the block is to be repeated.
        """
        suspects = self._suspects(leg, count) if leg.listing.is_complete else []
        if not suspects:
            return None, {}
        assert self._surfaces is not None
        problem, begun, found = leg.problem, leg.step, dict[int, tuple[int, Contact]]()
        surfaces = dict(zip(problem.bodies.tolist(), self._surfaces.tolist(), strict=True))
        lengths = leg.times.lengths().copy()
        for suspect in sorted(suspects):
            particle, body, _ = suspect
            own, other = int(problem.particles[particle]), int(problem.bodies[body])

            def is_within(step: int, particle: int = particle, pair: tuple[int, int] = (own, other)) -> bool:
                leg.times.step = begun
                leg.loop.replay(step)
                leg.times.step += step
                alone = leg.follower.alone(leg.stepper.state)[particle]
                q, _ = leg.state()
                return bool(alone and np.linalg.norm(q[pair[0]] - q[pair[1]]) < surfaces[pair[1]])

            step = losses.first_step_within(suspect, is_within)
            is_within(step)
            length = float(lengths[step])
            touched = losses.touching(leg.state_after, length, surfaces[other], own, other)
            if touched is not None:
                part, *there = touched
                now = step, Contact(body, part, leg.time + part * length, *there)
                known = found.setdefault(particle, now)
                found[particle] = min(known, now, key=lambda one: (one[0], one[1].part))
        leg.times.step = begun
        leg.loop.replay(count)
        if not found:
            return None, {}
        first = min(step for step, _ in found.values())
        contacts = {particle: found[particle][1] for particle in sorted(found) if found[particle][0] == first}
        status = np.array([hit(contact.body) for contact in contacts.values()])
        return Lost(first, np.array(list(contacts)), status), contacts

    def _suspects(self, leg: Leg, count: int) -> list[Suspect]:
        """Return what may hit a body in the block just marched: passages within radii, particles that are falling
        within one at its end, and those whose steps became too short.
        """
        if self._surfaces is None or not (leg.problem.retire and count):
            return []
        n, m, direction = len(leg.problem.bodies), len(leg.problem.particles), leg.clock.direction
        steps = leg.times.steps_in_block(self._deep[:, WHEN])
        pairs = zip(self._deep[:, ROW].astype(int) - n, self._deep[:, MATE].astype(int), steps, strict=True)
        found = [Suspect(int(p), int(body), min(max(int(k), 0), count - 1)) for p, body, k in pairs]
        path = leg.observers.recorded(count)[:, :, : 3 * n].reshape(count + 1, 2, 3, n)
        state = leg.stepper.state
        own = leg.follower.alone(state) & (self.retired.table()[:, 0] == OK)
        lost = own & self.retired.gone()
        q, v = state["particle_q"][:, :m], state["particle_v"][:, :m]
        there = np.flatnonzero(own & ~lost)
        bodies = path[count, 0], path[count, 1]
        close = losses.falling_within(q[:, there], v[:, there], bodies, self._surfaces, direction)
        found += [Suspect(int(there[k]), int(body), count - 1) for k, body in np.argwhere(close)]
        for particle in np.flatnonzero(lost):
            step = min(int(self.retired.block[particle, 1]), count - 1)
            nearest = int(np.linalg.norm(path[step, 0] - q[:, [particle]], axis=0).argmin())
            if self._surfaces[nearest] > 0.0:
                found.append(Suspect(int(particle), nearest, step))
        return found

    # ------------------------------------------------------------------------------------------- what is known

    def listed(self, leg: Leg) -> list[Retirement]:
        """Return the particles that were retired, in the order of the caller's bodies."""
        problem, state = leg.problem, leg.stepper.state
        if not len(problem.particles) or (self.retired.table()[:, 0] == OK).all():
            return []
        names = [problem.name(body) for body in problem.bodies.tolist()]
        places = leg.follower.places(state)
        return retirements(
            self.retired.table(), state["particle_q"], state["particle_v"], problem.particles, *places, names
        )


def close_to_planets(q: Array, bodies: Array, gm: Array, dominant: int) -> NDArray[np.intp]:
    """Return the particles within the reach of a planet; q : (m, 3); bodies : (n, 3), gm : (n,)."""
    planets = np.arange(len(bodies)) != dominant
    place, around = q - bodies[dominant], (bodies - bodies[dominant])[planets]
    return np.flatnonzero(kepler_passages.near_a_planet(place, around, gm[planets], float(gm[dominant])) >= 0)
