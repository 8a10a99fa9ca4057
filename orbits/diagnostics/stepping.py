"""The compiled step of a method on bodies, with all its digits, for reversibility, symplecticity and order.

States are in doubled precision, hi + lo.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from orbits.checks import nonzero_number, number_not_below_zero, real_numbers
from orbits.diagnostics.doubledouble import Floats, Pair, two_sum
from orbits.errors import InputError

if TYPE_CHECKING:
    from orbits.integrators.base import Integrator
    from orbits.lagrangians.terms.base import Summand
    from orbits.marching.legs.leg import Leg


MOST_STEPS = 10**9
"""The most steps that a diagnostic marches."""


@dataclass(frozen=True, eq=False)
class Bodies:
    """Bodies at a time: gm (n,), q and v (n, 3), float64 in one system of units, the softening length, and terms of
    their Lagrangian.
    """

    gm: Floats
    q: Floats
    v: Floats
    softening: float = 0.0
    terms: tuple[Summand, ...] = ()

    @classmethod
    def of(cls, gm: ArrayLike, q: ArrayLike, v: ArrayLike, softening: float = 0.0) -> Bodies:
        """Return checked bodies. Raises InputError for shapes that do not fit and values that are not finite."""
        masses, x, w = np.atleast_1d(real_numbers(gm, "gm")), real_numbers(q, "q"), real_numbers(v, "v")
        for name, array, shape in (("gm", masses, (len(masses),)), ("q", x, (len(masses), 3)), ("v", w, x.shape)):
            if array.shape != shape:
                raise InputError(f"{name} has shape {array.shape}; expected {shape} for {len(masses)} bodies.")
            if not np.isfinite(array).all():
                raise InputError(f"{name} holds values that are not finite; expected finite ones.")
        if not (masses >= 0.0).all() or not (masses > 0.0).any():
            raise InputError(f"gm is {masses}; expected values >= 0, at least one of them > 0.")
        return cls(masses, x, w, number_not_below_zero(softening, "softening"))

    @property
    def massive(self) -> NDArray[np.bool_]:
        """Which bodies have a mass, (n,)."""
        return self.gm > 0.0

    def marcher(self, integrator: Integrator, dt: float) -> Leg:
        """Bind the bodies to a method. Raises InputError for a step or a method that cannot be used."""
        from orbits.integrators import named, registry
        from orbits.lagrangians.newtonian import n_body, newtonian, parameters
        from orbits.marching.legs.leg import Leg

        integrator = named(integrator)
        step = nonzero_number(dt, "dt")
        lagrangian, values = newtonian, parameters(self.gm[self.massive], self.softening)
        if self.terms:
            lagrangian = n_body(self.gm[self.massive], self.softening, self.terms)
            values = lagrangian.parameter_vector
        integrator.check(lagrangian, registry)
        return Leg.of(lagrangian, integrator, values, self.massive, self.q, self.v, step)


def turned(marcher: Leg) -> None:
    """Flip all velocities of a marcher, low parts included, and clear what it carries from earlier steps."""
    checkpoint: dict[str, Floats] = {name: np.asarray(x) for name, x in marcher.checkpoint(seen=True).items()}
    for name in ("v", "v_lo", "particle_v", "particle_v_lo"):
        checkpoint[name] = -checkpoint[name]
    for name in ("memory", "particle_memory"):
        checkpoint[name] = np.zeros_like(checkpoint[name])
    marcher.restore(checkpoint, seen=True)


class StepMap:
    """One step of a method as a map of displacements from a fixed state; low parts are taken in and returned.

    particles : whether the massless particles are displaced, all at once, or the massive bodies
    """

    def __init__(self, bodies: Bodies, integrator: Integrator, dt: float, *, particles: bool) -> None:
        self._marcher = bodies.marcher(integrator, dt)
        start = self._marcher.checkpoint(seen=True)
        self._start: dict[str, Floats] = {name: np.asarray(x) for name, x in start.items()}
        n, self._names = int(np.sum(bodies.massive)), ("q", "v")
        if particles:
            n, self._names = int(np.sum(~bodies.massive)), ("particle_q", "particle_v")
        self._bodies, self._particles = n, particles

    def __call__(self, dq: Floats, dv: Floats) -> Pair:
        """Return the state (2, n, 3) after a step from the start displaced by dq and dv, (n, 3) each."""
        state = dict(self._start)
        for name, moved in zip(self._names, (dq, dv), strict=True):
            hi, lo = state[name].copy(), state[f"{name}_lo"].copy()
            where = self._view(hi)
            exact = two_sum(where, moved.T)
            where[...] = exact.hi
            self._view(lo)[...] += exact.lo
            state[name], state[f"{name}_lo"] = hi, lo
        self._marcher.restore(state, seen=True)
        self._marcher.advance(1)
        after: dict[str, Floats] = {name: np.asarray(x) for name, x in self._marcher.checkpoint(seen=True).items()}
        hi, lo = (np.array([self._view(after[name + part]).T for name in self._names]) for part in ("", "_lo"))
        return Pair(hi, lo)

    def _view(self, array: Floats) -> Floats:
        """Return a view (3, n) of a vector of the state."""
        return array[:, : self._bodies] if self._particles else array[: 3 * self._bodies].reshape(3, self._bodies)


def reach(bodies: Bodies) -> Floats:
    """Return the softened distance of each body from the nearest massive one, (n,): a step is analytic within it."""
    sources = np.flatnonzero(bodies.massive)
    away = np.linalg.norm(bodies.q[:, None] - bodies.q[sources], axis=2)
    away[sources, np.arange(len(sources))] = np.inf
    nearest = np.hypot(away.min(axis=1), bodies.softening)
    size = float(np.max(np.linalg.norm(bodies.q, axis=1))) or 1.0
    return np.where(np.isfinite(nearest), nearest, size)


def march(bodies: Bodies, integrator: Integrator, dt: float, steps: Sequence[int]) -> tuple[Floats, Floats]:
    """Return positions and velocities after each of the increasing numbers of `steps`, (len(steps), n, 3) each."""
    marcher = bodies.marcher(integrator, dt)
    states = []
    for step in steps:
        marcher.advance(int(step) - marcher.step)
        states.append(marcher.state())
    return np.array([q for q, _ in states]), np.array([v for _, v in states])


def march_finely(bodies: Bodies, integrator: Integrator, dt: float, steps: Sequence[int]) -> tuple[Pair, Pair]:
    """Return positions and velocities of massive bodies, with all their digits, at the start and after each of the
    increasing numbers of `steps`: (1 + len(steps), n, 3) each.
    """
    marcher, n = bodies.marcher(integrator, dt), len(bodies.gm)
    if not bodies.massive.all():
        raise InputError(f"gm is {bodies.gm}; expected massive bodies only.")
    states: list[list[Floats]] = []
    for step in (0, *steps):
        marcher.advance(int(step) - marcher.step)
        now = marcher.checkpoint(seen=True)
        arrays = (np.asarray(now[name], dtype=np.float64) for name in ("q", "q_lo", "v", "v_lo"))
        states.append([array[: 3 * n].reshape(3, n).T for array in arrays])
    q, q_lo, v, v_lo = (np.array(each) for each in zip(*states, strict=True))
    return Pair(q, q_lo), Pair(v, v_lo)
