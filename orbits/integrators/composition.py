"""Composition: steps gamma_1 h, ..., gamma_s h of a symmetric method, chosen so that their errors cancel.

    Phi_h = phi(gamma_s h) ... phi(gamma_1 h)

With L_d^i the discrete Lagrangian of the method for a step of gamma_i h, the composition is the variational integrator
of

    L_d(q_0, q_s; h) = ext over q_1, ..., q_(s-1) of sum_i L_d^i(q_(i-1), q_i; gamma_i h)

Source: Hairer, Lubich & Wanner (2006), sec. II.4, V.3; Marsden & West (2001), sec. 2.5.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from orbits.discrete.base import DiscreteLagrangian
from orbits.discrete.composed import composed
from orbits.discrete.rotors import kick_rotate_kick
from orbits.errors import InputError, shown
from orbits.integrators.base import SYMMETRIC, Integrator
from orbits.integrators.forms import Array, Form
from orbits.integrators.kicks_and_drifts.chain import Chain
from orbits.integrators.kicks_and_drifts.splitting import Splitting
from orbits.integrators.rigid.rotating import Rotating
from orbits.integrators.stormer_verlet import StormerVerlet
from orbits.lagrangians.base import Lagrangian
from orbits.tableaux import PartitionedTableau
from orbits.tableaux.compositions import Scheme, require_order, scheme, scheme_names

DEFAULTS = {4: "suzuki", 6: "sofroniou-spaletta", 8: "sofroniou-spaletta", 10: "sofroniou-spaletta"}
"""The default scheme for a base of order 2, by the order of the composition; see docs/compositions.md."""

CHAIN_DEFAULTS = {**DEFAULTS, 4: "blanes-moan", 6: "blanes-moan-11"}
"""The same for `StormerVerlet`, whose kicks and drifts may be recombined."""


@dataclass(frozen=True)
class Composition(Integrator):
    """A symmetric method raised to a higher order by a sequence of its steps, some of them backwards.

    base : a symmetric method: `StormerVerlet`, `Gauss`, `LobattoIIIAB`, ...
    order : the order of the composition; even, and above that of the base. From order 2: 4, 6, 8 and 10
    scheme : "suzuki" and "triple-jump" for any base; "yoshida", "kahan-li", "suzuki-umeno", "tsitouras",
        "sofroniou-spaletta" for bases of order 2; "blanes-moan", recombined kicks and drifts, for `StormerVerlet`.
        The error for any other name lists the schemes of an order

    It has the properties of its base: symplectic, symmetric, momentum maps. With `StormerVerlet` it is explicit and
    costs a force evaluation for each substep. Raises InputError for a base that is not symmetric and an unsuitable
    scheme.
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
        form = self.base.second_order
        if form is not None and form.transforms:
            raise InputError(
                f"{self.base.label} marches other coordinates than those seen and cannot be composed; use it with a "
                "corrector, which raises its order"
            )
        require_order(self.base.order, self.order)
        object.__setattr__(self, "order", int(self.order))
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
        """Whether the composition consists of kicks and drifts."""
        return type(self.base) is StormerVerlet

    @property
    def substeps(self) -> int:
        """The number of steps of the base in one step; for kicks and drifts, the number of drifts."""
        return len(self._scheme.drifts)

    @property
    def requires(self) -> frozenset[str]:  # type: ignore[override]
        """The traits that the base requires."""
        return self.base.requires

    @property
    def declares(self) -> frozenset[str]:  # type: ignore[override]
        """The properties that the base declares."""
        return self.base.declares

    @property
    def variational(self) -> bool:  # type: ignore[override]
        """Whether the base is variational."""
        return self.base.variational

    @property
    def looks_for_approaches(self) -> bool:
        """As in runs of the base."""
        return self.base.looks_for_approaches

    @property
    def tableau(self) -> PartitionedTableau:
        """The stages of all substeps in sequence."""
        return self._scheme.split() if self._chain else self._scheme.composed(self.base.tableau)

    @property
    def second_order(self) -> Form | None:
        """A single splitting if the base consists of kicks and drifts, else the sequence of its steps."""
        base = self.base.second_order
        if self._chain:
            return Splitting(self._scheme.binary_kicks_and_drifts, drifts=self.substeps)
        if isinstance(base, Splitting):
            return Splitting(_Joined(base.lengths, self._scheme.binary_steps), drifts=self.substeps * base.drifts)
        return None if base is None else Chain(base, self._scheme.binary_steps, self.substeps)

    @property
    def canonical(self) -> Form | None:
        """The sequence of the base's steps, if it has this form."""
        base = self.base.canonical
        return None if base is None else Chain(base, self._scheme.binary_steps, self.substeps)

    @property
    def constrained(self) -> Form | None:
        """The sequence of the base's steps, if it has this form."""
        base = self.base.constrained
        return None if base is None else Chain(base, self._scheme.binary_steps, self.substeps)

    def form_with(self, forces: int, inner: int = 0) -> Form | None:
        """The sequence of the base's steps, if it has such a form."""
        base = self.base.form_with(forces, inner)
        return None if base is None else Chain(base, self._scheme.binary_steps, self.substeps)

    def form_of_rotors(self, lagrangian: Lagrangian) -> Form | None:
        """A single splitting if the base consists of kicks and drifts, else the sequence of its steps, if any."""
        if self._chain:
            return Rotating.between(lagrangian, self._scheme.binary_kicks_and_drifts)
        base = self.base.form_of_rotors(lagrangian)
        return None if base is None else Chain(base, self._scheme.binary_steps, self.substeps)

    def discrete_lagrangian(self, lagrangian: Lagrangian) -> DiscreteLagrangian | None:
        """The sum of those of the steps; of kicks and drifts, with the kicks of each drift."""
        if self._chain and lagrangian.rotors:
            kicks, drifts = self._scheme.binary_kicks_and_drifts(1.0)
            ends = np.append(np.zeros(len(drifts) - 1), kicks[-1])
            shares = zip(kicks[:-1] / drifts, ends / drifts, strict=True)
            parts = [kick_rotate_kick(lagrangian, before=float(a), after=float(b)) for a, b in shares]
            return composed(parts, lambda h: self._scheme.binary_kicks_and_drifts(h)[1])
        base = self.base.discrete_lagrangian(lagrangian)
        return None if base is None else composed(base, self._scheme.binary_steps)

    def refusal(self, lagrangian: Lagrangian, q: Array, p: Array, dt: float, *, share: float = 1.0) -> str | None:
        """That of the base, for the longest step."""
        longest = float(np.max(np.abs(self._scheme.binary_steps(1.0)))) if not self._chain else 1.0
        return self.base.refusal(lagrangian, q, p, dt, share=share * longest)

    def serves(self, lagrangian: Lagrangian) -> bool:
        """Return whether the base can march `lagrangian`."""
        return self.base.serves(lagrangian)

    @classmethod
    def schemes(cls, base: Integrator, order: int) -> list[str]:
        """Return the names of the schemes that raise `base` to `order`."""
        return scheme_names(base.order, order, splittings=type(base) is StormerVerlet)

    @classmethod
    def examples(cls) -> tuple[Composition, ...]:
        """Return Störmer–Verlet composed to order 4, and kicks and drifts of order 6 that begin with a drift."""
        return cls(order=4, scheme="suzuki"), cls(order=6, scheme="blanes-moan")


@dataclass(frozen=True)
class _Joined:
    """Kicks and drifts of a sequence of steps; the last kick of each step is merged with the first of the next."""

    lengths: Callable[[float], tuple[Array, Array]]
    steps: Callable[[float], Array]

    def __call__(self, h: float) -> tuple[Array, Array]:
        """Return the kicks and drifts of a step of h."""
        parts = [self.lengths(float(x)) for x in self.steps(h)]
        kicks = np.zeros(1)
        for own, _ in parts:
            kicks = np.concatenate([kicks[:-1], [kicks[-1] + own[0]], own[1:]])
        return kicks, np.concatenate([drifts for _, drifts in parts])


__all__ = ["Composition"]
