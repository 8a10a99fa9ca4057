"""The kicks of Wisdom–Holman maps and their flows of terms, written plainly, on dual numbers: of planets and of eight
tangent vectors they give the changes of both. No derivative is written out.

The formulas are those of `orbits.kernels.maps.jacobi`, `heliocentric` and `terms_of_dominant`, whose kernels march the
planets, in lanes. A kick by the interaction g is

    plain  g(q),      lazy  g(q + s g),      modified  g + s Dg g,      s = h^2/12

and as g is a sum of x / |x|^3 over pairs of places, Dg e is the same sum of the changes of these.

Sources: Mikkola & Innanen (1999), Celest. Mech. Dyn. Astron. 74, 59; Rein & Tamayo (2016), MNRAS 459, 2275.
"""

from __future__ import annotations

from numba import types

from orbits.kernels.binding import plus
from orbits.kernels.compile import kernel
from orbits.kernels.compile.verbs import verb
from orbits.kernels.lanes import fma, full, get, load, put, store
from orbits.kernels.lanes.dual import dual_number, duals, number, slopes
from orbits.kernels.maps.interaction import change_of_pull, pair_of
from orbits.kernels.maps.layout import (
    ATTRACTING,
    CENTRAL,
    INNER,
    MASS,
    OUTER,
    SHARE,
    constant,
    coordinate,
    dominant,
)
from orbits.kernels.maps.programs import LAZY, MODIFIED
from orbits.kernels.maps.terms_by_kind import (
    depends_on_positions,
    depends_on_velocities,
    derivatives_at,
    pulls_at,
    terms_of,
)
from orbits.kernels.maps.terms_of_dominant import MORE, QUICK, WEAK
from orbits.kernels.maps.threes import accumulated, added, load_three, minus, store_three, times

PLACE, SPEED, FROM_SUN, SPEED_FROM_SUN, PULL, PUSH, RATE, CHANGE = range(8)
"""What stands in `VectorRoom.numbers`, (8, 3n, 16): places and velocities in Jacobi coordinates, both relative to the
dominant body, accelerations and derivatives by velocities there, and those in Jacobi coordinates."""


@kernel(inline=True)
def add_three(hi, lo, a, change):
    """Add a vector to rows a ... a + 2 in doubled precision."""
    total, rest = accumulated(load_three(hi, a), load_three(lo, a), change)
    store_three(hi, a, total)
    store_three(lo, a, rest)


@kernel(inline=True)
def add_slopes(hi, lo, size, numbers):
    """Add `size` times the derivatives of dual numbers to eight vectors."""
    for a in range(0, numbers.shape[0], 3):
        x, y, z = load_three(numbers, a)
        add_three(hi, lo, a, times(size, (slopes(x), slopes(y), slopes(z))))


