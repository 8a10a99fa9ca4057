"""The memory of a march: no bit depends on what was in memory before, and runs hand it on to the next ones at once."""

import gc
import platform
from functools import cache

import numpy as np
import pytest

import orbits
from orbits.marching.following import own_memory
from orbits.marching.stepping import alignment, bound_loops
from orbits.marching.watching import leg_observers

from ..problems import three_bodies

SYSTEMS = {"massive bodies": 0, "with particles": 3, "ten bodies": None}
"""The massless particles among three bodies; None for ten bodies, beyond whose coordinates lanes of eight read."""

WITHOUT_DT = pytest.mark.parametrize("options", [{}, {"dt": 0.05}], ids=["without dt", "constant steps"])
OF_SYSTEMS = pytest.mark.parametrize("name", SYSTEMS)


@cache
def system_of(name):
    if name == "ten bodies":
        return orbits.System.solar_system()
    gm, q, v = three_bodies(particles=SYSTEMS[name])
    return orbits.System([f"b{i}" for i in range(len(gm))], gm=gm, q=q, v=v, units=orbits.DIMENSIONLESS)


def run_of(name, **options):
    return orbits.propagate(system_of(name), duration=40.0, samples=5, approaches=True, progress=False, **options)


def found_in(run):
    closest = [(x.time.value, x.distance.value, x.speed.value) for x in run.closest_approaches().as_recorded()]
    return run.q.value, run.v.value, np.array(closest)


@WITHOUT_DT
@OF_SYSTEMS
def test_memory_that_is_not_cleared_is_written_before_it_is_read(monkeypatch, name, options):
    plain = found_in(run_of(name, **options))

    def full_of_nan(*shapes):
        arrays = alignment.unwritten(*shapes)
        for array in arrays:
            array[...] = np.nan
        return arrays

    for module in (bound_loops, own_memory, leg_observers):
        monkeypatch.setattr(module, "unwritten", full_of_nan)
    for known, found in zip(plain, found_in(run_of(name, **options)), strict=True):
        np.testing.assert_array_equal(found, known)


@pytest.fixture(scope="module")
def nothing_older():
    """Whatever was made before is left out of collections, which take half a second for it in a whole suite."""
    gc.collect()
    gc.freeze()
    yield
    gc.unfreeze()


@WITHOUT_DT
@OF_SYSTEMS
def test_a_run_leaves_nothing_to_the_garbage_collector(name, options, nothing_older):
    """In a circle of references, megabytes of each of thousands of short runs would stay for a while."""
    run_of(name, **options)
    gc.collect()
    gc.disable()
    try:
        run_of(name, **options)
        assert gc.collect() == 0
    finally:
        gc.enable()


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="of its rule for freed memory")
@WITHOUT_DT
@OF_SYSTEMS
def test_a_run_takes_no_new_memory_from_the_system_if_there_was_one_like_it(name, options):
    """Each page that is new takes as long as a fifth of a step of ten bodies."""
    import resource

    def pages():
        return resource.getrusage(resource.RUSAGE_SELF).ru_minflt

    for _ in range(5):
        run_of(name, **options)
    before = pages()
    for _ in range(10):
        run_of(name, **options)
    assert pages() - before < 50  # five a run; without dt 30 to 500 a run were those of memory that was new
