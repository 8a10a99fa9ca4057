"""The measurements of a certificate, each on the actual problem: a Lagrangian, a method, a step and an initial state.

Round-off is held to what rounding can do: a bound is a small multiple of 2^-53 times the sizes that are rounded. This
module only measures; what is declared or needed is decided in `certifying.py`.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from orbits import discrete
from orbits.diagnostics import loops
from orbits.diagnostics.symplecticity import symplecticity
from orbits.diagnostics.tangent import PlainStep, plain_step, symplecticity_defect
from orbits.discrete.base import Jet
from orbits.errors import InputError, IntegrationError
from orbits.integrators.base import Integrator
from orbits.integrators.composition import Composition
from orbits.integrators.gauss import Gauss
from orbits.integrators.maps.jacobi_form import outwards
from orbits.lagrangians.base import NEWTONIAN, Lagrangian
from orbits.marching.flow import DiscretePath, Flow

Array = NDArray[np.float64]
EPS = 2.0**-53

STEPS = 200
"""Length of the march on which momentum maps, areas and reversibility are measured."""

LOOP = 0.01
"""The size of the loop of initial conditions, relative to the largest coordinates of the march."""

GROWN = 1e6
"""The factor by which coordinates grow in a march whose steps are too long to be stable."""

DEL_POINTS = 12
"""Number of points of the march at which the equations of L_d are checked."""

ENERGY_STEPS = 4000
"""Length of the march on which the energy is followed."""


@dataclass(frozen=True)
class Measured:
    """A figure, the bound that round-off or the declaration sets, and its unit."""

    value: float
    bound: float
    unit: str = ""
    note: str = ""

    @property
    def holds(self) -> bool:
        """Whether the figure is within its bound."""
        return bool(self.value <= self.bound)


@dataclass(frozen=True, eq=False)
class Problem:
    """The problem to certify: a method with a step on a Lagrangian, from (q, p) at time t."""

    lagrangian: Lagrangian
    integrator: Integrator
    dt: float
    q: Array
    p: Array
    t: float

    @cached_property
    def flow(self) -> Flow:
        """The method's one-step map."""
        return Flow(self.lagrangian, self.integrator, self.dt, t=self.t)

    @cached_property
    def path(self) -> DiscretePath:
        """The first `STEPS` steps, or fewer if the method fails on the way. Raises IntegrationError below ten."""
        for steps in (STEPS, STEPS // 4):
            with contextlib.suppress(IntegrationError):
                return self.flow.march(self.q, self.p, steps)
        return self.flow.march(self.q, self.p, 10)

    @cached_property
    def weights(self) -> Array:
        """Square roots of the masses: w q and p / w are of the same size for all bodies."""
        mass = self.lagrangian.hessians(self.q, self.lagrangian.velocity(self.q, self.p, self.t), self.t)[2]
        weights: Array = np.sqrt(np.abs(np.diag(mass)))
        return np.where(weights > 0.0, weights, 1.0)

    @cached_property
    def size(self) -> float:
        """Largest |w q| along the path."""
        return self._moving(float(np.max(np.abs(self.path.q) * self.weights)), "q")

    @cached_property
    def momentum_size(self) -> float:
        """Largest |p / w| along the path."""
        return self._moving(float(np.max(np.abs(self.path.p) / self.weights)), "p")

    def _moving(self, size: float, what: str) -> float:
        """Return the size of q or p along the path. Raises InputError if it is 0."""
        if size == 0.0:
            raise InputError(
                f"{self.lagrangian.name!r}: {what} stays 0 from this start, and errors are measured relative to it; "
                "expected a motion: give another q and v"
            )
        return size

    def apart(self, one: tuple[Array, Array], other: tuple[Array, Array]) -> float:
        """Return the difference of two states (q, p), in units of 2^-53 of the largest on the path."""
        dq, dp = np.abs(one[0] - other[0]) * self.weights, np.abs(one[1] - other[1]) / self.weights
        return max(float(np.max(dq)) / self.size, float(np.max(dp)) / self.momentum_size) / EPS

    def growth(self, derivative: Array) -> float:
        """Return the largest element of the derivative of a step, as a pure number."""
        return float(np.max(np.abs(derivative * self.scaling)))

    def step_solves_its_equations(self) -> Measured:
        """Compiled steps against independent solutions of the equations of the tableau, or L_d, in 2^-53 of the state.

        The worst of up to 25 steps along the march.
        """
        worst, grown, rounded = 0.0, 1.0, 0.0
        count = len(self.path) - 1
        for k in range(0, count, max(1, count // 24)):
            plain, terms = self._plain(k)
            worst = max(worst, self.apart((self.path.q[k + 1], self.path.p[k + 1]), (plain.q, plain.p)))
            grown = max(grown, self.growth(plain.derivative))
            rounded = max(rounded, float(np.max(terms @ np.abs(plain.q) / self.weights)) / self.momentum_size)
        # The independent solution rounds a few dozen times, amplified by the condition number of the step.
        return Measured(worst, 64.0 * grown + rounded, "x 2^-53", "compiled steps against independent solutions")

    def _plain(self, k: int) -> tuple[PlainStep | discrete.PhaseStep, Array]:
        """An independent solution of the step that follows point k of the path, with its exact derivative; and what the
        rounding of positions does to its momenta, (d, d), where these are derivatives of an L_d.
        """
        q, p, t = self.path.q[k], self.path.p[k], float(self.path.t[k])
        if self._own is not None:
            own = discrete.phase_step(self._own, q, p, self.dt, t)
            return own, own.terms
        tableau = (Gauss() if self.integrator.follows_kepler else self.integrator).tableau
        return plain_step(self.lagrangian, tableau, q, p, self.dt, t), np.zeros((len(q), len(q)))

    @cached_property
    def _own(self) -> discrete.DiscreteLagrangian | None:
        """The discrete Lagrangian of a method that has one but no tableau."""
        return self.integrator.discrete_lagrangian(self.lagrangian)

    @property
    def scaling(self) -> Array:
        """What makes derivatives of a step by q and p pure numbers, (2d, 2d)."""
        scale = np.concatenate([self.weights / self.size, 1.0 / (self.weights * self.momentum_size)])
        scaled: Array = scale[:, None] / scale[None, :]
        return scaled

    def has_discrete_lagrangian(self) -> bool:
        """Whether the method's tableau is a symplectic pair, and so has an L_d, or it has an L_d of its own."""
        if self.integrator.follows_kepler:
            return self.integrator.variational and NEWTONIAN in self.lagrangian.traits
        if self._own is not None:
            return True
        tableau = self.integrator.tableau
        defect = tableau.b[:, None] * tableau.a_bar + (tableau.b[:, None] * tableau.a).T
        return bool(np.max(np.abs(defect - np.outer(tableau.b, tableau.b))) < 1e-14)

    def euler_lagrange(self) -> Measured:
        """The DEL residual along the path with the method's own L_d, in ulps of D2 L_d."""
        q = self.path.q[: DEL_POINTS + 2]
        residual = discrete.euler_lagrange_residual(self.discrete_lagrangian, q, self.dt, self.t)
        worst = self._in_ulps(residual)
        # The equations of L_d are solved in float64 as well, stage by stage, which adds several times as much, and at
        # the ends of substeps of a composition at random.
        substeps = self.integrator.substeps if isinstance(self.integrator, Composition) else 1
        note = "positions are stored to 2^-53, which their differences amplify"
        return Measured(worst[0], 8.0 * math.sqrt(substeps) * worst[1], "ulp", note)

    def legendre_transforms(self) -> Measured:
        """How far the step's own momenta are from -D1 L_d and D2 L_d at its ends, in ulps of D2 L_d.

        If they agree, the step is the map of this L_d, and not of one that differs from it by f(q1) - f(q0).
        """
        q, p = self.path.q[: DEL_POINTS + 1], self.path.p[: DEL_POINTS + 1]
        residual = discrete.momentum_residual(self.discrete_lagrangian, q, p, self.dt, self.t)
        worst = self._in_ulps(residual)
        return Measured(worst[0], 8.0 * worst[1], "ulp", "p = -D1 L_d before, D2 L_d after a step")

    @cached_property
    def discrete_lagrangian(self) -> discrete.DiscreteLagrangian:
        """The method's own discrete Lagrangian."""
        if self.integrator.follows_kepler:
            v = self.lagrangian.velocity(self.q, self.p, self.t)
            order = outwards(self._gm, self.q.reshape(-1, 3), v.reshape(-1, 3))
            return discrete.kepler_splitting(self.lagrangian, order)
        if self._own is not None:
            return self._own
        return discrete.vprk(self.lagrangian, self.integrator.tableau)

    def _in_ulps(self, residual: Array) -> tuple[float, float]:
        """The residual that exceeds rounding the most, and what rounding can do there, both in ulps of D2 L_d."""
        worst, noise = 0.0, 1.0
        for r, (ulp, here) in zip(residual, self._ulps, strict=False):
            missed = float(np.max(np.abs(r))) / ulp
            if missed / here > worst / noise:
                worst, noise = missed, here
        return worst, noise

    @cached_property
    def _ulps(self) -> list[tuple[float, float]]:
        """For each of the first steps: the ulp of D2 L_d, and how many of them rounding can produce."""
        q, h, L_d = self.path.q[: DEL_POINTS + 1], self.dt, self.discrete_lagrangian
        return [ulp_of(L_d.jet(q[k], q[k + 1], h, self.t + k * h), q[k + 1]) for k in range(len(q) - 1)]

    def momentum_maps(self) -> Iterator[tuple[str, Measured]]:
        """The largest change of each symmetry's momentum map along the path, relative to the sum of its terms."""
        for symmetry in self.lagrangian.symmetries:
            charge = self.path.momentum_map(symmetry)
            states = zip(self.path.q, self.path.p, self.path.t, strict=True)
            scale = max(symmetry.charge_size(q, p, float(t)) for q, p, t in states)
            drift = float(np.max(np.abs(charge - charge[0]))) / scale if scale > 0.0 else 0.0
            # Rounding is a random walk with steps of half an ulp of each term.
            yield symmetry.name, Measured(drift, 4.0 * EPS * math.sqrt(len(self.path)), "relative")

    def symplecticity(self) -> Measured:
        """The largest |M^T J M - J| of three steps, M being the exact derivative of a step; for a method without a
        tableau, of the step from the start, by differences.
        """
        worst = 0.0
        if self.integrator.follows_kepler:
            v = self.lagrangian.velocity(self.q, self.p, self.t).reshape(-1, 3)
            terms = getattr(self.lagrangian, "summands", ())
            found = symplecticity(self._gm, self.q.reshape(-1, 3), v, self.integrator, self.dt, terms=terms)
            bound = 32.0 * EPS * (2 * len(self.q)) ** 0.5 + 4.0 * found.noise
            return Measured(found.massive, bound, "", "derivative of the step by differences")
        bound, weights, cancelled = 32.0 * EPS * (2 * len(self.q)) ** 0.5, self._even_weights, 0.0
        for k in (0, len(self.path) // 3, 2 * len(self.path) // 3):
            plain, terms = self._plain(k)
            worst = max(worst, symplecticity_defect(plain.derivative, weights))
            # Second derivatives of L_d are 1/h times those of the map; what cancels is divided as the defect is.
            largest = max(1.0, self.growth(plain.derivative))
            cancelled = max(cancelled, float(np.max(terms / np.outer(weights, weights))) / largest)
        note = "exact derivative of the tableau's step" if self._own is None else "exact derivative of the map of L_d"
        return Measured(worst, bound + 4.0 * EPS * cancelled, "", note)

    @property
    def _gm(self) -> Array:
        return np.array([x for name, x in self.lagrangian.parameters.items() if name.startswith("GM")])

    @property
    def _even_weights(self) -> Array:
        return self.weights * math.sqrt(self.momentum_size / self.size)

    def areas(self) -> Measured:
        """The relative change of the area of a loop of initial conditions under the method.

        The motion shears the loop; if its points no longer resolve it, or some of them cannot be marched, the march is
        repeated over a shorter time, and at last of a smaller loop. In steps so long that the motion grows without
        bound, the loop is about the size of its first states.
        """
        seen = len(self.path) if np.max(np.abs(self.path.q)) < GROWN * np.max(np.abs(self.path.q[:4])) else 4
        for steps in (STEPS // 4, STEPS // 16, 2):
            with contextlib.suppress(IntegrationError):
                measured = self._area(steps, LOOP, seen)
                if measured.bound < 1e-9:
                    return measured
        return self._area(2, 0.1 * LOOP, seen)

    def _area(self, steps: int, part: float, seen: int) -> Measured:
        rng = np.random.default_rng(7)
        u = rng.normal(size=len(self.q))
        u /= np.sqrt(u @ u)
        q, v, p = (np.max(np.abs(x[:seen]), axis=0) for x in (self.path.q, self.path.v, self.path.p))
        # A coordinate at rest gets a thousandth of the largest, a momentum that of its own mass at the largest speed.
        least = 1e-3 * np.max(v) * self.weights**2
        dq, dp = part * np.maximum(q, 1e-3 * np.max(q)) * u, part * np.maximum(p, least) * u
        start = self._onto(*loops.loop(self.q, self.p, dq, dp, 128))
        before = loops.area(*start)
        moved = loops.marched(lambda x, y: self.flow.step(x, y, steps), *start)
        after = loops.area(*moved)
        # The truncation error of the moved loop's Fourier series is estimated by its highest quarter of frequencies.
        spread_q, spread_p = (np.max(np.abs(x - x.mean(axis=0)), axis=0) for x in moved)
        tail = float(np.sum(_tail(moved[0]) * spread_p + _tail(moved[1]) * spread_q))
        felt = np.sum(np.max(np.abs(moved[0]), axis=0) * spread_p + np.max(np.abs(moved[1]), axis=0) * spread_q)
        noise = 4.0 * EPS * float(felt) * math.sqrt(steps) + 4.0 * tail
        return Measured(
            abs(after - before) / abs(before), noise / abs(before), "relative", f"{steps} steps, 128 points"
        )

    def _onto(self, q: Array, p: Array) -> tuple[Array, Array]:
        """Return states, (n, d) each, that the method can start from."""
        return q, p

    def more(self) -> Iterator[tuple[str, Measured]]:
        """Properties that not every problem has."""
        return iter(())

    def reversibility(self, steps: int = 7) -> Measured:
        """The difference from the start after `steps` steps and as many back, in units of 2^-53 of the state."""
        q, p = self.path.q[steps], self.path.p[steps]
        back = Flow(self.lagrangian, self.integrator, -self.dt, t=self.t + steps * self.dt)
        off = self.apart(back.step(q, p, steps), (self.q, self.p))
        # The low parts are dropped at the turn; the motion amplifies that rounding by at most this much.
        return Measured(off, 8.0 * steps * self._growth(steps), "x 2^-53")

    def _growth(self, steps: int) -> float:
        """The largest element of the derivatives of the first steps, at least 1."""
        return max(1.0, *(self.growth(self._derivative(k)) for k in range(min(steps, len(self.path)))))

    def _derivative(self, k: int) -> Array:
        """The exact derivative of step k."""
        return self._plain(k)[0].derivative

    def energy(self) -> Measured:
        """The drift of the energy error over its oscillation; well below 1 if the error is bounded.

        Raises IntegrationError if the method fails on the way.
        """
        path = self.flow.march(self.q, self.p, ENERGY_STEPS, every=ENERGY_STEPS // 400)
        E = path.energy()
        quarter = len(E) // 4
        oscillation = max(_oscillation(part) for part in (E[:quarter], E[-quarter:]))
        v = path.v
        kinetic = float(np.max(np.abs(np.sum(path.p * v, axis=1))))
        noise = 16.0 * EPS * (kinetic + float(np.max(np.abs(E)))) * math.sqrt(ENERGY_STEPS)
        drift = abs(float(np.mean(E[-quarter:]) - np.mean(E[:quarter])))
        return Measured(drift / max(oscillation, noise), 0.5, "of its oscillation", f"{ENERGY_STEPS} steps")

    def reference(self, steps: int) -> Array:
        """Return q after so many steps, by short steps of Gauss collocation of order 16."""
        return Flow(self.lagrangian, Gauss(stages=8), self.dt / 16, t=self.t).step(self.q, self.p, 16 * steps)[0]

    @property
    def tells_order_of_discrete_lagrangian(self) -> bool:
        """Whether L_d can be compared with the exact one."""
        return self.has_discrete_lagrangian()

    def true_action(self, q: Array, p: Array, h: float, t: float, pieces: int = 4) -> tuple[float, Array]:
        """Return the action of the true motion from (q, p) over the time h, and its end point; by Gauss of order 16."""
        tableau = Gauss(stages=8).tableau
        small, action = h / pieces, []
        for k in range(pieces):
            start = t + k * small
            step = plain_step(self.lagrangian, tableau, q, p, small, start)
            stages = zip(tableau.b, tableau.c, step.Q, step.V, strict=True)
            action += [b * small * self.lagrangian.value(Q, V, start + c * small) for b, c, Q, V in stages]
            q, p = step.q, step.p
        return math.fsum(action), q


def ulp_of(jet: Jet, q: Array) -> tuple[float, float]:
    """Return the ulp of D2 L_d, of its derivatives up to q, and how many of them rounding can produce."""
    # Stored positions are rounded by 2^-53 |q|, which enters D2 L_d through its second derivatives.
    felt = (np.abs(jet.d12) + np.abs(jet.d22)) @ np.abs(q)
    ulp = float(np.spacing(np.max(np.abs(jet.d2))))
    return ulp, 4.0 * EPS * float(np.max(felt)) / ulp + 4.0


def _oscillation(values: Array) -> float:
    """Return the peak-to-peak range of values about the straight line fitted to them."""
    x = np.arange(len(values), dtype=np.float64)
    return float(np.ptp(values - np.polyval(np.polyfit(x, values, 1), x)))


def _tail(points: Array) -> Array:
    """Largest Fourier amplitude of the highest quarter of frequencies of a closed curve (n, d), by coordinate."""
    n = len(points)
    amplitudes: Array = np.abs(np.fft.fft(points - points.mean(axis=0), axis=0)) / n
    highest = amplitudes[n // 2 - n // 8 : n // 2 + n // 8]
    largest: Array = highest.max(axis=0)
    return largest
