"""One-parameter groups of symmetries, their generators, and their gauge terms.

A group acts on configurations by q -> flow(s, q), flow(0, q) = q; its generator is xi(q) = d/ds flow(s, q) at s = 0. If
the group leaves L unchanged up to a total derivative,

    d/ds L(flow(s, q), d/dt flow(s, q), t) = dK/dt  at s = 0,      K = K(q, t), the gauge term,

Noether's theorem gives the conserved charge J = p . xi(q) - K(q, t). K = 0 is plain invariance: translations and
rotations of a closed system. With K: boosts, whose xi depends on time, translations in uniform fields. If a discrete
Lagrangian changes by K(q1, t1) - K(q0, t0), the discrete theorem conserves p_k . xi(q_k) - K(q_k, t_k) exactly.

Source: Marsden & West (2001), sec. 1.2 and 1.3, for K = 0; Landau & Lifshitz, Mechanics, sec. 2, for total derivatives
and sec. 4 and 8 for boosts.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from orbits import checks
from orbits.errors import InputError, shown

Array = NDArray[np.float64]

NODES = 12
"""Nodes of the quadrature of K along a flow per unit of the group's parameter: exact to round-off for a radian."""


@dataclass(frozen=True)
class Symmetry:
    """A one-parameter group that acts on the configurations of a mechanical system.

    name : for tables
    flow : (s, q) -> q moved by the group, where q has shape (d,)
    generator : q -> xi(q) of shape (d,), the derivative of `flow` at s = 0
    gauge : q -> K(q), a number: L changes by s dK/dt to first order in s; None if L does not change
    timed : whether the three depend on time, as their last argument: flow(s, q, t), generator(q, t),
        gauge(q, t)

    Raises InputError for objects that are not functions of these arguments.
    """

    name: str
    flow: Callable[..., Array]
    generator: Callable[..., Array]
    gauge: Callable[..., float] | None = None
    timed: bool = False

    def __post_init__(self) -> None:
        """Raise InputError for objects that are not functions of these arguments."""
        time = ["t"] * self.timed
        for part, arguments in (("flow", ["s", "q", *time]), ("generator", ["q", *time]), ("gauge", ["q", *time])):
            function = getattr(self, part)
            if function is None and part == "gauge":
                continue
            if not callable(function):
                raise InputError(f"'{self.name}': {part} must be a function, got {shown(function)}")
            try:
                inspect.signature(function).bind(*arguments)
            except TypeError:
                now = f"with timed={self.timed} it is called as {part}({', '.join(arguments)})"
                raise InputError(
                    f"'{self.name}': {part} takes other arguments, {part}{inspect.signature(function)}; {now}. A "
                    "symmetry that depends on time needs timed=True, and t as the last argument of all three."
                ) from None
            except ValueError:
                continue  # compiled elsewhere: its arguments are unknown

    def moved(self, s: float, q: Array, t: float = 0.0) -> Array:
        """Return q moved by the group at the time t, (d,). Raises InputError as `xi`."""
        return self._called("flow", np.shape(q), q, t, s)

    def xi(self, q: Array, t: float = 0.0) -> Array:
        """Return the generator at q and t, (d,). Raises InputError for anything but d finite real numbers."""
        return self._called("generator", np.shape(q), q, t)

    def K(self, q: Array, t: float = 0.0) -> float:
        """Return the gauge term at q and t; 0 without one. Raises InputError for anything but a finite number."""
        return 0.0 if self.gauge is None else float(self._called("gauge", (), q, t))

    def _called(self, part: str, shape: tuple[int, ...], q: Array, t: float, *before: float) -> Array:
        """Return what a function of a user returns at q and t, which may not act on such points."""
        arguments = [*before, q, *([t] if self.timed else [])]
        try:
            found = np.asarray(getattr(self, part)(*arguments))
        except (ValueError, IndexError) as error:
            raise InputError(f"{self.name}: the {part} takes no point of shape {np.shape(q)}: {error}") from error
        if found.shape != shape:
            raise InputError(
                f"{self.name}: the {part} returns shape {found.shape} for a point of shape {np.shape(q)}; expected "
                f"{shape or 'a number'}"
            )
        if found.dtype.kind not in "fiu" or not np.isfinite(found).all():
            raise InputError(f"{self.name}: the {part} is {shown(found)} at q = {shown(q)}; expected finite numbers")
        return found

    def charge(self, q: Array, p: Array, t: float = 0.0) -> float:
        """Return Noether's charge p . xi(q, t) - K(q, t)."""
        return float(p @ self.xi(q, t)) - self.K(q, t)

    def charge_size(self, q: Array, p: Array, t: float = 0.0) -> float:
        """Return the sum of the absolute values of the terms of the charge, the scale of its rounding errors.

        K is one number, and its terms are unknown: each coordinate contributes the change of K when it is doubled.
        """
        size = float(np.sum(np.abs(p * self.xi(q, t))))
        if self.gauge is None:
            return size
        here = self.K(q, t)
        return size + abs(here) + sum(abs(self.K(q + doubled, t) - here) for doubled in np.diag(q))

    def gained(self, s: float, q: Array, t: float = 0.0) -> float:
        """Return K_s, the integral of K along the flow from q: the finite transformation by s changes L by dK_s/dt."""
        if self.gauge is None or s == 0.0:
            return 0.0
        pieces = math.ceil(abs(s))
        x, w = _quadrature()
        at = (np.arange(pieces)[:, None] + x).ravel() * (s / pieces)
        return s / pieces * math.fsum(np.tile(w, pieces) * [self.K(self.moved(u, q, t), t) for u in at])

    def defect(self, q: Array, t: float = 0.0) -> float:
        """Return the error of `generator` as the derivative of `flow` at q, relative to their size.

        By a central difference of eighth order, with an error of about 1e-12.
        """
        q = np.asarray(q, dtype=np.float64)
        step = 0.01
        weights = {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}
        slope = sum(w * (self.moved(m * step, q, t) - self.moved(-m * step, q, t)) for m, w in weights.items()) / step
        xi = self.xi(q, t)
        return float(np.max(np.abs(slope - xi)) / max(np.max(np.abs(xi)), np.max(np.abs(slope)), 1e-300))


