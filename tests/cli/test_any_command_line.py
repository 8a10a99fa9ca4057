"""Whatever is typed, and whatever a scenario's file does: words and an exit code, never a traceback."""

from __future__ import annotations

import os
import sys
import tempfile
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from hypothesis import strategies as st
from typer.testing import CliRunner

import orbits
from orbits.cli import app
from tests.campaigns import campaign

COMMANDS = ["run", "resume", "compare", "certify", "plot", "info", "list", "walk"]
HEAD = """import orbits
pair = orbits.System.from_elements({'s': {'gm': 1}, 'p': {'a': 1, 'gm': 0.001}}, units=orbits.DIMENSIONLESS)
given = dict(name='tiny', title='Tiny', integrators=[orbits.StormerVerlet()], dt=0.1, duration=1, samples=3, against=[],
             system=pair)
"""
WORDS = [
    "adaptive", "adaptive(tolerance=1e-3)", "adaptive(", "adaptive:1e-3", "transformed:0.3", "transformed:",
    *COMMANDS, "tiny.py", "run.h5", "no.h5", "no.py", "nowhere", "../x.py", "/etc/passwd", "/dev/null", ".", "", "-",
    "--", "--dt", "--duration", "--integrator", "--samples", "--out", "--json", "--no-plot", "--until", "--any-bits",
    "--set", "--list-options", "share=0.5", "share=x", "=",
    "--against", "--help", "--version", "6 d", "0.1", "1e400", "nan", "-1", "0", "3", "10 kg", "6 d d", "gauss",
    "gauss(stages=4)", "Gauss(", "Composition(StormerVerlet(), order=4)", "__import__('os').system('true')",
    "Composition(" * 50, "(" * 300, "9" * 400, "1" * 5000, "whfast", "leapfrog,ias15", "a.png", "out",
]  # fmt: skip
# What a scenario's argument may be by mistake, as it is written.
EXPRESSIONS = [
    "[orbits.Gauss(stages=8)]", "orbits.Adaptive(1e-3)", "orbits.Adaptive",
    "1/0", "None", "3", "-1", "0", "1e400", "1j", "float('nan')", "b'x'", "''", "'x'", "'../../etc'", "'a/b'", "'..'",
    "'a' * 500", "'\\n'", "'\\x00'", "[]", "{}", "[3]", "object()", "pair", "{'': pair}", "{'a/../b': pair, 'c': 3}",
    "lambda: pair", "lambda: 1/0", "lambda: {'../x': pair}", "lambda: {1: pair}", "lambda o: 1/0", "lambda o: [3]",
    "lambda o: (yield)", "lambda o: {'../a': 3}", "__import__('sys').exit(3)", "exec('raise BaseException(1)')",
    "(lambda f: f(f))(lambda f: f(f))", "{'energy': 'x'}", "{'energy': -1}", "{'nope': 1}", "['whfast', 'zz']",
    "[orbits.scenarios.Option('share', 0.5, help='a part')]", "{'share': 0.25}", "lambda options: 0.1",
    "[orbits.StormerVerlet()] * 2", "'stormer-verlet'", "['nope']", "orbits.Gauss", "'6 d'",
]  # fmt: skip
FILES = [
    "", "1/0", "scenario", "scenario = 3\n", "scenario = orbits\n", "import nonexistent\n", "raise SystemExit(0)",
    "def f(:", "x = '\\ud800'", "\x00", "\t\tx", "class scenario: pass",
    "raise type('E', (Exception,), {'__str__': lambda s: 1/0})()",
    "raise type('E', (BaseException,), {})()", "raise KeyError", "def f(): f()\nf()", "scenario = type('S', (), {})()",
]  # fmt: skip


@pytest.fixture(scope="module", autouse=True)
def elsewhere() -> Any:
    """All of this in a folder of its own, with a scenario, an archive, and what only looks like them."""
    before = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        inside = Path(folder, "inside")  # what is beside it is nobody else's
        inside.mkdir()
        os.chdir(inside)
        Path("tiny.py").write_text(HEAD + "scenario = orbits.scenarios.Scenario(**given)\n")
        Path("no.py").write_text("1/0\n")
        Path("no.h5").write_bytes(b"no archive")
        names: dict[str, Any] = {}
        exec(HEAD, names)
        orbits.propagate(names["pair"], orbits.StormerVerlet(), dt=0.1, duration=1.0, samples=3, archive="run.h5")
        yield
        os.chdir(before)


