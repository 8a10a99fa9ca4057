"""What the loop over blocks leaves where something fails, or begins, at an awkward place."""

import gc
import weakref

import numpy as np
import pytest

import orbits
from orbits.errors import StorageError
from orbits.marching.clocks.step_times import Place
from orbits.marching.legs.interruptions import LegWatcher
from orbits.point_masses import PointMasses
from orbits.propagation.marchers import march_of

FALLING = PointMasses(
    np.array([1.0, 0.0, 0.0]),
    np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.5, 0.0, 0.0]]),
    np.array([[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 1e-3, 0.0]]),
    0.0,
)
"""A star, a massless body on a circle, and one that falls into the star within 25 steps of 1/64."""


class FullDisk(LegWatcher):
    """Fails when a block is committed in which something was found."""

    def commit(self, leg, begun, last):
        if last is not None:
            raise StorageError("the disk is full")


def test_a_block_that_cannot_be_committed_retires_nobody():
    leg = march_of(FALLING, orbits.Gauss(stages=8), 2.0**-6)
    leg.advance_to(Place(10, 0.0))
    before = leg.checkpoint()
    leg.loop.listeners.append(FullDisk())
    with pytest.raises(StorageError):
        leg.advance_to(Place(300, 0.0))
    after = leg.checkpoint()
    assert leg.step == 10
    assert leg.retired() == []
    for name, array in before.items():
        assert np.array_equal(array, after[name]), name
    leg.restore(after)  # its retired particles are possible ones


def test_compiling_by_a_step_leaves_no_block_behind():
    leg = march_of(FALLING, orbits.StormerVerlet(), 2.0**-6)
    leg.loop.try_out()
    assert leg.loop.taken == 0
    assert len(leg.times.lengths()) == 0


@pytest.mark.parametrize("k", [6, 7])
def test_bodies_that_change_at_the_end_of_a_step_are_there_at_its_time(k):
    """Speeds grow by a hundredth after k whole steps: the run goes on from there, on the same grid, and in time."""
    dt, asked = 2.0**-5, []
    gm, q = np.array([1.0, 1e-6]), np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    v = np.array([[0.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    system = orbits.System(["star", "planet"], gm, q, v, units=orbits.DIMENSIONLESS)

    def faster(t, now):
        asked.append(t)
        return now.replaced(v=1.01 * now.values.v)

    def seen_later(t, now):
        later.append((t, now.q.value))

    later = []
    event = orbits.events.Event(lambda t, q, v: t - k * dt, then=faster)
    clock = orbits.events.Event(lambda t, q, v: t - 20.5 * dt, then=seen_later)
    given = {"dt": dt, "check_step": False, "progress": False}
    run = orbits.propagate(system, "stormer-verlet", duration=1.0, samples=33, events=[event, clock], **given)
    first = orbits.propagate(system, "stormer-verlet", duration=k * dt, samples=2, **given)
    changed = orbits.System(
        system.names, gm, first.q[-1], 1.01 * first.v[-1], units=orbits.DIMENSIONLESS
    )
    rest = orbits.propagate(changed, "stormer-verlet", duration=1.0 - k * dt, samples=33 - k, **given)
    assert len(asked) == len(later) == 1
    time, q = later[0]
    assert abs(float(time) - 20.5 * dt) < 1e-14  # the march reads the right time after the change
    np.testing.assert_allclose(q, rest.at((20.5 - k) * dt).q, rtol=0, atol=1e-13)
    np.testing.assert_allclose(run.q[k:], rest.q, rtol=0, atol=1e-13)  # rounding of the state, in 32 steps
    assert run.times[-1] == 1.0


def test_a_leg_is_free_as_soon_as_nobody_has_it():
    """Its arrays take megabytes: a circle of references would keep those of thousands of short runs for a while."""
    gc.disable()
    try:
        leg = march_of(FALLING, orbits.Gauss(stages=8), 2.0**-6)
        leg.advance_to(Place(10, 0.0))
        known = weakref.ref(leg)
        del leg
        assert known() is None
    finally:
        gc.enable()
