"""Terms of the dominant body in Wisdom–Holman maps: those of positions as kicks, relativity and the like as a flow.

A term of the dominant body adds sum_i m_i l(u_i, w_i) to L, with u and w positions and velocities relative to that body
(`about` in `orbits.lagrangians.terms.base`). In the Jacobi coordinates of `orbits.kernels.maps.jacobi`, with g = dl/du
and s = dl/dw, its part H_1 of the Hamiltonian moves the planets by

    dr'_i/dt = -[M_i/M_(i-1) s_i + sum_(k>i) m_k s_k / M_(i-1)]
    dv'_i/dt =   M_i/M_(i-1) g_i + sum_(k>i) m_k g_k / M_(i-1)

in which v'_i is the momentum divided by the reduced mass; at the ends of a march it is made from the velocities, and
they from it. For a term of positions alone, s = 0, this is a part of the kick. Any other one is a flow of its own, by
the midpoint rule: exactly symplectic and symmetric, with an error of (H_1 h)^3, which is below the last bit by ten
orders. g and s are taken at the velocities that belong to the momenta, so H_1 has all orders of 1/c^2 of the Legendre
transform of L, and the motion is that of L itself. The rule is solved by iteration: two evaluations where momenta
differ from m v by less than `WEAK`, which leaves 1e-20 of it, and more elsewhere.

A massless particle behind i planets has the same with R_i and its velocity in place of the sums.

Source: Hairer, Lubich & Wanner (2006), sec. II.1.4, VI.4 (midpoint rule); Saha & Tremaine (1994), AJ 108, 1962.
"""

from __future__ import annotations

from orbits.kernels.binding import plus
from orbits.kernels.compile import kernel
from orbits.kernels.compile.verbs import verb
from orbits.kernels.lanes import any_lane, full, lane, load, store
from orbits.kernels.maps.layout import (
    FORCE,
    MASS,
    OWN,
    PLACE,
    RATE,
    ROWS,
    SHARE,
    STATE_ROWS,
    constant,
    coordinate,
    masses_of,
)
from orbits.kernels.maps.orbits import displaced, kicked, orbits_of, write_orbits
from orbits.kernels.maps.terms_by_kind import (
    depends_on_positions,
    depends_on_velocities,
    derivatives_at,
    pulls_at,
    terms_of,
)
from orbits.kernels.maps.threes import (
    NOTHING,
    added,
    chosen,
    inside_of,
    load_three,
    minus,
    outside_of,
    store_three,
    times,
    totals,
)

WEAK = 1e-13
"""The square of s/w below which two evaluations do."""

QUICK, MORE = 2, 5
"""Evaluations, and how many more where s is not small."""


@kernel(inline=True)
def _in_jacobi(masses, sign, own, beyond):
    """Return derivatives by Jacobi's coordinates, divided by the reduced masses; beyond : the sums of m times them over
    the registers further out
    """
    further = plus(outside_of(times(masses.mass, own)), beyond)
    return times(sign, plus(times(masses.outer, own), times(masses.inner, further)))


@kernel(inline=True)
def _settled(terms, masses, orbits, half, sweeps):
    """Return the rates of the planets of a single register, of r' and of their momenta: see `_settle`.

    sweeps : how many evaluations more than the first one, which is at the state itself
    In u and its velocity W the rates are S J f = f + sum_j m_j f_j / m_0, so that only the last ones, and the first
    places, need sums over the planets inside or further out.
    """
    mass = masses.mass
    U = plus(orbits.place, inside_of(masses.share, orbits.place))
    W = plus(orbits.velocity, inside_of(masses.share, orbits.velocity))
    g, s = derivatives_at(terms, mass, U, W)
    part = mass * lane(masses.inner, 0)
    for _ in range(sweeps):
        g, s = _again(terms, mass, part, U, W, g, s, half)
    if sweeps > 0 and any_lane(_is_strong(s, W)):
        for _ in range(MORE):
            g, s = _again(terms, mass, part, U, W, g, s, half)
    return _in_jacobi(masses, -1.0, s, NOTHING), _in_jacobi(masses, 1.0, g, NOTHING)


@kernel(inline=True)
def _again(terms, mass, part, U, W, g, s, half):
    """Return the derivatives at the midpoint to which earlier ones lead; part : m_i / m_0"""
    g, p = plus(g, totals(times(part, g))), plus(s, totals(times(part, s)))
    place = added(U, -half, p)
    speed = W[0] + (half * g[0] - p[0]), W[1] + (half * g[1] - p[1]), W[2] + (half * g[2] - p[2])
    return derivatives_at(terms, mass, place, speed)


