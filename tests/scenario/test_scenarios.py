"""Scenarios: found by name and path, validated, performed, and careful with other people's files."""

import contextlib
import json
import os
import re
import signal
import struct
import subprocess
import sys
import textwrap

import h5py
import numpy as np
import pytest
from astropy import units as u
from hypothesis import given
from hypothesis import strategies as st

import orbits
from orbits import integrators
from orbits.archive import Archive
from orbits.errors import InputError, Interrupted, OrbitsError, StepWarning, UnknownNameError
from orbits.marching.clocks.variable_steps import ChangingSteps
from orbits.methods import ExplicitEuler, RungeKutta4
from orbits.propagation import marchers
from orbits.scenario import bundled, load, perform, performing
from orbits.scenario.certificates import certify_scenario
from orbits.scenario.typed import quantity, step_or_clock
from orbits.scenario.unfinished import alone_in
from orbits.scenarios import Check, Scenario
from tests.stopping import after_samples

from ..coverings import each, every, first, only

STUDIES = [
    *("arenstorf", "brouwer", "de440", "didymos", "discrete_kepler", "eccentric", "euler_top", "figure_eight", "fit"),
    *("hyperion", "liouville", "mercury", "mercury_spin", "outer_solar_system", "pendulum", "planetesimals"),
    *("pleiades", "resonance_map", "three_body_zoo", "work_precision"),
]
SHORT = {
    "kepler": {"duration": 3.0, "samples": 21},
    "solar_system": {"duration": 2 * u.yr, "samples": 11},
    "asteroid_belt": {"duration": 60 * u.day, "samples": 5},
}
NAMES = sorted(SHORT)
WITHOUT_DT = {
    "pythagorean": {"duration": 66.0, "samples": 67},  # to the ejection
    "close_encounter": {"duration": 205 * u.day, "samples": 21},
}

IN_EPHEMERIS = ("apophis",)  # in tests/ephemeris/test_in_ephemeris.py

BY_MAPS = "kirkwood_gaps", "secular", "trojans"  # in test_long_runs.py and test_studies.py
BY_FORCES = ("dust",)  # in test_dust.py
BY_FITS = ("ttv",)  # in tests/fitting/test_planets.py


def pair(**changes):
    system = orbits.System(
        ["star", "planet"], [1.0, 1e-3], [[0, 0, 0], [1, 0, 0]], [[0, 0, 0], [0, 1, 0.1]], units=orbits.DIMENSIONLESS
    )
    settings = {
        "name": "pair",
        "title": "Two bodies",
        "system": system,
        "integrators": [orbits.Gauss(stages=4)],
        "dt": 0.05,
        "duration": 2.0,
        "samples": 5,
        "against": (),
    }
    return Scenario(**{**settings, **changes})


def test_the_bundled_scenarios_are_those_of_the_docs():
    named = [*SHORT, *WITHOUT_DT, *STUDIES, *BY_MAPS, *BY_FORCES, *BY_FITS, *IN_EPHEMERIS]
    assert [each.name for each in bundled()] == sorted(named)
    assert all(each.summary for each in bundled())


@pytest.mark.parametrize("name", only(["solar_system"], NAMES))
def test_each_bundled_scenario_shortened_gives_all_that_it_demands(name, tmp_path):
    """Variational methods keep angular momentum, controls lose it, tolerances hold, pictures and JSON are written."""
    scenario = load(name).with_changes(**SHORT[name])
    outcome = perform(scenario, out=tmp_path)
    assert outcome.ok, outcome.failures
    assert {"Gauss(stages=8)", "StormerVerlet()", "RungeKutta4()", "ExplicitEuler()"} == set(outcome.runs)
    claims = [c.claim for c in outcome.checks]
    for label, verb in (("Gauss", "keeps"), ("StormerVerlet", "keeps"), ("RungeKutta4", "loses"), ("Euler", "loses")):
        assert any(label in c and f"{verb} angular momentum" in c for c in claims)
    record = json.loads((tmp_path / "report.json").read_text())
    assert record["ok"]
    for path in outcome.files:
        assert path.exists()
        if path.suffix == ".png":
            width, height = struct.unpack(">II", path.read_bytes()[16:24])
            assert width >= 1300
            assert height >= 800


def without_dt(name, monkeypatch, **changes):
    """A bundled scenario without dt, shortened, with few rotated starts."""
    scenario = load(name).with_changes(**{**WITHOUT_DT[name], **changes})
    if name == "close_encounter":
        monkeypatch.setitem(scenario.checks.__globals__, "STARTS", 2)
    return scenario


@pytest.mark.nightly
@pytest.mark.parametrize(("name", "claims"), first(1, [("pythagorean", 4), ("close_encounter", 6)]))
def test_each_bundled_scenario_without_dt_shortened_gives_all_that_it_demands(name, claims, tmp_path, monkeypatch):
    scenario = without_dt(name, monkeypatch)
    outcome = perform(scenario, out=tmp_path)
    assert outcome.ok, outcome.failures
    assert len(outcome.checks) == claims
    record = json.loads((tmp_path / "report.json").read_text())
    for case in record["cases"].values():
        (run,) = case["runs"].values()
        assert run["dt"] is None
        assert run["tolerance"] == pytest.approx(1e-9, rel=1e-14)
        assert [row["method"] for row in case["report"]["rows"]] == ["Gauss(stages=8)", "REBOUND ias15"]
        assert case["report"]["reference"]["kind"] == "taylor"
    width, height = struct.unpack(">II", (tmp_path / f"{name}.png").read_bytes()[16:24])
    assert width >= 1300
    assert height >= 800