@cache
def _quadrature() -> tuple[Array, Array]:
    """Return nodes and weights of Gauss quadrature on [0, 1]."""
    x, w = np.polynomial.legendre.leggauss(NODES)
    return (1.0 + x) / 2.0, w / 2.0


def translation(
    direction: ArrayLike,
    *,
    copies: int = 1,
    name: str = "translation",
    gauge: Callable[..., float] | None = None,
    timed: bool = False,
) -> Symmetry:
    """Return the translation q -> q + s u by one vector u, repeated for each of `copies` bodies.

    direction : (k,), not zero; the configuration is a vector of copies * k coordinates, body after body
    gauge, timed : as for `Symmetry`; for example K(q) = e B y/2 along x in a uniform magnetic field
    """
    u = np.tile(checks.direction(direction, "a translation"), checks.whole_number(copies, "copies"))

    def flow(s: float, q: Array, t: float = 0.0) -> Array:
        moved: Array = q + s * u
        return moved

    def generator(q: Array, t: float = 0.0) -> Array:
        return u.copy()

    return Symmetry(name, flow, generator, gauge, timed)


def boost(direction: ArrayLike, masses: ArrayLike = 1.0, *, name: str = "boost") -> Symmetry:
    """Return the Galilean boost q -> q + s u t of all bodies, with the gauge term K = sum m q . u.

    direction : (k,), not zero; masses : those of the bodies, a number or (n,)
    The configuration is a vector of n * k coordinates, body after body. The charge is -(sum m q - P t) . u: the centre
    of mass moves uniformly.
    """
    m = np.atleast_1d(checks.real_numbers(masses, "masses"))
    if m.ndim != 1 or not np.all(m > 0.0) or not np.all(np.isfinite(m)):
        raise InputError(f"a boost needs the masses of the bodies, finite and positive; got {shown(masses)}")
    u = checks.direction(direction, "a boost")
    everywhere, weighted = np.tile(u, len(m)), np.kron(m, u)

    def flow(s: float, q: Array, t: float) -> Array:
        moved: Array = q + (s * t) * everywhere
        return moved

    def generator(q: Array, t: float) -> Array:
        xi: Array = t * everywhere
        return xi

    return Symmetry(name, flow, generator, lambda q, t: float(weighted @ q), timed=True)


def rotation(axis: ArrayLike | None = None, *, copies: int = 1, name: str = "rotation") -> Symmetry:
    """Return the rotation of every body about an axis through the origin; in the plane without `axis`.

    axis : (3,), not zero, for bodies in space; None for bodies in the plane, with two coordinates each
    The configuration is a vector, body after body. The generator of a body at x is axis x x, |axis| = 1.
    """
    copies = checks.whole_number(copies, "copies")
    if axis is None:
        width, spin = 2, np.array([[0.0, -1.0], [1.0, 0.0]])
    else:
        n = checks.direction(axis, "a rotation", width=3)
        n = n / np.sqrt(n @ n)
        width, spin = 3, np.array([[0.0, -n[2], n[1]], [n[2], 0.0, -n[0]], [-n[1], n[0], 0.0]])

    def flow(s: float, q: Array) -> Array:
        # Rodrigues: exp(s S) = 1 + sin(s) S + (1 - cos(s)) S^2, also in the plane, where S^2 = -1.
        turn = np.eye(width) + np.sin(s) * spin + 2.0 * np.sin(s / 2.0) ** 2 * (spin @ spin)
        moved: Array = (q.reshape(copies, width) @ turn.T).ravel()
        return moved

    def generator(q: Array) -> Array:
        xi: Array = (q.reshape(copies, width) @ spin.T).ravel()
        return xi

    return Symmetry(name, flow, generator)
