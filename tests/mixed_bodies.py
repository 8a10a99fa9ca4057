"""Bodies in no order that REBOUND could use as it is, for tests of its integrators as peers."""

import numpy as np

# Jupiter, a massless body, the Sun, another one, Saturn: in no order that REBOUND could use as it is. au, day.
GM = np.array([2.825e-7, 0.0, 2.959e-4, 0.0, 8.46e-8])
Q = np.array([[4.0, 2.9, 1.2], [2.6, 0.4, 0.1], [-0.007, -0.003, -0.001], [0.0, -3.1, 0.2], [6.4, 6.2, 2.3]])
V = np.array(
    [
        [-0.0046, 0.0058, 0.0026],
        [-0.002, 0.0103, 0.0007],
        [5e-6, -7e-6, -3e-6],
        [0.0098, 0.0003, 0.001],
        [-0.0043, 0.0035, 0.0016],
    ]
)
DT = 16.0
