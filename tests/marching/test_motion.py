"""The motion within recorded steps, held against partial steps of the same method."""

import numpy as np
import pytest

import orbits
from orbits.marching.adaptive import Adaptive
from orbits.propagation.marchers import march_of
from orbits.system.model import model

STEPS = 40

# The polynomial has degree s + 1. Where it resolves the motion, only round-off of Mercury's position, 0.3 au, is left.
CASES = [
    ("adaptive", Adaptive(), orbits.Gauss(stages=8), 1e-14),  # 3.9e-15 reached
    ("two-registers", 2.0, orbits.Gauss(stages=12), 4e-16),  # 1.7e-16
    ("four-stages", 0.5, orbits.Gauss(stages=4), 2e-14),  # 7.8e-15
    ("backwards", -2.0, orbits.Gauss(stages=8), 4e-16),  # 1.7e-16
]


@pytest.mark.parametrize(("clock", "method", "bound"), [case[1:] for case in CASES], ids=[case[0] for case in CASES])
def test_the_motion_within_a_step_is_that_of_partial_steps(clock, method, bound):
    system = orbits.System.solar_system()
    marcher, again = (march_of(system.values, method, clock, model(system), dense=dense) for dense in (True, False))
    marcher.advance(STEPS)
    motion = marcher.motion()
    assert len(motion) == STEPS
    assert motion.times[-1] == pytest.approx(marcher.time, rel=1e-15)
    rng = np.random.default_rng(1)
    steps, fractions = np.sort(rng.integers(0, STEPS, 60)), rng.random(60)
    q, v = motion.at(steps, fractions)
    times = motion.times[steps] + fractions * np.diff(motion.times)[steps]
    mercury = system.names.index("Mercury")
    for k in np.argsort(times * again.clock.direction):
        place = again.clock.place(times[k])
        again.advance_to(place)
        expected_q, expected_v = again.state_at(place)
        assert abs(q[k] - expected_q)[mercury].max() <= bound
        assert abs(v[k] - expected_v).max() <= 20 * bound
    ends, _ = motion.at(np.arange(STEPS), np.ones(STEPS))
    recorded = motion.path[1:, 0, : 3 * len(system)].reshape(STEPS, 3, -1).transpose(0, 2, 1)
    assert abs(ends - recorded).max() <= 8e-15  # one unit in the last place of Pluto's 30 au
