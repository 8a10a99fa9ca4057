"""Directives that show what is registered: one each for scenarios, integrators, names.

In the site they take the place of the Markdown that `markdown_pages` writes for those who read the repository.
"""

from __future__ import annotations

import inspect
import sys
from collections.abc import Iterable

from docutils import nodes
from generated_pages import picture
from house_docstrings import to_rst
from markdown_pages import PLACE, api_pages, cell, methods, properties
from public_names import documented
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from orbits.integrators.base import Integrator
from orbits.scenario import bundled

DIRECTIVES = {
    "gallery": "```{scenario-gallery}\n```",
    "integrators": "```{integrator-table}\n```\n\n```{integrator-sections}\n```",
    "public-names": "```{public-names}\n```",
}


class RegistryDirective(SphinxDirective):
    """A directive without content that stands for generated Markdown."""

    def run(self) -> list[nodes.Node]:
        """Return the nodes of the Markdown."""
        made = []
        for part in self.markdown():
            made += self.parse_text_to_nodes(part, allow_section_headings=part.startswith("## "))
        return made

    def markdown(self) -> list[str]:
        """Return what the directive stands for, in parts: what has headings begins with one, and comes first."""
        raise NotImplementedError


class ScenarioGallery(RegistryDirective):
    """A card for each bundled scenario: picture, name, what it shows."""

    def markdown(self) -> list[str]:
        """Return the cards, and the contents for the navigation."""
        cards = []
        for each in bundled():
            page = f"_generated/scenarios/{each.name}.rst"
            image = f"[![{each.summary}]({picture(each.name)})]({page})\n\n" if picture(each.name) else ""
            cards.append(f":::{{container}} card\n{image}[**{each.name}**]({page})\n\n{each.summary}.\n:::\n")
        return [
            "::::{container} cards gallery\n" + "\n".join(cards) + "::::\n",
            contents(f"scenarios/{s.name}" for s in bundled()),
        ]


class IntegratorTable(RegistryDirective):
    """A table of all registered integrators: order, what is declared, the paper and the file."""

    def markdown(self) -> list[str]:
        """Return the table."""
        rows = ["| method | order | variational | declares | source | file |", "| --- | --- | --- | --- | --- | --- |"]
        for cls in methods():
            orders, declares = properties(cls)
            kind = "yes" if cls.variational else "no"
            head = f"[`{cls.__name__}`](#{cls.name}) | {orders} | {kind} | {declares}"
            rows.append(f"| {head} | {cell(cls.source)} | {listing(cls, below='orbits/integrators/')} |")
        return ["\n".join(rows)]


class IntegratorSections(RegistryDirective):
    """A section for each registered integrator: its discrete Lagrangian, as its file has it."""

    def markdown(self) -> list[str]:
        """Return the sections."""
        return ["\n".join(self.section(cls) for cls in methods())]

    def section(self, cls: type[Integrator]) -> str:
        """Return the section of one method."""
        rst = "\n".join(to_rst(sys.modules[cls.__module__].__doc__ or ""))
        examples = ", ".join(f"`{method.label}`" for method in cls.examples())
        return (
            f"## {cls.name}\n\n{{py:class}}`orbits.{cls.__name__}`: {cls.summary}. For example {examples}.\n\n"
            f"````{{eval-rst}}\n{rst}\n````\n\nFile: {listing(cls)}\n"
        )


def listing(cls: type[Integrator], below: str = "") -> str:
    """Return a link to the source of the module of a method, shown as its path below a folder."""
    file = "orbits/" + inspect.getfile(cls).rpartition("/orbits/")[2]
    shown = cell(file.removeprefix(below))
    return f'<a href="_modules/{cls.__module__.replace(".", "/")}.html"><code>{shown}</code></a>'


class PublicNames(RegistryDirective):
    """A table of the names on each page of the API reference."""

    def markdown(self) -> list[str]:
        """Return a table for each module, and the contents for the navigation."""
        parts = []
        for page in api_pages():
            parts += ["", f"## {page}", "", "| name | what it is |", "| --- | --- |"]
            for entry in documented():
                if entry.page == page:
                    role = {"compiled": "func", "function": "func", "exception": "exc"}.get(entry.kind, entry.kind)
                    parts.append(f"| {{py:{role}}}`{entry.full_name}` | {cell(entry.summary)} |")
        return ["\n".join(parts).strip(), contents(f"api/{page}" for page in api_pages())]


def contents(pages: Iterable[str]) -> str:
    """Return the contents for the navigation."""
    return "\n".join(["```{toctree}", ":hidden:", "", *(f"_generated/{page}" for page in pages), "```"])


def on_read(app: Sphinx, docname: str, content: list[str]) -> None:
    """Show by a directive what stands in the page as Markdown, where the site has more to show."""
    content[0] = PLACE.sub(lambda found: DIRECTIVES.get(found[1], found[0]), content[0])


def setup(app: Sphinx) -> dict[str, bool]:
    """Add the directives."""
    app.add_directive("scenario-gallery", ScenarioGallery)
    app.add_directive("integrator-table", IntegratorTable)
    app.add_directive("integrator-sections", IntegratorSections)
    app.add_directive("public-names", PublicNames)
    app.connect("source-read", on_read)
    return {"parallel_read_safe": True}
