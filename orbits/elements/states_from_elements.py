"""Keplerian and Pal's elements to states.

Every step is written so that nothing cancels: x = q - 2 a sin^2(E/2) instead of a (cos E - e), 1 + e cos f by half
angles, Kepler's equation in terms of 1 - e, and 1 - e from q/a where these are given.
Sources: Murray & Dermott (1999), Solar System Dynamics, 2.8; Battin (1999), An Introduction to the Mathematics and
Methods of Astrodynamics, ch. 4; for h, k, ix, iy Pal (2009), MNRAS 396, 1737.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from orbits.elements.kepler_equation import Floats, barker_anomaly, eccentric_anomaly, positive_angle, sinh_anomaly
from orbits.elements.naming import PAL, naming
from orbits.elements.refusals import BEYOND, NO_MASS, broadcast, finite, named, numbers, refuse

Plane = tuple[Floats, Floats, Floats, Floats]

# Below this r/|a|, the terms in 1/a are less than half the last digit, and a parabola is just as good.
NO_CURVATURE = 2.0**-60
# Rounding may push ix^2 + iy^2 this far above 4 (inc = pi), and q above a (a circle).
ROUNDING = 8.0 * np.finfo(np.float64).eps


class Conic(NamedTuple):
    """Size and shape of an orbit, arrays of one shape; a is infinite for a parabola."""

    gm: Floats
    a: Floats
    e: Floats
    one_minus_e: Floats
    q: Floats

    @property
    def parabola(self) -> NDArray[np.bool_]:
        """Which orbits are parabolas."""
        return np.isinf(self.a)


def state_from_elements(
    gm: ArrayLike,
    *,
    a: ArrayLike | None = None,
    P: ArrayLike | None = None,
    n: ArrayLike | None = None,
    q: ArrayLike | None = None,
    e: ArrayLike | None = None,
    inc: ArrayLike | None = None,
    Omega: ArrayLike | None = None,
    omega: ArrayLike | None = None,
    pomega: ArrayLike | None = None,
    M: ArrayLike | None = None,
    f: ArrayLike | None = None,
    E: ArrayLike | None = None,
    u: ArrayLike | None = None,
    l: ArrayLike | None = None,  # noqa: E741 - the mean longitude's own symbol
    theta: ArrayLike | None = None,
    T: ArrayLike | None = None,
    h: ArrayLike | None = None,
    k: ArrayLike | None = None,
    ix: ArrayLike | None = None,
    iy: ArrayLike | None = None,
    t: ArrayLike = 0.0,
    names: Sequence[str] | None = None,
) -> tuple[Floats, Floats]:
    """Return positions and velocities relative to the attracting body, each of shape (..., 3).

    All arguments broadcast against each other. Units are any consistent ones, with gm in length^3/time^2; angles are in
    radians. The result is in the axes to which the angles refer. Omitted elements are 0: without omega pericentre is at
    the node, without Omega the node is on the x axis.

    gm : G times the total mass of both bodies (of the attracting body, for a massless one), > 0
    a, P, n or q : exactly one, besides e: semi-major axis (negative for a hyperbola), period (ellipses only), mean
        motion, pericentre distance. Or q with a or P instead of e: near e = 1, where a float e determines 1 - e only to
        1.1e-16, q and a keep all digits of the orbit. q with an infinite a is a parabola
    e : eccentricity, >= 0. A parabola, e = 1 exactly, needs q, or n = sqrt(gm/(2 q^3))
    inc : inclination, 0 ... pi
    Omega : longitude of the ascending node
    omega or pomega : argument or longitude of pericentre; pomega = Omega + omega, or Omega - omega where inc > pi/2
    M, f, E, u, l, theta or T : at most one; M = 0 by default. Mean anomaly (D + D^3/3 for a parabola); true anomaly;
        eccentric anomaly (the hyperbolic anomaly F where e > 1; D = tan(f/2) where e = 1); argument of latitude
        omega + f; mean longitude pomega + M; true longitude pomega + f (pomega - M and pomega - f where inc > pi/2,
        pomega in 0 ... 2 pi); time of pericentre passage
    h, k, ix, iy : for an ellipse, Pal's elements e sin(Omega + omega), e cos(Omega + omega), 2 sin(inc/2) cos Omega,
        2 sin(inc/2) sin Omega instead of e, inc, Omega and omega; the position on the orbit is then l = Omega + omega
        + M, for any inc. They lose digits as 1 - h^2 - k^2 does for e near 1, and as 4 - ix^2 - iy^2 does for inc near
        pi; at pi itself, half of the digits are left
    t : the time of the state, needed only for T: M = n (t - T)
    names : names of the bodies, for error messages

    These are the conventions of Murray & Dermott and of REBOUND, for retrograde orbits too.
    Raises InputError, naming the body and the value or combination, for elements that do not determine an orbit.
    """
    given = {
        "a": a, "P": P, "n": n, "q": q, "e": e, "inc": inc, "Omega": Omega, "omega": omega, "pomega": pomega, "M": M,
        "f": f, "E": E, "u": u, "l": l, "theta": theta, "T": T, "h": h, "k": k, "ix": ix, "iy": iy,
    }  # fmt: skip
    names = named(names)
    way = naming([key for key, value in given.items() if value is not None], names)
    floats = {"gm": finite("gm", gm, names), "t": finite("t", t, names)}
    floats |= {
        key: _number(key, value, names, may_be_infinite=key == "a" and len(way.sizes) == 2)
        for key, value in given.items()
        if value is not None
    }
    floats = dict(zip(floats, broadcast(names, **floats), strict=True))
    gm_, t_ = floats.pop("gm"), floats.pop("t")
    zero = np.zeros(gm_.shape)
    refuse(gm_ <= 0.0, NO_MASS, names, gm=gm_)
    if way.pal:
        floats |= _from_pal({key: floats.get(key, zero) for key in PAL}, names)
    inc_, Omega_ = floats.get("inc", zero), floats.get("Omega", zero)
    wrong = "inc = {inc} rad; expected 0 ... pi. A negative inclination is a positive one with Omega turned by pi"
    refuse((inc_ < 0.0) | (inc_ > np.pi), wrong, names, inc=inc_)
    conic = _conic(gm_, {key: floats[key] for key in way.sizes}, floats.get("e"), names)
    sense = np.where((inc_ <= 0.5 * np.pi) | way.pal, 1.0, -1.0)
    omega_ = floats.get("omega", zero)
    if "pomega" in floats:
        omega_ = sense * (floats["pomega"] - Omega_)
    where = floats.get(way.place, zero)
    if way.place in ("l", "theta"):
        where = sense * (where - positive_angle(Omega_ + sense * omega_))
    if way.place == "u":
        where = where - omega_
    if way.place in ("f", "theta", "u"):
        plane = _plane_from_true_anomaly(conic, where, names)
    elif way.place == "E":
        plane = _plane_from_eccentric_anomaly(conic, where)
    elif way.place == "T":
        plane = _plane_from_time(conic, t_ - where)
    else:
        plane = _plane_from_mean_anomaly(conic, where)
    state = _turned_into_space(plane, inc_, Omega_, omega_)
    for what, vector in zip(("position", "velocity"), state, strict=True):
        size = np.max(np.abs(vector), axis=-1)
        refuse(~np.isfinite(size) | (size == 0.0), BEYOND, names, what="the " + what, value=size)
    return state


def _number(key: str, value: ArrayLike, names: Sequence[str] | None, *, may_be_infinite: bool) -> Floats:
    if not may_be_infinite:
        return finite(key, value, names)
    array = numbers(key, value, "a number or an array of numbers")
    refuse(np.isnan(array), key + " is {value}; expected a number, infinite for a parabola", names, value=array)
    return array


def _from_pal(given: dict[str, Floats], names: Sequence[str] | None) -> dict[str, Floats]:
    """Return e, inc, Omega and pomega = Omega + omega, of any inclination, for Pal's elements."""
    h, k, ix, iy = (given[key] for key in PAL)
    e, half = np.hypot(h, k), 0.5 * np.hypot(ix, iy)
    wrong = "h = {h}, k = {k} make e = {e}; expected h^2 + k^2 < 1: Pal's elements are for ellipses. Give e itself"
    refuse(e >= 1.0, wrong, names, h=h, k=k, e=e)
    wrong = "ix = {ix}, iy = {iy}; expected ix^2 + iy^2 <= 4: they are 2 sin(inc/2) times a cosine and a sine"
    refuse(half > 1.0 + ROUNDING, wrong, names, ix=ix, iy=iy)
    half = np.minimum(half, 1.0)
    inc = 2.0 * np.arctan2(half, np.sqrt((1.0 - half) * (1.0 + half)))
    return {"e": e, "inc": np.minimum(inc, np.pi), "Omega": np.arctan2(iy, ix), "pomega": np.arctan2(h, k)}


