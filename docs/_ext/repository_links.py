"""Links between Markdown files as they work on a code forge, made to work in the site as well.

Files outside docs/ that pages link to have a copy in the site; links to them, and in them, are rewritten.
"""

from __future__ import annotations

import os
import re
from pathlib import Path

from sphinx.application import Sphinx

DOCS = Path(__file__).resolve().parents[1]
ROOT = DOCS.parent
COPIED = {"CONTRIBUTING.md": "contributing.md", "CHANGELOG.md": "changelog.md", "data/README.md": "data.md"}
"""Files of the repository, and their names in `_generated/`."""
LINK = re.compile(r"\]\((?![a-z]+:|#)([^)#\s]+)(#[^)\s]*)?\)")


def rewritten(text: str, origin: Path, here: Path) -> str:
    """Return Markdown that was written for the folder `origin`, with its links as they are from the folder `here`."""

    def link(found: re.Match[str]) -> str:
        target = (origin / found[1]).resolve()
        name = target.relative_to(ROOT).as_posix() if target.is_relative_to(ROOT) else ""
        if name in COPIED:
            target = DOCS / "_generated" / COPIED[name]
        return f"]({Path(os.path.relpath(target, here)).as_posix()}{found[2] or ''})"

    return LINK.sub(link, text)


def on_read(app: Sphinx, docname: str, content: list[str]) -> None:
    """Rewrite the links of a page of docs/."""
    path = app.env.doc2path(docname)
    if path.suffix == ".md" and not docname.startswith("_generated"):
        content[0] = rewritten(content[0], path.parent, path.parent)


def setup(app: Sphinx) -> dict[str, bool]:
    """Rewrite pages as they are read."""
    app.connect("source-read", on_read)
    return {"parallel_read_safe": True}
