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

from numba import types
from numba.core.imputils import impl_ret_borrowed
from numba.extending import intrinsic

from orbits.kernels.binding import SumType, kernel_of, other_terms, plus
from orbits.kernels.compile import kernel
from orbits.kernels.compile.verbs import verb
from orbits.kernels.lanes import WIDTH, any_lane, full, lane, load, select, store, sums_after, sums_before, total
from orbits.kernels.maps.interaction import (
    FORCE,
    INNER,
    MASS,
    OUTER,
    OWN,
    PLACE,
    RATE,
    ROWS,
    SHARE,
    STATE_ROWS,
    load_three,
    masses_of,
    store_three,
)
from orbits.kernels.sums.summation import accumulate

WEAK = 1e-13
"""The square of s/w below which two evaluations do."""

QUICK, MORE = 2, 5
"""Evaluations, and how many more where s is not small."""


@intrinsic
def strength_of(typingctx, model):
    """Return eps^2 and GM of each body, the parameters of Newton's Lagrangian, of a model with terms or without."""
    own = model.types[1]
    several = isinstance(own, types.BaseTuple)

    def codegen(context, builder, signature, arguments):
        found = builder.extract_value(arguments[0], 1)
        found = builder.extract_value(found, 0) if several else found
        return impl_ret_borrowed(context, builder, signature.return_type, found)

    return (own[0] if several else own)(model), codegen


def _summing(static):
    """Return a function that sums what `about` returns over terms of positions alone, or over all others."""

    @verb
    def summed(tags, strength, parameters, gm, r, w):
        about, last = kernel_of(tags.terms[0], "about"), len(tags.terms) == 1
        if (kernel_of(tags.terms[0], "field") is not None) != static:
            if last:

                def nothing(tags, strength, parameters, gm, r, w):
                    none = r[0] * 0.0
                    return none, none, none, none, none, none

                return nothing
            return lambda tags, strength, parameters, gm, r, w: summed(
                other_terms(tags), strength, parameters[1:], gm, r, w
            )
        if last:
            return lambda tags, strength, parameters, gm, r, w: about(strength, parameters[0], gm, r, w)

        def these(tags, strength, parameters, gm, r, w):
            mine = about(strength, parameters[0], gm, r, w)
            return plus(mine, summed(other_terms(tags), strength, parameters[1:], gm, r, w))

        return these

    return summed


_pulls = _summing(True)
_derivatives = _summing(False)


def _has(model, static):
    """Return whether a model, by its Numba type, has terms of positions alone, or others."""
    tag = model.types[0]
    if not isinstance(tag, SumType):
        return False
    return any((kernel_of(term, "field") is not None) == static for term in tag.terms[1:])


@kernel(inline=True)
def _settled(tags, strength, parameters, masses, state, half, sweeps):
    """Return the rates of the planets of a single register, six, from r' and their momenta: see `_settle`.

    sweeps : how many evaluations more than the first one, which is at the state itself
    In u and its velocity W the rates are S J f = f + sum_j m_j f_j / m_0, so that only the last ones, and the first
    places, need sums over the planets inside or further out.
    """
    (x, y, z, u, v, w), share, mass = state, masses.share, masses.mass
    U = x + sums_before(share * x), y + sums_before(share * y), z + sums_before(share * z)
    W = u + sums_before(share * u), v + sums_before(share * v), w + sums_before(share * w)
    f = _derivatives(tags, strength, parameters, mass, U, W)
    part = mass * full(lane(masses.inner, 0))
    for _ in range(sweeps):
        f = _again(tags, strength, parameters, mass, part, U, W, f, half)
    if sweeps > 0 and any_lane(_is_strong((f[3], f[4], f[5]), W)):
        for _ in range(MORE):
            f = _again(tags, strength, parameters, mass, part, U, W, f, half)
    outer, inner = masses.outer, masses.inner
    return (
        -_in_jacobi(outer, inner, mass, f[3], 0.0),
        -_in_jacobi(outer, inner, mass, f[4], 0.0),
        -_in_jacobi(outer, inner, mass, f[5], 0.0),
        _in_jacobi(outer, inner, mass, f[0], 0.0),
        _in_jacobi(outer, inner, mass, f[1], 0.0),
        _in_jacobi(outer, inner, mass, f[2], 0.0),
    )


