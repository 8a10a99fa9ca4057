"""The helpers that choose which cases run by default."""

import itertools

import pytest

from .coverings import cover, covering, each, every, first, only


@pytest.mark.parametrize("strength", [1, 2, 3])
def test_each_combination_of_factors_is_in_a_case_of_a_covering_and_few_cases_do(strength):
    factors = [range(5), range(4), range(3), range(2)]

    def allowed(a, b, c, d):
        return a != b

    taken = covering(factors, strength, allowed)
    whole = {x for x in itertools.product(*factors) if allowed(*x)}
    assert taken <= whole
    for at in itertools.combinations(range(4), strength):
        assert {tuple(x[k] for k in at) for x in taken} == {tuple(x[k] for k in at) for x in whole}
    # A greedy covering; none has fewer cases than the largest product of that many factors, here 5, 5 * 4 - 4, 48.
    assert len(taken) <= {1: 6, 2: 20, 3: 58}[strength]
    assert taken == covering(factors, strength, allowed)


def runs_by_default(cases):
    return [case.values for case in cases if not case.marks]


def test_cases_outside_a_covering_are_nightly():
    cases = cover(("a", "b"), "xyz", [1, 2], strength=1).args[1]
    assert [case.values for case in cases] == list(itertools.product("xyz", [1, 2]))
    assert len(runs_by_default(cases)) == 3
    assert {mark.name for case in cases for mark in case.marks} == {"nightly"}


def test_cases_are_chosen_by_place_or_value_and_keep_their_marks():
    cases = ["a", ("b", 1), pytest.param("c", 2, id="third", marks=pytest.mark.slow)]
    assert runs_by_default(first(1, cases)) == [("a",)]
    assert runs_by_default(only(["b"], cases)) == [("b", 1)]
    third = every(2, cases)[2]
    assert (third.id, third.values, [mark.name for mark in third.marks]) == ("third", ("c", 2), ["slow"])
    with pytest.raises(AssertionError, match="none of the cases"):
        only(["d"], cases)


def test_one_test_of_many_cases_is_skipped_if_all_of_them_are():
    @each("a", [1, 2, 3])
    def check(a, least):
        if a > least:
            pytest.skip("above")

    check(least=1)
    with pytest.raises(pytest.skip.Exception):
        check(least=0)


def test_one_test_of_many_cases_runs_all_of_them_and_lists_those_that_fail():
    seen = []

    @each(("a", "b"), [(1, 1), (1, 2), (2, 2), (3, 4)])
    def check(a, b, fixture):
        seen.append((a, b, fixture))
        assert a == b

    with pytest.raises(pytest.fail.Exception, match=r"(?s)2 of 4 cases fail.*\(1, 2\).*AssertionError.*\(3, 4\)"):
        check(fixture="once")
    assert seen == [(1, 1, "once"), (1, 2, "once"), (2, 2, "once"), (3, 4, "once")]
