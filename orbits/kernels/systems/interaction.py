"""The interaction of the planets of eight systems, and its change along itself, with the bits of a system alone.

The sums over planets are the trees of additions of `orbits.kernels.maps.interaction`, from one register of eight
planets to the next. The pulls on a planet are added in its order: first those within its register, then those of the
planets of the others, one by one. Each pair is evaluated once.
"""

from __future__ import annotations

from orbits.kernels.compile import kernel
from orbits.kernels.lanes import WIDTH, fma, full, inverse_powers, load, rsqrt_cubed, store
from orbits.kernels.maps.interaction import (
    Pairs,
    load_three,
    pulls_on_inner,
    store_three,
    tide,
    tide_of_pair,
    tides_on_inner,
    whole_interaction,
    with_change,
)
from orbits.kernels.systems.planet_rows import (
    FORCE,
    GM,
    INVERSE,
    INWARDS,
    MOVED,
    OWN,
    PLACE,
    PLANET,
    POWERS,
    PULLS,
    SHIFTED,
    STATE,
    WEIGHT,
    masses_at,
    registers_of,
)
from orbits.kernels.systems.sums import before_each, minus, plus, plus_all, plus_each, sum_of_eight, times, times_each

REGISTER = WIDTH * PLANET
"""Rows of a register of planets."""


@kernel(inline=True)
def store_places(rows, count, source, out, stride):
    """Write a vector of each planet relative to the dominant body, from that relative to the centre of mass of those
    inside.

    source : where that is for the first planet; out, stride : where to write, and how many rows a planet has there
    """
    registers, inner = registers_of(count), (full(0.0), full(0.0), full(0.0))
    for register in range(registers):
        first, to = REGISTER * register, WIDTH * stride * register + out
        share = load_eight(rows, first + WEIGHT, PLANET)
        inner = (
            _store_component(rows, registers, share, first + source, to, stride, inner[0]),
            _store_component(rows, registers, share, first + source + 1, to + 1, stride, inner[1]),
            _store_component(rows, registers, share, first + source + 2, to + 2, stride, inner[2]),
        )


@kernel(inline=True)
def _store_component(rows, registers, share, source, out, stride, inner):
    """Write a component for a register of planets; return the sum over the planets up to them, from that of the
    registers before.
    """
    x = load_eight(rows, source, PLANET)
    weighted = times_each(share, x)
    inside = before_each(weighted)
    if registers > 1:
        inside = plus_all(inside, inner)
        inner = plus(inner, sum_of_eight(weighted))
    _store_eight(rows, out, stride, plus_each(x, inside))
    return inner


@kernel(inline=True)
def load_eight(rows, first, stride):
    """Return a row of each planet of a register, the first one's, and those each `stride` rows on."""
    return (
        load(rows, first),
        load(rows, first + stride),
        load(rows, first + 2 * stride),
        load(rows, first + 3 * stride),
        load(rows, first + 4 * stride),
        load(rows, first + 5 * stride),
        load(rows, first + 6 * stride),
        load(rows, first + 7 * stride),
    )


@kernel(inline=True)
def _store_eight(rows, first, stride, x):
    store(rows, first, x[0])
    store(rows, first + stride, x[1])
    store(rows, first + 2 * stride, x[2])
    store(rows, first + 3 * stride, x[3])
    store(rows, first + 4 * stride, x[4])
    store(rows, first + 5 * stride, x[5])
    store(rows, first + 6 * stride, x[6])
    store(rows, first + 7 * stride, x[7])


@kernel(inline=True)
def _store_beyond(rows, count):
    """Replace INWARDS by the sums over the planets further out."""
    registers, outer = registers_of(count), (full(0.0), full(0.0), full(0.0))
    for behind in range(registers):
        first = REGISTER * (registers - 1 - behind) + INWARDS
        outer = (
            _store_beyond_component(rows, registers, first, outer[0]),
            _store_beyond_component(rows, registers, first + 1, outer[1]),
            _store_beyond_component(rows, registers, first + 2, outer[2]),
        )


@kernel(inline=True)
def _store_beyond_component(rows, registers, first, outer):
    x = load_eight(rows, first + 7 * PLANET, -PLANET)
    beyond = before_each(x)
    if registers > 1:
        beyond = plus_all(beyond, outer)
        outer = plus(outer, sum_of_eight(x))
    _store_eight(rows, first + 7 * PLANET, -PLANET, beyond)
    return outer


@kernel(inline=True)
def _apart(rows, planet, other):
    """Return the place of another planet relative to one; these are `PLANET` times their numbers."""
    x, y, z = load_three(rows, planet + PLACE)
    X, Y, Z = load_three(rows, other + PLACE)
    return minus(X, x), minus(Y, y), minus(Z, z)