@kernel(inline=True)
def _again(tags, strength, parameters, mass, part, U, W, f, half):
    """Return the derivatives at the midpoint to which earlier ones lead; part : m_i / m_0"""
    gx, gy, gz = f[0] + total(part * f[0]), f[1] + total(part * f[1]), f[2] + total(part * f[2])
    px, py, pz = f[3] + total(part * f[3]), f[4] + total(part * f[4]), f[5] + total(part * f[5])
    place = U[0] - half * px, U[1] - half * py, U[2] - half * pz
    speed = W[0] + (half * gx - px), W[1] + (half * gy - py), W[2] + (half * gz - pz)
    return _derivatives(tags, strength, parameters, mass, place, speed)


@kernel(inline=True)
def _settle_register(tags, strength, parameters, planets, room, half, sweeps):
    state = load_three(planets, 0) + load_three(planets, 3)
    rates = _settled(tags, strength, parameters, masses_of(full(0.0), room), state, half, sweeps)
    store_three(room, RATE, (rates[0], rates[1], rates[2]))
    store_three(room, RATE + 3, (rates[3], rates[4], rates[5]))


@kernel
def _evaluate(tags, strength, parameters, planets, room, half, known):
    """Write the rates of change of the planets into the rows RATE; of a single register, those at its state.

    half : how far the planets are ahead by the rates that are there; known : 1 if their velocities are momenta, from
        which those rates lead to velocities, or 0 if they are velocities
    """
    registers = room.shape[0] // ROWS
    if registers == 1:
        _settle_register(tags, strength, parameters, planets, room, half, 0)
        return
    bx, by, bz, bu, bv, bw = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for register in range(registers):
        first, other = STATE_ROWS * register, ROWS * register
        x, y, z = load_three(planets, first)
        u, v, w = load_three(planets, first + 3)
        rx, ry, rz = load_three(room, other + RATE)
        ru, rv, rw = load_three(room, other + RATE + 3)
        x, y, z = x + half * rx, y + half * ry, z + half * rz
        u, v, w = u + (half * ru + known * rx), v + (half * rv + known * ry), w + (half * rw + known * rz)
        share, mass = load(room, other + SHARE), load(room, other + MASS)
        sx, sy, sz, su, sv, sw = share * x, share * y, share * z, share * u, share * v, share * w
        place = x + (bx + sums_before(sx)), y + (by + sums_before(sy)), z + (bz + sums_before(sz))
        speed = u + (bu + sums_before(su)), v + (bv + sums_before(sv)), w + (bw + sums_before(sw))
        gx, gy, gz, px, py, pz = _derivatives(tags, strength, parameters, mass, place, speed)
        bx, by, bz = bx + total(sx), by + total(sy), bz + total(sz)
        bu, bv, bw = bu + total(su), bv + total(sv), bw + total(sw)
        store_three(room, other + OWN, (gx, gy, gz))
        store_three(room, other + OWN + 3, (px, py, pz))
    beyond, further = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for k in range(registers):
        other = ROWS * (registers - 1 - k)
        g, s, mass = load_three(room, other + OWN), load_three(room, other + OWN + 3), load(room, other + MASS)
        _store_rates(room, other, g, s, beyond, further)
        beyond = beyond[0] + total(mass * g[0]), beyond[1] + total(mass * g[1]), beyond[2] + total(mass * g[2])
        further = further[0] + total(mass * s[0]), further[1] + total(mass * s[1]), further[2] + total(mass * s[2])


@kernel(inline=True)
def _store_rates(room, other, g, s, beyond, further):
    """Write the rates of a register; beyond, further : the sums of m g and m s over the registers further out."""
    outer, inner, mass = load(room, other + OUTER), load(room, other + INNER), load(room, other + MASS)
    store(room, other + RATE, -_in_jacobi(outer, inner, mass, s[0], further[0]))
    store(room, other + RATE + 1, -_in_jacobi(outer, inner, mass, s[1], further[1]))
    store(room, other + RATE + 2, -_in_jacobi(outer, inner, mass, s[2], further[2]))
    store(room, other + RATE + 3, _in_jacobi(outer, inner, mass, g[0], beyond[0]))
    store(room, other + RATE + 4, _in_jacobi(outer, inner, mass, g[1], beyond[1]))
    store(room, other + RATE + 5, _in_jacobi(outer, inner, mass, g[2], beyond[2]))


