"""Zeros of functions in steps: which are found, on functions made to hide them."""

import numpy as np
import pytest

from orbits.propagation.events.base import Bound
from orbits.propagation.events.search.brackets import CHECKS, NotFiniteError
from orbits.propagation.events.search.meaning import DIRECTIONS, are_clear
from orbits.propagation.events.search.zeros import Zeros, zeros_of

from ..coverings import cover


class Still:
    """Steps of bodies that do not move: functions of time alone."""

    def __init__(self, times):
        self.times = np.asarray(times, dtype=float)
        self.backwards = bool(self.times[-1] < self.times[0])

    def __len__(self):
        return len(self.times) - 1

    def _states(self, t):
        return t, np.zeros((len(t), 1, 3)), np.zeros((len(t), 1, 3))

    def at(self, steps, fractions, rough=False):
        return self._states(self.times[steps] + fractions * (self.times[steps + 1] - self.times[steps]))

    def at_checks(self, steps, fractions):
        numbers = np.arange(steps.start, steps.stop)
        return self.at(np.repeat(numbers, len(fractions)), np.tile(fractions, len(numbers)))

    def ends(self):
        return self._states(self.times)


class OfTime(Bound):
    """A function of time."""

    def __init__(self, function, words=("falls", "rises")):
        super().__init__(words, [(-1, -1)])
        self.function = function

    def values(self, t, q, v, columns):
        return np.asarray(self.function(t))[:, None]


def times_of(function, times, words=("falls", "rises")):
    """Return the times of the zeros of a function, and which of them rise."""
    stretch = Still(times)
    ((found, missing),) = zeros_of([OfTime(function, words)], stretch)
    if missing is not None:
        raise missing
    return stretch.at(found.steps, found.fractions)[0], found.rising


def parabola(a, b):
    return lambda t: (t - a) * (t - b)


class Bulging(Still):
    """Steps whose rough motion is off by a parabola between their ends."""

    size = 1e3

    def at(self, steps, fractions, rough=False):
        t, q, v = super().at(steps, fractions)
        q[:, 0, 0] = self.size * fractions * (1.0 - fractions) * rough
        return t, q, v

    def at_checks(self, steps, fractions):
        numbers = np.arange(steps.start, steps.stop)
        return self.at(np.repeat(numbers, len(fractions)), np.tile(fractions, len(numbers)), rough=True)


class OnTheWay(Bound):
    """The sine of time, and how far a body is."""

    def values(self, t, q, v, columns):
        return (np.sin(t) + q[:, 0, 0])[:, None]


EDGES = np.append(CHECKS, 1.0)


@pytest.mark.parametrize("times", [np.arange(11.0), np.arange(11.0)[::-1]], ids=["forwards", "backwards"])
def test_two_zeros_between_two_checks_are_found_wherever_and_however_close_they_are(times):
    rng = np.random.default_rng(4)
    for apart in (1e-2, 1e-4, 1e-6):
        for _ in range(20):
            step, check = rng.integers(10), rng.integers(len(CHECKS))
            low, high = EDGES[check], EDGES[check + 1]
            a = low + 1e-3 + rng.random() * (high - low - 1e-3 - 1.1 * apart) if high - low > 2 * apart else low
            a, sign = step + a, rng.choice([-1.0, 1.0])
            found, rising = times_of(lambda t, a=a, s=sign, d=apart: s * parabola(a, a + d)(t), times)
            order = np.argsort(found)
            # Half a unit in the last place of times up to 10, twice: 1.8e-15 seen.
            np.testing.assert_allclose(found[order], [a, a + apart], rtol=0.0, atol=4e-15)
            assert rising[order].tolist() == [sign < 0.0, sign > 0.0]


def test_two_zeros_close_together_take_few_evaluations():
    """The least value between them is found with the bend of the function, by Newton's method, not by halving."""
    rng, calls = np.random.default_rng(4), []
    for place in rng.uniform(0.0, 10.0, 40):

        def function(t, a=place):
            calls.append(a)
            return parabola(a, a + 1e-4)(t)

        times_of(function, np.arange(11.0))
    assert len(calls) < 41 * 40  # 37.9 for each; 45.4 with a bend that is wrong by a thousandth of the value


def test_a_function_that_hardly_misses_zero_has_none():
    for missed in (1e-12, 1e-3):
        found, _ = times_of(lambda t, m=missed: (t - 2.31) ** 2 + m, np.arange(6.0))
        assert not len(found)


def test_a_narrow_dip_with_one_extremum_between_two_checks_is_found():
    # A dip of width 1e-3 in a step of 1: nothing of it is seen at the checks but the slopes towards it.
    middle = 0.5 * (CHECKS[4] + CHECKS[5])
    found, _ = times_of(lambda t: 1.0 - 1.5 / (1.0 + ((t - middle) / 1e-3) ** 2) ** 0.1, np.arange(4.0))
    assert len(found) == 2
    assert abs(found.mean() - middle) < 1e-12


def test_zeros_with_two_extrema_between_two_checks_may_stay_unseen():
    """The guarantee excludes a wave with many extrema between two checks."""
    found, _ = times_of(lambda t: np.sin(2.0 * np.pi * 40.0 * t + 0.1), np.arange(3.0))
    assert 0 < len(found) < 160