@kernel(inline=True)
def _settle_register(terms, planets, room, half, sweeps):
    one = full(0.0)
    r, v = _settled(terms, masses_of(one, room), orbits_of(one, planets), half, sweeps)
    store_three(room, RATE, r)
    store_three(room, RATE + 3, v)


@kernel
def _evaluate(terms, planets, room, half, known):
    """Write the rates of change of the planets into the rows RATE; of a single register, those at its state.

    half : how far the planets are ahead by the rates that are there; known : 1 if their velocities are momenta, from
        which those rates lead to velocities, or 0 if they are velocities
    """
    registers = room.shape[0] // ROWS
    if registers == 1:
        _settle_register(terms, planets, room, half, 0)
        return
    inside, slower = NOTHING, NOTHING
    for register in range(registers):
        first, other = STATE_ROWS * register, ROWS * register
        rate, change = load_three(room, other + RATE), load_three(room, other + RATE + 3)
        r = added(load_three(planets, first), full(half), rate)
        u, v, w = load_three(planets, first + 3)
        v = (
            u + (half * change[0] + known * rate[0]),
            v + (half * change[1] + known * rate[1]),
            w + (half * change[2] + known * rate[2]),
        )
        share, mass = load(room, other + SHARE), load(room, other + MASS)
        place = plus(inside, plus(r, inside_of(share, r)))
        speed = plus(slower, plus(v, inside_of(share, v)))
        g, s = derivatives_at(terms, mass, place, speed)
        inside, slower = plus(inside, totals(times(share, r))), plus(slower, totals(times(share, v)))
        store_three(room, other + OWN, g)
        store_three(room, other + OWN + 3, s)
    beyond, further = NOTHING, NOTHING
    for k in range(registers):
        other = ROWS * (registers - 1 - k)
        masses, g = masses_of(full(0.0), room[other:]), load_three(room, other + OWN)
        s = load_three(room, other + OWN + 3)
        store_three(room, other + RATE, _in_jacobi(masses, -1.0, s, further))
        store_three(room, other + RATE + 3, _in_jacobi(masses, 1.0, g, beyond))
        beyond = plus(beyond, totals(times(masses.mass, g)))
        further = plus(further, totals(times(masses.mass, s)))


