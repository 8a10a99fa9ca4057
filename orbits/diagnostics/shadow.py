"""The shadow Hamiltonian of a variational method: the energy that its steps conserve, from its steps alone.

The points of a discrete trajectory lie on the motion of a modified Lagrangian L~, whose action between two of them is
L_d(q_k, q_{k+1}; h). With S, the sum of these up to t_k, and q as functions of time along that motion, L~ = dS/dt, and

    H~(q, p) = p . dq/dt - dS/dt.

The same holds for the true motion from (q, p), with its action and H. Of the differences of the two, Delta q and
Delta S, which are O(h^r) for a method of order r,

    H~(q, p) = H(q, p) + p . d(Delta q)/dt - d(Delta S)/dt.

These derivatives are those of the polynomial of degree 2k through the values at 2k + 1 consecutive steps,

    dx/dt(t_n) = 1/h sum_j c_j (x_{n+j} - x_{n-j}) + O(h^2k) d^(2k+1)x,   c_j = (-1)^(j+1) k!^2 / (j (k - j)! (k + j)!),

so that the result differs from H~, which is constant but for an exponentially small part, by O(h^(r+2k)). Nothing of
the series of H~ is needed. Only increments of q and S are added up, so that the division by h amplifies no rounding
errors.

Source: Skeel & Hardy (2001) and Engle, Skeel & Drees (2005), for polynomials through the points of Störmer–Verlet and a
variable beta in the place of S; Hairer, Lubich & Wanner (2006), sec. IX.8; for S, Vermeeren (2017).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbits import discrete
from orbits.diagnostics.constrained_motion import motion
from orbits.diagnostics.tangent import plain_step
from orbits.errors import InputError
from orbits.integrators.base import SYMMETRIC, Integrator
from orbits.integrators.composition import Composition
from orbits.integrators.kicks_and_drifts.chain import Chain
from orbits.integrators.kicks_and_drifts.splitting import Splitting
from orbits.lagrangians.base import CONSTRAINED, SEPARABLE, Lagrangian
from orbits.lagrangians.evaluation import gradients, value
from orbits.tableaux import PartitionedTableau, gauss

Array = NDArray[np.float64]

SWEEPS = 100


class Increments(NamedTuple):
    """What a step adds to positions and momenta, (d,), and its action L_d."""

    q: Array
    p: Array
    action: float


Step = Callable[[Array, Array, float], Increments]
"""A step of fixed length from (q, p) at the time t."""


def shadow_energies(
    lagrangian: Lagrangian, integrator: Integrator, h: float, q: Array, p: Array, t: Array, order: int
) -> Array:
    """Return the shadow Hamiltonian of the method's steps of h at n states, (n,), up to O(h^order).

    q, p : (n, d) positions and momenta; t : (n,) their times
    order : even, above that of the method

    From each state, k steps are taken in either direction by a symmetric method; 2k forwards by others, whose values
    belong to the middle of these steps. As many steps follow the true motion.
    """
    if not len(q):
        return np.empty(0)
    k = math.ceil((order - integrator.order) / 2)
    weights, both_ways = central_weights(k), SYMMETRIC in integrator.declares
    forth = _step_of(lagrangian, integrator, h, q[0])
    back = _step_of(lagrangian, integrator, -h, q[0])
    truly = _true_step(lagrangian, integrator, h, q[0]), _true_step(lagrangian, integrator, -h, q[0])
    energies = np.empty(len(q))
    for n, (x, y, now) in enumerate(zip(q, p, t, strict=True)):
        if both_ways:
            one, other = _marched(forth, x, y, float(now), h, k), _marched(back, x, y, float(now), -h, k)
            changes = [a[1:] - b[1:] for a, b in zip(one[:2], other[:2], strict=True)]
        else:
            moved, actions, momenta = _marched(forth, x, y, float(now), h, 2 * k)
            changes = [a[k + 1 :] - a[:k][::-1] for a in (moved, actions)]
            x, y, now = x + moved[k], momenta[k], now + k * h
        one, other = (
            _marched(step, x, y, float(now), way * h, k) for step, way in zip(truly, (1.0, -1.0), strict=True)
        )
        off_q, off_s = (c - (a[1:] - b[1:]) for c, a, b in zip(changes, one[:2], other[:2], strict=True))
        energy = lagrangian.energy(x, lagrangian.velocity(x, y, float(now)), float(now))
        energies[n] = energy + (y @ (weights @ off_q) - weights @ off_s) / h
    return energies


def taken_back(
    lagrangian: Lagrangian, integrator: Integrator, rests: Array, q: Array, p: Array, t: Array
) -> tuple[Array, Array, Array]:
    """Return states (q, p), (n, d) each, before partial steps of the lengths `rests`, (n,), and their times.

    Partial steps are no powers of the step of h, and change its shadow energy by O(h^r). Raises InputError for methods
    that are not symmetric, whose step of -h does not undo one of h.
    """
    q, p, t = q.copy(), p.copy(), t - rests
    if np.any(rests) and SYMMETRIC not in integrator.declares:
        raise InputError(
            f"some of these samples are within a step of {integrator.label}, which is not symmetric and cannot be "
            "taken back. Expected samples at multiples of dt, or a symmetric method."
        )
    for k in np.flatnonzero(rests):
        part = _step_of(lagrangian, integrator, -float(rests[k]), q[k])(q[k], p[k], float(t[k] + rests[k]))
        q[k], p[k] = q[k] + part.q, p[k] + part.p
    return q, p, t


def central_weights(k: int) -> Array:
    """Return c_1 ... c_k of the first derivative from 2k + 1 equidistant values."""
    f = math.factorial
    return np.array([(-1) ** (j + 1) * f(k) ** 2 / (j * f(k - j) * f(k + j)) for j in range(1, k + 1)])


def _marched(step: Step, q: Array, p: Array, t: float, h: float, steps: int) -> tuple[Array, Array, Array]:
    """Return the changes of q, (steps + 1, d), and of S, (steps + 1,), since the start, and the momenta."""
    moved, actions, momenta = [np.zeros_like(q)], [0.0], [p]
    for k in range(steps):
        increments = step(q + moved[-1], momenta[-1], t + k * h)
        moved.append(moved[-1] + increments.q)
        actions.append(actions[-1] + increments.action)
        momenta.append(momenta[-1] + increments.p)
    return np.array(moved), np.array(actions), np.array(momenta)


def _true_step(lagrangian: Lagrangian, integrator: Integrator, h: float, q: Array) -> Step:
    """Return the true motion over h, by Gauss collocation of order 12 or 16 in short steps."""
    low = integrator.order <= 4
    pieces = 1 if low else (2 if integrator.order <= 8 else 4)
    if CONSTRAINED in lagrangian.traits:
        return _ConstrainedMotion(lagrangian, h, pieces)
    lengths = np.full(pieces, h / pieces)
    return _in_sequence([_Stages(lagrangian, gauss(6 if low else 8), h / pieces, q)] * pieces, lengths)


def _step_of(lagrangian: Lagrangian, integrator: Integrator, h: float, q: Array) -> Step:
    """Return the step of the method in NumPy, with its action; q : a configuration."""
    if CONSTRAINED in lagrangian.traits:
        form = integrator.constrained
        lengths = form.lengths(h) if isinstance(form, Chain) else np.array([h])
        L_d = discrete.constrained(discrete.trapezoidal(lagrangian))
        return _in_sequence([_ConstrainedStep(L_d, float(x)) for x in lengths], lengths)
    form = integrator.form(lagrangian)
    if isinstance(form, Splitting):
        return _Splitting(lagrangian, *form.lengths(h), q)
    if isinstance(form, Chain) and isinstance(integrator, Composition):
        lengths = form.lengths(h)
        return _in_sequence([_Stages(lagrangian, integrator.base.tableau, float(x), q) for x in lengths], lengths)
    return _Stages(lagrangian, integrator.tableau, h, q)


def _in_sequence(steps: list[Step], lengths: Array) -> Step:
    """Return the steps one after the other, as one."""

    def whole(q: Array, p: Array, t: float) -> Increments:
        moved, pushed, action = np.zeros_like(q), np.zeros_like(p), 0.0
        for step, h in zip(steps, lengths, strict=True):
            part = step(q + moved, p + pushed, t)
            moved, pushed, action, t = moved + part.q, pushed + part.p, action + part.action, t + float(h)
        return Increments(moved, pushed, action)

    return whole


class _Evaluated:
    """L and dL/dq without checks, for states that are known to be vectors of the right length."""

    def __init__(self, lagrangian: Lagrangian) -> None:
        self.lagrangian = lagrangian

    def value(self, q: Array, v: Array, t: float) -> float:
        """Return L(q, v, t)."""
        L = self.lagrangian
        return value(L.tag, L.parameter_vector, t, L.kernel_order(q), L.kernel_order(v))

    def force(self, q: Array, v: Array, t: float) -> Array:
        """Return dL/dq, (d,)."""
        L = self.lagrangian
        return L.caller_order(gradients(L.tag, L.parameter_vector, t, L.kernel_order(q), L.kernel_order(v))[0])


class _Splitting:
    """Kicks and drifts: S is the sum of those of the flows, -k V(q) and d T(v)."""

    def __init__(self, lagrangian: Lagrangian, kicks: Array, drifts: Array, q: Array) -> None:
        self.at, self.kicks, self.drifts = _Evaluated(lagrangian), kicks, np.append(drifts, 0.0)
        self.rest = np.zeros(lagrangian.dimension)
        self.inverse = np.linalg.inv(lagrangian.hessians(q, self.rest)[2])

    def __call__(self, q: Array, p: Array, t: float) -> Increments:
        moved, pushed, action = np.zeros_like(q), np.zeros_like(p), 0.0
        for kick, drift in zip(self.kicks, self.drifts, strict=True):
            if kick != 0.0:
                pushed = pushed + kick * self.at.force(q + moved, self.rest, t)
                action += kick * self.at.value(q + moved, self.rest, t)
            if drift != 0.0:
                now = p + pushed
                v = self.inverse @ now
                moved = moved + drift * v
                action += 0.5 * drift * float(now @ v)
        return Increments(moved, pushed, action)


class _Stages:
    """A partitioned Runge–Kutta step: S is h sum_i b_i L(Q_i, V_i)."""

    def __init__(self, lagrangian: Lagrangian, tableau: PartitionedTableau, h: float, q: Array) -> None:
        self.lagrangian, self.tableau, self.h, self.at = lagrangian, tableau, h, _Evaluated(lagrangian)
        separable = SEPARABLE in lagrangian.traits
        self.inverse = np.linalg.inv(lagrangian.hessians(q, np.zeros_like(q))[2]) if separable else None

    def __call__(self, q: Array, p: Array, t: float) -> Increments:
        b, c, h = self.tableau.b, self.tableau.c, self.h
        stages = None if self.inverse is None else self._iterated(q, p)
        if stages is None:
            plain = plain_step(self.lagrangian, self.tableau, q, p, h, t)
            stages = plain.Q, plain.V
        Q, V = stages
        states = list(zip(Q, V, t + c * h, strict=True))
        F = np.array([self.at.force(x, w, float(now)) for x, w, now in states])
        action = h * math.fsum(b * [self.at.value(x, w, float(now)) for x, w, now in states])
        return Increments(h * (b @ V), h * (b @ F), action)

    def _iterated(self, q: Array, p: Array) -> tuple[Array, Array] | None:
        """Return (Q, V) of a separable Lagrangian by fixed-point iteration, or None if it does not converge."""
        a, a_bar, h = self.tableau.a, self.tableau.a_bar, self.h
        inverse = np.asarray(self.inverse)
        rest, v = np.zeros_like(q), p @ inverse
        V = v + h * self.tableau.c[:, None] * (self.at.force(q, rest, 0.0) @ inverse)
        last = np.inf
        for _ in range(SWEEPS):
            Q = q + h * (a @ V)
            F = np.array([self.at.force(x, rest, 0.0) for x in Q])
            new = v + h * (a_bar @ F) @ inverse
            size, V = float(np.max(np.abs(new - V))), new
            if size == 0.0 or (size >= 0.5 * last and size <= 1e-12 * float(np.max(np.abs(V)))):
                return q + h * (a @ V), V
            if not np.isfinite(size):
                return None
            last = size
        return None


class _ConstrainedStep:
    """RATTLE, solved by Newton's method; S is its trapezoidal L_d."""

    def __init__(self, L_d: discrete.Constrained, h: float) -> None:
        self.L_d, self.h = L_d, h

    def __call__(self, q: Array, p: Array, t: float) -> Increments:
        x, y = discrete.step(self.L_d, q, p, self.h)
        return Increments(x - q, y - p, self.L_d.value(q, x, self.h))


