"""Splittings: sequences of kicks and drifts, the exact flows of the potential and of the kinetic energy.

    v <- v + k_0 g(q);   for i = 1 ... s:   q <- q + d_i v,   v <- v + k_i g(q)

The lengths k and d of a step are data: symplectic Euler, Störmer–Verlet and all its compositions share one kernel. A
flow of length 0 costs nothing, and the force of the last kick is reused for the first kick of the next step.

Source: Hairer, Lubich & Wanner (2006), sec. II.4, II.5; Blanes & Moan (2002).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from orbits.errors import InputError
from orbits.integrators.forms import Array, Form, padded
from orbits.kernels.barrier import accelerate_shared
from orbits.kernels.binding import field
from orbits.kernels.compile import kernel
from orbits.kernels.state import copy, drift, drifted, kick, kicked
from orbits.kernels.steps import OK


@kernel(inline=True)
def begin(method, model, t, h, state, storage):
    """Compute the force of the first kick, which later steps take over from the last kick."""
    kicks, last = method.coefficients[0], method.coefficients.shape[1] - 1
    if kicks[0] != 0.0 and kicks[last] != 0.0:
        accelerate_shared(storage.share, model, state.q, storage.scratch[0])


@kernel(inline=True)
def step(method, model, t, h, state, storage):
    """Take one step; `storage.stages` (s + 1, padded) receives the positions before it and after each drift."""
    kicks, drifts, last = method.coefficients[0], method.coefficients[1], method.coefficients.shape[1] - 1
    q, q_lo, v, v_lo = state
    g, stages, share = storage.scratch[0], storage.stages, storage.share
    start, stop = share.start, share.stop
    evaluations = 0
    copy(q, start, stop, stages[0])
    if kicks[0] != 0.0:
        if kicks[last] == 0.0:
            accelerate_shared(share, model, q, g)
            evaluations += 1
        kick(v, v_lo, kicks[0], g, start, stop)
    for i in range(last):
        drift(q, q_lo, drifts[i], v, v_lo, start, stop)
        copy(q, start, stop, stages[i + 1])
        if kicks[i + 1] != 0.0:
            accelerate_shared(share, model, q, g)
            evaluations += 1
            kick(v, v_lo, kicks[i + 1], g, start, stop)
    return OK, 0, evaluations


@kernel(inline=True)
def begin_particles(method, model, particles, storage):
    """Return the accelerations of the particles, the carry of this method."""
    return field(model.tag, model.parameters, storage.stages[0], particles.x, particles.y, particles.z)


@kernel(inline=True)
def step_particles(method, model, t, h, particles, carry, storage):
    """Take one step of eight particles in the field of the bodies at their positions before it and after each drift."""
    kicks, drifts, last = method.coefficients[0], method.coefficients[1], method.coefficients.shape[1] - 1
    evaluations = 0
    if kicks[0] != 0.0:
        if kicks[last] == 0.0:
            carry = field(model.tag, model.parameters, storage.stages[0], particles.x, particles.y, particles.z)
            evaluations += 1
        particles = kicked(particles, kicks[0], carry)
    for i in range(last):
        particles = drifted(particles, drifts[i])
        if kicks[i + 1] != 0.0:
            carry = field(model.tag, model.parameters, storage.stages[i + 1], particles.x, particles.y, particles.z)
            evaluations += 1
            particles = kicked(particles, kicks[i + 1], carry)
    return particles, carry, OK, evaluations


@kernel(inline=True)
def stretch(method, unit, factor):
    """Write the kicks and drifts of steps `factor` times as long."""
    for i in range(unit.coefficients.shape[1]):
        method.coefficients[0, i] = factor * unit.coefficients[0, i]
        method.coefficients[1, i] = factor * unit.coefficients[1, i]


@dataclass(frozen=True)
class Splitting(Form):
    """A method of kicks and drifts for separable Lagrangians.

    lengths : a function of h, proportional to it, that returns the s + 1 kicks and the s drifts between them
    drifts : s
    """

    lengths: Callable[[float], tuple[Array, Array]]
    drifts: int

    kernels: ClassVar[Mapping[str, Any]] = {
        "begin": begin,
        "step": step,
        "begin_particles": begin_particles,
        "step_particles": step_particles,
        "stretch": stretch,
    }

    @property
    def shared(self) -> bool:
        """True: each thread advances its share of the coordinates."""
        return True

    def coefficients(self, h: float, before: float) -> Array:
        """Return the kicks and the drifts, (2, s + 1), with a last drift of 0. Raises InputError for other numbers."""
        kicks, drifts = self.lengths(h)
        if (len(kicks), len(drifts)) != (self.drifts + 1, self.drifts):
            raise InputError(
                f"Splitting(drifts={self.drifts}) has lengths of {len(kicks)} kicks and {len(drifts)} drifts; expected "
                f"{self.drifts + 1} kicks and the {self.drifts} drifts between them, zeros too"
            )
        return np.array([kicks, np.append(drifts, 0.0)])

    def stages_shape(self, size: int) -> tuple[int, int]:
        """Positions before the step and after each drift."""
        return self.drifts + 1, padded(size)

    def scratch_shape(self, size: int) -> tuple[int, int]:
        """One vector of accelerations."""
        return 1, padded(size)