@cover(
    ("place", "sign", "times"),
    [3.0, 3.0 + CHECKS[1], 3.0 + CHECKS[6]],
    [1.0, -1.0],
    [np.arange(8.0), np.arange(8.0)[::-1]],
    strength=1,
)
def test_a_zero_exactly_at_a_check_counts_once(place, sign, times):
    found, rising = times_of(lambda t: sign * (t - place), times)
    assert found.tolist() == [place]
    assert rising.tolist() == [sign > 0.0]


def test_only_the_wanted_direction_is_returned_and_it_is_one_in_time():
    def wave(t):
        return np.sin(np.pi * (t - 0.25))

    for times in (np.arange(0.0, 7.0), np.arange(0.0, 7.0)[::-1]):
        falls, rising = times_of(wave, times, ("falls", None))
        assert not rising.any()
        np.testing.assert_allclose(np.sort(falls), [1.25, 3.25, 5.25], rtol=0.0, atol=1e-15)
        rises, rising = times_of(wave, times, (None, "rises"))
        assert rising.all()
        np.testing.assert_allclose(np.sort(rises), [0.25, 2.25, 4.25], rtol=0.0, atol=1e-15)


def test_several_zeros_in_one_step_come_in_their_order():
    places = [0.03, 0.2, 0.21, 0.55, 0.97]
    found, _ = times_of(lambda t: np.prod([t - x for x in places], axis=0), [0.0, 1.0])
    np.testing.assert_allclose(found, places, rtol=0.0, atol=1e-12)
    assert (np.diff(found) > 0.0).all()


def test_the_division_into_stretches_does_not_change_a_bit():
    def function(t):
        return np.sin(7.3 * t) + 0.3 * np.cos(31.0 * t)

    times = np.arange(0.0, 40.0)
    whole, _ = times_of(function, times)
    parts = [times_of(function, times[a : b + 1])[0] for a, b in ((0, 7), (7, 8), (8, 39))]
    assert len(whole) > 90
    np.testing.assert_array_equal(whole, np.concatenate(parts))


@pytest.mark.parametrize("times", [np.arange(8.0), np.arange(8.0)[::-1], 1e6 + np.arange(8.0)],
                         ids=["forwards", "backwards", "late"])  # fmt: skip
def test_a_change_of_sign_through_infinity_is_no_zero(times):
    base = min(times)
    poles = [
        lambda x: 1.0 / (x - 3.1234),
        lambda x: -1.0 / (x - 3.1234) ** 3,
        lambda x: 1.0 / np.cbrt(x - 3.1234),
        lambda x: 1e-12 / (x - 3.1234) + 1.0,  # with a zero close by, at 3.1234 - 1e-12
        lambda x: np.tan(x),  # zeros at pi and 2 pi, poles in between
    ]
    zeros = [[], [], [], None, [np.pi, 2.0 * np.pi]]
    for function, expected in zip(poles, zeros, strict=True):
        with np.errstate(divide="ignore"):
            found, _ = times_of(lambda t, f=function: f(t - base), times)
        if expected is not None:
            np.testing.assert_allclose(np.sort(found - base), expected, rtol=0.0, atol=1e-9)


def test_where_a_function_is_not_finite_is_said():
    with pytest.raises(NotFiniteError) as caught:
        times_of(lambda t: np.where(t > 2.5, np.nan, 1.0), np.arange(6.0))
    assert 2.5 < caught.value.time < 2.7
    assert np.isnan(caught.value.value)


@pytest.mark.parametrize(
    ("size", "clear", "tried"), [(1e-8, True, 1), (1e-13, True, DIRECTIONS), (1e-15, False, DIRECTIONS)]
)
def test_what_may_be_round_off_is_judged_by_all_directions_and_what_is_far_above_it_by_one(size, clear, tried):
    directions = []

    class Watched(Bound):
        """A function of which round-off makes 1e-14."""

        def values(self, t, q, v, columns):
            directions.append(q.copy())
            return np.full((len(t), 1), 1e-12)

    zero = Zeros(*(np.array([x]) for x in (0, 0.5, 0, True, size)))
    state = np.zeros(1), np.ones((1, 2, 3)), np.ones((1, 2, 3))
    assert are_clear(Watched(("falls", "rises"), [(0, 1)]), zero, np.ones(1), 1.0, *state).tolist() == [clear]
    assert len(np.unique(directions, axis=0)) == len(directions) == tried


@pytest.mark.parametrize("sign", [1.0, -1.0], ids=["forwards", "backwards"])
@pytest.mark.parametrize("size", [1e3, -1e3])
def test_functions_of_which_the_rough_motion_tells_little_are_zero_where_their_sign_changes(size, sign):
    stretch = Bulging(sign * np.arange(0.5, 30.0))
    stretch.size = size
    for words, first, period in ((("falls", "rises"), 1, 1), ((None, "rises"), 2, 2), (("falls", None), 1, 2)):
        ((found, _),) = zeros_of([OnTheWay(words, [(-1, -1)])], stretch)
        expected = sign * np.pi * np.arange(first, 10, period)
        # Fractions of steps are found to 1e-15, times up to 30 rounded to 3.6e-15: 7e-15 seen.
        np.testing.assert_allclose(stretch.at(found.steps, found.fractions)[0], expected, rtol=0.0, atol=2e-14)
        assert (found.rising == (np.cos(expected) > 0.0)).all()
