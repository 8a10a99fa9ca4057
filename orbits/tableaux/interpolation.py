"""Polynomials through nodes, in mpmath, for collocation tableaux."""

from __future__ import annotations

from typing import Any

import mpmath

from orbits.tableaux.partitioned import DIGITS


def legendre_zeros(stages: int) -> list[Any]:
    """Return the zeros of P_s(2c - 1) in ascending order, by Newton's method from the usual estimate."""
    zeros = []
    for i in range(1, stages + 1):
        x = mpmath.cos(mpmath.pi * (i - mpmath.mpf(1) / 4) / (stages + mpmath.mpf(1) / 2))
        for _ in range(100):
            p, slope = legendre(stages, x)
            correction = p / slope
            x -= correction
            if abs(correction) < mpmath.mpf(10) ** (-DIGITS):
                break
        zeros.append((1 + x) / 2)
    return sorted(zeros)


def legendre(degree: int, x: Any) -> tuple[Any, Any]:
    """Return P_n(x) and its derivative, |x| < 1."""
    p, below = mpmath.mpf(1), mpmath.mpf(0)
    for k in range(1, degree + 1):
        p, below = ((2 * k - 1) * x * p - (k - 1) * below) / k, p
    return p, degree * (x * p - below) / (x * x - 1)


def lagrange_coefficients(nodes: list[Any], j: int) -> list[Any]:
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


def integral(coefficients: list[Any], upper: Any) -> Any:
    """Return the integral of a polynomial from 0 to `upper`."""
    return sum(c * upper ** (m + 1) / (m + 1) for m, c in enumerate(coefficients))


def value(coefficients: list[Any], x: Any) -> Any:
    """Return the value of a polynomial at x."""
    return sum(c * x**m for m, c in enumerate(coefficients))


def collocation(nodes: list[Any]) -> tuple[list[list[Any]], list[Any]]:
    """Return (a, b) of the collocation method with these nodes."""
    s = range(len(nodes))
    basis = [lagrange_coefficients(nodes, j) for j in s]
    return [[integral(basis[j], c) for j in s] for c in nodes], [integral(basis[j], mpmath.mpf(1)) for j in s]