def _conic(gm: Floats, sizes: dict[str, Floats], e: Floats | None, names: Sequence[str] | None) -> Conic:
    kind = next(iter(sizes))
    size = sizes[kind]
    for key, what in (("P", "period P"), ("n", "mean motion n"), ("q", "pericentre distance q")):
        if key in sizes:
            refuse(sizes[key] <= 0.0, what + " = {size}; expected > 0", names, size=sizes[key])
    # Take roots of each factor, so that no square of a huge or tiny time is computed.
    third = np.cbrt(gm) * np.cbrt(size / (2.0 * np.pi)) ** 2 if kind == "P" else size
    third = np.cbrt(gm) / np.cbrt(size) ** 2 if kind == "n" else third
    if len(sizes) == 2:
        a, q = third if kind == "P" else size, sizes["q"]
        refuse(a == 0.0, "a = {a} with q = {q}; expected another number", names, a=a, q=q)
        a = np.where(np.isinf(a), np.inf, a)
        wrong = "q = {q} is greater than a = {a}; expected q <= a for an ellipse, a < 0 for a hyperbola"
        refuse((a > 0.0) & (q > a * (1.0 + ROUNDING)), wrong, names, a=a, q=q)
        with np.errstate(under="ignore", over="ignore"):
            one_minus_e = np.minimum(q / a, 1.0)
        wrong = "a = {a}, q = {q}: q/a is beyond the range of floats; expected an infinite a for a parabola"
        refuse(~np.isinf(a) & ((one_minus_e == 0.0) | np.isinf(one_minus_e)), wrong, names, a=a, q=q)
        return Conic(gm, a, 1.0 - one_minus_e, one_minus_e, q)
    e = np.zeros_like(gm) if e is None else e
    refuse(e < 0.0, "eccentricity e = {e}; expected >= 0", names, e=e)
    one_minus_e = 1.0 - e
    parabola = e == 1.0
    if kind in ("a", "P"):
        wrong = (
            "e = 1 exactly: a parabola has no semi-major axis and no period. Give its pericentre distance q, or q and a"
        )
        refuse(parabola, wrong + " without e for a nearly parabolic orbit", names)
    if kind == "a":
        a = size
        refuse((e < 1.0) & (a <= 0.0), "a = {a} with e = {e}; expected a > 0 for an ellipse", names, a=a, e=e)
        wrong = "a = {a} with e = {e}; expected a < 0, since the semi-major axis of a hyperbola is negative. Or give q"
        refuse((e > 1.0) & (a >= 0.0), wrong, names, a=a, e=e)
    elif kind == "P":
        wrong = "period P is given and e = {e}: a hyperbola has no period. Give a (negative), n or q"
        refuse(e > 1.0, wrong, names, e=e)
        a = third
    elif kind == "n":
        a = np.where(parabola, np.inf, np.copysign(third, one_minus_e))
    else:
        with np.errstate(over="ignore"):
            a = size / np.where(parabola, 1.0, one_minus_e)
        refuse(np.isinf(a), BEYOND, names, what="a", value=a)
        a = np.where(parabola, np.inf, a)
    if kind == "q":
        q = size
    else:
        q = np.where(parabola, third / np.cbrt(2.0), np.where(parabola, 1.0, a) * one_minus_e)
    return Conic(gm, a, e, one_minus_e, q)