@pytest.mark.slow
@pytest.mark.parametrize("name", WITHOUT_DT)
def test_each_bundled_scenario_without_dt_gives_all_that_it_demands_in_full(name, tmp_path):
    outcome = perform(load(name), out=tmp_path)
    assert outcome.ok, outcome.failures


@pytest.mark.parametrize("name", first(1, WITHOUT_DT))
def test_steps_that_resolve_too_little_fail_the_scenarios_without_dt(name, tmp_path, monkeypatch):
    outcome = perform(without_dt(name, monkeypatch, dt=orbits.Adaptive(1e-3)), out=tmp_path, plot=False)
    assert any("exceeds" in failure for failure in outcome.failures)
    assert any(not check.ok for check in outcome.checks)


@pytest.mark.nightly
def test_an_encounter_that_is_not_reached_is_not_judged_and_its_panels_say_so(tmp_path, monkeypatch):
    outcome = perform(without_dt("close_encounter", monkeypatch, duration=20 * u.day), out=tmp_path)
    assert outcome.ok, outcome.failures
    assert outcome.checks == ()


def test_the_plane_of_an_encounter_is_met_where_the_straight_line_would_have_met_it():
    """On a hyperbola from far away: b is the offset of the asymptote, and its components are those of the line."""
    names = load("close_encounter").checks.__globals__
    gm, speed, far = np.array([2.0, 0.0]), 3.0, 1e9
    planet = np.array([0.0, 5.0, 0.0])  # its velocity: zeta points along -y, xi along z for a line along x
    coming = np.array([-far, -0.7, 0.4])
    # Energy and angular momentum as those of the line at infinity, on which the body moves at `speed`.
    velocity = planet + np.array([np.sqrt(speed**2 + 2 * gm.sum() / np.linalg.norm(coming)), 0.0, 0.0])
    q, v = np.array([[0, 0, 0], [0, 0, 0], coming]), np.array([[0, 0, 0], planet, velocity])
    (xi, zeta), speed2 = names["target_plane"](gm, q, v)
    assert speed2 == pytest.approx(speed**2, rel=1e-9)
    assert (xi, zeta) == (pytest.approx(-0.4, abs=1e-6), pytest.approx(0.7, abs=1e-6))
    assert names["grazing"](1.0, gm, 4.0) == pytest.approx(np.sqrt(2.0))


@pytest.mark.parametrize("share", first(2, [0.01, -0.5, 1.0, 10.0]))
@pytest.mark.parametrize("name", only(["solar_system"], NAMES))
def test_a_run_of_a_few_steps_or_less_than_one_is_no_failure(name, share, tmp_path):
    """Controls are judged from one step on: in a part of a step they lose less, which need not show."""
    scenario = load(name)
    outcome = perform(scenario.with_changes(duration=share * scenario.dt, samples=3), out=tmp_path, plot=False)
    assert outcome.ok, outcome.failures
    assert any("loses" in check.claim for check in outcome.checks) is (share >= 1.0)


def test_the_old_name_of_the_controls_says_the_new_one():
    with pytest.raises(UnknownNameError, match="no argument 'foils': it is called controls now"):
        next(orbits.scenario.angular_momentum_checks({}, bound=1e-14, foils=False))


