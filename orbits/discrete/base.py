"""Discrete Lagrangians: L_d(q0, q1; h) on Q x Q with its first and second derivatives.

L_d approximates the action of the motion from q0 to q1 in the time h. Its derivatives are the discrete momenta,

    p0 = -D1 L_d(q0, q1; h),      p1 = D2 L_d(q0, q1; h),

and a discrete trajectory is a sequence of points at which the two agree,

    D2 L_d(q_{k-1}, q_k; h) + D1 L_d(q_k, q_{k+1}; h) = 0.

Source: Marsden & West (2001), sec. 1.2, 1.3.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from orbits.checks import finite_number, finite_vector, nonzero_number
from orbits.errors import InputError, SingularityError, shown
from orbits.lagrangians.base import show

Array = NDArray[np.float64]


class Mechanics(Protocol):
    """The methods of a Lagrangian that are used here: `orbits.lagrangians.base.Lagrangian`, or any object like it."""

    @property
    def name(self) -> str:
        """The name, for messages."""
        ...

    @property
    def dimension(self) -> int:
        """Number of coordinates d."""
        ...

    @property
    def parameters(self) -> Mapping[str, float]:
        """Parameters by name."""
        ...

    def vector(self, x: ArrayLike, what: str) -> Array:
        """Return x as a vector of d finite floats; InputError for anything else."""
        ...

    def value(self, q: ArrayLike, v: ArrayLike, t: float = 0.0) -> float:
        """Return L(q, v, t)."""
        ...

    def gradients(self, q: ArrayLike, v: ArrayLike, t: float = 0.0) -> tuple[Array, Array]:
        """Return (dL/dq, dL/dv)."""
        ...

    def hessians(self, q: ArrayLike, v: ArrayLike, t: float = 0.0) -> tuple[Array, Array, Array]:
        """Return (d2L/dq dq, d2L/dq dv, d2L/dv dv); rows of the mixed one belong to q."""
        ...

    def momentum(self, q: ArrayLike, v: ArrayLike, t: float = 0.0) -> Array:
        """Return dL/dv."""
        ...

    def velocity(self, q: ArrayLike, p: ArrayLike, t: float = 0.0) -> Array:
        """Return v with dL/dv = p."""
        ...


class Jet(NamedTuple):
    """L_d at one pair of points: its value, D1 and D2 (d,), and D1D1, D1D2, D2D2 (d, d)."""

    value: float
    d1: Array
    d2: Array
    d11: Array
    d12: Array
    d22: Array


class DiscreteLagrangian(ABC):
    """L_d(q0, q1; h) on Q x Q, Q = R^d, of a Lagrangian that may depend on time.

    name : of the rule that defines it
    lagrangian : the Lagrangian it approximates; None for a closed form made from numbers alone

    q0, q1 : (d,), or (n, 3) for bodies in space; h : step, of either sign; t : time at q0
    Raises InputError for points of another shape, numbers that are not finite and h = 0, SingularityError where L_d is
    not finite, ConvergenceError where the equations of an implicit L_d cannot be solved.
    """

    name: str
    lagrangian: Mechanics | None

    @abstractmethod
    def _first(self, q0: Array, q1: Array, h: float, t: float) -> tuple[float, Array, Array]:
        """Return (L_d, D1, D2); the arguments are already checked."""

    def _second(self, q0: Array, q1: Array, h: float, t: float) -> tuple[Array, Array, Array]:
        """Return (D1D1, D1D2, D2D2); the arguments are already checked. A class has this or `_jet`."""
        jet = self._jet(q0, q1, h, t)
        return jet.d11, jet.d12, jet.d22

    def _jet(self, q0: Array, q1: Array, h: float, t: float) -> Jet:
        return Jet(*self._first(q0, q1, h, t), *self._second(q0, q1, h, t))

    def value(self, q0: ArrayLike, q1: ArrayLike, h: float, t: float = 0.0) -> float:
        """Return L_d(q0, q1; h), an action."""
        return self.first(q0, q1, h, t)[0]

    def d1(self, q0: ArrayLike, q1: ArrayLike, h: float, t: float = 0.0) -> Array:
        """Return D1 L_d = -p0, (d,)."""
        return self.first(q0, q1, h, t)[1]

    def d2(self, q0: ArrayLike, q1: ArrayLike, h: float, t: float = 0.0) -> Array:
        """Return D2 L_d = p1, (d,)."""
        return self.first(q0, q1, h, t)[2]

    def d12(self, q0: ArrayLike, q1: ArrayLike, h: float, t: float = 0.0) -> Array:
        """Return D1D2 L_d, (d, d); rows belong to q0, columns to q1."""
        return self.hessian(q0, q1, h, t)[1]

    def first(self, q0: ArrayLike, q1: ArrayLike, h: float, t: float = 0.0) -> tuple[float, Array, Array]:
        """Return (L_d, D1 L_d, D2 L_d) at the cost of one of them."""
        x0, x1, h, t = self._checked(q0, q1, h, t)
        value, d1, d2 = self._first(x0, x1, h, t)
        self._finite(x0, x1, h, t, value, d1, d2)
        return value, d1, d2

    def hessian(self, q0: ArrayLike, q1: ArrayLike, h: float, t: float = 0.0) -> tuple[Array, Array, Array]:
        """Return (D1D1 L_d, D1D2 L_d, D2D2 L_d), each (d, d)."""
        x0, x1, h, t = self._checked(q0, q1, h, t)
        blocks = self._second(x0, x1, h, t)
        self._finite(x0, x1, h, t, *blocks)
        return blocks

    def jet(self, q0: ArrayLike, q1: ArrayLike, h: float, t: float = 0.0) -> Jet:
        """Return the value with all first and second derivatives."""
        x0, x1, h, t = self._checked(q0, q1, h, t)
        made = self._jet(x0, x1, h, t)
        self._finite(x0, x1, h, t, *made)
        return made

    def vector(self, x: ArrayLike, what: str) -> Array:
        """Return x as a vector of d finite floats; InputError for anything else."""
        if self.lagrangian is not None:
            return self.lagrangian.vector(x, what)
        return finite_vector(x, what)

    def guess(self, q: Array, p: Array, h: float, t: float) -> Array:
        """Return a first guess of the q1 that p leads to, on the straight line."""
        if self.lagrangian is None:
            raise NotImplementedError(f"{self.name}: a closed form without a Lagrangian needs a `guess` of its own")
        moved: Array = q + h * self.lagrangian.velocity(q, p, t)
        return moved

    def _checked(self, q0: ArrayLike, q1: ArrayLike, h: float, t: float) -> tuple[Array, Array, float, float]:
        x0, x1 = self.vector(q0, "q0"), self.vector(q1, "q1")
        if x0.shape != x1.shape:
            raise InputError(f"q0 and q1 must be points of the same space; got {x0.size} and {x1.size} coordinates")
        return x0, x1, time_step(h), finite_number(t, "t")

    def _finite(self, q0: Array, q1: Array, h: float, t: float, *results: float | Array) -> None:
        if not all(np.all(np.isfinite(x)) for x in results):
            raise SingularityError(
                f"{self.name} L_d is not finite between q0 = {show(q0)} and q1 = {show(q1)} with h = {h:.6g}: the "
                "Lagrangian is singular between them. Choose other points or a shorter h.",
                time=t,
            )

    def __repr__(self) -> str:
        return f"<discrete Lagrangian {self.name}>"


def require_mechanics(lagrangian: Mechanics) -> None:
    """Raise InputError unless it is a Lagrangian."""
    if not hasattr(lagrangian, "gradients"):
        raise InputError(f"expected a Lagrangian such as orbits.lagrangians.kepler, got {shown(lagrangian)}")


def time_step(h: float) -> float:
    """Return h, a step of either sign. Raises InputError unless it is one finite number other than zero."""
    return nonzero_number(h, "h")
