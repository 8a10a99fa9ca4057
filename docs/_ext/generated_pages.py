"""Pages that are written when the site is built, into `_generated/`: the API, the scenarios, and the files at the root.

There are no lists kept by hand: names come from `__all__`, scenarios from their folder.
"""

from __future__ import annotations

import ast
import importlib
import inspect
from pathlib import Path

from house_docstrings import indented, to_rst
from markdown_pages import api_pages
from public_names import DOCS, Entry, documented
from repository_links import COPIED, rewritten
from sphinx.application import Sphinx

from orbits.scenario import bundled

GENERATED = DOCS / "_generated"


def pages() -> dict[str, str]:
    """Return the text of every generated page by its path below `_generated/`."""
    made = {f"api/{page}.rst": api_page(page, [e for e in documented() if e.page == page]) for page in api_pages()}
    for scenario in bundled():
        made[f"scenarios/{scenario.name}.rst"] = scenario_page(scenario.name, scenario.path)
    for source, name in COPIED.items():
        text = (DOCS.parent / source).read_text(encoding="utf-8")
        made[name] = rewritten(text, (DOCS.parent / source).parent, GENERATED)
    return made


def api_page(module: str, entries: list[Entry]) -> str:
    """Return the page of one module: its docstring, then each of its names."""
    lines = [*heading(module, "="), *to_rst(inspect.getdoc(importlib.import_module(module)) or "")]
    for entry in entries:
        lines += directive(entry)
    return "\n".join(lines) + "\n"


def directive(entry: Entry) -> list[str]:
    """Return what documents one name."""
    if entry.kind in {"class", "exception", "function"}:
        return [f".. auto{entry.kind}:: {entry.full_name}", ""]
    if entry.kind == "compiled":
        signature = str(inspect.signature(entry.value)).replace("(typingctx, ", "(")  # what Numba gives an intrinsic
        head = [f".. py:function:: {entry.full_name}{signature}"]
    else:
        value = repr(entry.value)
        head = [f".. py:data:: {entry.full_name}", *([f"    :value: {value}"] if len(value) < 80 else [])]
    return [*head, "", *indented(to_rst(entry.doc)), ""]


def scenario_page(name: str, path: Path) -> str:
    """Return the page of one scenario: what its file says, how to run it, its picture, its source."""
    said = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
    lines = [*heading(name, "="), *to_rst(said), ".. code-block:: sh", "", f"    orbits run {name}", ""]
    if picture(name):
        lines += [f".. image:: /{picture(name)}", f"    :alt: {said.splitlines()[0]}", ""]
    source = f"{path.parent.name}/{path.name}"
    lines += [*heading("The file", "-"), f"``{source}``, whole:", ""]
    lines += [f".. literalinclude:: ../../../{source}", "    :language: python", ""]
    return "\n".join(lines)


def picture(name: str) -> str | None:
    """Return the path below docs/ of the picture of a scenario, if there is one."""
    path = f"figures/{name}.png"
    return path if (DOCS / path).is_file() else None


def heading(text: str, line: str) -> list[str]:
    """Return a heading of reStructuredText."""
    return [text, line * len(text), ""]


def write(app: Sphinx) -> None:
    """Write the pages that are missing or changed, and remove those that nothing makes any more."""
    made = pages()
    for path in GENERATED.rglob("*.*"):
        if path.relative_to(GENERATED).as_posix() not in made:
            path.unlink()
    for name, text in made.items():
        path = GENERATED / name
        if not path.is_file() or path.read_text(encoding="utf-8") != text:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")


def setup(app: Sphinx) -> dict[str, bool]:
    """Write the pages before Sphinx looks which there are."""
    app.connect("builder-inited", write)
    return {"parallel_read_safe": True}
