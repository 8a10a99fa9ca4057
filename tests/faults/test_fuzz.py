"""Calls of the public interface with anything at all: a number, or an error in words; see `fuzz`."""

import pytest

from tests.faults.fuzz import fuzz


def test_a_few_calls_with_anything_at_all_give_numbers_or_errors_in_words():
    found = fuzz(seed=0, calls=400)
    assert not found.wrong
    assert found.returned > 100, "good calls are among them"


@pytest.mark.faults
@pytest.mark.parametrize("seed", range(1, 11))
def test_many_calls_with_anything_at_all_give_numbers_or_errors_in_words(seed):
    """32,000 in all, each with an alarm."""
    found = fuzz(seed, calls=3200)
    assert not found.wrong
    assert found.returned > 800
