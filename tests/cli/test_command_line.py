"""The command line: what it prints, what it exits with, and that no traceback is ever seen."""

import io
import json
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from astropy import units as u
from typer.testing import CliRunner

import orbits
from orbits import integrators
from orbits.cli import app
from orbits.errors import InputError, Interrupted
from orbits.regression import PEERS
from orbits.scenario import bundled, load
from orbits.scenario.command import guarded
from orbits.scenario.printed import stderr, stdout
from orbits.scenario.runs import Runs
from tests.coverings import each
from tests.stopping import after_samples

COMMANDS = ["run", "resume", "compare", "certify", "plot", "view", "info", "list"]


@pytest.fixture(autouse=True)
def elsewhere(tmp_path, monkeypatch):
    """Results go to the working folder by default: let that be an empty one."""
    folder = tmp_path / "elsewhere"
    folder.mkdir()
    monkeypatch.chdir(folder)


def call(*arguments):
    return CliRunner().invoke(app, [str(a) for a in arguments])


@pytest.fixture(scope="module")
def whole_run(tmp_path_factory):
    path = tmp_path_factory.mktemp("whole") / "run.h5"
    system = orbits.System.solar_system(bodies=["Sun", "Jupiter", "Saturn"])
    run = orbits.propagate(
        system, orbits.Gauss(stages=4), dt=40 * u.day, duration=10 * u.yr, samples=11, archive=path
    )
    run.close()
    return path


@pytest.fixture
def archive(whole_run, tmp_path):
    return shutil.copy(whole_run, tmp_path / "run.h5")


@pytest.fixture(scope="module")
def with_controls(tmp_path_factory):
    """The file of a scenario with a method and two controls."""
    path = tmp_path_factory.mktemp("scenario") / "controlled.py"
    path.write_text(
        "import orbits\n"
        "bodies = {'s': {'gm': 1}, 'p': {'a': 1, 'e': 0.6, 'gm': 0.001}}\n"
        "methods = [orbits.Gauss(stages=8), orbits.methods.ExplicitEuler(), orbits.methods.RungeKutta4()]\n"
        "scenario = orbits.scenarios.Scenario(name='controlled', title='With controls', integrators=methods, dt=0.1,\n"
        "    duration=2, samples=5, against=['whfast'], checks=lambda outcome: [orbits.scenarios.Check('all', True)],\n"
        "    system=orbits.System.from_elements(bodies, units=orbits.DIMENSIONLESS))\n"
    )
    return path


@pytest.fixture(scope="module")
def controlled_run(with_controls, tmp_path_factory):
    """What a run of all methods of a scenario says, and its folder."""
    folder = tmp_path_factory.mktemp("controlled") / "k"
    return call("run", with_controls, "--no-plot", "--out", folder), folder


@pytest.fixture(scope="module")
def listed():
    """What `orbits list` prints, and what it has of the scenarios and methods as JSON."""
    return call("list").output, json.loads(call("list", "--json").stdout)


@pytest.fixture
def impossible(tmp_path):
    path = tmp_path / "impossible.py"
    path.write_text(
        "import orbits\n"
        "bodies = {'s': {'gm': 1}, 'p': {'a': 1, 'gm': 0.001}}\n"
        "scenario = orbits.scenarios.Scenario(name='impossible', title='Impossible',\n"
        "    integrators=[orbits.StormerVerlet()], dt=0.1, duration=1, samples=3,\n"
        "    against=['leapfrog'], tolerances={'position': 1e-30},\n"
        "    system=orbits.System.from_elements(bodies, units=orbits.DIMENSIONLESS))\n"
    )
    return path


@pytest.mark.parametrize("command", COMMANDS)
def test_every_commands_help_has_an_example(command):
    out = call(command, "--help")
    assert out.exit_code == 0
    assert f"Example: orbits {command}" in " ".join(out.output.split())


@pytest.mark.parametrize(
    ("command", "default"), [("run", "results/NAME by default"), ("plot", "beside FILE by default")]
)
def test_help_says_where_results_go_and_that_flags_take_no_value(command, default):
    text = " ".join(call(command, "--help").output.replace("│", " ").split())
    assert default in text
    assert "bool" not in text.split("--help")[0]


