"""The implicit midpoint rule: the variational integrator of L_d(q, q+; h) = h L((q + q+) / 2, (q+ - q) / h).

It is Gauss collocation with one stage, and uses its kernels.

Source: Hairer, Lubich & Wanner (2006), sec. I.1.2, VI.4.1; Marsden & West (2001), sec. 2.6.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from orbits.integrators.collocation.variational import VariationalRungeKutta
from orbits.tableaux import SymplecticTableau, gauss


@dataclass(frozen=True)
class ImplicitMidpoint(VariationalRungeKutta):
    """The implicit midpoint rule, order 2: `Gauss(stages=1)` by its usual name.

    Implicit, symplectic, symmetric; conserves linear and angular momentum and all quadratic invariants to round-off.
    For separable Lagrangians, `StormerVerlet` is cheaper.
    """

    name: ClassVar[str] = "implicit-midpoint"
    summary: ClassVar[str] = "implicit midpoint rule: variational, order 2; Gauss with one stage"
    source: ClassVar[str] = "Hairer, Lubich & Wanner (2006), sec. I.1.2, VI.4.1; Marsden & West (2001), sec. 2.6"

    @property
    def tableau(self) -> SymplecticTableau:
        """Gauss with one stage."""
        return gauss(1)