@kernel(inline=True)
def _clear_rates(room):
    for register in range(room.shape[0] // ROWS):
        for k in range(6):
            store(room, ROWS * register + RATE + k, full(0.0))


@kernel
def _settle(terms, planets, room, half):
    """Write the rates at the midpoint of a flow of twice `half`, or with half = 0 those from momenta to velocities."""
    registers, strong = room.shape[0] // ROWS, False
    if registers == 1:
        _settle_register(terms, planets, room, half, QUICK - 1)
        return
    _clear_rates(room)
    for _ in range(QUICK):
        _evaluate(terms, planets, room, half, 1.0)
    for register in range(registers):
        r, v = load_three(room, ROWS * register + RATE), load_three(planets, STATE_ROWS * register + 3)
        strong = strong or any_lane(_is_strong(r, v))
    if strong:
        for _ in range(MORE):
            _evaluate(terms, planets, room, half, 1.0)


@kernel(inline=True)
def _is_strong(rate, velocity):
    """Return 1 where momenta differ so much from m v that more evaluations are due."""
    square = rate[0] * rate[0] + rate[1] * rate[1] + rate[2] * rate[2]
    v2 = velocity[0] * velocity[0] + velocity[1] * velocity[1] + velocity[2] * velocity[2]
    return square > WEAK * v2


@kernel
def _tabulate(planets, room, count, table, first):
    """Write C_i and its rate of change, and the rates of R_i, for each place i, in two of three rows each."""
    for k in range(6):
        offset, rate = 0.0, 0.0
        table[first, k] = offset
        for i in range(1, count + 1):
            offset += constant(room, SHARE, i - 1) * coordinate(planets, k, i - 1)
            table[first + 3 * i, k] = offset
        table[first + 3 * count + 1, k] = rate
        for back in range(count):
            i = count - 1 - back
            rate -= constant(room, SHARE, i) * constant(room, RATE + k, i)
            table[first + 3 * i + 1, k] = rate


@kernel
def _flow(terms, planets, room, table, first, h):
    _settle(terms, planets, room, 0.5 * h)
    if first >= 0:
        _tabulate(planets, room, terms.strength.shape[0] - 2, table, first)
    for register in range(room.shape[0] // ROWS):
        own, rate = planets[STATE_ROWS * register :], ROWS * register + RATE
        moved = displaced(orbits_of(full(0.0), own), times(h, load_three(room, rate)))
        write_orbits(own, kicked(moved, times(h, load_three(room, rate + 3))))


@verb
def flow(model, planets, room, table, first, h):
    """Advance the planets by h in the flow of the terms that depend on velocities; without any, nothing is done.

    table, first : where particles find what they need of it, two tables of three rows for each place from row `first`
        on, or -1 for none
    """
    if not depends_on_velocities(model):
        return lambda model, planets, room, table, first, h: None
    return lambda model, planets, room, table, first, h: _flow(terms_of(model), planets, room, table, first, h)


@kernel(inline=True)
def _flow_of_register(terms, masses, orbits, h):
    r, v = _settled(terms, masses, orbits, 0.5 * h, QUICK - 1)
    return kicked(displaced(orbits, times(h, r)), times(h, v))


@verb
def flow_of_register(model, masses, orbits, h):
    """Return planets that stay in a register after `flow`."""
    if not depends_on_velocities(model):
        return lambda model, masses, orbits, h: orbits
    return lambda model, masses, orbits, h: _flow_of_register(terms_of(model), masses, orbits, h)


@kernel
def _change_variables(terms, planets, room, table, first, sign):
    if sign < 0.0:
        _clear_rates(room)
        _evaluate(terms, planets, room, 0.0, 0.0)
    else:
        _settle(terms, planets, room, 0.0)
    if first >= 0:
        _tabulate(planets, room, terms.strength.shape[0] - 2, table, first)
    for register in range(room.shape[0] // ROWS):
        own, rate = planets[STATE_ROWS * register :], load_three(room, ROWS * register + RATE)
        write_orbits(own, kicked(orbits_of(full(0.0), own), times(sign, rate)))


@verb
def change_variables(model, planets, room, table, first, sign):
    """Change the velocities of planets to momenta, divided by masses, for sign = -1, or back for 1; table, first : see
    `flow`.
    """
    if not depends_on_velocities(model):
        return lambda model, planets, room, table, first, sign: None
    return lambda model, planets, room, table, first, sign: _change_variables(
        terms_of(model), planets, room, table, first, sign
    )


@verb
def force_with_pulls(model, masses, place, force):
    """Return the interaction of planets in registers with the accelerations by terms of positions alone, at u."""
    if not depends_on_positions(model):
        return lambda model, masses, place, force: force
    return lambda model, masses, place, force: plus(
        force, _in_jacobi(masses, 1.0, pulls_at(terms_of(model), masses.mass, place), NOTHING)
    )


@kernel
def _kick(terms, planets, room):
    """Add the accelerations at u, in the rows PLACE, to the rows FORCE."""
    registers, beyond = room.shape[0] // ROWS, NOTHING
    for k in range(registers):
        other = ROWS * (registers - 1 - k)
        masses = masses_of(full(0.0), room[other:])
        pull = pulls_at(terms, masses.mass, load_three(room, other + PLACE))
        force = plus(load_three(room, other + FORCE), _in_jacobi(masses, 1.0, pull, beyond))
        store_three(room, other + FORCE, force)
        beyond = plus(beyond, totals(times(masses.mass, pull)))


@verb
def kick_more(model, planets, room):
    """Add the accelerations by terms of positions alone to the interaction; without any, nothing is done."""
    if not depends_on_positions(model):
        return lambda model, planets, room: None
    return lambda model, planets, room: _kick(terms_of(model), planets, room)


@verb
def pull_more(model, u, g):
    """Return g of particles at u with the accelerations by terms of positions alone."""
    if not depends_on_positions(model):
        return lambda model, u, g: g
    return lambda model, u, g: plus(g, pulls_at(terms_of(model), u[0] * 0.0, u))


@kernel(inline=True)
def particle_rates(model, central, u, w, half, known):
    """Return (rates of the place, rates of the velocity) of massless particles at u with velocities w relative to the
    dominant body, whose rates are `central`, three and three numbers.

    half : how far the particles are ahead by these rates; known : whether w are momenta
    """
    terms = terms_of(model)
    g, s = derivatives_at(terms, u[0] * 0.0, u, w)
    s = -s[0], -s[1], -s[2]
    if known:
        for _ in range(QUICK - 1):
            s, g = _once(terms, central, u, w, half, s, g)
        strong = _is_strong(s, w)
        if any_lane(strong):
            better, faster = s, g
            for _ in range(MORE):
                better, faster = _once(terms, central, u, w, half, better, faster)
            s, g = chosen(strong, better, s), chosen(strong, faster, g)
    return s, g


@kernel(inline=True)
def _once(terms, central, u, w, half, s, g):
    """Return the rates at the midpoint to which earlier ones lead, with the velocities that belong to the momenta."""
    (x, y, z), (a, b, c) = minus(s, central[0]), minus(g, central[1])
    speed = w[0] + (half * a + x), w[1] + (half * b + y), w[2] + (half * c + z)
    g, s = derivatives_at(terms, u[0] * 0.0, added(u, half, (x, y, z)), speed)
    return (-s[0], -s[1], -s[2]), g
