"""Which cases of a test run by default. The others have the marker `nightly`: `make nightly` runs the whole product.

Each new combination of a method, a Lagrangian and options compiles kernels, so that full products are what a suite
spends its time on, while nearly all defects show in one value or in a pair of values.
"""

from __future__ import annotations

import functools
import inspect
import itertools
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import pytest

STANDARD = (
    "Gauss(stages=4)",
    "LobattoIIIAB(stages=3)",
    "StormerVerlet()",
    "WisdomHolman(coordinates='jacobi', kernel='modified-kick', corrector=17)",
)
"""The labels of the methods that stand for all where any will do: one of each family of kernels."""


def covering(factors: Sequence[Sequence[Any]], strength: int, allowed: Callable[..., bool]) -> set[tuple[int, ...]]:
    """Return places in a product, such that each allowed combination of `strength` factors is in one of them.

    The same in every run: of the cases that add most, the first one is taken.
    """
    product = [
        places
        for places in itertools.product(*(range(len(factor)) for factor in factors))
        if allowed(*(factor[k] for factor, k in zip(factors, places, strict=True)))
    ]
    chosen_factors = list(itertools.combinations(range(len(factors)), min(strength, len(factors))))
    parts = {places: {(at, tuple(places[k] for k in at)) for at in chosen_factors} for places in product}
    missing = set[Any]().union(*parts.values())
    taken: set[tuple[int, ...]] = set()
    while missing:
        best = max(product, key=lambda places: len(parts[places] & missing))  # the first of equals
        taken.add(best)
        missing -= parts[best]
    return taken


def cover(
    names: tuple[str, ...],
    *factors: Iterable[Any],
    strength: int = 2,
    allowed: Callable[..., bool] = lambda *values: True,
    ids: Callable[[Any], str] | None = None,
) -> pytest.MarkDecorator:
    """Parametrize a test over a product of which a covering runs by default: all pairs of values, or all values.

    strength : 2 for a covering of all pairs, 1 for one in which each value occurs
    allowed : whether a combination is a case at all
    """
    lists = [list(factor) for factor in factors]
    taken = covering(lists, strength, allowed)
    cases = []
    for places in itertools.product(*(range(len(values)) for values in lists)):
        values = [values[k] for values, k in zip(lists, places, strict=True)]
        if allowed(*values):
            cases.append(pytest.param(*values, marks=[] if places in taken else pytest.mark.nightly))
    return pytest.mark.parametrize(names, cases, ids=ids)


def first(count: int, cases: Iterable[Any]) -> list[Any]:
    """Return cases of which the first ones run by default."""
    return keep(lambda k, case: k < count, cases)


def every(step: int, cases: Iterable[Any]) -> list[Any]:
    """Return cases of which the first of each `step` runs by default."""
    return keep(lambda k, case: k % step == 0, cases)


def at(places: Iterable[int], cases: Iterable[Any]) -> list[Any]:
    """Return cases of which those at some places run by default."""
    places = set(places)
    return keep(lambda k, case: k in places, cases)


def only(wanted: Iterable[Any], cases: Iterable[Any]) -> list[Any]:
    """Return cases of which those run by default that are among `wanted`, or whose label or first value is."""
    wanted = list(wanted)

    def is_wanted(_: int, case: Any) -> bool:
        head = case[0] if isinstance(case, tuple) and case else case
        return any(x in wanted for x in (head, getattr(head, "label", None)) if x is not None)

    kept = keep(is_wanted, cases)
    assert any(not case.marks for case in kept), "none of the cases would run by default"
    return kept


def keep(wanted: Callable[[int, Any], bool], cases: Iterable[Any]) -> list[Any]:
    """Return cases; those for which `wanted(place, case)` is false are nightly. Marks of a case stay."""
    kept = []
    for k, case in enumerate(cases):
        marks = [] if wanted(k, case) else [pytest.mark.nightly]
        if hasattr(case, "marks"):  # a pytest.param
            kept.append(pytest.param(*case.values, id=case.id, marks=[*case.marks, *marks]))
        else:
            kept.append(pytest.param(*(case if isinstance(case, tuple) else (case,)), marks=marks))
    return kept


def each(names: str | tuple[str, ...], cases: Iterable[Any]) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Make one test of a function that is cheap for each of many cases; it lists all cases that fail.

    Fixtures are made once for all cases. A case may be skipped; the test is if all of them are.
    """
    keys = (names,) if isinstance(names, str) else names
    cases = list(cases)

    def one_test_of(check: Callable[..., None]) -> Callable[..., None]:
        @functools.wraps(check)
        def test(**fixtures: Any) -> None:
            failures: list[str] = []
            skipped: list[BaseException] = []
            for case in cases:
                values = (case,) if isinstance(names, str) else case
                try:
                    check(**dict(zip(keys, values, strict=True)), **fixtures)
                except pytest.skip.Exception as reason:
                    skipped.append(reason)
                except (Exception, pytest.fail.Exception) as error:
                    failures.append(f"{', '.join(keys)} = {case!r}\n{type(error).__name__}: {error}")
            if failures:
                head = f"{len(failures)} of {len(cases)} cases fail"
                pytest.fail("\n\n".join([head, *failures]), pytrace=False)
            if len(skipped) == len(cases):
                raise skipped[-1]

        signature = inspect.signature(check)
        others = [parameter for name, parameter in signature.parameters.items() if name not in keys]
        vars(test)["__signature__"] = signature.replace(parameters=others)
        return test

    return one_test_of
