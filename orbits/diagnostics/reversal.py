"""Reversibility: march forwards, flip the velocities, march as many steps again, and compare with the start."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from orbits.checks import whole_number
from orbits.diagnostics.stepping import MOST_STEPS, Bodies, turned

if TYPE_CHECKING:
    from orbits.integrators.base import Integrator


@dataclass(frozen=True)
class Reversal:
    """How far bodies end from where they began: the largest distance of any of them.

    q, v : in the units of positions and velocities
    q_ulps, v_ulps : in units in the last place of the largest |q| and |v| of all bodies
    steps : number of steps forwards, and again backwards
    """

    q: float
    v: float
    q_ulps: float
    v_ulps: float
    steps: int

    @property
    def ulps(self) -> float:
        """The larger of q_ulps and v_ulps."""
        return max(self.q_ulps, self.v_ulps)


def reversibility(
    gm: ArrayLike,
    q: ArrayLike,
    v: ArrayLike,
    integrator: Integrator,
    dt: float,
    steps: int,
    *,
    softening: float = 0.0,
) -> Reversal:
    """March `steps` steps of dt, flip all velocities, march as many again: the identity for a symmetric method.

    gm (n,), q and v (n, 3) : float64 in one system of units; massless particles take part
    dt : step, not 0

    The low parts of the states are kept at the turn, so the difference that remains is the round-off of the steps,
    amplified by the motion. The velocities are flipped, not the step, so that a method that is symmetric but not
    reversible is found out.
    Raises InputError for bodies or steps that cannot be marched, IntegrationError for a step that fails.
    Source: Hairer, Lubich & Wanner (2006), sec. V.1.

        x = system.values
        orbits.diagnostics.reversibility(x.gm, x.q, x.v, orbits.Gauss(stages=8), dt=6.0, steps=1000)
    """
    bodies = Bodies.of(gm, q, v, softening)
    n = whole_number(steps, "steps", most=MOST_STEPS)
    marcher = bodies.marcher(integrator, dt)
    marcher.advance(n)
    turned(marcher)
    marcher.advance(n)
    back_q, back_v = marcher.state()
    off_q = float(np.max(np.linalg.norm(back_q - bodies.q, axis=1)))
    off_v = float(np.max(np.linalg.norm(back_v + bodies.v, axis=1)))
    size_q, size_v = (float(np.max(np.linalg.norm(x, axis=1))) for x in (bodies.q, bodies.v))
    return Reversal(off_q, off_v, _ulps(off_q, size_q), _ulps(off_v, size_v), n)


def _ulps(off: float, size: float) -> float:
    return off / float(np.spacing(size)) if off else 0.0
