"""`orbits run`, `resume` and `info` of long runs: limits of the wall time, heartbeats, files that are being written."""

from __future__ import annotations

import json
import re
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from astropy import units as u
from typer.testing import CliRunner

import orbits
from orbits.cli import app
from orbits.propagation.control import wall_clock

from ..coverings import first

SCENARIO = """
import orbits
system = orbits.System.from_elements({"sun": {"gm": 1.0}, "earth": {"gm": 3e-6, "a": 1.0, "e": 0.1}},
                                     units=orbits.DIMENSIONLESS)
scenario = orbits.scenarios.Scenario(name="long", title="A long run", system=system, integrators=[
    orbits.StormerVerlet(), orbits.methods.SymplecticEuler()], dt=0.02, duration=1000.0, samples=11)
"""


def orbits_(*words: object) -> Any:
    return CliRunner().invoke(app, [str(word) for word in words])


@pytest.fixture
def looks(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """A limit that is over after a number of looks, whatever the speed of the machine."""
    left = [10**9]

    def over(deadline: wall_clock.Deadline) -> bool:
        left[0] -= 1
        return left[0] < 0

    monkeypatch.setattr(wall_clock.Deadline, "over", property(over))
    return left


def test_a_scenario_stops_with_75_when_its_wall_time_is_over_and_the_same_command_goes_on(
    tmp_path: Path, looks: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("long.py").write_text(SCENARIO)
    command = ["run", "long.py", "--out", "whole", "--no-plot"]
    assert orbits_(*command).exit_code == 0
    looks[0] = 2
    stopped = orbits_(*command[:-2], "part", "--no-plot", "--wall-time", "2 h")
    assert stopped.exit_code == 75
    assert "stopped: the wall time of 2 h is over at t = " in stopped.output
    assert "in StormerVerlet(): 2 bodies; the same command goes on with it." in " ".join(stopped.output.split())
    assert "error" not in stopped.output
    looks[0] = 10**9
    again = orbits_(*command[:-2], "part", "--no-plot", "--wall-time", "2 h")
    assert again.exit_code == 0
    assert "going on with the unfinished run" in again.output
    runs = [orbits.Trajectory.open(Path(folder) / "run.h5") for folder in ("whole", "part")]
    assert np.array_equal(runs[0].q, runs[1].q)


def test_resume_stops_with_75_as_well_and_says_how_to_go_on(tmp_path: Path, looks: list[int]) -> None:
    path, system = tmp_path / "run.h5", orbits.System.solar_system("2026-01-01", bodies=["Sun", "Jupiter"])
    looks[0] = 1
    orbits.propagate(system, "stormer-verlet", dt=40, duration="5e4 yr", samples=5, archive=path, wall_time=60).close()
    told = orbits_("info", path).output
    assert "stopped: the wall time of 1 min is over at t = " in told
    assert f"not complete: go on with  orbits resume {path}" in told
    looks[0] = 1
    again = orbits_("resume", path, "--wall-time", "01:00:00", "--heartbeat", "never")
    assert again.exit_code == 75
    assert f"stopped: the wall time of 1 h is over; go on with: orbits resume {path}" in again.output.replace("\n", "")
    looks[0] = 10**9
    last = orbits_("resume", path, "--wall-time", 3600, "--heartbeat", 1e-9)
    assert last.exit_code == 0
    assert re.search(r"100\.0%, t = 50 of 50 kyr, .* steps/s, after .*, dE/E .*, 5 of 5 samples in run.h5", last.output)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--wall-time", "soon"], "--wall-time"),
        (["--wall-time", "0"], "--wall-time is 0.0; expected a finite number above 0"),
        (["--heartbeat", "-3 s"], "--heartbeat"),
    ],
)
def test_what_is_no_time_is_refused_before_anything_is_done(words: list[str], said: str, tmp_path: Path) -> None:
    done = orbits_("run", "kepler", "--out", tmp_path / "out", *words)
    assert done.exit_code == 2
    assert said in done.output


