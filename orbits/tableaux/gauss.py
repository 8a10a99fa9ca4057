"""Gauss collocation: nodes at the zeros of the shifted Legendre polynomial, order 2s, symplectic and symmetric.

    c_i : zeros of P_s(2c - 1)        a_ij = int_0^{c_i} l_j(t) dt        b_j = int_0^1 l_j(t) dt

For q'' = g(q) with L_i = h b_i g(Q_i) the step needs eta_ij = (A^2)_ij / b_j only, and it is symplectic if and only if

    eta_ij - eta_ji = c_i - c_j.

Tables rounded to nearest miss this by about 1e-17, which shows as a secular drift of the energy. Here c and the lower
triangle of eta are multiples of 2^-53 and the upper triangle is *formed* from the identity, so that it holds exactly,
and so does the symmetry c_{s+1-i} = 1 - c_i, eta_{s+1-i,s+1-j} = eta_ji.

Source: Hairer, Lubich & Wanner (2006), sec. II.1.3 (collocation), VI.4.1 (symplecticity); Hairer, McLachlan &
Razakarivony (2008) for why the rounding of the coefficients matters.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from typing import Any

import mpmath
import numpy as np
from numpy.typing import NDArray

from orbits.errors import InputError

ETA_GRID = 53  # c and eta, below 1 in size, are multiples of 2^-53
MU_GRID = 52  # mu reaches 1.09: multiples of 2^-52
DIGITS = 60


@dataclass(frozen=True)
class GaussTableau:
    """The s-stage Gauss method, to `DIGITS` digits and in exactly symplectic floats.

    exact_a, exact_b, exact_c : mpmath numbers, (s, s) and (s,) nested lists
    b, c, one_minus_c : (s,) float64; c and one_minus_c multiples of 2^-53 with c_i + (1 - c_i) = 1 exactly
    eta : (s, s) float64, (A^2)_ij / b_j with eta_ij - eta_ji = c_i - c_j exactly
    mu : (s, s) float64, a_ij / b_j with mu_ij + mu_ji = 1 exactly, for the first-order form
    extrapolation : (s, s) float64; continues L of one step, by its collocation polynomial, to the L of the next
    """

    stages: int
    exact_a: Any
    exact_b: Any
    exact_c: Any
    b: NDArray[np.float64]
    c: NDArray[np.float64]
    one_minus_c: NDArray[np.float64]
    eta: NDArray[np.float64]
    mu: NDArray[np.float64]
    extrapolation: NDArray[np.float64]

    @property
    def order(self) -> int:
        """Order of the method: 2s."""
        return 2 * self.stages

    def symplecticity_residual(self) -> Fraction:
        """Return the largest defect of eta_ij - eta_ji = c_i - c_j and mu_ij + mu_ji = 1, in exact arithmetic."""
        s = range(self.stages)
        eta, mu, c = _fractions(self.eta), _fractions(self.mu), _fractions(self.c)
        second: Fraction = max(abs(eta[i, j] - eta[j, i] - (c[i] - c[j])) for i in s for j in s)
        worst: Fraction = max(second, *(abs(mu[i, j] + mu[j, i] - 1) for i in s for j in s))
        return worst

    def symmetry_residual(self) -> Fraction:
        """Return the largest defect of c_{s+1-i} = 1 - c_i and eta_{s+1-i,s+1-j} = eta_ji, in exact arithmetic."""
        s = range(self.stages)
        eta, c = _fractions(self.eta), _fractions(self.c)
        nodes: Fraction = max(abs(c[i] + c[-1 - i] - 1) for i in s)
        worst: Fraction = max(nodes, *(abs(eta[-1 - i, -1 - j] - eta[j, i]) for i in s for j in s))
        return worst

    def rounding_residual(self) -> float:
        """Return how far the floats lie from the true coefficients, in units of 2^-53."""
        s = range(self.stages)
        with mpmath.workdps(DIGITS):
            eta = _eta(self.exact_a, self.exact_b)
            worst: Any = max(abs(mpmath.mpf(float(self.eta[i, j])) - eta[i][j]) for i in s for j in s)
            worst = max(worst, *(abs(mpmath.mpf(float(self.c[i])) - self.exact_c[i]) for i in s))
            return float(worst * 2**53)


def _fractions(values: NDArray[np.float64]) -> Any:
    return np.vectorize(Fraction, otypes=[object])(values)


def _legendre_zeros(stages: int) -> list[Any]:
    """Return the zeros of P_s(2c - 1) in ascending order, by Newton's method from the usual estimate."""
    zeros = []
    for i in range(1, stages + 1):
        x = mpmath.cos(mpmath.pi * (i - mpmath.mpf(1) / 4) / (stages + mpmath.mpf(1) / 2))
        for _ in range(100):
            p, below = mpmath.mpf(1), mpmath.mpf(0)
            for k in range(1, stages + 1):
                p, below = ((2 * k - 1) * x * p - (k - 1) * below) / k, p
            slope = stages * (x * p - below) / (x * x - 1)
            correction = p / slope
            x -= correction
            if abs(correction) < mpmath.mpf(10) ** (-DIGITS):
                break
        zeros.append((1 + x) / 2)
    return sorted(zeros)


