"""The flow of terms of the dominant body for massless particles among planets in Jacobi coordinates; see
`orbits.kernels.maps.terms_of_dominant`, and `orbits.kernels.maps.jacobi_particles`.
"""

from __future__ import annotations

from orbits.kernels.binding import plus
from orbits.kernels.compile import kernel
from orbits.kernels.compile.verbs import verb
from orbits.kernels.lanes import WIDTH
from orbits.kernels.maps.jacobi_particles import on_orbits, present, store_marched, take_particles
from orbits.kernels.maps.jacobi_tables import flow_rows, of_places
from orbits.kernels.maps.orbits import displaced, kicked
from orbits.kernels.maps.terms_by_kind import depends_on_velocities, strength_of
from orbits.kernels.maps.terms_of_dominant import particle_rates
from orbits.kernels.maps.threes import chosen, load_three, minus, times
from orbits.kernels.search.context import flat


@verb
def flowing_particles(model, table, first, marched, rows, h):
    """Return particles after h in the flow of terms that depend on velocities."""
    if not depends_on_velocities(model):
        return lambda model, table, first, marched, rows, h: marched
    return lambda model, table, first, marched, rows, h: _flowing(model, table, first, marched, rows, h)


@kernel(inline=True)
def _flowing(model, table, first, marched, rows, h):
    r, v = _rates(model, table, first, marched, rows, 0.5 * h, True)
    return on_orbits(marched, kicked(displaced(marched.orbits, times(h, r)), times(h, v)))


@kernel(inline=True)
def _rates(model, table, first, marched, rows, half, known):
    """Return the rates of r' and of its velocity in the flow of terms; 0 in lanes without a particle."""
    line, orbits, nothing = flat(table), marched.orbits, (0.0, 0.0, 0.0)
    offset, motion = of_places(line, first, 0, marched.number, marched.common, rows)
    drift, pull = of_places(line, first, 1, marched.number, marched.common, rows)
    at, there = WIDTH * (first + 1), marched.gm > 0.0
    central = load_three(line, at), load_three(line, at + 3)
    u, w = plus(orbits.place, offset), plus(orbits.velocity, motion)
    r, v = particle_rates(model, central, u, w, half, known)
    return chosen(there, minus(r, drift), nothing), chosen(there, minus(v, pull), nothing)


@verb
def change_momenta(model, table, particles, sign):
    """Change the velocities of particles to momenta for sign = -1, or back for sign = 1, with the table for it."""
    if not depends_on_velocities(model):
        return lambda model, table, particles, sign: None
    return lambda model, table, particles, sign: _change_all(model, table, particles, sign)


@kernel
def _change_all(model, table, particles, sign):
    memory, retired, rows, share = particles
    first = flow_rows(strength_of(model).shape[0] - 2)
    for p in range(share.start, share.stop, WIDTH):
        marched = take_particles(memory, p, present(memory, retired, p), rows)
        rate, _ = _rates(model, table, first, marched, rows, 0.0, sign > 0.0)
        store_marched(memory, p, on_orbits(marched, kicked(marched.orbits, times(sign, rate))), rows)
