"""Observers called by address, and the context with their data."""

import copy
import os
import pickle
import subprocess
import sys
import weakref
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from numba import types

from orbits.kernels.barrier import ABANDONED, COUNTERS, meet
from orbits.kernels.compile import kernel
from orbits.kernels.lanes import WIDTH
from orbits.kernels.search.context import Contexts, watch_at
from orbits.kernels.search.observers import OBSERVER, call_observer, observe, observer_address

ARRAYS = {
    "path": (5,),
    "annuli": (3, 3),
    "reaches": (11,),
    "record": (4, 2, 9),
    "stops": (2, 4),
    "hits": (2,),
    "passages": (2, 18),
    "listed": (2,),
}
WHOLE = ("hits", "listed")
NUMBERS = ("stride", "bodies", "first", "dominant", "mu", "passage_angle", "least_eccentricity", "pericentre_angle")


@kernel
def march(observer, context, track, h, blocks):
    """Call the observer after each block, like a driver."""
    for block in range(blocks):
        track[0, 0] = 0.5 * block
        call_observer(observer, context, track, h, 7, WIDTH * block, WIDTH * block + 5)


@kernel
def note_arguments(context, track, h, steps, start, stop):
    seen = watch_at(context).record[0, 0]
    seen[0] += 1.0
    seen[1], seen[2], seen[3], seen[4], seen[5] = h, steps, start, stop, track[0, 0]
    seen[6], seen[7] = track.shape[0], track.shape[1]


@kernel
def note_numbers(context, track, h, steps, start, stop):
    watch = watch_at(context)
    seen = watch.record[0, 0]
    seen[0], seen[1], seen[2], seen[3] = watch.stride, watch.bodies, watch.first, watch.dominant
    seen[4], seen[5], seen[6], seen[7] = watch.mu, watch.passage_angle, watch.least_eccentricity, watch.pericentre_angle


@kernel
def increase_last(context, track, h, steps, start, stop):
    """Add 1 to the last element of each array."""
    watch = watch_at(context)
    for array in (watch.path, watch.reaches):
        array[array.shape[0] - 1] += 1.0
    for table in (watch.annuli, watch.stops, watch.passages):
        table[table.shape[0] - 1, table.shape[1] - 1] += 1.0
    watch.listed[watch.listed.shape[0] - 1] += 1
    watch.hits[watch.hits.shape[0] - 1] += 1
    record = watch.record
    record[record.shape[0] - 1, record.shape[1] - 1, record.shape[2] - 1] += 1.0


@kernel
def meet_another(context, track, h, steps, start, stop):
    """Return when two threads have arrived, or when cancelled."""
    watch = watch_at(context)
    meet(watch.listed, 2, 1)
    watch.record[0, 0, 0] = watch.first


@kernel
def return_something(context, track, h, steps, start, stop):
    return start


def track(steps=1):
    return np.zeros((6 * (steps + 1), WIDTH))


def test_an_observer_is_given_what_the_driver_passes():
    contexts, record, states = Contexts(1), np.zeros((4, 2, 9)), track(7)
    contexts.enter(record=record)
    march(observer_address(note_arguments), contexts.addresses[0], states, 0.25, 3)
    assert list(record[0, 0, :8]) == [3, 0.25, 7, 16, 21, 1.0, 48, 8]


def test_without_an_observer_nothing_is_called():
    march(0, 0, track(), 0.25, 3)
    observe(0, 0, track(), 0.25, 1, 0, 8)


def test_an_observer_reads_every_field_of_its_context():
    contexts, record = Contexts(1), np.zeros((4, 2, 9))
    numbers = [11, 3, -5, 2**40, 1.5, -2.5, 3.5e-300, 4.5]
    contexts.enter(record=record, **dict(zip(NUMBERS, numbers, strict=True)))
    observe(observer_address(note_numbers), contexts.addresses[0], track(), 1.0, 1, 0, 8)
    assert list(record[0, 0, :8]) == numbers
    arrays = {name: np.zeros(shape, np.int64 if name in WHOLE else float) for name, shape in ARRAYS.items()}
    contexts.enter(**arrays)
    observe(observer_address(increase_last), contexts.addresses[0], track(), 1.0, 1, 0, 8)
    for name, array in arrays.items():
        assert array.sum() == array.flat[-1] == 1, name


