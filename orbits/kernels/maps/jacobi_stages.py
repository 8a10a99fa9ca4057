"""Steps of several kicks and Kepler motions in Jacobi coordinates, of planets and of massless particles.

The stages of a step are rows (kick, drift) of its lengths: a kick by the interaction, then Kepler motions. What is
marched stands within the first motion of a step, which is thereby joined to the last one of the step before it.
"""

from __future__ import annotations

from orbits.kernels.compile import kernel
from orbits.kernels.kepler.short_flow import short_increments
from orbits.kernels.lanes import WIDTH, alike, fma, full, load, store
from orbits.kernels.maps.interaction import (
    FORCE,
    ROWS,
    STATE_ROWS,
    interact,
    interact_in,
    interaction,
    kind_of,
    masses_of,
    of_state,
    stay_in_registers,
    write_state,
)
from orbits.kernels.maps.jacobi import advance_planets, finish_velocities, move_centre, show_planets
from orbits.kernels.maps.jacobi_particles import (
    PLAIN,
    Marched,
    drifted_particles,
    kicked_particles,
    table_rows,
    tabulate,
    tabulate_centres,
)
from orbits.kernels.maps.jacobi_particles import interaction as interaction_of_particles
from orbits.kernels.sums.summation import accumulate

KICK, DRIFT = 0, 1
"""Columns of the stages."""


@kernel
def step_in_stages(registers, planets, room, count, stages):
    """Take the stages of a step.

    registers : see `orbits.kernels.maps.interaction.registers_of`
    planets, room : see `orbits.kernels.maps.jacobi`; count : the number of planets; stages : (s, columns)
    """
    if stay_in_registers(registers, room):
        _step_in_registers(kind_of(registers), planets, room, stages)
        return
    for i in range(stages.shape[0]):
        interact(planets, room, count, False)
        _kick_and_drift(planets, room, stages[i, KICK], stages[i, DRIFT])


@kernel
def step_in_stages_among_particles(registers, strength, planets, room, stages, table):
    """The same to the same bits, with a table for particles at each kick."""
    count = strength.shape[0] - 2
    for i in range(stages.shape[0]):
        interact_in(registers, planets, room, count, False)
        tabulate(strength, planets, room, table, i * table_rows(count), PLAIN)
        _kick_and_drift(planets, room, stages[i, KICK], stages[i, DRIFT])


@kernel(inline=True)
def _kick_and_drift(planets, room, kick, drift):
    advance_planets(planets, room, drift, kick)
    finish_velocities(planets, room, 0.0)


@kernel
def _step_in_registers(like, planets, room, stages):
    """The same for planets that fit into as many registers as `like` has, without leaving them."""
    x, y, z = of_state(like, planets, 0)
    u, v, w = of_state(like, planets, 3)
    x_lo, y_lo, z_lo = of_state(like, planets, 6)
    u_lo, v_lo, w_lo = of_state(like, planets, 9)
    masses = masses_of(like, room)
    for i in range(stages.shape[0]):
        kick, h = stages[i, KICK], stages[i, DRIFT]
        force, _, _ = interaction(x, y, z, masses)
        vx, vy, vz = _kicked((u, v, w), kick, force)
        dx, dy, dz, dvx, dvy, dvz = short_increments(x, y, z, vx, vy, vz, masses.attracting, alike(h, like))
        x, x_lo = accumulate(x, x_lo, dx)
        y, y_lo = accumulate(y, y_lo, dy)
        z, z_lo = accumulate(z, z_lo, dz)
        du, dv, dw = _kicked((dvx, dvy, dvz), kick, force)
        u, u_lo = accumulate(u, u_lo, du)
        v, v_lo = accumulate(v, v_lo, dv)
        w, w_lo = accumulate(w, w_lo, dw)
        move_centre(planets, room.shape[0] // ROWS, h)
    write_state(planets, 0, (x, y, z))
    write_state(planets, 3, (u, v, w))
    write_state(planets, 6, (x_lo, y_lo, z_lo))
    write_state(planets, 9, (u_lo, v_lo, w_lo))


@kernel(inline=True)
def _kicked(v, kick, force):
    return fma(kick, force[0], v[0]), fma(kick, force[1], v[1]), fma(kick, force[2], v[2])


@kernel(inline=True)
def _at_the_end(planets, room, copy, drift):
    """Write the planets after Kepler motions of `drift` into `copy`."""
    for row in range(planets.shape[0]):
        store(copy, row, load(planets, row))
    for register in range(room.shape[0] // ROWS):
        for k in range(3):
            store(room, ROWS * register + FORCE + k, full(0.0))
    advance_planets(copy, room, drift, 0.0)
    finish_velocities(copy, room, 0.0)


@kernel
def show_at_the_end(strength, planets, room, copy, drift, q, p):
    """Write the state of the bodies, rounded, after Kepler motions of `drift`; copy : workspace, like `planets`."""
    _at_the_end(planets, room, copy, drift)
    show_planets(strength, copy, room, q, p)


@kernel
def tabulate_the_end(strength, planets, room, copy, drift, table):
    """Write R_i and its velocity after Kepler motions of `drift` into the first table of the stages."""
    _at_the_end(planets, room, copy, drift)
    tabulate_centres(strength, copy, room, table, 0)


@kernel(inline=True)
def particles_in_stages(model, marched, table, stages, rows):
    """Return eight particles after the stages of a step."""
    count = model.parameters.shape[0] - 2
    for i in range(stages.shape[0]):
        g = interaction_of_particles(model, table, i * table_rows(count), 0.0, 0.0, marched, rows)
        marched = _with(marched, g)
        marched, ax, ay, az = drifted_particles(marched, stages[i, DRIFT], stages[i, KICK])
        marched = kicked_particles(marched, (ax, ay, az), 0.0, g)
    return marched


@kernel(inline=True)
def _with(marched, g):
    """Return particles with another g."""
    return Marched(
        marched.x, marched.y, marched.z, marched.x_lo, marched.y_lo, marched.z_lo,
        marched.vx, marched.vy, marched.vz, marched.vx_lo, marched.vy_lo, marched.vz_lo,
        g[0], g[1], g[2], marched.gm, marched.number, marched.common,
    )  # fmt: skip


@kernel(inline=True)
def particles_at_the_end(marched, drift):
    """Return eight particles after Kepler motions of `drift`."""
    zero = full(0.0)
    marched, ax, ay, az = drifted_particles(_with(marched, (zero, zero, zero)), drift, 0.0)
    return kicked_particles(marched, (ax, ay, az), 0.0, (zero, zero, zero))


@kernel(inline=True)
def registers_in(planets):
    """Return the number of registers of the planets."""
    return (planets.shape[0] - 2) // (STATE_ROWS + 1)


@kernel(inline=True)
def room_rows(registers):
    """Return the number of rows of `room`."""
    return ROWS * registers + WIDTH
