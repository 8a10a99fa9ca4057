"""Calls of functions of users, compiled by themselves: their kernels may allocate, and change from call to call."""

from __future__ import annotations

from numba import njit


@njit
def call_each(function, t, q, v, out):
    """Write the values of a compiled function of a time and a state, q and v (bodies, 3), at each of many."""
    for k in range(len(t)):
        out[k] = function(t[k], q[k], v[k])
