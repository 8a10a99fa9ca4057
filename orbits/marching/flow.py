"""The flow of a method on a Lagrangian: its one-step map on positions and momenta, and recorded marches.

`Flow` is the direct interface to an integrator, for any Lagrangian on R^d: states are vectors, momenta are dL/dv.
(`orbits.propagate` marches systems of bodies with massless particles, units and archives.)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NoReturn

import numpy as np
from numpy.typing import ArrayLike, NDArray

from orbits.checks import finite_number, nonzero_number, whole_number
from orbits.discrete.noether import momentum_map
from orbits.errors import InputError, shown
from orbits.integrators import named
from orbits.integrators.base import Integrator
from orbits.integrators.forms import padded
from orbits.kernels.lanes import WIDTH
from orbits.kernels.steps import NO_MULTIPLIERS, NOT_CONVERGED, NOT_REGULAR, OK
from orbits.lagrangians.base import CONSTRAINED, GRADIENTS, SEPARABLE, Lagrangian, show
from orbits.lagrangians.constraints import constraint_values, require_on_constraints
from orbits.lagrangians.symmetry import Symmetry
from orbits.lagrangians.transforming import is_transformed
from orbits.marching.clocks.constant import ConstantSteps
from orbits.marching.stepping import driver
from orbits.marching.stepping.alignment import aligned
from orbits.marching.stepping.choice_of_form import form_for
from orbits.marching.stepping.failures import failure_of_coordinates, last_good

Array = NDArray[np.float64]

PATH_BYTES = 1024 * 1024
"""Size of the states that are recorded in one call of the kernel."""

MOST = 2**53
"""The most steps: those that a float64 counts."""


@dataclass(frozen=True, eq=False, repr=False)
class DiscretePath:
    """A discrete trajectory: positions and discrete momenta at uniform times.

    lagrangian, integrator, dt : the problem, the method and the step
    t : (n,) times of the n samples
    q, p : (n, d) positions and momenta, p = dL/dv
    evaluations : the total number of force evaluations

    All are plain numbers in the Lagrangian's own units, arrays of float64.
    """

    lagrangian: Lagrangian
    integrator: Integrator
    dt: float
    t: Array
    q: Array
    p: Array
    evaluations: int = 0

    def __len__(self) -> int:
        return len(self.t)

    def __repr__(self) -> str:
        return (
            f"DiscretePath({self.lagrangian.name}, {len(self)} samples, t = {self.t[0]:g} ... {self.t[-1]:g}; "
            f"{self.integrator.label}, dt = {self.dt:g})"
        )

    @cached_property
    def v(self) -> Array:
        """Velocities, (n, d), by the inverse Legendre transform of the momenta."""
        return velocities(self.lagrangian, self.t, self.q, self.p)

    def energy(self) -> Array:
        """Return p . v - L at each sample, (n,): the energy, or Jacobi's integral in a rotating frame."""
        states = zip(self.q, self.v, self.t, strict=True)
        return np.array([self.lagrangian.energy(q, v, float(t)) for q, v, t in states])

    def constraint_values(self) -> Array:
        """Return g(q) at each sample, (n, m): 0 but for round-off; m = 0 for a Lagrangian without constraints."""
        if CONSTRAINED not in self.lagrangian.traits:
            return np.zeros((len(self), 0))
        return np.array([constraint_values(self.lagrangian, q)[0] for q in self.q])

    def momentum_map(self, symmetry: Symmetry) -> Array:
        """Return Noether's charge J = p . xi(q, t) - K(q, t) of a symmetry at each sample, (n,).

        Raises InputError if the symmetry does not act on these coordinates.
        """
        return np.asarray(momentum_map(symmetry, self.q, self.p, self.t))