class _ConstrainedMotion:
    """The true motion with constraints."""

    def __init__(self, lagrangian: Lagrangian, h: float, pieces: int) -> None:
        self.lagrangian, self.h, self.pieces = lagrangian, h, pieces

    def __call__(self, q: Array, p: Array, t: float) -> Increments:
        v = self.lagrangian.velocity(q, p)
        moved, faster, action = motion(self.lagrangian, q, v, self.h, self.pieces)
        return Increments(moved, self.lagrangian.momentum(q + moved, v + faster) - p, action)


def require_shadow(lagrangian: Lagrangian, integrator: Integrator) -> None:
    """Raise InputError, with the reason, if the method's steps conserve no such energy, or none that is known."""
    if not lagrangian.autonomous:
        raise InputError(
            f"'{lagrangian.name}' depends on time, so that neither an energy nor a shadow of it is conserved. Expected "
            "one that does not."
        )
    if integrator.follows_kepler:
        raise InputError(
            f"{integrator.label} is a splitting into Kepler motions, whose discrete Lagrangian is not summed here. "
            "Expected a method of kicks and drifts or of stages: orbits.StormerVerlet(), orbits.Gauss(stages=2), ..."
        )
    if not integrator.variational:
        raise InputError(
            f"{integrator.label} is not symplectic: its steps are no motion of a Hamiltonian, so there is no energy "
            "that they conserve. Expected a variational method, such as orbits.StormerVerlet()."
        )
