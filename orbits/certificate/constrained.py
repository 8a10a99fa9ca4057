"""The measurements of a certificate for a Lagrangian with constraints: the same properties, on the constraints.

States (q, p) satisfy g(q) = 0 and G M^-1 p = 0. A method of Störmer–Verlet's kind has the trapezoidal L_d with
multipliers; a composition has that for each of its substeps.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from orbits import discrete
from orbits.certificate.measuring import DEL_POINTS, EPS, Array, Measured, Problem, ulp_of
from orbits.diagnostics.constrained_motion import motion
from orbits.discrete import Constrained
from orbits.integrators.kicks_and_drifts.chain import Chain
from orbits.lagrangians.constraints import constraint_values, onto_constraints
from orbits.marching.flow import Flow


class Substep(NamedTuple):
    """A compiled step of h from (q0, p0) to (q1, p1), or a substep of one."""

    q0: Array
    p0: Array
    q1: Array
    p1: Array
    h: float


@dataclass(frozen=True, eq=False)
class ConstrainedProblem(Problem):
    """The problem to certify, with constraints."""

    def has_discrete_lagrangian(self) -> bool:
        """The trapezoidal one with multipliers."""
        return True

    @cached_property
    def discrete_lagrangian(self) -> Constrained:
        """That of a substep."""
        return discrete.constrained(discrete.trapezoidal(self.lagrangian))

    @cached_property
    def lengths(self) -> Array:
        """The lengths of the substeps."""
        form = self.integrator.constrained
        return form.lengths(self.dt) if isinstance(form, Chain) else np.array([self.dt])

    def more(self) -> Iterator[tuple[str, Measured]]:
        """The constraints, and the tangency of velocities, along the path, relative to what is added up in them."""
        off = leads = fastest = 0.0
        for q, v in zip(self.path.q, self.path.v, strict=True):
            g, G = constraint_values(self.lagrangian, q)
            size = np.sqrt(np.sum(G * G, axis=1))
            off = max(off, float(np.max(np.abs(g) / size)) / math.sqrt(q @ q))
            leads = max(leads, float(np.max(np.abs(G @ v) / size)))
            fastest = max(fastest, math.sqrt(v @ v))
        # A few roundings in each sum; they are not added up from step to step.
        bound = 4.0 + len(self.q)
        leads, note = leads / max(fastest, 1e-300), f"{len(self.path) - 1} steps"
        yield "constraints", Measured(off / EPS, bound, "x 2^-53", note)
        yield "velocities tangent to them", Measured(leads / EPS, bound, "x 2^-53", note)

    def step_solves_its_equations(self) -> Measured:
        """Compiled steps against independent solutions of the constrained equations, in 2^-53 of the state."""
        worst, count = 0.0, len(self.path) - 1
        for k in range(0, count, max(1, count // 24)):
            q, p = self.path.q[k], self.path.p[k]
            for h in self.lengths:
                q, p = discrete.step(self.discrete_lagrangian, q, p, float(h))
            worst = max(worst, self.apart((self.path.q[k + 1], self.path.p[k + 1]), (q, p)))
        # The independent solution computes momenta from differences of positions, which amplifies their rounding.
        amplified = self.size / (self.momentum_size * float(np.min(np.abs(self.lengths))))
        bound = 64.0 * self._growth(7) + 4.0 * len(self.lengths) * amplified
        return Measured(worst, bound, "x 2^-53", "compiled steps against independent solutions")

    def euler_lagrange(self) -> Measured:
        """The residual of the equations with multipliers, along the constraints, in ulps of D2 L_d."""
        first = [self.discrete_lagrangian.first(s.q0, s.q1, s.h) for s in self._substeps]
        residual = [before[2] + after[1] for before, after in itertools.pairwise(first)]
        worst = self._in_ulps(np.array(residual))
        note = "positions are stored to 2^-53, which their differences amplify"
        return Measured(worst[0], 8.0 * worst[1], "ulp", note)

    def legendre_transforms(self) -> Measured:
        """How far the momenta are from -D1 L_d and D2 L_d along the constraints, in ulps of D2 L_d."""
        residual = []
        for s in self._substeps:
            _, d1, d2 = self.discrete_lagrangian.first(s.q0, s.q1, s.h)
            residual.append([s.p0 + d1, s.p1 - d2])
        worst = self._in_ulps(np.array(residual))
        return Measured(worst[0], 8.0 * worst[1], "ulp", "p = -D1 L_d before, D2 L_d after a step")

    @cached_property
    def _substeps(self) -> list[Substep]:
        """The substeps of the first steps of the path."""
        found: list[Substep] = []
        if len(self.lengths) == 1:
            q, p = self.path.q[: DEL_POINTS + 2], self.path.p[: DEL_POINTS + 2]
            return [Substep(q[k], p[k], q[k + 1], p[k + 1], self.dt) for k in range(len(q) - 1)]
        flows = [Flow(self.lagrangian, self.integrator.base, float(h)) for h in self.lengths]  # type: ignore[attr-defined]
        for k in range(3):
            q, p = self.path.q[k], self.path.p[k]
            for flow in flows:
                x, y = flow.step(q, p)
                found.append(Substep(q, p, x, y, flow.dt))
                q, p = x, y
        return found

    @cached_property
    def _ulps(self) -> list[tuple[float, float]]:
        return [ulp_of(self.discrete_lagrangian.base.jet(s.q0, s.q1, s.h), s.q1) for s in self._substeps]

    def _derivative(self, k: int) -> Array:
        """The derivative of step k for vectors tangent to the constraints, (2d, 2d)."""
        q, p = self.path.q[k], self.path.p[k]
        derivative = np.eye(2 * len(q))
        for h in self.lengths:
            x, y = discrete.step(self.discrete_lagrangian, q, p, float(h))
            derivative = discrete.phase_derivative(self.discrete_lagrangian, q, x, float(h)) @ derivative
            q, p = x, y
        return derivative

    def symplecticity(self) -> Measured:
        """The largest |dx^T (M^T J M - J) dy| of three steps, for unit vectors tangent to the constraints."""
        worst, d = 0.0, len(self.q)
        scale = np.concatenate([self._even_weights, 1.0 / self._even_weights])
        J = discrete.canonical_form(d)
        for k in (0, len(self.path) // 3, 2 * len(self.path) // 3):
            tangents = self.discrete_lagrangian.tangents(self.path.q[k], self.path.p[k])
            basis, _ = np.linalg.qr(scale[:, None] * tangents)
            moved = scale[:, None] * self._derivative(k) / scale @ basis
            defect = float(np.max(np.abs(moved.T @ J @ moved - basis.T @ J @ basis)))
            worst = max(worst, defect / max(1.0, float(np.max(np.abs(moved)))) ** 2)
        bound = 32.0 * EPS * (2 * d) ** 0.5 * len(self.lengths)
        return Measured(worst, bound, "", "exact derivative of the step, on the constraints")

    def _onto(self, q: Array, p: Array) -> tuple[Array, Array]:
        moved = []
        for x, y in zip(q, p, strict=True):
            mass = self.lagrangian.hessians(x, np.zeros_like(x))[2]
            x, w = onto_constraints(self.lagrangian, x, np.linalg.solve(mass, y))
            moved.append((x, mass @ w))
        return np.array([x for x, _ in moved]), np.array([y for _, y in moved])

    def reference(self, steps: int) -> Array:
        """Return q after so many steps, by Gauss collocation of the equations without multipliers."""
        v = self.lagrangian.velocity(self.q, self.p)
        return self.q + motion(self.lagrangian, self.q, v, steps * self.dt, steps)[0]

    @property
    def tells_order_of_discrete_lagrangian(self) -> bool:
        """Whether the method's L_d has no points within a step."""
        return len(self.lengths) == 1

    def true_action(self, q: Array, p: Array, h: float, t: float, pieces: int = 4) -> tuple[float, Array]:
        """Return the same, on the constraints."""
        moved, _, action = motion(self.lagrangian, q, self.lagrangian.velocity(q, p), h, pieces)
        return action, q + moved