@pytest.mark.nightly
def test_a_scenario_file_runs_as_a_program_of_its_own(tmp_path):
    path = next(each.path for each in bundled() if each.name == "kepler")
    done = subprocess.run(
        [sys.executable, str(path), "--duration", "2", "--samples", "5", "--no-plot", "--json"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["ok"]
    assert (tmp_path / "results" / "kepler" / "run-e-0.9.h5").exists()
    assert not list(tmp_path.rglob("*.png"))


@pytest.mark.nightly
def test_steps_and_durations_in_words_are_the_same_for_run_comparison_and_certificate(tmp_path):
    scenario = pair(dt="P/100", duration="2", against=("ias15",), tolerances={"energy": 1e-9})
    outcome = perform(scenario, out=tmp_path, plot=False)
    assert outcome.ok
    assert outcome.run.dt.value == pytest.approx(2 * np.pi / 100, rel=0.02)  # the star has a mass of its own
    assert outcome.report.settings["dt"] == outcome.run.dt.value
    (one,) = certify_scenario(scenario, out=tmp_path).certified
    assert one.certificate.dt == outcome.run.dt.value


def test_a_scenario_needs_no_dt_and_no_method(tmp_path):
    changes = {"dt": None, "against": ("whfast", "ias15"), "tolerances": {"position": 1e-13}}
    settings = {name: value for name, value in vars(pair(**changes)).items() if name != "integrators"}
    outcome = perform(Scenario(**settings), out=tmp_path, plot=False)
    assert outcome.ok, outcome.failures
    assert outcome.run.made_by == "Gauss(stages=8), adaptive steps (tolerance 1e-09)"
    verdicts = {row.method: row.verdict for row in outcome.report.rows}
    assert verdicts == {"Gauss(stages=8)": "ok", "REBOUND whfast": "n/a", "REBOUND ias15": "peer"}


@pytest.mark.parametrize("named", ["gauss(stages=4)", ["gauss(stages=4)"], [orbits.Gauss(stages=4)]])
def test_a_scenario_takes_the_names_of_methods_as_propagate_does(named):
    assert pair(integrators=named).integrators == (orbits.Gauss(stages=4),)


def test_a_method_that_needs_a_dt_is_refused_before_any_run(tmp_path):
    with pytest.raises(InputError, match=r"StormerVerlet\(\) needs a dt"):
        perform(pair(dt=None, integrators=[orbits.Gauss(stages=8), orbits.StormerVerlet()]), out=tmp_path)
    assert not list(tmp_path.iterdir())


@pytest.mark.nightly
def test_a_scenario_without_dt_is_certified_with_a_step_only(tmp_path):
    for dt in (None, orbits.Adaptive(1e-8)):
        with pytest.raises(InputError, match=r"'pair' has adaptive steps.*--dt"):
            certify_scenario(pair(dt=dt), out=tmp_path)
    (one,) = certify_scenario(pair(dt=None), dt=0.05, out=tmp_path).certified
    assert one.certificate.dt == np.float32(0.05)


def test_running_twice_replaces_what_the_first_run_wrote(tmp_path):
    perform(pair(), out=tmp_path, plot=False)
    first = (tmp_path / "run.h5").read_bytes()
    outcome = perform(pair(duration=4.0), out=tmp_path, plot=False)
    assert outcome.ok
    assert (tmp_path / "run.h5").read_bytes() != first


def stopped_by_ctrl_c(scenario, folder, monkeypatch):
    after_samples(monkeypatch, 1, lambda: os.kill(os.getpid(), signal.SIGINT))
    with pytest.raises(Interrupted):
        perform(scenario, out=folder)
    monkeypatch.undo()


@pytest.mark.parametrize("dt", [0.05, None], ids=["constant steps", "adaptive steps"])
def test_running_again_after_ctrl_c_goes_on_with_the_same_run(tmp_path, dt, monkeypatch):
    stopped_by_ctrl_c(pair(dt=dt), tmp_path / "stopped", monkeypatch)
    said = []
    again = perform(pair(dt=dt), out=tmp_path / "stopped", plot=False, say=said.append)
    undisturbed = perform(pair(dt=dt), out=tmp_path / "whole", plot=False)
    assert any("going on with the unfinished run" in line for line in said)
    assert again.run.complete
    for ours, theirs in ((again.run.q, undisturbed.run.q), (again.run.v, undisturbed.run.v)):
        assert ours.value.tobytes() == theirs.value.tobytes()


@pytest.mark.parametrize(
    ("before", "now", "told"),
    [
        ({}, {"dt": 0.025}, "it has dt = 0.05, this one dt = 0.025"),
        ({"dt": None}, {}, r"it has adaptive steps \(tolerance .*\), this one dt = 0.05"),
        ({"duration": 3.0}, {}, "it ends at t = 3, this one at 2"),
        ({"duration": 2.0000001}, {}, "it ends at t = 2.0000001, this one at 2.0"),
        ({"duration": -2.0}, {}, "it has dt = 0.05 backwards, this one dt = 0.05; it ends at t = -2, this one at 2"),
        ({"samples": 7}, {}, "it has 7 samples, this one 5"),
        ({"integrators": [orbits.Gauss(stages=3)], "dt": 0.1}, {},
         r"it has Gauss\(stages=3\), this one Gauss\(stages=4\); it has dt = 0.1, this one dt = 0.05"),
        ({"system": pair().system.replaced(softening=0.01)}, {}, "it has other bodies, states or forces"),
        ({"system": pair().system.barycentric()}, {}, "it has other bodies, states or forces"),
    ],
)  # fmt: skip
def test_an_unfinished_run_is_not_lost_to_another(tmp_path, before, now, told, monkeypatch):
    stopped_by_ctrl_c(pair(**before), tmp_path, monkeypatch)
    kept = (tmp_path / "run.h5").read_bytes()
    remedy = "To complete it: orbits resume [^ ]*run.h5. Otherwise give another folder with --out"
    with pytest.raises(InputError, match=f"run.h5 has an unfinished run that is not this one: {told}. {remedy}"):
        perform(pair(**now), out=tmp_path)
    assert (tmp_path / "run.h5").read_bytes() == kept


def test_an_unfinished_run_by_another_version_is_not_lost_and_its_remedy_works(tmp_path, monkeypatch):
    stopped_by_ctrl_c(pair(), tmp_path, monkeypatch)
    now = marchers.provenance()
    monkeypatch.setattr(marchers, "provenance", lambda: {**now, "numba": "99"})
    changed = "it was made with a different numba .* -> 99; its last bits may come out differently here"
    with pytest.raises(InputError, match=f"{changed}. To complete it: orbits resume .*run.h5 --any-bits. Otherwise"):
        perform(pair(), out=tmp_path)
    assert orbits.resume(tmp_path / "run.h5", same_bits=False).complete
    assert perform(pair(), out=tmp_path, plot=False).ok


def test_an_unfinished_run_of_an_unknown_method_is_not_lost(tmp_path, monkeypatch):
    stopped_by_ctrl_c(pair(), tmp_path, monkeypatch)
    monkeypatch.setattr(Archive, "integrator", {"name": "mine", "parameters": {}})
    with pytest.raises(InputError, match=r"run.h5 has an unfinished .*: it has a method that is not known here, mine"):
        perform(pair(), out=tmp_path)


def test_an_archive_that_cannot_be_read_is_not_replaced(tmp_path):
    perform(pair(), out=tmp_path, plot=False)
    with h5py.File(tmp_path / "run.h5", "r+") as file:
        file.attrs["orbits"] = "99"
    with pytest.raises(InputError, match=r"run.h5.* It is not replaced: give another folder with --out, or remove"):
        perform(pair(), out=tmp_path)


def begin_another(path):
    def stumble(time, system):
        raise ValueError("a mistake of its user")

    with pytest.raises(ValueError, match="a mistake"):
        orbits.propagate(pair().system, orbits.Gauss(stages=4), dt=0.05, duration=3.0, archive=path, callback=stumble)


def test_a_run_with_an_error_of_its_user_is_not_lost_but_one_whose_step_failed_is_replaced(tmp_path):
    begin_another(tmp_path / "run.h5")
    with pytest.raises(InputError, match="has an unfinished run that is not this one: it ends at t = 3, this one at 2"):
        perform(pair(), out=tmp_path)
    (tmp_path / "run.h5").unlink()
    hopeless = pair(integrators=[orbits.Gauss(stages=8)], dt=8.0, duration=100.0)
    assert not perform(hopeless, out=tmp_path, plot=False).ok
    assert perform(pair(), out=tmp_path, plot=False).ok


def test_a_run_that_is_being_written_and_a_folder_in_use_are_left_alone(tmp_path):
    perform(pair(), out=tmp_path, plot=False)
    with contextlib.closing(Archive.claim(tmp_path / "run.h5")), pytest.raises(InputError, match="being written by"):
        perform(pair(), out=tmp_path)
    with alone_in(tmp_path), pytest.raises(InputError, match=r"another process runs a scenario in .*; wait for it"):
        perform(pair(), out=tmp_path)
    assert perform(pair(), out=tmp_path, plot=False).ok


def test_a_run_begun_by_another_process_meanwhile_is_not_lost(tmp_path, monkeypatch):
    """`orbits resume` and `orbits.propagate` do not look at the folder: between two cases they may have begun a run."""
    two = pair(system=lambda: {"one": pair().system, "two": pair().system.barycentric()})
    report, told = performing._report, "run-two.h5 has an unfinished run that is not this one"

    def report_while_another_begins(*words):
        begin_another(tmp_path / "run-two.h5")
        return report(*words)

    monkeypatch.setattr(performing, "_report", report_while_another_begins)
    with pytest.raises(InputError, match=told):
        perform(two, out=tmp_path, plot=False)


def test_the_complete_cases_of_a_run_that_was_stopped_are_not_run_again(tmp_path, monkeypatch):
    two = pair(system=lambda: {"one": pair().system, "two": pair().system.barycentric()})
    whole = perform(two, out=tmp_path / "whole", plot=False)
    assert perform(two, out=tmp_path, plot=False).ok
    before = (tmp_path / "run-one.h5").read_bytes()
    (tmp_path / "run-two.h5").unlink()
    stopped_by_ctrl_c(pair(system=pair().system.barycentric()), tmp_path / "stopped", monkeypatch)
    (tmp_path / "stopped" / "run.h5").rename(tmp_path / "run-two.h5")
    said = []
    again = perform(two, out=tmp_path, plot=False, say=said.append)
    assert any("one, " in line and ", complete in" in line for line in said)
    assert any("two, " in line and ", going on with the unfinished run in" in line for line in said)
    assert (tmp_path / "run-one.h5").read_bytes() == before
    for case in ("one", "two"):
        assert again.cases[case].run.q.value.tobytes() == whole.cases[case].run.q.value.tobytes()


SEVERAL = {
    "integrators": [orbits.Gauss(stages=4), orbits.StormerVerlet(), RungeKutta4()],
    "against": ("leapfrog", "ias15"),
}
"""Two methods and a control, beside two peers and the exact solution."""

STAGES = {
    "StormerVerlet()": ("run.h5 is complete; run-StormerVerlet.h5 is begun", 0),
    "reference": ("run.h5, run-StormerVerlet.h5, run-RungeKutta4.h5 are complete", 0),
    "REBOUND ias15": ("run-RungeKutta4.h5 are complete; of the comparison: reference, exact, REBOUND leapfrog", 2),
}
"""Where Ctrl-C comes, what is there then by the message, and how many parts of the comparison."""


@pytest.mark.parametrize("stage", every(2, STAGES))
def test_ctrl_c_anywhere_says_what_is_there_and_the_same_run_goes_on_to_the_same_bits(tmp_path, stage, monkeypatch):
    told, parts = STAGES[stage]
    now = []

    def stop():
        if now[-1].startswith(stage):
            signal.raise_signal(signal.SIGINT)

    def note_or_stop(text):
        now.append(text)
        if text.startswith(stage) and stage != "StormerVerlet()":
            signal.raise_signal(signal.SIGINT)

    after_samples(monkeypatch, None, stop)
    message = f"^stopped by Ctrl-C.*, in {re.escape(stage)}.*; in {tmp_path}, .*{told}; run it again to go on"
    with pytest.raises(Interrupted, match=message):
        perform(pair(**SEVERAL), out=tmp_path, plot=False, say=note_or_stop)
    monkeypatch.undo()
    assert len(list(tmp_path.glob("part-*.h5"))) == parts
    said = []
    again = perform(pair(**SEVERAL), out=tmp_path, plot=False, say=said.append)
    assert again.ok
    assert any(line.startswith("Gauss(stages=4): 2 bodies, complete in") for line in said)
    assert sum("taken over" in line for line in said) == parts
    assert not list(tmp_path.glob("part-*"))
    whole = perform(pair(**SEVERAL), out=tmp_path / "whole", plot=False)
    for label, run in whole.runs.items():
        assert again.runs[label].q.value.tobytes() == run.q.value.tobytes()
    for one, other in zip(again.report.rows, whole.report.rows, strict=True):
        assert one.positions == other.positions


def test_each_stage_is_told_before_it_begins_and_what_is_left_of_it_is_measured(tmp_path):
    said = []
    heartbeat = orbits.Heartbeat(every="1 h", first=1e-9, to=said.append)
    perform(pair(**SEVERAL, dt=0.0625), out=tmp_path, plot=False, say=said.append, heartbeat=heartbeat)
    stages = [
        f"2 bodies, over 2, by {len(SEVERAL['integrators'])} methods; then comparison with leapfrog, ias15",
        *(f"{method.label}: 2 bodies, 32 steps of 0.0625" for method in SEVERAL["integrators"]),
        "comparing with leapfrog, ias15", "reference, exact: 2 bodies, 5 samples",
        "REBOUND leapfrog: 2 bodies, 32 steps", "REBOUND ias15: 2 bodies, steps of its own",
    ]  # fmt: skip
    assert [line for line in said if line in stages] == stages
    assert " left" in said[said.index(stages[-1]) + 1]


def test_warnings_of_controls_are_one_sentence_at_the_end(tmp_path):
    said = []
    methods = [orbits.Gauss(stages=4), RungeKutta4(), ExplicitEuler()]
    perform(pair(integrators=methods, dt=1.0, duration=20.0), out=tmp_path, plot=False, say=said.append)
    (told,) = [line for line in said if line.startswith("mind: ")]
    assert told == said[-1]
    assert re.fullmatch(r"mind: [2-4] warnings of steps that are too long for the controls RungeKutta4\(\), "
                        r"ExplicitEuler\(\), as was to be expected\.", told)  # fmt: skip
    alone = []
    perform(pair(integrators=[RungeKutta4()], dt=1.0), out=tmp_path / "alone", plot=False, say=alone.append)
    assert any(line.startswith("mind: dt = 1 is too long for RungeKutta4()") for line in alone)


@pytest.mark.parametrize("name", ["run.h5", "report.json", "run.png"])
def test_a_file_of_somebody_else_is_never_replaced(tmp_path, name):
    (tmp_path / name).write_text("my notes")
    try:
        outcome = perform(pair(), out=tmp_path)
    except InputError as error:
        message = str(error)
    else:
        message = " ".join(outcome.failures)
    assert f"{name} is there already and was not written by orbits" in message
    assert (tmp_path / name).read_text() == "my notes"


def test_the_results_folder_may_not_be_a_file(tmp_path):
    (tmp_path / "here").write_text("")
    with pytest.raises(InputError, match="results need a folder"):
        perform(pair(), out=tmp_path / "here")


def test_a_tolerance_that_is_exceeded_is_a_failure_with_its_numbers(tmp_path):
    scenario = pair(against=("leapfrog",), tolerances={"position": 1e-30})
    outcome = perform(scenario, out=tmp_path, plot=False)
    assert not outcome.ok
    assert "exceeds" in outcome.failures[0]
    assert not json.loads((tmp_path / "report.json").read_text())["ok"]


def test_tolerances_of_methods_that_are_not_run_are_left_out_by_name_and_label():
    own = {"StormerVerlet()": {"energy": 1e-3}, "Gauss": {"energy": 1e-9}, "gauss(stages=4)": {"energy": 1e-9}}
    scenario = pair(tolerances={"position": 1.0, **own, "Gaus": {"energy": 1.0}})
    assert scenario.demands().keys() == {"position", "Gauss", "gauss(stages=4)", "Gaus"}
    assert scenario.with_changes(integrators=[orbits.StormerVerlet()]).demands().keys() == {
        "position", "StormerVerlet()", "Gaus",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"against": ["whfsat"]}, "no peer is called 'whfsat'"),
        ({"tolerances": {"position": {"plant": 1.0}}}, "no key 'plant'"),
        ({"against": ["ias15"], "system": orbits.System.solar_system(model="relativistic")}, "Newton's gravity alone"),
    ],
)
def test_what_cannot_be_compared_is_refused_before_the_runs(changes, said, tmp_path):
    with pytest.raises(InputError, match=said):
        perform(pair(**changes), out=tmp_path)
    assert not list(tmp_path.iterdir())


