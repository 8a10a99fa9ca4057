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
    drifted_particles,
    interaction,
    kicked_particles,
    seen_at,
    store_marched,
    take_particles,
    with_interaction,
)
from orbits.kernels.maps.jacobi_tables import of_places, table_rows
from orbits.kernels.maps.orbits import place_of, times
from orbits.kernels.maps.programs import KICK, LAZY, MODIFIED, SHIFT, WHOLE
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
        seen = _seen(stages[0], 0, marched, rows)
        for k in range(steps):
            table, before = stages[k], marched
            marched, (ax, ay, az) = drifted_particles(before, whole, half)
            (kx, ky, kz), begun_at, now_at = times(half, before.g), before.orbits, marched.orbits
            flow = flow_of(
                place_of(begun_at),
                (begun_at.vx + kx, begun_at.vy + ky, begun_at.vz + kz),
                before.gm,
                full(h),
                (
                    (now_at.x - begun_at.x) + (now_at.x_lo - begun_at.x_lo),
                    (now_at.y - begun_at.y) + (now_at.y_lo - begun_at.y_lo),
                    (now_at.z - begun_at.z) + (now_at.z_lo - begun_at.z_lo),
                ),
                (ax - kx, ay - ky, az - kz),
            )
            g = interaction(model, table, after, shift, lazy, marched, rows)
            marched = kicked_particles(marched, (ax, ay, az), half, g)
            last = matrix
            matrix = kick_matrix(table, after, count, kick, shift, marched, rows)
            now = abs(h * begun) + k * abs(h)
            for w in range(fans.vectors.shape[1]):
                _advance(flow, last, matrix, half, fans.vectors[group, w])
                _measure(now, abs(h), fans.scale, fans.vectors[group, w], fans.growth[group, w])
            old, seen = seen, _seen(table, after, marched, rows)
            _note(rules, 1.0 * (begun + k), k, old, seen, found[group])
        store_marched(storage.carry, p, marched, rows)


@kernel(inline=True)
def _seen(table, first, marched, rows):
    """Return particles as observers see them."""
    x, y, z, _, _, _, vx, vy, vz, _, _, _ = seen_at(table, first, marched, rows)
    return Seen(x, y, z, vx, vy, vz)


@kernel(inline=True)
def _advance(flow, last, matrix, half, vector):
    """Take a step of a vector of each of eight particles: half a kick, a Kepler motion, half a kick."""
    x, y, z = load(vector, 0), load(vector, 1), load(vector, 2)
    kx, ky, kz = _times(last, x, y, z)
    vx, vy, vz = fma(half, kx, load(vector, 3)), fma(half, ky, load(vector, 4)), fma(half, kz, load(vector, 5))
    dx, dy, dz, dvx, dvy, dvz = flow_change(flow, x, y, z, vx, vy, vz)
    x, y, z = x + dx, y + dy, z + dz
    kx, ky, kz = _times(matrix, x, y, z)
    store(vector, 0, x)
    store(vector, 1, y)
    store(vector, 2, z)
    store(vector, 3, fma(half, kx, vx + dvx))
    store(vector, 4, fma(half, ky, vy + dvy))
    store(vector, 5, fma(half, kz, vz + dvz))


@kernel(inline=True)
def _times(matrix, x, y, z):
    return (
        fma(matrix.xx, x, fma(matrix.xy, y, matrix.xz * z)),
        fma(matrix.yx, x, fma(matrix.yy, y, matrix.yz * z)),
        fma(matrix.zx, x, fma(matrix.zy, y, matrix.zz * z)),
    )


@kernel(inline=True)
def _measure(t, h, scale, vector, growth):
    """Add a step of h from t to the growth of a vector of each of eight particles."""
    x, y, z = load(vector, 0), load(vector, 1), load(vector, 2)
    vx, vy, vz = scale * load(vector, 3), scale * load(vector, 4), scale * load(vector, 5)
    now = fma(x, x, fma(y, y, fma(z, z, fma(vx, vx, fma(vy, vy, vz * vz)))))
    factor = add_growth(t, h, now, growth)
    if any_lane(factor < 1.0):
        for row in range(6):
            store(vector, row, factor * load(vector, row))


@kernel(inline=True)
def _pull(x, y, z):
    """Return r^-3 and r^-2."""
    r2 = fma(x, x, fma(y, y, z * z))
    cubed = rsqrt_cubed(r2)
    near = cubed * r2
    return cubed, near * near


