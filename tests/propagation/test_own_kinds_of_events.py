"""Kinds of events of a user's: what is not as it should be is said before the run."""

from dataclasses import dataclass

import pytest

import orbits
from orbits.errors import InputError
from orbits.propagation.events.base import Bound, PairBound, Sought


def run(event):
    bodies = {"star": {"gm": 1.0}, "planet": {"a": 1.0, "e": 0.3, "M": 0.3, "gm": 1e-9}}
    system = orbits.System.from_elements(bodies, units=orbits.DIMENSIONLESS)
    return orbits.propagate(system, duration=6.0, events=event)


class Sine(PairBound):
    """A function of a pair of bodies."""

    def of(self, q, v):
        """Return a component."""
        return q[..., 1]


class Broad(PairBound):
    """One that returns all components."""

    def of(self, q, v):
        """Return vectors."""
        return q


class Flat(Bound):
    """One of all states that has no columns."""

    def values(self, t, q, v, columns):
        """Return one number for each time."""
        return q[:, 1, 1]


class Twice(Bound):
    """One that returns two columns for one."""

    def values(self, t, q, v, columns):
        """Return columns."""
        return q[:, 1, :2]


@dataclass(frozen=True)
class Kind(Sought):
    """A kind of event that a test makes."""

    functions: object = ()

    def bound(self, system):
        """Return what the test gives."""
        return self.functions


@dataclass(frozen=True)
class Empty(Sought):
    """A kind of event without functions."""


WORDS = ("down", "up")

KINDS = [
    (Empty(), r"Empty has no functions; expected a method bound\(self, system\)"),
    (Kind(Sine(WORDS, [(1, 0)])), "Kind.bound returned <.*Sine object.*expected a list of functions"),
    (Kind([7]), r"Kind.bound returned \[7\]; expected a list"),
    (Kind([Sine("up", [(1, 0)])]), "the words of Sine are 'up'; expected a pair"),
    (Kind([Sine(("down", 3), [(1, 0)])]), r"the words of Sine are \('down', 3\)"),
    (Kind([Sine(WORDS, [(1, 9)])]), "Sine is of body number 9; expected numbers from 0 to 1, as system.index"),
    (Kind([Sine(WORDS, [(-2, 0)])]), "Sine is of body number -2"),
    (Kind([Broad(WORDS, [(1, 0)])]), "Broad fails at the start of the run: ValueError: .*Expected `of` of a PairBound"),
    (Kind([Flat(WORDS, [(1, 0)])]), "Flat fails at the start of the run: IndexError: .*Expected `of`"),
    (Kind([Twice(WORDS, [(1, 0)])]), "Twice returned shape .* for two times. Expected `of`"),
    (Kind([PairBound(WORDS, [(1, 0)])]), "PairBound fails at the start of the run: NotImplementedError"),
]


@pytest.mark.parametrize(("event", "message"), KINDS)
def test_a_kind_of_event_that_is_not_as_it_should_be_is_refused_before_the_run(event, message):
    with pytest.raises(InputError, match=message):
        run(event)


def test_a_kind_of_event_that_is_as_it_should_be_is_sought():
    assert run(Kind([Sine(WORDS, [(1, 0)])])).events.kind.tolist() == ["down", "up"]
