"""`orbits warm-up`: what runs need is compiled before they need it, and said."""

import os
import subprocess
import sys

import pytest
from typer.testing import CliRunner

from orbits import integrators
from orbits.cli import app
from orbits.errors import InputError
from orbits.scenario import warm_up
from orbits.scenario.warm_up import Done, Task, WarmUp

from ..coverings import at

SCENARIO = """
import orbits
pair = orbits.System.from_elements({"s": {"gm": 1}, "p": {"a": 1, "gm": 0.001}}, units=orbits.DIMENSIONLESS)
methods = [orbits.StormerVerlet(), orbits.methods.ExplicitEuler()]
scenario = orbits.scenarios.Scenario(
    name="tiny", title="Tiny", integrators=methods, dt=0.01, duration=1000, samples=11, against=[], system=pair
)
"""
COUNTED = """
import sys
from orbits.kernels.compile.compile_time import compile_time
from orbits.cli import app
app(sys.argv[1:], standalone_mode=False)
print("compiled", compile_time.seconds() > 0.0)
"""


@pytest.fixture
def command(tmp_path):
    """Return a function that runs a command with a cache of its own; it returns the output and the messages."""
    (tmp_path / "tiny.py").write_text(SCENARIO)

    def run(*arguments):
        environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache")}
        program = [sys.executable, "-c", COUNTED, *arguments]
        done = subprocess.run(program, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=600)
        assert done.returncode == 0, done.stderr
        return done.stdout, done.stderr

    return run


@pytest.mark.nightly
def test_a_scenario_runs_without_compiling_after_it_was_warmed_up(command):
    out, messages = command("warm-up", "tiny.py")
    assert out.startswith("ready after ")
    assert "2 of 2 kinds of run had kernels to compile" in out
    assert messages.splitlines()[0] == "compiling for this machine, once: 2 kinds of run, 2 at a time"
    again, _ = command("warm-up", "tiny.py")
    assert again.startswith("nothing to compile: the kernels of 2 kinds of run are in the cache")
    ran, messages = command("run", "tiny.py", "--no-plot")
    assert "compiled False" in ran
    assert "compiling" not in messages


def test_a_scenario_is_made_ready_in_a_process_of_its_own(tmp_path):
    path = tmp_path / "tiny.py"
    path.write_text(SCENARIO.replace(", orbits.methods.ExplicitEuler()", ""))
    done = CliRunner().invoke(app, ["warm-up", str(path)])
    assert done.exit_code == 0, done.output
    assert done.stdout.startswith(("ready after ", "nothing to compile: the kernels of 1 kinds of run"))


def test_everything_has_each_method_with_and_without_massless_bodies_once():
    tasks = warm_up.everything()
    assert tasks[: len(warm_up.everyday())] == warm_up.everyday()
    assert len({task[1:] for task in tasks}) == len(tasks)
    for name in integrators.registry():
        assert {("bodies", (name,)), ("particles", (name,))} <= {task[1:] for task in tasks}


@pytest.mark.parametrize("label", at((0, 1, 3, 4), [task.label for task in warm_up.everyday()]))
def test_everyday_calls_are_no_refused_ones(label):
    (task,) = (task for task in warm_up.everyday() if task.label == label)
    assert warm_up.performed(task).refused == ""


def test_a_combination_that_is_refused_is_told_and_no_failure():
    done = warm_up.performed(Task("nothing", "bodies", ("no such method",)))
    assert "no such method" in done.refused


def test_a_study_is_refused():
    with pytest.raises(InputError, match="is a study, which makes its runs by itself; expected a scenario"):
        warm_up.of_scenario("brouwer")


def test_the_outcome_is_said_in_a_line():
    assert str(WarmUp(5, 61.2, 4, {})) == "ready after 61 s: 4 of 5 kinds of run had kernels to compile"
    assert Done(False, "").refused == ""
