"""The classical fourth-order Runge–Kutta method, the second foil.

For q'' = g(q) its four stages are

    Q_1 = q,   Q_2 = q + h/2 v,   Q_3 = q + h/2 v + h^2/4 g_1,   Q_4 = q + h v + h^2/2 g_2,      g_i = g(Q_i)
    q+  = q + h v + h^2/6 (g_1 + g_2 + g_3),     v+ = v + h/6 (g_1 + 2 g_2 + 2 g_3 + g_4)

It has no discrete Lagrangian: it is neither symplectic nor symmetric, and energy and angular momentum drift at order
h^5 a step.
Source: Kutta (1901); Hairer, Lubich & Wanner (2006), sec. II.1.1.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from orbits.integrators.base import NOT_FINITE, OK, Integrator, padded
from orbits.kernels.binding import accelerate, dimension, field
from orbits.kernels.compile import kernel
from orbits.kernels.lanes import WIDTH
from orbits.kernels.observing import call_observer
from orbits.kernels.paths import record_particles, record_state
from orbits.kernels.state import all_finite, copy, drift, first_not_finite, kick, load_particles, store_particles
from orbits.kernels.summation import accumulate, add_product
from orbits.lagrangians.base import SEPARABLE
from orbits.tableaux import PartitionedTableau, runge_kutta_4


@kernel
def advance(tag, parameters, coefficients, h, q, q_lo, v, v_lo, memory, work, field_record, path, steps):
    """March the massive bodies by `steps` steps of h; `field_record` (slots, 4, padded) receives the positions of the
    stages.
    """
    size = dimension(tag, parameters)
    g1, g2, g3, g4 = work[0], work[1], work[2], work[3]
    for step in range(steps):
        record_state(path, step, q, v, size)
        slot = step % field_record.shape[0]
        Q1, Q2, Q3, Q4 = field_record[slot, 0], field_record[slot, 1], field_record[slot, 2], field_record[slot, 3]
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
        drift(q, q_lo, h, v, v_lo, size)
        for k in range(size):
            middle = g2[k] + g3[k]
            g4[k] = g1[k] + 2.0 * middle + g4[k]
            g1[k] += middle
        kick(q, q_lo, h * h / 6, g1, size)
        kick(v, v_lo, h / 6, g4, size)
    return (OK if all_finite(q, v, size) else NOT_FINITE), steps, 0, 4 * steps


@kernel
def advance_particles(
    tag,
    parameters,
    coefficients,
    h,
    q,
    q_lo,
    v,
    v_lo,
    memory,
    work,
    field_record,
    steps,
    start,
    stop,
    observer,
    context,
    track,
):
    """March particles start ... stop - 1 in the recorded field, eight in lanes; `start` is a multiple of eight."""
    for p in range(start, stop, WIDTH):
        x, y, z, x_lo, y_lo, z_lo = load_particles(q, q_lo, p)
        vx, vy, vz, vx_lo, vy_lo, vz_lo = load_particles(v, v_lo, p)
        for step in range(steps):
            record_particles(track, step, x, y, z, vx, vy, vz)
            t, s, w = h / 2, h * h / 4, h * h / 2
            ax, ay, az = field(tag, parameters, field_record[step, 0], x, y, z)
            bx, by, bz = field(tag, parameters, field_record[step, 1], x + t * vx, y + t * vy, z + t * vz)
            cx, cy, cz = field(
                tag,
                parameters,
                field_record[step, 2],
                x + (t * vx + s * ax),
                y + (t * vy + s * ay),
                z + (t * vz + s * az),
            )
            dx, dy, dz = field(
                tag,
                parameters,
                field_record[step, 3],
                x + (h * vx + w * bx),
                y + (h * vy + w * by),
                z + (h * vz + w * bz),
            )
            x, x_lo = add_product(x, x_lo, h, vx, vx_lo)
            y, y_lo = add_product(y, y_lo, h, vy, vy_lo)
            z, z_lo = add_product(z, z_lo, h, vz, vz_lo)
            x, x_lo = accumulate(x, x_lo, h * h / 6 * (ax + bx + cx))
            y, y_lo = accumulate(y, y_lo, h * h / 6 * (ay + by + cy))
            z, z_lo = accumulate(z, z_lo, h * h / 6 * (az + bz + cz))
            vx, vx_lo = accumulate(vx, vx_lo, h / 6 * (ax + 2.0 * (bx + cx) + dx))
            vy, vy_lo = accumulate(vy, vy_lo, h / 6 * (ay + 2.0 * (by + cy) + dy))
            vz, vz_lo = accumulate(vz, vz_lo, h / 6 * (az + 2.0 * (bz + cz) + dz))
        store_particles(q, q_lo, p, x, y, z, x_lo, y_lo, z_lo)
        store_particles(v, v_lo, p, vx, vy, vz, vx_lo, vy_lo, vz_lo)
        record_particles(track, steps, x, y, z, vx, vy, vz)
        call_observer(observer, context, track, h, steps, p, stop)
    lost = first_not_finite(q, v, start, stop)
    return (OK if lost < 0 else NOT_FINITE), steps, max(lost, 0), 4 * steps * (stop - start)


@dataclass(frozen=True)
class RungeKutta4(Integrator):
    """The classical Runge–Kutta method: accurate for a while, then energy and angular momentum leave. A foil for long
    runs.
    """

    name: ClassVar[str] = "runge-kutta-4"
    summary: ClassVar[str] = "classical Runge–Kutta: not variational, order 4; the foil for long runs"
    requires: ClassVar[frozenset[str]] = frozenset({SEPARABLE})
    declares: ClassVar[frozenset[str]] = frozenset()
    source: ClassVar[str] = "Kutta (1901); Hairer, Lubich & Wanner (2006), sec. II.1.1"
    advance: ClassVar[Any] = staticmethod(advance)
    advance_particles: ClassVar[Any] = staticmethod(advance_particles)

    @property
    def tableau(self) -> PartitionedTableau:
        """Four stages, nothing implicit."""
        return runge_kutta_4()

    @property
    def order(self) -> int:
        """Order of convergence: 4."""
        return 4

    def field_shape(self, size: int) -> tuple[int, int]:
        """Positions of the four stages."""
        return 4, padded(size)

    def work_shape(self, size: int) -> tuple[int, int]:
        """Four vectors of accelerations."""
        return 4, padded(size)
