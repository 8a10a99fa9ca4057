"""Gauss collocation on the flow of Kepler (FCIRK16), counted: is it cheaper than a Wisdom–Holman map at equal error?

    python scripts/gauss_on_kepler.py          a minute

Half a Kepler flow, a step of Gauss with 8 stages for what perturbs the Kepler motion, seen in the variables that this
motion leaves constant, half a Kepler flow. Sun and nine in Jacobi coordinates for ten years, in NumPy: what is counted
are sweeps of the iteration and evaluations of a stage, each a Kepler flow, its gradient and the interaction.

Source: Antoñana, Alberdi, Makazaga & Murua (2022), CeMDA 134, 31.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from benchmarks.problems import AU_KM, YEAR, marcher, ten_bodies_data

import orbits
from orbits.tableaux.interpolation import collocation, legendre_zeros

SPAN = 10 * YEAR
STEPS = (75, 100, 150, 200, 300, 600)
MAPS = (1218, 609)
MOST_SWEEPS, SETTLED = 40, 1e-14
TINY = 1e-30
"""The complex step of derivatives."""


@dataclass
class Problem:
    """Sun and planets in Jacobi coordinates: gm (n,), the map to them and back, (n, n), and GM of their orbits."""

    gm: np.ndarray
    to: np.ndarray
    back: np.ndarray

    @classmethod
    def of(cls, gm: np.ndarray) -> Problem:
        """Return the problem of bodies, the Sun first."""
        n, total = len(gm), np.cumsum(gm)
        to = np.eye(n)
        for i in range(1, n):
            to[i, :i] = -gm[:i] / total[i - 1]
        to[0] = gm / total[-1]
        return cls(gm, to, np.linalg.inv(to))

    @property
    def mu(self) -> np.ndarray:
        """GM of each planet with all before it."""
        return np.cumsum(self.gm)[1:]

    def perturbation(self, q: np.ndarray) -> np.ndarray:
        """Return the accelerations other than Kepler's of planets at q, (stages, n - 1, 3), in Jacobi coordinates."""
        centre = np.zeros((*q.shape[:-2], 1, 3))
        x = self.back @ np.concatenate([centre, q], axis=-2)
        apart = x[..., None, :, :] - x[..., :, None, :]
        r2 = np.sum(apart * apart, axis=-1) + np.eye(len(self.gm))
        pull = self.gm / r2**1.5 * (1.0 - np.eye(len(self.gm)))
        all_of_it = self.to @ np.sum(pull[..., None] * apart, axis=-2)
        r = np.sqrt(np.sum(q * q, axis=-1, keepdims=True))
        return all_of_it[..., 1:, :] + self.mu[:, None] * q / r**3


def kepler(mu: np.ndarray, q: np.ndarray, v: np.ndarray, t: np.ndarray, s: np.ndarray | None, sweeps: int):
    """Return (q, v, s) after a time t on ellipses: s is the universal variable, and a start for it."""
    r0, turn = np.sqrt(np.sum(q * q, axis=-1)), np.sum(q * v, axis=-1)
    beta = 2.0 * mu / r0 - np.sum(v * v, axis=-1)
    root = np.sqrt(beta)
    s = t / r0 if s is None else s
    for k in range(sweeps + 1):
        half, g1 = np.sin(0.5 * root * s), np.sin(root * s) / root
        g0, g2, g3 = 1.0 - 2.0 * half * half, 2.0 * half * half / beta, (s - g1) / beta
        r = r0 * g0 + turn * g1 + mu * g2
        if k < sweeps:
            s = s - (r0 * g1 + turn * g2 + mu * g3 - t) / r
    f, g = 1.0 - mu * g2 / r0, t - mu * g3
    df, dg = -mu * g1 / (r * r0), 1.0 - mu * g2 / r
    return f[..., None] * q + g[..., None] * v, df[..., None] * q + dg[..., None] * v, s