def test_tolerances_are_judged_also_without_peers(tmp_path):
    outcome = perform(pair(tolerances={"position": 1e-30}), out=tmp_path, plot=False)
    assert not outcome.ok


def test_a_method_that_fails_is_reported_and_the_others_are_judged(tmp_path, recwarn):
    scenario = pair(integrators=[orbits.Gauss(stages=8), orbits.StormerVerlet()], dt=8.0, duration=100.0)
    said = []
    outcome = perform(scenario, out=tmp_path, plot=False, say=said.append)
    assert not outcome.ok
    assert "did not converge" in outcome.failures[0]
    assert outcome.runs["StormerVerlet()"].complete
    assert any(text.startswith("mind: dt = 8 is too long for Gauss(stages=8)") for text in said)
    again = perform(scenario, out=tmp_path, plot=False, say=said.append)
    assert again.failures == outcome.failures
    assert (tmp_path / "report.json").exists()
    assert not [warning for warning in recwarn if warning.category is StepWarning]


@pytest.mark.parametrize(
    "wrong",
    [{"draw": lambda outcome: 3}, {"checks": lambda outcome: ["fine"]}, {"checks": lambda outcome: None}],
)
def test_pictures_and_checks_of_another_kind_are_refused_in_words(tmp_path, wrong):
    try:
        message = " ".join(perform(pair(**wrong), out=tmp_path).failures)
    except InputError as error:
        message = str(error)
    assert "expected a matplotlib Figure" in message or "must yield orbits.scenarios.Check" in message