@kernel(inline=True)
def _pull(rows, first, i, apart, keep):
    """Write the pull of the planet `apart` places after planet i of a register, and if `keep`, the powers of its
    distance.
    """
    planet, other = first + PLANET * i, first + PLANET * ((i + apart) % WIDTH)
    dx, dy, dz = _apart(rows, planet, other)
    cubed, squared = inverse_powers(fma(dx, dx, fma(dy, dy, dz * dz)))
    if keep:
        store(rows, planet + INVERSE + 2 * (apart - 1), cubed)
        store(rows, planet + INVERSE + 2 * (apart - 1) + 1, squared)
    store_three(rows, planet + PULLS + 3 * (apart - 1), (cubed * dx, cubed * dy, cubed * dz))


@kernel(inline=True)
def _store_pulls(rows, count, keep):
    for start in range(0, count, WIDTH):
        first, here = PLANET * start, min(WIDTH, count - start)
        for i in range(here):
            for apart in range(1, 4):
                if (i + apart) % WIDTH < here:
                    _pull(rows, first, i, apart, keep)
            if i + 4 < here:
                _pull(rows, first, i, 4, keep)


@kernel(inline=True)
def _sum_pulls(rows, first, i, k):
    """Return component k of the sum of the pulls on planet i of a register by the others there."""
    one, two, three = (i + 1) % WIDTH, (i + 2) % WIDTH, (i + 3) % WIDTH
    last, four = _of_pair(rows, first, 3, i % 4, k), (i + 4) % WIDTH
    opposite = last if i < 4 else -last
    there = plus(
        fma(_gm(rows, first, one), _of_pair(rows, first, 0, i, k),
            times(_gm(rows, first, two), _of_pair(rows, first, 1, i, k))),
        fma(_gm(rows, first, three), _of_pair(rows, first, 2, i, k), times(_gm(rows, first, four), opposite)),
    )  # fmt: skip
    one, two, three = (i + 7) % WIDTH, (i + 6) % WIDTH, (i + 5) % WIDTH
    back = plus(
        times(_gm(rows, first, one), _of_pair(rows, first, 0, one, k)),
        times(_gm(rows, first, two), _of_pair(rows, first, 1, two, k)),
    )
    return minus(there, plus(back, times(_gm(rows, first, three), _of_pair(rows, first, 2, three, k))))


@kernel(inline=True)
def _gm(rows, first, i):
    return load(rows, first + PLANET * i + GM)


@kernel(inline=True)
def _of_pair(rows, first, places, i, k):
    return load(rows, first + PLANET * i + PULLS + 3 * places + k)


@kernel
def _store_sums(rows, count):
    """Write the sums of the pulls on each planet by those in its register."""
    for start in range(0, count, WIDTH):
        first = PLANET * start
        for i in range(min(WIDTH, count - start)):
            own = _sum_pulls(rows, first, i, 0), _sum_pulls(rows, first, i, 1), _sum_pulls(rows, first, i, 2)
            store_three(rows, first + PLANET * i + OWN, own)


