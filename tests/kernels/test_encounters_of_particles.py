"""Which blocks of steps lead particles too close to a planet: by the states at all ends of steps."""

import numpy as np
import pytest

from orbits.kernels.compile import kernel
from orbits.kernels.lanes import store
from orbits.kernels.search.encounters_of_particles import Rules, encountering
from orbits.marching.stepping.alignment import aligned

STEPS, H, HILL = 3, 0.1, 0.1


@kernel
def write_encountering(rules, track, steps, out):
    store(out, 0, encountering(rules, track, steps))


@pytest.mark.parametrize("end", range(STEPS + 1))
@pytest.mark.parametrize("speed", [4.1, 3.9])
def test_a_line_from_any_end_of_a_step_that_comes_within_the_radius_is_an_encounter(end, speed):
    """A planet at rest at 1 from the star, particles at rest at 0.5 from it: but for one, that is fast at one end."""
    near, extent = np.array([[0.0, HILL**2], [0.0, 0.0]]), np.array([[0.0, 1.0], [0.0, 1.0], [0.0, 0.0]])
    states = np.zeros((STEPS + 1, 2, 3, 2))
    states[:, 0, 0, 1] = 1.0
    rules = Rules(near, extent, states.ravel(), 6, 0, 1.0, H, 1e3)
    track, out = aligned((6 * (STEPS + 1), 8), (8,))
    track[0::6], track[1::6] = 1.0, 0.5
    track[6 * end + 4, 2] = -speed if end < STEPS else speed  # towards it forwards, or backwards
    write_encountering(rules, track, STEPS, out)
    assert out.tolist() == [0, 0, float(0.5 - H * speed < HILL), 0, 0, 0, 0, 0]
