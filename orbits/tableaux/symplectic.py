"""Symplectic tableaux whose floats are exactly symplectic.

Written with the increments of the stages, K_j = h b_j V_j and L_j = h b_j F_j,

    Q_i = q + sum_j mu_ij K_j,   P_i = p + sum_j mu_bar_ij L_j,   mu_ij = a_ij / b_j,   mu_bar_ij = a_bar_ij / b_j,

the step is symplectic if and only if mu_bar_ij + mu_ji = 1. For q'' = g(q) only eta_ij = (a a_bar)_ij / b_j is needed,
and the step is symplectic if and only if eta_ij - eta_ji = c_i - c_j.

Coefficients rounded to nearest violate this by about 1e-17, which causes a secular drift of the energy. Here c and the
lower triangle of eta are multiples of a power of two, and the upper triangle is *computed* from the identity, which
therefore holds exactly. For a symmetric method so do c_{s+1-i} = 1 - c_i and eta_{s+1-i,s+1-j} = eta_ji. mu is rounded
in the same way.

Source: Hairer, Lubich & Wanner (2006), sec. VI.4.1; Hairer, McLachlan & Razakarivony (2008) on the rounding of
coefficients.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any

import mpmath
import numpy as np

from orbits.errors import InputError
from orbits.many_digits import many_digits
from orbits.tableaux.interpolation import lagrange_coefficients, value
from orbits.tableaux.partitioned import DIGITS, Array, PartitionedTableau, exact, read_only

TOLERANCE = 1e-50
"""An identity holds if its defect is below this, for numbers of 60 digits."""

FLOAT_TOLERANCE = 2.0**-50
"""The same, for coefficients given as float64."""

LARGEST = 1e6
"""The largest coefficients that are accepted."""

FAR = 1.5
"""The largest ratio of a step to the one before at which the polynomial of that step is used to guess the stages."""


@dataclass(frozen=True, eq=False)
class SymplecticTableau(PartitionedTableau):
    """A symplectic pair, with coefficients that are exactly symplectic in binary floats.

    nodes, one_minus_nodes : (s,) float64; the nodes c on a binary grid, with c_i + (1 - c_i) = 1 exactly
    eta : (s, s) float64, (a a_bar)_ij / b_j with eta_ij - eta_ji = c_i - c_j exactly
    mu, mu_bar : (s, s) float64, a_ij / b_j and a_bar_ij / b_j with mu_bar_ij + mu_ji = 1 exactly
    continuation : (s, s) float64; extrapolates stage values of one step to the next, by the polynomial through them
    symmetric : whether the method is its own adjoint
    """

    nodes: Array = field(repr=False)
    one_minus_nodes: Array = field(repr=False)
    eta: Array = field(repr=False)
    mu: Array = field(repr=False)
    mu_bar: Array = field(repr=False)
    continuation: Array = field(repr=False)
    symmetric: bool

    def __post_init__(self) -> None:
        for array in (self.nodes, self.one_minus_nodes, self.eta, self.mu, self.mu_bar, self.continuation):
            read_only(array)

    def continued(self, ratio: float) -> Array:
        """Return `continuation` for a next step that is `ratio` times as long, (s, s).

        A polynomial is useless far from its nodes: for ratios beyond `FAR` the values themselves are the guess.
        """
        if ratio == 1.0:
            return self.continuation
        if not -FAR <= ratio <= FAR:
            return np.eye(self.stages)
        with many_digits(DIGITS):
            return _continuation(list(self.exact_c), ratio)

    def binary_residual(self) -> Fraction:
        """Return the largest defect of eta_ij - eta_ji = c_i - c_j and mu_bar_ij + mu_ji = 1, in exact arithmetic."""
        s = range(self.stages)
        eta, mu, mu_bar, c = (_fractions(x) for x in (self.eta, self.mu, self.mu_bar, self.nodes))
        second: Fraction = max(abs(eta[i, j] - eta[j, i] - (c[i] - c[j])) for i in s for j in s)
        worst: Fraction = max(second, *(abs(mu_bar[i, j] + mu[j, i] - 1) for i in s for j in s))
        return worst

    def binary_asymmetry(self) -> Fraction:
        """Return the largest defect of the mirror symmetries, in exact arithmetic.

        They are c_{s+1-i} = 1 - c_i, eta_{s+1-i,s+1-j} = eta_ji and mu_ij + mu_{s+1-i,s+1-j} = 1.
        """
        s = range(self.stages)
        eta, mu, c = _fractions(self.eta), _fractions(self.mu), _fractions(self.nodes)
        worst: Fraction = max(abs(c[i] + c[-1 - i] - 1) for i in s)
        worst = max(worst, *(abs(eta[-1 - i, -1 - j] - eta[j, i]) for i in s for j in s))
        mirrored: Fraction = max(abs(mu[i, j] + mu[-1 - i, -1 - j] - 1) for i in s for j in s)
        return max(worst, mirrored)

    def rounding_residual(self) -> float:
        """Return how far the floats are from the true coefficients, in units of 2^-53."""
        s = range(self.stages)
        with many_digits(DIGITS):
            eta, mu = _eta(self), _mu(self)
            worst: Any = max(abs(mpmath.mpf(float(self.nodes[i])) - self.exact_c[i]) for i in s)
            worst = max(worst, *(abs(mpmath.mpf(float(self.eta[i, j])) - eta[i][j]) for i in s for j in s))
            worst = max(worst, *(abs(mpmath.mpf(float(self.mu[i, j])) - mu[i][j]) for i in s for j in s))
            return float(worst * 2**53)

    def rounded_to_nearest(self) -> SymplecticTableau:
        """Return the pair with each coefficient rounded to the nearest float: a control, not exactly symplectic."""
        with many_digits(DIGITS):
            eta, mu = (np.array([[float(x) for x in row] for row in table]) for table in (_eta(self), _mu(self)))
            bar = [[float(x / b) for x, b in zip(row, self.exact_b, strict=True)] for row in self.exact_a_bar]
            rest = np.array([float(1 - c) for c in self.exact_c])
        return replace(self, nodes=self.c, one_minus_nodes=rest, eta=eta, mu=mu, mu_bar=np.array(bar))


def symplectic(name: str, a: Any, a_bar: Any, b: Any, order: int, *, tolerance: float = TOLERANCE) -> SymplecticTableau:
    """Return a symplectic pair with exactly symplectic floats, after checking every identity that it promises.

    a, a_bar : (s, s), b : (s,), of Fractions, mpmath numbers or floats
    order : of convergence, as its author says; `convergence_order` measures it, and certificates do
    Raises InputError for shapes that do not fit, zero weights, a pair that is not symplectic, and coefficients above
    a million.
    """
    with many_digits(DIGITS + 10):
        plain = PartitionedTableau(name, exact(a), exact(a_bar), exact(b), order)
        _require_pair(plain, tolerance)
        s = range(plain.stages)
        symmetric = plain.symmetry_residual() <= tolerance
        exact_eta, exact_mu = _eta(plain), _mu(plain)
        size = max(1, *(abs(x) for row in (*exact_eta, plain.exact_c) for x in row))
        if size > LARGEST:
            raise InputError(
                f"{name}: coefficients of size {float(size):.3g}; expected at most {LARGEST:.0f}: differences of "
                "larger ones would be rounding errors"
            )
        grid = 53 - int(mpmath.ceil(mpmath.log(size, 2)))
        c = np.array([_on_grid(x, grid) for x in plain.exact_c])
        if symmetric:
            for i in range(plain.stages // 2):
                c[-1 - i] = 1.0 - c[i]
            if plain.stages % 2:
                c[plain.stages // 2] = 0.5
        eta = np.empty((plain.stages, plain.stages))
        for i in s:
            for j in range(i + 1):
                eta[i, j] = _on_grid(exact_eta[i][j], grid)
                eta[j, i] = eta[i, j] - (c[i] - c[j])
        mu = _binary_mu(plain, exact_mu, symmetric, tolerance)
        tableau = SymplecticTableau(
            name=name,
            exact_a=plain.exact_a,
            exact_a_bar=plain.exact_a_bar,
            exact_b=plain.exact_b,
            order=order,
            nodes=c,
            one_minus_nodes=1.0 - c,
            eta=eta,
            mu=mu,
            mu_bar=1.0 - mu.T,
            continuation=_continuation(list(plain.exact_c)),
            symmetric=symmetric,
        )
    _check(tableau, rounding=4.0 * max(1.0, float(size)) + tolerance * 2.0**54)
    return tableau


def _require_pair(tableau: PartitionedTableau, tolerance: float) -> None:
    s = tableau.stages
    shapes = [len(tableau.exact_a), len(tableau.exact_a_bar)]
    rows = [len(row) for table in (tableau.exact_a, tableau.exact_a_bar) for row in table]
    if s == 0 or shapes != [s, s] or set(rows) != {s}:
        raise InputError(f"{tableau.name}: a and a_bar must be {s} x {s} tables for the {s} weights b")
    zero = [i + 1 for i, x in enumerate(tableau.exact_b) if x == 0]
    if zero:
        raise InputError(
            f"{tableau.name}: the weight b_{zero[0]} is zero, so its stage has no momentum of its own; expected "
            "weights that are not zero. Leave that stage out."
        )
    with many_digits(DIGITS):
        excess = mpmath.fsum(tableau.exact_b) - 1
    if abs(excess) > tolerance:
        raise InputError(
            f"{tableau.name}: the weights b sum to {float(1 + excess):.17g}; expected 1, for at least order 1"
        )
    defect = tableau.symplecticity_residual()
    if not defect <= tolerance:
        raise InputError(
            f"{tableau.name} is not symplectic: b_i a_bar_ij + b_j a_ji = b_i b_j is violated by {defect:.3g}, "
            f"expected at most {tolerance:.0e}. Complete the pair by a_bar_ij = b_j (1 - a_ji / b_i)."
        )


def _binary_mu(plain: PartitionedTableau, exact_mu: list[list[Any]], symmetric: bool, tolerance: float) -> Array:
    """Round mu so that the identities of unpartitioned and of symmetric methods hold exactly as well."""
    s = range(plain.stages)
    size = max(1, *(abs(x) for row in exact_mu for x in row), *(abs(1 - x) for row in exact_mu for x in row))
    grid = 52 - int(mpmath.floor(mpmath.log(size, 2)))
    own = max(
        abs(x - y) for r, t in zip(plain.exact_a, plain.exact_a_bar, strict=True) for x, y in zip(r, t, strict=True)
    )
    mu = np.full((plain.stages, plain.stages), np.nan)
    for i in s:
        for j in s:
            partners = [(j, i)] if own <= tolerance else []
            if symmetric:
                partners.append((plain.stages - 1 - i, plain.stages - 1 - j))
            known = [mu[k] for k in partners if k != (i, j) and not np.isnan(mu[k])]
            if (i, j) in partners:
                mu[i, j] = 0.5
            else:
                mu[i, j] = 1.0 - known[0] if known else _on_grid(exact_mu[i][j], grid)
    return mu


def _continuation(nodes: list[Any], ratio: float = 1.0) -> Array:
    """Extrapolate from c_j to 1 + ratio c_i by the polynomial through the values; identity where nodes coincide."""
    s = range(len(nodes))
    if len({mpmath.nstr(c, 30) for c in nodes}) < len(nodes):
        return np.eye(len(nodes))
    basis = [lagrange_coefficients(nodes, j) for j in s]
    return np.array([[float(value(basis[j], 1 + ratio * nodes[i])) for j in s] for i in s])


def _eta(tableau: PartitionedTableau) -> list[list[Any]]:
    a, a_bar, b, s = tableau.exact_a, tableau.exact_a_bar, tableau.exact_b, range(tableau.stages)
    return [[sum(a[i][k] * a_bar[k][j] for k in s) / b[j] for j in s] for i in s]


def _mu(tableau: PartitionedTableau) -> list[list[Any]]:
    s = range(tableau.stages)
    return [[tableau.exact_a[i][j] / tableau.exact_b[j] for j in s] for i in s]


def _fractions(values: Array) -> Any:
    return np.vectorize(Fraction, otypes=[object])(values)


def _on_grid(x: Any, grid: int) -> float:
    """Round to the nearest multiple of 2^-grid."""
    return float(mpmath.nint(x * 2**grid)) / 2.0**grid


def _check(tableau: SymplecticTableau, rounding: float) -> None:
    defects = {"eta_ij - eta_ji = c_i - c_j, mu_bar_ij + mu_ji = 1": tableau.binary_residual()}
    if tableau.symmetric:
        defects["c, eta and mu mirrored"] = tableau.binary_asymmetry()
    for identity, defect in defects.items():
        if defect != 0:
            raise ArithmeticError(f"{tableau.name}: {identity} is off by {float(defect):.3g} in binary")
    if tableau.rounding_residual() > rounding:
        raise ArithmeticError(f"{tableau.name}: coefficients off by {tableau.rounding_residual():.3g} x 2^-53")