@kernel
def _add_pulls_between(rows, count):
    """Add the pulls of the planets of other registers."""
    for i in range(count):
        planet = PLANET * i
        ax, ay, az = load_three(rows, planet + OWN)
        gm = load(rows, planet + GM)
        for j in range(WIDTH * (i // WIDTH + 1), count):
            other = PLANET * j
            dx, dy, dz = _apart(rows, planet, other)
            near = rsqrt_cubed(fma(dz, dz, fma(dy, dy, dx * dx)))
            w, back = near * load(rows, other + GM), -near * gm
            bx, by, bz = load_three(rows, other + OWN)
            store_three(rows, other + OWN, (fma(back, dx, bx), fma(back, dy, by), fma(back, dz, bz)))
            ax, ay, az = fma(w, dx, ax), fma(w, dy, ay), fma(w, dz, az)
        store_three(rows, planet + OWN, (ax, ay, az))


@kernel
def interact_in_lanes(rows, count, source, keep):
    """Write the interaction at the positions r' in the rows from `source` on; keep : whether to keep the powers of
    distances for `modify_in_lanes`.
    """
    store_places(rows, count, source, PLACE, PLANET)
    _store_pulls(rows, count, keep)
    _store_sums(rows, count)
    if count > WIDTH:
        _add_pulls_between(rows, count)
    for i in range(count):
        planet = PLANET * i
        ux, uy, uz = load_three(rows, planet + PLACE)
        x, y, z = load_three(rows, planet + source)
        near, near2 = inverse_powers(fma(ux, ux, fma(uy, uy, uz * uz)))
        kepler, kepler2 = inverse_powers(fma(x, x, fma(y, y, z * z)))
        store(rows, planet + POWERS, near)
        store(rows, planet + POWERS + 1, kepler)
        if keep:
            store(rows, planet + POWERS + 2, near2)
            store(rows, planet + POWERS + 3, kepler2)
        own = load_three(rows, planet + OWN)
        store_three(rows, planet + INWARDS, pulls_on_inner(masses_at(rows, planet), own, (ux, uy, uz), near))
    _store_beyond(rows, count)
    for i in range(count):
        planet = PLANET * i
        force = whole_interaction(
            masses_at(rows, planet),
            load_three(rows, planet + OWN),
            load_three(rows, planet + INWARDS),
            load_three(rows, planet + source),
            load(rows, planet + POWERS + 1),
            load_three(rows, planet + PLACE),
            load(rows, planet + POWERS),
        )
        store_three(rows, planet + FORCE, force)


@kernel(inline=True)
def displace_in_lanes(rows, count, shift):
    """Write r' displaced by `shift` times the interaction."""
    for i in range(count):
        planet = PLANET * i
        x, y, z = load_three(rows, planet + STATE)
        fx, fy, fz = load_three(rows, planet + FORCE)
        there = fma(full(shift), fx, x), fma(full(shift), fy, y), fma(full(shift), fz, z)
        store_three(rows, planet + SHIFTED, there)


@kernel(inline=True)
def _moved_apart(rows, planet, other):
    """Return the displacement of another planet relative to that of one."""
    x, y, z = load_three(rows, planet + MOVED)
    X, Y, Z = load_three(rows, other + MOVED)
    return minus(X, x), minus(Y, y), minus(Z, z)


@kernel(inline=True)
def _tide_of_pair(rows, first, i, apart):
    """Replace the pull of the planet `apart` places after planet i of a register by its change."""
    planet, other = first + PLANET * i, first + PLANET * ((i + apart) % WIDTH)
    dx, dy, dz = _apart(rows, planet, other)
    ex, ey, ez = _moved_apart(rows, planet, other)
    inverse = planet + INVERSE + 2 * (apart - 1)
    pair_of_two = Pairs(dx, dy, dz, load(rows, inverse), load(rows, inverse + 1))
    store_three(rows, planet + PULLS + 3 * (apart - 1), tide_of_pair(pair_of_two, ex, ey, ez))


@kernel(inline=True)
def _store_tides(rows, count):
    for start in range(0, count, WIDTH):
        first, here = PLANET * start, min(WIDTH, count - start)
        for i in range(here):
            for apart in range(1, 4):
                if (i + apart) % WIDTH < here:
                    _tide_of_pair(rows, first, i, apart)
            if i + 4 < here:
                _tide_of_pair(rows, first, i, 4)


@kernel
def _add_tides_between(rows, count):
    """Add the changes of the pulls of the planets of other registers."""
    for i in range(count):
        planet = PLANET * i
        ax, ay, az = load_three(rows, planet + OWN)
        gm = load(rows, planet + GM)
        for j in range(WIDTH * (i // WIDTH + 1), count):
            other = PLANET * j
            dx, dy, dz = _apart(rows, planet, other)
            ex, ey, ez = _moved_apart(rows, planet, other)
            tx, ty, tz = tide(dx, dy, dz, fma(dz, dz, fma(dy, dy, dx * dx)), ex, ey, ez)
            there, back = load(rows, other + GM), -gm
            bx, by, bz = load_three(rows, other + OWN)
            store_three(rows, other + OWN, (fma(back, tx, bx), fma(back, ty, by), fma(back, tz, bz)))
            ax, ay, az = fma(there, tx, ax), fma(there, ty, ay), fma(there, tz, az)
        store_three(rows, planet + OWN, (ax, ay, az))


@kernel
def modify_in_lanes(rows, count, shift):
    """Add `shift` times the derivative of the interaction along itself; `interact_in_lanes` must have kept powers."""
    for i in range(count):
        fx, fy, fz = load_three(rows, PLANET * i + FORCE)
        shifted = times(full(shift), fx), times(full(shift), fy), times(full(shift), fz)
        store_three(rows, PLANET * i + SHIFTED, shifted)
    store_places(rows, count, SHIFTED, MOVED, PLANET)
    _store_tides(rows, count)
    _store_sums(rows, count)
    if count > WIDTH:
        _add_tides_between(rows, count)
    for i in range(count):
        planet, within = PLANET * i, load_three(rows, PLANET * i + OWN)
        kepler, centre = _central_tides(rows, planet)
        store_three(rows, planet + SHIFTED, kepler)
        store_three(rows, planet + MOVED, centre)
        store_three(rows, planet + INWARDS, tides_on_inner(masses_at(rows, planet), within, centre))
    _store_beyond(rows, count)
    for i in range(count):
        planet = PLANET * i
        force = with_change(
            masses_at(rows, planet),
            load_three(rows, planet + FORCE),
            load_three(rows, planet + OWN),
            load_three(rows, planet + INWARDS),
            load_three(rows, planet + SHIFTED),
            load_three(rows, planet + MOVED),
        )
        store_three(rows, planet + FORCE, force)


@kernel(inline=True)
def _central_tides(rows, planet):
    """Return the changes of r' / r'^3 and of u / u^3."""
    x, y, z = load_three(rows, planet + STATE)
    ux, uy, uz = load_three(rows, planet + PLACE)
    sx, sy, sz = load_three(rows, planet + SHIFTED)
    ex, ey, ez = load_three(rows, planet + MOVED)
    near, near2 = load(rows, planet + POWERS), load(rows, planet + POWERS + 2)
    kepler, kepler2 = load(rows, planet + POWERS + 1), load(rows, planet + POWERS + 3)
    own = tide_of_pair(Pairs(x, y, z, kepler, kepler2), sx, sy, sz)
    return own, tide_of_pair(Pairs(ux, uy, uz, near, near2), ex, ey, ez)
