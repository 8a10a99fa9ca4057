"""The discrete Lagrangian of a composition of steps gamma_i h: the sum of theirs, stationary in the points between.

    L_d(q_0, q_s; h) = ext over q_1, ..., q_(s-1) of sum_i L_d^i(q_(i-1), q_i; gamma_i h)

Source: Marsden & West (2001), sec. 2.5.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from orbits.discrete.base import Array, DiscreteLagrangian, Jet, Mechanics
from orbits.discrete.boundary import OfSteps, block_solve
from orbits.discrete.evolution import step
from orbits.discrete.legendre import phase_derivative
from orbits.discrete.newton import solve
from orbits.errors import InputError, IntegrationError
from orbits.lagrangians.base import show


@dataclass(frozen=True, eq=False, repr=False)
class Composed(OfSteps):
    """See `composed`."""

    name: str
    lagrangian: Mechanics | None
    parts: tuple[DiscreteLagrangian, ...]
    lengths: Callable[[float], Array]

    def guess(self, q: Array, p: Array, h: float, t: float) -> Array:
        """As for its parts."""
        return self.parts[0].guess(q, p, h, t)

    def _jets(self, q0: Array, q1: Array, h: float, t: float) -> list[Jet]:
        """Return the steps between the points that make their sum stationary, from the straight line."""
        steps = np.asarray(self.lengths(h), dtype=np.float64)
        offsets = np.append(0.0, np.cumsum(steps))
        count, d = len(steps), q0.size

        def of(x: Array) -> list[Jet]:
            points = np.vstack([q0, x.reshape(count - 1, d), q1])
            steps_of = zip(self.parts, itertools.pairwise(points), steps, offsets, strict=False)
            return [part.jet(a, b, float(length), t + float(at)) for part, (a, b), length, at in steps_of]

        if count == 1:
            return of(np.zeros(0))

        def equations(x: Array) -> tuple[Array, Callable[[Array], Array]]:
            jets = of(x)
            residual = np.concatenate([a.d2 + b.d1 for a, b in itertools.pairwise(jets)])
            return residual, lambda right: block_solve(jets, right[:, None])[:, 0]

        guess = self._between(q0, q1, h, t, steps, offsets)
        failure = f"{self.name}: no stationary points between q0 = {show(q0)} and q1 = {show(q1)}, h = {h:.6g}"
        return of(solve(equations, guess.ravel(), scale=float(np.max(np.abs(guess))), failure=failure, time=t))

    def _between(self, q0: Array, q1: Array, h: float, t: float, steps: Array, offsets: Array) -> Array:
        """Return a guess of the points between: those of the steps from the momentum of a single one, shifted so that
        they end at q1; on the straight line, where these cannot be taken.
        """
        shares = (offsets[1:] / h)[:, None]
        try:
            points, q, p = [], q0, -self.parts[0].d1(q0, q1, h, t)
            for part, length, at in zip(self.parts, steps, offsets, strict=False):
                q, p = step(part, q, p, float(length), t + float(at))
                points.append(q)
        except (IntegrationError, InputError):
            return np.asarray((q0 + shares * (q1 - q0))[:-1])
        return np.asarray((np.array(points) + shares * (q1 - q))[:-1])


@dataclass(frozen=True)
class PhaseStep:
    """A step of F~, solved from L_d by Newton's method, with its exact derivative.

    q, p : (d,) after the step; derivative : (2d, 2d)
    terms : (d, d), sizes of what cancels in the derivative of p by q: |D1D1 L_d| + |D2D2 L_d|; of parts, the root of
        the sum of their squares, as roundings add up
    """

    q: Array
    p: Array
    derivative: Array
    terms: Array


def phase_step(discrete: DiscreteLagrangian, q: ArrayLike, p: ArrayLike, h: float, t: float = 0.0) -> PhaseStep:
    """Return a step from (q, p), each (d,), with its derivative; of a composition, as the product of its parts'.

    Raises ConvergenceError if Newton's method fails, InputError if L_d is not regular.
    """
    x, y = discrete.vector(q, "q"), discrete.vector(p, "p")
    parts = [(discrete, h)]
    if isinstance(discrete, Composed):
        parts = [(part, float(length)) for part, length in zip(discrete.parts, discrete.lengths(h), strict=True)]
    derivative, terms = np.eye(2 * x.size), np.zeros((x.size, x.size))
    for part, length in parts:
        after, momentum = step(part, x, y, length, t)
        derivative = phase_derivative(part, x, after, length, t) @ derivative
        d11, _, d22 = part.hessian(x, after, length, t)
        terms = np.hypot(terms, np.abs(d11) + np.abs(d22))
        x, y, t = after, momentum, t + length
    return PhaseStep(x, y, derivative, terms)


def composed(
    parts: DiscreteLagrangian | Sequence[DiscreteLagrangian],
    lengths: Callable[[float], Array],
    *,
    name: str | None = None,
) -> Composed:
    """Return the discrete Lagrangian of steps one after another.

    parts : one for all steps, or one for each
    lengths : a function of h that returns the lengths of the steps, whose sum is h; some may be negative
    Raises InputError for lengths of another sum, and for another number of parts.
    """
    found = np.asarray(lengths(1.0), dtype=np.float64)
    if found.ndim != 1 or not len(found) or not abs(float(np.sum(found)) - 1.0) <= 1e-12:
        raise InputError(f"lengths must return a vector whose sum is h; for h = 1 it returns {show(found)}")
    each = (parts,) * len(found) if isinstance(parts, DiscreteLagrangian) else tuple(parts)
    if len(each) != len(found):
        raise InputError(f"parts are {len(each)}, but lengths returns {len(found)} steps; expected one for each")
    return Composed(name or f"{each[0].name}, {len(found)} composed", each[0].lagrangian, each, lengths)
