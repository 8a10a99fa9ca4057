"""Suris' integrable map of the pendulum, as a discrete Lagrangian.

    q_{k+1} - 2 q_k + q_{k-1} = -4 arg(1 + kappa e^{i q_k}),      kappa = (h omega)^2/4,   omega^2 = g/l

are the discrete Euler-Lagrange equations of the trapezoidal rule for a potential that differs from the pendulum's by
O(h^2): with the moment of inertia I = m l^2,

    L_d(q0, q1; h) = I [(q1 - q0)^2/(2h) - h omega^2 (W(q0) + W(q1))/2],
    W'(q) = arg(1 + kappa e^{iq})/kappa = sin q + O(h^2),      W(q) = Re Li2(-kappa e^{iq})/kappa,

Li2 being the dilogarithm. It approximates the pendulum to order 2, is symmetric, and its map has an integral for all h,

    cos((q1 - q0)/2) + kappa cos((q1 + q0)/2),

so no orbit is chaotic; the standard map (the trapezoidal rule for sin q itself) has islands and chaos.

W is analytic for h omega < 2. At h omega = 2, W' = q/2 jumps at q = pi, and for longer steps arg jumps there by a full
turn: -D1 L_d and D2 L_d do not exist there, although D1D2 L_d = -I/h is regular. Such steps are refused.

Source: Suris (1989), Integrable mappings of the standard type, Functional Analysis and Its Applications 23, 74-76.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from orbits.checks import real_numbers, whole_number
from orbits.discrete.base import Array, DiscreteLagrangian, Mechanics, time_step
from orbits.errors import InputError
from orbits.many_digits import many_digits


@dataclass(frozen=True, eq=False, repr=False)
class Suris(DiscreteLagrangian):
    """Suris' discrete Lagrangian of the pendulum; see `suris`.

    inertia : I = m l^2; omega : the frequency of small swings, sqrt(g/l)
    """

    name: str
    lagrangian: Mechanics
    inertia: float
    omega: float

    def _first(self, q0: Array, q1: Array, h: float, t: float) -> tuple[float, Array, Array]:
        kappa, dq, strength = self._kappa(h), q1 - q0, 0.5 * h * self.omega**2
        potential = _potential(float(q0[0]), kappa) + _potential(float(q1[0]), kappa)
        value = self.inertia * (0.5 * float(dq[0]) ** 2 / h - strength * potential)
        d1 = self.inertia * (-dq / h - strength * _force(q0, kappa))
        d2 = self.inertia * (dq / h - strength * _force(q1, kappa))
        return value, d1, d2

    def _second(self, q0: Array, q1: Array, h: float, t: float) -> tuple[Array, Array, Array]:
        kappa = self._kappa(h)
        own = [
            self.inertia * (1.0 / h - 0.5 * h * self.omega**2 * (np.cos(q) + kappa) / _square(q, kappa))
            for q in (q0, q1)
        ]
        return own[0][:, None], np.array([[-self.inertia / h]]), own[1][:, None]

    def guess(self, q: Array, p: Array, h: float, t: float) -> Array:
        """Return the exact q1 that p leads to, in closed form."""
        moved: Array = q + h * (p / self.inertia - 0.5 * h * self.omega**2 * _force(q, self._kappa(h)))
        return moved

    def march(self, q: ArrayLike, p: ArrayLike, h: float, steps: int) -> tuple[Array, Array]:
        """Return positions and momenta of n orbits, (steps + 1, n) each, by the map in closed form.

        q, p : (n,), the initial state. `step` computes the same map by solving for each next point.
        Raises InputError for shapes that do not fit, values that are not finite, and |h| sqrt(g/l) >= 2.
        """
        h = time_step(h)
        kappa, kick = self._kappa(h), 0.5 * h * self.inertia * self.omega**2
        x, y, steps = real_numbers(q, "q"), real_numbers(p, "p"), whole_number(steps, "steps", least=0)
        if x.ndim != 1 or x.shape != y.shape or not np.all(np.isfinite([x, y])):
            raise InputError(f"q and p must be finite, with one shape (n,); got shapes {x.shape} and {y.shape}")
        path = np.empty((2, steps + 1, x.size))
        path[:, 0] = x, y
        for k in range(steps):
            y = y - kick * _force(x, kappa)
            x = x + h / self.inertia * y
            y = y - kick * _force(x, kappa)
            path[:, k + 1] = x, y
        return path[0], path[1]

    def integral(self, q0: ArrayLike, q1: ArrayLike, h: float) -> Array:
        """Return cos((q1 - q0)/2) + kappa cos((q1 + q0)/2), constant along orbits; q0, q1 : neighbours."""
        before, after = np.asarray(q0, dtype=np.float64), np.asarray(q1, dtype=np.float64)
        kept: Array = np.cos((after - before) / 2) + self._kappa(time_step(h)) * np.cos((after + before) / 2)
        return kept

    def _kappa(self, h: float) -> float:
        if not abs(h) * self.omega < 2.0:
            raise InputError(
                f"{self.name}: h = {h:.6g} is too long. Suris' map has a potential for |h| sqrt(g/l) < 2, here |h| < "
                f"{2.0 / self.omega:.6g}; from there on its force jumps at q = pi. Use a shorter h."
            )
        return (h * self.omega) ** 2 / 4


def suris(pendulum: Mechanics) -> Suris:
    """Return Suris' discrete Lagrangian of `orbits.lagrangians.pendulum`, for any values of its parameters.

    It is of order 2 and symmetric, with an integral for |h| sqrt(g/l) < 2. Raises InputError for another Lagrangian,
    and when it is used with longer steps.
    """
    values = pendulum.parameters
    if pendulum.name != "pendulum" or not {"m", "l", "g"} <= set(values):
        raise InputError(
            f"Suris' map exists for the pendulum only; got '{pendulum.name}'. Pass orbits.lagrangians.pendulum."
        )
    if not (values["m"] > 0.0 and values["l"] > 0.0 and values["g"] > 0.0):
        raise InputError(f"Suris' map needs a pendulum with m, l, g > 0; got {dict(values)}")
    inertia, weight = values["m"] * values["l"] ** 2, values["m"] * values["g"] * values["l"]
    for q, v in ((0.7, 0.3), (2.0, -1.1)):
        f, p = pendulum.gradients([q], [v])
        if abs(f[0] + weight * math.sin(q)) > 1e-12 * weight or abs(p[0] - inertia * v) > 1e-12 * inertia:
            raise InputError(
                f"'{pendulum.name}' is not m l^2 v^2/2 + m g l cos q, for which alone Suris' map exists: at q = {q}, v "
                f"= {v} its dL/dq is {f[0]:.6g}, and p {p[0]:.6g}. Pass orbits.lagrangians.pendulum."
            )
    return Suris("suris", pendulum, inertia, math.sqrt(values["g"] / values["l"]))


def _potential(q: float, kappa: float) -> float:
    """Return W(q), to round-off."""
    import mpmath

    with many_digits(20):
        return float(mpmath.polylog(2, -kappa * mpmath.expj(q)).real / kappa)


def _force(q: Array, kappa: float) -> Array:
    """Return W'(q)."""
    slope: Array = np.arctan2(kappa * np.sin(q), 1.0 + kappa * np.cos(q)) / kappa
    return slope


def _square(q: Array, kappa: float) -> Array:
    """Return |1 + kappa e^{iq}|^2."""
    size: Array = 1.0 + 2.0 * kappa * np.cos(q) + kappa * kappa
    return size