def call(arguments: list[str]) -> None:
    out = CliRunner().invoke(app, arguments)
    assert out.exit_code in (0, 1, 2), (arguments, out.exception)
    assert out.exception is None or isinstance(out.exception, SystemExit), (arguments, out.exception)
    assert "Traceback" not in out.output, arguments
    assert "bug in orbits" not in out.output, (arguments, out.output)


def takes_long(option: str, value: str) -> bool:
    try:
        number = abs(float(value.split()[0]))
    except (ValueError, IndexError):
        return False
    return option in ("--dt", "--duration", "--until", "--samples") and (number > 1e4 or 0 < number < 1e-3)


word = st.sampled_from(WORDS) | st.text(st.characters(exclude_categories=["Cs"]), max_size=8)


@campaign(15, 1500, arguments=st.lists(word, max_size=5))
def test_any_words_end_with_an_exit_code(arguments: list[str]) -> None:
    if not any(takes_long(option, value) for option, value in pairwise(arguments)):
        call(arguments)


@campaign(
    20,
    1000,
    command=st.sampled_from(COMMANDS),
    file=st.sampled_from(["tiny.py", "run.h5", "no.h5", "no.py"]),
    option=st.sampled_from([w for w in WORDS if w.startswith("--")]),
    value=word,
)
def test_any_option_ends_with_an_exit_code(command: str, file: str, option: str, value: str) -> None:
    if not takes_long(option, value):
        call([command, file, option, value])


@campaign(
    20,
    1000,
    command=st.sampled_from(["run", "compare"]),
    changes=st.dictionaries(
        st.sampled_from(["name", "title", "system", "integrators", "dt", "duration", "samples", "against", "tolerances",
                         "checks", "draw", "options", "chosen", "nonsense"]),
        st.sampled_from(EXPRESSIONS), min_size=1, max_size=2,
    ),
)  # fmt: skip
def test_any_scenario_runs_or_is_refused(command: str, changes: dict[str, str]) -> None:
    arguments = ", ".join(f"{key!r}: {value}" for key, value in changes.items())
    Path("changed.py").write_text(f"{HEAD}scenario = orbits.scenarios.Scenario(**{{**given, {arguments}}})\n")
    call([command, "changed.py", "--out", "changed"])
    assert {path.name for path in Path.cwd().parent.glob("x*")} == set()  # nothing beside the folder


@campaign(
    20,
    1000,
    text=st.sampled_from(FILES).map(str.encode) | st.text(max_size=30).map(str.encode) | st.binary(max_size=40),
    name=st.sampled_from(["a.py", "a b.py", "a.b.py", "ä.py", "-x.py", "x\n.py", "..py", "numpy.py", "orbits.py"]),
)
def test_any_file_is_a_scenario_or_refused(text: bytes, name: str) -> None:
    before = sys.modules.get("orbits")
    Path(name).write_bytes(text)
    try:
        call(["run", f"./{name}"])
    finally:
        Path(name).unlink()
    assert sys.modules.get("orbits") is before


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("raise type('E', (Exception,), {'__str__': lambda s: 1/0})()", "line 1: E: (no message)"),
        ("raise type('Own', (BaseException,), {})('stop')", "line 1: Own: stop"),
        (
            f"{HEAD}scenario = orbits.scenarios.Scenario(**{{**given, 'tolerances': None}})",
            "tolerances must be a mapping such as",
        ),
        (
            f"{HEAD}scenario = orbits.scenarios.Scenario(**{{**given, 'against': None}})",
            "against must be a list of peers' names",
        ),
    ],
)
def test_what_this_campaign_found_in_files_is_told_in_words(text: str, message: str) -> None:
    Path("found.py").write_text(text)
    out = CliRunner().invoke(app, ["run", "found.py"])
    assert out.exit_code == 2
    assert message in " ".join(out.output.split())


def test_no_file_at_all_cannot_be_drawn() -> None:
    out = CliRunner().invoke(app, ["plot", ""])
    assert out.exit_code == 2
    assert "is a folder" in out.output