def test_the_commands_are_those_that_the_help_lists():
    out = call("--help")
    assert all(command in out.output for command in COMMANDS)
    assert call("--version").output.strip() == f"orbits {orbits.__version__}"


def test_list_shows_every_scenario_and_integrator(listed):
    text, record = listed
    assert {s["name"] for s in record["scenarios"]} == {s.name for s in bundled()}
    assert {m["name"] for m in record["integrators"]} == set(integrators.registry())
    for name in [*(s.name for s in bundled()), *integrators.registry()]:
        assert name in text
    assert "symplectic" in text


def test_the_list_of_scenarios_names_their_options(listed):
    text, record = listed
    assert "for a hundred thousand years; options: planets, count" in " ".join(text.split())
    found = {scenario["name"]: scenario["options"] for scenario in record["scenarios"]}
    assert found == {scenario.name: list(scenario.options) for scenario in bundled()}


def test_run_prints_tables_and_writes_where_it_was_told(controlled_run):
    out, folder = controlled_run
    assert out.exit_code == 0, out.output
    assert "Gauss(stages=8)" in out.output
    assert "holds" in out.output
    assert '"times": [0.0, 0.5, 1.0, 1.5, 2.0]' in (folder / "report.json").read_text()


def test_run_takes_another_method_backwards_and_prints_json_alone(tmp_path):
    out = call(
        "run", "solar_system", "--integrator", "gauss(stages=4)", "--dt", "2 d", "--duration", "-0.5 yr",
        "--samples", "3", "--json", "--no-plot", "--out", tmp_path,
    )  # fmt: skip
    record = json.loads(out.stdout)
    assert out.exit_code == 0
    (run,) = record["cases"][""]["runs"].values()
    assert run["integrator"] == "Gauss(stages=4)"
    assert run["dt"] == 2.0
    assert orbits.Trajectory.open(tmp_path / "run.h5").times[-1] == -0.5 * 365.25


@pytest.mark.nightly
def test_a_scenario_with_constant_steps_is_run_and_compared_with_adaptive_ones(tmp_path):
    out = call(
        "run", "solar_system", "--dt", "adaptive", "--integrator", "gauss", "--duration", "1 yr", "--samples", "3",
        "--json", "--no-plot", "--out", tmp_path / "run",
    )  # fmt: skip
    record = json.loads(out.stdout)
    assert out.exit_code == 0, out.output
    (run,) = record["cases"][""]["runs"].values()
    assert run["dt"] is None
    assert "adaptive steps (tolerance 1e-09)" in call("info", tmp_path / "run" / "run.h5").output
    out = call(
        "compare", "kepler", "--dt", "adaptive(tolerance=1e-8)", "--integrator", "gauss", "--duration", "6",
        "--samples", "3", "--json", "--no-plot", "--out", tmp_path / "compare",
    )  # fmt: skip
    record = json.loads(out.stdout)
    assert out.exit_code == 0, out.output
    for case in record["cases"].values():
        assert case["settings"]["tolerance"] == 1e-8
        verdicts = {row["method"]: row["verdict"] for row in case["rows"]}
        assert verdicts == {"Gauss(stages=8)": "ok", "REBOUND whfast": "n/a", "REBOUND ias15": "peer"}


@pytest.mark.nightly
def test_a_scenario_is_run_compared_and_certified_in_transformed_time(tmp_path):
    typed = ["--dt", "transformed:0.3", "--integrator", "gauss"]
    out = call("run", "pythagorean", *typed, "--json", "--no-plot", "--out", tmp_path / "run")
    (run,) = json.loads(out.stdout)["cases"][""]["runs"].values()
    assert out.exit_code == 0, out.output
    assert run["made_by"] == "Gauss(stages=8), steps of 0.3 in transformed time"
    assert run["made_by"] in call("info", next(tmp_path.glob("run/*.h5"))).output
    out = call("compare", "kepler", *typed, "--duration", "20", "--json", "--no-plot", "--out", tmp_path)
    assert out.exit_code == 0, out.output
    verdicts = [row["verdict"] for case in json.loads(out.stdout)["cases"].values() for row in case["rows"]]
    assert "ok" in verdicts
    out = call("certify", "kepler", *typed, "--out", tmp_path)
    assert out.exit_code == 0, out.output