def test_what_is_not_conserved_is_null_in_the_report_and_not_a_word_that_json_does_not_have(tmp_path):
    driven = orbits.System.in_ephemeris(epoch="2013-01-30").add("rock", primary="Sun", a=1.5 * u.au, e=0.1)
    perform(pair(system=driven, integrators=[orbits.Gauss(stages=8)], dt=None), out=tmp_path, plot=False)

    def refused(word):
        pytest.fail(f"{word} is no JSON")

    report = json.loads((tmp_path / "report.json").read_text(), parse_constant=refused)
    (run,) = report["cases"][""]["runs"].values()
    assert run["largest_relative_change"]["centre_of_mass"] is None


@pytest.mark.parametrize("name", ["planets/Mars", "../outside"])
def test_a_figure_whose_name_leads_to_another_folder_is_a_failure(tmp_path, name):
    from matplotlib.figure import Figure

    folder = tmp_path / "results"
    outcome = perform(pair(draw=lambda outcome: {name: Figure()}), out=folder)
    assert outcome.failures == (f"draw called a figure {name!r}; expected a name without a folder: it names a file.",)
    assert (folder / "report.json").exists()
    assert list(tmp_path.iterdir()) == [folder]


def test_a_method_that_is_given_twice_is_refused():
    """Its second run took the place of the first, under another name of its file."""
    with pytest.raises(InputError, match=r"StormerVerlet\(\) is among the integrators twice; give each method once"):
        pair(integrators=["stormer-verlet", orbits.StormerVerlet()])