@kernel(inline=True)
def _read(planets, first, vectors, out):
    """Write coordinates of the planets that change along eight vectors; first : 0 for places, 3 for velocities."""
    for a in range(out.shape[0]):
        put(out, a, dual_number(coordinate(planets, first + a % 3, a // 3), load(vectors, a)))


@kernel(inline=True)
def _relative(scratch, r, u):
    """Write places relative to the dominant body from those in Jacobi coordinates, or velocities."""
    for k in range(3):
        inside = 0.0 * get(r, k)
        for a in range(k, r.shape[0], 3):
            put(u, a, inside + get(r, a))
            inside = fma(constant(scratch, SHARE, a // 3), get(r, a), inside)


@kernel
def _in_jacobi(scratch, sign, f, out):
    """Write derivatives in Jacobi coordinates over the reduced masses, from those by places relative to the dominant
    body over the masses.
    """
    for k in range(3):
        beyond = 0.0 * get(f, k)
        for back in range(k, f.shape[0], 3):
            a = f.shape[0] - 3 - back + 2 * k
            i, own = a // 3, get(f, a)
            put(out, a, sign * fma(constant(scratch, OUTER, i), own, constant(scratch, INNER, i) * beyond))
            beyond = fma(constant(scratch, MASS, i), own, beyond)


@verb
def _at(u, a):
    """Return three numbers; None of None."""
    return (lambda u, a: None) if u == types.none else load_three


@verb
def _pull(d, e):
    """Return d / |d|^3, or its change along e, if that is not None."""
    return _pull_at if e == types.none else lambda d, e: change_of_pull(pair_of(d), e)


@kernel(inline=True)
def _pull_at(d, e):
    of = pair_of(d)
    return times(of.cubed, d)


@kernel(inline=True)
def _attract(mass, u, e, f):
    """Write the attraction of planets by each other, or its change along e, if that is not None."""
    for i in range(mass.shape[0]):
        here, moved, none = _at(u, 3 * i), _at(e, 3 * i), 0.0 * get(u, 3 * i)
        own = none, none, none
        for j in range(i):
            pull = _pull(minus(_at(u, 3 * j), here), minus(_at(e, 3 * j), moved))
            own = added(own, mass[j], pull)
            store_three(f, 3 * j, added(load_three(f, 3 * j), -mass[i], pull))
        store_three(f, 3 * i, own)


@verb
def _add_pulls(model, mass, u, f):
    """Add the accelerations by terms of positions alone; without any, nothing is done."""
    return _add_each_pull if depends_on_positions(model) else lambda model, mass, u, f: None


@kernel
def _add_each_pull(model, mass, u, f):
    for i in range(mass.shape[0]):
        a = 3 * i
        store_three(f, a, plus(load_three(f, a), pulls_at(terms_of(model), mass[i], load_three(u, a))))


@verb
def _relative_change(scratch, e, change):
    """Write the change of places relative to the dominant body by that in Jacobi coordinates, if that is not None."""
    return (lambda scratch, e, change: None) if isinstance(e, types.NoneType) else _relative


@verb
def _if_there(e, change):
    """Return None for None, else the second argument."""
    return (lambda e, change: None) if isinstance(e, types.NoneType) else lambda e, change: change


@kernel
def _interact(model, room, r, e, with_terms, out):
    """Write the interaction of planets at r, or its change along e, if that is not None, with terms of positions alone
    or without.
    """
    scratch, mass, u, f = room.scratch, room.mass, duals(room.numbers[FROM_SUN]), duals(room.numbers[PULL])
    _relative(scratch, r, u)
    change = _if_there(e, duals(room.numbers[SPEED_FROM_SUN]))
    _relative_change(scratch, e, change)
    _attract(mass, u, change, f)
    if with_terms:
        _add_pulls(model, mass, u, f)
    # m_0 = (m_0 / M_(i-1)) / (1 / M_(i-1))
    central, none = scratch[CENTRAL, 0] / scratch[INNER, 0], 0.0 * get(r, 0)
    beyond = none, none, none
    for back in range(mass.shape[0]):
        i = mass.shape[0] - 1 - back
        a, own = 3 * i, load_three(f, 3 * i)
        whole = added(times(constant(scratch, INNER, i), beyond), constant(scratch, OUTER, i), own)
        if i > 0:  # of the first planet, the Kepler motion has all of the pull
            near, kepler = _pull(_at(u, a), _at(change, a)), _pull(_at(r, a), _at(e, a))
            attracting = constant(scratch, ATTRACTING, i)
            share = -constant(scratch, CENTRAL, i)
            whole = added(whole, attracting, added(kepler, share, near))
            beyond = added(added(beyond, mass[i], own), -mass[i] * central, near)
        store_three(out, a, whole)


@kernel
def change_of_kick(model, kind, shift, vectors, out, room):
    """Write the changes of the interaction of a kick along eight vectors, with terms of positions alone.

    kind, shift : see `orbits.kernels.maps.programs`; vectors : (3n or more, 8), dr'; out : (3n, 8)
    """
    numbers = room.numbers
    if room.mass.shape[0] == 0:
        return
    r, e, g = duals(numbers[PLACE]), duals(numbers[SPEED]), duals(numbers[RATE])
    _read(room.planets, 0, vectors, r)
    _interact(model, room, r, None, kind != MODIFIED, g)
    if kind == LAZY:
        for a in range(r.shape[0]):
            put(e, a, fma(shift, get(g, a), get(r, a)))
        _interact(model, room, e, None, True, g)
    for a in range(r.shape[0]):
        store(out, a, slopes(get(g, a)))
    if kind == MODIFIED:
        for a in range(r.shape[0]):
            put(e, a, shift * get(g, a))
        _interact(model, room, r, e, True, g)
        for a in range(r.shape[0]):
            store(out, a, load(out, a) + slopes(get(g, a)))


@kernel
def kick_heliocentric_vectors(strength, h, vectors, room):
    """Advance eight vectors by a kick of h in democratic heliocentric coordinates, before the planets.

    It adds h times the attraction by each other to V, and h times the sum of (m_i / m_0) V_i to all Q.
    """
    r, f, mass = duals(room.numbers[PLACE]), duals(room.numbers[PULL]), room.mass
    central = strength[1 + dominant(room.planets)]
    _read(room.planets, 0, vectors[0], r)
    _attract(mass, r, None, f)
    jump = full(0.0), full(0.0), full(0.0)
    for i in range(mass.shape[0]):
        jump = added(jump, h * (mass[i] / central), load_three(vectors[2], 3 * i))
    for a in range(0, r.shape[0], 3):
        add_three(vectors[0], vectors[1], a, jump)
    add_slopes(vectors[2], vectors[3], h, f)


@kernel
def _settle(model, half, known, vectors, room):
    """Write the rates of r' and of its velocity in the flow of terms, at its midpoint.

    half : that of its length; known : 1 if velocities are momenta, which the rates lead to velocities, else 0
    """
    planets, scratch, mass, numbers, terms = room.planets, room.scratch, room.mass, room.numbers, terms_of(model)
    if mass.shape[0] == 0:
        return
    r, w, u, s = duals(numbers[PLACE]), duals(numbers[SPEED]), duals(numbers[FROM_SUN]), duals(numbers[SPEED_FROM_SUN])
    f, p, rate, change = duals(numbers[PULL]), duals(numbers[PUSH]), duals(numbers[RATE]), duals(numbers[CHANGE])
    _read(planets, 0, vectors[0], r)
    _read(planets, 3, vectors[2], w)
    for a in range(r.shape[0]):
        put(rate, a, 0.0)
        put(change, a, 0.0)
    sweeps = QUICK if known > 0.0 else 1
    for sweep in range(QUICK + 2 * MORE):
        if sweep == sweeps and (known == 0.0 or not _are_strong(rate, w)):
            break
        for a in range(r.shape[0]):
            put(f, a, fma(half, get(rate, a), get(r, a)))
            put(p, a, get(w, a) + fma(half, get(change, a), known * get(rate, a)))
        _relative(scratch, f, u)
        _relative(scratch, p, s)
        for i in range(mass.shape[0]):
            a = 3 * i
            pull, push = derivatives_at(terms, mass[i], load_three(u, a), load_three(s, a))
            store_three(f, a, pull)
            store_three(p, a, push)
        _in_jacobi(scratch, -1.0, p, rate)
        _in_jacobi(scratch, 1.0, f, change)


@kernel
def _are_strong(rate, w):
    """Return whether momenta differ much from m v."""
    strong = False
    for a in range(0, w.shape[0], 3):
        square = number(get(rate, a)) ** 2 + number(get(rate, a + 1)) ** 2 + number(get(rate, a + 2)) ** 2
        w2 = number(get(w, a)) ** 2 + number(get(w, a + 1)) ** 2 + number(get(w, a + 2)) ** 2
        strong = strong or square > WEAK * w2
    return strong


@verb
def flow_vectors(model, h, vectors, room):
    """Advance groups of eight vectors by the flow of terms that depend on velocities, of h, before the planets; without
    any such terms, nothing is done.
    """
    return _flow_vectors if depends_on_velocities(model) else lambda model, h, vectors, room: None


@kernel
def _flow_vectors(model, h, vectors, room):
    for group in range(vectors.shape[0]):
        _settle(model, 0.5 * h, 1.0, vectors[group], room)
        add_slopes(vectors[group, 0], vectors[group, 1], h, duals(room.numbers[RATE]))
        add_slopes(vectors[group, 2], vectors[group, 3], h, duals(room.numbers[CHANGE]))


@verb
def change_variables_of_vectors(model, sign, vectors, room):
    """Change dv' to those of momenta for sign = -1, or back for 1, before the planets' velocities are; without terms
    that depend on velocities nothing is done.
    """
    return _change_variables if depends_on_velocities(model) else lambda model, sign, vectors, room: None


@kernel
def _change_variables(model, sign, vectors, room):
    for group in range(vectors.shape[0]):
        _settle(model, 0.0, max(sign, 0.0), vectors[group], room)
        add_slopes(vectors[group, 2], vectors[group, 3], sign, duals(room.numbers[RATE]))
