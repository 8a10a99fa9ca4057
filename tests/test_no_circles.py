"""No file of the package imports another one that leads back to it, at its top or inside a function."""

from collections.abc import Iterator, Mapping

import grimp
import pytest


def circle(imports: Mapping[str, set[str]]) -> list[str]:
    """Return the names that import one another in a ring, in this order, or nothing.

    imports : what each imports
    """
    left = {name: set(found) & set(imports) for name, found in imports.items()}
    while ends := [name for name, found in left.items() if not found]:
        left = {name: found.difference(ends) for name, found in left.items() if found}
    path = [min(left)] if left else []  # whatever is left imports something that is left: one gets back somewhere
    while path:
        after = min(left[path[-1]])
        if after in path:
            return path[path.index(after) :]
        path.append(after)
    return path


def knots(imports: Mapping[str, set[str]]) -> Iterator[set[str]]:
    """Yield the sets of names each of which leads to all others.

    imports : what each imports
    """
    onward = {name: reached(name, imports) for name in imports}
    left = {name for name, found in onward.items() if name in found}
    while left:
        name = min(left)
        together = {other for other in onward[name] if name in onward.get(other, ())}
        left -= together
        yield together


def reached(name: str, imports: Mapping[str, set[str]]) -> set[str]:
    """Return what a name imports, and all that this imports in its turn."""
    found: set[str] = set()
    ahead = [name]
    while ahead:
        new = imports.get(ahead.pop(), set()) - found
        found |= new
        ahead += new
    return found


MOST_TOGETHER = 15
"""The most files that may know one another's types: `System` with its methods, which stand in files of their own, are
fourteen, `Trajectory` with its methods eight."""


@pytest.fixture(scope="module")
def files() -> dict[str, set[str]]:
    """What each file imports, for running it: what is imported for type checkers alone does not count."""
    graph = grimp.build_graph("orbits", exclude_type_checking_imports=True, cache_dir=None)
    return {name: graph.find_modules_directly_imported_by(name) for name in graph.modules}


@pytest.fixture(scope="module")
def types() -> dict[str, set[str]]:
    """What each file imports, for running it or for its annotations."""
    graph = grimp.build_graph("orbits", exclude_type_checking_imports=False, cache_dir=None)
    return {name: graph.find_modules_directly_imported_by(name) for name in graph.modules}


def test_files_that_know_one_anothers_types_are_few(types):
    for together in knots(types):
        assert len(together) <= MOST_TOGETHER, sorted(together)


def test_one_annotation_that_points_upwards_ties_many_files_together(types):
    # As before there were protocols: pictures took a `Trajectory`, which draws them.
    low, high = "orbits.plotting.pictures", "orbits.trajectory.trajectory"
    (together,) = (knot for knot in knots({**types, low: types[low] | {high}}) if low in knot)
    assert high in together
    assert len(together) > MOST_TOGETHER


def test_a_knot_has_all_that_lead_to_one_another_and_nothing_else():
    imports = {"a": {"b"}, "b": {"c"}, "c": {"b", "d"}, "d": set(), "e": {"f"}, "f": {"e", "a"}}
    assert sorted(map(sorted, knots(imports))) == [["b", "c"], ["e", "f"]]


def test_no_file_imports_its_way_back_to_itself(files):
    found = circle(files)
    assert not found, " -> ".join([*found, found[0]])


def test_imports_inside_functions_count_and_a_circle_of_many_files_is_seen(files):
    # Imported inside a function.
    assert "orbits.propagation.marchers" in files["orbits.propagation.resuming.marching_again"]
    low, high = "orbits.kernels.sums.summation", "orbits.scenario.command"
    closed = {**files, low: files[low] | {high}}
    assert {low, high} <= set(circle(closed))


def test_what_merely_leads_into_a_circle_is_not_part_of_it():
    imports = {"a": {"b"}, "b": {"c"}, "c": {"b", "d"}, "d": set()}
    assert sorted(circle(imports)) == ["b", "c"]
    assert circle({"a": {"b"}, "b": {"c", "d"}, "c": {"d"}, "d": set()}) == []
