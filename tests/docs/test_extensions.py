"""Docstrings in the house style become reStructuredText, and formulas in Unicode become formulas."""

from __future__ import annotations

import inspect

import pytest

pytest.importorskip("sphinx", reason="Sphinx comes with the extra 'docs'")

from docutils import nodes
from docutils.core import publish_doctree
from house_docstrings import to_rst
from hypothesis import given
from hypothesis import strategies as st
from markdown_pages import API, markdown, pages
from public_names import documented
from repository_links import DOCS, ROOT, rewritten
from unicode_formulas import typeset

from ..coverings import each

QUIET = {"report_level": 1, "halt_level": 5, "warning_stream": False, "syntax_highlight": "none"}

DOCSTRING = """Do it: q_k <- |q|*2.

    x = f(1)

q, v : (d,) positions; t : time, of `q` too
    and a second line
gm or mass : 0 by default
Raises `Error`s:
"""


def read(docstring: str) -> nodes.document:
    return publish_doctree("\n".join(to_rst(docstring)), settings_overrides=QUIET)


def complaints(document: nodes.document) -> list[str]:
    return [message.astext() for message in document.findall(nodes.system_message)]


def test_a_list_of_arguments_becomes_a_definition_list() -> None:
    document = read(DOCSTRING)
    items = list(document.findall(nodes.definition_list_item))
    assert [item[0].astext() for item in items] == ["q, v", "t", "gm or mass"]
    assert items[1][1].astext() == "time, of q too and a second line"
    assert not complaints(document)


def test_an_indented_example_becomes_code_and_text_stays_as_it_was_typed() -> None:
    document = read(DOCSTRING)
    (code,) = document.findall(nodes.literal_block)
    assert code.astext() == "x = f(1)"
    first, *_, last = document.findall(nodes.paragraph)
    assert nodes.unescape(first.astext()) == "Do it: q_k <- |q|*2."
    assert nodes.unescape(last.astext()) == "Raises Errors:"


WORDS = st.text(alphabet=list("ab :;.,*|_`<>()[]\\\n=-'\"#+~^4"), max_size=120)


@given(WORDS)
def test_no_docstring_whatever_is_misread_as_markup(text: str) -> None:
    assert not complaints(read("A summary.\n\n" + text))


@pytest.mark.nightly
@each("page", sorted({entry.page for entry in documented()}))
def test_every_docstring_of_the_reference_is_read_without_complaint(page: str) -> None:
    for entry in documented():
        if entry.page == page:
            members = vars(entry.value).values() if inspect.isclass(entry.value) else ()
            for text in (entry.doc, *(inspect.getdoc(member) or "" for member in members)):
                assert not complaints(read(text)), (entry.full_name, text)


@each(
    ("typed", "expected"),
    [
        ("L_d(q_{k-1}, q_k)", "L<d>(q<k-1>, q<k>)"),
        ("O(h^{r+1}), O(h^r)", "O(h[r+1]), O(h[r])"),
        ("b_i a_bar_ij + b_j a_ji", "b<i> ā<ij> + b<j> a<ji>"),
        ("L_d^E(q0, q1)", "L<d>[E](q0, q1)"),
        ("2^-53, x^(-3/2), au^3/d^2", "2[-53], x[-3/2], au[3]/d[2]"),
        ("sum_{i<j} gm_i gm_j", "Σ<i<j> gm<i> gm<j>"),
        ("L_d^i(q_(i-1), q_i; gamma_i h)", "L<d>[i](q<i-1>, q<i>; γ<i> h)"),
        ("v_half = v + h/2 g(q)", "v<half> = v + h/2 g(q)"),
        ("my_name, q_path, NUMBA_CACHE_DIR, a^", "my_name, q_path, NUMBA_CACHE_DIR, a^"),
    ],
)
def test_what_is_typed_with_low_and_high_signs_is_set_low_and_high(typed: str, expected: str) -> None:
    marks = {nodes.subscript: "<{}>", nodes.superscript: "[{}]", nodes.Text: "{}"}
    assert "".join(marks[type(node)].format(node.astext()) for node in typeset(typed)) == expected


@given(st.text(alphabet=list("ab12_^{}() /-ΣL"), max_size=60))
def test_no_character_of_a_formula_is_lost(text: str) -> None:
    shown = "".join(node.astext() for node in typeset(text))
    assert sorted(c for c in shown if c.isalnum()) == sorted(c for c in text if c.isalnum())


def test_links_out_of_the_folder_lead_to_the_copies_in_the_site() -> None:
    text = "[a](../CONTRIBUTING.md#style) [b](theory.md) [c](https://e.org/CHANGELOG.md) [d](#here)"
    expected = "[a](_generated/contributing.md#style) [b](theory.md) [c](https://e.org/CHANGELOG.md) [d](#here)"
    assert rewritten(text, DOCS, DOCS) == expected
    assert rewritten("[a](docs/theory.md)", ROOT, DOCS / "_generated") == "[a](../theory.md)"


def test_pages_that_are_made_from_the_package_are_up_to_date() -> None:
    """If this fails: python docs/_ext/markdown_pages.py."""
    made = pages()
    stale = [path.name for path, text in made.items() if path.read_text(encoding="utf-8") != text]
    assert stale == []
    assert {path for path in made if path.parent == API} == set(API.glob("*.md"))


def test_a_docstring_becomes_markdown() -> None:
    assert markdown(DOCSTRING) == [
        r"Do it: q_k \<- \|q\|\*2.", "",
        "```py", "x = f(1)", "```", "",
        "- `q, v`: (d,) positions", "- `t`: time, of `q` too and a second line", "",
        "- `gm or mass`: 0 by default", "",
        "Raises `Error`s:", "",
    ]  # fmt: skip
