"""The page on how the package is built names the layers that it is held to, and files that are there."""

from __future__ import annotations

import inspect
import re
import tomllib
from pathlib import Path

import pytest

from orbits.kernels import steps

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")

def test_the_page_has_the_layers_in_their_order() -> None:
    pyproject = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    (contract,) = [c for c in pyproject["tool"]["importlinter"]["contracts"] if c["id"] == "layers"]
    held = [name.strip("() ") for layer in contract["layers"] for name in layer.split("|")]
    table = PAGE.partition("## The layers")[2].partition("\n## ")[0]
    shown = [
        name for row in re.findall(r"^\| (`.*?) \|", table, re.MULTILINE) for name in re.findall(r"`([^`]+)`", row)
    ]
    assert shown == held


def test_every_file_and_folder_that_the_page_names_is_there() -> None:
    named = set(re.findall(r"`((?:orbits/)?(?:[a-z_0-9]+/)+(?:[a-z_0-9]+\.py)?)`", PAGE))
    assert len(named) > 30
    missing = [path for path in named if not (ROOT / "orbits" / path.removeprefix("orbits/")).exists()]
    assert missing == []


@pytest.mark.parametrize("name", ["State", "Particles", "Model", "Method", "Share", "Storage"])
def test_the_page_shows_the_values_of_the_contract(name: str) -> None:
    assert f"| `{name}` |" in PAGE
    assert hasattr(steps, name)


@pytest.mark.parametrize("name", ["begin", "step", "begin_particles", "step_particles"])
def test_the_page_shows_the_functions_of_the_contract_as_they_are(name: str) -> None:
    arguments = ", ".join(inspect.signature(getattr(steps, name)).parameters)
    assert f"| `{name}({arguments})` |" in PAGE
