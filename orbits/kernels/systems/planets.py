"""Wisdom–Holman maps of eight systems at once: rows are what lanes are in `orbits.kernels.jacobi`, with the same bits.

The planets of each system are numbered outwards, as they are alone, so that row i has the i-th of each. The sums over
planets are the same trees of additions.
"""

from __future__ import annotations

from orbits.kernels.compile import kernel
from orbits.kernels.interaction import (
    ATTRACTING,
    CENTRAL,
    INNER,
    MASS,
    OUTER,
    REST,
    SHARE,
    STATE_ROWS,
    Masses,
    Pairs,
    load_three,
    pulls_on_inner,
    store_three,
    tide_of_pair,
    tides_on_inner,
    whole_interaction,
    with_change,
)
from orbits.kernels.jacobi import prepare_room
from orbits.kernels.lanes import WIDTH, fma, full, halves, inverse_powers, joined, load, store
from orbits.kernels.short_kepler import short_increments
from orbits.kernels.summation import accumulate, add_product
from orbits.kernels.systems.sums import before_each, minus, plus, times

MOST_PLANETS = WIDTH
"""The most planets of a system: a register, where it is marched alone."""

CENTRE = STATE_ROWS * MOST_PLANETS
CONSTANTS = CENTRE + STATE_ROWS
FORCE = CONSTANTS + 8 * MOST_PLANETS
PLACE = FORCE + 3 * MOST_PLANETS
CHANGE = PLACE + 3 * MOST_PLANETS
SHIFTED = CHANGE + 3 * MOST_PLANETS
MOVED = SHIFTED + 3 * MOST_PLANETS
POWERS = MOVED + 3 * MOST_PLANETS
PULLS = POWERS + 4 * MOST_PLANETS
INVERSE = PULLS + 12 * MOST_PLANETS
OWN = INVERSE + 8 * MOST_PLANETS
INWARDS = OWN + 3 * MOST_PLANETS
SEEN = INWARDS + 3 * MOST_PLANETS
ROWS = SEEN + 6 * (MOST_PLANETS + 1)
"""Rows: for each planet 12 of its state, r', its velocity and their low parts; the same of the centre of mass; then for
each planet 8 constants, the fields of `Masses`; the interaction; u; the change of velocity; r' displaced, or the
displacement; the displacement of u; the powers -3 and -2 of u and of r'. For each pair its pull, and the same powers of
its distance: first the pairs of neighbours, then those two places apart, three, and four, counted round. Then the sum
of the pulls on each planet, and what it passes on to those inside; and the state of the bodies that is seen.
"""


@kernel(inline=True)
def _masses(rows, i):
    """Return the constants of planet i."""
    first = CONSTANTS + 8 * i
    return Masses(
        load(rows, first),
        load(rows, first + 1),
        load(rows, first + 2),
        load(rows, first + 3),
        load(rows, first + 4),
        load(rows, first + 5),
        load(rows, first + 6),
        load(rows, first + 7),
    )


@kernel(inline=True)
def _share(rows, i):
    return load(rows, CONSTANTS + 8 * i + 1)


@kernel
def gather_planets(strengths, carries, room, rows):
    """Write the states and constants of eight systems into `rows`.

    strengths : (8, 1 + n), see `prepare_room`; carries : (8, rows, 8), the `planets` of each; room : workspace for one
    """
    count = strengths.shape[1] - 2
    for k in range(rows.shape[0]):
        store(rows, k, full(0.0))
    for system in range(WIDTH):
        planets = carries[system]
        prepare_room(strengths[system], planets, room)
        for i in range(count):
            for row in range(STATE_ROWS):
                rows[STATE_ROWS * i + row, system] = planets[row, i]
            first = CONSTANTS + 8 * i
            rows[first, system] = room[MASS, i]
            rows[first + 1, system] = room[SHARE, i]
            rows[first + 2, system] = room[OUTER, i]
            rows[first + 3, system] = room[INNER, i]
            rows[first + 4, system] = room[CENTRAL, i]
            rows[first + 5, system] = room[ATTRACTING, i]
            rows[first + 6, system] = room[REST, i]
            rows[first + 7, system] = room[CENTRAL, 0] / room[INNER, 0]
        for row in range(6):
            rows[CENTRE + row, system] = planets[STATE_ROWS, row]
            rows[CENTRE + 6 + row, system] = planets[STATE_ROWS + 1, row]


