"""Sums in doubled precision, linear equations, and iterations to the round-off floor."""
