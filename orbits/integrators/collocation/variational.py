"""The common part of all variational partitioned Runge–Kutta methods; each of them is a tableau and a name.

    L_d(q, q+; h) = h sum_i b_i L(Q_i, V_i),   extremized under   q+ = q + h sum_i b_i V_i

Separable Lagrangians are marched in second-order form, all others in canonical form.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import ClassVar

from orbits.errors import InputError
from orbits.integrators.base import MOMENTUM_MAPS, SYMMETRIC, SYMPLECTIC, Integrator
from orbits.integrators.canonical.bodies import CanonicalBodies
from orbits.integrators.canonical.form import Canonical
from orbits.integrators.collocation.form import Collocation
from orbits.integrators.forms import Form
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

    @property
    def looks_for_approaches(self) -> bool:
        """Yes: beside stages that are iterated it costs little."""
        return True

    @property
    def second_order(self) -> Form:
        """All stages at once, to the round-off floor."""
        return Collocation(self.tableau)

    @property
    def canonical(self) -> Form | None:
        """The same in positions and momenta, for stages that fit into one register."""
        return Canonical(self.tableau) if self.tableau.stages <= WIDTH else None

    def form_with(self, forces: int, inner: int = 0) -> Form | None:
        """The canonical form in velocities, for stages that fit into one register."""
        return CanonicalBodies(self.tableau, forces, inner) if self.tableau.stages <= WIDTH else None

    def check(self, lagrangian: Lagrangian, others: Callable[[], Mapping[str, type[Integrator]]]) -> None:
        """As for all methods; more than one register of stages needs a separable Lagrangian."""
        if self.canonical is None and SEPARABLE not in lagrangian.traits:
            raise InputError(
                f"{self.label}: more than {WIDTH} stages serve separable Lagrangians only; '{lagrangian.name}' is not "
                f"separable. Use {WIDTH} stages or fewer."
            )
        super().check(lagrangian, others)