def test_a_single_check_need_not_be_in_a_list(tmp_path):
    outcome = perform(pair(checks=lambda outcome: Check("pigs fly", False, "0 of 3")), out=tmp_path, plot=False)
    assert outcome.failures == ("pigs fly: 0 of 3",)


def test_a_check_that_does_not_hold_is_a_failure(tmp_path):
    outcome = perform(
        pair(checks=lambda outcome: [Check("pigs fly", np.bool_(False), "0 of 3")]), out=tmp_path, plot=False
    )
    assert outcome.failures == ("pigs fly: 0 of 3",)


def test_the_plan_of_cases_of_several_sizes_does_not_give_all_the_largest(tmp_path):
    one, said = pair().system, []
    cases = {"one": one, "two": one.add("grain", primary="star", a=2.0)}
    perform(pair(system=cases, duration=0.1), out=tmp_path, plot=False, say=said.append)
    assert said[0].startswith("2 cases of up to 3 bodies, over 0.1")


@each(
    ("given", "message"),
    [
        (("a < b", "0.5"), r"ok of Check\('a < b', \.\.\.\) is '0.5'; expected True or False"),
        (("a < b", np.nan), "is nan; expected True or False"),
        (("a < b", np.array([True, False])), r"is array\(\[ True, False\]\); expected True or False"),
        ((True, "a < b"), r"the claim of a Check is True; expected a text: Check\(claim, ok, \.\.\.\)"),
    ],
)
def test_a_check_holds_if_it_is_true_and_not_if_it_is_anything_else(given, message):
    with pytest.raises(InputError, match=message):
        Check(*given)


