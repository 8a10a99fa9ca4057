"""Every Python block of README and docs runs as it is typed, in the order of its page, in an empty folder.

So do the commands of the tutorials and of "How to extend it"; those of the other pages are such as the command line
understands.
"""

import ast
import importlib
import re
import shlex
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

import orbits
from orbits import integrators
from orbits.cli import app
from orbits.errors import InputError
from orbits.events import CloserThan, EnergyErrorAbove, FartherThan, WallTimeOver
from orbits.scenario import bundled
from orbits.terms import Drag

from .coverings import each, first, keep

ROOT = Path(__file__).resolve().parent.parent
WRITTEN = sorted(page for page in (ROOT / "docs").rglob("*.md") if "_generated" not in page.parts)
PAGES = [ROOT / "README.md", *WRITTEN]
BLOCK = re.compile(r"^```python\n(.*?)^```", re.MULTILINE | re.DOTALL)
FILE = re.compile(r"`(\w+\.py)`[^`]*```python\n(.*?)^```", re.MULTILINE | re.DOTALL)
SHELL = re.compile(r"^```sh\n(.*?)^```", re.MULTILINE | re.DOTALL)
LESSONS = ("docs/tutorials/", "docs/extending.md")
LINK = re.compile(r"\]\((?![a-z]+:)([^)#\s]*)(?:#([^)\s]+))?\)")


def name(page):
    return page.relative_to(ROOT).as_posix()


def text_of(page):
    return page.read_text(encoding="utf-8")


def blocks(page):
    return BLOCK.findall(text_of(page))


def save_files(page, folder):
    """Save the blocks that follow the name of a file under that name, as the reader is asked to."""
    for file, code in FILE.findall(text_of(page)):
        (folder / file).write_text(code, encoding="utf-8")


def commands(page):
    """Return what is typed after `orbits` in the shell blocks of a page, word by word, and whether it ends well."""
    lines = [line for block in SHELL.findall(text_of(page)) for line in block.splitlines()]
    return [
        (shlex.split(line, comments=True)[1:], "# exit code 1" not in line)
        for line in lines
        if line.startswith("orbits ")
    ]


RUN_BY_DEFAULT = ("from_rebound", "elements", "events")
"""Pages whose code needs kernels that tests need anyway; the others run nightly."""


