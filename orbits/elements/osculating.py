"""States to osculating Keplerian elements.

What keeps the digits:

- near e = 1, 1 - e comes from h^2/(gm a) = (1 - e)(1 + e), not from the eccentricity vector;
- inclination and node come from the components of q x v, by atan2;
- near pericentre the true anomaly comes first, from e cos f = p/r - 1, far from it the eccentric one, from
  e cos E = 1 - r/a; each of the other anomalies comes from that one;
- omega is what f leaves of the argument of latitude, which needs no pericentre. So for a nearly circular orbit omega
  and M are as ill-determined as nature makes them, but their sum, and the state made from them, is good to the last
  digits.

Sources: Murray & Dermott (1999), Solar System Dynamics, 2.8; Battin (1999), ch. 4.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike

from orbits.elements.checks import NO_DISTANCE, NO_MASS, PARABOLA, RECTILINEAR, broadcast, finite, refuse, vectors
from orbits.elements.kepler import Floats, angle_minus_sine, positive_angle, sinh_minus_angle

# An eccentricity, or the sine of an inclination, that is no more than what rounding makes of an exact zero.
ROUNDING = 8.0 * np.finfo(np.float64).eps
# |q x v|/(|q| |v|), or |2 - r v^2/gm|, below which rounding alone decides the plane, or the side of the parabola.
INDISTINCT = 4.0 * np.finfo(np.float64).eps


@dataclass(frozen=True, eq=False)
class Elements:
    """Osculating elements, read-only float64 arrays of one shape (...); lengths and times in the units of the state.

    a : semi-major axis, negative for a hyperbola
    e : eccentricity
    q : pericentre distance a (1 - e)
    inc : inclination, 0 ... pi
    Omega : longitude of the ascending node, 0 ... 2 pi; 0 for an orbit in the reference plane
    omega : argument of pericentre, 0 ... 2 pi; 0 for a circle; counted from the x axis where Omega is 0 by definition
    pomega : longitude of pericentre, 0 ... 2 pi: Omega + omega, or Omega - omega where inc > pi/2
    M, E, f : mean, eccentric (hyperbolic where e > 1) and true anomaly, signed, counted from pericentre: -pi ... pi for
        an ellipse; a signed angle keeps its digits just before pericentre. For a circle they are counted from the node
    l, theta : mean and true longitude: pomega + M and pomega + f, or pomega - M and pomega - f where inc > pi/2;
        0 ... 2 pi, but l of a hyperbola is no angle and is not wrapped
    n : mean motion, radians per time, > 0
    P : period; infinite for a hyperbola
    T : time of the pericentre passage closest to the time of the state

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
    l: Floats  # noqa: E741 - the mean longitude's own symbol
    theta: Floats
    n: Floats
    P: Floats
    T: Floats

    def __post_init__(self) -> None:
        for key in self.keys():
            array = np.asarray(getattr(self, key))
            array.flags.writeable = False
            object.__setattr__(self, key, array)

    def keys(self) -> tuple[str, ...]:
        """Return the names of the elements."""
        return tuple(field.name for field in fields(self))

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

    Circular and equatorial orbits have every element defined (see `Elements`). Raises InputError, naming the body and
    the value, for non-finite input, gm <= 0, q = 0, a rectilinear or a parabolic orbit.
    """
    q, v = vectors("position", q, names), vectors("velocity", v, names)
    gm, t = finite("gm", gm, names), finite("t", t, names)
    x, y, z, vx, vy, vz, gm, t = broadcast(
        names, **dict(zip("xyz", np.moveaxis(q, -1, 0), strict=True)),
        **dict(zip(("vx", "vy", "vz"), np.moveaxis(v, -1, 0), strict=True)), gm=gm, t=t)  # fmt: skip
    refuse(gm <= 0.0, NO_MASS, names, gm=gm)
    r = np.sqrt(x * x + y * y + z * z)
    refuse(r == 0.0, NO_DISTANCE, names)
    v2 = vx * vx + vy * vy + vz * vz
    hx, hy, hz = y * vz - z * vy, z * vx - x * vz, x * vy - y * vx
    h2 = hx * hx + hy * hy + hz * hz
    h = np.sqrt(h2)
    refuse(h <= INDISTINCT * r * np.sqrt(v2), RECTILINEAR, names, h=h)
    binding = 2.0 - r * v2 / gm  # r/a
    refuse(np.abs(binding) <= INDISTINCT, PARABOLA, names, x=binding)
    a = r / binding

    inc = np.arctan2(np.hypot(hx, hy), hz)
    in_plane = np.hypot(hx, hy) <= ROUNDING * h
    Omega = np.where(in_plane, 0.0, np.arctan2(hx, -hy))
    # The argument of latitude: the angle from the node to the body, along the motion.
    cO, sO = np.cos(Omega), np.sin(Omega)
    nx, ny, nz = -hz * sO, hz * cO, hx * sO - hy * cO  # h times the direction 90 degrees ahead of the node
    latitude = np.arctan2((x * nx + y * ny + z * nz) / h, x * cO + y * sO)

    e, E, M, f = anomalies(r, x * vx + y * vy + z * vz, h2, a, binding, gm)
    circle = e <= ROUNDING
    omega = np.where(circle, 0.0, positive_angle(latitude - f))
    M, E, f = (np.where(circle, latitude, anomaly) for anomaly in (M, E, f))

    sense = np.where(inc <= 0.5 * np.pi, 1.0, -1.0)
    pomega = positive_angle(Omega + sense * omega)
    n = np.sqrt(gm / np.abs(a)) / np.abs(a)
    ellipse = e < 1.0
    longitude = pomega + sense * M
    return Elements(
        a=a, e=e, q=h2 / gm / (1.0 + e), inc=inc, Omega=positive_angle(Omega), omega=omega, pomega=pomega,
        M=M, E=E, f=f, l=np.where(ellipse, positive_angle(longitude), longitude),
        theta=positive_angle(pomega + sense * f), n=n, P=np.where(ellipse, 2.0 * np.pi / n, np.inf), T=t - M / n,
    )  # fmt: skip


def anomalies(
    r: Floats, qv: Floats, h2: Floats, a: Floats, binding: Floats, gm: Floats
) -> tuple[Floats, Floats, Floats, Floats]:
    """Return (e, E, M, f) from |q|, q.v, |h|^2, a, r/a and gm, arrays of one shape."""
    ellipse = a > 0.0
    p = h2 / gm
    e_cos_f, e_sin_f = p / r - 1.0, np.sqrt(p / gm) * qv / r
    e = np.hypot(e_cos_f, e_sin_f)
    # (1 - e)(1 + e) = p/a; far from e = 1 the first form of e is the better one.
    e = np.where((e > 0.5) & (e < 2.0), 1.0 - p / a / (1.0 + e), e)
    # From here on, e is what it was rounded to: the anomalies must fit the e that a state will be made from.
    one_minus_e = 1.0 - e
    stretch, squeeze = np.sqrt(1.0 + e), np.sqrt(np.abs(one_minus_e))
    root = qv / np.sqrt(gm * np.abs(a))  # e sin E, or e sinh F
    # Rounding e by one part moves E by a/r parts and f by r/p parts: the better conditioned one comes first.
    close = r * r < p * np.abs(a)
    f = np.arctan2(e_sin_f, e_cos_f)

    E = np.where(
        close, 2.0 * np.arctan2(squeeze * np.sin(0.5 * f), stretch * np.cos(0.5 * f)), np.arctan2(root, 1.0 - binding)
    )
    M = one_minus_e * np.sin(E) + angle_minus_sine(E)
    f_far = 2.0 * np.arctan2(stretch * np.sin(0.5 * E), squeeze * np.cos(0.5 * E))

    tangent = np.where(close & ~ellipse, squeeze / stretch * np.tan(0.5 * f), 0.0)  # tanh(F/2)
    S = np.where(close, 2.0 * tangent / ((1.0 - tangent) * (1.0 + tangent)), root / np.where(ellipse, 1.0, e))
    F = np.arcsinh(S)
    M_open = -one_minus_e * S + sinh_minus_angle(F, S)
    f_open = 2.0 * np.arctan2(stretch * S, squeeze * (1.0 + np.hypot(1.0, S)))
    return (
        e,
        np.where(ellipse, E, F),
        np.where(ellipse, M, M_open),
        np.where(close, f, np.where(ellipse, f_far, f_open)),
    )
