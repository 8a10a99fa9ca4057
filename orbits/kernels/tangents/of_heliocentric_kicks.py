"""The derivative of kicks in democratic heliocentric coordinates, and of the change to them.

With the coordinates of `orbits.kernels.maps.heliocentric`, a kick of h adds h times the change of the planets'
attraction to dV, and h times the sum of (m_i / m_0) dV_i, which the kick does not change, to all dQ.
"""

from __future__ import annotations

from orbits.kernels.compile import kernel
from orbits.kernels.lanes import WIDTH, fma, full, load, store
from orbits.kernels.maps.interaction import STATE_ROWS
from orbits.kernels.tangents.of_jacobi_kicks import pulls_of_pairs
from orbits.kernels.tangents.vector_parts import HERE, add_three


@kernel
def place_heliocentric(planets, places):
    """Write the places of the planets, at which the derivative of a kick is taken."""
    for i in range(places.shape[1]):
        for k in range(3):
            places[HERE, i, k] = planets[STATE_ROWS * (i // WIDTH) + k, i % WIDTH]


@kernel
def kick_heliocentric_vectors(mass, central, h, vectors, room):
    """Advance eight vectors by a kick, from the places of `place_heliocentric`."""
    places, pull = room.places[HERE], room.pull
    count = mass.shape[0]
    for a in range(3 * count):
        store(room.offset, a, load(vectors[0], a))
    pulls_of_pairs(mass, places, 0, places, False, room.offset, pull)
    jx, jy, jz = full(0.0), full(0.0), full(0.0)
    for i in range(count):
        share, a = full(mass[i] / central), 3 * i
        jx, jy = fma(share, load(vectors[2], a), jx), fma(share, load(vectors[2], a + 1), jy)
        jz = fma(share, load(vectors[2], a + 2), jz)
    for i in range(count):
        a = 3 * i
        add_three(vectors[0], vectors[1], a, h * jx, h * jy, h * jz)
        add_three(vectors[2], vectors[3], a, h * load(pull, a), h * load(pull, a + 1), h * load(pull, a + 2))


@kernel
def to_heliocentric(planets, mass, central, count, vectors, room):
    """Change eight vectors from the order of the bodies to places relative to the dominant one and velocities relative
    to the centre of mass, in the planets' order.
    """
    numbers = planets.shape[0] // (STATE_ROWS + 1) * STATE_ROWS
    sun, whole = int(planets[numbers, 6]), central
    for i in range(count):
        whole += mass[i]
    for part in range(4):
        rows = vectors[part]
        for k in range(3):
            own = load(rows, 3 * sun + k)
            centre = full(central / whole) * own
            for i in range(count):
                body = int(planets[numbers + 2 + i // WIDTH, i % WIDTH])
                there = load(rows, 3 * body + k)
                store(room, 3 * i + k, there)
                centre = fma(full(mass[i] / whole), there, centre)
            origin = own if part < 2 else centre
            for i in range(count):
                store(rows, 3 * i + k, load(room, 3 * i + k) - origin)
            store(rows, 3 * count + k, centre)


@kernel
def from_heliocentric(planets, mass, central, count, vectors, room):
    """Undo `to_heliocentric`."""
    numbers = planets.shape[0] // (STATE_ROWS + 1) * STATE_ROWS
    sun, whole = int(planets[numbers, 6]), central
    for i in range(count):
        whole += mass[i]
    for part in range(4):
        rows = vectors[part]
        for k in range(3):
            centre = load(rows, 3 * count + k)
            own = centre
            for i in range(count):
                there = load(rows, 3 * i + k)
                store(room, 3 * i + k, there)
                own = fma(full(-mass[i] / (whole if part < 2 else central)), there, own)
            origin = own if part < 2 else centre
            for i in range(count):
                body = int(planets[numbers + 2 + i // WIDTH, i % WIDTH])
                store(rows, 3 * body + k, origin + load(room, 3 * i + k))
            store(rows, 3 * sun + k, own)
