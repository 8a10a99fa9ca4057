"""Bundled files are found by name, and a missing one is named."""

from __future__ import annotations

from pathlib import Path

import pytest

from orbits import resources
from orbits.errors import OrbitsError, UnknownNameError


def test_data_files_are_found() -> None:
    assert resources.data_path("gm_de440.json").is_file()
    assert resources.scenarios_dir().is_dir()


@pytest.mark.parametrize("name", ["nothing.json", "../pyproject.toml", ""])
def test_a_missing_data_file_is_refused_with_the_list_of_those_there_are(name: str) -> None:
    with pytest.raises(UnknownNameError, match=r"gm_de440\.json"):
        resources.data_path(name)


def test_an_installation_without_its_folders_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # Beside site-packages there may be any folder called data: only a checkout's own counts.
    (tmp_path / "data").mkdir()
    monkeypatch.setattr(resources, "__file__", str(tmp_path / "orbits" / "resources.py"))
    with pytest.raises(OrbitsError, match=r"has no data/ folder; looked for .*_bundled"):
        resources.data_path("gm_de440.json")


def test_the_folders_of_a_wheel_come_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    inside = tmp_path / "orbits" / "_bundled" / "data"
    inside.mkdir(parents=True)
    (inside / "x.json").write_text("{}", encoding="utf-8")
    monkeypatch.setattr(resources, "__file__", str(tmp_path / "orbits" / "resources.py"))
    assert resources.data_path("x.json") == inside / "x.json"
