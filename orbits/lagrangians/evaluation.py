"""L and its derivatives at one point or along a path, for callers that are not compiled."""

from __future__ import annotations

from orbits.kernels import binding
from orbits.kernels.compile import kernel


@kernel
def value(tag, parameters, t, q, v):
    """Return L(q, v, t); q, v : (d,)."""
    return binding.value(tag, parameters, t, q, v)


@kernel
def gradients(tag, parameters, t, q, v, f, p):
    """Write dL/dq into f and dL/dv into p, each (d,)."""
    binding.gradients(tag, parameters, t, q, v, f, p)


@kernel
def hessians(tag, parameters, t, q, v, out):
    """Write d2L/dq dq, d2L/dq dv and d2L/dv dv, each (d, d) row by row, into out (3 d^2,)."""
    binding.hessians(tag, parameters, t, q, v, out)
