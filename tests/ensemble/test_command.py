"""`orbits ensemble`: a file with a plan, a scenario, a folder."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time

import pytest
from typer.testing import CliRunner

from orbits import ensemble
from orbits.cli import app

PLAN = """
import numpy as np
import orbits
from orbits import ensemble

planets = orbits.System.solar_system(epoch="2022-08-09", bodies=["Sun", "Jupiter", "Saturn"])
grid = ensemble.grid(planets, primary="Sun", a=np.linspace(2.2, 3.2, 8), e=np.linspace(0.0, 0.2, 8))
plan = ensemble.Plan(grid, duration="{duration}", dt="30 d", integrator="wisdom-holman", block=16)
"""


def orbits_(*arguments):
    return CliRunner().invoke(app, [str(one) for one in arguments])


def test_a_file_with_a_plan_runs_and_its_folder_can_be_looked_at(tmp_path):
    (tmp_path / "belt.py").write_text(PLAN.format(duration="20 yr"))
    done = orbits_("ensemble", tmp_path / "belt.py", "--out", tmp_path / "c", "--workers", 1)
    assert done.exit_code == 0, done.output
    assert "4 of 4 blocks done: 64 of 64 members" in done.stdout
    assert "largest eccentricity: least" in done.stdout
    looked = orbits_("ensemble", tmp_path / "c", "--json")
    record = json.loads(looked.stdout)
    assert record["members"] == {"survived": 64}
    assert record["bits"] == ensemble.open(tmp_path / "c").bits
    for option in (["--retry"], ["--duration", "40 yr"], ["--no-approaches"], ["--set", "count=3"]):
        refused = orbits_("ensemble", tmp_path / "c", *option)
        assert refused.exit_code == 2
        name = option[0].replace("no-", "")
        assert f"is shown and not run: it takes no {name}" in " ".join(refused.output.split())


def test_options_change_the_plan(tmp_path):
    (tmp_path / "belt.py").write_text(PLAN.format(duration="20 yr"))
    options = ["--dt", "20 d", "--duration", "5 yr", "--block", 32, "--table-only", "--samples", 3, "--json"]
    done = orbits_("ensemble", tmp_path / "belt.py", "--out", tmp_path / "c", *options)
    record = json.loads(done.stdout)
    assert record["blocks"]["all"] == 2
    assert "dt = 20 d, 1826.25 d" in record["made_by"]
    assert not list((tmp_path / "c").glob("*.h5"))


def test_a_duration_takes_the_place_of_the_end_of_a_plan_and_has_its_direction(tmp_path):
    (tmp_path / "belt.py").write_text(PLAN.replace("duration=", "until=").format(duration="2032-08-09"))
    options = ["--duration", "-1 yr", "--table-only", "--json"]
    done = orbits_("ensemble", tmp_path / "belt.py", "--out", tmp_path / "c", *options)
    assert done.exit_code == 0, done.output
    assert "dt = 30 d, -365.25 d" in json.loads(done.stdout)["made_by"]


def test_the_particles_of_a_scenario_are_members(tmp_path):
    done = orbits_("ensemble", "asteroid_belt", "--out", tmp_path / "c", "--duration", "30 d", "--samples", 2, "--json")
    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout)["members"] == {"survived": 1250}


def test_what_has_no_members_is_refused(tmp_path):
    (tmp_path / "belt.py").write_text("plan = 3")
    assert "defines neither `plan` nor `scenario`, plan being 3" in _told("ensemble", tmp_path / "belt.py")
    assert "is a study, which has no members" in _told("ensemble", "resonance_map")
    (tmp_path / "plan.py").write_text(PLAN.format(duration="20 yr"))
    assert "block must be a whole number >= 1, got 0" in _told("ensemble", tmp_path / "plan.py", "--block", 0)


def _told(*arguments):
    done = orbits_(*arguments)
    assert done.exit_code == 2
    return " ".join(done.output.split())


@pytest.mark.nightly
def test_ctrl_c_stops_with_a_line_on_how_to_go_on_and_the_same_command_goes_on(tmp_path, monkeypatch):
    (tmp_path / "belt.py").write_text(PLAN.format(duration="6000 yr"))
    command = [sys.executable, "-m", "orbits", "ensemble", "belt.py", "--workers", "1"]
    started = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    index, begun = tmp_path / "belt.campaign" / "index.jsonl", time.monotonic()
    while not index.exists() and time.monotonic() - begun < 120:
        time.sleep(0.01)
    started.send_signal(signal.SIGINT)
    _, told = started.communicate(timeout=120)
    assert started.returncode == 130, told
    assert "stopped by Ctrl-C: " in told
    assert "the same call goes on" in told
    monkeypatch.chdir(tmp_path)
    again = orbits_(*command[3:])
    assert again.exit_code == 0, again.stderr
    assert "of 4 blocks are there already" in again.stderr
    assert ensemble.open(tmp_path / "belt.campaign").complete
    assert os.listdir(tmp_path / "belt.campaign")


def test_members_that_could_not_be_integrated_are_told_and_in_the_exit_code(tmp_path):
    (tmp_path / "failing.py").write_text(
        "import orbits\n"
        "def make(mass):\n"
        "    if mass > 1.5:\n"
        "        raise ValueError('too heavy')\n"
        "    bodies = {'star': {'gm': mass}, 'b': {'a': 1.0, 'gm': 1e-3}}\n"
        "    return orbits.System.from_elements(bodies, units=orbits.DIMENSIONLESS)\n"
        "grid = orbits.ensemble.grid(make, mass=[1.0, 2.0])\n"
        "plan = orbits.ensemble.Plan(grid, integrator='stormer-verlet', dt=0.01, duration=1.0)\n"
    )
    done = orbits_("ensemble", tmp_path / "failing.py", "--out", tmp_path / "c")
    assert done.exit_code == 1, done.output
    assert "1 of 2 members could not be integrated" in done.stderr
    assert "too heavy" in done.stderr
