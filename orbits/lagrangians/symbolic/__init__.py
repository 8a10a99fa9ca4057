"""Lagrangians written in SymPy, turned into kernels."""

from orbits.lagrangians.symbolic.making import from_sympy, shipped

__all__ = ["from_sympy", "shipped"]
