"""Pages of the reference as Markdown that is checked in, to be read without the site: made from the package itself.

    python docs/_ext/markdown_pages.py          # writes what has changed

A page that people write has a place for it, between `<!-- generated: NAME -->` and `<!-- end -->`; the API has a page
for each module, in docs/api/. A test holds all of them up to date. The site shows the same from the same sources, with
links to its own pages: see `registry_tables`.
"""

from __future__ import annotations

import importlib
import inspect
import re
import sys
from collections.abc import Iterable
from functools import cached_property
from pathlib import Path
from typing import Any

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from house_docstrings import blocks, code_block, parts
from house_docstrings import items as items_of
from public_names import DOCS, Entry, documented, public_name

from orbits.integrators import registry
from orbits.integrators.base import Integrator
from orbits.scenario import bundled

PLACE = re.compile(r"<!-- generated: (\S+) -->\n.*?<!-- end -->", re.DOTALL)
CODE = re.compile(r"(`[^`]+`)")
MARKUP = re.compile(r"[*<\[\]|]|(?<!\w)_|_(?!\w)")
API = DOCS / "api"


def pages() -> dict[Path, str]:
    """Return the text of every page that is made, or has a place for what is made, by its path."""
    made = {API / f"{module}.md": api_page(module) for module in api_pages()}
    for path in sorted(DOCS.glob("*.md")):
        text = path.read_text(encoding="utf-8")
        if PLACE.search(text):
            made[path] = PLACE.sub(lambda found: filled(found[1]), text)
    return made


def filled(name: str) -> str:
    """Return a place with what belongs there."""
    content = {"gallery": gallery, "integrators": integrators, "command-line": command_line, "public-names": names}
    return f"<!-- generated: {name} -->\n\n{content[name]().strip()}\n\n<!-- end -->"


def gallery() -> str:
    """Return all scenarios, two in a row: picture, name, what it shows."""
    cells = []
    for scenario in bundled():
        source = f"../{scenario.path.parent.name}/{scenario.path.name}"
        image = f"figures/{scenario.name}.png"
        shown = f"[![{scenario.name}]({image})]({source})<br>" if (DOCS / image).is_file() else ""
        cells.append(f"{shown}[**{scenario.name}**]({source}): {cell(scenario.summary)}.")
    cells += [""] * (len(cells) % 2)
    rows = [f"| {left} | {right} |" for left, right in zip(cells[::2], cells[1::2], strict=True)]
    return "\n".join(["| | |", "| --- | --- |", *rows])


def integrators() -> str:
    """Return a table of the registered integrators, and a section with the discrete Lagrangian of each."""
    rows = ["| method | order | variational | declares | source |", "| --- | --- | --- | --- | --- |"]
    sections = []
    for cls in methods():
        orders, declares = properties(cls)
        kind = "yes" if cls.variational else "no"
        rows.append(f"| [`{cls.__name__}`](#{cls.name}) | {orders} | {kind} | {declares} | {cell(cls.source)} |")
        examples = ", ".join(f"`{method.label}`" for method in cls.examples())
        file = "orbits/" + inspect.getfile(cls).rpartition("/orbits/")[2]
        sections += [f"## {cls.name}", "", f"`{public_name(cls)}`: {cls.summary}. For example {examples}.", ""]
        sections += [*markdown(sys.modules[cls.__module__].__doc__ or ""), f"File: [{file}](../{file})", ""]
    return "\n".join([*rows, "", *sections])


def methods() -> list[type[Integrator]]:
    """Return the registered integrators, the variational ones first."""
    return sorted(registry().values(), key=lambda cls: (not cls.variational, cls.name))


def properties(cls: type[Integrator]) -> tuple[str, str]:
    """Return the orders of the examples of a method, and what all of them declare."""
    examples = cls.examples()
    orders = ", ".join(str(order) for order in sorted({method.order for method in examples}))
    return orders, ", ".join(sorted(set.intersection(*(set(m.declares) for m in examples)))) or "nothing"


def command_line() -> str:
    """Return a section for each command, from the help texts of the program itself."""
    import typer

    from orbits.cli import app

    made = []
    for name, command in typer.main.get_command(app).commands.items():
        context = command.make_context(name, [], resilient_parsing=True)
        said, *examples = command.help.split("Example: ")
        typed = [line.strip().replace(", or with", "  # or with") for line in examples]  # a comment, not an argument
        made += [f"## orbits {name}", "", said.strip(), "", "```sh", *typed, "```"]
        made += ["", "| | |", "| --- | --- |"]
        for parameter in command.params:
            form, *text = parameter.get_help_record(context) or ["", ""]
            if parameter.param_type_name == "argument":
                form = parameter.metavar
            if form and form != "--help":
                made.append(f"| `{form}` | {cell(' '.join(text))} |")
        made.append("")
    return "\n".join(made)


