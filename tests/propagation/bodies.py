"""Bodies in plain numbers: for runs without dt, and with terms and forces."""

import numpy as np

import orbits

PLAIN = orbits.DIMENSIONLESS

# Burrau's problem at t = 63 by Taylor series in 128-bit floats (heyoka); in 80-bit floats it is 3e-5 off.
BURRAU = [
    [2.8394339724915003, 8.112854424695952, 0.0],
    [-0.4634202799751191, -2.8522283629340026, 0.0],
    [-1.332924159514805, -2.585929964470369, 0.0],
]


def system(gm, q, v, **options):
    return orbits.System([f"b{i}" for i in range(len(gm))], gm=gm, q=q, v=v, units=PLAIN, **options)


def falling(sideways):
    """Two bodies that fall towards each other."""
    return system([1.0, 1.0], [[-1, 0, 0], [1, 0, 0]], [[0, sideways, 0], [0, -sideways, 0]])


POLE = (0.36, 0.48, 0.8)
SPIN = orbits.terms.FrameDragging("planet", spin=0.1, pole=POLE, c=3.0)
FLAT = orbits.terms.ZonalHarmonics("planet", J2=0.05, radius=0.5, pole=POLE)
DRAG = orbits.terms.Drag(rate=1e-2, velocity=(0.05, 0.0, -0.02))
PARTICLE = {"p": (0.0, [0.0, 1.4, 0.1], [-0.8, 0.0, 0.1])}


def planet(**bodies):
    """A planet at rest with satellites: GM, place and velocity of each."""
    gm = [1.0, *(body[0] for body in bodies.values())]
    states = [np.zeros((2, 3)), *(np.array(body[1:]) for body in bodies.values())]
    q, v = (np.array([s[k] for s in states], dtype=float) for k in (0, 1))
    return orbits.System(["planet", *bodies], gm, q, v, units=orbits.DIMENSIONLESS)


def three(**more):
    return planet(
        inner=(0.01, [1, 0, 0.2], [0, 0.9, 0.3]), outer=(0.002, [-2, 0.5, 0], [-0.1, -0.6, 0.3]), **more
    )


def falling_particles():
    """A star, a planet, a particle on a circle, and two that fall into the star after pi (r / 2)^1.5."""
    q = [[0, 0, 0], [9, 0, 0], [2.5, 0, 0], [0, 0, 0.8], [0, 0, 2.0]]
    v = [[0, 0, 0], [0, 1 / 3, 0], [0, 2.5**-0.5, 0], [0, 0, 0], [0, 0, 0]]
    return orbits.System(
        ["star", "planet", "p", "near", "far"], gm=[1.0, 1e-9, 0, 0, 0], q=q, v=v, units=orbits.DIMENSIONLESS
    )