def _plane_from_mean_anomaly(conic: Conic, M: Floats) -> Plane:
    """Return (x, y, vx, vy) with x towards pericentre, from the mean anomaly."""
    E = np.empty(M.size)
    _, _, e, one_minus_e, _ = (value.ravel() for value in conic)
    ellipse, hyperbola, parabola = _kinds(conic)
    with np.errstate(over="ignore", under="ignore", invalid="ignore"):
        E[ellipse] = eccentric_anomaly(M.ravel()[ellipse], e[ellipse], one_minus_e[ellipse])
        E[hyperbola] = sinh_anomaly(M.ravel()[hyperbola], e[hyperbola], one_minus_e[hyperbola])
        E[parabola] = barker_anomaly(M.ravel()[parabola])
    return _plane(conic, E.reshape(M.shape))


def _plane_from_eccentric_anomaly(conic: Conic, E: Floats) -> Plane:
    """Return (x, y, vx, vy) from the eccentric anomaly, F for a hyperbola, tan(f/2) for a parabola."""
    hyperbola = conic.a < 0.0
    with np.errstate(over="ignore"):
        return _plane(conic, np.where(hyperbola, np.sinh(np.where(hyperbola, E, 0.0)), E))


def _plane_from_time(conic: Conic, time: Floats) -> Plane:
    """Return (x, y, vx, vy) from the time since pericentre."""
    with np.errstate(over="ignore", invalid="ignore", under="ignore"):
        D = barker_anomaly(np.sqrt(0.5 * conic.gm / conic.q) / conic.q * time)
        straight = (1.0 + D * D) * np.abs(conic.one_minus_e) < NO_CURVATURE
    parabola = Conic(conic.gm, np.full_like(conic.a, np.inf), np.ones_like(conic.e), np.zeros_like(conic.e), conic.q)
    chosen = Conic(*(np.where(straight, ours, theirs) for ours, theirs in zip(parabola, conic, strict=True)))
    size = np.where(chosen.parabola, 2.0 ** (1 / 3) * chosen.q, np.abs(chosen.a))
    return _plane_from_mean_anomaly(chosen, np.sqrt(chosen.gm / size) / size * time)


