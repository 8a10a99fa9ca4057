"""Variational partitioned Runge–Kutta methods among bodies whose motion is given, as in an ephemeris.

Massive bodies 0 ... n - 1 are where their series have them at the stages and at the ends of a step, which takes the
place of their equations; the rows of the others, with masses that the given ones do not feel, and massless particles
satisfy those of `orbits.integrators.canonical.bodies`. A step without others evaluates no force.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from orbits.integrators.canonical.bodies import CanonicalBodies, evaluate, guess, iterate, put
from orbits.integrators.canonical.end import momenta, settle
from orbits.integrators.canonical.form import combine
from orbits.integrators.canonical.lengths import prepare, stretch
from orbits.integrators.canonical.particles import step_particles
from orbits.integrators.canonical.room import HOURS, INVERSE, MU, MU_BAR, stages_in, work_in
from orbits.integrators.collocation.lengths import least_kick
from orbits.integrators.collocation.rows import HB, HC, HC_LO, LAST, WEIGHTS, is_close
from orbits.kernels.binding import Tag, dimension
from orbits.kernels.compile import kernel
from orbits.kernels.compile.verbs import verb
from orbits.kernels.ephemeris.chebyshev import ROW, given_in, held_by, place_given
from orbits.kernels.lanes import WIDTH, fma, full, largest, load, select, store, total, unit
from orbits.kernels.steps import NOT_CONVERGED, NOT_FINITE, OK
from orbits.kernels.sums.summation import moved


@kernel(inline=True)
def place_between(given, t, ahead, ends, stages, d):
    """Write the given bodies at the times t + ahead of stages, and at the ends of a step, t + the first two of `ends`;
    ahead, ends : `Lanes`.
    """
    n, held, Q, V = d // 3, held_by(given), stages.Q, stages.V
    place_given(given, t, ends, n, Q, V)
    for i in range(held):
        for k in range(i, d, n):
            stages.q[k], stages.v[k], stages.q_end[k], stages.v_end[k] = Q[k, 0], V[k, 0], Q[k, 1], V[k, 1]
    place_given(given, t, ahead, n, Q, V)
    for k in range(stages.Q_lo.shape[0]):
        store(stages.Q_lo, k, full(0.0))


@kernel(inline=True)
def step(method, model, t, h, state, storage):
    """Take one step."""
    q, q_lo, v, v_lo = state
    d = dimension(model.tag, model.parameters)
    given, stages = given_in(model.tag, model.parameters), stages_in(storage.stages, q.shape[0])
    n, held = d // 3, held_by(given)
    place_between(given, t, load(method.coefficients[0], HOURS), h * unit(1), stages, d)
    status, body, evaluations = OK, 0, 0
    if held < n:
        status, body, evaluations = step_others(method, model, t, h, state, storage, held)
    if status == OK:
        for i in range(held):
            for k in range(i, d, n):
                q[k], q_lo[k], v[k], v_lo[k] = stages.q_end[k], 0.0, stages.v_end[k], 0.0
    return status, body, evaluations


@kernel(inline=True)
def sweep(equations, first):
    """As `canonical.bodies.sweep`, for bodies `held` ... n - 1."""
    method, model, times, q, v, stages, work, held = equations
    table, strength, d = method.coefficients[0], model.parameters[0], dimension(model.tag, model.parameters)
    n, hb = d // 3, load(table, HB)
    for i in range(held, n):
        for k in range(i, d, n):
            W = load(work.W, k)
            store(work.change, k, hb * W)
            store(stages.V, k, v[k] + W)
        for k in range(i, d, n):
            put(method, stages, k, q[k], load(work.base, k) + combine(table, MU, work.change, k))
    evaluate(method, model, times, stages, work, d)
    for i in range(held, n):
        for k in range(i, d, n):
            W = combine(table, MU_BAR, work.G, k) - (load(work.S, k) - work.s[k]) / strength[1 + i]
            store(work.change, k, abs(W) if first else abs(W - load(work.W, k)))
            store(work.W, k, W)
    return work.change, True


STAGES = Tag("stages among given bodies", {"sweep": sweep})


@kernel
def step_others(method, model, t, h, state, storage, held):
    """Take one step of bodies `held` ... n - 1 among those that are placed; the arguments are those of a step."""
    table, strength = method.coefficients[0], model.parameters[0]
    q, q_lo, v, v_lo = state
    d = dimension(model.tag, model.parameters)
    n, blocks, rows = d // 3, (d + WIDTH - 1) // WIDTH, q.shape[0]
    carry, work, stages = storage.carry, work_in(storage.scratch, rows, 0), stages_in(storage.stages, rows)
    times = load(table, HOURS) + t
    hc, hc_lo = load(table, HC), load(table, HC_LO)
    for k in range(WIDTH * blocks):
        store(work.change, k, full(0.0))
    for i in range(held, n):
        for k in range(i, d, n):
            stages.q[k], stages.v[k] = q[k], v[k]
            store(work.base, k, fma(hc, full(v[k]), hc_lo * v[k] + hc * v_lo[k] + q_lo[k]))
            cold = largest(abs(load(carry, k))) == 0.0
            store(work.W, k, full(0.0) if cold else guess(method, table, carry, k, v[k]))
    momenta(model, t, stages.q, stages.v, work.f, work.s)
    equations = method, model, times, q, v, stages, work, held
    status, body, evaluations = iterate(STAGES, equations, work.history, n, d)
    if status != OK:
        return status, body, evaluations
    body = finish_others(method, model, t + h, h, state, stages, work, held)
    if body >= 0:
        return NOT_CONVERGED, body, evaluations
    for i in range(held, n):
        for k in range(i, d, n):
            leave(method, table, stages, work, k, work.s[k], strength[1 + i], carry)
            if (q[k] + v[k]) * 0.0 != 0.0:
                return NOT_FINITE, i, evaluations
    return OK, 0, evaluations


@verb
def leave(method, table, stages, work, k, s, mass, carry):
    """Write into the carry what the next step begins with: the velocities of the stages, or the kicks by which they are
    a polynomial.
    """
    if not is_close(method):
        return lambda method, table, stages, work, k, s, mass, carry: store(carry, k, load(stages.V, k))

    def kicks(method, table, stages, work, k, s, mass, carry):
        store(work.change, k, (load(work.S, k) - s) / mass)
        store(carry, k, load(work.G, k) - combine(table, INVERSE, work.change, k))

    return kicks


@kernel
def finish_others(method, model, t, h, state, stages, work, held):
    """Advance positions and velocities of bodies `held` ... n - 1 to the time t, the end of the step. Returns a body
    whose velocity does not converge, or -1.
    """
    q, q_lo, v, v_lo = state
    hb = load(method.coefficients[0], HB)
    d = dimension(model.tag, model.parameters)
    n = d // 3
    for i in range(held, n):
        for k in range(i, d, n):
            q[k], q_lo[k] = moved(h, q[k], q_lo[k], v[k], v_lo[k], total(hb * load(work.W, k)))
            work.kick[k], work.kick_lo[k] = total(load(work.G, k)), 0.0
            stages.q_end[k], stages.v_end[k] = q[k], v[k] + work.kick[k]
    return settle(model, t, state, stages, work, held, d)


@kernel
def signal(method, model, h, state, storage):
    """Return the error signal of the bodies that are not given; see `orbits.integrators.collocation.lengths.signal`."""
    table, L = method.coefficients[0], storage.carry
    given, d = given_in(model.tag, model.parameters), dimension(model.tag, model.parameters)
    n, last, weights = d // 3, load(table, LAST), load(table, WEIGHTS)
    inverse, worst = select(weights > 0.0, 1.0 / weights, full(0.0)), 0.0
    for i in range(held_by(given), n):
        rest = most = 0.0
        for k in range(i, d, n):
            rest, most = max(rest, abs(total(last * load(L, k)))), max(most, largest(abs(inverse * load(L, k))))
        worst = max(worst, rest / max(most, least_kick(model, h, state, i)))
    return worst


@dataclass(frozen=True)
class GivenBodies(CanonicalBodies):
    """The form of a variational partitioned Runge–Kutta method of up to eight stages among given bodies."""

    kernels: ClassVar[Mapping[str, Any]] = {
        "begin": None,
        "step": step,
        "step_particles": step_particles,
        "width": 1,
        "stretch": stretch,
        "given": 1,
    }

    kernels_of_lengths: ClassVar[Mapping[str, Any]] = {"prepare": prepare, "signal": signal, "speeds": 1}

    @staticmethod
    def held(parameters: Any) -> int:
        """Return the number of bodies that are given, from the vectors of a Lagrangian."""
        tables = next(vector for vector in parameters if isinstance(vector, tuple))
        return int(tables[0][-1, ROW]) + 1

    @property
    def is_dense(self) -> bool:
        """False: there is no polynomial through the forces on bodies that are given."""
        return False