def test_the_folder_of_results_may_be_a_text(tmp_path):
    assert perform(pair(), out=str(tmp_path / "here"), plot=False).folder == tmp_path / "here"


def test_the_name_of_a_scenario_is_no_scenario():
    with pytest.raises(InputError, match=r"got 'kepler'; expected a scenario, such as orbits\.scenario\.load"):
        perform("kepler")


def test_what_a_check_measured_may_have_a_unit(tmp_path):
    outcome = perform(pair(checks=lambda outcome: Check("it is near", True, 3 * u.km)), out=tmp_path, plot=False)
    assert json.loads((tmp_path / "report.json").read_text())["checks"][0]["measured"] == "3.0 km"
    assert outcome.ok


def test_a_function_that_takes_other_arguments_is_not_said_to_be_a_line_of_this_package(tmp_path):
    with pytest.raises(InputError, match=r"^in a function of the scenario: TypeError: .* takes 0 positional arguments"):
        perform(pair(checks=lambda: ["none"]), out=tmp_path, plot=False)


def test_an_error_in_the_scenarios_own_code_names_file_and_line(tmp_path):
    def draw(outcome):
        raise ZeroDivisionError("nothing to draw")

    outcome = perform(pair(draw=draw), out=tmp_path)
    (failure,) = outcome.failures
    assert "ZeroDivisionError: nothing to draw" in failure
    assert "test_scenarios.py, line" in failure


def test_a_figure_is_not_replaced_by_the_picture_of_the_comparison(tmp_path):
    from matplotlib.figure import Figure

    drawn = {"comparison": Figure(figsize=(2, 1), dpi=50)}
    outcome = perform(pair(draw=lambda outcome: drawn, tolerances={"energy": 1.0}, duration=0.1), out=tmp_path)
    (failure,) = outcome.failures
    assert failure.startswith("a figure is called 'comparison', as the picture of the comparison is")
    assert struct.unpack(">II", (tmp_path / "comparison.png").read_bytes()[16:24]) == (100, 50)


WRONG = [
    ({"name": ""}, "name"),
    ({"name": "../x"}, "name"),
    ({"title": "two\nlines"}, "title"),
    ({"integrators": []}, "integrators"),
    ({"integrators": ["gaus"]}, "did you mean gauss"),
    ({"integrators": [orbits.Gauss]}, "integrators"),
    ({"samples": 1}, "samples"),
    ({"samples": 2.5}, "samples"),
    ({"against": "whfast"}, "against"),
    ({"draw": 3}, "draw"),
    ({"checks": []}, "checks"),
]


@each(("wrong", "message"), WRONG)
def test_a_scenario_that_cannot_be_is_refused_where_it_is_made(wrong, message):
    with pytest.raises(InputError, match=message):
        pair(**wrong)


def test_a_system_that_is_none_is_refused_when_it_is_made(tmp_path):
    with pytest.raises(InputError, match="must give a System"):
        perform(pair(system=lambda: 42), out=tmp_path)


FILES = [
    ("def f(:\n", r"x\.py, line 1"),
    ("import nowhere_to_be_found\n", r"x\.py, line 1: ModuleNotFoundError"),
    ("a = 1\nb = a / 0\n", r"x\.py, line 2: ZeroDivisionError"),
    ("a = 1\n", "defines none"),
    ("scenario = 3\n", "type int"),
    ("raise SystemExit(3)\n", r"x\.py, line 1: SystemExit"),
]


@pytest.mark.parametrize(("text", "message"), FILES)
def test_a_file_that_is_no_scenario_is_refused_with_file_and_line(tmp_path, text, message):
    path = tmp_path / "x.py"
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        load(str(path))


def test_a_scenario_file_with_null_bytes_is_refused_without_a_line(tmp_path):
    path = tmp_path / "x.py"
    path.write_bytes(b"scenario = 1\n\0")
    with pytest.raises(InputError, match=r"x\.py.*null bytes") as error:
        load(str(path))
    assert "None" not in str(error.value)


def test_unknown_scenarios_are_refused_with_the_names_that_come_close(tmp_path):
    with pytest.raises(UnknownNameError, match="Did you mean 'kepler'"):
        load("keppler")
    with pytest.raises(InputError, match="does not exist"):
        load(str(tmp_path / "none.py"))
    with pytest.raises(InputError, match="is a folder"):
        load(str(tmp_path) + "/.")


