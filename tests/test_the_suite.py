"""The suite itself: what several tests need stands in a module of its own, and few cases run by default."""

import re
from collections import Counter
from pathlib import Path

import pytest

TESTS = Path(__file__).parent
MOST_CASES = 40
"""A function with more cases is a product, whose covering suffices by default, or a loop (`tests/coverings.py`)."""


IMPORTED = re.compile(r"^\s*(?:from\s+(\S+)\s+)?import\s+(\([^)]*\)|.*)", re.MULTILINE)
"""The module that something is imported from, and what is, also in lines of their own between brackets."""


def test_no_test_module_imports_from_another():
    found = []
    for path in TESTS.rglob("*.py"):
        for words in IMPORTED.findall(path.read_text(encoding="utf-8")):
            if re.search(r"\btest_", " ".join(words)):
                found.append(f"{path.relative_to(TESTS)}: {words}")
    assert not found


def test_no_function_has_more_than_forty_cases_by_default(request):
    if "not nightly" not in request.config.option.markexpr:
        pytest.skip("whole products were asked for")
    counts = Counter(item.nodeid.partition("[")[0] for item in request.session.items)
    assert {name: count for name, count in counts.items() if count > MOST_CASES} == {}