def api_pages() -> list[str]:
    """Return the modules that have a page of the API reference."""
    return sorted({entry.page for entry in documented()})


def names() -> str:
    """Return a table for each module of the API, with links to its page."""
    made = []
    for page in api_pages():
        made += [f"## {page}", "", "| name | what it is |", "| --- | --- |"]
        for entry in documented():
            if entry.page == page:
                link = f"api/{page}.md#{anchor(entry.full_name)}"
                made.append(f"| [`{entry.full_name}`]({link}) | {cell(entry.summary)} |")
        made.append("")
    return "\n".join(made)


def api_page(module: str) -> str:
    """Return the page of one module: its docstring, then each of its names, classes with what they have."""
    made = [f"# {module}", "", *markdown(inspect.getdoc(importlib.import_module(module)) or "")]
    for entry in documented():
        if entry.page == module:
            made += [f"## {entry.full_name}", "", *signature(entry.name, entry.value, entry), *markdown(entry.doc)]
            for name, member in members(entry):
                made += [f"### {entry.name}.{name}", "", *signature(name, member)]
                made += markdown(inspect.getdoc(member) or "")
    return "\n".join(made).rstrip() + "\n"


def members(entry: Entry) -> Iterable[tuple[str, Any]]:
    """Yield the public methods and properties that a class defines itself and documents."""
    if entry.kind == "class":
        for name, value in vars(entry.value).items():
            member = value.__func__ if isinstance(value, classmethod | staticmethod) else value
            known = inspect.isfunction(member) or isinstance(member, property | cached_property)
            if known and not name.startswith("_") and getattr(member, "__doc__", None):
                yield name, member


def signature(name: str, value: Any, entry: Entry | None = None) -> list[str]:
    """Return how a name is called, without types, as code; nothing for properties, exceptions and constants."""
    if isinstance(value, property | cached_property) or (entry is not None and entry.kind in {"data", "exception"}):
        return []
    try:
        called = inspect.signature(value)
    except (TypeError, ValueError):
        return []
    shown = [p for p in called.parameters.values() if p.name not in {"self", "cls", "typingctx"}]
    bare = [parameter.replace(annotation=parameter.empty) for parameter in shown]
    text = str(called.replace(parameters=bare, return_annotation=called.empty))
    return ["```py", name + re.sub(r" at 0x[0-9a-f]+", "", text), "```", ""]


def markdown(docstring: str) -> list[str]:
    """Return a docstring in the house style as lines of Markdown."""
    lines: list[str] = []
    for block in blocks(inspect.cleandoc(docstring).splitlines()):
        if block[0].startswith(" "):
            lines += [*fenced(block), ""]
            continue
        for part in parts(block):
            found = items_of(part)
            if found:
                lines += [*(f"- `{head}`: {inline(said)}" for head, said in found), ""]
            else:
                lines += [inline(" ".join(line.strip() for line in part)), ""]
    return lines


def fenced(block: list[str]) -> list[str]:
    """Return indented lines as a fenced block: Python, or a formula as it is typed."""
    head, _, *code = code_block(block)
    language = "py" if head.endswith("python") else "text"
    return [f"```{language}", *(line[4:] for line in code), "```"]


def inline(text: str) -> str:
    """Return running text whose special characters are no markup; what stands in backticks stays code."""
    return "".join(piece if piece.startswith("`") else MARKUP.sub(r"\\\g<0>", piece) for piece in CODE.split(text))


def cell(text: str) -> str:
    """Return text for a cell of a table."""
    return inline(" ".join(text.split()))


def anchor(heading: str) -> str:
    """Return the anchor that a code forge gives to a heading."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")


def main() -> None:
    """Write the pages that have changed, and remove those of modules that are gone."""
    made = pages()
    API.mkdir(exist_ok=True)
    for path in API.glob("*.md"):
        if path not in made:
            path.unlink()
    for path, text in made.items():
        if not path.is_file() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")
            print(path.relative_to(DOCS.parent))


if __name__ == "__main__":
    main()
