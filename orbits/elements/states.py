"""Keplerian elements to states.

Every step is written so that nothing cancels: x = q - 2 a sin^2(E/2) for a (cos E - e), 1 + e cos f from half angles,
Kepler's equation from 1 - e.
Sources: Murray & Dermott (1999), Solar System Dynamics, 2.8; Battin (1999), An Introduction to the Mathematics and
Methods of Astrodynamics, ch. 4.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from orbits.elements.checks import NO_MASS, broadcast, finite, refuse
from orbits.elements.kepler import Floats, eccentric_anomaly, positive_angle, sinh_anomaly
from orbits.errors import InputError

SIZES = ("a", "P", "q")
POSITIONS = ("M", "f", "E", "l", "theta", "T")


class Conic(NamedTuple):
    """Size and shape of an orbit, arrays of one shape."""

    gm: Floats
    a: Floats
    e: Floats
    one_minus_e: Floats
    q: Floats


def state_from_elements(
    gm: ArrayLike,
    *,
    a: ArrayLike | None = None,
    P: ArrayLike | None = None,
    q: ArrayLike | None = None,
    e: ArrayLike = 0.0,
    inc: ArrayLike = 0.0,
    Omega: ArrayLike = 0.0,
    omega: ArrayLike | None = None,
    pomega: ArrayLike | None = None,
    M: ArrayLike | None = None,
    f: ArrayLike | None = None,
    E: ArrayLike | None = None,
    l: ArrayLike | None = None,  # noqa: E741 - the mean longitude's own symbol
    theta: ArrayLike | None = None,
    T: ArrayLike | None = None,
    t: ArrayLike = 0.0,
    names: Sequence[str] | None = None,
) -> tuple[Floats, Floats]:
    """Return positions and velocities relative to the attracting body, each of shape (..., 3).

    All arguments broadcast against each other. Units are consistent ones of the caller's, gm in length^3/time^2; angles
    are in radians. The axes of the result are those that the angles refer to.

    gm : G times the mass of both bodies together (of the attracting body alone for a massless one), > 0
    a, P or q : exactly one: semi-major axis (negative for a hyperbola), period (ellipses only), pericentre distance
    e : eccentricity, 0 <= e < 1 or e > 1. A parabola, e = 1, is refused: it has no a, and M means something else for it
    inc : inclination, 0 ... pi
    Omega : longitude of the ascending node
    omega or pomega : argument or longitude of pericentre; pomega = Omega + omega, or Omega - omega where inc > pi/2
    M, f, E, l, theta or T : at most one; M = 0 where none is given. Mean anomaly; true anomaly; eccentric anomaly (the
        hyperbolic one, F, where e > 1); mean longitude pomega + M; true longitude pomega + f (pomega - M and pomega - f
        where inc > pi/2, pomega in 0 ... 2 pi); time of pericentre passage
    t : the time of the state, for T alone: M = n (t - T)
    names : names of the bodies, for error messages

    Angles left out are 0: without omega pericentre is at the node, without Omega the node is on the x axis.
    These are the conventions of Murray & Dermott and of REBOUND, retrograde orbits included.
    Raises InputError, naming the body and the value, for anything that is not such an orbit.
    """
    conic, angles = _checked(gm, {"a": a, "P": P, "q": q}, e, inc, Omega, omega, pomega, t,
                             {"M": M, "f": f, "E": E, "l": l, "theta": theta, "T": T}, names)  # fmt: skip
    inc_, Omega_, omega_, kind, where, t_ = angles
    sense = np.where(inc_ <= 0.5 * np.pi, 1.0, -1.0)
    if kind in ("l", "theta"):
        where = sense * (where - positive_angle(Omega_ + sense * omega_))
    if kind == "T":
        where = np.sqrt(conic.gm / np.abs(conic.a)) / np.abs(conic.a) * (t_ - where)
    if kind in ("f", "theta"):
        plane = _plane_from_true_anomaly(conic, where, names)
    else:
        plane = _plane_from_anomaly(conic, where, is_mean=kind != "E")
    return _turned_into_space(plane, inc_, Omega_, omega_)


def _checked(
    gm: ArrayLike,
    sizes: dict[str, ArrayLike | None],
    e: ArrayLike,
    inc: ArrayLike,
    Omega: ArrayLike,
    omega: ArrayLike | None,
    pomega: ArrayLike | None,
    t: ArrayLike,
    positions: dict[str, ArrayLike | None],
    names: Sequence[str] | None,
) -> tuple[Conic, tuple[Floats, Floats, Floats, str, Floats, Floats]]:
    """Return size and shape, and (inc, Omega, omega, kind of position, position, t), broadcast and checked."""
    size = _only_one(sizes, "the size of the orbit", names, required=True)
    kind = _only_one(positions, "the place on the orbit", names, required=False)
    turn = _only_one({"omega": omega, "pomega": pomega}, "the direction of pericentre", names, required=False)
    given = {
        "gm": gm, size: sizes[size], "e": e, "inc": inc, "Omega": Omega,
        turn: 0.0 if omega is None and pomega is None else pomega if omega is None else omega,
        kind: 0.0 if positions[kind] is None else positions[kind], "t": t,
    }  # fmt: skip
    checked = {key: finite(key, value, names) for key, value in given.items() if value is not None}
    gm_, size_, e_, inc_, Omega_, turn_, where, t_ = broadcast(names, **checked)
    refuse(gm_ <= 0.0, NO_MASS, names, gm=gm_)
    wrong = "inc = {inc} rad; expected 0 ... pi. A negative inclination is the positive one with Omega turned by pi"
    refuse((inc_ < 0.0) | (inc_ > np.pi), wrong, names, inc=inc_)
    conic = _conic(gm_, size, size_, e_, names)
    omega_ = turn_ if turn == "omega" else np.where(inc_ <= 0.5 * np.pi, turn_ - Omega_, Omega_ - turn_)
    return conic, (inc_, Omega_, omega_, kind, where, t_)


def _only_one(given: dict[str, ArrayLike | None], what: str, names: Sequence[str] | None, *, required: bool) -> str:
    """Return which entry is not None (the first one where none is and none is required); raise InputError otherwise."""
    found = [key for key, value in given.items() if value is not None]
    if len(found) == 1 or (not found and not required):
        return found[0] if found else next(iter(given))
    who = f"{names[0]}: " if names is not None and len(names) == 1 else ""
    said = " and ".join(found) if found else "nothing"
    count = "exactly" if required else "at most"
    raise InputError(f"{who}{what} is given by {said}; expected {count} one of {', '.join(given)}")


def _conic(gm: Floats, kind: str, size: Floats, e: Floats, names: Sequence[str] | None) -> Conic:
    refuse(e < 0.0, "eccentricity e = {e}; expected >= 0", names, e=e)
    parabola = "e = 1 exactly: a parabola has no semi-major axis, no period and no mean anomaly. "
    refuse(
        e == 1.0, parabola + "Give its pericentre distance q and an e next to 1, such as 0.9999999 or 1.0000001", names
    )
    one_minus_e = 1.0 - e
    if kind == "P":
        refuse(size <= 0.0, "period P = {P}; expected > 0", names, P=size)
        refuse(e > 1.0, "period P is given and e = {e}: a hyperbola has no period. Give a (negative) or q", names, e=e)
        a = np.cbrt(gm * (size / (2.0 * np.pi)) ** 2)
    elif kind == "q":
        refuse(size <= 0.0, "pericentre distance q = {q}; expected > 0", names, q=size)
        a = size / one_minus_e
    else:
        refuse((e < 1.0) & (size <= 0.0), "a = {a} with e = {e}; expected a > 0 for an ellipse", names, a=size, e=e)
        wrong = "a = {a} with e = {e}; expected a < 0, since the semi-major axis of a hyperbola is negative. Or give q"
        refuse((e > 1.0) & (size >= 0.0), wrong, names, a=size, e=e)
        a = size
    return Conic(gm, a, e, one_minus_e, size if kind == "q" else a * one_minus_e)


def _plane_from_anomaly(conic: Conic, anomaly: Floats, *, is_mean: bool) -> tuple[Floats, Floats, Floats, Floats]:
    """Return (x, y, vx, vy) with x towards pericentre, from the mean or else the eccentric (hyperbolic) anomaly."""
    gm, a, e, one_minus_e, q = (part.ravel() for part in conic)
    angle = anomaly.ravel()
    versine, sine, cosine = (np.empty_like(angle) for _ in range(3))  # of E, or their hyperbolic counterparts
    ellipse = e < 1.0
    E = eccentric_anomaly(angle[ellipse], e[ellipse]) if is_mean else angle[ellipse]
    versine[ellipse], sine[ellipse], cosine[ellipse] = 2.0 * np.sin(0.5 * E) ** 2, np.sin(E), np.cos(E)
    open_ = ~ellipse
    S = sinh_anomaly(angle[open_], e[open_]) if is_mean else np.sinh(angle[open_])
    C = np.hypot(1.0, S)
    versine[open_], sine[open_], cosine[open_] = -S * (S / (C + 1.0)), S, C
    x = q - a * versine
    r = q + a * e * versine
    speed = np.sqrt(gm * np.abs(a)) / r
    flatness = np.sqrt(np.abs(one_minus_e) * (1.0 + e))
    plane = (x, np.abs(a) * flatness * sine, -speed * sine, speed * flatness * cosine)
    return tuple(part.reshape(anomaly.shape) for part in plane)  # type: ignore[return-value]


def _plane_from_true_anomaly(
    conic: Conic, f: Floats, names: Sequence[str] | None
) -> tuple[Floats, Floats, Floats, Floats]:
    """Return (x, y, vx, vy) with x towards pericentre, from the true anomaly."""
    cosine2 = 2.0 * np.cos(0.5 * f) ** 2
    opening = conic.one_minus_e + conic.e * cosine2  # 1 + e cos f
    wrong = "true anomaly f = {f} rad with e = {e} lies beyond the asymptote of the hyperbola; expected cos f > -1/e"
    refuse(opening <= 0.0, wrong, names, f=f, e=conic.e)
    p = conic.q * (1.0 + conic.e)
    r = p / opening
    speed = np.sqrt(conic.gm / p)
    return r * np.cos(f), r * np.sin(f), -speed * np.sin(f), speed * (cosine2 - conic.one_minus_e)


def _turned_into_space(
    plane: tuple[Floats, Floats, Floats, Floats], inc: Floats, Omega: Floats, omega: Floats
) -> tuple[Floats, Floats]:
    """Return q and v from coordinates in the orbit's plane, by the rotations omega, inc, Omega."""
    x, y, vx, vy = plane
    cO, sO, co, so, ci, si = np.cos(Omega), np.sin(Omega), np.cos(omega), np.sin(omega), np.cos(inc), np.sin(inc)
    to_pericentre = np.stack([cO * co - sO * so * ci, sO * co + cO * so * ci, so * si], axis=-1)
    along_motion = np.stack([-cO * so - sO * co * ci, -sO * so + cO * co * ci, co * si], axis=-1)
    return (
        x[..., None] * to_pericentre + y[..., None] * along_motion,
        vx[..., None] * to_pericentre + vy[..., None] * along_motion,
    )