@kernel(inline=True)
def _in_jacobi(outer, inner, mass, own, beyond):
    """Return a derivative by Jacobi's coordinates, divided by the reduced masses; beyond : m times it, further out."""
    return outer * own + inner * (sums_after(mass * own) + beyond)


@kernel
def _settle(tags, strength, parameters, planets, room, half):
    """Write the rates at the midpoint of a flow of twice `half`, or with half = 0 those from momenta to velocities."""
    registers, strong = room.shape[0] // ROWS, False
    if registers == 1:
        _settle_register(tags, strength, parameters, planets, room, half, QUICK - 1)
        return
    for register in range(registers):
        for k in range(6):
            store(room, ROWS * register + RATE + k, full(0.0))
    for _ in range(QUICK):
        _evaluate(tags, strength, parameters, planets, room, half, 1.0)
    for register in range(registers):
        r, v = load_three(room, ROWS * register + RATE), load_three(planets, STATE_ROWS * register + 3)
        strong = strong or any_lane(_is_strong(r, v))
    if strong:
        for _ in range(MORE):
            _evaluate(tags, strength, parameters, planets, room, half, 1.0)


@kernel(inline=True)
def _is_strong(rate, velocity):
    """Return 1 where momenta differ so much from m v that more evaluations are due."""
    square = rate[0] * rate[0] + rate[1] * rate[1] + rate[2] * rate[2]
    v2 = velocity[0] * velocity[0] + velocity[1] * velocity[1] + velocity[2] * velocity[2]
    return square > WEAK * v2


