"""An interrupt anywhere in a block of steps leaves the state of the last complete block."""

import numpy as np
import pytest

import orbits

from ..contracts.problems import marcher
from ..problems import three_bodies


@pytest.mark.parametrize("threads", [1, 2])
def test_a_march_that_was_interrupted_goes_on_to_the_same_bits(threads):
    start = three_bodies(particles=11)
    whole = marcher(orbits.Gauss(stages=4), *start, 0.15, threads=threads)
    whole.block = 10
    whole.advance(40)

    run = marcher(orbits.Gauss(stages=4), *start, 0.15, threads=threads)
    run.block = 10
    march, calls = run.stepper.loops.march, []

    def interrupted(*arguments):
        calls.append(march(*arguments))
        if len(calls) == 3:
            raise KeyboardInterrupt
        return calls[-1]

    run.stepper.loops.march = interrupted
    with pytest.raises(KeyboardInterrupt):
        run.advance(40)
    assert run.step == 20
    run.advance(20)
    for a, b in zip(whole.state(), run.state(), strict=True):
        assert np.array_equal(a, b)
    assert whole.stepper.counts() == run.stepper.counts()
    whole.close()
    run.close()
