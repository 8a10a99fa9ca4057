"""Reference solutions for positions.

For a single massive body with any number of massless ones, or two massive bodies alone, the reference is exact:
Kepler's problem is solved in universal variables with 200-bit floats (60 digits), for all conics. The resulting float64
positions are the exact solution of the float64 initial values, correctly rounded (except for ties beyond the 27th
digit).

For runs without dt, the reference is a Taylor series of order 36 in doubled precision (106 bits), which starts from
exactly the same floats, chooses steps of its own, and has nothing in common with the methods that are judged. Its own
error is the difference from the same of order 28.

With constant steps the reference is converged: Gauss collocation with 8 stages (order 16) and at most half the step.
The largest difference from the same with 7 and with 6 stages is printed as its own error. Comparing one method at half
and at a quarter of the step would underestimate this: the coefficients h a_ij would be the same floats up to a power
of two, with the same rounding errors, which bias both runs in the same direction. Here the step is a power of two, so
that multiplication by it is exact, and the other runs have other coefficients. Errors common to all collocation
methods, or in the force kernel, are not detected; peers share no code with either.

Source: Rein & Tamayo (2015), sec. 2.3, and Danby (1992), sec. 6.9, for universal variables; Jorba & Zou (2005) for
Taylor series.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from orbits.body_names import few
from orbits.elements.two_body import two_body
from orbits.errors import ConvergenceError, with_unit
from orbits.many_digits import ONE_AT_A_TIME
from orbits.point_masses import PointMasses
from orbits.regression.stages import QUIET, Arrays, Stages
from orbits.regression.taylor import ORDER, Doubled, taylor

if TYPE_CHECKING:
    from orbits.system import System
    from orbits.time_grid import TimeGrid

Array = NDArray[np.float64]

PRECISION = 200
"""Precision of the mpmath floats in bits: 34 digits remain where near-parabolic motion cancels 26 of 60."""

CHECK_ORDER = 28
"""The order of the second Taylor series, whose difference from the first is the error of the reference."""

_CONVERGED = 2.0**-90  # relative; Newton converges quadratically, so what is left is of the order of 2^-180
_SERIES_BELOW = 1e-10  # of theta^2 = beta X^2: beneath it four terms of the series are good to 1e-40


@dataclass(frozen=True)
class ReferenceSolution:
    """Reference positions and their errors.

    q : (samples, bodies, 3) float64, in the caller's length unit
    error : (bodies,) float64, the largest error of each body, same unit
    kind : "exact", "taylor" or "converged"
    description : one sentence for the footer of a table
    """

    q: Array
    error: Array
    kind: str
    description: str


def exact_applies(start: PointMasses) -> bool:
    """Whether the exact solution is known: for one attractor, or two massive bodies alone, without softening.

    It is not if a body falls straight into the attractor (no angular momentum about it), which ends in a collision.
    """
    gm, q, v, softening = start
    massive = np.flatnonzero(gm > 0)
    if softening != 0.0 or not (len(massive) == 1 or (len(massive) == 2 and len(gm) == 2)):
        return False
    if len(gm) == 1:
        return True
    centre = massive[0]
    others = np.arange(len(gm)) != centre
    areal = np.cross((q - q[centre])[others], (v - v[centre])[others])
    return bool(np.all(np.any(areal != 0.0, axis=1)))


def exact(start: PointMasses, times: Array, stages: Stages = QUIET) -> ReferenceSolution:
    """Return the exact positions at `times`, (samples,) float64, of a system for which `exact_applies`.

    It takes a few tenths of a millisecond per moving body and sample.
    """
    import mpmath

    gm, q, v, _ = start
    name = "reference, exact"

    def positions() -> Arrays:
        stages.begin(f"{name}: {len(gm):,} bodies, {len(times):,} samples")
        with ONE_AT_A_TIME, mpmath.workprec(PRECISION):
            two = np.count_nonzero(gm) == 2
            return {"q": _two_massive(gm, q, v, times) if two else _one_massive(gm, q, v, times)}

    out = stages.keep(name, positions)["q"]
    error = np.spacing(np.abs(out)).max(axis=(0, 2)) / 2
    return ReferenceSolution(out, error, "exact", "exact two-body solution, 200-bit arithmetic, rounded to float64")


def _one_massive(gm: Array, q: Array, v: Array, times: Array) -> Array:
    """The attractor moves uniformly; every massless body has its own Kepler orbit about it."""
    from mpmath import mpf

    centre = int(np.argmax(gm))
    mu = mpf(float(gm[centre]))
    t = [mpf(x) for x in times.tolist()]
    q0, v0 = _vector(q[centre]), _vector(v[centre])
    base = [[a + b * s for a, b in zip(q0, v0, strict=True)] for s in t]
    out = np.empty((len(times), len(gm), 3))
    for body in range(len(gm)):
        if body == centre:
            out[:, body] = [[float(x) for x in row] for row in base]
            continue
        relative = _kepler(mu, _difference(q[body], q[centre]), _difference(v[body], v[centre]), t)
        out[:, body] = [
            [float(a + b) for a, b in zip(row, origin, strict=True)] for row, origin in zip(relative, base, strict=True)
        ]
    return out


def _two_massive(gm: Array, q: Array, v: Array, times: Array) -> Array:
    """The barycentre moves uniformly; the relative vector is a Kepler orbit under the sum of both GM."""
    from mpmath import mpf

    m = [mpf(x) for x in gm.tolist()]
    total = m[0] + m[1]
    q0, v0 = [_vector(x) for x in q], [_vector(x) for x in v]
    centre = [(m[0] * a + m[1] * b) / total for a, b in zip(*q0, strict=True)]
    motion = [(m[0] * a + m[1] * b) / total for a, b in zip(*v0, strict=True)]
    t = [mpf(x) for x in times.tolist()]
    relative = _kepler(total, _difference(q[1], q[0]), _difference(v[1], v[0]), t)
    out = np.empty((len(times), 2, 3))
    for i, s in enumerate(t):
        for axis in range(3):
            barycentre = centre[axis] + motion[axis] * s
            out[i, 0, axis] = float(barycentre - m[1] / total * relative[i][axis])
            out[i, 1, axis] = float(barycentre + m[0] / total * relative[i][axis])
    return out


def _vector(x: Array) -> list[Any]:
    from mpmath import mpf

    return [mpf(component) for component in x.tolist()]


def _difference(a: Array, b: Array) -> list[Any]:
    return [x - y for x, y in zip(_vector(a), _vector(b), strict=True)]


def _kepler(mu: Any, q: list[Any], v: list[Any], times: list[Any]) -> list[list[Any]]:
    """Relative positions at `times` of a Kepler orbit, as mpmath vectors.

    Solves t = r0 X + eta G2(X) + zeta G3(X) for X, with G_n the universal functions of beta = 2 mu/r0 - v^2; then
    q(t) = (1 - mu G2/r0) q + (t - mu G3) v. The right side grows with X (its derivative is r > 0): there is one X.
    """
    from mpmath import floor, mpf, pi, sqrt

    r0 = sqrt(sum(x * x for x in q))
    beta = 2 * mu / r0 - sum(x * x for x in v)
    eta = sum(a * b for a, b in zip(q, v, strict=True))
    zeta = mu - beta * r0
    period = 2 * pi * mu / (beta * sqrt(beta)) if beta > 0 else None
    reduced = [t - period * floor(t / period) if period is not None else t for t in times]
    floats = (np.array(x, dtype=np.float64) for x in (q, v, reduced))
    starts = _starting_values(float(mu), float(beta), *floats)
    out = []
    for t, start in zip(reduced, starts.tolist(), strict=True):
        x = mpf(start)
        while True:
            g1, g2, g3 = _universal(beta, x)
            residual = t - (r0 * x + eta * g2 + zeta * g3)
            correction = residual / (r0 + eta * g1 + zeta * g2)
            if abs(correction) <= abs(x) * _CONVERGED:
                break
            x += correction
        f, g = 1 - mu * g2 / r0, t - mu * g3
        out.append([f * a + g * b for a, b in zip(q, v, strict=True)])
    return out


def _universal(beta: Any, x: Any) -> tuple[Any, Any, Any]:
    """G1, G2, G3 at X, in mpmath: sin, 1 - cos and their kin, with the sign of beta choosing circular or hyperbolic."""
    from mpmath import cos_sin, cosh, sinh, sqrt

    theta2 = beta * x * x
    if abs(theta2) < _SERIES_BELOW:
        g3 = x**3 / 6 * (1 - theta2 / 20 * (1 - theta2 / 42 * (1 - theta2 / 72)))
        g2 = x**2 / 2 * (1 - theta2 / 12 * (1 - theta2 / 30 * (1 - theta2 / 56)))
        return x - beta * g3, g2, g3
    root = sqrt(abs(beta))
    c, s = cos_sin(root * x) if beta > 0 else (cosh(root * x), sinh(root * x))
    g1 = s / root
    return g1, (1 - c) / beta, (x - g1) / beta


def _starting_values(mu: float, beta: float, q: Array, v: Array, t: Array) -> Array:
    """X in float64: d(q.v)/dt = mu/r - beta, so that q.v grows by mu X - beta t."""
    there, moving = two_body(q, v, mu, t)
    return np.asarray(((there * moving).sum(axis=1) - (q * v).sum() + beta * t) / mu)


def series(start: PointMasses, times: Array, stages: Stages = QUIET) -> ReferenceSolution:
    """Return the positions at `times` by Taylor series in doubled precision.

    The error of a body is the largest difference, over the samples, from a series of another order, whose steps and
    rounding errors are others; and the rounding of the result to float64. Raises IntegrationError if bodies meet.
    """

    def states(name: str, order: int) -> Arrays:
        with stages.under_way(f"{name}: Taylor series of order {order}", times) as reached:
            found = taylor(start, times, order=order, reached=reached)
        return {"q": found.q, "q_lo": found.q_lo, "v": found.v, "v_lo": found.v_lo, "steps": np.array(found.steps)}

    def series_of(name: str, order: int) -> Doubled:
        kept = stages.keep(name, partial(states, name, order))
        return Doubled(kept["q"], kept["q_lo"], kept["v"], kept["v_lo"], int(kept["steps"]))

    judge, check = (
        series_of(name, order)
        for name, order in (("reference 1 of 2", ORDER), ("reference 2 of 2", CHECK_ORDER))
    )
    missed = np.linalg.norm(check.from_positions(judge.q) + judge.q_lo, axis=-1).max(axis=0)
    error = missed + np.spacing(np.abs(judge.q)).max(axis=(0, 2)) / 2
    description = f"Taylor series of order {ORDER} in 106-bit arithmetic, compared with order {CHECK_ORDER}"
    return ReferenceSolution(judge.q, error, "taylor", description)


def power_of_two(step: float) -> float:
    """Return the largest power of two that is not above `step` > 0: multiples by it are exact."""
    return float(2.0 ** np.floor(np.log2(step)))


def converged(
    system: System, grid: TimeGrid, threads: int | None = None, stages: Stages = QUIET
) -> ReferenceSolution:
    """Return positions by Gauss collocation with 8 stages, at the step and samples of `grid`.

    The error of a body is the largest difference from the same with 7 or 6 stages over the samples. Where only
    round-off remains, each is the difference of two random walks and may be small by chance, hence two of them. The
    cost is that of three runs at this step, massless particles included.
    Raises IntegrationError if the stages do not converge.
    """
    from orbits.integrators.gauss import Gauss
    from orbits.propagation.making_runs import propagated

    named = with_unit(f"{grid.dt:.6g}", system.units.time)

    def positions(name: str, method: Gauss) -> Arrays:
        pacing = stages.of_run(f"{name}: {method.label}, {grid.whole_steps:,} steps of {named}")
        run = propagated(system, method, grid, threads=threads, check_step=False, **pacing)
        if len(run.retired):
            raise ConvergenceError(
                f"the reference solution by {run.integrator.label} lost {few(run.retired.names)}, whose stages did not "
                "converge; nothing can be compared with it. Use a smaller dt, or remove them (system.remove).",
                bodies=run.retired.names,
            )
        return {"q": np.asarray(run.q.to_value(system.units.length))}

    q, *checks = (
        stages.keep(name, partial(positions, name, Gauss(stages=count)))["q"]
        for name, count in (("reference 1 of 3", 8), ("reference 2 of 3", 7), ("reference 3 of 3", 6))
    )
    error = np.max([np.linalg.norm(q - check, axis=-1).max(axis=0) for check in checks], axis=0)
    description = f"Gauss(stages=8) at dt = {named}, compared with 7 and 6 stages"
    return ReferenceSolution(q, error, "converged", description)
