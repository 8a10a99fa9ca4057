"""The suite itself: what several tests need stands in a module of its own, and few cases run by default."""

import ast
from collections import Counter
from pathlib import Path

import pytest

TESTS = Path(__file__).parent
MOST_CASES = 40
"""A function with more cases is a product, whose covering suffices by default, or a loop (`tests/coverings.py`)."""


def test_no_test_module_imports_from_another():
    found = []
    for path in TESTS.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_bytes())):
            if isinstance(node, ast.Import | ast.ImportFrom):
                parts = [*(getattr(node, "module", None) or "").split("."), *(alias.name for alias in node.names)]
                if any(part.startswith("test_") for name in parts for part in name.split(".")):
                    found.append(f"{path.relative_to(TESTS)}:{node.lineno}")
    assert not found


def test_no_function_has_more_than_forty_cases_by_default(request):
    if "not nightly" not in request.config.option.markexpr:
        pytest.skip("whole products were asked for")
    counts = Counter(item.nodeid.partition("[")[0] for item in request.session.items)
    assert {name: count for name, count in counts.items() if count > MOST_CASES} == {}