@kernel
def scatter_planets(rows, count, carries):
    """Write the states of eight systems back."""
    for system in range(WIDTH):
        planets = carries[system]
        for i in range(count):
            for row in range(STATE_ROWS):
                planets[row, i] = rows[STATE_ROWS * i + row, system]
        for row in range(6):
            planets[STATE_ROWS, row] = rows[CENTRE + row, system]
            planets[STATE_ROWS + 1, row] = rows[CENTRE + 6 + row, system]


@kernel(inline=True)
def store_places(rows, source, stride, out):
    """Write a vector of each planet relative to the dominant body, from that relative to the centre of mass of those
    inside; the first is the same.
    """
    for k in range(3):
        x = (
            load(rows, source + k),
            load(rows, source + stride + k),
            load(rows, source + 2 * stride + k),
            load(rows, source + 3 * stride + k),
            load(rows, source + 4 * stride + k),
            load(rows, source + 5 * stride + k),
            load(rows, source + 6 * stride + k),
        )
        inside = before_each(
            (
                times(_share(rows, 0), x[0]),
                times(_share(rows, 1), x[1]),
                times(_share(rows, 2), x[2]),
                times(_share(rows, 3), x[3]),
                times(_share(rows, 4), x[4]),
                times(_share(rows, 5), x[5]),
                times(_share(rows, 6), x[6]),
            )
        )
        store(rows, out + k, x[0])
        store(rows, out + 3 + k, plus(x[1], inside[0]))
        store(rows, out + 6 + k, plus(x[2], inside[1]))
        store(rows, out + 9 + k, plus(x[3], inside[2]))
        store(rows, out + 12 + k, plus(x[4], inside[3]))
        store(rows, out + 15 + k, plus(x[5], inside[4]))
        store(rows, out + 18 + k, plus(x[6], inside[5]))
        store(rows, out + 21 + k, plus(load(rows, source + 7 * stride + k), inside[6]))


@kernel(inline=True)
def _beyond(rows, k):
    """Return the sums of component k of INWARDS over the planets after each of the first seven, the last one first."""
    return before_each(
        (
            load(rows, INWARDS + 21 + k),
            load(rows, INWARDS + 18 + k),
            load(rows, INWARDS + 15 + k),
            load(rows, INWARDS + 12 + k),
            load(rows, INWARDS + 9 + k),
            load(rows, INWARDS + 6 + k),
            load(rows, INWARDS + 3 + k),
        )
    )


@kernel(inline=True)
def _store_beyond(rows):
    """Replace INWARDS by the sums over the planets further out."""
    for k in range(3):
        g, f, e, d, c, b, a = _beyond(rows, k)
        store(rows, INWARDS + k, a)
        store(rows, INWARDS + 3 + k, b)
        store(rows, INWARDS + 6 + k, c)
        store(rows, INWARDS + 9 + k, d)
        store(rows, INWARDS + 12 + k, e)
        store(rows, INWARDS + 15 + k, f)
        store(rows, INWARDS + 18 + k, g)
        store(rows, INWARDS + 21 + k, full(0.0))


@kernel(inline=True)
def _apart(rows, i, j):
    """Return the place of planet j relative to planet i."""
    x, y, z = load_three(rows, PLACE + 3 * i)
    X, Y, Z = load_three(rows, PLACE + 3 * j)
    return minus(X, x), minus(Y, y), minus(Z, z)


@kernel(inline=True)
def _pull(rows, i, apart):
    """Write the pull of the planet `apart` places after planet i, and the powers of its distance."""
    j, pair = (i + apart) % WIDTH, (apart - 1) * WIDTH + i
    dx, dy, dz = _apart(rows, i, j)
    cubed, squared = inverse_powers(fma(dx, dx, fma(dy, dy, dz * dz)))
    store(rows, INVERSE + 2 * pair, cubed)
    store(rows, INVERSE + 2 * pair + 1, squared)
    store_three(rows, PULLS + 3 * pair, (cubed * dx, cubed * dy, cubed * dz))


@kernel(inline=True)
def _store_pulls(rows, count):
    for i in range(count):
        for apart in range(1, 4):
            if (i + apart) % WIDTH < count:
                _pull(rows, i, apart)
        if i + 4 < count:
            _pull(rows, i, 4)


