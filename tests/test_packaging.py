"""The wheel: what travels in it, and that it finds it, without the checkout and without a network."""

from __future__ import annotations

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

wheel_builder = pytest.importorskip("hatchling.builders.wheel", reason="hatchling comes with the extra 'dev'")

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    builder = wheel_builder.WheelBuilder(str(ROOT))
    (artifact,) = builder.build(directory=str(tmp_path_factory.mktemp("wheel")), versions=["standard"])
    return Path(artifact)


@pytest.fixture(scope="module")
def unpacked(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(folder)
    return folder


def files_below(folder: Path, suffixes: tuple[str, ...] = ()) -> set[str]:
    return {
        path.relative_to(folder).as_posix()
        for path in folder.rglob("*")
        if path.is_file() and "__pycache__" not in path.parts and (not suffixes or path.suffix in suffixes)
    }


def run(unpacked: Path, folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run Python in `folder` with the unpacked wheel before everything else, the checkout included."""
    environment = {**os.environ, "PYTHONPATH": str(unpacked)}
    command = [sys.executable, *arguments]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=99, check=False)


@pytest.mark.parametrize("name", ["data", "scenarios"])
def test_the_wheel_carries_the_bundled_folders_whole_and_unchanged(unpacked: Path, name: str) -> None:
    bundled = unpacked / "orbits" / "_bundled" / name
    assert files_below(bundled) == files_below(ROOT / name)
    for path in files_below(bundled):
        assert (bundled / path).read_bytes() == (ROOT / name / path).read_bytes()


def test_the_wheel_carries_every_module_the_page_the_marker_of_types_and_nothing_else(
    wheel: Path, unpacked: Path
) -> None:
    with zipfile.ZipFile(wheel) as archive:
        packed = {path.removeprefix("orbits/") for path in archive.namelist() if path.startswith("orbits/")}
    modules = {path for path in packed if not path.startswith("_bundled/")}
    page = {path for path in files_below(ROOT / "orbits") if path.startswith("viewing/static/")}
    assert {"viewing/static/three.min.js", "viewing/static/three.LICENSE", "viewing/static/view.css"} <= page
    assert modules == files_below(ROOT / "orbits", (".py", ".typed")) | page
    assert "py.typed" in modules
    assert {path.name for path in unpacked.iterdir()} == {"orbits", f"orbits-{version(unpacked)}.dist-info"}


def version(unpacked: Path) -> str:
    done = run(unpacked, unpacked, "-c", "import orbits; print(orbits.__version__)")
    return done.stdout.strip()


def test_the_wheel_names_its_version_licence_and_command(unpacked: Path) -> None:
    (info,) = unpacked.glob("*.dist-info")
    metadata = (info / "METADATA").read_text(encoding="utf-8")
    assert f"\nVersion: {version(unpacked)}\n" in metadata
    assert "\nLicense-Expression: MIT\n" in metadata
    assert "\nRequires-Python: >=3.11\n" in metadata
    assert (info / "licenses" / "LICENSE").is_file()
    assert "orbits = orbits.cli:main" in (info / "entry_points.txt").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def installed(unpacked: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[list[str], list[Path]]:
    """Return what the package and its command line say in an empty folder, by lines, and what is there afterwards."""
    folder = tmp_path_factory.mktemp("anywhere")
    code = (
        "import orbits\n"
        "print(orbits.__file__)\n"
        "print(orbits.resources.scenarios_dir())\n"
        "print(orbits.System.solar_system('2022-08-09').add_particles(orbits.asteroids(5)))\n"
        "import sys; from orbits.cli import main; sys.argv[1:] = ['list']; main()\n"
    )
    done = run(unpacked, folder, "-c", code)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines(), list(folder.iterdir())


def test_an_installed_package_reads_its_own_data_in_any_folder(
    unpacked: Path, installed: tuple[list[str], list[Path]]
) -> None:
    source, scenarios, system = installed[0][:3]
    assert Path(source) == unpacked / "orbits" / "__init__.py"
    assert Path(scenarios) == unpacked / "orbits" / "_bundled" / "scenarios"
    assert "10 massive, 5 massless" in system


def test_an_installed_command_line_lists_the_bundled_scenarios_in_an_empty_folder(
    installed: tuple[list[str], list[Path]],
) -> None:
    said, left = "\n".join(installed[0][3:]), installed[1]
    for path in files_below(ROOT / "scenarios", (".py",)):
        assert Path(path).stem in said
    assert not left
