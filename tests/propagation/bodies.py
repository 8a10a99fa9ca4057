"""Bodies in plain numbers, for runs without dt."""

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
