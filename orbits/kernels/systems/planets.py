"""Wisdom–Holman maps of eight systems at once: rows are what lanes are in `orbits.kernels.maps.jacobi`, with the same
bits.

`orbits.kernels.systems.planet_rows` has what the rows hold.
"""

from __future__ import annotations

from orbits.kernels.compile import kernel
from orbits.kernels.kepler.short_flow import short_increments
from orbits.kernels.lanes import WIDTH, fma, full, halves, joined, load, store
from orbits.kernels.maps.interaction import load_three, store_three
from orbits.kernels.sums.summation import accumulate, add_product
from orbits.kernels.systems.interaction import displace_in_lanes, interact_in_lanes, load_eight, modify_in_lanes
from orbits.kernels.systems.planet_rows import (
    ALL_IN,
    CENTRE,
    CHANGE,
    FORCE,
    PLANET,
    SEEN,
    SHIFTED,
    STAR,
    STATE,
    WEIGHT,
    body_of,
    registers_of,
)
from orbits.kernels.systems.sums import before_each, minus, plus, times_each


@kernel(inline=True)
def kick_in_lanes(rows, count, shift, lazy):
    """Write the interaction for a kick: plain, modified, or at displaced positions."""
    modified = shift != 0.0 and not lazy
    interact_in_lanes(rows, count, STATE, modified)
    if lazy:
        displace_in_lanes(rows, count, shift)
        interact_in_lanes(rows, count, SHIFTED, modified)
    elif modified:
        modify_in_lanes(rows, count, shift)


@kernel
def _advance(rows, count, h):
    """Move the planets from velocities that are kicked, and write what this changes of the velocities: two planets at
    once, whose instructions alternate, and the last one of an odd number with itself.
    """
    kick = full(0.5 * h)
    for i in range(0, count, 2):
        one, two = PLANET * i, PLANET * min(i + 1, count - 1)
        (x, y, z), (u, v, w), (fx, fy, fz) = _begun(rows, one)
        (X, Y, Z), (U, V, W), (Fx, Fy, Fz) = _begun(rows, two)
        dx, dy, dz, du, dv, dw = short_increments(
            joined(x, X), joined(y, Y), joined(z, Z),
            joined(fma(kick, fx, u), fma(kick, Fx, U)), joined(fma(kick, fy, v), fma(kick, Fy, V)),
            joined(fma(kick, fz, w), fma(kick, Fz, W)),
            joined(load(rows, one + ALL_IN), load(rows, two + ALL_IN)), joined(full(h), full(h)),
        )  # fmt: skip
        (dx, dX), (dy, dY), (dz, dZ) = halves(dx), halves(dy), halves(dz)
        (du, dU), (dv, dV), (dw, dW) = halves(du), halves(dv), halves(dw)
        if two > one:
            _store_advanced(rows, two, kick, (X, Y, Z), (dX, dY, dZ), (dU, dV, dW))
        _store_advanced(rows, one, kick, (x, y, z), (dx, dy, dz), (du, dv, dw))


@kernel(inline=True)
def _begun(rows, planet):
    """Return r' of a planet, its velocity, and the interaction."""
    state = planet + STATE
    return load_three(rows, state), load_three(rows, state + 3), load_three(rows, planet + FORCE)


@kernel(inline=True)
def _store_advanced(rows, planet, kick, place, moved, change):
    (x, y, z), (dx, dy, dz), (du, dv, dw) = place, moved, change
    fx, fy, fz = load_three(rows, planet + FORCE)
    store_three(rows, planet + CHANGE, (fma(kick, fx, du), fma(kick, fy, dv), fma(kick, fz, dw)))
    x_lo, y_lo, z_lo = load_three(rows, planet + STATE + 6)
    x, x_lo = accumulate(x, x_lo, dx)
    y, y_lo = accumulate(y, y_lo, dy)
    z, z_lo = accumulate(z, z_lo, dz)
    store_three(rows, planet + STATE, (x, y, z))
    store_three(rows, planet + STATE + 6, (x_lo, y_lo, z_lo))


@kernel
def step_in_lanes(rows, count, h, shift, lazy):
    """Take one step of eight systems: half a kick, Kepler motions, half a kick."""
    _advance(rows, count, h)
    kick_in_lanes(rows, count, shift, lazy)
    kick = full(0.5 * h)
    for i in range(count):
        state = PLANET * i + STATE
        fx, fy, fz = load_three(rows, PLANET * i + FORCE)
        cx, cy, cz = load_three(rows, PLANET * i + CHANGE)
        u, v, w = load_three(rows, state + 3)
        u_lo, v_lo, w_lo = load_three(rows, state + 9)
        u, u_lo = accumulate(u, u_lo, fma(kick, fx, cx))
        v, v_lo = accumulate(v, v_lo, fma(kick, fy, cy))
        w, w_lo = accumulate(w, w_lo, fma(kick, fz, cz))
        store_three(rows, state + 3, (u, v, w))
        store_three(rows, state + 9, (u_lo, v_lo, w_lo))
    for k in range(3):
        hi, lo = load(rows, CENTRE + k), load(rows, CENTRE + 6 + k)
        hi, lo = add_product(hi, lo, full(h), load(rows, CENTRE + 3 + k), load(rows, CENTRE + 9 + k))
        store(rows, CENTRE + k, hi)
        store(rows, CENTRE + 6 + k, lo)


@kernel
def show_in_lanes(rows, count, source, stride, centre):
    """Write the state of the bodies, rounded, into the rows SEEN of the planets, and STAR of the dominant body.

    source, stride : where positions and velocities begin, and how many rows a planet has there; centre : those of the
        centre of mass
    """
    registers = registers_of(count)
    for k in range(6):
        inside = load(rows, centre + k)
        for behind in range(registers):
            start = WIDTH * (registers - 1 - behind)
            own = load_eight(rows, source + stride * start + k, stride)
            a, b, c, d, e, f, g, h = times_each(load_eight(rows, PLANET * start + WEIGHT, PLANET), own)
            beyond = before_each((h, g, f, e, d, c, b, a))
            first = PLANET * start + SEEN + k
            _store_seen(rows, first, 0, own[0], inside, a, beyond[7])
            _store_seen(rows, first, 1, own[1], inside, b, beyond[6])
            _store_seen(rows, first, 2, own[2], inside, c, beyond[5])
            _store_seen(rows, first, 3, own[3], inside, d, beyond[4])
            _store_seen(rows, first, 4, own[4], inside, e, beyond[3])
            _store_seen(rows, first, 5, own[5], inside, f, beyond[2])
            _store_seen(rows, first, 6, own[6], inside, g, beyond[1])
            _store_seen(rows, first, 7, own[7], inside, h, beyond[0])
            inside = minus(inside, plus(a, beyond[7]))
        store(rows, STAR + k, inside)


@kernel(inline=True)
def _store_seen(rows, first, i, own, inside, weighted, beyond):
    store(rows, first + PLANET * i, plus(own, minus(inside, plus(weighted, beyond))))


@kernel(inline=True)
def place_seen(rows, count, planets, system, q, v, first, after):
    """Write what is seen of the bodies of a system, in their order: positions into q from `first` on, velocities into v
    from `first + after` on; planets : its carry.
    """
    n = count + 1
    for i in range(-1, count):
        body, seen = body_of(planets, count, i), STAR if i < 0 else PLANET * i + SEEN
        for k in range(3):
            q[first + k * n + body] = rows[seen + k, system]
            v[first + after + k * n + body] = rows[seen + 3 + k, system]