def test_light_bodies_are_refused_in_transformed_time_with_the_reason(tmp_path):
    out = call("run", "close_encounter", "--dt", "transformed", "--no-plot", "--out", tmp_path / "out")
    assert out.exit_code == 2
    assert "is too light for transformed time: rounding errors of the energy" in " ".join(out.output.split())


@pytest.mark.parametrize("command", ["run", "compare"])
def test_methods_that_need_a_dt_are_refused_with_the_option_that_leaves_them_out(command, tmp_path):
    out = call(command, "kepler", "--dt", "adaptive", "--out", tmp_path / "out")
    assert out.exit_code == 2
    text = " ".join(out.output.split())
    assert "StormerVerlet() needs a dt" in text
    assert "--integrator gauss" in text
    assert not (tmp_path / "out").exists()
    out = call("certify", "kepler", "--dt", "adaptive", "--out", tmp_path)
    assert out.exit_code == 2
    assert "a certificate needs steps of one length" in " ".join(out.output.split())


def test_a_tolerance_that_is_exceeded_ends_with_exit_code_1(impossible, tmp_path):
    for command in ("run", "compare"):
        out = call(command, impossible, "--no-plot", "--out", tmp_path / command)
        assert out.exit_code == 1, out.output
        assert "FAIL" in out.output
        assert "exceeds" in out.output


def test_compare_takes_its_peers_from_the_command_line(tmp_path):
    out = call(
        "compare", "solar_system", "--against", "leapfrog", "--duration", "100 d", "--samples", "3", "--integrator",
        "gauss", "--out", tmp_path, "--json",
    )  # fmt: skip
    record = json.loads(out.stdout)
    assert out.exit_code == 0, out.output
    assert [row["method"] for row in record["cases"][""]["rows"]] == ["Gauss(stages=8)", "REBOUND leapfrog"]
    assert (tmp_path / "comparison.png").exists()
    assert json.loads((tmp_path / "comparison.json").read_text()) == record["cases"][""]


@pytest.fixture
def judged(tmp_path):
    """A study of Kepler's problem by a variational method and one that is none."""
    path = tmp_path / "judged.py"
    path.write_text(
        "import orbits\n"
        "kepler, methods = orbits.lagrangians.kepler, orbits.methods\n"
        "both = [orbits.StormerVerlet(), methods.ExplicitEuler()]\n"
        "scenario = orbits.scenarios.Study(name='judged', title='Judged', experiment=print,\n"
        "    certifies=[(kepler, method, 0.1) for method in both])\n"
    )
    return path


def test_certify_judges_variational_methods_and_shows_controls(judged, tmp_path):
    out = call("certify", judged, "--out", tmp_path)
    assert out.exit_code == 0, out.output
    text = " ".join(out.stdout.split())
    assert "StormerVerlet() on kepler, dt = 0.1" in text
    assert "a variational integrator, as declared" in text
    assert text.count("NOT CERTIFIED") == text.count("a control, shown for comparison") == 1
    assert "ok: 1 certified, 1 control not judged" in text
    record = json.loads((tmp_path / "certificate.json").read_text())
    assert [(c["control"], c["certificate"]["ok"]) for c in record["certificates"]] == [(False, True), (True, False)]
    again = ["certify", judged, "--integrator", "explicit-euler", "--out", tmp_path]
    assert call(*again).exit_code == 1  # its own file may be replaced
    (tmp_path / "certificate.json").write_text("my notes")
    assert call(*again).exit_code == 2


