"""Explicit Euler, a non-symplectic control: q+ = q + h v, v+ = v + h g(q).

It has no discrete Lagrangian: it is neither symplectic nor symmetric, does not conserve angular momentum, and every
orbit spirals outwards.
Source: Hairer, Lubich & Wanner (2006), sec. I.1.1.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from orbits.integrators.base import Integrator
from orbits.integrators.forms import Form, padded
from orbits.kernels.binding import accelerate, dimension, field
from orbits.kernels.compile import kernel
from orbits.kernels.dense import keep_coefficients
from orbits.kernels.state import copy, drift, drifted, kick, kicked
from orbits.kernels.steps import OK
from orbits.lagrangians.base import SEPARABLE
from orbits.tableaux import PartitionedTableau, explicit_euler


@kernel(inline=True)
def step(method, model, t, h, state, storage):
    """Take one step; `storage.stages` (1, padded) receives the positions before it."""
    size, g = dimension(model.tag, model.parameters), storage.scratch[0]
    accelerate(model.tag, model.parameters, state.q, g)
    copy(state.q, 0, size, storage.stages[0])
    drift(state.q, state.q_lo, h, state.p, state.p_lo, 0, size)
    kick(state.p, state.p_lo, h, g, 0, size)
    return OK, 0, 1


@kernel(inline=True)
def step_particles(method, model, t, h, particles, carry, storage):
    """Take one step of eight particles in the field of the bodies at its beginning."""
    g = field(model.tag, model.parameters, storage.stages[0], particles.x, particles.y, particles.z)
    return kicked(drifted(particles, h), h, g), carry, OK, 1


class _Euler(Form):
    """A step of positions and velocities, both from their values before it."""

    kernels: ClassVar[Mapping[str, Any]] = {
        "step": step,
        "step_particles": step_particles,
        "stretch": keep_coefficients,
    }

    def stages_shape(self, size: int) -> tuple[int, int]:
        """Positions before a step."""
        return 1, padded(size)


@dataclass(frozen=True)
class ExplicitEuler(Integrator):
    """A method not to use: order 1, with drifts of energy and angular momentum. It is a control that shows why the
    others exist.
    """

    name: ClassVar[str] = "explicit-euler"
    summary: ClassVar[str] = "explicit Euler: not variational, order 1; a control"
    requires: ClassVar[frozenset[str]] = frozenset({SEPARABLE})
    declares: ClassVar[frozenset[str]] = frozenset()
    source: ClassVar[str] = "Hairer, Lubich & Wanner (2006), sec. I.1.1"

    @property
    def tableau(self) -> PartitionedTableau:
        """One explicit stage."""
        return explicit_euler()

    @property
    def order(self) -> int:
        """Order of convergence: 1."""
        return 1

    @property
    def second_order(self) -> Form:
        """A drift and a kick, independent of each other."""
        return _Euler()
