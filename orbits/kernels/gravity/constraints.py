"""How a compiled method finds the constraints g(q) = 0 of a Lagrangian; see `orbits.kernels.binding`."""

from __future__ import annotations

from orbits.kernels.binding import kernel_of, of_lagrangian
from orbits.kernels.compile.verbs import verb


@verb
def constraint_count(lagrangian):
    """Return the number m of constraints."""
    count = kernel_of(lagrangian, "constraint_count")
    return count and (lambda lagrangian: count)


@of_lagrangian()
def constraints(lagrangian, parameters, q, out):
    """Write g(q), (m,), its gradients G, (m, d), and W = G M^-1, (m, d), M being the mass matrix, into the vector
    `out`, one after the other.
    """
