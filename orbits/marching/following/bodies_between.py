"""Where the massive bodies are within their steps, for particles with steps of their own.

The polynomial through the forces at the s stages of a step gives the positions in between to 1e-13 of the orbit at a
tolerance of 1e-9, a hundred times worse than at its ends. Therefore the forces are evaluated once more, at eight other
points in the positions that it gives, and a polynomial through all s + 8 forces, of s + 4 Legendre polynomials by least
squares, takes its place: what remains is round-off. With C_k its coefficients, and J_k as in `orbits.kernels.dense`,

    q(theta) = q + h theta v + h sum_k C_k J_k(theta).

With terms that depend on velocities, or forces, the velocities are needed as well, v(theta) = v + sum_k C_k I_k(theta).
What is fitted there is the acceleration v' = (dL/dq + f - ds/dt) / m; s, the contribution of terms to the momenta, is
differentiated as a polynomial through its values at the other points and at the beginning of the step.

Steps are treated when a particle first needs them.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from orbits.integrators.canonical.end import momenta as momenta_of
from orbits.integrators.canonical.room import padded_length, stages_in
from orbits.integrators.collocation.given_bodies import place_between
from orbits.integrators.forms import Array
from orbits.kernels.binding import accelerate_close, bodies, first_term, kernel_of
from orbits.kernels.compile import kernel
from orbits.kernels.compile.verbs import verb
from orbits.kernels.dense import dense, double_integrals, single_integrals
from orbits.kernels.ephemeris.chebyshev import given_in, place_given
from orbits.kernels.gravity.terms_and_forces import add_acting, add_terms
from orbits.kernels.lanes import WIDTH, fma, full, load, store, unit
from orbits.kernels.sums.summation import two_sum
from orbits.tableaux import SymplecticTableau

MODES = 12
"""The most Legendre polynomials of the forces in a step."""

MORE = 4
"""How many there are beyond one for each stage."""

POINTS, FIRST, FITTED, SLOPE = 0, 1, 9, 41
"""Rows of a chart, (49, 8): the eight other points; eight rows that lead from L of the stages to the first modes; 32
that lead to all modes, two rows of eight for each of the eight stages and then for each of the other points; and eight,
one for each of these points, that lead from the values there of a function that begins with 0 to its derivative.
"""


@lru_cache(maxsize=64)
def chart(tableau: SymplecticTableau) -> Array:
    """Return the numbers by which modes are computed from forces, (49, 8), for up to eight stages. They are shared."""
    s, nodes = tableau.stages, tableau.nodes
    extrema: Array = np.polynomial.legendre.Legendre.basis(WIDTH + 1).deriv().roots().real
    points = 0.5 * (1.0 + extrema)
    count = min(s + MORE, MODES)
    everywhere = np.polynomial.legendre.legvander(2.0 * np.concatenate([nodes, points]) - 1.0, count - 1)
    fit = np.zeros((2 * WIDTH, 2 * WIDTH))  # rows: stages, then points; columns: modes
    solved = np.linalg.pinv(everywhere)
    fit[:s, :count] = solved[:, :s].T / tableau.b[:, None]
    fit[WIDTH:, :count] = solved[:, s:].T
    out = np.zeros((SLOPE + WIDTH, WIDTH))
    out[POINTS] = points
    values = np.polynomial.legendre.legvander(2.0 * nodes - 1.0, s - 1)
    out[FIRST : FIRST + s, :s] = (np.linalg.inv(values) / tableau.b).T
    out[FITTED:SLOPE] = fit.reshape(4 * WIDTH, WIDTH)
    basis = [np.polynomial.legendre.Legendre.basis(k, domain=[0.0, 1.0]) for k in range(WIDTH)]
    through = np.stack([points * one(points) for one in basis], axis=1)  # times the fraction: they begin with 0
    slopes = np.stack([one(points) + points * one.deriv()(points) for one in basis], axis=1)
    out[SLOPE:] = (slopes @ np.linalg.inv(through)).T
    return out


class Field(NamedTuple):
    """The steps that the massive bodies have taken in a block, in which particles follow.

    times : the workspace of its clock: first the times since the block began at which its steps begin and the last ends
    stages : (steps, rows, 8), with low parts; path : flat, q and v at the beginning of each step, each padded
    kicks : (steps, rows, 8), the carry after each step
    chart : see `chart`; modes : (steps, 3n, 16), those of the steps that are `known`, (steps,) bool
    room : (MODES + rows of stages + 3 padded, 8), workspace; from row `PLACES` on it has what `place_bodies` writes
    """

    times: Any
    stages: Any
    path: Any
    kicks: Any
    chart: Any
    modes: Any
    known: Any
    room: Any


@kernel(inline=True)
def length_of(field, k):
    """Return the length of step k to the last bit; see `orbits.marching.clocks.adaptive.Adaptive.room`."""
    return field.times[field.kicks.shape[0] + 1 + k]


@kernel(inline=True)
def time_of(field, k):
    """Return the time at which step k begins for terms and forces; see
    `orbits.marching.clocks.adaptive.Adaptive.room`.
    """
    return field.times[2 * (field.kicks.shape[0] + 1) + k]


PLACES = MODES
"""The row of the workspace from which on it has positions of bodies."""


@kernel
def learn(method, model, field, k):
    """Compute the modes of step k."""
    size = 3 * bodies(model.tag, model.parameters)
    table, modes, kicks, room = field.chart, field.modes[k], field.kicks[k], field.room
    h, stages = length_of(field, k), field.stages.shape[1]
    for i in range(size):
        first = full(0.0)
        for j in range(WIDTH):
            first = first + load(table, FIRST + j) * kicks[i, j]
        store(modes[i], 0, first)
        store(modes[i], WIDTH, full(0.0))
    place(method, model, field, k, load(table, POINTS))
    kicked = room[PLACES + stages :]
    kick_there(method, model, field, k, h, room[PLACES : PLACES + stages], kicked)
    for i in range(size):
        first = second = full(0.0)
        for j in range(WIDTH):
            at = FITTED + 2 * j
            first, second = first + load(table, at) * kicks[i, j], second + load(table, at + 1) * kicks[i, j]
        for j in range(WIDTH):
            at, force = FITTED + 2 * (WIDTH + j), kicked[i, j]
            first, second = first + load(table, at) * force, second + load(table, at + 1) * force
        store(modes[i], 0, first)
        store(modes[i], WIDTH, second)
    field.known[k] = True


@verb
def kick_there(method, model, field, k, h, places, room):
    """Write h times the accelerations of the bodies at `places`, at the eight other points of step k, into rows."""
    if kernel_of(method.types[0], "speeds"):
        return lambda method, model, field, k, h, places, room: _kick_with_terms(model, field, k, h, places, room)

    def by_places(method, model, field, k, h, places, room):
        stride = places.shape[0] // 2
        accelerate_close(model.tag, model.parameters, places[:stride], places[stride:], room)
        for i in range(3 * bodies(model.tag, model.parameters)):
            store(room, i, h * load(room, i))

    return by_places


@kernel
def _kick_with_terms(model, field, k, h, places, room):
    """Write h v' at the eight other points of step k into the first rows of `room`."""
    size, strength = 3 * bodies(model.tag, model.parameters), model.parameters[0]
    n, stride = size // 3, padded_length(size)
    forces, momenta, stages = room[stride : 2 * stride], room[2 * stride : 3 * stride], stages_in(places, stride)
    begin, table = time_of(field, k), field.chart
    s, f = stages.q_end, stages.v_end
    for i in range(size):
        stages.q[i], stages.v[i] = field.path[2 * k * stride + i], field.path[(2 * k + 1) * stride + i]
    momenta_of(model, begin, stages.q, stages.v, f, s)
    accelerate_close(first_term(model.tag), strength, stages.Q, stages.Q_lo, room)
    for i in range(size):
        store(forces, i, full(0.0))
        store(momenta, i, full(0.0))
    times = h * load(table, POINTS) + begin
    add_terms(model.tag, model.parameters, times, stages.Q, stages.V, forces, momenta)
    none = room[:0]  # internal variables, with which particles do not take steps of their own
    add_acting(model.tag, model.parameters, times, stages.Q, stages.V, none, forces, none)
    for i in range(size):
        mass = strength[1 + i % n]
        store(momenta, i, (load(momenta, i) - s[i]) / mass)
        slope = full(0.0)
        for j in range(WIDTH):
            slope = slope + load(table, SLOPE + j) * momenta[i, j]
        store(room, i, h * (load(room, i) + load(forces, i) / mass) - slope)


