"""Coefficients of Runge–Kutta methods from first principles, in forms that are exactly symplectic in binary floats."""
