"""Tangent vectors of massless particles in a Wisdom–Holman map: eight particles in lanes, several vectors of each.

The particles march by the kernels of `orbits.kernels.maps.jacobi_particles`. What their vectors need of a step is
computed once: the `Flow` of the Kepler motion, and the derivative of the kick, a matrix, with T = Dg and s = h^2/12

    plain      T
    lazy       T(r' + s g) (1 + s T)
    modified   T + s T^2 + s D^2 g (g, .)

The planets have no variations. Passages that the map cannot follow are noted on the way, by the rule by which others
leave it (`orbits.kernels.search.encounters_of_particles`).

Sources: those of `orbits.kernels.tangents.map_stages`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from orbits.kernels.binding import plus
from orbits.kernels.compile import kernel
from orbits.kernels.lanes import (
    WIDTH,
    any_lane,
    fma,
    full,
    get,
    load,
    rsqrt_cubed,
    select,
    store,
    unit,
)
from orbits.kernels.maps.jacobi_particles import (
    central,
    drifted_particles,
    interaction,
    kicked_particles,
    seen_at,
    store_marched,
    take_particles,
    with_interaction,
)
from orbits.kernels.maps.jacobi_tables import of_places, table_rows
from orbits.kernels.maps.orbits import change_of_place
from orbits.kernels.maps.programs import KICK, LAZY, MODIFIED, SHIFT, WHOLE
from orbits.kernels.maps.threes import added, dot, load_three, minus, store_three, times
from orbits.kernels.search.context import flat
from orbits.kernels.search.encounters_of_particles import HILL2, Seen, falls, meets
from orbits.kernels.steps import Model
from orbits.kernels.tangents.growth import add_growth
from orbits.kernels.tangents.of_kepler_flow import flow_change, flow_of

NEAR, WHICH, SHARP = 0, 1, 2
"""Rows of what is noted of eight particles: the step with the first passage near a planet, the number of that planet,
and the step with the first pericentre that is not resolved; infinite for none."""


class Matrix(NamedTuple):
    """The derivative of a kick, by rows."""

    xx: Any
    xy: Any
    xz: Any
    yx: Any
    yy: Any
    yz: Any
    zx: Any
    zy: Any
    zz: Any


class Fans(NamedTuple):
    """The vectors of particles, (groups, count, 6, 8), dr' and its velocity; their growth, (groups, count, 5, 8), see
    `orbits.kernels.tangents.growth`; and the unit of time in which velocities count in their lengths.
    """

    vectors: Any
    growth: Any
    scale: Any


@kernel
def follow_particles(tag, strength, coefficients, h, begun, steps, storage, fans, rules, found):
    """March particles by `steps` steps of h through the tables of the planets, and their vectors.

    tag, strength : of Newton's gravity; begun : the number of steps before
    storage : the memory of the particles, the tables, and workspace, see `orbits.kernels.maps.jacobi_particles`; and
        the share of the particles
    rules : what passages are noted by, see `orbits.kernels.search.encounters_of_particles`
    found : (groups, 3, 8), see `NEAR`
    """
    count, half, whole, shift = strength.shape[0] - 2, 0.5 * h, coefficients[0, WHOLE], coefficients[0, SHIFT]
    kick, after, model = int(coefficients[0, KICK]), table_rows(count), Model(tag, strength)
    lazy, stages, rows, stop = kick == LAZY, storage.stages, storage.scratch, storage.share.stop
    for p in range(storage.share.start, stop, WIDTH):
        there = full(1.0)
        for j in range(WIDTH):
            if p + j >= stop:
                there = there - unit(j)
        group = p // WIDTH
        marched = take_particles(storage.carry, p, there, rows)
        marched = with_interaction(model, stages[0], 0, shift, lazy, marched, rows)
        matrix = kick_matrix(stages[0], 0, count, kick, shift, marched, rows)
        seen = _seen(stages[0], count, marched, rows)
        for k in range(steps):
            table, before = stages[k], marched
            marched, change = drifted_particles(before, whole, half, None)
            push = times(half, before.g)
            flow = flow_of(
                before.orbits.place,
                plus(before.orbits.velocity, push),
                before.gm,
                full(h),
                change_of_place(before.orbits, marched.orbits),
                minus(change, push),
            )
            g = interaction(model, table, after, shift, lazy, marched, rows)
            marched = kicked_particles(marched, change, half, g)
            last = matrix
            matrix = kick_matrix(table, after, count, kick, shift, marched, rows)
            now = abs(h * begun) + k * abs(h)
            for w in range(fans.vectors.shape[1]):
                _advance(flow, last, matrix, half, fans.vectors[group, w])
                _measure(now, abs(h), fans.scale, fans.vectors[group, w], fans.growth[group, w])
            old, seen = seen, _seen(table, after + count, marched, rows)
            _note(rules, 1.0 * (begun + k), k, old, seen, found[group])
        store_marched(storage.carry, p, marched, rows)


@kernel(inline=True)
def _seen(table, places, marched, rows):
    """Return particles as observers see them."""
    x, y, z, _, _, _, vx, vy, vz, _, _, _ = seen_at(table, places, marched, rows)
    return Seen(x, y, z, vx, vy, vz)


@kernel(inline=True)
def _advance(flow, last, matrix, half, vector):
    """Take a step of a vector of each of eight particles: half a kick, a Kepler motion, half a kick."""
    place = load_three(vector, 0)
    velocity = added(load_three(vector, 3), half, _times(last, place))
    way, change = flow_change(flow, place, velocity)
    place = plus(place, way)
    store_three(vector, 0, place)
    store_three(vector, 3, added(plus(velocity, change), half, _times(matrix, place)))


@kernel(inline=True)
def _times(matrix, a):
    x, y, z = a
    return (
        fma(matrix.xx, x, fma(matrix.xy, y, matrix.xz * z)),
        fma(matrix.yx, x, fma(matrix.yy, y, matrix.yz * z)),
        fma(matrix.zx, x, fma(matrix.zy, y, matrix.zz * z)),
    )


@kernel(inline=True)
def _measure(t, h, scale, vector, growth):
    """Add a step of h from t to the growth of a vector of each of eight particles."""
    (x, y, z), velocity = load_three(vector, 0), times(scale, load_three(vector, 3))
    now = fma(x, x, fma(y, y, fma(z, z, dot(velocity, velocity))))
    factor = add_growth(t, h, now, growth)
    if any_lane(factor < 1.0):
        for row in range(6):
            store(vector, row, factor * load(vector, row))


@kernel(inline=True)
def _powers(d):
    """Return |d|^-3 and |d|^-2."""
    r2 = dot(d, d)
    cubed = rsqrt_cubed(r2)
    near = cubed * r2
    return cubed, near * near


@kernel(inline=True)
def _with_pull(T, w, d):
    """Return a matrix with w times the derivative of d / |d|^3."""
    (x, y, z), (cubed, squared) = d, _powers(d)
    w = w * cubed
    fx, fy, fz = times(-3.0 * w * squared, d)
    return (
        fma(fx, x, T[0] + w), fma(fx, y, T[1]), fma(fx, z, T[2]),
        fma(fy, y, T[3] + w), fma(fy, z, T[4]), fma(fz, z, T[5] + w),
    )  # fmt: skip


@kernel(inline=True)
def _with_bend(T, w, d, e):
    """Return a matrix with w times the change of the derivative of d / |d|^3 along e."""
    (x, y, z), (cubed, squared), along = d, _powers(d), dot(d, e)
    f = -3.0 * w * cubed * squared
    b = -2.5 * along * squared  # half of the coefficient of x x
    (ax, ay, az), own = times(f, added(e, b, d)), f * along
    return (
        T[0] + fma(2.0 * ax, x, own), T[1] + fma(ax, y, ay * x), T[2] + fma(ax, z, az * x),
        T[3] + fma(2.0 * ay, y, own), T[4] + fma(ay, z, az * y), T[5] + fma(2.0 * az, z, own),
    )  # fmt: skip


@kernel(inline=True)
def _derivative(line, first, count, second, place, centre, marched):
    """Return T at a place relative to R_i, six numbers, and g there; see `orbits.kernels.maps.jacobi_particles`."""
    u, g, none = plus(place, centre[0]), centre[1], 0.0 * place[0]
    T = none, none, none, none, none, none
    for j in range(count):
        row = WIDTH * (first + j)
        d, mass = minus(load_three(line, row + 3 * second), u), get(line, row + 6)
        T = _with_pull(T, full(-mass), d)
        g = added(g, mass * _powers(d)[0], d)
    pull = central(line, first + count, marched)
    T = _with_pull(_with_pull(T, marched.gm, place), -pull, u)
    kepler, near = times(marched.gm * _powers(place)[0], place), times(pull * _powers(u)[0], u)
    return T, plus(g, minus(kepler, near))


@kernel
def kick_matrix(table, first, count, kick, shift, marched, rows):
    """Return the derivative of the kick of eight particles, by a table of the planets."""
    line, places = flat(table), first + count
    place, number, common = marched.orbits.place, marched.number, marched.common
    centre = of_places(line, places, 0, number, common, rows)
    T, g = _derivative(line, first, count, 0, place, centre, marched)
    if kick == LAZY:
        moved = of_places(line, places, 1, number, common, rows)
        U, _ = _derivative(line, first, count, 1, added(place, shift, g), moved, marched)
        return _product(U, T, shift, U)
    if kick == MODIFIED:
        shifted, u, B = times(shift, g), plus(place, centre[0]), T
        e = plus(shifted, of_places(line, places, 1, number, common, rows)[0])
        for j in range(count):
            row = WIDTH * (first + j)
            d, apart = minus(load_three(line, row), u), minus(load_three(line, row + 3), e)
            B = _with_bend(B, full(-get(line, row + 6)), d, apart)
        B = _with_bend(B, marched.gm, place, shifted)
        B = _with_bend(B, -central(line, places, marched), u, e)
        return _product(T, T, shift, B)
    return Matrix(T[0], T[1], T[2], T[1], T[3], T[4], T[2], T[4], T[5])


@kernel(inline=True)
def _product(U, T, s, B):
    """Return B + s U T of symmetric matrices."""
    ax, ay, az = s * U[0], s * U[1], s * U[2]
    bx, by, bz = s * U[1], s * U[3], s * U[4]
    cx, cy, cz = s * U[2], s * U[4], s * U[5]
    return Matrix(
        fma(ax, T[0], fma(ay, T[1], fma(az, T[2], B[0]))),
        fma(ax, T[1], fma(ay, T[3], fma(az, T[4], B[1]))),
        fma(ax, T[2], fma(ay, T[4], fma(az, T[5], B[2]))),
        fma(bx, T[0], fma(by, T[1], fma(bz, T[2], B[1]))),
        fma(bx, T[1], fma(by, T[3], fma(bz, T[4], B[3]))),
        fma(bx, T[2], fma(by, T[4], fma(bz, T[5], B[4]))),
        fma(cx, T[0], fma(cy, T[1], fma(cz, T[2], B[2]))),
        fma(cx, T[1], fma(cy, T[3], fma(cz, T[4], B[4]))),
        fma(cx, T[2], fma(cy, T[4], fma(cz, T[5], B[5]))),
    )


@kernel
def _note(rules, step, k, before, after, found):
    """Note the first passage of each of eight particles near a planet, and the first pericentre that is not resolved.

    step, k : the number of the step, in the march and in the block; before, after : the particles at its ends
    """
    for j in range(rules.near.shape[1]):
        if rules.near[HILL2, j] != 0.0:
            near = meets(rules, k, j, before, 1.0, 1.0) + meets(rules, k + 1, j, after, -1.0, 1.0) > 0.0
            first = near * (load(found, NEAR) > step)
            store(found, NEAR, select(first, full(step), load(found, NEAR)))
            store(found, WHICH, select(first, full(1.0 * j), load(found, WHICH)))
    sharp = falls(rules, k + 1, after, 1.0)
    store(found, SHARP, select(sharp * (load(found, SHARP) > step), full(step), load(found, SHARP)))
