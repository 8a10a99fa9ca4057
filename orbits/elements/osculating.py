"""States to osculating Keplerian elements.

How the digits are kept:

- the invariants, and e times the sine and cosine of each anomaly, are computed without cancellation
  (`orbits.elements.invariants`): every element belongs to the given state, to a few roundings;
- near e = 1, 1 - e comes from p/a = (1 - e)(1 + e), and is used for the anomalies before it is rounded into e;
- inclination and node come from the components of q x v, by atan2;
- omega is the argument of latitude, which needs no pericentre, minus f. For a nearly circular orbit omega and M are
  ill-determined by nature, but their sum, and the state computed from them, are good to the last digits.

Sources: Murray & Dermott (1999), Solar System Dynamics, 2.8; Battin (1999), ch. 4; for h, k, ix, iy Pal (2009), MNRAS
396, 1737.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from orbits.elements.invariants import Motion, measured, scaled
from orbits.elements.kepler_equation import Floats, angle_minus_sine, positive_angle, sinh_minus_angle
from orbits.elements.refusals import BEYOND, finite, named, refuse, vectors

# An eccentricity, or the sine of an inclination, up to this may be an exact zero plus rounding.
ROUNDING = 8.0 * np.finfo(np.float64).eps
# Below this |r/a|, rounding alone distinguishes an orbit from a parabola: states made from 800,000 parabolas reached a
# third of it. Treating such an orbit as a parabola changes the state made from the elements by at most half of it.
PARABOLIC = 32.0 * np.finfo(np.float64).eps


@dataclass(frozen=True, eq=False)
class Elements:
    """Osculating elements, read-only float64 arrays of one shape (...); lengths and times in the units of the state.

    a : semi-major axis, negative for a hyperbola, infinite for a parabola
    e : eccentricity; 1 for a parabola, which includes every orbit that only rounding distinguishes from one. A thin
        ellipse or a sharp hyperbola with |q/a| < 1e-16 also has e = 1 as a float, but a finite a
    q : pericentre distance a (1 - e)
    inc : inclination, 0 ... pi
    Omega : longitude of the ascending node, 0 ... 2 pi; 0 for an orbit in the reference plane
    omega : argument of pericentre, 0 ... 2 pi; 0 for a circle; measured from the x axis where Omega is 0 by definition
    pomega : longitude of pericentre, 0 ... 2 pi: Omega + omega, or Omega - omega where inc > pi/2
    M, E, f : mean, eccentric and true anomaly, measured from pericentre, or from the node for a circle. For an ellipse
        they are in -pi ... pi, as a signed angle keeps its digits just before pericentre. E is the hyperbolic anomaly
        (F or H) for a hyperbola, and D = tan(f/2) for a parabola, whose M is D + D^3/3. Always M = n (t - T)
    u : argument of latitude, omega + f, 0 ... 2 pi: the angle from the node, which needs no pericentre
    l, theta : mean and true longitude: pomega + M and pomega + f, or pomega - M and pomega - f where inc > pi/2;
        0 ... 2 pi, except for l of an open orbit, which is not an angle and is not wrapped
    n : mean motion sqrt(gm/|a|^3), radians per time, > 0; sqrt(gm/(2 q^3)) for a parabola
    P : period; infinite for an open orbit
    T : time of the pericentre passage nearest to the time of the state, or of the node passage for a circle
    h, k : e sin(Omega + omega), e cos(Omega + omega), as Pal defines them, also for retrograde orbits
    ix, iy : 2 sin(inc/2) cos Omega, 2 sin(inc/2) sin Omega

    A float e determines 1 - e only to 1.1e-16, so near e = 1 the orbit is determined by a and q together: they and any
    anomaly reproduce the state, as do q, e and T near pericentre. For an ellipse with h, k, ix and iy use `pal`.
    The value is also a mapping: elements["a"], elements.keys(), dict(elements).
    """

    a: Floats
    e: Floats
    q: Floats
    inc: Floats
    Omega: Floats
    omega: Floats
    pomega: Floats
    M: Floats
    E: Floats
    f: Floats
    u: Floats
    l: Floats  # noqa: E741 - the mean longitude's own symbol
    theta: Floats
    n: Floats
    P: Floats
    T: Floats
    h: Floats
    k: Floats
    ix: Floats
    iy: Floats

    def __post_init__(self) -> None:
        for key in self.keys():
            array = np.asarray(getattr(self, key))
            array.flags.writeable = False
            object.__setattr__(self, key, array)

    def keys(self) -> tuple[str, ...]:
        """Return the names of the elements."""
        return tuple(field.name for field in fields(self))

    def pal(self) -> dict[str, Floats]:
        """Return a, l, h, k, ix, iy, for `state_from_elements(gm, **elements.pal())`.

        Here l is Pal's mean longitude Omega + omega + M, which for inc > pi/2 is not the l of these elements.
        """
        mean_longitude = positive_angle(self.Omega + self.omega + self.M)
        return {"a": self.a, "l": mean_longitude, "h": self.h, "k": self.k, "ix": self.ix, "iy": self.iy}

    def __iter__(self) -> Iterator[str]:
        return iter(self.keys())

    def __getitem__(self, key: str) -> Floats:
        if key not in self.keys():
            raise KeyError(f"there is no element {key!r}; expected one of {', '.join(self.keys())}")
        value: Floats = getattr(self, key)
        return value


def elements_from_state(
    q: ArrayLike, v: ArrayLike, gm: ArrayLike, *, t: ArrayLike = 0.0, names: Sequence[str] | None = None
) -> Elements:
    """Return the osculating elements of bodies with positions q and velocities v relative to the attracting body.

    q, v : (..., 3), in the axes to which the angles refer
    gm : (...), G times the total mass of both bodies, in consistent units, > 0
    t : (...), the time of the state; only T depends on it
    names : names of the bodies, for error messages

    Every element is defined for circular, equatorial and parabolic orbits as well (see `Elements`). Raises InputError,
    naming the body and the value, for input that is not finite, gm <= 0, q = 0, a rectilinear orbit (with no angular
    momentum it has no plane, and ends in a collision), and elements beyond the range of floats.
    """
    names = named(names)
    q, v = vectors("position", q, names), vectors("velocity", v, names)
    motion, t = measured(q, v, finite("gm", gm, names), finite("t", t, names), names)
    r, h = motion.r, motion.h
    hx, hy, hz = (h[..., i] for i in range(3))
    across = np.hypot(hx, hy)
    inc = np.arctan2(across, hz)
    Omega = np.where(across <= ROUNDING * motion.h_size, 0.0, np.arctan2(hx, -hy))
    # The argument of latitude: the angle from the node to the body, along the motion.
    cO, sO = np.cos(Omega), np.sin(Omega)
    nx, ny, nz = -hz * sO, hz * cO, hx * sO - hy * cO  # h times the direction 90 degrees ahead of the node
    x, y, z = (motion.q[..., i] for i in range(3))
    latitude = np.arctan2((x * nx + y * ny + z * nz) / motion.h_size, x * cO + y * sO)

    conic = Shape.of(motion, np.abs(motion.binding) <= PARABOLIC)
    circle = conic.e <= ROUNDING
    omega = np.where(circle, 0.0, positive_angle(latitude - conic.f))
    M, E, f = (np.where(circle, latitude, anomaly) for anomaly in (conic.M, conic.E, conic.f))

    sense = np.where(inc <= 0.5 * np.pi, 1.0, -1.0)
    pomega = positive_angle(Omega + sense * omega)
    longitude = pomega + sense * M
    # e cos and e sin of Omega + latitude - f, without f: they are determined even where e is 0, and f is not.
    e_sin_f, ahead = np.sqrt(motion.p / motion.gm) * motion.qv / r, Omega + latitude
    tilt = 2.0 * np.sin(0.5 * inc)
    ellipse = (conic.a > 0.0) & (conic.a < np.inf)
    sizes = {
        "a": scaled(conic.a, motion.length),
        "q": scaled(conic.q, motion.length),
        "n": scaled(conic.n, -motion.time),
    }
    for what, value in sizes.items():
        refuse((value == 0.0) | (np.isinf(value) & (conic.e != 1.0)), BEYOND, names, what=what, value=value)
    return Elements(
        **sizes, e=conic.e, inc=inc, Omega=positive_angle(Omega), omega=omega, pomega=pomega,
        M=M, E=E, f=f, u=positive_angle(latitude), l=np.where(ellipse, positive_angle(longitude), longitude),
        theta=positive_angle(pomega + sense * f),
        P=np.where(ellipse, scaled(2.0 * np.pi / conic.n, motion.time), np.inf),
        T=t - scaled(M / conic.n, motion.time),
        h=motion.e_cos_f * np.sin(ahead) - e_sin_f * np.cos(ahead),
        k=motion.e_cos_f * np.cos(ahead) + e_sin_f * np.sin(ahead),
        ix=tilt * cO, iy=tilt * sO,
    )  # fmt: skip


class Shape(NamedTuple):
    """A conic and the position on it, arrays of one shape, in the units of the motion."""

    a: Floats  # inf for a parabola
    q: Floats
    e: Floats
    one_minus_e: Floats
    n: Floats
    M: Floats
    E: Floats  # F of a hyperbola, D = tan(f/2) of a parabola
    f: Floats

    @classmethod
    def of(cls, motion: Motion, parabola: NDArray[np.bool_]) -> Shape:
        """Return the conic of a motion, a parabola where `parabola` is True."""
        r, qv, p, gm, binding = motion.r, motion.qv, motion.p, motion.gm, np.where(parabola, 0.0, motion.binding)
        ellipse = binding > 0.0
        size = r / np.where(parabola, 1.0, np.abs(binding))  # |a|
        e_sin_f = np.sqrt(p / gm) * qv / r
        e = np.hypot(motion.e_cos_f, e_sin_f)
        opening = p / r * binding  # (1 - e)(1 + e); far from e = 1 the first form of e is more accurate
        e = np.where((e > 0.5) & (e < 2.0), 1.0 - opening / (1.0 + e), e)
        one_minus_e, q = opening / (1.0 + e), p / (1.0 + e)

        root = qv / np.sqrt(gm * size)  # e sin E, or e sinh F
        E = np.arctan2(root, motion.e_cos_E)
        M = one_minus_e * np.sin(E) + angle_minus_sine(E)
        S = np.where(ellipse | parabola, 0.0, root / np.where(ellipse, 1.0, e))
        F = np.arcsinh(S)
        M_open = sinh_minus_angle(F, S) - one_minus_e * S
        D = qv / np.sqrt(gm * p)
        M_parabola = D * (1.0 + D * D / 3.0)
        return cls(
            np.where(parabola, np.inf, np.copysign(size, binding)),
            q,
            e,
            one_minus_e,
            np.where(parabola, np.sqrt(0.5 * gm / q) / q, np.sqrt(gm / size) / size),
            np.where(parabola, M_parabola, np.where(ellipse, M, M_open)),
            np.where(parabola, D, np.where(ellipse, E, F)),
            np.arctan2(e_sin_f, motion.e_cos_f),
        )
