"""Which massless particles are lost first, and passages that are listed only to see who falls on a body."""

import numpy as np

from orbits.kernels.search.record import COLUMNS, MATE, ROW
from orbits.marching.following.losses import without_dominant
from orbits.marching.following.retirement import Lost, earlier


def lost(steps, particles, status):
    return Lost(steps, np.array(particles), np.array(status, dtype=np.int64))


def test_of_two_findings_the_earlier_one_counts_and_of_one_step_both():
    first, second = lost(3, [5], [2]), lost(7, [1], [4])
    assert earlier(first, second) is first
    assert earlier(second, first) is first
    assert earlier(None, second) is second
    assert earlier(first, None) is first
    both = earlier(lost(3, [5, 8], [2, 2]), lost(3, [1, 8], [4, 4]))
    assert both.steps == 3
    assert both.particles.tolist() == [1, 5, 8]
    assert both.status.tolist() == [4, 2, 2]  # of the same particle, the reason of the first argument


def test_passages_of_the_dominant_body_are_taken_off_a_list_with_their_count():
    passages = np.zeros((6, COLUMNS))
    passages[:5, ROW], passages[:5, MATE] = [1, 4, 5, 6, 4], [0, 0, 2, 0, 2]  # rows below 3 are of massive bodies
    listed = np.array([5, 7])  # in the list, and found
    without_dominant([(passages, listed)], bodies=3, dominant=0)
    assert listed.tolist() == [3, 5]
    assert passages[:3, ROW].tolist() == [1, 5, 4]
    assert passages[:3, MATE].tolist() == [0, 2, 2]
