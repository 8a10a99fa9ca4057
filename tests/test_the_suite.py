"""The suite itself: what several tests need stands in a module of its own."""

import ast
from pathlib import Path

TESTS = Path(__file__).parent


def test_no_test_module_imports_from_another():
    found = []
    for path in TESTS.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_bytes())):
            if isinstance(node, ast.Import | ast.ImportFrom):
                parts = [*(getattr(node, "module", None) or "").split("."), *(alias.name for alias in node.names)]
                if any(part.startswith("test_") for name in parts for part in name.split(".")):
                    found.append(f"{path.relative_to(TESTS)}:{node.lineno}")
    assert not found