@pytest.mark.nightly
def test_certify_takes_each_problem_of_a_study_once_for_a_method_that_was_asked_for(tmp_path):
    (tmp_path / "twice.py").write_text(
        "import orbits\n"
        "def pair():\n"
        "    bodies = {'s': {'gm': 1}, 'p': {'a': 1, 'gm': 0.001}}\n"
        "    return orbits.System.from_elements(bodies, units=orbits.DIMENSIONLESS)\n"
        "scenario = orbits.scenarios.Study(name='twice', title='Twice', experiment=print,\n"
        "    certifies=[(pair(), orbits.StormerVerlet(), 0.1), (pair(), orbits.methods.RungeKutta4(), 0.1)])\n"
    )
    out = call("certify", tmp_path / "twice.py", "--integrator", "stormer-verlet", "--json", "--out", tmp_path)
    assert len(json.loads(out.stdout)["certificates"]) == 1


def test_what_a_run_minds_is_said_in_sentences_and_of_controls_once(controlled_run, with_controls, tmp_path):
    command = ["run", with_controls, "--no-plot", "--out", tmp_path]
    said = " ".join(controlled_run[0].stderr.split())
    assert said.count("for the controls") == 1
    assert said.endswith("for the controls ExplicitEuler(), RungeKutta4(), as was to be expected.")
    alone = " ".join(call(*command, "--integrator", "explicit-euler").stderr.split())
    assert re.search(r"a full turn would take [\d.]+ steps", alone)
    assert "one by one. ..." not in alone


def test_certify_fails_a_control_that_was_asked_for(judged, tmp_path):
    out = call("certify", judged, "--integrator", "runge-kutta-4", "--dt", "0.2", "--json", "--out", tmp_path)
    assert out.exit_code == 1, out.output
    record = json.loads(out.stdout)
    (entry,) = record["certificates"]
    assert (record["ok"], entry["control"], entry["certificate"]["dt"]) == (False, False, 0.2)
    assert "symplecticity" in " ".join(entry["certificate"]["failures"])


@pytest.mark.nightly
def test_certify_takes_every_system_of_a_scenario(tmp_path):
    out = call("certify", "kepler", "--integrator", "gauss(stages=2)", "--dt", "0.05", "--json", "--out", tmp_path)
    record = json.loads(out.stdout)
    assert [entry["case"] for entry in record["certificates"]] == ["e = 0", "e = 0.3", "e = 0.6", "e = 0.9"]
    assert all(entry["certificate"]["method"] == "Gauss(stages=2)" for entry in record["certificates"])
    assert out.exit_code == 0
    assert record["ok"]


def test_info_says_what_an_archive_holds(archive):
    text, record = call("info", archive), json.loads(call("info", archive, "--json").stdout)
    assert record["names"] == ["Sun", "Jupiter", "Saturn"]
    assert record["integrator"] == "Gauss(stages=4)"
    assert (record["samples"], record["complete"], record["dt"]) == (11, True, 40.0)
    assert "angular momentum" in text.output


def test_plot_draws_an_archive(archive, tmp_path):
    assert call("plot", archive).exit_code == 0
    assert (tmp_path / "run.png").read_bytes().startswith(b"\x89PNG")
    (tmp_path / "run.png").rename(tmp_path / "other.png")
    again = call("plot", archive, "--kind", "energy", "--out", tmp_path / "other.png")
    assert again.exit_code == 0  # its own picture may be replaced
    assert not (tmp_path / "run.png").exists()


def test_resume_extends_a_finished_run(archive):
    out = call("resume", archive, "--until", "12 yr")
    assert out.exit_code == 0, out.output
    assert orbits.Trajectory.open(archive).times[-1] == 12 * 365.25


def test_resuming_a_finished_run_says_that_it_was_complete_and_how_to_extend_it(archive):
    before = archive.read_bytes()
    out = call("resume", archive, "--json")
    assert out.exit_code == 0
    assert json.loads(out.stdout)["complete"]
    (line,) = out.stderr.splitlines()
    assert line.startswith("complete already, nothing was done")
    assert line.endswith(f"orbits resume {archive} --until '7305 d'")
    assert archive.read_bytes() == before
    assert call("resume", archive, "--until", "7305 d").stderr == ""