@verb
def place_bodies(method, model, field, k, theta, begin, end):
    """Write the positions of the bodies at eight fractions of step k, and their low parts, into the workspace; for
    terms that depend on velocities, and for forces, also their velocities, and their states at the fractions `begin`
    and `end`.
    """
    if kernel_of(method.types[0], "given"):
        return lambda method, model, field, k, theta, begin, end: _place_given(model, field, k, theta, begin, end)

    def by_modes(method, model, field, k, theta, begin, end):
        if not field.known[k]:
            learn(method, model, field, k)
        place_ends(method, model, field, k, begin, end)
        place(method, model, field, k, theta)

    return by_modes


@kernel
def _place_given(model, field, k, theta, begin, end):
    """Write the states of bodies that are given; see `place_bodies`."""
    size, h = 3 * bodies(model.tag, model.parameters), length_of(field, k)
    stages = stages_in(field.room[PLACES : PLACES + field.stages.shape[1]], padded_length(size))
    given = given_in(model.tag, model.parameters)
    place_between(given, time_of(field, k), theta * h, begin * h + ((end - begin) * h) * unit(1), stages, size)


@verb
def state_between(method, model, field, k, part, Q, V):
    """Write the state of the bodies at a fraction of step k, for observers."""
    if kernel_of(method.types[0], "given"):

        def from_series(method, model, field, k, part, Q, V):
            size = 3 * bodies(model.tag, model.parameters)
            stages = stages_in(field.room[PLACES : PLACES + field.stages.shape[1]], padded_length(size))
            given = given_in(model.tag, model.parameters)
            place_given(given, time_of(field, k), full(part * length_of(field, k)), size // 3, stages.Q, stages.V)
            for i in range(size):
                Q[i], V[i] = stages.Q[i, 0], stages.V[i, 0]

        return from_series

    def by_kicks(method, model, field, k, part, Q, V):
        stride = padded_length(3 * bodies(model.tag, model.parameters))
        begin = 2 * k * stride
        q, v = field.path[begin : begin + stride], field.path[begin + stride : begin + 2 * stride]
        dense(method, length_of(field, k), q, v, field.kicks[k], part, Q, V)

    return by_kicks


@verb
def place_ends(method, model, field, k, begin, end):
    """Write the states of the bodies at two fractions of step k, if they are needed."""
    if not kernel_of(method.types[0], "speeds"):
        return lambda method, model, field, k, begin, end: None

    def both(method, model, field, k, begin, end):
        size = 3 * bodies(model.tag, model.parameters)
        stages = stages_in(field.room[PLACES : PLACES + field.stages.shape[1]], padded_length(size))
        place(method, model, field, k, begin + (end - begin) * unit(1))
        for i in range(size):
            stages.q[i], stages.v[i] = stages.Q[i, 0], stages.V[i, 0]
            stages.q_end[i], stages.v_end[i] = stages.Q[i, 1], stages.V[i, 1]

    return both


@verb
def place(method, model, field, k, theta):
    """Write positions, their low parts, and velocities if they are needed, by the modes of step k."""
    if not kernel_of(method.types[0], "speeds"):

        def positions(method, model, field, k, theta):
            stride = field.stages.shape[1] // 2
            _place(field, k, theta, 3 * bodies(model.tag, model.parameters), stride, PLACES + stride)

        return positions

    def states(method, model, field, k, theta):
        size = 3 * bodies(model.tag, model.parameters)
        stride = padded_length(size)
        _place_speeds(field, k, theta, size, stride)
        _place(field, k, theta, size, stride, PLACES + field.stages.shape[1] - stride)

    return states


@kernel(inline=True)
def _place_speeds(field, k, theta, size, stride):
    """Write velocities by the modes of step k."""
    room, modes, v = field.room, field.modes[k], (2 * k + 1) * stride
    single_integrals(theta, MODES, room)
    for i in range(size):
        even = load(room, 0) * modes[i, 0]
        odd = load(room, 1) * modes[i, 1]
        for j in range(2, MODES, 2):
            even = even + load(room, j) * modes[i, j]
            odd = odd + load(room, j + 1) * modes[i, j + 1]
        store(room, PLACES + stride + i, field.path[v + i] + (even + odd))


@kernel(inline=True)
def _place(field, k, theta, size, stride, lows):
    """Write positions by the modes of step k, and their low parts from row `lows` on."""
    room, modes = field.room, field.modes[k]
    double_integrals(theta, MODES, room)
    h = length_of(field, k)
    q, v, part = 2 * k * stride, (2 * k + 1) * stride, theta * h
    for i in range(size):
        even = load(room, 0) * modes[i, 0]
        odd = load(room, 1) * modes[i, 1]
        for j in range(2, MODES, 2):
            even = even + load(room, j) * modes[i, j]
            odd = odd + load(room, j + 1) * modes[i, j + 1]
        position, low = two_sum(full(field.path[q + i]), fma(part, full(field.path[v + i]), h * (even + odd)))
        store(room, PLACES + i, position)
        store(room, lows + i, low)
