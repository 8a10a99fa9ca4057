"""What all variational partitioned Runge–Kutta methods share; each of them is a tableau and a name.

    L_d(q, q+; h) = h sum_i b_i L(Q_i, V_i),   extremized under   q+ = q + h sum_i b_i V_i

Separable Lagrangians are marched in second-order form, all others in canonical form.
"""

from __future__ import annotations

from typing import Any, ClassVar

from orbits.integrators.base import MOMENTUM_MAPS, SYMMETRIC, SYMPLECTIC, Array, Integrator, padded
from orbits.integrators.vprk import canonical, second_order
from orbits.integrators.vprk.coefficients import in_lanes
from orbits.kernels.lanes import WIDTH
from orbits.lagrangians.base import SEPARABLE
from orbits.tableaux import SymplecticTableau


class VariationalRungeKutta(Integrator):
    """Base of the methods of this family."""

    requires: ClassVar[frozenset[str]] = frozenset({SEPARABLE})
    declares: ClassVar[frozenset[str]] = frozenset({SYMPLECTIC, SYMMETRIC, MOMENTUM_MAPS})
    variational: ClassVar[bool] = True
    advance: ClassVar[Any] = staticmethod(second_order.advance)
    advance_particles: ClassVar[Any] = staticmethod(second_order.advance_particles)
    advance_canonical: ClassVar[Any] = staticmethod(canonical.advance)

    @property
    def tableau(self) -> SymplecticTableau:
        """The pair of coefficients."""
        raise NotImplementedError

    @property
    def order(self) -> int:
        """Order of convergence."""
        return self.tableau.order

    def coefficients(self, h: float) -> Array:
        """Return the tableau for steps of h in lanes."""
        return in_lanes(self.tableau, h)

    def coefficients_after(self, before: float, h: float) -> Array:
        """Return the same for a step of h whose stages are guessed from those of a step of `before`."""
        return in_lanes(self.tableau, h, h / before)

    def field_shape(self, size: int) -> tuple[int, int]:
        """One row of eight stages for each coordinate."""
        return padded(size), WIDTH

    def memory_rows(self, size: int) -> int:
        """Stages of the step before, one row for each coordinate: their kicks, or their velocities."""
        return padded(size)

    @property
    def particle_memory_rows(self) -> int:
        """Kicks of the step before, one row for each coordinate."""
        return 3

    def work_shape(self, size: int) -> tuple[int, int]:
        """Increments and changes of each coordinate, and three numbers of history for each."""
        return 2 * padded(size) + 3 * padded(size) // WIDTH, WIDTH

    def canonical_work_shape(self, size: int) -> tuple[int, int]:
        """Stages, Hessians and the matrix of Newton's method."""
        return canonical.work_rows(size, padded(size)), WIDTH
