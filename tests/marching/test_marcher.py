"""Marches that are made from a march: of the same bodies, with all that acts on them."""

import numpy as np
import pytest

import orbits
from orbits.errors import InputError
from orbits.marching.clocks import Place
from orbits.propagation.marchers import bound

from ..problems import three_bodies

START = orbits.System(["a", "b", "c"], *three_bodies(), units=orbits.DIMENSIONLESS)
BRAKED = START.with_forces(orbits.Drag(rate=0.01))


def test_a_march_that_ends_at_a_time_has_the_forces_of_the_march():
    """No method chooses its steps under forces yet; the march to the end of a run would tell if it left them out."""
    marcher = bound(START, "gauss", orbits.Adaptive())
    marcher.approach(Place(0, 1.0))
    marcher._forces = bound(BRAKED, "gauss", 0.01)._forces
    with pytest.raises(InputError, match="with the force of drag"):
        marcher.ended_at(1.0)


def test_marches_made_within_a_step_have_the_forces_of_the_march():
    """A partial step by 0.01: the drag of 1e-4 of the velocities is seen in both."""
    marcher = bound(BRAKED, "gauss", 0.02)
    marcher.advance(1)
    expected = marcher.state_after(0.01)
    end, place = marcher.towards(0.03)
    end.advance_to(place)
    for found in (marcher.part_of_a_step(0.01).state(), end.state()):
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-14)
