"""Partitioned Runge–Kutta tableaux: a method (a, b) for q' = v and a method (a_bar, b) for p' = f, with equal weights.

    Q_i = q + h sum_j a_ij V_j,         q+ = q + h sum_j b_j V_j
    P_i = p + h sum_j a_bar_ij F_j,     p+ = p + h sum_j b_j F_j

The method is symplectic, and variational, if and only if b_i a_bar_ij + b_j a_ji = b_i b_j.

Source: Hairer, Lubich & Wanner (2006), sec. II.2.1, VI.4.1 (theorem 4.6); Marsden & West (2001), sec. 2.6.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import mpmath
import numpy as np
from numpy.typing import NDArray

from orbits.many_digits import many_digits

DIGITS = 60

Array = NDArray[np.float64]
Exact = tuple[Any, ...]


@dataclass(frozen=True, eq=False)
class PartitionedTableau:
    """A partitioned Runge–Kutta method with s stages, to `DIGITS` digits.

    name : for messages
    exact_a, exact_a_bar : (s, s) mpmath numbers, nested tuples
    exact_b : (s,) mpmath numbers
    order : order of convergence
    """

    name: str
    exact_a: Exact
    exact_a_bar: Exact
    exact_b: Exact
    order: int

    @property
    def stages(self) -> int:
        """Number of stages s."""
        return len(self.exact_b)

    @cached_property
    def exact_c(self) -> Exact:
        """Nodes c_i = sum_j a_ij, mpmath numbers."""
        with many_digits(DIGITS):
            return tuple(mpmath.fsum(row) for row in self.exact_a)

    @cached_property
    def a(self) -> Array:
        """Coefficients of the positions, (s, s), rounded to float64."""
        return read_only(np.array([[float(x) for x in row] for row in self.exact_a]))

    @cached_property
    def a_bar(self) -> Array:
        """Coefficients of the momenta, (s, s), rounded to float64."""
        return read_only(np.array([[float(x) for x in row] for row in self.exact_a_bar]))

    @cached_property
    def b(self) -> Array:
        """Weights, (s,), rounded to float64."""
        return read_only(np.array([float(x) for x in self.exact_b]))

    @cached_property
    def c(self) -> Array:
        """Nodes, (s,), float64."""
        return read_only(np.array([float(x) for x in self.exact_c]))

    def symplecticity_residual(self) -> float:
        """Return the largest |b_i a_bar_ij + b_j a_ji - b_i b_j|, evaluated with `DIGITS` digits."""
        a, a_bar, b, s = self.exact_a, self.exact_a_bar, self.exact_b, range(self.stages)
        with many_digits(DIGITS):
            return float(max(abs(b[i] * a_bar[i][j] + b[j] * a[j][i] - b[i] * b[j]) for i in s for j in s))

    def symmetry_residual(self) -> float:
        """Return the largest defect of a_ij + a_{s+1-i,s+1-j} = b_j = b_{s+1-j}, for a and a_bar."""
        b, s = self.exact_b, range(self.stages)
        with many_digits(DIGITS):
            worst = max(abs(b[j] - b[-1 - j]) for j in s)
            for a in (self.exact_a, self.exact_a_bar):
                worst = max(worst, *(abs(a[i][j] + a[-1 - i][-1 - j] - b[j]) for i in s for j in s))
            return float(worst)


def read_only(array: Array) -> Array:
    """Return an array that all methods share, so that it cannot be written to."""
    array.flags.writeable = False
    return array


def exact(values: Any) -> Exact:
    """Return numbers, `Fraction`s, mpmath numbers, or nested sequences of them, as nested tuples of mpmath numbers."""
    from fractions import Fraction

    if isinstance(values, Fraction):
        return mpmath.mpf(values.numerator) / values.denominator  # type: ignore[no-any-return]
    if isinstance(values, list | tuple | np.ndarray):
        return tuple(exact(x) for x in values)
    return mpmath.mpf(values)  # type: ignore[no-any-return]