@kernel(inline=True)
def _sum_pulls(rows, i, k):
    """Return component k of the sum of the pulls on planet i."""
    one, two, three = (i + 1) % WIDTH, (i + 2) % WIDTH, (i + 3) % WIDTH
    last, four = PULLS + 9 * WIDTH + 3 * (i % 4) + k, (i + 4) % WIDTH
    opposite = load(rows, last) if i < 4 else -load(rows, last)
    there = plus(
        fma(_mass(rows, one), _of_pair(rows, 0, i, k), times(_mass(rows, two), _of_pair(rows, 1, i, k))),
        fma(_mass(rows, three), _of_pair(rows, 2, i, k), times(_mass(rows, four), opposite)),
    )
    one, two, three = (i + 7) % WIDTH, (i + 6) % WIDTH, (i + 5) % WIDTH
    back = plus(
        times(_mass(rows, one), _of_pair(rows, 0, one, k)), times(_mass(rows, two), _of_pair(rows, 1, two, k))
    )
    return minus(there, plus(back, times(_mass(rows, three), _of_pair(rows, 2, three, k))))


@kernel(inline=True)
def _mass(rows, i):
    return load(rows, CONSTANTS + 8 * i)


@kernel(inline=True)
def _of_pair(rows, places, i, k):
    return load(rows, PULLS + 3 * (WIDTH * places + i) + k)


@kernel
def interact_in_lanes(rows, count, source, stride):
    """Write the interaction at the positions r' in the rows from `source` on, `stride` rows apart."""
    store_places(rows, source, stride, PLACE)
    _store_pulls(rows, count)
    for i in range(count):
        masses = _masses(rows, i)
        own = _sum_pulls(rows, i, 0), _sum_pulls(rows, i, 1), _sum_pulls(rows, i, 2)
        ux, uy, uz = load_three(rows, PLACE + 3 * i)
        x, y, z = load_three(rows, source + stride * i)
        near, near2 = inverse_powers(fma(ux, ux, fma(uy, uy, uz * uz)))
        kepler, kepler2 = inverse_powers(fma(x, x, fma(y, y, z * z)))
        store(rows, POWERS + 4 * i, near)
        store(rows, POWERS + 4 * i + 1, near2)
        store(rows, POWERS + 4 * i + 2, kepler)
        store(rows, POWERS + 4 * i + 3, kepler2)
        store_three(rows, OWN + 3 * i, own)
        store_three(rows, INWARDS + 3 * i, pulls_on_inner(masses, own, (ux, uy, uz), near))
    _store_beyond(rows)
    for i in range(count):
        force = whole_interaction(
            _masses(rows, i),
            load_three(rows, OWN + 3 * i),
            load_three(rows, INWARDS + 3 * i),
            load_three(rows, source + stride * i),
            load(rows, POWERS + 4 * i + 2),
            load_three(rows, PLACE + 3 * i),
            load(rows, POWERS + 4 * i),
        )
        store_three(rows, FORCE + 3 * i, force)


@kernel(inline=True)
def _displace(rows, count, shift):
    for i in range(count):
        x, y, z = load_three(rows, STATE_ROWS * i)
        fx, fy, fz = load_three(rows, FORCE + 3 * i)
        there = fma(full(shift), fx, x), fma(full(shift), fy, y), fma(full(shift), fz, z)
        store_three(rows, SHIFTED + 3 * i, there)


@kernel(inline=True)
def _tide_of_pair(rows, i, apart):
    """Replace the pull of the planet `apart` places after planet i by its change."""
    j, pair = (i + apart) % WIDTH, (apart - 1) * WIDTH + i
    dx, dy, dz = _apart(rows, i, j)
    ex, ey, ez = load_three(rows, MOVED + 3 * i)
    EX, EY, EZ = load_three(rows, MOVED + 3 * j)
    pair_of_two = Pairs(dx, dy, dz, load(rows, INVERSE + 2 * pair), load(rows, INVERSE + 2 * pair + 1))
    store_three(
        rows, PULLS + 3 * pair, tide_of_pair(pair_of_two, minus(EX, ex), minus(EY, ey), minus(EZ, ez))
    )


