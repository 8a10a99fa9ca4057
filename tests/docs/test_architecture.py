"""The page on how the package is built names the layers that it is held to, and files that are there."""

from __future__ import annotations

import re
import tomllib
from itertools import pairwise
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")

def test_the_page_has_the_layers_in_their_order() -> None:
    """Every layer stands in the table; those of a row may stand in any order, as they may beside each other."""
    pyproject = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    (contract,) = [c for c in pyproject["tool"]["importlinter"]["contracts"] if c["id"] == "layers"]
    held = [name.strip("() ") for layer in contract["layers"] for name in layer.split("|")]
    table = PAGE.partition("## Layers")[2].partition("\n## ")[0]
    rows = [re.findall(r"`([^`]+)`", row) for row in re.findall(r"^\| (`.*?) \|", table, re.MULTILINE)]
    assert sorted(name for row in rows for name in row) == sorted(held)
    places = [{held.index(name) for name in row} for row in rows]
    assert all(max(above) < min(below) for above, below in pairwise(places))


def test_every_file_and_folder_that_the_page_names_is_there() -> None:
    """By the whole path, or by the end of it that the sentence needs."""
    named = set(re.findall(r"`((?:[a-z_0-9]+/)+(?:[a-z_0-9]+\.py)?)`", PAGE))
    assert len(named) > 30
    there = [f"/{path.relative_to(ROOT)}" for path in (*ROOT.glob("orbits/**/"), *ROOT.glob("orbits/**/*.py"))]
    there += [f"/{path.relative_to(ROOT)}" for path in (*ROOT.glob("[a-z]*/"), *ROOT.glob("scripts/*.py"))]
    missing = [name for name in named if not any(path.endswith(f"/{name.rstrip('/')}") for path in there)]
    assert [name for name in missing if "NAME" not in name] == []


def test_the_page_fits_into_one_reading() -> None:
    """At most 200 lines, with an example for each of the six contracts."""
    assert len(PAGE.splitlines()) <= 200
    assert len(re.findall(r"^\*\*[1-6]\. ", PAGE, re.MULTILINE)) == PAGE.count("```py\n") == 6
