"""Symplectic Euler: the variational integrators of the two rectangle rules, order 1.

    kick-drift    L_d(q, q+; h) = h L(q, (q+ - q)/h)     p+ = p + h dL/dq(q, V),    q+ = q + h V,  dL/dv(q, V) = p+
    drift-kick    L_d(q, q+; h) = h L(q+, (q+ - q)/h)    q+ = q + h V,  dL/dv(q+, V) = p,    p+ = p + h dL/dq(q+, V)

Each is the adjoint of the other; neither is symmetric. As partitioned tableaux: one stage, a = 0 with a_bar = 1, or the
other way round.

Source: Hairer, Lubich & Wanner (2006), sec. VI.3; Marsden & West (2001), sec. 2.6.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from orbits.errors import InputError, shown
from orbits.integrators.base import MOMENTUM_MAPS, SYMPLECTIC
from orbits.integrators.collocation.variational import VariationalRungeKutta
from orbits.integrators.forms import Array
from orbits.integrators.kicks_and_drifts.splitting import Splitting
from orbits.tableaux import SymplecticTableau, drift_kick, kick_drift


def kick_then_drift(h: float) -> tuple[Array, Array]:
    """A kick, and a drift with the new velocities."""
    return np.array([h, 0.0]), np.array([h])


def drift_then_kick(h: float) -> tuple[Array, Array]:
    """A drift, and a kick at the new positions."""
    return np.array([0.0, h]), np.array([h])


_FLOWS = {"kick-drift": kick_then_drift, "drift-kick": drift_then_kick}
_VARIANTS = {"kick-drift": kick_drift, "drift-kick": drift_kick}


@dataclass(frozen=True)
class SymplecticEuler(VariationalRungeKutta):
    """Symplectic Euler, order 1: the simplest variational integrator, for teaching.

    variant : "kick-drift" (momenta first) or "drift-kick" (positions first)

    Explicit for separable Lagrangians. Conserves linear and angular momentum and the symplectic form, but is not
    symmetric. `StormerVerlet` costs no more.
    Raises InputError for another variant; a march of a Lagrangian that is not separable raises ConvergenceError if a
    step does not converge.
    """

    variant: str = "kick-drift"

    name: ClassVar[str] = "symplectic-euler"
    summary: ClassVar[str] = "symplectic Euler, kick–drift or drift–kick: variational, order 1"
    declares: ClassVar[frozenset[str]] = frozenset({SYMPLECTIC, MOMENTUM_MAPS})
    source: ClassVar[str] = "Hairer, Lubich & Wanner (2006), sec. VI.3; Marsden & West (2001), sec. 2.6"

    def __post_init__(self) -> None:
        if not isinstance(self.variant, str) or self.variant.lower() not in _VARIANTS:
            raise InputError(f"SymplecticEuler has the variants {' and '.join(_VARIANTS)}; got {shown(self.variant)}")
        object.__setattr__(self, "variant", self.variant.lower())

    @property
    def tableau(self) -> SymplecticTableau:
        """One stage at the beginning or at the end of the step."""
        return _VARIANTS[self.variant]()

    @property
    def looks_for_approaches(self) -> bool:
        """No: a kick and a drift cost as little as the search."""
        return False

    @property
    def second_order(self) -> Splitting:
        """A kick and a drift, explicit if the Lagrangian is separable."""
        return Splitting(_FLOWS[self.variant], drifts=1)

    @classmethod
    def examples(cls) -> tuple[SymplecticEuler, ...]:
        """Return both variants."""
        return tuple(cls(variant=v) for v in _VARIANTS)
