"""The validators take numbers and nothing that merely becomes one, and each message names the value."""

from fractions import Fraction

import numpy as np
import pytest
from astropy import units as u

from orbits import checks
from orbits.errors import InputError

from .coverings import each


@pytest.mark.parametrize("given", [2, 2.0, np.float32(2.0), np.int64(2), np.array(2.0), Fraction(2)])
def test_a_number_is_taken_whatever_its_type(given):
    for check in (checks.single_number, checks.finite_number, checks.nonzero_number, checks.positive_number):
        number = check(given, "x")
        assert (number, type(number)) == (2.0, float)


ODD = ["2", b"2", True, np.True_, 2j, None, {}, np.timedelta64(2, "s"), np.datetime64("2020-01-01"), 2 * u.km, 10**400]


@each("given", ODD)
def test_what_only_becomes_a_number_is_refused_by_name(given):
    with pytest.raises(InputError, match=r"^step (must be|is) "):
        checks.finite_number(given, "step")


@pytest.mark.parametrize(
    ("check", "refused"),
    [
        (checks.finite_number, [np.nan, np.inf, [1.0]]),
        (checks.nonzero_number, [0.0, -0.0, np.nan, -np.inf]),
        (checks.positive_number, [0.0, -1e-300, np.nan, np.inf]),
        (checks.number_not_below_zero, [-1e-300, np.nan, np.inf]),
        (checks.whole_number, [0, -1, 1.0, True, "1", np.timedelta64(1), None]),
        (checks.finite_numbers, [[1.0, np.nan], ["1"], [1j], [None], np.ones(2) * u.km]),
        (checks.finite_vector, [[], [[1.0]], [np.inf], ["x"]]),
    ],
)
def test_each_refuses_what_is_outside_its_range(check, refused):
    for value in refused:
        with pytest.raises(InputError, match=r"^dt\b"):
            check(value, "dt")


def test_counts_have_both_ends():
    assert [checks.whole_number(n, "n", least=0, most=3) for n in (0, 3)] == [0, 3]
    with pytest.raises(InputError, match="n must be a whole number >= 0, got -1"):
        checks.whole_number(-1, "n", least=0, most=3)
    with pytest.raises(InputError, match="n = 4: at most"):
        checks.whole_number(4, "n", least=0, most=3)


def test_the_place_of_what_is_not_finite_is_told():
    with pytest.raises(InputError, match=r"q\[1, 2\] is nan; expected finite numbers"):
        checks.finite_numbers([[0.0, 0.0, 0.0], [0.0, 0.0, np.nan]], "q")


def test_a_vector_is_a_copy():
    given = np.ones(2)
    checks.finite_vector(given, "q")[0] = 5.0
    assert given[0] == 1.0


def test_a_flag_is_true_or_false_and_nothing_that_equals_them():
    assert [checks.checked_flag(given, "x") for given in (True, np.False_)] == [True, False]
    assert checks.checked_choice(None, "x") is None
    for given in (1, 0.0, "yes", None, [True]):
        with pytest.raises(InputError, match=r"^flag is .*expected True or False$"):
            checks.checked_flag(given, "flag")


@pytest.mark.parametrize("given", [[0.0, 0.0, 0.0], [1.0, np.nan, 0.0], [[1.0, 0.0, 0.0]], 1.0, [1.0, 0.0], None])
def test_a_direction_has_finite_components_and_one_that_is_not_zero(given):
    assert checks.direction([0.0, 0.0, 2.0], "spin", width=3).tolist() == [0.0, 0.0, 2.0]
    with pytest.raises(InputError, match=r"^spin needs a direction, a finite vector of 3 numbers that is not zero"):
        checks.direction(given, "spin", width=3)