@kernel
def modify_in_lanes(rows, count, shift):
    """Add `shift` times the derivative of the interaction along itself; `interact_in_lanes` must have been called."""
    for i in range(count):
        fx, fy, fz = load_three(rows, FORCE + 3 * i)
        shifted = times(full(shift), fx), times(full(shift), fy), times(full(shift), fz)
        store_three(rows, SHIFTED + 3 * i, shifted)
    store_places(rows, SHIFTED, 3, MOVED)
    for i in range(count):
        for apart in range(1, 4):
            if (i + apart) % WIDTH < count:
                _tide_of_pair(rows, i, apart)
        if i + 4 < count:
            _tide_of_pair(rows, i, 4)
    for i in range(count):
        masses = _masses(rows, i)
        within = _sum_pulls(rows, i, 0), _sum_pulls(rows, i, 1), _sum_pulls(rows, i, 2)
        _, centre = _central_tides(rows, i)
        store_three(rows, OWN + 3 * i, within)
        store_three(rows, INWARDS + 3 * i, tides_on_inner(masses, within, centre))
    _store_beyond(rows)
    for i in range(count):
        kepler, centre = _central_tides(rows, i)
        force = with_change(
            _masses(rows, i),
            load_three(rows, FORCE + 3 * i),
            load_three(rows, OWN + 3 * i),
            load_three(rows, INWARDS + 3 * i),
            kepler,
            centre,
        )
        store_three(rows, FORCE + 3 * i, force)


@kernel(inline=True)
def _central_tides(rows, i):
    """Return the changes of r' / r'^3 and of u / u^3."""
    x, y, z = load_three(rows, STATE_ROWS * i)
    ux, uy, uz = load_three(rows, PLACE + 3 * i)
    sx, sy, sz = load_three(rows, SHIFTED + 3 * i)
    ex, ey, ez = load_three(rows, MOVED + 3 * i)
    near, near2 = load(rows, POWERS + 4 * i), load(rows, POWERS + 4 * i + 1)
    kepler, kepler2 = load(rows, POWERS + 4 * i + 2), load(rows, POWERS + 4 * i + 3)
    own = tide_of_pair(Pairs(x, y, z, kepler, kepler2), sx, sy, sz)
    return own, tide_of_pair(Pairs(ux, uy, uz, near, near2), ex, ey, ez)


@kernel(inline=True)
def kick_in_lanes(rows, count, shift, lazy):
    """Write the interaction for a kick: plain, modified, or at displaced positions."""
    interact_in_lanes(rows, count, 0, STATE_ROWS)
    if lazy:
        _displace(rows, count, shift)
        interact_in_lanes(rows, count, SHIFTED, 3)
    elif shift != 0.0:
        modify_in_lanes(rows, count, shift)


@kernel
def _advance(rows, count, h):
    """Move the planets from velocities that are kicked, and write what this changes of the velocities: two planets at
    once, whose instructions alternate, and the last one of an odd number with itself.
    """
    kick = full(0.5 * h)
    for i in range(0, count, 2):
        j = min(i + 1, count - 1)
        (x, y, z), (u, v, w), (fx, fy, fz) = _begun(rows, i)
        (X, Y, Z), (U, V, W), (Fx, Fy, Fz) = _begun(rows, j)
        dx, dy, dz, du, dv, dw = short_increments(
            joined(x, X), joined(y, Y), joined(z, Z),
            joined(fma(kick, fx, u), fma(kick, Fx, U)), joined(fma(kick, fy, v), fma(kick, Fy, V)),
            joined(fma(kick, fz, w), fma(kick, Fz, W)),
            joined(load(rows, CONSTANTS + 8 * i + 5), load(rows, CONSTANTS + 8 * j + 5)), joined(full(h), full(h)),
        )  # fmt: skip
        (dx, dX), (dy, dY), (dz, dZ) = halves(dx), halves(dy), halves(dz)
        (du, dU), (dv, dV), (dw, dW) = halves(du), halves(dv), halves(dw)
        if j > i:
            _store_advanced(rows, j, kick, (X, Y, Z), (dX, dY, dZ), (dU, dV, dW))
        _store_advanced(rows, i, kick, (x, y, z), (dx, dy, dz), (du, dv, dw))


@kernel(inline=True)
def _begun(rows, i):
    """Return r' of a planet, its velocity, and the interaction."""
    first = STATE_ROWS * i
    return load_three(rows, first), load_three(rows, first + 3), load_three(rows, FORCE + 3 * i)