def test_what_is_said_to_extend_a_run_extends_it_also_where_it_ends_behind_its_samples(tmp_path):
    path, system = tmp_path / "my run.h5", orbits.System.solar_system("2026-01-01", bodies=["Sun", "Jupiter"])
    orbits.propagate(system, dt=40, duration=400, samples=[40.0], archive=path)
    _, _, typed = call("resume", path).stderr.strip().partition("extend it with  orbits ")
    assert call(*shlex.split(typed)).exit_code == 0
    assert orbits.Trajectory.open(path).span[1] == 800.0


def test_an_interrupted_run_says_how_to_go_on_and_resume_completes_it(tmp_path, monkeypatch):
    after_samples(monkeypatch, 1, lambda: os.kill(os.getpid(), signal.SIGINT))
    command = ["run", "solar_system", "--duration", "1 yr", "--samples", "9", "--no-plot", "--out", str(tmp_path)]
    monkeypatch.setattr(sys, "argv", ["orbits", *command])
    out = call(*command)
    assert out.exit_code == 130
    assert f"in {tmp_path}, run.h5 is begun; to go on: {shlex.join(sys.argv)}\n" in out.output
    assert "Traceback" not in out.output
    monkeypatch.undo()
    path = tmp_path / "run.h5"
    assert "not complete" in call("info", path).output
    assert call("resume", path).exit_code == 0
    assert len(orbits.Trajectory.open(path)) == 9


@pytest.fixture
def ways(tmp_path):
    (tmp_path / "text.h5").write_text("no archive")
    (tmp_path / "way").write_text("a file in the way")
    return tmp_path


@each(
    ("arguments", "message"),
    [
        (["run", "keppler"], "Did you mean"),
        (["run", "WAYS/none.py"], "does not exist"),
        (["run", "/dev/null"], "is no regular file"),
        (["run", "kepler", "--dt", "0"], "dt must be finite and not zero"),
        (["run", "kepler", "--dt", "nan"], "dt must be finite and not zero"),
        (["run", "kepler", "--dt", "3 km"], "dt"),
        (["run", "kepler", "--dt", "soon"], "--dt = 'soon'"),
        (["run", "kepler", "--dt", "3 days"], "'days' is not a unit; did you mean day?"),
        (["run", "kepler", "--dt", "3 d"], "a plain number, as DIMENSIONLESS has no units"),
        (["run", "kepler", "--duration", "inf"], "duration must be finite"),
        (["run", "kepler", "--duration", "0"], "duration is 0"),
        (["run", "kepler", "--integrator", "gaus"], "did you mean gauss"),
        (["run", "kepler", "--integrator", "rk4"], "did you mean runge-kutta-4?"),
        (["run", "kepler", "--integrator", "RK-4"], "did you mean runge-kutta-4?"),
        (["run", "kepler", "--integrator", "leapfrog"], "did you mean stormer-verlet?"),
        (["run", "kepler", "--integrator", "velocity-verlet"], "did you mean stormer-verlet?"),
        (["run", "kepler", "--integrator", "midpoint"], "did you mean implicit-midpoint?"),
        (["run", "kepler", "--integrator", "euler"], "did you mean explicit-euler or symplectic-euler?"),
        (["run", "kepler", "--integrator", "ias15"], "REBOUND's: compare with it by against=['ias15']"),
        (["run", "kepler", "--integrator", "WHFast"], "or --against whfast."),
        (["run", "kepler", "--integrator", "gauss(stages=33)"], "between 1 and 32"),
        (["run", "kepler", "--samples", "1"], "samples"),
        (["run", "kepler", "--samples", "-3"], "samples"),
        (["run", "kepler", "--out", "WAYS/way"], "results need a folder"),
        (["compare", "kepler", "--against", "mercury"], "no peer is called"),
        (["run", "liouville", "--duration", "3"], "takes no --duration"),
        (["run", "liouville", "--dt", "1", "--samples", "3"], "takes no --dt or --samples"),
        (["compare", "liouville"], "is a study"),
        (["certify", "keppler"], "Did you mean"),
        (["certify", "kepler", "--integrator", "gaus"], "did you mean gauss"),
        (["certify", "pendulum", "--dt", "0"], "dt must be finite and not zero"),
        (["certify", "pendulum", "--dt", "1 d"], "dt must be a number"),
        (["certify", "kepler", "--out", "WAYS/way"], "results need a folder"),
        (["info", "WAYS/none.h5"], "none.h5"),
        (["info", "WAYS/text.h5"], "text.h5"),
        (["plot", "WAYS/text.h5"], "text.h5"),
        (["resume", "WAYS/text.h5"], "text.h5"),
        (["info", "WAYS"], "WAYS"),
    ],
)
def test_a_wrong_use_is_one_line_and_exit_code_2(ways, arguments, message):
    """WAYS is a folder with a file in the way, and one that is no archive."""
    out = call(*(word.replace("WAYS", str(ways)) for word in arguments))
    message = message.replace("WAYS", str(ways))
    assert out.exit_code == 2, out.output
    lines = [line for line in out.stderr.splitlines() if "error:" in line]
    assert len(lines) == 1
    assert message in " ".join(out.stderr.split())
    assert "Traceback" not in out.output


