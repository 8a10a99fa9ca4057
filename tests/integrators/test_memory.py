"""The memory that kernels work on."""

import numpy as np
import pytest

from orbits.marching.stepping.alignment import aligned


@pytest.mark.parametrize("shapes", [[(16,)], [(0, 8), (1, 24, 8), (3, 16), (5,), (7, 0, 8), (33,)]])
def test_arrays_begin_where_a_line_of_the_cache_does_and_share_nothing(shapes):
    kept = []
    for size in range(1, 20):  # what is kept moves the next one
        arrays = aligned(*shapes)
        assert [x.shape for x in arrays] == shapes
        for k, x in enumerate(arrays):
            assert x.ctypes.data % 64 == 0 or not x.size
            assert x.flags.c_contiguous
            assert not x.any()
            x[...] = k + 1
        assert all((x == k + 1).all() for k, x in enumerate(arrays))
        kept.append(np.empty(2 * size))
