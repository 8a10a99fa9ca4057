"""The memory of a march: no bit depends on what was in memory before."""

import os
import warnings

import numpy as np
import pytest

import orbits
from orbits.marching.following import own_memory
from orbits.marching.stepping import alignment, bound_loops

from ..problems import three_bodies

UNITS = orbits.DIMENSIONLESS


def states(**options):
    gm, q, v = three_bodies(particles=3)
    system = orbits.System([f"b{i}" for i in range(len(gm))], gm=gm, q=q, v=v, units=UNITS)
    run = orbits.propagate(system, orbits.Gauss(stages=8), duration=40.0, samples=5, progress=False, **options)
    return run.q.value, run.v.value


@pytest.mark.parametrize("options", [{}, {"dt": 0.05}], ids=["without dt", "constant steps"])
def test_memory_that_is_not_cleared_is_written_before_it_is_read(monkeypatch, options):
    plain = states(**options)

    def full_of_nan(*shapes):
        arrays = alignment.unwritten(*shapes)
        for array in arrays:
            array[...] = np.nan
        return arrays

    for module in (bound_loops, own_memory):
        monkeypatch.setattr(module, "unwritten", full_of_nan)
    for known, found in zip(plain, states(**options), strict=True):
        np.testing.assert_array_equal(found, known)


@pytest.mark.parametrize("size", [0, 7, alignment.FEW - 1, alignment.FEW, 3 * alignment.FEW + 5])
def test_zeros_on_demand_are_zeros_that_can_be_written(size):
    found = alignment.zeros_on_demand(size)
    assert found.shape == (size,)
    assert found.dtype == np.float64
    assert not found.any()
    found[...] = 1.0
    assert found.sum() == size
    assert not alignment.zeros_on_demand(size).any()


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no processes are forked here")
def test_zeros_on_demand_are_not_shared_with_forked_processes():
    found = alignment.zeros_on_demand(alignment.FEW)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of a process with threads
        child = os.fork()
    if not child:
        found[...] = 1.0
        os._exit(0)
    os.waitpid(child, 0)
    assert not found.any()