def test_a_truncated_archive_is_refused_in_words(archive):
    archive.write_bytes(archive.read_bytes()[:4000])
    out = call("info", archive)
    assert out.exit_code == 2
    assert "error:" in out.stderr


def test_an_until_before_the_end_is_refused(archive):
    out = call("resume", archive, "--until", "1 yr")
    assert out.exit_code == 2
    assert "before the end" in " ".join(out.stderr.split())


def test_unknown_options_are_a_wrong_use():
    assert call("run", "kepler", "--stepp", "1").exit_code == 2
    assert call("nothing").exit_code == 2


def test_the_command_line_starts_without_heavy_packages():
    code = (
        "import sys, orbits.cli\n"
        "heavy = {'numba', 'matplotlib', 'rebound', 'astropy', 'h5py', 'numpy'} & set(sys.modules)\n"
        "print(sorted(heavy))"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.strip() == "[]"


@pytest.mark.nightly
def test_a_reader_that_stops_early_is_no_error():
    command = f"{sys.executable} -c 'from orbits.cli import main; main()' list --json | head -1"
    out = subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=False)
    assert "Traceback" not in out.stderr
    assert "BrokenPipe" not in out.stderr


def test_a_reader_that_stops_early_is_no_failure_of_what_is_printed_as_tables(monkeypatch):
    reader, writer = os.pipe()
    os.close(reader)
    monkeypatch.setattr(sys, "stdout", os.fdopen(writer, "w"))
    with pytest.raises(SystemExit) as caught, guarded():
        stdout().print("x" * 100_000)
    assert caught.value.code == 0


@pytest.mark.parametrize("stream", ["stdout", "stderr"])
def test_a_command_whose_output_is_closed_does_what_it_is_asked_for(stream, monkeypatch):
    """As by >&- and 2>&-: it ended in an AttributeError, "a bug in orbits"."""
    monkeypatch.setattr(sys, stream, None)
    with guarded():
        print("a result")
        stderr().print("a message")
    with pytest.raises(SystemExit) as caught, guarded():
        raise InputError("wrong use")
    assert caught.value.code == 2


def test_a_run_that_is_interrupted_ends_with_its_own_exit_code_and_what_it_says(capsys):
    assert Interrupted("stopped").exit_code == 130
    with pytest.raises(SystemExit) as caught, guarded():
        raise Interrupted("stopped by SIGTERM at 3 of 7 d")
    assert caught.value.code == 130
    assert "stopped by SIGTERM at 3 of 7 d" in " ".join(capsys.readouterr().err.split())


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_signal_where_no_run_is_marched_ends_a_command_as_in_a_run(number, capsys):
    before = signal.getsignal(number)
    with pytest.raises(SystemExit) as caught, guarded():
        signal.raise_signal(number)
    assert caught.value.code == 130
    assert f"stopped by {number.name}" in capsys.readouterr().err
    assert signal.getsignal(number) == before


