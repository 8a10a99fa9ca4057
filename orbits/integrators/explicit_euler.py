"""Explicit Euler, the foil: q+ = q + h v, v+ = v + h g(q).

It has no discrete Lagrangian: it is neither symplectic nor symmetric, keeps no angular momentum, and every orbit
spirals outwards.
Source: Hairer, Lubich & Wanner (2006), sec. I.1.1.
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
from orbits.tableaux import PartitionedTableau, explicit_euler


@kernel
def advance(tag, parameters, coefficients, h, q, q_lo, v, v_lo, memory, work, field_record, path, steps):
    """March the massive bodies by `steps` steps of h; `field_record` (slots, 1, padded) receives the positions before
    each.
    """
    size = dimension(tag, parameters)
    g = work[0]
    for step in range(steps):
        record_state(path, step, q, v, size)
        accelerate(tag, parameters, q, g)
        copy(q, 0, size, field_record[step % field_record.shape[0], 0])
        drift(q, q_lo, h, v, v_lo, size)
        kick(v, v_lo, h, g, size)
    return (OK if all_finite(q, v, size) else NOT_FINITE), steps, 0, steps


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
            ax, ay, az = field(tag, parameters, field_record[step, 0], x, y, z)
            x, x_lo = add_product(x, x_lo, h, vx, vx_lo)
            y, y_lo = add_product(y, y_lo, h, vy, vy_lo)
            z, z_lo = add_product(z, z_lo, h, vz, vz_lo)
            vx, vx_lo = accumulate(vx, vx_lo, h * ax)
            vy, vy_lo = accumulate(vy, vy_lo, h * ay)
            vz, vz_lo = accumulate(vz, vz_lo, h * az)
        store_particles(q, q_lo, p, x, y, z, x_lo, y_lo, z_lo)
        store_particles(v, v_lo, p, vx, vy, vz, vx_lo, vy_lo, vz_lo)
        record_particles(track, steps, x, y, z, vx, vy, vz)
        call_observer(observer, context, track, h, steps, p, stop)
    lost = first_not_finite(q, v, start, stop)
    return (OK if lost < 0 else NOT_FINITE), steps, max(lost, 0), steps * (stop - start)


@dataclass(frozen=True)
class ExplicitEuler(Integrator):
    """The method one should not use: order 1, energy and angular momentum drift. It is here to show why the others
    exist.
    """

    name: ClassVar[str] = "explicit-euler"
    summary: ClassVar[str] = "explicit Euler: not variational, order 1; the foil"
    requires: ClassVar[frozenset[str]] = frozenset({SEPARABLE})
    declares: ClassVar[frozenset[str]] = frozenset()
    source: ClassVar[str] = "Hairer, Lubich & Wanner (2006), sec. I.1.1"
    advance: ClassVar[Any] = staticmethod(advance)
    advance_particles: ClassVar[Any] = staticmethod(advance_particles)

    @property
    def tableau(self) -> PartitionedTableau:
        """One stage, nothing implicit."""
        return explicit_euler()

    @property
    def order(self) -> int:
        """Order of convergence: 1."""
        return 1

    def field_shape(self, size: int) -> tuple[int, int]:
        """Positions before a step."""
        return 1, padded(size)

    def work_shape(self, size: int) -> tuple[int, int]:
        """One vector of accelerations."""
        return 1, padded(size)
