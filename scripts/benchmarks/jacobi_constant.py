"""The Jacobi constant of particles that meet a planet again and again, by maps that follow encounters."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

import orbits
from orbits.elements import state_from_elements
from orbits.lagrangians.newtonian import newtonian, parameters
from orbits.marching.legs.leg import Leg
from orbits.point_masses import PointMasses

Array = NDArray[np.float64]

PLANET, YEAR = 1.0 / 1047.0, 2.0 * np.pi
"""The mass of the planet as a fraction of both, whose sum, distance and mean motion are 1; and its year."""

COUNT = 40


def part_jacobi(repetitions: int) -> dict[str, Any]:
    """Forty particles with e = 0.3 cross the orbit of a planet with a 1,047th of the star's mass, on a circle; in 1,000
    of its years they meet it tens of times. The table has the change of their Jacobi constants, which are about 3,
    after 10, 100 and 1,000 years: the median and the value that nine tenths do not exceed, in 40 and in 100 steps a
    year, by WisdomHolman(encounters="follow"), MERCURIUS and TRACE.
    """
    gm, q, v = _start()
    first, rows = constant(gm, q, v), []
    for part in (40, 100):
        for name in ("wisdom-holman", "mercurius", "trace"):
            run = _ours if name == "wisdom-holman" else _theirs
            row: dict[str, Any] = {"method": name, "steps a year": part}
            for years, x, w in run(name, gm, q, v, YEAR / part, (10, 100, 1000)):
                change = np.abs(constant(gm, x, w) - first)
                row[f"{years} yr"], row[f"{years} yr, 9/10"] = (
                    float(np.nanmedian(change)), float(np.nanquantile(change, 0.9))
                )
            rows.append(row)
    return {"rows": rows}


def constant(gm: Array, q: Array, v: Array) -> Array:
    """Return C = 2 (m_1 / r_1 + m_2 / r_2) + 2 (x v_y - y v_x) - v^2 of the particles."""
    centre, speed = (gm[:2] @ q[:2]) / gm[:2].sum(), (gm[:2] @ v[:2]) / gm[:2].sum()
    pull = sum(gm[k] / np.linalg.norm(q[2:] - q[k], axis=1) for k in (0, 1))
    x, w = q[2:] - centre, v[2:] - speed
    turn: Array = 2.0 * pull + 2.0 * (x[:, 0] * w[:, 1] - x[:, 1] * w[:, 0]) - (w * w).sum(axis=1)
    return turn


def _start() -> tuple[Array, Array, Array]:
    gm = np.append([1.0 - PLANET, PLANET], np.zeros(COUNT))
    q = np.array([[-PLANET, 0.0, 0.0], [1.0 - PLANET, 0.0, 0.0]])
    v = np.array([[0.0, -PLANET, 0.0], [0.0, 1.0 - PLANET, 0.0]])
    sizes, anomalies = np.linspace(0.85, 1.2, COUNT), np.linspace(0.0, 2.0 * np.pi, COUNT, endpoint=False)
    states = [
        state_from_elements(gm[0], a=a, e=0.3, inc=0.05, omega=5.0 * M, M=M)
        for a, M in zip(sizes, anomalies, strict=True)
    ]
    places, speeds = (np.array(x) for x in zip(*states, strict=True))
    return gm, np.vstack([q, q[0] + places]), np.vstack([v, v[0] + speeds])


def _ours(name: str, gm: Array, q: Array, v: Array, h: float, years: tuple[int, ...]) -> Any:
    method, massive = orbits.WisdomHolman(encounters="follow"), gm > 0.0
    march = Leg.of(newtonian, method, parameters(gm[massive]), massive, q, v, h, retire=True)
    for count in years:
        march.advance(round(count * YEAR / h) - march.step)
        yield count, *march.state()


def _theirs(name: str, gm: Array, q: Array, v: Array, h: float, years: tuple[int, ...]) -> Any:
    from orbits.regression.peers import simulation

    simulated = simulation(PointMasses(gm, q, v))
    simulated.integrator, simulated.dt = name, h
    for count in years:
        simulated.integrate(count * YEAR, exact_finish_time=0)
        x, w = np.empty_like(q), np.empty_like(v)
        simulated.serialize_particle_data(xyz=x, vxvyvz=w)
        yield count, x, w
