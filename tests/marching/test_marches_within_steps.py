"""Marches that are made from a march: of the same bodies, with all that acts on them."""

import numpy as np
import pytest

import orbits
from orbits.marching.clocks.step_times import Place
from orbits.marching.legs import within_step
from orbits.propagation.marchers import bound

from ..problems import three_bodies

START = orbits.System(["a", "b", "c"], *three_bodies(), units=orbits.DIMENSIONLESS)
BRAKED = START.with_forces(orbits.terms.Drag(rate=0.01))


@pytest.mark.nightly
def test_a_march_that_ends_at_a_time_has_the_forces_of_the_march():
    """Up to the last step before the time 1 and from there to it, against a march of constant steps."""
    marcher = bound(BRAKED, "gauss", orbits.Adaptive())
    marcher.approach(Place(0, 1.0))
    constant = bound(BRAKED, "gauss", 2.0**-7)
    constant.advance(2**7)
    for found, expected in zip(within_step.ended_at(marcher, 1.0).state(), constant.state(), strict=True):
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)  # the drag moves them by 1e-2


@pytest.mark.nightly
def test_marches_made_within_a_step_have_the_forces_of_the_march():
    """A partial step by 0.01: the drag of 1e-4 of the velocities is seen in both."""
    marcher = bound(BRAKED, "gauss", 0.02)
    marcher.advance(1)
    expected = marcher.state_after(0.01)
    end, place = within_step.towards(marcher, 0.03)
    end.advance_to(place)
    for found in (within_step.ended_at(marcher, marcher.time + 0.01).state(), end.state()):
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-14)
