"""Problems with encounters and eccentric orbits, and where their starts lead in more digits."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import mpmath
import numpy as np
from astropy.time import Time
from numpy.typing import NDArray

import orbits
from benchmarks.problems import AU_KM, ten_bodies_data

Array = NDArray[np.float64]

MASSIVE = ["Sun", "Mercury", "Venus", "Earth", "Moon", "Mars", "Jupiter", "Saturn", "Uranus", "Neptune"]

SUN = 0.00029591220828


class Problem(NamedTuple):
    """Bodies, how far they go, in which unit errors are told and of which body; all if None."""

    name: str
    gm: Array
    q: Array
    v: Array
    span: float
    unit: float = 1.0
    body: int | None = None


def truth_of(problem: Problem, q: Array, v: Array) -> Array | None:
    """Return where a start leads: two bodies in 40 digits, more by a Taylor series in 80 or 128 bits; None where heyoka
    is not installed.
    """
    solve = _kepler if len(problem.gm) == 2 else taylor
    return solve(problem.gm, q, v, problem.span)


def _kepler(gm: Array, q: Array, v: Array, span: float) -> Array:
    """Return where two bodies on an ellipse are after `span`, by Kepler's equation in 40 digits."""
    with mpmath.workdps(40):
        m, t = [mpmath.mpf(float(x)) for x in gm], mpmath.mpf(float(span))
        x, w = ([[mpmath.mpf(float(c)) for c in row] for row in rows] for rows in (q, v))
        mu, r, u = m[0] + m[1], [b - a for a, b in zip(*x, strict=True)], [b - a for a, b in zip(*w, strict=True)]
        size, speed2, fall = mpmath.sqrt(mpmath.fdot(r, r)), mpmath.fdot(u, u), mpmath.fdot(r, u)
        a = 1 / (2 / size - speed2 / mu)
        n, cosine, sine = mpmath.sqrt(mu / a**3), 1 - size / a, fall / mpmath.sqrt(mu * a)
        turn = mpmath.fmod(n * t, 2 * mpmath.pi)
        d = mpmath.findroot(
            lambda d: d - cosine * mpmath.sin(d) + sine * (1 - mpmath.cos(d)) - turn,
            (-mpmath.pi / 10, 2 * mpmath.pi + mpmath.pi / 10),
            solver="anderson",
        )
        f = 1 - a / size * (1 - mpmath.cos(d))
        g = turn / n - (d - mpmath.sin(d)) / n
        lines = zip(x[0], w[0], x[1], w[1], strict=True)
        centre = [(m[0] * (x0 + w0 * t) + m[1] * (x1 + w1 * t)) / mu for x0, w0, x1, w1 in lines]
        apart = [f * a + g * b for a, b in zip(r, u, strict=True)]
        share = (-m[1] / mu, m[0] / mu)
        return np.array([[float(c + s * p) for c, p in zip(centre, apart, strict=True)] for s in share])


def taylor(gm: Array, q: Array, v: Array, span: float, *, states: bool = False) -> Array | None:
    """Return the positions, or the states, to which a start leads, by a Taylor series in more digits; None where heyoka
    is not installed. Massless bodies come last.
    """
    try:
        import heyoka as hy
    except ImportError:
        return None
    number = hy.real128 if not v.any() else np.longdouble
    masses = [number(float(m)) for m in gm if m > 0.0]
    model = hy.model.nbody(len(gm), masses=masses, Gconst=number(1.0))
    state = [number(float(x)) for row in np.hstack([q, v]) for x in row]
    series = hy.taylor_adaptive(model, state, fp_type=number, compact_mode=True)
    series.propagate_until(number(float(span)))
    end = np.array([float(x) for x in series.state]).reshape(-1, 6)
    return end if states else end[:, :3]


def problems() -> Iterator[Problem]:
    for e in (0.9, 0.99, 0.999, 0.9999):
        for where, side in (("apocentre", -1.0), ("pericentre", 1.0)):
            gm, r, speed = np.array([0.7, 0.3]), 1 - side * e, np.sqrt((1 + side * e) / (1 - side * e))
            q, v = np.array([[-0.3 * r, 0, 0], [0.7 * r, 0, 0]]), np.array([[0, -0.3 * speed, 0], [0, 0.7 * speed, 0]])
            yield Problem(f"e = {e}, 100 orbits from {where}", gm, q, v, 200 * np.pi)
    yield Problem(
        "Burrau's problem to t = 63",
        np.array([3.0, 4.0, 5.0]),
        np.array([[1.0, 3, 0], [-2, -1, 0], [1, -1, 0]]),
        np.zeros((3, 3)),
        63.0,
    )
    yield _triple()
    yield apophis(365.0)
    yield _apophis_from_2024()
    yield _comet()


def _triple() -> Problem:
    """An inner pair and a third body on an inclined orbit, both at apocentre."""
    gm, tilt = np.array([0.6, 0.4, 0.5]), np.radians(75.0)
    inner, outer = np.array([-1.1, 0, 0]), np.array([-15.0, 0, 0])
    slow = np.sqrt(1.0 * (1 - 0.1) / (1 + 0.1)) * np.array([0, -1.0, 0])
    far = np.sqrt(1.5 / 10.0 * (1 - 0.5) / (1 + 0.5)) * np.array([0, -np.cos(tilt), -np.sin(tilt)])
    states = []
    for pair, third in ((inner, outer), (slow, far)):
        centre = -third / 3.0
        states.append(np.array([centre - 0.4 * pair, centre + 0.6 * pair, centre + third]))
    return Problem("hierarchical triple to t = 10,000", gm, *states, 1e4)


