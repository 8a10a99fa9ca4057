"""Störmer–Verlet: the variational integrator of the trapezoidal discrete Lagrangian.

    L_d(q, q+; h) = h/2 [L(q, (q+ - q)/h) + L(q+, (q+ - q)/h)]

For a separable Lagrangian, q'' = g(q), its discrete Euler–Lagrange equations are kick - drift - kick:

    v_half = v + h/2 g(q),     q+ = q + h v_half,     v+ = v_half + h/2 g(q+)

Source: Hairer, Lubich & Wanner (2006), sec. I.1.4; Marsden & West (2001), sec. 2.6.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from orbits.integrators.base import MOMENTUM_MAPS, NOT_FINITE, OK, SYMMETRIC, SYMPLECTIC, Array, Integrator, padded
from orbits.kernels.binding import accelerate, dimension, field
from orbits.kernels.compile import kernel
from orbits.kernels.lanes import WIDTH
from orbits.kernels.observing import call_observer
from orbits.kernels.paths import record_particles, record_state
from orbits.kernels.state import all_finite, copy, drift, first_not_finite, kick, load_particles, store_particles
from orbits.kernels.summation import accumulate, add_product
from orbits.lagrangians.base import SEPARABLE
from orbits.tableaux import PartitionedTableau, lobatto_iiia_iiib


@kernel
def advance(tag, parameters, coefficients, h, q, q_lo, v, v_lo, memory, work, field_record, path, steps):
    """March the massive bodies by `steps` steps of h: half a kick, a drift, half a kick.

    `field_record` (slots, 2, padded) receives the positions before and after each step.
    """
    size = dimension(tag, parameters)
    g = work[0]
    accelerate(tag, parameters, q, g)
    for step in range(steps):
        record_state(path, step, q, v, size)
        record = field_record[step % field_record.shape[0]]
        copy(q, 0, size, record[0])
        kick(v, v_lo, h / 2, g, size)
        drift(q, q_lo, h, v, v_lo, size)
        accelerate(tag, parameters, q, g)
        kick(v, v_lo, h / 2, g, size)
        copy(q, 0, size, record[1])
    return (OK if all_finite(q, v, size) else NOT_FINITE), steps, 0, steps


@kernel(inline=True)
def _kicked(half, ax, ay, az, vx, vy, vz, vx_lo, vy_lo, vz_lo):
    """Return the velocities of eight particles after half a kick."""
    vx, vx_lo = accumulate(vx, vx_lo, half * ax)
    vy, vy_lo = accumulate(vy, vy_lo, half * ay)
    vz, vz_lo = accumulate(vz, vz_lo, half * az)
    return vx, vy, vz, vx_lo, vy_lo, vz_lo


@kernel(inline=True)
def _drifted(h, x, y, z, x_lo, y_lo, z_lo, vx, vy, vz, vx_lo, vy_lo, vz_lo):
    """Return the positions of eight particles after a drift."""
    x, x_lo = add_product(x, x_lo, h, vx, vx_lo)
    y, y_lo = add_product(y, y_lo, h, vy, vy_lo)
    z, z_lo = add_product(z, z_lo, h, vz, vz_lo)
    return x, y, z, x_lo, y_lo, z_lo


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
    """March particles start ... stop - 1 in the recorded field; `start` is a multiple of eight.

    Two registers of eight at a time: while one waits for the end of its kick and drift, the other is busy with forces.
    """
    half = h / 2
    second = track[track.shape[0] // 2 :]
    for p in range(start, stop, 2 * WIDTH):
        P = p + WIDTH if p + WIDTH < stop else p
        x, y, z, x_lo, y_lo, z_lo = load_particles(q, q_lo, p)
        X, Y, Z, X_lo, Y_lo, Z_lo = load_particles(q, q_lo, P)
        vx, vy, vz, vx_lo, vy_lo, vz_lo = load_particles(v, v_lo, p)
        VX, VY, VZ, VX_lo, VY_lo, VZ_lo = load_particles(v, v_lo, P)
        ax, ay, az = field(tag, parameters, field_record[0, 0], x, y, z)
        AX, AY, AZ = field(tag, parameters, field_record[0, 0], X, Y, Z)
        for step in range(steps):
            record_particles(track, step, x, y, z, vx, vy, vz)
            record_particles(second, step, X, Y, Z, VX, VY, VZ)
            vx, vy, vz, vx_lo, vy_lo, vz_lo = _kicked(half, ax, ay, az, vx, vy, vz, vx_lo, vy_lo, vz_lo)
            x, y, z, x_lo, y_lo, z_lo = _drifted(h, x, y, z, x_lo, y_lo, z_lo, vx, vy, vz, vx_lo, vy_lo, vz_lo)
            VX, VY, VZ, VX_lo, VY_lo, VZ_lo = _kicked(half, AX, AY, AZ, VX, VY, VZ, VX_lo, VY_lo, VZ_lo)
            X, Y, Z, X_lo, Y_lo, Z_lo = _drifted(h, X, Y, Z, X_lo, Y_lo, Z_lo, VX, VY, VZ, VX_lo, VY_lo, VZ_lo)
            ax, ay, az = field(tag, parameters, field_record[step, 1], x, y, z)
            vx, vy, vz, vx_lo, vy_lo, vz_lo = _kicked(half, ax, ay, az, vx, vy, vz, vx_lo, vy_lo, vz_lo)
            AX, AY, AZ = field(tag, parameters, field_record[step, 1], X, Y, Z)
            VX, VY, VZ, VX_lo, VY_lo, VZ_lo = _kicked(half, AX, AY, AZ, VX, VY, VZ, VX_lo, VY_lo, VZ_lo)
        store_particles(q, q_lo, p, x, y, z, x_lo, y_lo, z_lo)
        store_particles(v, v_lo, p, vx, vy, vz, vx_lo, vy_lo, vz_lo)
        store_particles(q, q_lo, P, X, Y, Z, X_lo, Y_lo, Z_lo)
        store_particles(v, v_lo, P, VX, VY, VZ, VX_lo, VY_lo, VZ_lo)
        record_particles(track, steps, x, y, z, vx, vy, vz)
        call_observer(observer, context, track, h, steps, p, stop)
        if p < P:
            record_particles(second, steps, X, Y, Z, VX, VY, VZ)
            call_observer(observer, context, second, h, steps, P, stop)
    lost = first_not_finite(q, v, start, stop)
    return (OK if lost < 0 else NOT_FINITE), steps, max(lost, 0), steps * (stop - start)


@dataclass(frozen=True)
class StormerVerlet(Integrator):
    """The explicit second-order workhorse, known in the field as leapfrog.

    One force evaluation a step; symplectic, symmetric, keeps linear and angular momentum to round-off. Its energy
    error is bounded and proportional to dt^2: take some hundreds of steps for the shortest period, or `Gauss` where
    more than a few digits matter.
    """

    name: ClassVar[str] = "stormer-verlet"
    summary: ClassVar[str] = "Störmer–Verlet (leapfrog): variational, explicit, order 2"
    requires: ClassVar[frozenset[str]] = frozenset({SEPARABLE})
    declares: ClassVar[frozenset[str]] = frozenset({SYMPLECTIC, SYMMETRIC, MOMENTUM_MAPS})
    variational: ClassVar[bool] = True
    source: ClassVar[str] = "Hairer, Lubich & Wanner (2006), sec. I.1.4; Marsden & West (2001), sec. 2.6"
    advance: ClassVar[Any] = staticmethod(advance)
    advance_particles: ClassVar[Any] = staticmethod(advance_particles)

    @property
    def tableau(self) -> PartitionedTableau:
        """Lobatto IIIA-IIIB with two stages."""
        return lobatto_iiia_iiib(2)

    @property
    def order(self) -> int:
        """Order of convergence: 2."""
        return 2

    def kicks_and_drifts(self, h: float) -> tuple[Array, Array]:
        """Half a kick, a drift, half a kick."""
        return np.array([h / 2, h / 2]), np.array([h])

    def field_shape(self, size: int) -> tuple[int, int]:
        """Positions before and after a step."""
        return 2, padded(size)

    def work_shape(self, size: int) -> tuple[int, int]:
        """One vector of accelerations."""
        return 1, padded(size)