class Flow:
    """The one-step map of `integrator` on `lagrangian` with step dt.

    integrator : a method, or its name as on the command line: "gauss(stages=4)"
    dt : the step, not 0; negative for backwards in time
    t : time of the first step of each call, for Lagrangians that depend on it: where a march goes on, another Flow does
    canonical : use the canonical form even if the faster second-order form is possible

    Raises InputError if the method cannot integrate the Lagrangian.
    """

    def __init__(
        self,
        lagrangian: Lagrangian,
        integrator: Integrator | str,
        dt: float,
        *,
        t: float = 0.0,
        canonical: bool = False,
    ) -> None:
        if not isinstance(lagrangian, Lagrangian):
            raise InputError(f"expected a Lagrangian such as orbits.lagrangians.pendulum, got {shown(lagrangian)}")
        integrator = named(integrator)
        self.lagrangian, self.integrator = lagrangian, integrator
        self.dt, self.t = nonzero_number(dt, "dt"), finite_number(t, "t")
        form = self._form = form_for(integrator, lagrangian, canonical=canonical)
        self._has_canonical = integrator.canonical is not None and GRADIENTS in lagrangian.traits
        self.canonical = canonical or not (integrator.requires <= lagrangian.traits and integrator.second_order)
        self._start: Array = np.zeros(lagrangian.dimension)
        size = lagrangian.dimension
        self._coefficients = form.coefficients(self.dt, self.dt)
        self._carry, self._scratch, self._stages = aligned(
            (form.carry_rows(size), WIDTH), form.scratch_shape(size), (1, *form.stages_shape(size))
        )

    def step(self, q: ArrayLike, p: ArrayLike, steps: int = 1) -> tuple[Array, Array]:
        """Return (q, p), each (d,), after `steps` steps from (q, p). Raises ConvergenceError or SingularityError."""
        path = self.march(q, p, steps, every=steps)
        return path.q[-1], path.p[-1]

    def march(
        self, q: ArrayLike, p: ArrayLike, steps: int, *, every: int = 1, v: ArrayLike | None = None
    ) -> DiscretePath:
        """March from (q, p) and record every `every`-th state, the first included.

        q, p : (d,) positions and momenta; steps : a multiple of `every`
        v : velocities at the start, if known; otherwise they are computed from p
        If the fixed-point iteration of the second-order form does not converge, the march is repeated in canonical
        form, with Newton's method.
        Raises ConvergenceError or SingularityError, with the step and the state, if a step cannot be taken; the error's
        `trajectory` holds the samples before.
        """
        self.lagrangian.tag.check()
        x, y = self.lagrangian.vector(q, "q"), self.lagrangian.vector(p, "p")
        steps, every = whole_number(steps, "steps", most=MOST), whole_number(every, "every", most=MOST)
        if CONSTRAINED in self.lagrangian.traits:
            require_on_constraints(self.lagrangian, x, y, self.dt)
        if steps % every:
            raise InputError(f"steps must be a multiple of every, got {steps} and {every}")
        samples = steps // every
        try:
            out_q, out_p = np.empty((samples + 1, len(x))), np.empty((samples + 1, len(x)))
        except (MemoryError, ValueError, OverflowError):
            raise InputError(
                f"steps / every = {samples:.3g} states of {len(x)} coordinates do not fit into memory; record fewer, "
                "with a larger every."
            ) from None
        out_q[0], out_p[0] = x, y
        if self.canonical:
            known = self.lagrangian.velocity(x, y, self.t) if v is None else self.lagrangian.vector(v, "v")
            self._start = self.lagrangian.kernel_order(known)
        status, done, evaluations = self._record(x, y, every, out_q[1:], out_p[1:])
        if status == NOT_CONVERGED and not self.canonical and self._has_canonical:
            general = Flow(self.lagrangian, self.integrator, self.dt, t=self.t, canonical=True)
            return general.march(x, y, steps, every=every, v=v)
        path = self._path(out_q, out_p, every, evaluations)
        if status != OK:
            self._fail(status, done, x, y, path, every)
        self.lagrangian.require_signs(path.q)
        return path

    def _record(self, q: Array, p: Array, every: int, out_q: Array, out_p: Array) -> tuple[int, int, int]:
        order = self.lagrangian.kernel_order
        mass = None  # the constant mass matrix of a separable Lagrangian; None if p is v
        # Positions and velocities are marched, but momenta are not a constant times those.
        general = not self.canonical and SEPARABLE not in self.lagrangian.traits
        if not self.canonical and not general and GRADIENTS in self.lagrangian.traits:
            mass = self.lagrangian.hessians(q, np.zeros_like(q))[2]
        second = p if mass is None else self.lagrangian.solve_mass(mass, p, q)
        if general:
            second = self.lagrangian.velocity(q, p, self.t)
        state = [_padded(order(q)), _padded(np.zeros_like(q)), _padded(order(second)), _padded(np.zeros_like(p))]
        self._carry[:] = 0.0
        if self.canonical:
            self._form.guess(self._carry, self._start)
        bound = (self._form.tag, self._coefficients, self.lagrangian.tag, self.lagrangian.parameter_vector)
        clock = ConstantSteps(self.dt)
        samples, d, stride = len(out_q), len(q), padded(len(q))
        transforms = self._form.transforms
        room = 1 if transforms else max(1, min(samples, PATH_BYTES // (16 * stride)))
        if transforms:
            self._form.check_start(self.lagrangian.parameter_vector, q.reshape(-1, 3), second.reshape(-1, 3))
            driver.enter_march(*bound, self.dt, *state, self._carry, self._scratch, self._stages)
        path = np.empty((0 if transforms else room, 2, stride))
        evaluations = status = done = 0
        for first in range(0, samples, room):
            count = min(room, samples - first)
            now = clock.numbers(self.t, first * every)
            status, done, _, more = driver.march(
                *bound, clock.timing, now, _NOTHING, *state, self._carry, self._scratch, self._stages,
                path.reshape(-1), _NOTHING, every, _NO_KICKS, count * every,
            )  # fmt: skip
            evaluations += more
            done += first * every
            # Recorded are the states at the beginning of each sample; the first is the last of the block before.
            last = first + count - 1
            if transforms:
                driver.leave_march(*bound, self.dt, *state, self._carry.copy(), self._scratch, self._stages)
            out_q[first:last], out_p[first:last] = path[1:count, 0, :d], path[1:count, 1, :d]
            out_q[last], out_p[last] = state[0][:d], state[2][:d]
            if status != OK:
                break
        out_q[:], out_p[:] = self.lagrangian.caller_order(out_q), self.lagrangian.caller_order(out_p)
        if mass is not None:
            with np.errstate(invalid="ignore"):  # states after a failure are not returned
                out_p[:] = out_p @ mass
        if general:
            for k in range(len(out_q) if status == OK else done // every):
                out_p[k] = self.lagrangian.momentum(out_q[k], out_p[k], self.t)
        return int(status), int(done), int(evaluations)

    def _path(self, q: Array, p: Array, every: int, evaluations: int = 0) -> DiscretePath:
        t: Array = self.t + self.dt * every * np.arange(len(q), dtype=np.float64)
        return DiscretePath(self.lagrangian, self.integrator, self.dt, t, q, p, evaluations)

    def _fail(self, status: int, done: int, q: Array, p: Array, path: DiscretePath, every: int) -> NoReturn:
        if status not in (NOT_CONVERGED, NOT_REGULAR, NO_MULTIPLIERS):
            # Explicit methods are checked only at the end of a march; implicit ones at each step, so `done` is right.
            rest_q, rest_p = np.empty((1, len(q))), np.empty((1, len(q)))
            done = last_good(lambda steps: self._record(q, p, steps, rest_q, rest_p)[0] == OK, done + 1)
        good = done // every + 1
        before = self._path(path.q[:good], path.p[:good], every)
        if done:
            last_q, last_p = np.empty((1, len(q))), np.empty((1, len(q)))
            self._record(q, p, done, last_q, last_p)
            q, p = last_q[0], last_p[0]
        time = self.t + done * self.dt
        transformed = is_transformed(self.lagrangian)
        clock = "tau" if transformed else "t"
        where = (
            f"'{self.lagrangian.name}', step {done + 1} ({clock} = {time:.10g}, d{clock} = {self.dt:.6g}), "
            f"at q = {show(q)}, p = {show(p)}"
        )
        reason = self.integrator.refusal(self.lagrangian, q, p, self.dt) if status == NOT_CONVERGED else None
        error = failure_of_coordinates(
            status,
            done,
            time,
            where,
            self.integrator,
            newton=self._has_canonical,
            transformed=transformed,
            reason=reason,
        )
        error.trajectory = before
        raise error


def march(
    lagrangian: Lagrangian,
    integrator: Integrator | str,
    *,
    dt: float,
    steps: int,
    q: ArrayLike | None = None,
    v: ArrayLike | None = None,
    p: ArrayLike | None = None,
    t: float = 0.0,
    every: int = 1,
) -> DiscretePath:
    """March a Lagrangian on R^d from (q, v) or (q, p) by `steps` steps of dt and record every `every`-th state.

    integrator : a method, or its name as on the command line: "gauss(stages=4)"
    q, v, p : (d,); give either v or p, which is dL/dv(q, v); without q, the Lagrangian's own example
    dt : the step, not 0; negative for backwards in time
    steps, every : whole numbers >= 1; steps must be a multiple of every, and steps/every + 1 states are recorded
    t : time at the start, for Lagrangians that depend on it

    All are plain numbers in the Lagrangian's own units.
    Raises InputError if the method cannot integrate the Lagrangian, or for invalid values; ConvergenceError or
    SingularityError, with the step and the state, if a step cannot be taken: its `trajectory` holds the samples before.

        path = orbits.march(orbits.lagrangians.pendulum, orbits.Gauss(stages=4), q=[1.0], v=[0.0], dt=0.1, steps=1000)
        path.t, path.q, path.p, path.v, path.energy()
    """
    flow = Flow(lagrangian, integrator, dt, t=t)
    known = lagrangian.example.v if q is None and lagrangian.example is not None else v
    q, p = starting_state(lagrangian, q, v, p, t)
    return flow.march(q, p, steps, every=every, v=known)


def starting_state(
    lagrangian: Lagrangian, q: ArrayLike | None, v: ArrayLike | None, p: ArrayLike | None = None, t: float = 0.0
) -> tuple[Array, Array]:
    """Return (q, p) from the arguments of a caller; without any, those of the Lagrangian's example."""
    if q is None:
        if v is not None or p is not None:
            raise InputError(f"'{lagrangian.name}': a start needs q together with v or p; got no q")
        if lagrangian.example is None:
            raise InputError(f"'{lagrangian.name}' has no example of a motion: give its initial state, q and v")
        q, v = lagrangian.example.q, lagrangian.example.v
    elif (v is None) == (p is None):
        raise InputError(
            f"'{lagrangian.name}': a start needs q and either v or p; got {'both' if p is not None else 'q'}"
        )
    x = lagrangian.vector(q, "q")
    if p is not None:
        return x, lagrangian.vector(p, "p")
    w = lagrangian.vector(v if v is not None else [], "v")
    if GRADIENTS not in lagrangian.traits:
        return x, w
    lagrangian.require_regular(x, w, t)
    return x, lagrangian.momentum(x, w, t)


def velocities(lagrangian: Lagrangian, t: Array, q: Array, p: Array) -> Array:
    """Return dq/dt for many states, (n, d)."""
    if GRADIENTS not in lagrangian.traits:
        return p.copy()
    if SEPARABLE in lagrangian.traits:
        mass = lagrangian.hessians(q[0], np.zeros(lagrangian.dimension))[2]
        return np.asarray(np.linalg.solve(mass, p.T).T, dtype=np.float64)
    return np.array([lagrangian.velocity(x, y, float(s)) for x, y, s in zip(q, p, t, strict=True)])


_NOTHING: Array = np.zeros(0)
_NO_KICKS: Array = np.zeros((0, 1, WIDTH))


def _padded(x: Array) -> Array:
    out = np.zeros(padded(len(x)))
    out[: len(x)] = x
    return out


__all__: Sequence[str] = ["DiscretePath", "Flow", "march", "starting_state", "velocities"]
