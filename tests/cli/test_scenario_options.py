"""`--set` and `--list-options`: the options of a scenario's own on the command line."""

from __future__ import annotations

import json
import runpy
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from orbits.archive import Archive
from orbits.cli import app
from orbits.ensemble import open as open_campaign

from ..coverings import each

FILE = """import orbits

def system(options):
    bodies = {"star": {"gm": 1.0}, "planet": {"a": options["a"], "gm": 1e-3}}
    return orbits.System.from_elements(bodies, units=orbits.DIMENSIONLESS)

scenario = orbits.scenarios.Scenario(
    name="pair", title="Two bodies", system=system, dt=0.125, duration=2.0, samples=3, against=["ias15"],
    options=[
        orbits.scenarios.Option("a", 1.0, least=0.1, help="semi-major axis"),
        orbits.scenarios.Option("colour", "red", choices=("red", "blue"), help="colour of the orbit"),
    ],
)

if __name__ == "__main__":
    scenario.main()
"""


@pytest.fixture(autouse=True)
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A scenario with options, in an empty folder."""
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "pair.py"
    path.write_text(FILE)
    return path


def call(*words: str) -> Any:
    return CliRunner().invoke(app, [*words])


def test_a_run_looks_for_closest_approaches_as_it_is_told() -> None:
    for method, told, has in (
        ("stormer-verlet", [], False),
        ("stormer-verlet", ["--approaches"], True),
        ("gauss(stages=4)", [], True),
        ("gauss(stages=4)", ["--no-approaches"], False),
    ):
        out = call("run", "pair.py", "--integrator", method, "--no-plot", *told)
        assert out.exit_code == 0, out.output
        with Archive.open("results/pair/run.h5") as archive:
            assert archive.approaches is has


def test_a_study_takes_no_choice_of_closest_approaches() -> None:
    out = call("run", "eccentric", "--no-approaches")
    assert out.exit_code == 2
    assert "it takes no --no-approaches" in " ".join(out.stderr.split())


def test_a_campaign_leaves_closest_approaches_out_as_it_is_told() -> None:
    for told in ([], ["--no-approaches"]):
        out = call("ensemble", "pair.py", "--out", f"c{len(told)}", "--workers", "1", *told)
        assert out.exit_code == 0, out.output
        assert ("closest" in open_campaign(f"c{len(told)}").summary.colnames) is not bool(told)


def test_a_run_has_the_options_that_were_set_and_says_them_everywhere() -> None:
    out = call("run", "pair.py", "--set", "a=2", "--set", "colour=blue", "--json", "--no-plot")
    assert out.exit_code == 0, out.output
    assert "Two bodies (a=2.0, colour=blue)" in out.stderr
    record = json.loads(out.stdout)
    assert (record["title"], record["options"]) == ("Two bodies", {"a": 2.0, "colour": "blue"})
    text, values = call("info", "results/pair/run.h5").output, call("info", "results/pair/run.h5", "--json").stdout
    assert "\nscenario: pair, a=2.0, colour=blue\n" in text
    assert json.loads(values)["scenario"] == {"scenario": "pair", "options": {"a": 2.0, "colour": "blue"}}
    checked = call("verify", "results/pair/run.h5")
    assert checked.exit_code == 0
    assert "scenario pair, a=2.0, colour=blue" in checked.output


def test_options_are_listed_and_nothing_is_run() -> None:
    out = call("run", "pair.py", "--list-options")
    assert out.exit_code == 0
    assert [line.split() for line in out.stdout.splitlines()[1:]] == [
        ["option", "default", "what", "it", "is"],
        ["a=NUMBER", "1.0", "semi-major", "axis"],
        ["colour=red|blue", "red", "colour", "of", "the", "orbit"],
    ]
    assert json.loads(call("run", "pair.py", "--list-options", "--json").stdout) == [
        {"name": "a", "default": 1.0, "least": 0.1, "help": "semi-major axis"},
        {"name": "colour", "default": "red", "choices": ["red", "blue"], "help": "colour of the orbit"},
    ]
    assert not Path("results").exists()
    for name in ("kepler", "pendulum"):
        assert call("run", name, "--list-options").stdout == f"{name} has no options of its own.\n"


@pytest.mark.nightly
def test_a_scenario_run_as_a_program_takes_the_same_options(
    file: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    words = [sys.executable, str(file), "--set", "a=2", "--no-plot", "--json"]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["options"]["a"] == 2.0
    monkeypatch.setattr(sys, "argv", [str(file), "--list-options"])
    with pytest.raises(SystemExit, match="0"):
        runpy.run_path(str(file), run_name="__main__")
    assert "colour=red|blue" in capsys.readouterr().out


@pytest.mark.nightly
def test_comparison_and_certificate_take_options() -> None:
    out = call("compare", "pair.py", "--set", "a=2", "--integrator", "stormer-verlet", "--json", "--no-plot")
    assert out.exit_code == 0, out.output
    assert json.loads(out.stdout)["options"]["a"] == 2.0
    out = call("certify", "pair.py", "--set", "a=2", "--integrator", "stormer-verlet", "--json")
    assert out.exit_code == 0, out.output
    assert json.loads(out.stdout)["options"]["a"] == 2.0


def test_a_campaign_takes_options_and_a_plan_has_none() -> None:
    out = call("ensemble", "pair.py", "--set", "a=2", "--out", "c", "--workers", "1")
    assert out.exit_code == 0, out.output
    again = call("ensemble", "pair.py", "--out", "c", "--workers", "1")
    assert again.exit_code == 2
    assert "the store of another campaign. What differs:" in again.output
    plan = FILE.replace("scenario = ", "other = ").split("\nif __name__")[0]
    Path("plan.py").write_text(
        f"{plan}\nplan = orbits.ensemble.Plan(orbits.ensemble.systems(other.cases().values()), duration=2.0)\n"
    )
    out = call("ensemble", "plan.py", "--set", "a=2")
    assert out.exit_code == 2
    assert "plan.py defines a plan, which has no options: --set is for those of a scenario." in out.output


@each(
    ("words", "message"),
    [
        (["run", "pair.py", "--set", "color=red"], "no option 'color'; its options are a and colour. Did you mean"),
        (["run", "pair.py", "--set", "colour=rad"], "'rad'; expected red or blue. Did you mean 'red'?"),
        (["run", "pair.py", "--set", "a"], "--set 'a': expected NAME=VALUE, such as --set a=1.0."),
        (["compare", "pair.py", "--set", "a=0"], "option 'a' of 'pair' is 0.0; expected a number >= 0.1."),
        (["run", "kepler", "--set", "a=3"], "'kepler' has no options of its own, and so no option 'a'."),
        (["run", "kepler", "--set", "dt=3"], "no option 'dt'. `orbits run` takes --dt, without --set."),
        (["run", "pendulum", "--set", "a=3"], "'pendulum' is a study, which has no options of its own"),
        (["certify", "pendulum", "--set", "a=3"], "'pendulum' is a study, which has no options of its own"),
        (["resume", "pair.h5", "--set", "a=3"], "No such option: --set"),
    ],
)
def test_a_wrong_use_is_one_line_and_exit_code_2(words: list[str], message: str) -> None:
    out = call(*words)
    assert out.exit_code == 2
    assert message in " ".join(out.output.replace("│", " ").split())
    assert not Path("results").exists()


def test_an_unfinished_run_with_other_options_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    long = ["--duration", "1e6", "--wall-time", "0.01", "--no-plot"]
    assert call("run", "pair.py", "--set", "a=2", *long).exit_code == 75
    out = call("run", "pair.py", *long)
    assert out.exit_code == 2
    words = " ".join(out.output.split())
    told = "results/pair/run.h5 has an unfinished run that is not this one: it has a=2.0, this one a=1.0."
    remedy = "To complete it: orbits resume results/pair/run.h5. Otherwise give another folder with --out, or remove"
    assert f"{told} {remedy}" in words
