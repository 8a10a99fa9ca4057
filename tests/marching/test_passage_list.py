"""The list of passages: the same however a march is divided into blocks, and whenever it is read."""

import numpy as np
import pytest

from orbits.kernels.search.record import ABOUT, COLUMNS, FASTEST2, LEAST2, MATE, ROW, STATE, STEP, WHEN
from orbits.marching.clocks.constant import ConstantSteps
from orbits.marching.watching import passage_list
from orbits.marching.watching.passage_list import BlockList, PassageList

GM = np.array([1.0, 1e-3, *np.zeros(8)])
ANGLE = 0.4


def passages(count: int) -> np.ndarray:
    """Return passages in the order of time: by the dominant body, by the planet, and particles bound to the planet."""
    rng = np.random.default_rng(7)
    found = np.zeros((count, COLUMNS))
    found[:, ROW], found[:, MATE] = rng.integers(2, len(GM), count), rng.integers(0, 2, count)
    found[:, WHEN] = np.sort(rng.uniform(0.0, 1000.0, count))
    found[:, STEP] = np.floor(found[:, WHEN])
    found[:, LEAST2], found[:, FASTEST2] = rng.uniform(0.5, 2.0, count), rng.uniform(0.05, 1.5, count)
    far = rng.uniform(0.001, 0.06, count)
    found[:, STATE], found[:, STATE + 4] = far, np.sqrt(1e-3 / far) * rng.uniform(0.5, 2.0, count)
    found[:, ABOUT], found[:, ABOUT + 4] = 1.0, 1.0
    return found


def blocks_of(found: np.ndarray, lengths: list[int]) -> list[list[BlockList]]:
    cuts = np.split(found, np.cumsum(lengths)[:-1])
    return [[BlockList(cut, np.array([len(cut), len(cut) + missed]))] for missed, cut in enumerate(cuts)]


def listed(found: np.ndarray, lengths: list[int], read: bool = False) -> PassageList:
    known = PassageList(GM, 0, ANGLE, ConstantSteps(0.5))
    for block in blocks_of(found, lengths):
        known.add(block)
        assert not block[0].listed.any()
        if read:
            assert len(known.passages) <= 2 * known._room
    return known


@pytest.mark.parametrize("room", [1000, 30], ids=["all fit", "not all fit"])
def test_blocks_of_any_length_give_the_same_list_whenever_it_is_read(room, monkeypatch):
    monkeypatch.setattr(passage_list, "ROOM", room - passage_list.ROOM_PER_BODY * len(GM))
    found = passages(600)
    whole = listed(found, [600])
    kept = whole.passages
    slow = (found[:, MATE] == 1) & (found[:, FASTEST2] <= (ANGLE / 0.5) ** 2 * found[:, LEAST2])
    if room == 1000:  # all but slow revolutions about the planet
        left_out = np.isin(found[:, WHEN], kept[:, WHEN], invert=True)
        assert 20 < left_out.sum() < slow.sum()
        assert not (left_out & ~slow).any()
        assert whole.left_out == 0
    else:
        assert len(kept) == 2 * room
        assert whole.left_out > 200
    assert (np.diff(kept[:, WHEN]) > 0.0).all()
    for lengths in ([1] * 600, [200, 1, 399], [10] * 60):
        missed = sum(range(len(lengths)))  # that the kernels found beyond what they listed
        for read in (False, True):
            parts = listed(found, lengths, read)
            assert np.array_equal(parts.passages, kept)
            assert parts.left_out == whole.left_out + missed


def test_what_waits_to_be_merged_is_in_a_checkpoint_and_is_put_back():
    found = passages(300)
    known = listed(found, [10] * 30)
    before = known.keep()
    first = known.passages
    known.add([BlockList(found[:5], np.array([5, 5]))])
    assert len(known.passages) > len(first)
    known.put_back(before)
    assert np.array_equal(known.passages, first)
    known.put_back(before)
    checkpoint = known.checkpoint()
    again = PassageList(GM, 0, ANGLE, ConstantSteps(0.5))
    again.restore({**checkpoint, "counts": np.array([1000])})
    assert np.array_equal(again.passages, first)
    assert again.left_out == known.left_out
