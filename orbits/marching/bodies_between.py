"""Where the massive bodies are within their steps, for particles with steps of their own.

The polynomial through the forces at the s stages of a step gives the positions in between to 1e-13 of the orbit at a
tolerance of 1e-9, a hundred times worse than at its ends. Therefore the forces are evaluated once more, at eight other
points in the positions that it gives, and a polynomial through all s + 8 forces, of s + 4 Legendre polynomials by least
squares, takes its place: what remains is round-off. With C_k its coefficients, and J_k as in `orbits.kernels.dense`,

    q(theta) = q + h theta v + h sum_k C_k J_k(theta).

Steps are treated when a particle first needs them.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from orbits.integrators.forms import Array
from orbits.kernels.binding import accelerate_close, bodies
from orbits.kernels.compile import kernel
from orbits.kernels.dense import double_integrals
from orbits.kernels.lanes import WIDTH, fma, full, load, store
from orbits.kernels.summation import two_sum
from orbits.tableaux import SymplecticTableau

MODES = 12
"""The most Legendre polynomials of the forces in a step."""

MORE = 4
"""How many there are beyond one for each stage."""

POINTS, FIRST, FITTED = 0, 1, 9
"""Rows of a chart, (41, 8): the eight other points; eight rows that lead from L of the stages to the first modes; and
32 that lead to all modes, two rows of eight for each of the eight stages and then for each of the other points.
"""


def chart(tableau: SymplecticTableau) -> Array:
    """Return the numbers by which modes are computed from forces, (41, 8), for up to eight stages."""
    s, nodes = tableau.stages, tableau.nodes
    extrema: Array = np.polynomial.legendre.Legendre.basis(WIDTH + 1).deriv().roots().real
    points = 0.5 * (1.0 + extrema)
    count = min(s + MORE, MODES)
    everywhere = np.polynomial.legendre.legvander(2.0 * np.concatenate([nodes, points]) - 1.0, count - 1)
    fit = np.zeros((2 * WIDTH, 2 * WIDTH))  # rows: stages, then points; columns: modes
    solved = np.linalg.pinv(everywhere)
    fit[:s, :count] = solved[:, :s].T / tableau.b[:, None]
    fit[WIDTH:, :count] = solved[:, s:].T
    out = np.zeros((FITTED + 4 * WIDTH, WIDTH))
    out[POINTS] = points
    values = np.polynomial.legendre.legvander(2.0 * nodes - 1.0, s - 1)
    out[FIRST : FIRST + s, :s] = (np.linalg.inv(values) / tableau.b).T
    out[FITTED:] = fit.reshape(4 * WIDTH, WIDTH)
    return out


class Field(NamedTuple):
    """The steps that the massive bodies have taken in a block, in which particles follow.

    origin, times : the time at which the block began, and the workspace of its clock: first the times since then at
        which its steps begin and the last ends
    stages : (steps, rows, 8), with low parts; path : flat, q and v at the beginning of each step, each padded
    kicks : (steps, rows, 8), the carry after each step
    chart : see `chart`; modes : (steps, 3n, 16), those of the steps that are `known`, (steps,) bool
    room : (8 + MODES + rows of stages, 8), workspace; from row `PLACES` on it has what `place_bodies` writes
    """

    origin: Any
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
    """Return the length of step k to the last bit; see `orbits.marching.adaptive.Adaptive.room`."""
    kept = field.times.shape[0] - 2 * field.stages.shape[1] - WIDTH * field.kicks.shape[1]
    return field.times[kept // 2 + k]


PLACES = MODES
"""The row of the workspace from which on it has positions of bodies."""


@kernel
def learn(method, model, field, k):
    """Compute the modes of step k."""
    size, stride = 3 * bodies(model.tag, model.parameters), field.stages.shape[1] // 2
    table, modes, kicks, room = field.chart, field.modes[k], field.kicks[k], field.room
    h, forces = length_of(field, k), room[PLACES + 2 * stride :]
    for i in range(size):
        first = full(0.0)
        for j in range(WIDTH):
            first = first + load(table, FIRST + j) * kicks[i, j]
        store(modes[i], 0, first)
        store(modes[i], WIDTH, full(0.0))
    _place(field, k, load(table, POINTS), size)
    places, low_parts = room[PLACES : PLACES + stride], room[PLACES + stride : PLACES + 2 * stride]
    accelerate_close(model.tag, model.parameters, places, low_parts, forces)
    for i in range(size):
        first = second = full(0.0)
        for j in range(WIDTH):
            at = FITTED + 2 * j
            first, second = first + load(table, at) * kicks[i, j], second + load(table, at + 1) * kicks[i, j]
        for j in range(WIDTH):
            at, force = FITTED + 2 * (WIDTH + j), h * forces[i, j]
            first, second = first + load(table, at) * force, second + load(table, at + 1) * force
        store(modes[i], 0, first)
        store(modes[i], WIDTH, second)
    field.known[k] = True


@kernel(inline=True)
def place_bodies(method, model, field, k, theta):
    """Write the positions of the bodies at eight fractions of step k, and their low parts, into the workspace."""
    if not field.known[k]:
        learn(method, model, field, k)
    _place(field, k, theta, 3 * bodies(model.tag, model.parameters))


@kernel(inline=True)
def _place(field, k, theta, size):
    """Write positions, and their low parts, by the modes of step k."""
    room, modes, stride = field.room, field.modes[k], field.stages.shape[1] // 2
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
        store(room, PLACES + stride + i, low)