def test_a_study_has_no_wall_time() -> None:
    done = orbits_("run", "work_precision", "--wall-time", "1 h")
    assert done.exit_code == 2
    assert "is a study, which makes its runs by itself: it takes no --wall-time." in " ".join(done.output.split())


def test_info_tells_of_a_file_that_is_being_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, seen = tmp_path / "run.h5", []
    monkeypatch.setattr("orbits.propagation.resuming.sample_store.CHUNK_BYTES", 1)  # commit each sample
    system = orbits.System.solar_system("2026-01-01", bodies=["Sun", "Jupiter"])

    def look(t: u.Quantity, state: orbits.System) -> None:
        if t.to_value("yr") > 24_000:
            time.sleep(0.01)
            seen.append((orbits_("info", path).output, json.loads(orbits_("info", path, "--json").stdout)["running"]))

    run = orbits.propagate(
        system, "stormer-verlet", dt=40, duration="5e4 yr", samples=5, archive=path, callback=look
    )
    text, record = seen[0]
    assert re.search(
        r"being written by process \d+: 25.0%, t = 12.5 of 50 kyr at the last commit, [\d.]+ m?s ago; [\d,.e+]+ kyr an "
        r"hour; done in about .*, at \d{4}-\d\d-\d\d \d\d:\d\d", text
    ), text  # fmt: skip
    assert "go on with" not in text
    assert record["fraction"] == pytest.approx(0.25, abs=0.001)
    assert record["left_s"] >= 0.0
    assert run.complete
    assert json.loads(orbits_("info", path, "--json").stdout)["running"] is None


@pytest.mark.parametrize(
    ("words", "name"),
    first(
        1,
        [
            (["--kind", "elements", "--elements", "a,pomega", "--body", "p", "--primary", "Sun"], "run-elements.png"),
            (["--kind", "resonance", "--resonance", "3:1", "--planet", "Jupiter"], "run-resonance.png"),
            (["--kind", "energy"], "run-energy.png"),
            ([], "run.png"),
        ],
    ),
)
def test_plot_draws_each_kind_beside_the_file(words: list[str], name: str, tmp_path: Path) -> None:
    giants = orbits.System.solar_system("2026-01-01", bodies=["Sun", "Jupiter", "Saturn"])
    rock = giants.add(["p"], primary="Sun", a=[2.5] * u.au, e=[0.3])
    orbits.propagate(rock, "wisdom-holman", dt=20, duration="100 yr", archive=tmp_path / "run.h5").close()
    done = orbits_("plot", tmp_path / "run.h5", *words)
    assert done.exit_code == 0, done.output
    assert (tmp_path / name).stat().st_size > 10_000


def test_plot_says_which_kinds_there_are(tmp_path: Path) -> None:
    system = orbits.System.solar_system("2026-01-01", bodies=["Sun", "Jupiter"])
    orbits.propagate(system, "stormer-verlet", dt=20, duration="1 yr", archive=tmp_path / "run.h5").close()
    done = orbits_("plot", tmp_path / "run.h5", "--kind", "pie")
    assert done.exit_code == 2
    said = " ".join(done.output.split())
    assert "expected one of 'paths', 'elements', 'phase', 'resonance', 'error', 'energy'" in said


@pytest.mark.nightly
def test_plot_draws_how_a_rigid_body_turns(tmp_path: Path) -> None:
    system = orbits.System.solar_system("2026-01-01", bodies=["Sun", "Jupiter"])
    jupiter = orbits.RigidBody(A=0.25, B=0.25, C=0.26, radius=71492 * u.km, spin=10 * u.rad / u.day)
    turning = system.with_rigid("Jupiter", jupiter)
    orbits.propagate(turning, dt="0.5 h", duration="1 d", archive=tmp_path / "run.h5").close()
    done = orbits_("plot", tmp_path / "run.h5", "--kind", "rotation", "--body", "Jupiter", "--primary", "Sun")
    assert done.exit_code == 0, done.output
    assert (tmp_path / "run-rotation.png").stat().st_size > 10_000
    done = orbits_("plot", tmp_path / "run.h5", "--kind", "rotation", "--body", "Jupiter", "--body", "Sun")
    assert done.exit_code == 2
    assert "is that of one body" in done.output
