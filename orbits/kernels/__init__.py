"""Numba kernels: floats in, floats out. No units, no Python objects, no allocation inside a step."""
