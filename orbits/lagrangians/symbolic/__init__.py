"""Kernels from Lagrangians in SymPy."""

from orbits.lagrangians.symbolic.making import from_sympy, shipped

__all__ = ["from_sympy", "shipped"]
