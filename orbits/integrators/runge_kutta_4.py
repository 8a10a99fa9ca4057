"""The classical fourth-order Runge–Kutta method, the second control.

For q'' = g(q) its four stages are

    Q_1 = q,   Q_2 = q + h/2 v,   Q_3 = q + h/2 v + h^2/4 g_1,   Q_4 = q + h v + h^2/2 g_2,      g_i = g(Q_i)
    q+  = q + h v + h^2/6 (g_1 + g_2 + g_3),     v+ = v + h/6 (g_1 + 2 g_2 + 2 g_3 + g_4)

It has no discrete Lagrangian: it is neither symplectic nor symmetric, and energy and angular momentum drift by O(h^5)
per step.
Source: Kutta (1901); Hairer, Lubich & Wanner (2006), sec. II.1.1.
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
from orbits.kernels.state import copy, drift, drifted, kick, kicked, shifted
from orbits.kernels.steps import OK
from orbits.lagrangians.base import SEPARABLE
from orbits.tableaux import PartitionedTableau, runge_kutta_4


@kernel(inline=True)
def step(method, model, t, h, state, storage):
    """Take one step; `storage.stages` (4, padded) receives the positions of the stages."""
    q, q_lo, v, v_lo = state
    tag, parameters, work, stages = model.tag, model.parameters, storage.scratch, storage.stages
    size = dimension(tag, parameters)
    g1, g2, g3, g4 = work[0], work[1], work[2], work[3]
    Q1, Q2, Q3, Q4 = stages[0], stages[1], stages[2], stages[3]
    copy(q, 0, size, Q1)
    accelerate(tag, parameters, Q1, g1)
    for k in range(size):
        Q2[k] = q[k] + h / 2 * v[k]
    accelerate(tag, parameters, Q2, g2)
    for k in range(size):
        Q3[k] = q[k] + (h / 2 * v[k] + h * h / 4 * g1[k])
    accelerate(tag, parameters, Q3, g3)
    for k in range(size):
        Q4[k] = q[k] + (h * v[k] + h * h / 2 * g2[k])
    accelerate(tag, parameters, Q4, g4)
    drift(q, q_lo, h, v, v_lo, 0, size)
    for k in range(size):
        middle = g2[k] + g3[k]
        g4[k] = g1[k] + 2.0 * middle + g4[k]
        g1[k] += middle
    kick(q, q_lo, h * h / 6, g1, 0, size)
    kick(v, v_lo, h / 6, g4, 0, size)
    return OK, 0, 4


@kernel(inline=True)
def _force(model, sources, particles, half, whole, g):
    """Return the accelerations at the stage q + half v + whole g."""
    return field(
        model.tag,
        model.parameters,
        sources,
        particles.x + (half * particles.vx + whole * g[0]),
        particles.y + (half * particles.vy + whole * g[1]),
        particles.z + (half * particles.vz + whole * g[2]),
    )


@kernel(inline=True)
def step_particles(method, model, t, h, particles, carry, storage):
    """Take one step of eight particles in the field of the bodies' stages."""
    tag, parameters, stages = model.tag, model.parameters, storage.stages
    half = h / 2
    ax, ay, az = field(tag, parameters, stages[0], particles.x, particles.y, particles.z)
    bx, by, bz = field(
        tag,
        parameters,
        stages[1],
        particles.x + half * particles.vx,
        particles.y + half * particles.vy,
        particles.z + half * particles.vz,
    )
    cx, cy, cz = _force(model, stages[2], particles, half, h * h / 4, (ax, ay, az))
    dx, dy, dz = _force(model, stages[3], particles, h, h * h / 2, (bx, by, bz))
    particles = shifted(drifted(particles, h), h * h / 6, (ax + bx + cx, ay + by + cy, az + bz + cz))
    change = (ax + 2.0 * (bx + cx) + dx, ay + 2.0 * (by + cy) + dy, az + 2.0 * (bz + cz) + dz)
    return kicked(particles, h / 6, change), carry, OK, 4


class _FourStages(Form):
    """Four explicit stages."""

    kernels: ClassVar[Mapping[str, Any]] = {
        "step": step,
        "step_particles": step_particles,
        "stretch": keep_coefficients,
    }

    def stages_shape(self, size: int) -> tuple[int, int]:
        """Positions of the four stages."""
        return 4, padded(size)

    def scratch_shape(self, size: int) -> tuple[int, int]:
        """Four vectors of accelerations."""
        return 4, padded(size)


@dataclass(frozen=True)
class RungeKutta4(Integrator):
    """The classical Runge–Kutta method: accurate for a while, then energy and angular momentum drift. A control for
    long runs.
    """

    name: ClassVar[str] = "runge-kutta-4"
    summary: ClassVar[str] = "classical Runge–Kutta: not variational, order 4; a control for long runs"
    requires: ClassVar[frozenset[str]] = frozenset({SEPARABLE})
    declares: ClassVar[frozenset[str]] = frozenset()
    source: ClassVar[str] = "Kutta (1901); Hairer, Lubich & Wanner (2006), sec. II.1.1"

    @property
    def tableau(self) -> PartitionedTableau:
        """Four explicit stages."""
        return runge_kutta_4()

    @property
    def order(self) -> int:
        """Order of convergence: 4."""
        return 4

    @property
    def second_order(self) -> Form:
        """Four accelerations, one after the other."""
        return _FourStages()