@kernel
def _advance(planets, room, h, moving):
    """Add h times the rates to the velocities, and if `moving` to the places."""
    for register in range(room.shape[0] // ROWS):
        first, other = STATE_ROWS * register, ROWS * register + RATE
        for k in range(0 if moving else 3, 6):
            hi, lo = accumulate(load(planets, first + k), load(planets, first + 6 + k), h * load(room, other + k))
            store(planets, first + k, hi)
            store(planets, first + 6 + k, lo)


@kernel
def _change_momenta(planets, room, sign):
    """Take the rates of the places from the velocities, or add them: momenta from velocities, or the reverse."""
    for register in range(room.shape[0] // ROWS):
        first, other = STATE_ROWS * register + 3, ROWS * register + RATE
        for k in range(3):
            hi, lo = accumulate(load(planets, first + k), load(planets, first + 6 + k), sign * load(room, other + k))
            store(planets, first + k, hi)
            store(planets, first + 6 + k, lo)


@kernel
def _tabulate(planets, room, strength, table, first):
    """Write C_i and its rate of change, and the rates of R_i, for each place i, in two of three rows each."""
    count = strength.shape[0] - 2
    for k in range(6):
        offset, rate = 0.0, 0.0
        table[first + 3 * count + 1, k] = rate
        for j in range(count):
            i = count - j
            register, slot = (i - 1) // WIDTH, (i - 1) % WIDTH
            rate -= room[ROWS * register + SHARE, slot] * room[ROWS * register + RATE + k, slot]
            table[first + 3 * (i - 1) + 1, k] = rate
        table[first, k] = offset
        for i in range(1, count + 1):
            register, slot = (i - 1) // WIDTH, (i - 1) % WIDTH
            offset += room[ROWS * register + SHARE, slot] * planets[STATE_ROWS * register + k, slot]
            table[first + 3 * i, k] = offset


@kernel
def _flow(tags, strength, parameters, planets, room, h):
    _settle(tags, strength, parameters, planets, room, 0.5 * h)
    _advance(planets, room, h, True)


@verb
def flow(model, planets, room, h):
    """Advance the planets by h in the flow of the terms that depend on velocities; without any, nothing is done."""
    if not _has(model, False):
        return lambda model, planets, room, h: None
    return lambda model, planets, room, h: _flow(
        other_terms(model.tag), model.parameters[0], model.parameters[1:], planets, room, h
    )


@kernel(inline=True)
def _flow_of_register(tags, strength, parameters, masses, planets, h):
    (x, y, z, u, v, w), (x_lo, y_lo, z_lo, u_lo, v_lo, w_lo) = planets
    rates = _settled(tags, strength, parameters, masses, planets[0], 0.5 * h, QUICK - 1)
    x, x_lo = accumulate(x, x_lo, h * rates[0])
    y, y_lo = accumulate(y, y_lo, h * rates[1])
    z, z_lo = accumulate(z, z_lo, h * rates[2])
    u, u_lo = accumulate(u, u_lo, h * rates[3])
    v, v_lo = accumulate(v, v_lo, h * rates[4])
    w, w_lo = accumulate(w, w_lo, h * rates[5])
    return (x, y, z, u, v, w), (x_lo, y_lo, z_lo, u_lo, v_lo, w_lo)


@verb
def flow_of_register(model, masses, planets, h):
    """Return planets of a single register after `flow`: r' and its velocity, six, and their low parts."""
    if not _has(model, False):
        return lambda model, masses, planets, h: planets
    return lambda model, masses, planets, h: _flow_of_register(
        other_terms(model.tag), model.parameters[0], model.parameters[1:], masses, planets, h
    )


@kernel(inline=True)
def _with_pulls(tags, strength, parameters, masses, place, force):
    gx, gy, gz, _, _, _ = _pulls(tags, strength, parameters, masses.mass, place, place)
    outer, inner, mass = masses.outer, masses.inner, masses.mass
    return (
        force[0] + _in_jacobi(outer, inner, mass, gx, 0.0),
        force[1] + _in_jacobi(outer, inner, mass, gy, 0.0),
        force[2] + _in_jacobi(outer, inner, mass, gz, 0.0),
    )


@verb
def force_with_pulls(model, masses, place, force):
    """Return the interaction of a single register with the accelerations by terms of positions alone, at u."""
    if not _has(model, True):
        return lambda model, masses, place, force: force
    return lambda model, masses, place, force: _with_pulls(
        other_terms(model.tag), model.parameters[0], model.parameters[1:], masses, place, force
    )


@kernel
def _flow_among(tags, strength, parameters, planets, room, table, first, h):
    _settle(tags, strength, parameters, planets, room, 0.5 * h)
    _tabulate(planets, room, strength, table, first)
    _advance(planets, room, h, True)


@verb
def flow_among(model, planets, room, table, first, h):
    """The same, with what particles need of it in a table, from row `first` of the stages of a step on."""
    if not _has(model, False):
        return lambda model, planets, room, table, first, h: None
    return lambda model, planets, room, table, first, h: _flow_among(
        other_terms(model.tag), model.parameters[0], model.parameters[1:], planets, room, table, first, h
    )


@kernel
def _to_momenta(tags, strength, parameters, planets, room, table, first):
    for register in range(room.shape[0] // ROWS):
        for k in range(6):
            store(room, ROWS * register + RATE + k, full(0.0))
    _evaluate(tags, strength, parameters, planets, room, 0.0, 0.0)
    if first >= 0:
        _tabulate(planets, room, strength, table, first)
    _change_momenta(planets, room, -1.0)


@verb
def to_momenta(model, planets, room, table, first):
    """Change the velocities of planets to momenta, divided by masses; with a table for particles if first >= 0."""
    if not _has(model, False):
        return lambda model, planets, room, table, first: None
    return lambda model, planets, room, table, first: _to_momenta(
        other_terms(model.tag), model.parameters[0], model.parameters[1:], planets, room, table, first
    )


@kernel
def _to_velocities(tags, strength, parameters, planets, room, table, first):
    _settle(tags, strength, parameters, planets, room, 0.0)
    if first >= 0:
        _tabulate(planets, room, strength, table, first)
    _change_momenta(planets, room, 1.0)


@verb
def to_velocities(model, planets, room, table, first):
    """The reverse of `to_momenta`."""
    if not _has(model, False):
        return lambda model, planets, room, table, first: None
    return lambda model, planets, room, table, first: _to_velocities(
        other_terms(model.tag), model.parameters[0], model.parameters[1:], planets, room, table, first
    )


@kernel
def _kick(tags, strength, parameters, planets, room):
    """Add the accelerations at u, in the rows PLACE, to the rows FORCE."""
    registers = room.shape[0] // ROWS
    if registers == 1:
        place, force = load_three(room, PLACE), load_three(room, FORCE)
        store_three(room, FORCE, _with_pulls(tags, strength, parameters, masses_of(full(0.0), room), place, force))
        return
    bx, by, bz = 0.0, 0.0, 0.0
    for k in range(registers):
        other = ROWS * (registers - 1 - k)
        outer, inner, mass = load(room, other + OUTER), load(room, other + INNER), load(room, other + MASS)
        place, (fx, fy, fz) = load_three(room, other + PLACE), load_three(room, other + FORCE)
        gx, gy, gz, _, _, _ = _pulls(tags, strength, parameters, mass, place, place)
        fx, fy = fx + _in_jacobi(outer, inner, mass, gx, bx), fy + _in_jacobi(outer, inner, mass, gy, by)
        store_three(room, other + FORCE, (fx, fy, fz + _in_jacobi(outer, inner, mass, gz, bz)))
        bx, by, bz = bx + total(mass * gx), by + total(mass * gy), bz + total(mass * gz)


@verb
def kick_more(model, planets, room):
    """Add the accelerations by terms of positions alone to the interaction; without any, nothing is done."""
    if not _has(model, True):
        return lambda model, planets, room: None
    return lambda model, planets, room: _kick(
        other_terms(model.tag), model.parameters[0], model.parameters[1:], planets, room
    )


@verb
def pull_more(model, u, g):
    """Return g of particles at u with the accelerations by terms of positions alone."""
    if not _has(model, True):
        return lambda model, u, g: g

    def pulled(model, u, g):
        none = u[0] * 0.0
        more = _pulls(other_terms(model.tag), model.parameters[0], model.parameters[1:], none, u, u)
        return g[0] + more[0], g[1] + more[1], g[2] + more[2]

    return pulled


def depends_on_velocities(model):
    """Return whether a model, by its Numba type, has terms that depend on velocities."""
    return _has(model, False)


def depends_on_positions(model):
    """Return whether a model, by its Numba type, has terms of positions alone."""
    return _has(model, True)


@verb
def has_terms(model):
    """Return whether a model has terms besides Newton's."""
    if _has(model, False) or _has(model, True):
        return lambda model: True
    return lambda model: False


@verb
def has_flow(model):
    """Return whether a model has terms that depend on velocities."""
    if _has(model, False):
        return lambda model: True
    return lambda model: False


@verb
def particle_rates(model, central, u, w, half, known):
    """Return (rates of the place, rates of the velocity) of massless particles at u with velocities w relative to the
    dominant body, whose rates are `central`, six numbers; half and known : see
    `orbits.kernels.maps.terms_of_dominant._evaluate`.
    """
    return lambda model, central, u, w, half, known: _rates_of(
        other_terms(model.tag), model.parameters[0], model.parameters[1:], central, (u, w), half, known
    )


@kernel(inline=True)
def _rates_of(tags, strength, parameters, central, state, half, known):
    u, w = state
    gx, gy, gz, px, py, pz = _derivatives(tags, strength, parameters, u[0] * 0.0, u, w)
    rate = -px, -py, -pz, gx, gy, gz
    if known:
        for _ in range(QUICK - 1):
            rate = _once(tags, strength, parameters, central, u, w, half, rate)
        strong = _is_strong((rate[0], rate[1], rate[2]), w)
        if any_lane(strong):
            better = rate
            for _ in range(MORE):
                better = _once(tags, strength, parameters, central, u, w, half, better)
            rate = (
                select(strong, better[0], rate[0]),
                select(strong, better[1], rate[1]),
                select(strong, better[2], rate[2]),
                select(strong, better[3], rate[3]),
                select(strong, better[4], rate[4]),
                select(strong, better[5], rate[5]),
            )
    return rate


@kernel(inline=True)
def _once(tags, strength, parameters, central, u, w, half, rate):
    """Return the rates at the midpoint to which earlier ones lead, with the velocities that belong to the momenta."""
    x, y, z = rate[0] - central[0], rate[1] - central[1], rate[2] - central[2]
    a, b, c = rate[3] - central[3], rate[4] - central[4], rate[5] - central[5]
    there = u[0] + half * x, u[1] + half * y, u[2] + half * z
    speed = w[0] + (half * a + x), w[1] + (half * b + y), w[2] + (half * c + z)
    gx, gy, gz, px, py, pz = _derivatives(tags, strength, parameters, u[0] * 0.0, there, speed)
    return -px, -py, -pz, gx, gy, gz