@kernel(inline=True)
def _store_advanced(rows, i, kick, place, moved, change):
    (x, y, z), (dx, dy, dz), (du, dv, dw) = place, moved, change
    first, (fx, fy, fz) = STATE_ROWS * i, load_three(rows, FORCE + 3 * i)
    store_three(rows, CHANGE + 3 * i, (fma(kick, fx, du), fma(kick, fy, dv), fma(kick, fz, dw)))
    x_lo, y_lo, z_lo = load_three(rows, first + 6)
    x, x_lo = accumulate(x, x_lo, dx)
    y, y_lo = accumulate(y, y_lo, dy)
    z, z_lo = accumulate(z, z_lo, dz)
    store_three(rows, first, (x, y, z))
    store_three(rows, first + 6, (x_lo, y_lo, z_lo))


@kernel
def step_in_lanes(rows, count, h, shift, lazy):
    """Take one step of eight systems: half a kick, Kepler motions, half a kick."""
    _advance(rows, count, h)
    kick_in_lanes(rows, count, shift, lazy)
    kick = full(0.5 * h)
    for i in range(count):
        first = STATE_ROWS * i
        fx, fy, fz = load_three(rows, FORCE + 3 * i)
        cx, cy, cz = load_three(rows, CHANGE + 3 * i)
        u, v, w = load_three(rows, first + 3)
        u_lo, v_lo, w_lo = load_three(rows, first + 9)
        u, u_lo = accumulate(u, u_lo, fma(kick, fx, cx))
        v, v_lo = accumulate(v, v_lo, fma(kick, fy, cy))
        w, w_lo = accumulate(w, w_lo, fma(kick, fz, cz))
        store_three(rows, first + 3, (u, v, w))
        store_three(rows, first + 9, (u_lo, v_lo, w_lo))
    for k in range(3):
        hi, lo = load(rows, CENTRE + k), load(rows, CENTRE + 6 + k)
        hi, lo = add_product(hi, lo, full(h), load(rows, CENTRE + 3 + k), load(rows, CENTRE + 9 + k))
        store(rows, CENTRE + k, hi)
        store(rows, CENTRE + 6 + k, lo)


@kernel
def show_in_lanes(rows, source, stride, centre):
    """Write the state of the bodies, rounded, into the rows SEEN: six of the dominant body, then of each planet.

    source, stride : where positions and velocities begin, and how many rows a planet has there; centre : those of the
        centre of mass
    """
    for k in range(6):
        inside = load(rows, centre + k)
        beyond = before_each(
            (
                _weighted(rows, source, stride, 7, k),
                _weighted(rows, source, stride, 6, k),
                _weighted(rows, source, stride, 5, k),
                _weighted(rows, source, stride, 4, k),
                _weighted(rows, source, stride, 3, k),
                _weighted(rows, source, stride, 2, k),
                _weighted(rows, source, stride, 1, k),
            )
        )
        _store_seen(rows, source, stride, 0, k, inside, beyond[6])
        _store_seen(rows, source, stride, 1, k, inside, beyond[5])
        _store_seen(rows, source, stride, 2, k, inside, beyond[4])
        _store_seen(rows, source, stride, 3, k, inside, beyond[3])
        _store_seen(rows, source, stride, 4, k, inside, beyond[2])
        _store_seen(rows, source, stride, 5, k, inside, beyond[1])
        _store_seen(rows, source, stride, 6, k, inside, beyond[0])
        _store_seen(rows, source, stride, 7, k, inside, full(0.0))
        store(rows, SEEN + k, minus(inside, plus(_weighted(rows, source, stride, 0, k), beyond[6])))


@kernel(inline=True)
def _weighted(rows, source, stride, i, k):
    return times(_share(rows, i), load(rows, source + stride * i + k))


@kernel(inline=True)
def _store_seen(rows, source, stride, i, k, inside, beyond):
    outwards = plus(_weighted(rows, source, stride, i, k), beyond)
    store(rows, SEEN + 6 * (i + 1) + k, plus(load(rows, source + stride * i + k), minus(inside, outwards)))


@kernel(inline=True)
def place_seen(rows, count, planets, system, q, v, first, after):
    """Write what is seen of the bodies of a system, in their order: positions into q from `first` on, velocities into v
    from `first + after` on; planets : its carry.
    """
    n = count + 1
    for i in range(n):
        body = int(planets[STATE_ROWS, 6]) if i == 0 else int(planets[STATE_ROWS + 2, i - 1])
        for k in range(3):
            q[first + k * n + body] = rows[SEEN + 6 * i + k, system]
            v[first + after + k * n + body] = rows[SEEN + 6 * i + 3 + k, system]
