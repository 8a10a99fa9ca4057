"""Composition: steps gamma_1 h, ..., gamma_s h of a symmetric method, chosen so that their errors cancel.

    Phi_h = phi(gamma_s h) ... phi(gamma_1 h)

With L_d^i the discrete Lagrangian of the method for a step of gamma_i h, the whole is the variational integrator of

    L_d(q_0, q_s; h) = ext over q_1, ..., q_(s-1) of sum_i L_d^i(q_(i-1), q_i; gamma_i h)

Source: Hairer, Lubich & Wanner (2006), sec. II.4, V.3; Marsden & West (2001), sec. 2.5.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from orbits.errors import InputError, shown
from orbits.integrators.base import SYMMETRIC, Array, Integrator, padded
from orbits.integrators.composition import chain, substeps
from orbits.integrators.methods import method_tag
from orbits.integrators.stormer_verlet import StormerVerlet
from orbits.lagrangians.base import Lagrangian
from orbits.tableaux import PartitionedTableau
from orbits.tableaux.compositions import Scheme, require_order, scheme, scheme_names

DEFAULTS = {4: "suzuki", 6: "sofroniou-spaletta", 8: "sofroniou-spaletta", 10: "sofroniou-spaletta"}
"""The scheme for a base of order 2 where none is asked for, by the order of the whole; see docs/compositions.md."""

CHAIN_DEFAULTS = {**DEFAULTS, 4: "blanes-moan", 6: "blanes-moan-11"}
"""The same for `StormerVerlet`, whose kicks and drifts may be arranged anew."""


@dataclass(frozen=True)
class Composition(Integrator):
    """A symmetric method raised to a higher order by a chain of its steps, some of them backwards.

    base : a symmetric method: `StormerVerlet`, `Gauss`, `LobattoIIIAB`, ...
    order : of the whole; even, above that of the base. From order 2: 4, 6, 8 and 10
    scheme : "suzuki" and "triple-jump" for any base; "yoshida", "kahan-li", "suzuki-umeno", "tsitouras",
        "sofroniou-spaletta" for bases of order 2; "blanes-moan", kicks and drifts arranged anew, for `StormerVerlet`.
        Which order has which is told by an error for any other name

    Has what its base has: symplectic, symmetric, momentum maps. With `StormerVerlet` it is explicit and costs a force
    evaluation for each substep. Raises InputError for a base that is not symmetric and a scheme that does not fit.
    """

    base: Integrator = field(default_factory=StormerVerlet)
    order: int = 8
    scheme: str | None = None

    name: ClassVar[str] = "composition"
    summary: ClassVar[str] = "steps of a symmetric method composed: variational like the method, order 4 to 10"
    source: ClassVar[str] = (
        "Hairer, Lubich & Wanner (2006), sec. II.4, V.3; Yoshida (1990); Suzuki (1990); Kahan & Li (1997); "
        "Blanes & Moan (2002); Sofroniou & Spaletta (2005)"
    )

    def __post_init__(self) -> None:
        if not isinstance(self.base, Integrator):
            raise InputError(f"Composition needs a method such as orbits.StormerVerlet(), got {shown(self.base)}")
        if isinstance(self.base, Composition):
            raise InputError(f"{self.base.label} is composed already; compose its base, {self.base.base.label}, once")
        if SYMMETRIC not in self.base.declares:
            raise InputError(
                f"{self.base.label} is not symmetric, and these schemes cancel errors of symmetric methods only; use "
                "StormerVerlet(), Gauss(...) or LobattoIIIAB(...)"
            )
        require_order(self.base.order, self.order)
        if self.scheme is None:
            object.__setattr__(self, "scheme", self._default())
        if not isinstance(self.scheme, str):
            raise InputError(f"scheme is {shown(self.scheme)}; expected the name of one, such as 'suzuki', or None")
        object.__setattr__(self, "scheme", self.scheme.lower())
        _ = self._scheme

    def _default(self) -> str:
        best = CHAIN_DEFAULTS if self._chain else DEFAULTS
        return best.get(self.order, "suzuki") if self.base.order == 2 else "suzuki"

    @property
    def _scheme(self) -> Scheme:
        return scheme(self.base.order, self.order, self.scheme or "", splittings=self._chain)

    @property
    def _chain(self) -> bool:
        """Whether the whole is kicks and drifts."""
        return type(self.base) is StormerVerlet

    @property
    def substeps(self) -> int:
        """Steps of the base in one step; for kicks and drifts, the drifts."""
        return len(self._scheme.drifts)

    @property
    def requires(self) -> frozenset[str]:  # type: ignore[override]
        """What the base asks of a Lagrangian."""
        return self.base.requires

    @property
    def declares(self) -> frozenset[str]:  # type: ignore[override]
        """What the base declares."""
        return self.base.declares

    @property
    def variational(self) -> bool:  # type: ignore[override]
        """Whether the base is."""
        return self.base.variational

    @property
    def advance(self) -> Any:
        """The kernel of chains, or that of steps of any method."""
        return chain.advance if self._chain else substeps.advance

    @property
    def advance_particles(self) -> Any:
        """The kernel of chains, or that of steps of any method."""
        return chain.advance_particles if self._chain else substeps.advance_particles

    @property
    def advance_canonical(self) -> Any:
        """The kernel of steps of any method, where the base has one."""
        return None if self.base.advance_canonical is None else substeps.advance_canonical

    @property
    def tableau(self) -> PartitionedTableau:
        """The stages of all substeps, one after the other."""
        return self._scheme.split() if self._chain else self._scheme.composed(self.base.tableau)

    def coefficients(self, h: float) -> Any:
        """Return the kicks and drifts, (2, s + 1); or the tag of the base and its coefficients for each substep."""
        if self._chain:
            kicks, drifts = self._scheme.binary_kicks_and_drifts(h)
            return np.array([kicks, np.append(drifts, 0.0)])
        lengths = self._scheme.binary_steps(h)
        base = self.base
        tag = method_tag(base.advance, base.advance_canonical, base.advance_particles)
        tables = [base.coefficients_after(lengths[i - 1], lengths[i]) for i in range(len(lengths))]
        return tag, np.array(tables), lengths, np.append(0.0, np.cumsum(lengths)[:-1])

    def kicks_and_drifts(self, h: float) -> tuple[Array, Array] | None:
        """Those of a chain; None for steps of another method."""
        if not self._chain:
            return None
        kicks, drifts = self._scheme.binary_kicks_and_drifts(h)
        return np.array(kicks), np.array(drifts)

    def field_shape(self, size: int) -> tuple[int, int]:
        """Positions before the step and after each drift, or the fields of the substeps one after the other."""
        if self._chain:
            return self.substeps + 1, padded(size)
        rows, columns = self.base.field_shape(size)
        return self.substeps * rows, columns

    def memory_rows(self, size: int) -> int:
        """As for the base."""
        return self.base.memory_rows(size)

    @property
    def particle_memory_rows(self) -> int:
        """As for the base."""
        return self.base.particle_memory_rows

    def work_shape(self, size: int) -> tuple[int, int]:
        """One vector of accelerations; or the scratch of the base, after the track of eight particles."""
        if self._chain:
            return 1, padded(size)
        rows, columns = self.base.work_shape(size)
        return 12 + rows, columns

    def canonical_work_shape(self, size: int) -> tuple[int, int]:
        """As for the base."""
        return self.base.canonical_work_shape(size)

    def serves(self, lagrangian: Lagrangian) -> bool:
        """Whether the base can march `lagrangian`."""
        return self.base.serves(lagrangian)

    @classmethod
    def schemes(cls, base: Integrator, order: int) -> list[str]:
        """Return the names of the schemes that raise `base` to `order`."""
        return scheme_names(base.order, order, splittings=type(base) is StormerVerlet)

    @classmethod
    def examples(cls) -> tuple[Composition, ...]:
        """Return Störmer–Verlet composed to order 4, and kicks and drifts of order 6 that begin with a drift."""
        return cls(order=4, scheme="suzuki"), cls(order=6, scheme="blanes-moan")


__all__ = ["Composition"]