def apophis(span: float) -> Problem:
    """Apophis, massless, past the Earth in 2029, from a hundred days before it on."""
    epoch = Time(2462138.5359989386, format="jd", scale="tdb")
    start = orbits.System.solar_system(epoch=epoch, bodies=MASSIVE)
    gm, q, v, _ = start.values
    place = np.array([-0.5594653855048851, 0.8564756475757451, 0.30415066217102493])
    speed = np.array([-0.013818324735921638, -0.006008827559793919, -0.0025805044631309632])
    return Problem(
        f"Apophis 2029, {span:g} d",
        np.append(gm, 0.0),
        np.vstack([q, q[0] + place]),
        np.vstack([v, v[0] + speed]),
        span,
        AU_KM,
        len(gm),
    )


def _apophis_from_2024() -> Problem:
    """The same from five years earlier to five years later, 2024 to 2034."""
    later = apophis(3652.5)
    back = taylor(later.gm, later.q, -later.v, 1826.25, states=True)
    if back is None:
        return later
    q, v = back[:, :3], -back[:, 3:]
    return later._replace(name="Apophis, 2024 to 2034", q=q, v=v)


def _comet() -> Problem:
    """A comet with a perihelion of 0.02 au among the planets, from a year before it."""
    gm, q, v, _ = ten_bodies_data()
    a, e = 200.0, 0.9999
    anomaly = -np.sqrt(gm[0] / a**3) * 365.25
    eccentric = -0.2
    for _ in range(60):
        eccentric -= (eccentric - e * np.sin(eccentric) - anomaly) / (1 - e * np.cos(eccentric))
    c, s, r = np.cos(eccentric), np.sin(eccentric), a * (1 - e * np.cos(eccentric))
    flat = a * (c - e), a * np.sqrt(1 - e * e) * s
    moving = -np.sqrt(gm[0] * a) / r * s, np.sqrt(gm[0] * a * (1 - e * e)) / r * c
    node, peri, tilt = 0.4, 1.0, 0.5
    p = np.array(
        [
            np.cos(peri) * np.cos(node) - np.sin(peri) * np.sin(node) * np.cos(tilt),
            np.cos(peri) * np.sin(node) + np.sin(peri) * np.cos(node) * np.cos(tilt),
            np.sin(peri) * np.sin(tilt),
        ]
    )
    w = np.array(
        [
            -np.sin(peri) * np.cos(node) - np.cos(peri) * np.sin(node) * np.cos(tilt),
            -np.sin(peri) * np.sin(node) + np.cos(peri) * np.cos(node) * np.cos(tilt),
            np.cos(peri) * np.sin(tilt),
        ]
    )
    return Problem(
        "comet, q = 0.02 au, e = 0.9999, 2 yr",
        np.append(gm, 0.0),
        np.vstack([q, q[0] + flat[0] * p + flat[1] * w]),
        np.vstack([v, v[0] + moving[0] * p + moving[1] * w]),
        730.5,
        AU_KM,
        len(gm),
    )


def flybys() -> Iterator[Problem]:
    """A stone past a light body on a circle of 2.77 au: 300 days before the passage to 300 days after it."""
    for gm, apart in ((1.4e-13, 0.002), (1.4e-13, 0.02), (9.5e-11, 0.005), (9.5e-11, 0.05)):
        masses, speed = np.array([SUN, gm, 0.0]), np.sqrt((SUN + gm) / 2.77)
        q = np.array([[0.0, 0, 0], [2.77, 0, 0], [2.77 + apart, 0, 0]])
        v = np.array([[0.0, 0, 0], [0, speed, 0], [0, 0.97 * speed, 5.0 / 1731.0]])
        back = taylor(masses, q, -v, 300.0, states=True)
        if back is not None:
            name = f"GM {gm:g} au^3/d^2 passed at {apart:g} au"
            yield Problem(name, masses, back[:, :3], -back[:, 3:], 600.0, AU_KM, 2)


def crossers(span: float) -> Problem:
    """Fifty massless particles that cross Jupiter's orbit, among Sun, Jupiter and Saturn."""
    start = orbits.System.solar_system(epoch="2022-08-09", bodies=["Sun", "Jupiter", "Saturn"])
    gm, q, v, _ = start.values
    from_ecliptic = orbits.elements.ecliptic_to_icrf
    places, speeds = [], []
    for a, anomaly in zip(np.linspace(4.5, 6.0, 50), np.linspace(0.0, 6.0, 50), strict=True):
        x, w = orbits.elements.state_from_elements(gm[0], a=a, e=0.3, M=anomaly)
        places.append(q[0] + from_ecliptic(x))
        speeds.append(v[0] + from_ecliptic(w))
    name = f"50 Jupiter-crossers, {span / 365.25:g} yr"
    return Problem(name, np.append(gm, np.zeros(50)), np.vstack([q, places]), np.vstack([v, speeds]), span, AU_KM)
