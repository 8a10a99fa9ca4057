"""Kernels for eight systems of equal shape at once: one coordinate of each in a lane, with the bits it has alone."""