def test_contexts_keep_their_arrays_alive():
    contexts, array = Contexts(2), np.zeros(4)
    watched = weakref.ref(array)
    contexts.enter(path=array)
    del array
    assert watched() is not None
    contexts.enter(path=np.zeros(4))
    assert watched() is None


@pytest.mark.parametrize("wrong", [np.zeros(4, np.float32), np.zeros((2, 2)), np.zeros(8)[::2], np.zeros(4, int)])
def test_an_array_that_kernels_would_misread_is_refused(wrong):
    with pytest.raises(TypeError, match="path must be a contiguous array of 1 dimensions of float64"):
        Contexts(1).enter(path=wrong)
    with pytest.raises(TypeError, match="path must be"):
        Contexts(1).enter_each("path", [wrong])


def test_contexts_are_not_copied_with_the_addresses_of_others():
    for take in (copy.deepcopy, pickle.dumps):
        with pytest.raises(TypeError, match="cannot be copied or pickled"):
            take(Contexts(1))


def test_contexts_share_all_but_what_is_their_own():
    whole, parts = Contexts(1), Contexts(2)
    shared, own = np.zeros((4, 2, 9)), [np.zeros((4, 2, 9)) for _ in range(2)]
    whole.enter(record=shared, stride=16, mu=0.5)
    parts.enter_each("record", own)
    parts.share(whole, own=["record"])
    for address in parts.addresses:
        observe(observer_address(note_numbers), address, track(), 1.0, 1, 0, 8)
    for record in own:
        assert (record[0, 0, 0], record[0, 0, 4]) == (16, 0.5)
    assert not shared.any()


def test_observers_of_two_threads_run_at_the_same_time_each_with_its_own_context():
    contexts, counters = Contexts(2), np.zeros(COUNTERS, np.int64)
    records = [np.zeros((4, 2, 9)) for _ in range(2)]
    contexts.enter(listed=counters, first=42)
    contexts.enter_each("record", records)
    address = observer_address(meet_another)
    march(0, 0, track(), 0.1, 1)
    with ThreadPoolExecutor(2) as pool:
        tasks = [pool.submit(march, address, context, track(), 0.1, 1) for context in contexts.addresses]
        try:
            # With the global lock held in one of them, the other would never come. A minute is for a busy machine.
            for task in tasks:
                task.result(timeout=60)
        finally:
            counters[ABANDONED] = 1
    assert [record[0, 0, 0] for record in records] == [42, 42]


def test_a_kernel_that_returns_something_is_no_observer():
    with pytest.raises(TypeError, match="return_something returns int64, expected none"):
        observer_address(return_something)


def test_an_address_is_that_of_one_signature():
    other = types.none(*OBSERVER.args[:-1], types.int32)
    assert observer_address(note_arguments) == observer_address(note_arguments, OBSERVER)
    assert observer_address(note_arguments, other) != observer_address(note_arguments)


MODULE = """
from orbits.kernels.compile import kernel
from orbits.kernels.search.observers import call_observer
from orbits.kernels.search.context import watch_at

@kernel
def look(context, track, h, steps, start, stop):
    watch_at(context).record[0, 0, start] += h * track[0, 0]

@kernel
def march(observer, context, track, h, blocks):
    for block in range(blocks):
        call_observer(observer, context, track, h, 1, block, blocks)
"""

PROGRAM = """
import numpy as np
from orbits.kernels.search.observers import observer_address
from orbits.kernels.search.context import Contexts
from observed import look, march

contexts, record = Contexts(1), np.zeros((4, 2, 9))
contexts.enter(record=record)
address = observer_address(look)
march(address, contexts.addresses[0], np.full((12, 8), 3.0), 0.5, 9)
hits = [sum(f.stats.cache_hits.values()) for f in (look.addressed, march.entry)]
print(*hits, *record[0, 0])
"""


@pytest.mark.nightly
def test_observer_and_driver_are_loaded_from_the_cache_in_a_second_process(tmp_path):
    (tmp_path / "observed.py").write_text(MODULE)
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": str(tmp_path)}
    runs = []
    for _ in range(2):
        program = [sys.executable, "-c", PROGRAM]
        out = subprocess.run(program, env=environment, capture_output=True, text=True, check=True).stdout.split()
        runs.append([float(word) for word in out])
        assert runs[-1][2:] == [1.5] * 9
    assert [run[:2] for run in runs] == [[0, 0], [1, 1]]