def test_a_scenario_of_the_docs_length_is_found_by_its_path(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(
        textwrap.dedent("""
        import orbits
        scenario = orbits.scenarios.Scenario(
            name="mine", title="Mine", integrators=[orbits.StormerVerlet()], dt=0.1, duration=1, against=(),
            system=lambda: orbits.System.from_elements({"s": {"gm": 1}, "p": {"a": 1}}, units=orbits.DIMENSIONLESS))
        """)
    )
    outcome = perform(load(str(path)), out=tmp_path / "out")
    assert outcome.ok
    assert set(outcome.files) == {tmp_path / "out" / name for name in ("run.h5", "run.png", "report.json")}


@pytest.mark.parametrize(
    ("text", "expected"), [("6 d", 6 * u.day), ("1000 yr", 1000 * u.yr), ("-2", -2.0), ("1e3", 1000.0), ("inf", np.inf)]
)
def test_times_are_read_as_people_type_them(text, expected):
    assert quantity(text, "--dt") == expected


@pytest.mark.parametrize("text", ["", "six days", "6 bananas", "6 d d d(", "--", "1,5"])
def test_times_that_cannot_be_read_are_refused_with_the_option(text):
    with pytest.raises(InputError, match="--dt = "):
        quantity(text, "--dt")


@pytest.mark.parametrize("text", ["adaptive", " Adaptive ", "adaptive()", "Adaptive(tolerance=None)"])
def test_adaptive_steps_are_typed_as_a_word(text):
    assert step_or_clock(text, "--dt") == orbits.Adaptive()


def test_a_tolerance_is_typed_as_a_methods_stages_are():
    assert step_or_clock("adaptive(tolerance=1e-8)", "--dt") == orbits.Adaptive(tolerance=1e-8)
    assert step_or_clock("adaptive(1e-8)", "--dt") == orbits.Adaptive(tolerance=1e-8)
    assert step_or_clock("adaptive:1e-8", "--dt") == orbits.Adaptive(tolerance=1e-8)
    assert step_or_clock("6 d", "--dt") == 6 * u.day
    assert step_or_clock("P/20", "--dt") == "P/20"
    with pytest.raises(InputError, match=r"--dt = 'p/20'; expected .*; or a fraction of the shortest period, P/20; or"):
        step_or_clock("p/20", "--dt")


@pytest.mark.parametrize("text", ["transformed:0.2", "Transformed : 0.2", "transformed(step=0.2)", "transformed(0.2)"])
def test_steps_of_transformed_time_are_typed_as_a_word(text):
    assert step_or_clock(text, "--dt") == orbits.TimeTransformed(step=0.2)
    assert step_or_clock("transformed", "--dt") == orbits.TimeTransformed()


@each(
    ("text", "message"),
    [
        ("adaptive(", "write adaptive, adaptive:1e-8 or"),
        ("adaptively", "write adaptive, adaptive:1e-8 or"),
        ("adaptive(tolerence=1e-8)", "write adaptive, adaptive:1e-8 or"),
        ("adaptive(tolerance=__import__('os'))", "write adaptive, adaptive:1e-8 or"),
        ("adaptive(1, 2)", "write adaptive, adaptive:1e-8 or"),
        ("adaptive(tolerance=1)", "tolerance is 1; expected 1e-12 ... 0.001"),
        ("adaptive(tolerance='x')", "expected a number such as 1e-9"),
        ("adaptive:", "write adaptive, adaptive:1e-8 or"),
        ("adaptive:1e-30", "tolerance is 1e-30; expected 1e-12"),
        ("transformed:6 d", "write transformed, transformed:0.3 or"),
        ("transformed:3", "step is 3.0; expected a positive number up to 2"),
        ("transformed(tolerance=1e-8)", "write transformed, transformed:0.3 or"),
    ],
)
def test_adaptive_steps_that_cannot_be_read_are_refused_in_words(text, message):
    with pytest.raises(InputError, match=message):
        step_or_clock(text, "--dt")


@given(st.text(max_size=30).map("adaptive".__add__) | st.text(max_size=30))
def test_whatever_is_typed_as_a_step_is_read_or_refused(text):
    with contextlib.suppress(InputError):
        step = step_or_clock(text, "--dt")
        assert isinstance(step, float | str | u.Quantity | ChangingSteps)


@given(st.text(max_size=30))
def test_whatever_is_typed_as_a_time_is_read_or_refused(text):
    with contextlib.suppress(InputError):
        assert isinstance(quantity(text, "--dt"), float | u.Quantity)


@given(st.text(max_size=40))
def test_whatever_is_typed_as_an_integrator_is_read_or_refused(text):
    with contextlib.suppress(OrbitsError):
        assert integrators.parse(text).label


@given(
    st.dictionaries(
        st.sampled_from(["stages", "order", "x"]), st.one_of(st.integers(), st.text(), st.none(), st.floats())
    )
)
def test_whatever_an_archive_says_of_an_integrator_is_built_or_refused(parameters):
    with contextlib.suppress(OrbitsError):
        built = integrators.build({"name": "gauss", "parameters": parameters})
        assert built == orbits.Gauss(**parameters)


def test_pictures_of_an_earlier_run_do_not_stay_beside_the_report_of_another(tmp_path):
    from matplotlib.figure import Figure

    perform(pair(draw=lambda outcome: {"first": Figure(), "both": Figure()}), out=tmp_path)
    own = tmp_path / "mine.png"
    own.write_bytes((tmp_path / "first.png").read_bytes())  # in no report, though written by the package
    perform(pair(draw=lambda outcome: {"second": Figure(), "both": Figure()}), out=tmp_path)
    assert {path.name for path in tmp_path.glob("*.png")} == {"second.png", "both.png", "mine.png"}
    perform(pair(), out=tmp_path, plot=False)
    assert [path.name for path in tmp_path.glob("*.png")] == ["mine.png"]
