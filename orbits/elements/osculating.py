"""States to osculating Keplerian elements.

What keeps the digits:

- the invariants, and what is e times a sine or a cosine of each anomaly, come without cancellation
  (`orbits.elements.invariants`): every element is that of the state as it stands, to a few roundings;
- near e = 1, 1 - e comes from p/a = (1 - e)(1 + e), and serves the anomalies before it is rounded into e;
- inclination and node come from the components of q x v, by atan2;
- omega is what f leaves of the argument of latitude, which needs no pericentre. So for a nearly circular orbit omega
  and M are as ill-determined as nature makes them, but their sum, and the state made from them, is good to the last
  digits.

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

# An eccentricity, or the sine of an inclination, that is no more than what rounding makes of an exact zero.
ROUNDING = 8.0 * np.finfo(np.float64).eps
# |r/a| below which rounding alone tells an orbit from a parabola: states made from 800,000 parabolas reached a third of
# this. To take such an orbit for a parabola moves the state made from the elements by half of it at most.
PARABOLIC = 32.0 * np.finfo(np.float64).eps


@dataclass(frozen=True, eq=False)
class Elements:
    """Osculating elements, read-only float64 arrays of one shape (...); lengths and times in the units of the state.

    a : semi-major axis, negative for a hyperbola, infinite for a parabola
    e : eccentricity; 1 for a parabola, which is every orbit that rounding alone tells from one, and as a float for a
        thin ellipse or a sharp hyperbola with |q/a| < 1e-16 too: these have a finite a
    q : pericentre distance a (1 - e)
    inc : inclination, 0 ... pi
    Omega : longitude of the ascending node, 0 ... 2 pi; 0 for an orbit in the reference plane
    omega : argument of pericentre, 0 ... 2 pi; 0 for a circle; counted from the x axis where Omega is 0 by definition
    pomega : longitude of pericentre, 0 ... 2 pi: Omega + omega, or Omega - omega where inc > pi/2
    M, E, f : mean, eccentric and true anomaly, signed, counted from pericentre: -pi ... pi for an ellipse; a signed
        angle keeps its digits just before pericentre. For a circle they are counted from the node. E is the hyperbolic
        anomaly (F or H) of a hyperbola, and D = tan(f/2) of a parabola, whose M is D + D^3/3. M = n (t - T) always
    u : argument of latitude, omega + f, 0 ... 2 pi: the angle from the node, which needs no pericentre
    l, theta : mean and true longitude: pomega + M and pomega + f, or pomega - M and pomega - f where inc > pi/2;
        0 ... 2 pi, but l of an open orbit is no angle and is not wrapped
    n : mean motion sqrt(gm/|a|^3), radians per time, > 0; sqrt(gm/(2 q^3)) for a parabola
    P : period; infinite for an open orbit
    T : time of the pericentre passage closest to the time of the state; of the passage of the node for a circle
    h, k : e sin(Omega + omega), e cos(Omega + omega), as Pal has them: retrograde orbits are no exception
    ix, iy : 2 sin(inc/2) cos Omega, 2 sin(inc/2) sin Omega

    A float e holds 1 - e to 1.1e-16 only, so next to e = 1 it is a and q together that hold the orbit: they and any
    anomaly give the state back, as do q, e and T around pericentre. For an ellipse with h, k, ix and iy use `pal`.
    Also a mapping: elements["a"], elements.keys(), dict(elements).
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
        """Return a, l, h, k, ix, iy, to be given back to `state_from_elements(gm, **elements.pal())`.

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

    q, v : (..., 3), in the axes that the angles shall refer to
    gm : (...), G times the mass of both bodies together, consistent units, > 0
    t : (...), the time of the state; only T depends on it
    names : names of the bodies, for error messages

    Circular, equatorial and parabolic orbits have every element defined (see `Elements`). Raises InputError, naming the
    body and the value, for non-finite input, gm <= 0, q = 0, a rectilinear orbit (angular momentum zero: it has no
    plane and ends in a collision), and where an element would be beyond the range of floats.
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
    # e cos and e sin of Omega + latitude - f, without f: it is undetermined where e is 0, they are not.
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
    """A conic and the place on it, arrays of one shape, in the units of the motion."""

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
        """Return the conic of a motion, and a parabola where one is wanted."""
        r, qv, p, gm, binding = motion.r, motion.qv, motion.p, motion.gm, np.where(parabola, 0.0, motion.binding)
        ellipse = binding > 0.0
        size = r / np.where(parabola, 1.0, np.abs(binding))  # |a|
        e_sin_f = np.sqrt(p / gm) * qv / r
        e = np.hypot(motion.e_cos_f, e_sin_f)
        opening = p / r * binding  # (1 - e)(1 + e); far from e = 1 the first form of e is the better one
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
