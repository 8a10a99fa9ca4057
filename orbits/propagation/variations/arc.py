"""The motion of a small body in an ephemeris through the times of its observations, and its derivatives by the start.

The states are those of the method at the ends of its steps, and between them on polynomials of degree fifteen through
eight of these: for Apophis within 6e-12 au of partial steps, 1e-15 au as a rule. The derivatives are those of the
motion under Newton's attraction by the bodies of the ephemeris alone, without relativity, figures and forces: they are
off by a few millionths after ten years, by 1e-4 after an encounter with the Earth, which no covariance shows, and take
a third of the time. They are computed at the ends of a few steps each, and between these by polynomials of degree
seven. Those by parameters are symmetric differences of whole arcs.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from orbits.diagnostics.hermite import between
from orbits.errors import ConvergenceError
from orbits.integrators.forms import Array
from orbits.integrators.gauss import Gauss
from orbits.lagrangians.terms.in_ephemeris import InEphemeris
from orbits.marching.clocks.adaptive import Adaptive
from orbits.marching.legs import within_step
from orbits.marching.stepping.motion import Motion
from orbits.marching.tangents.of_bodies import Tangents
from orbits.propagation.marchers import bound
from orbits.propagation.variations.following import particle_of
from orbits.system import System
from orbits.system.model import model
from orbits.system.parameters import GM, parameters_of, with_values

METHOD = Gauss(stages=8)

TOGETHER = 4
"""The most steps between two nodes of the derivatives."""

TURN = 0.4
"""The most radians by which the body moves about the nearest other body, as seen from there, between two nodes."""

MOST, MOST_A_DAY = 4000, 10.0
"""The most steps of an arc: those of a body that passes the Sun or a planet are a few hundred, of one that is bound to
a planet a few a day. An orbit that is tried and takes more is that of no body that is observed."""

OF_STATES, OF_DERIVATIVES = 8, 4
"""Nodes of a polynomial."""

MOVED = 1e-5, 0.1
"""How far the body is moved by the difference of a parameter, au, and by how much less it may be: rounding, 1e-14 au
after decades, is 1e-9 of it, and what is not linear 1e-10."""


class Arc:
    """The motion of one massless body of a system whose massive bodies are those of an ephemeris.

    system : at t = 0; name : of the body; parameters : names of numbers of what acts, see `orbits.system.parameters`
    A start has the state, then their values: (n,), n = 6 + p.

    Raises what `orbits.propagate` raises of such a system.
    """

    def __init__(self, system: System, name: str, parameters: Sequence[str] = ()) -> None:
        self.system, place = system, system.names.index(name)
        self._whole = particle_of(system, place, coupled=False)
        ephemeris = [term for term in system.terms if isinstance(term, InEphemeris)]
        newtonian = system.replaced(terms=ephemeris, forces=())
        self._plain = particle_of(newtonian, place, coupled=False)
        self._newton = model(self._plain.system)
        self._own, self._count = int(self._whole.varied[0]), len(self._whole.system.names)
        self.parameters = parameters_of(self._whole.system, list(parameters))
        self._steps = [1e-3 * abs(one.value) or 1e-12 for one in self.parameters]

    def states(self, start: Array, times: Array) -> tuple[Array, Array]:
        """Return q and v at times, (m, 3) each, for a start, (n,); NaN where a march from it does not get.

        Raises an IntegrationError on the way.
        """
        system = self._whole.system
        if self.parameters:
            system = with_values(system, self.parameters, start[6:].tolist())
        nodes, states = [np.zeros(1)], [start[None, :6]]
        for sign, rows in _sides(times):
            for motion in self._motions(system, start, sign, times[rows]):
                path = motion.path[1:, :, : 3 * self._count].reshape(len(motion), 6, self._count)
                nodes.append(motion.times[1:].copy())
                states.append(path[:, :, self._own])
        at = np.concatenate(nodes)
        order = np.argsort(at)
        found = between(at[order], np.concatenate(states)[order], times, OF_STATES)
        found[(times < at[order[0]]) | (times > at[order[-1]])] = np.nan
        return found[:, :3], found[:, 3:]

    def derivatives(self, start: Array, times: Array) -> Array:
        """Return the derivatives of positions and velocities at times by the start, (m, 6, n)."""
        out = np.empty((len(times), 6, len(start)))
        for sign, rows in _sides(times):
            nodes, matrices = self._nodes(start, sign, times[rows])
            out[rows, :, :6] = between(nodes, matrices, times[rows], OF_DERIVATIVES)
        for k in range(len(self.parameters)):
            out[:, :, 6 + k] = self._by_parameter(k, start, times)
        return out

    def _by_parameter(self, k: int, start: Array, times: Array) -> Array:
        """Return the derivatives of positions and velocities by a parameter, (m, 6)."""
        for _ in range(3):  # until the difference is large enough, and not too large
            step = np.zeros_like(start)
            if self.parameters[k].of == GM:  # masses are above 0
                self._steps[k] = min(self._steps[k], 0.1 * start[6 + k])
            step[6 + k] = self._steps[k]
            before, after = (np.concatenate(self.states(start + x, times), axis=1) for x in (-step, step))
            moved = float(np.abs(after - before)[:, :3].max())
            if MOVED[0] * MOVED[1] <= moved <= MOVED[0] / MOVED[1] or moved == 0.0:
                break
            self._steps[k] *= MOVED[0] / moved
        return np.asarray((after - before) / (2.0 * step[6 + k]))

    def _motions(self, system: System, start: Array, sign: float, times: Array) -> Iterator[Motion]:
        """Yield the motion to the last of these times, block by block. Raises ConvergenceError after too many steps."""
        state, most = self._moved(system, start), MOST + MOST_A_DAY * float(np.abs(times).max())
        march = bound(system, METHOD, Adaptive().towards(sign), threads=1, state=state, dense=True, approaches=False)
        for motion, _ in within_step.stretches(*within_step.towards(march.leg, sign * float(np.abs(times).max()))):
            yield motion
            most -= len(motion)
            if most < 0.0:
                raise ConvergenceError(
                    f"{self._whole.system.names[self._own]}: the motion through {np.abs(times).max():.4g} d of "
                    "observations takes too many steps, and is that of no small body; expected another start, or "
                    "observations without those of another body."
                )

    def _moved(self, system: System, start: Array) -> tuple[Array, Array]:
        """Return q and v of all bodies, (n, 3), with a start of the body."""
        q, v = system.values.q.copy(), system.values.v.copy()
        q[self._own], v[self._own] = start[:3], start[3:6]
        return q, v

    def _nodes(self, start: Array, sign: float, times: Array) -> tuple[Array, Array]:
        """Return the times of nodes, (k,), and the derivatives there, (k, 6, 6)."""
        vectors = np.eye(6).reshape(6, 1, 2, 3).swapaxes(1, 2)
        system, newton = self._plain.system, self._newton
        moved = self._moved(system, start)
        tangents = Tangents(newton.lagrangian, newton.vectors, METHOD, self._plain.varied, *moved, vectors, None)
        nodes, matrices = [0.0], [np.eye(6)]
        for motion in self._motions(system, start, sign, times):
            for first, last in _groups(motion, self._own, len(self._whole.system.names)):
                some = motion.with_steps(
                    motion.times[first : last + 1],
                    motion.path[first : last + 1],
                    motion.kicks[first:last],
                    motion.lengths[first:last],
                )
                tangents.follow(some)
                nodes.append(float(motion.times[last]))
                matrices.append(tangents.vectors()[:, :, 0].reshape(6, 6).T)
        return np.array(nodes), np.array(matrices)


def _sides(times: Array) -> Iterator[tuple[float, NDArray[np.intp]]]:
    """Yield 1 and the rows of later times, -1 and those of earlier ones, if there are any."""
    for sign, rows in ((1.0, np.flatnonzero(times >= 0.0)), (-1.0, np.flatnonzero(times < 0.0))):
        if len(rows):
            yield sign, rows


def _groups(motion: Motion, own: int, n: int) -> Iterator[tuple[int, int]]:
    """Yield the first and the last end of steps that are taken together: few, and none that turn far."""
    count = len(motion)
    q, v = (x.reshape(count + 1, 3, n) for x in np.moveaxis(motion.path[:, :, : 3 * n], 1, 0))
    others = np.arange(n) != own
    dq, dv = (x[:, :, others] - x[:, :, [own]] for x in (q, v))
    rate = (np.linalg.norm(dv, axis=1) / np.linalg.norm(dq, axis=1)).max(axis=1)
    turns = np.abs(motion.lengths) * np.maximum(rate[:-1], rate[1:])
    first, turned = 0, 0.0
    for k in range(count):
        turned += turns[k]
        if k + 1 - first == TOGETHER or k + 1 == count or turned + turns[k + 1] > TURN:
            yield first, k + 1
            first, turned = k + 1, 0.0
