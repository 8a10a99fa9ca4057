"""The derivative of kicks in democratic heliocentric coordinates, and of the change to them.

With the coordinates of `orbits.kernels.maps.heliocentric`, a kick of h adds h times the change of the planets'
attraction to dV, and h times the sum of (m_i / m_0) dV_i, which the kick does not change, to all dQ.
"""

from __future__ import annotations

from orbits.kernels.compile import kernel
from orbits.kernels.lanes import fma, full, load, store
from orbits.kernels.maps.layout import body_of, coordinate, dominant
from orbits.kernels.tangents.of_jacobi_kicks import pulls_of_pairs
from orbits.kernels.tangents.vector_parts import HERE, add_three


@kernel
def place_heliocentric(planets, places):
    """Write the places of the planets, at which the derivative of a kick is taken."""
    for i in range(places.shape[1]):
        for k in range(3):
            places[HERE, i, k] = coordinate(planets, k, i)


@kernel
def kick_heliocentric_vectors(strength, h, vectors, room):
    """Advance eight vectors by a kick, from the places of `place_heliocentric`."""
    places, pull, mass = room.places[HERE], room.pull, room.mass
    central, count = strength[1 + dominant(room.planets)], mass.shape[0]
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


@kernel(inline=True)
def _of_all(strength):
    """Return GM of all bodies."""
    whole = 0.0
    for k in range(strength.shape[0] - 1):
        whole += strength[1 + k]
    return whole


@kernel
def to_heliocentric(strength, vectors, room):
    """Change eight vectors from the order of the bodies to places relative to the dominant one and velocities relative
    to the centre of mass, in the planets' order.
    """
    planets, mass, kept, whole = room.planets, room.mass, room.shifted, _of_all(strength)
    count, sun = mass.shape[0], dominant(planets)
    for part in range(4):
        rows = vectors[part]
        for k in range(3):
            own = load(rows, 3 * sun + k)
            centre = full(strength[1 + sun] / whole) * own
            for i in range(count):
                there = load(rows, 3 * body_of(planets, i) + k)
                store(kept, 3 * i + k, there)
                centre = fma(full(mass[i] / whole), there, centre)
            origin = own if part < 2 else centre
            for i in range(count):
                store(rows, 3 * i + k, load(kept, 3 * i + k) - origin)
            store(rows, 3 * count + k, centre)


@kernel
def from_heliocentric(strength, vectors, room):
    """Undo `to_heliocentric`."""
    planets, mass, kept, whole = room.planets, room.mass, room.shifted, _of_all(strength)
    count, sun = mass.shape[0], dominant(planets)
    for part in range(4):
        rows = vectors[part]
        for k in range(3):
            centre = load(rows, 3 * count + k)
            own = centre
            for i in range(count):
                there = load(rows, 3 * i + k)
                store(kept, 3 * i + k, there)
                own = fma(full(-mass[i] / (whole if part < 2 else strength[1 + sun])), there, own)
            origin = own if part < 2 else centre
            for i in range(count):
                store(rows, 3 * body_of(planets, i) + k, origin + load(kept, 3 * i + k))
            store(rows, 3 * sun + k, own)
