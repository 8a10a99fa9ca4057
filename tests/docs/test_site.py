"""The site: it builds without a warning, without a network, and shows all that the registries have."""

from __future__ import annotations

import re
from html import unescape
from pathlib import Path
from urllib.parse import unquote

import pytest
import typer

pytest.importorskip("sphinx", reason="Sphinx comes with the extra 'docs'")

from public_names import documented

import orbits
from orbits.cli import app
from orbits.integrators import registry
from orbits.plotting import style
from orbits.scenario import bundled

from ..coverings import each

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.nightly
def test_the_site_builds_without_a_warning_or_a_network(site: Path) -> None:
    assert (site / "index.html").is_file()
    assert (site / "searchindex.js").is_file()


@pytest.mark.nightly
def test_every_reference_within_the_site_leads_somewhere(site: Path) -> None:
    pages = {page: page.read_text(encoding="utf-8") for page in site.rglob("*.html")}
    anchors = {page: {unescape(found) for found in re.findall(r' id="([^"]+)"', text)} for page, text in pages.items()}
    for page, text in pages.items():
        for target in re.findall(r' (?:href|src)="(?!https?:|#|data:)([^"]+)"', text):
            path, _, anchor = unquote(unescape(target)).partition("#")
            file = (page.parent / path.split("?")[0]).resolve()
            assert file.is_file(), f"{page}: {target}"
            # Listings of source name all their objects by one module, also those that are documented under another.
            listing = "_modules" in page.parts
            assert not anchor or anchor in anchors[file] or listing, f"{page}: {target}"


@pytest.mark.nightly
def test_nothing_is_loaded_from_elsewhere(site: Path) -> None:
    for page in site.rglob("*.html"):
        text = page.read_text(encoding="utf-8")
        assert not re.findall(r'(?:src="|<link [^>]*rel="stylesheet"[^>]*href=")https?:[^"]*', text), page
    for sheet in site.rglob("*.css"):
        assert not re.findall(r"(?:@import|url\() *[\"']?https?:[^\"')]*", sheet.read_text(encoding="utf-8")), sheet


@pytest.mark.nightly
def test_every_public_name_has_its_place(site: Path) -> None:
    text = "".join(page.read_text(encoding="utf-8") for page in (site / "_generated" / "api").glob("*.html"))
    shown = set(re.findall(r' id="(orbits\.[\w.]+)"', text))
    assert {f"orbits.{name}" for name in orbits.__all__ if not name.startswith("_")} <= shown
    assert {entry.full_name for entry in documented()} <= shown


@each("name", [entry.full_name for entry in documented()])
def test_every_name_of_the_reference_is_documented(name: str) -> None:
    (entry,) = [entry for entry in documented() if entry.full_name == name]
    assert entry.doc, f"{name} is public and has no docstring"


@pytest.mark.nightly
def test_every_scenario_integrator_and_command_is_shown(site: Path) -> None:
    gallery, methods, commands = (
        (site / f"{page}.html").read_text(encoding="utf-8") for page in ("gallery", "integrators", "command_line")
    )
    for scenario in bundled():
        assert f'href="_generated/scenarios/{scenario.name}.html"' in gallery
    for cls in registry().values():
        (name,) = (entry.full_name for entry in documented() if entry.value is cls)
        assert f"_generated/api/orbits.methods.html#{name}" in methods
    assert methods.index("<table") < methods.index("<h2>")  # the overview, then each method
    group = typer.main.get_command(app)
    for name, command in group.commands.items():
        assert f"<h2>orbits {name}" in commands
        for parameter in command.params:
            forms = [parameter.metavar] if parameter.param_type_name == "argument" else parameter.opts
            assert all(f">{form}" in commands for form in forms if form != "--help")


def test_pictures_of_the_gallery_are_shown_whole() -> None:
    css = (ROOT / "docs" / "_static" / "site.css").read_text(encoding="utf-8")
    (image,) = re.findall(r"\.card img \{([^}]*)\}", css)
    assert "object-fit: contain" in image
    assert "cover" not in css


def test_figures_are_wide_enough_to_be_read_and_small_enough_for_the_repository() -> None:
    for path in (ROOT / "docs" / "figures").glob("*.png"):
        width = int.from_bytes(path.read_bytes()[16:20], "big")
        assert 1400 <= width <= 1920, path.name
        assert path.stat().st_size < 460_000, path.name  # 452 kB: the dots of the pendulum


@pytest.mark.parametrize("name", ["kepler", "solar_system", "discrete_kepler"])
def test_figures_keep_the_colours_that_tell_methods_apart(name: str) -> None:
    import numpy as np
    from matplotlib.colors import to_rgb
    from matplotlib.image import imread

    pixels = (imread(ROOT / "docs" / "figures" / f"{name}.png")[..., :3] * 255).round().astype(int)
    packed = np.unique(pixels @ (65536, 256, 1))
    seen = np.column_stack([packed // 65536, packed // 256 % 256, packed % 256])
    for colour in style.PALETTE[:4]:
        # 3 of 255 at most is reached; the most frequent 128 colours left purple grey, off by 50.
        assert np.abs(seen - 255 * np.array(to_rgb(colour))).max(axis=1).min() < 6
