"""The derivative of the flow of Kepler's problem, for a known step of it; float64 or `Lanes`.

With the notation of `orbits.kernels.kepler.flow`, the flow is a function of r0, eta and beta, and of q and v. The
universal anomaly of a step that is known is s = (beta dt + change of q.v) / gm, on every conic, so that no equation is
solved. Differences d of the start change

    r ds = -(G1 dr0 + G2 deta + W dbeta),   W = eta P2 + zeta P3 - r0 G3,   P_k = dG_k/dbeta = (k G_(k+2) - s G_(k+1))/2
    dG_k = G_(k-1) ds + P_k dbeta,   dr = G0 dr0 + G1 deta + (eta G0 + zeta G1) ds + (eta P1 + zeta P2 - r0 G2) dbeta

and with them f, g, f' and g'. All are linear in A = q.dq, B = q.dv + v.dq and C = v.dv: twelve numbers, computed once
for a step, serve any number of differences.

Sources: Mikkola & Innanen (1999), Celest. Mech. Dyn. Astron. 74, 59; Rein & Tamayo (2016), MNRAS 459, 2275.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from orbits.kernels.binding import plus
from orbits.kernels.compile import kernel
from orbits.kernels.kepler.flow import anomaly_functions
from orbits.kernels.lanes import any_lane, fma, maximum, minimum, select, sqrt
from orbits.kernels.maps.threes import added, dot, times

FOURTH = tuple(1.0 / math.factorial(2 * k + 4) for k in range(10, -1, -1))
FIFTH = tuple(1.0 / math.factorial(2 * k + 5) for k in range(10, -1, -1))
"""Coefficients of c4 and c5, the highest first: complete to 1e-19 for |z| <= 2.5."""

FAST = 16.0
"""The -beta r0 / gm above which s is bounded: rounding errors in it are that much larger."""

SHORT = 2.5
"""The |z| up to which the series of c4 and c5 are summed."""


class Flow(NamedTuple):
    """A step of Kepler's flow and its derivative.

    place, velocity : where it began, three numbers each
    f, g, df, dg : f - 1, g, f' and g' - 1, with which q+ - q = (f - 1) q + g v and v+ - v = f' q + (g' - 1) v; each
        with its derivatives by A, B and C
    """

    place: Any
    velocity: Any
    f: Any
    g: Any
    df: Any
    dg: Any


@kernel(inline=True)
def _six_functions(s, beta):
    """Return G0 ... G5 of any s."""
    z = beta * s * s
    small = abs(z) <= SHORT
    m = -select(small, z, 0.0)
    c4, c5 = m * 0.0, m * 0.0
    for k in range(len(FOURTH)):
        c4, c5 = fma(m, c4, FOURTH[k]), fma(m, c5, FIFTH[k])
    c2, c3 = fma(m, c4, 0.5), fma(m, c5, 1.0 / 6.0)
    s2 = s * s
    s3 = s2 * s
    G2, G3, G4, G5 = s2 * c2, s3 * c3, s2 * s2 * c4, s2 * s3 * c5
    G0, G1 = fma(m, c2, 1.0), s * fma(m, c3, 1.0)
    if any_lane(1.0 - small):
        H0, H1, H2, H3 = anomaly_functions(s, beta)
        by = 1.0 / select(small, 1.0, beta)
        G0, G1, G2, G3 = select(small, G0, H0), select(small, G1, H1), select(small, G2, H2), select(small, G3, H3)
        G4 = select(small, G4, (0.5 * s2 - H2) * by)
        G5 = select(small, G5, ((1.0 / 6.0) * s3 - H3) * by)
    return G0, G1, G2, G3, G4, G5


@kernel(inline=True)
def flow_of(place, velocity, gm, dt, moved, change):
    """Return the `Flow` of a step in the time dt, of which the change of place, `moved`, and of velocity are known.

    gm : 0 where nothing attracts; the motion is then straight
    """
    there = gm > 0.0
    gm = select(there, gm, 1.0)
    r0 = sqrt(dot(place, place))
    near = 1.0 / r0
    eta, v2 = dot(place, velocity), dot(velocity, velocity)
    beta = fma(2.0 * gm, near, -v2)
    zeta = fma(-beta, r0, gm)
    turned = dot(place, change) + (dot(moved, velocity) + dot(moved, change))
    s = fma(beta, dt, turned) / gm
    end = plus(place, moved)
    r1 = sqrt(dot(end, end))
    far = 1.0 / r1
    fast = (-beta * r0 > FAST * gm) * (eta * (eta + turned) > 0.0)
    if any_lane(fast):  # the sum for s cancels; but the distance is between those at both ends, and so is ds/dt
        least, most = minimum(near, far), maximum(near, far)
        one, other = dt * least, dt * most
        bounded = minimum(maximum(s, minimum(one, other)), maximum(one, other))
        s = select(fast, bounded, s)
    G0, G1, G2, G3, G4, G5 = _six_functions(s, beta)
    P1, P2, P3 = 0.5 * fma(-s, G2, G3), 0.5 * fma(-s, G3, 2.0 * G4), 0.5 * fma(-s, G4, 3.0 * G5)

    # Derivatives by r0, eta and beta.
    s0, s1 = -G1 * far, -G2 * far
    s2 = -fma(eta, P2, fma(zeta, P3, -r0 * G3)) * far
    slope = fma(eta, G0, zeta * G1)
    r0_, r1_ = fma(slope, s0, G0), fma(slope, s1, G1)
    r2_ = fma(slope, s2, fma(eta, P1, fma(zeta, P2, -r0 * G2)))
    G1_0, G1_1, G1_2 = G0 * s0, G0 * s1, fma(G0, s2, P1)
    G2_0, G2_1, G2_2 = G1 * s0, G1 * s1, fma(G1, s2, P2)
    G3_0, G3_1, G3_2 = G2 * s0, G2 * s1, fma(G2, s2, P3)

    pull, away = gm * near, gm * far
    f, g, df, dg = -pull * G2, fma(-gm, G3, dt), -pull * far * G1, -away * G2
    f0, f1, f2 = pull * fma(G2, near, -G2_0), -pull * G2_1, -pull * G2_2
    g0, g1, g2 = -gm * G3_0, -gm * G3_1, -gm * G3_2
    e0 = pull * far * fma(G1, fma(far, r0_, near), -G1_0)
    e1, e2 = pull * far * fma(G1, far * r1_, -G1_1), pull * far * fma(G1, far * r2_, -G1_2)
    h0, h1, h2 = (
        away * fma(G2, far * r0_, -G2_0),
        away * fma(G2, far * r1_, -G2_1),
        away * fma(G2, far * r2_, -G2_2),
    )
    # dr0 = A / r0, deta = B, dbeta = -2 gm A / r0^3 - 2 C
    bent = -2.0 * pull * near
    zero = 0.0 * r0
    return Flow(
        place,
        velocity,
        _where(there, zero, (f, near * fma(bent, f2, f0), f1, -2.0 * f2), zero),
        _where(there, zero, (g, near * fma(bent, g2, g0), g1, -2.0 * g2), dt),
        _where(there, zero, (df, near * fma(bent, e2, e0), e1, -2.0 * e2), zero),
        _where(there, zero, (dg, near * fma(bent, h2, h0), h1, -2.0 * h2), zero),
    )


@kernel(inline=True)
def _where(there, zero, four, straight):
    """Return four numbers where something attracts, and those of a straight motion elsewhere."""
    return (
        select(there, four[0], straight),
        select(there, four[1], zero),
        select(there, four[2], zero),
        select(there, four[3], zero),
    )


@kernel(inline=True)
def flow_change(flow, place, velocity):
    """Return the changes of a difference of the start in a step, of place and of velocity, to be added to it.

    flow : of `flow_of`, in float64 or `Lanes`; the difference may be `Lanes` of one step, or of eight
    """
    q, u = flow.place, flow.velocity
    A, B, C = dot(q, place), dot(q, velocity) + dot(u, place), dot(u, velocity)
    f, g, e, h = _along(flow.f, A, B, C), _along(flow.g, A, B, C), _along(flow.df, A, B, C), _along(flow.dg, A, B, C)
    way = plus(added(times(flow.g[0], velocity), flow.f[0], place), added(times(g, u), f, q))
    return way, plus(added(times(flow.dg[0], velocity), flow.df[0], place), added(times(h, u), e, q))


@kernel(inline=True)
def _along(four, A, B, C):
    return fma(four[1], A, fma(four[2], B, four[3] * C))
