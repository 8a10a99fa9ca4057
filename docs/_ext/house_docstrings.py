"""Docstrings in the house style as reStructuredText: lists of "name : text", indented examples, `names` in backticks.

The style is plain text, so every character that reStructuredText would interpret as markup is escaped.
"""

from __future__ import annotations

import ast
import inspect
import re
import textwrap
from collections.abc import Callable, Iterable

WORD = r"[A-Za-z_*][\w*]*"
ITEM = re.compile(rf"^({WORD}(?:(?:, | and | or | ){WORD}){{0,6}}) : (?=\S)")
"""What opens an item of a list: "q, v : ", "gm or mass : "."""
NEXT_ITEM = re.compile(rf"(?:;|(?<=\.)) +(?={WORD}(?:, {WORD})* : \S)")
"""Where a second item begins on the same line: "t : (n,) times; q, p : (n, d) positions"."""
COLUMNS = re.compile(r"\S {3,}\S")
QUOTED = re.compile(r"``(.+?)``|`([^`]+)`", re.DOTALL)
MARKUP = re.compile(r"([\\*|_<>`\[\]:.)])")

Link = Callable[[str], str | None]
"""From what stands in backticks to the full name of a public object, or None."""


def to_rst(docstring: str, link: Link = lambda name: None) -> list[str]:
    """Return the lines of reStructuredText that show a docstring as its author laid it out."""
    lines: list[str] = []
    for block in blocks(inspect.cleandoc(docstring).splitlines()):
        lines += [*rendered(block, link), ""]
    return lines


def blocks(lines: list[str]) -> Iterable[list[str]]:
    """Split at blank lines; an indented block goes on over them until the indentation ends."""
    block: list[str] = []
    for line in lines:
        indented = line.startswith(" ")
        code = bool(block) and block[0].startswith(" ")
        if block and ((not line.strip() and not code) or (code and line.strip() and not indented)):
            yield stripped(block)
            block = []
        if line.strip() or block:
            block.append(line)
    if block:
        yield stripped(block)


def stripped(block: list[str]) -> list[str]:
    """Return the block without blank lines at its end."""
    while block and not block[-1].strip():
        block = block[:-1]
    return block


def rendered(block: list[str], link: Link) -> list[str]:
    """Return one block as a code block, or as paragraphs and definition lists in the order in which they come."""
    if block[0].startswith(" "):
        return code_block(block)
    lines: list[str] = []
    if all(re.match(r"^\S+ {2,}\S|^ ", line) for line in block):  # a table of two columns
        for line in block:
            name, text = line.split(maxsplit=1)
            lines += [f"``{name}``", f"    {inline(text, link)}"]
        return lines
    for part in parts(block):
        opened = ITEM.match(part[0])
        if opened:
            lines += [*definition(part, link), ""]
        else:
            text = "\n".join(part)
            lines += [inline(f"{text.rstrip(':')}:" if text.endswith(":") else text, link), ""]
    return lines


def parts(block: list[str]) -> Iterable[list[str]]:
    """Split a block into items, each with its continuation lines, and paragraphs."""
    part: list[str] = []
    for line in block:
        item = ITEM.match(line)
        ends_item = bool(part) and bool(ITEM.match(part[0])) and not line.startswith(" ")
        if part and (item or ends_item):
            yield part
            part = []
        part.append(line)
    if part:
        yield part


def definition(part: list[str], link: Link) -> list[str]:
    """Return an item, or the several that stand on its line, as entries of a definition list."""
    if any(COLUMNS.search(line.strip()) for line in part[1:]):
        names, first = part[0].split(" : ", 1)
        return [term(names), f"    {inline(first, link)}", "", *indented(code_block(part[1:], "text"))]
    lines: list[str] = []
    for names, said in items(part):
        lines += [term(names), f"    {inline(said, link)}"]
    return lines


def items(part: list[str]) -> list[tuple[str, str]]:
    """Return the items of a part, names and text; none if it is a paragraph."""
    if not ITEM.match(part[0]):
        return []
    found = (item.split(" : ", 1) for item in NEXT_ITEM.split(" ".join(line.strip() for line in part)))
    return [(names, said) for names, said in found]


def term(names: str) -> str:
    """Return the head of an item: its names as code, the words between them as they are."""
    return re.sub(rf"(?<!\S){WORD}", lambda m: m[0] if m[0] in {"and", "or", "together"} else f"``{m[0]}``", names)


def code_block(block: list[str], other: str = "none") -> list[str]:
    """Return indented lines as code: Python where they are, else of the language `other`; "none" is for formulas."""
    code = textwrap.dedent("\n".join(block))
    try:
        ast.parse(code)
        language = "python"
    except SyntaxError:
        language = other
    return [f".. code-block:: {language}", "", *indented(code.splitlines())]


def indented(lines: Iterable[str]) -> list[str]:
    """Return the lines four columns to the right."""
    return [f"    {line}" if line else "" for line in lines]


def inline(text: str, link: Link) -> str:
    """Return running text on one line, its `names` as links where they are public, everything else escaped."""
    text = " ".join(text.split())
    pieces, end = [], 0
    for found in QUOTED.finditer(text):
        quoted = found[1] or found[2]
        if quoted != quoted.strip() or "`" in quoted or quoted.endswith("\\"):
            continue  # no code, but a mark that is typed as it is
        pieces.append(escaped(text[end : found.start()]))
        target = link(quoted)
        # A backslash-blank ends markup that a letter follows, as in "`Check`s", and stands for nothing.
        pieces.append("\\ " + (f":py:obj:`{quoted} <{target}>`" if target else f"``{quoted}``") + "\\ ")
        end = found.end()
    pieces.append(escaped(text[end:]))
    line = "".join(pieces)
    return line if line[:1].isalpha() else f"\\ {line}"


def escaped(text: str) -> str:
    """Return plain text so that nothing in it is markup."""
    return MARKUP.sub(r"\\\1", text)


def setup(app):
    """Render every docstring that autodoc shows."""
    from public_names import documented

    known = {entry.name: entry.full_name for entry in documented()}

    def link(quoted: str) -> str | None:
        name = quoted.removeprefix("orbits.").split("(")[0]
        return known.get(name) if name.isidentifier() else None

    def process(app, what, name, obj, options, lines):
        lines[:] = to_rst("\n".join(lines), link)

    app.connect("autodoc-process-docstring", process)
    return {"parallel_read_safe": True}
