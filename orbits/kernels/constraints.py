"""How a compiled method finds the constraints g(q) = 0 of a Lagrangian; see `orbits.kernels.binding`."""

from __future__ import annotations

from numba.extending import overload

from orbits.kernels.binding import OPTIONS, kernel_of


def constraint_count(lagrangian):
    """Return the number m of constraints."""
    raise NotImplementedError("constraint_count() is for compiled code only")


@overload(constraint_count, jit_options=OPTIONS)
def _constraint_count(lagrangian):
    count = kernel_of(lagrangian, "constraint_count")
    return count and (lambda lagrangian: count)


def constraints(lagrangian, parameters, q, out):
    """Write g(q), (m,), its gradients G, (m, d), and W = G M^-1, (m, d), M being the mass matrix, into the vector
    `out`, one after the other.
    """
    raise NotImplementedError("constraints() is for compiled code only")


@overload(constraints, jit_options=OPTIONS)
def _constraints(lagrangian, parameters, q, out):
    compiled = kernel_of(lagrangian, "constraints")
    return compiled and (lambda lagrangian, parameters, q, out: compiled(parameters, q, out))
