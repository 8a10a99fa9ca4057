"""Discrete mechanics on Q x Q: discrete Lagrangians and their Euler–Lagrange equations."""

from orbits.discrete.quadrature import DiscreteLagrangian, euler_lagrange_residual, midpoint, trapezoidal

__all__ = ["DiscreteLagrangian", "euler_lagrange_residual", "midpoint", "trapezoidal"]