def test_a_signal_before_the_first_step_of_a_scenario_ends_it_as_one_in_a_run(tmp_path, monkeypatch):
    monkeypatch.setattr(Runs, "_run", lambda *given: signal.raise_signal(signal.SIGTERM))
    out = call("run", "kepler", "--no-plot", "--out", tmp_path)
    assert out.exit_code == 130
    assert "stopped by SIGTERM" in out.stderr


@pytest.mark.nightly
def test_a_process_of_its_own_tells_who_was_retired(tmp_path):
    """Where nothing had imported what marches runs again, `orbits info` knew of no retired particle."""
    q, v = [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]], np.zeros((2, 3))
    start = orbits.System(["star", "falls"], gm=[1, 0], q=q, v=v, units=orbits.DIMENSIONLESS)
    with pytest.warns(orbits.errors.RetiredWarning):
        orbits.propagate(start, dt=0.1, duration=5.0, check_step=False, archive=tmp_path / "run.h5").close()
    command = [sys.executable, "-m", "orbits", "info", str(tmp_path / "run.h5")]
    said = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert "2 bodies (1 retired)" in said
    assert "falls  the stages did not converge" in said


def test_letters_that_a_terminal_cannot_show_do_not_end_a_command(monkeypatch):
    shown = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(shown, encoding="ascii"))
    with guarded():
        print("max |ΔE/E|")
    assert shown.getvalue() == b"max |?E/E|\n"


def test_the_help_of_compare_lists_all_peers():
    said = call("compare", "--help").stdout
    assert all(peer in said for peer in PEERS)


def test_a_run_is_extended_to_a_date(archive):
    assert call("resume", archive, "--until", "2011-01-01").exit_code == 0
    assert orbits.Trajectory.open(archive).epochs[-1].isot == "2011-01-01T00:00:00.000"
    out = call("resume", archive, "--until", "2100-01-01x")
    assert out.exit_code == 2
    assert "until = '2100-01-01x'; expected" in " ".join(out.stderr.split())
    assert call("resume", archive, "--until", "1900-01-01").exit_code == 2


def test_the_package_is_run_as_the_command():
    done = subprocess.run([sys.executable, "-m", "orbits", "--version"], capture_output=True, text=True, check=True)
    assert done.stdout == f"orbits {orbits.__version__}\n"


@pytest.mark.nightly
def test_encounters_in_a_map_are_an_option_of_the_method_on_the_command_line(tmp_path):
    method = "wisdom-holman(encounters='follow')"
    out = call(
        "run", "solar_system", "--integrator", method, "--dt", "1 d", "--duration", "1 yr", "--samples", "3", "--json",
        "--no-plot", "--out", tmp_path,
    )  # fmt: skip
    assert out.exit_code == 0, out.output
    (run,) = json.loads(out.stdout)["cases"][""]["runs"].values()
    assert "encounters='follow all'" in run["integrator"]
    record = json.loads(call("info", tmp_path / "run.h5", "--json").stdout)
    assert all({"Earth", "Moon"} == set(one["bodies"]) for one in record["excursions"])
    out = call("run", "solar_system", "--integrator", "wisdom-holman(encounters='leave')", "--out", tmp_path / "other")
    assert out.exit_code == 2
    assert "expected 'warn', 'follow', 'follow particles'" in out.output


def test_the_archives_of_examples_are_those_that_their_scenarios_write(tmp_path):
    """In the help of commands, and so on their page, and in the other pages."""
    docs = Path(orbits.__file__).parents[1] / "docs"
    texts = [path.read_text(encoding="utf-8") for path in docs.rglob("*.md")]
    named = {found.groups() for text in texts for found in re.finditer(r"results/(\w+)/(run[-\w.]*\.h5)", text)}
    assert ("solar_system", "run.h5") in named
    for scenario, archive in named:
        made = load(scenario)
        assert archive in {path.name for path in Unlooked(made, made.cases(), {}, tmp_path).archives.values()}


class Unlooked(Runs):
    """The runs of a scenario, of which none is there."""

    def _look(self, name, label):
        return ""