def _lagrange_coefficients(nodes: list[Any], j: int) -> list[Any]:
    """Return the coefficients, lowest power first, of the polynomial that is 1 at node j and 0 at the others."""
    coefficients = [mpmath.mpf(1)]
    for k, node in enumerate(nodes):
        if k != j:
            width = nodes[j] - node
            shifted = [mpmath.mpf(0), *coefficients]
            coefficients = [
                (up - node * (coefficients[m] if m < len(coefficients) else 0)) / width for m, up in enumerate(shifted)
            ]
    return coefficients


def _integral(coefficients: list[Any], upper: Any) -> Any:
    return sum(c * upper ** (m + 1) / (m + 1) for m, c in enumerate(coefficients))


def _value(coefficients: list[Any], x: Any) -> Any:
    return sum(c * x**m for m, c in enumerate(coefficients))


def _eta(a: Any, b: Any) -> list[list[Any]]:
    s = range(len(b))
    return [[sum(a[i][k] * a[k][j] for k in s) / b[j] for j in s] for i in s]


def _on_grid(x: Any, grid: int) -> float:
    """Round to the nearest multiple of 2^-grid."""
    return float(mpmath.nint(x * 2**grid)) / 2.0**grid


@lru_cache(maxsize=64)
def gauss(stages: int) -> GaussTableau:
    """Return the Gauss method with `stages` >= 1 stages; every identity it promises is checked here.

    Raises InputError if `stages` is not a positive integer.
    """
    if not isinstance(stages, int) or isinstance(stages, bool) or stages < 1:
        raise InputError(f"the number of stages must be a positive integer, got {stages!r}; use e.g. Gauss(stages=8)")
    s = range(stages)
    with mpmath.workdps(DIGITS + 10):
        nodes = _legendre_zeros(stages)
        basis = [_lagrange_coefficients(nodes, j) for j in s]
        exact_a = [[_integral(basis[j], nodes[i]) for j in s] for i in s]
        exact_b = [_integral(basis[j], mpmath.mpf(1)) for j in s]
        exact_eta = _eta(exact_a, exact_b)

        c = np.array([_on_grid(x, ETA_GRID) for x in nodes])
        for i in range(stages // 2):
            c[-1 - i] = 1.0 - c[i]
        if stages % 2:
            c[stages // 2] = 0.5
        eta = np.empty((stages, stages))
        mu = np.empty((stages, stages))
        for i in s:
            mu[i, i] = 0.5
            for j in range(i + 1):
                eta[i, j] = _on_grid(exact_eta[i][j], ETA_GRID)
                eta[j, i] = eta[i, j] - (c[i] - c[j])
            for j in range(i):
                mu[i, j] = _on_grid(exact_a[i][j] / exact_b[j], MU_GRID)
                mu[j, i] = 1.0 - mu[i, j]
        extrapolation = np.array(
            [[float(exact_b[i] * _value(basis[j], 1 + nodes[i]) / exact_b[j]) for j in s] for i in s]
        )
        tableau = GaussTableau(
            stages=stages,
            exact_a=exact_a,
            exact_b=exact_b,
            exact_c=nodes,
            b=np.array([float(x) for x in exact_b]),
            c=c,
            one_minus_c=1.0 - c,
            eta=eta,
            mu=mu,
            extrapolation=extrapolation,
        )
    _check(tableau)
    return tableau


def _check(tableau: GaussTableau) -> None:
    defects = {
        "eta_ij - eta_ji = c_i - c_j, mu_ij + mu_ji = 1": tableau.symplecticity_residual(),
        "c_{s+1-i} = 1 - c_i, eta_{s+1-i,s+1-j} = eta_ji": tableau.symmetry_residual(),
    }
    for identity, defect in defects.items():
        if defect != 0:
            raise ArithmeticError(f"Gauss tableau, {tableau.stages} stages: {identity} is off by {float(defect):.3g}")
    if tableau.rounding_residual() > 2.0:
        raise ArithmeticError(f"Gauss tableau, {tableau.stages} stages: coefficients off by more than 2 x 2^-53")
