"""Messages and states of lost particles, together with other events in the same block of steps."""

import numpy as np
import pytest

from orbits.errors import ConvergenceError, InputError
from orbits.integrators.gauss import Gauss
from orbits.integrators.stormer_verlet import StormerVerlet
from orbits.kernels.search.stopping import FARTHER
from orbits.lagrangians.newtonian import newtonian, parameters
from orbits.marching.following.retirement import retirements
from orbits.marching.legs import within_step
from orbits.marching.legs.leg import Leg
from orbits.marching.legs.problem import Ends
from orbits.marching.legs.record import approaches


def collapse(*, retire):
    """Two bodies fall into each other at t = 4; far away a particle falls into a third one at t = 0.5."""
    gm = np.array([1.0, 1.0, 1.0, 0.0])
    q = np.array([[-1.5, 0, 0], [1.5, 0, 0], [1000.0, 0, 0], [1000.6, 0, 0]])
    return Leg.of(newtonian, Gauss(stages=4), parameters(gm[:3]), gm > 0, q, np.zeros((4, 3)), 1 / 32, retire=retire)


def struck(**options):
    """A body at rest and a light one; particle 2 hits the former exactly in its first step, particle 3 is in orbit."""
    h = 0.0625
    q = np.array([[0, 0, 0], [5.0, 0, 0], [1.0, 0, 0], [0, 2.0, 0]])
    v = np.array([[0, 0, 0], [0, 5**-0.5, 0], [h / 2 - 1 / h, 0, 0], [-(2**-0.5), 0, 0]])
    massive = np.array([True, True, False, False])
    gm = parameters(np.array([1.0, 1e-300]))
    return Leg.of(newtonian, StormerVerlet(), gm, massive, q, v, h, retire=True, **options)


def test_a_particle_lost_before_the_bodies_fail_is_the_error():
    run = collapse(retire=False)
    with pytest.raises(ConvergenceError) as error:
        run.advance(400)
    assert error.value.bodies == ("body 3",)
    assert error.value.step == run.step < 20


def test_a_particle_lost_before_the_bodies_fail_is_retired():
    run = collapse(retire=True)
    with pytest.raises(ConvergenceError) as error:
        run.advance(400)
    assert error.value.bodies == ("body 0", "body 1")
    (lost,) = run.retired()
    assert lost.body == 3
    assert lost.step < 20 < run.step
    assert np.isnan(run.state()[0][3]).all()


def test_a_retired_particle_meets_no_condition():
    run = struck(ends=Ends(np.array([[FARTHER, -1.0, 0.0, 1000.0**2]])))
    run.advance(150)
    assert [lost.body for lost in run.retired()] == [2]
    assert run.bounds.met is None
    assert run.step == 150


def test_a_retired_particle_is_far_from_all_bodies_for_good():
    run = struck()
    run.advance(150)
    assert np.isinf(approaches(run)[0, :, 2]).all()


def test_a_part_of_a_step_goes_on_without_a_retired_particle():
    run = struck()
    run.advance(10)
    part = within_step.ended_at(run, run.time + 0.01)
    # It begins at the state rounded to float64: one rounding of numbers below 8.
    np.testing.assert_allclose(part.state()[0], run.state_after(0.01)[0], rtol=0, atol=2**-50)
    assert np.isnan(part.state()[0][2]).all()


def test_a_reason_that_there_is_not_is_refused():
    one = np.zeros((3, 1))
    with pytest.raises(InputError, match=r"reasons \[97\]"):
        retirements(np.array([[97, 3]]), one, one, np.array([0]))
