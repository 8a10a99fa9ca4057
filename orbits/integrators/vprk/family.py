"""What all variational partitioned Runge–Kutta methods share; each of them is a tableau and a name.

    L_d(q, q+; h) = h sum_i b_i L(Q_i, V_i),   extremized under   q+ = q + h sum_i b_i V_i

Separable Lagrangians are marched in second-order form, all others in canonical form.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any, ClassVar

from orbits.errors import InputError
from orbits.integrators.base import MOMENTUM_MAPS, SYMMETRIC, SYMPLECTIC, Array, Integrator, padded
from orbits.integrators.vprk import canonical, second_order, wide
from orbits.integrators.vprk.coefficients import in_lanes
from orbits.kernels.lanes import WIDTH
from orbits.lagrangians.base import SEPARABLE, Lagrangian
from orbits.tableaux import SymplecticTableau


class VariationalRungeKutta(Integrator):
    """Base of the methods of this family."""

    requires: ClassVar[frozenset[str]] = frozenset({SEPARABLE})
    declares: ClassVar[frozenset[str]] = frozenset({SYMPLECTIC, SYMMETRIC, MOMENTUM_MAPS})
    variational: ClassVar[bool] = True

    @property
    def tableau(self) -> SymplecticTableau:
        """The pair of coefficients."""
        raise NotImplementedError

    @cached_property
    def registers(self) -> int:
        """How many registers of eight the stages of a coordinate fill."""
        return wide.registers(self.tableau.stages)

    @property
    def advance(self) -> Any:
        """The kernel for stages in one register, or in several."""
        return second_order.advance if self.registers == 1 else wide.advance

    @property
    def advance_particles(self) -> Any:
        """The kernel for stages in one register, or in several."""
        return second_order.advance_particles if self.registers == 1 else wide.advance_particles

    @property
    def advance_canonical(self) -> Any:
        """The kernel of the canonical form, for stages in one register; None for more."""
        return canonical.advance if self.registers == 1 else None

    @property
    def order(self) -> int:
        """Order of convergence."""
        return self.tableau.order

    def coefficients(self, h: float) -> Array:
        """Return the tableau for steps of h in lanes."""
        return self.coefficients_after(h, h)

    def coefficients_after(self, before: float, h: float) -> Array:
        """Return the same for a step of h whose stages are guessed from those of a step of `before`."""
        table = in_lanes if self.registers == 1 else wide.in_registers
        return table(self.tableau, h, h / before)

    def field_shape(self, size: int) -> tuple[int, int]:
        """One row of eight stages for each coordinate and register."""
        return self.registers * padded(size), WIDTH

    def memory_rows(self, size: int) -> int:
        """Stages of the step before, one row for each coordinate and register: their kicks, or their velocities."""
        return self.registers * padded(size)

    @property
    def particle_memory_rows(self) -> int:
        """Kicks of the step before, one row for each coordinate and register."""
        return 3 * self.registers

    def work_shape(self, size: int) -> tuple[int, int]:
        """Increments and changes of each coordinate, and three numbers of history for each."""
        if self.registers > 1:
            return wide.work_rows(size, self.registers), WIDTH
        return 2 * padded(size) + 3 * padded(size) // WIDTH, WIDTH

    def check(self, lagrangian: Lagrangian, others: Mapping[str, type[Integrator]]) -> None:
        """As for all methods; more than one register of stages is for separable Lagrangians only."""
        if self.registers > 1 and SEPARABLE not in lagrangian.traits:
            raise InputError(
                f"{self.label}: more than {WIDTH} stages serve separable Lagrangians only; '{lagrangian.name}' is not "
                f"separable. Use {WIDTH} stages or fewer."
            )
        super().check(lagrangian, others)

    def canonical_work_shape(self, size: int) -> tuple[int, int]:
        """Stages, Hessians and the matrix of Newton's method."""
        return canonical.work_rows(size, padded(size)), WIDTH