@kernel(inline=True)
def _with_pull(T, w, x, y, z):
    """Return a matrix with w times the derivative of (x, y, z) / r^3."""
    cubed, squared = _pull(x, y, z)
    w = w * cubed
    f = -3.0 * w * squared
    fx, fy, fz = f * x, f * y, f * z
    return (
        fma(fx, x, T[0] + w), fma(fx, y, T[1]), fma(fx, z, T[2]),
        fma(fy, y, T[3] + w), fma(fy, z, T[4]), fma(fz, z, T[5] + w),
    )  # fmt: skip


@kernel(inline=True)
def _with_bend(T, w, x, y, z, ex, ey, ez):
    """Return a matrix with w times the change of the derivative of (x, y, z) / r^3 along (ex, ey, ez)."""
    cubed, squared = _pull(x, y, z)
    f = -3.0 * w * cubed * squared
    along = fma(x, ex, fma(y, ey, z * ez))
    b = -2.5 * along * squared  # half of the coefficient of x x
    ax, ay, az, own = f * fma(b, x, ex), f * fma(b, y, ey), f * fma(b, z, ez), f * along
    return (
        T[0] + fma(2.0 * ax, x, own), T[1] + fma(ax, y, ay * x), T[2] + fma(ax, z, az * x),
        T[3] + fma(2.0 * ay, y, own), T[4] + fma(ay, z, az * y), T[5] + fma(2.0 * az, z, own),
    )  # fmt: skip


@kernel(inline=True)
def _derivative(line, first, count, second, place, centre, marched):
    """Return T at a place relative to R_i, six numbers, and g there; see `orbits.kernels.maps.jacobi_particles`."""
    (x, y, z), (cx, cy, cz, bx, by, bz) = place, centre
    ux, uy, uz = x + cx, y + cy, z + cz
    zero = 0.0 * x
    T = zero, zero, zero, zero, zero, zero
    gx, gy, gz = bx, by, bz
    planets = WIDTH * (first + 3 * (count + 1))
    for j in range(count):
        row = planets + WIDTH * j
        at = row + 3 * second
        dx, dy, dz, mass = get(line, at) - ux, get(line, at + 1) - uy, get(line, at + 2) - uz, get(line, row + 6)
        T = _with_pull(T, full(-mass), dx, dy, dz)
        w = mass * _pull(dx, dy, dz)[0]
        gx, gy, gz = fma(w, dx, gx), fma(w, dy, gy), fma(w, dz, gz)
    central = select(marched.gm > 0.0, get(line, WIDTH * first + 7), 0.0)
    T = _with_pull(T, marched.gm, x, y, z)
    T = _with_pull(T, -central, ux, uy, uz)
    kepler, pull = marched.gm * _pull(x, y, z)[0], central * _pull(ux, uy, uz)[0]
    gx, gy, gz = gx + (kepler * x - pull * ux), gy + (kepler * y - pull * uy), gz + (kepler * z - pull * uz)
    return T, (gx, gy, gz)


@kernel
def kick_matrix(table, first, count, kick, shift, marched, rows):
    """Return the derivative of the kick of eight particles, by a table of the planets."""
    line = flat(table)
    (x, y, z), number, common = place_of(marched.orbits), marched.number, marched.common
    centre = of_places(line, first, 0, number, common, rows)
    T, g = _derivative(line, first, count, 0, (x, y, z), centre, marched)
    if kick == LAZY:
        moved = of_places(line, first, 1, number, common, rows)
        place = fma(shift, g[0], x), fma(shift, g[1], y), fma(shift, g[2], z)
        U, _ = _derivative(line, first, count, 1, place, moved, marched)
        return _product(U, T, shift, U)
    if kick == MODIFIED:
        moved = of_places(line, first, 1, number, common, rows)
        sx, sy, sz = shift * g[0], shift * g[1], shift * g[2]
        ex, ey, ez = sx + moved[0], sy + moved[1], sz + moved[2]
        ux, uy, uz = x + centre[0], y + centre[1], z + centre[2]
        B = T
        planets = WIDTH * (first + 3 * (count + 1))
        for j in range(count):
            row = planets + WIDTH * j
            B = _with_bend(
                B, full(-get(line, row + 6)),
                get(line, row) - ux, get(line, row + 1) - uy, get(line, row + 2) - uz,
                get(line, row + 3) - ex, get(line, row + 4) - ey, get(line, row + 5) - ez,
            )  # fmt: skip
        central = select(marched.gm > 0.0, get(line, WIDTH * first + 7), 0.0)
        B = _with_bend(B, marched.gm, x, y, z, sx, sy, sz)
        B = _with_bend(B, -central, ux, uy, uz, ex, ey, ez)
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