def pulled_back(mu, q, v, t, s, a):
    """Return what the acceleration a at the end of a flow does to its start (q, v): (-d/dv, d/dq) of a . q(q, v)."""
    z = np.stack([np.concatenate([q, v], axis=-1)] * 6).astype(complex)
    for k in range(6):
        z[k, ..., k] += 1j * TINY
    end, _, _ = kepler(mu, z[..., :3], z[..., 3:], t, np.stack([s] * 6).astype(complex), 2)
    gradient = np.moveaxis(np.sum(end.imag / TINY * a, axis=-1), 0, -1)
    return np.concatenate([-gradient[..., 3:], gradient[..., :3]], axis=-1)


def step(problem: Problem, q: np.ndarray, v: np.ndarray, h: float, a: np.ndarray, b: np.ndarray, c: np.ndarray):
    """Return (q, v, sweeps) after a step."""
    mu = problem.mu
    half, t = np.full(len(mu), 0.5 * h), (c[:, None] - 0.5) * h * np.ones(len(mu))
    q, v, _ = kepler(mu, q, v, half, None, 12)
    size = np.concatenate([np.abs(x).max(axis=-1, keepdims=True) * np.ones(3) for x in (q, v)], axis=-1)
    slopes, s, least, sweeps = np.zeros((8, len(mu), 6)), None, np.inf, 0
    while sweeps < MOST_SWEEPS:
        sweeps += 1
        stages = h * np.tensordot(a, slopes, axes=1)
        place, speed = q + stages[..., :3], v + stages[..., 3:]
        there, _, s = kepler(mu, place, speed, t, s, 12 if s is None else 4)
        new = pulled_back(mu, place, speed, t, s, problem.perturbation(there))
        change, slopes = float(np.max(np.abs(h * (new - slopes)) / size)), new
        if change < 1e-16 or (change < SETTLED and change > 0.5 * least):
            break
        least = min(change, least)
    moved = h * np.tensordot(b, slopes, axes=1)
    q, v, _ = kepler(mu, q + moved[:, :3], v + moved[:, 3:], half, None, 12)
    return q, v, sweeps


def main() -> None:
    """Print errors and counts."""
    gm, q, v, reference = ten_bodies_data()
    truth, problem = np.array(reference["10"], dtype=float), Problem.of(gm)
    nodes = legendre_zeros(8)
    a, b, c = (np.array(x, dtype=float) for x in (*collocation(nodes), nodes))

    def told(x: np.ndarray) -> str:
        off = AU_KM * np.linalg.norm((x - x[0]) - (truth - truth[0]), axis=1)
        return f"Mercury {off[1]:.2e} km, Earth-Moon {off[3]:.2e} km"

    for steps in STEPS:
        h, sweeps = SPAN / steps, 0
        x, w = (problem.to @ y for y in (q, v))
        centre = x[0] + SPAN * w[0]
        x, w = x[1:], w[1:]
        for _ in range(steps):
            x, w, count = step(problem, x, w, h, a, b, c)
            sweeps += count
        end = problem.back @ np.concatenate([centre[None], x])
        counts = f"{sweeps / steps:.2f} sweeps a step, {8 * sweeps / SPAN:.2f} evaluations of a stage a day"
        print(f"on the flow of Kepler, {h:5.2f} d: {told(end)}; {counts}")
    for steps in MAPS:
        run = marcher(orbits.WisdomHolman(kernel="lazy"), gm, q, v, SPAN / steps)
        run.advance(steps)
        print(f"lazy kick, corrector 17, {SPAN / steps:5.2f} d: {told(run.state()[0])}; a flow and two kicks a step")
    run = marcher(orbits.Gauss(stages=8), gm, q, v, SPAN / 609)
    run.advance(609)
    print(f"Gauss, 6 d: {told(run.state()[0])}; {8 * run.stepper.counts()[0] / SPAN:.2f} evaluations of a stage a day")


if __name__ == "__main__":
    main()