def _plane(conic: Conic, E: Floats) -> Plane:
    """Return (x, y, vx, vy) from E for an ellipse, sinh F for a hyperbola, tan(f/2) for a parabola."""
    plane = np.empty((4, E.size))
    for kind, part in zip(_kinds(conic), (_on_ellipse, _on_hyperbola, _on_parabola), strict=True):
        with np.errstate(over="ignore", under="ignore", invalid="ignore"):
            plane[:, kind] = part(Conic(*(value.ravel()[kind] for value in conic)), E.ravel()[kind])
    x, y, vx, vy = plane.reshape(4, *E.shape)
    return x, y, vx, vy


def _kinds(conic: Conic) -> tuple[NDArray[np.bool_], NDArray[np.bool_], NDArray[np.bool_]]:
    """Return which of the flattened conics are ellipses, hyperbolas and parabolas."""
    hyperbola, parabola = conic.a.ravel() < 0.0, conic.parabola.ravel()
    return ~(hyperbola | parabola), hyperbola, parabola


def _on_ellipse(conic: Conic, E: Floats) -> Plane:
    return _on_curve(conic, 2.0 * np.sin(0.5 * E) ** 2, np.sin(E), np.cos(E))


def _on_hyperbola(conic: Conic, S: Floats) -> Plane:
    C = np.hypot(1.0, S)
    return _on_curve(conic, -S * (S / (C + 1.0)), S, C)


def _on_curve(conic: Conic, versine: Floats, sine: Floats, cosine: Floats) -> Plane:
    gm, a, e, one_minus_e, q = conic
    r = q + a * e * versine
    speed = np.sqrt(gm) * np.sqrt(np.abs(a)) / r
    flatness = np.sqrt(np.abs(one_minus_e) * (1.0 + e))
    return q - a * versine, np.abs(a) * flatness * sine, -speed * sine, speed * flatness * cosine


def _on_parabola(conic: Conic, D: Floats) -> Plane:
    q, speed, opening = conic.q, np.sqrt(2.0 * conic.gm / conic.q), 1.0 + D * D
    return q * (1.0 - D) * (1.0 + D), 2.0 * q * D, -speed * (D / opening), speed / opening


def _plane_from_true_anomaly(conic: Conic, f: Floats, names: Sequence[str] | None) -> Plane:
    """Return (x, y, vx, vy) with x towards pericentre, from the true anomaly."""
    cosine2 = 2.0 * np.cos(0.5 * f) ** 2
    opening = conic.one_minus_e + conic.e * cosine2  # 1 + e cos f
    wrong = "true anomaly f = {f} rad with e = {e} lies beyond the asymptote of the hyperbola; expected cos f > -1/e"
    refuse(opening <= 0.0, wrong, names, f=f, e=conic.e)
    p = conic.q * (1.0 + conic.e)
    r = p / opening
    speed = np.sqrt(conic.gm / p)
    return r * np.cos(f), r * np.sin(f), -speed * np.sin(f), speed * (cosine2 - conic.one_minus_e)


def _turned_into_space(plane: Plane, inc: Floats, Omega: Floats, omega: Floats) -> tuple[Floats, Floats]:
    """Return q and v from coordinates in the orbital plane, by the rotations omega, inc, Omega."""
    x, y, vx, vy = plane
    to_pericentre, along_motion = perifocal_axes(inc, Omega, omega)
    with np.errstate(over="ignore", invalid="ignore"):
        return (
            x[..., None] * to_pericentre + y[..., None] * along_motion,
            vx[..., None] * to_pericentre + vy[..., None] * along_motion,
        )


def perifocal_axes(inc: Floats, Omega: Floats, omega: Floats) -> tuple[Floats, Floats]:
    """Return the unit vectors to the pericentre and along the motion there, (..., 3), for angles (...)."""
    cO, sO, co, so, ci, si = np.cos(Omega), np.sin(Omega), np.cos(omega), np.sin(omega), np.cos(inc), np.sin(inc)
    to_pericentre = np.stack([cO * co - sO * so * ci, sO * co + cO * so * ci, so * si], axis=-1)
    return to_pericentre, np.stack([-cO * so - sO * co * ci, -sO * so + cO * co * ci, co * si], axis=-1)