@pytest.mark.parametrize("page", keep(lambda _, p: p.stem in RUN_BY_DEFAULT, [p for p in PAGES if blocks(p)]), ids=name)
def test_the_code_of_a_page_runs(page, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    save_files(page, tmp_path)
    monkeypatch.syspath_prepend(tmp_path)  # where a script finds the files beside it
    names = {"__name__": "page"}
    for number, code in enumerate(blocks(page), 1):
        exec(compile(code, f"{page.name}, block {number}", "exec"), names)


@each("page", [p for p in PAGES if blocks(p)])
def test_what_the_code_of_a_page_takes_from_the_package_is_there(page):
    """Also on pages whose code does not run by default."""
    for code in blocks(page):
        for node in ast.walk(ast.parse(code)):
            if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "orbits":
                module = importlib.import_module(node.module)
                assert [alias.name for alias in node.names if not hasattr(module, alias.name)] == []
            if isinstance(node, ast.Attribute) and ast.unparse(node).startswith("orbits."):
                found = orbits
                for part in ast.unparse(node).split(".")[1:]:
                    if not re.fullmatch(r"\w+", part):  # a method of what is made here
                        break
                    found = getattr(found, part)


@each("page", [p for p in PAGES if blocks(p)])
def test_a_page_whose_blocks_need_earlier_ones_says_so(page):
    alone = all(re.search("^(import|from) orbits", code, re.MULTILINE) for code in blocks(page))
    assert alone or re.search(r"build\s+on\s+each\s+other|in\s+this\s+order", text_of(page))


@pytest.mark.parametrize(
    "page",
    first(1, [p for p in PAGES if commands(p) and (p.parent.name == "tutorials" or p.stem == "extending")]),
    ids=name,
)
def test_the_commands_of_a_tutorial_end_as_it_says(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    save_files(page, tmp_path)
    for words, succeeds in commands(page):
        done = CliRunner().invoke(app, words)
        assert done.exit_code == (0 if succeeds else 1), (words, done.output)


@pytest.fixture(scope="module")
def scenarios():
    return {each.name for each in bundled()}


@each("page", [p for p in PAGES if commands(p)])
def test_the_command_line_understands_every_command_of_a_page(page, scenarios):
    group = typer.main.get_command(app)
    for (command, *words), _ in commands(page):
        arguments = group.commands[command].make_context(command, words).params
        scenario = arguments.get("scenario", "a.py")
        assert scenario.endswith(".py") or scenario in scenarios


@each("page", [*PAGES, ROOT / "CONTRIBUTING.md", ROOT / "data" / "README.md"])
def test_what_a_page_links_to_is_there(page):
    for target, heading in LINK.findall(text_of(page)):
        file = page.parent / target if target else page
        assert file.exists(), target
        if heading:
            assert heading in headings(file), f"{target}#{heading}"


def headings(page):
    """Return the anchors that a code forge gives to the headings of a page."""
    titles = re.findall(r"^#+ (.+)$", text_of(page), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


def test_the_citation_is_of_this_version():
    assert f"\nversion: {orbits.__version__}\n" in text_of(ROOT / "CITATION.cff")
    assert f"Version {orbits.__version__}." in text_of(ROOT / "docs" / "citing.md")


def test_tables_written_by_hand_have_all_that_is_registered(scenarios):
    methods, lagrangians, described = (
        text_of(ROOT / "docs" / f"{page}.md") for page in ("choosing", "lagrangians", "scenarios")
    )
    assert [cls.__name__ for cls in integrators.registry().values() if f"`{cls.__name__}(" not in methods] == []
    assert [key for key in orbits.lagrangians.registry() if f"| `{key.replace('-', '_')}` |" not in lagrangians] == []
    assert [name for name in scenarios if f"| `{name}` |" not in described] == []


NUMBER = re.compile(r"[-+]?\d[\d,]*\.?\d*(?:e[-+]?\d+)?")


def figures(text):
    return [float(number.replace(",", "")) for number in NUMBER.findall(text)]


def test_the_readme_is_short_and_its_example_prints_what_it_says(tmp_path, monkeypatch, capsys):
    text = text_of(ROOT / "README.md")
    assert len(text.splitlines()) <= 110
    assert len(text.split()) <= 700
    assert text.count("![") == 1
    monkeypatch.chdir(tmp_path)
    (code,) = blocks(ROOT / "README.md")
    (said,) = re.findall(r"^```text\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    exec(compile(code, "README.md", "exec"), {})
    printed = capsys.readouterr().out
    assert NUMBER.sub("", printed) == NUMBER.sub("", said)
    # The last figure is round-off, a few units in the last place of the energy: another processor may round one
    # differently, but a figure that has doubled is another one.
    *expected, rounding = figures(said)
    *found, change = figures(printed)
    assert found == expected
    assert 0.6 * rounding <= change <= 1.6 * rounding
    assert (tmp_path / "encounter.png").is_file()


@pytest.mark.nightly
def test_the_guide_names_the_conditions_that_terms_and_forces_exclude():
    """Each is tried under a force; the paragraph after the table of what acts names those that are refused."""
    after = text_of(ROOT / "docs" / "guide" / "terms.md").partition("| what acts | methods |")[2]
    (paragraph,) = (text for text in after.split("\n\n") if text.startswith("Another method refuses"))
    pair = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]], [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
    system = orbits.System(["a", "b"], [1.0, 0.1], *pair, units=orbits.DIMENSIONLESS)
    system = system.with_forces(Drag(rate=1e-3))
    conditions = [
        CloserThan(1e-3), FartherThan(1e3), EnergyErrorAbove(0.1), WallTimeOver(600)
    ]  # fmt: skip
    for condition in conditions:
        try:
            orbits.propagate(system, "gauss", dt=0.1, duration=0.5, samples=2, stop=condition, progress=False)
            refused = False
        except InputError:
            refused = True
        assert (f"`{type(condition).__name__}`" in paragraph) == refused, condition
