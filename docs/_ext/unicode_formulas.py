"""Formulas as they are typed, in Unicode with _ and ^, set with subscripts and superscripts: no images, no scripts.

Pages and docstrings say q_k, q_{k+1} and h^{r+1}: to be read in any editor. Indented blocks that are no code are
displayed formulas; in running text single letters with an index are formulas.
"""

from __future__ import annotations

import re

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.transforms.post_transforms import SphinxPostTransform

GREEK = {
    "alpha": "α", "beta": "β", "gamma": "γ", "delta": "δ", "eta": "η", "mu": "μ", "xi": "ξ", "phi": "φ", "psi": "ψ",
    "omega": "ω", "Phi": "Φ", "Psi": "Ψ", "sum": "Σ",
}  # fmt: skip
INDEX = (
    r"\{(?P<%s_long>[^{}]+)\}|\((?P<%s_round>-?\d+/\d+|[a-z][+−-]\d)\)|"
    r"(?P<%s>half(?![A-Za-z])|-?\d+(?![A-Za-z0-9])|[A-Za-z0-9*±+-]{1,2}(?![A-Za-z0-9]))"
)
BASE = rf"(?P<base>(?<![A-Za-z_])(?:{'|'.join(GREEK)}|gm|dp|dq|[A-Za-zα-ωΑ-Ωāēξ∂Σ]̃?)|[)\]0-9])"
LOW, BOTH, HIGH = (INDEX.replace("%s", name) for name in ("low", "both", "high"))
SCRIPTED = re.compile(rf"{BASE}_(?:{LOW})(?:\^(?:{BOTH}))?|(?P<raised>[\w)\]])\^(?:{HIGH})")
WORD = re.compile(rf"\b(?:{'|'.join(GREEK)})\b")
WIDE = re.compile(r" {3,}")


def typeset(text: str) -> list[nodes.Node]:
    """Return the text as nodes, with its subscripts and superscripts."""
    text = text.replace("a_bar", "ā")
    made: list[nodes.Node] = []
    end = 0
    for found in SCRIPTED.finditer(text):
        base = found["base"] or found["raised"]
        base = GREEK.get(base, base)
        made.append(nodes.Text(text[end : found.start()] + base))
        for name, node in (("low", nodes.subscript), ("both", nodes.superscript), ("high", nodes.superscript)):
            script = found[f"{name}_long"] or found[f"{name}_round"] or found[name]
            if script:
                made.append(node("", "", *typeset(script)))
        end = found.end()
    made.append(nodes.Text(text[end:]))
    return made


class Formulas(SphinxPostTransform):
    """Set the formulas of a page."""

    default_priority = 5
    formats = ("html",)

    def run(self) -> None:
        """Replace displayed formulas, then letters with an index in running text."""
        for block in list(self.document.findall(nodes.literal_block)):
            if block.get("language") == "none":
                lines = [WIDE.sub("\u2003\u2003", line) for line in block.astext().splitlines()]
                lines = [WORD.sub(lambda found: GREEK[found[0]], line) for line in lines]
                formula = nodes.line_block(classes=["formula"])
                formula += [nodes.line("", "", *typeset(line)) for line in lines]
                block.replace_self(formula)
        for node in list(self.document.findall(nodes.Text)):
            text = nodes.unescape(node)
            if (SCRIPTED.search(text) or "a_bar" in text) and not in_code(node):
                node.parent.replace(node, typeset(text))


RUNNING = nodes.paragraph | nodes.emphasis | nodes.strong | nodes.entry | nodes.reference | nodes.term
"""Where text is running text; all other elements of text are code, headings, or formulas that are set already."""


def in_code(text: nodes.Text) -> bool:
    """Whether the text stands in anything but running text."""
    node = text.parent
    while node is not None:
        if isinstance(node, nodes.TextElement | nodes.raw) and not isinstance(node, RUNNING):
            return True
        node = node.parent
    return False


def setup(app: Sphinx) -> dict[str, bool]:
    """Set formulas last, when all references are resolved."""
    app.add_post_transform(Formulas)
    return {"parallel_read_safe": True}
