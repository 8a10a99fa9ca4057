"""`orbits info`: what it says of events, changes, dense output and the end of a run."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from astropy import units as u
from typer.testing import CliRunner

import orbits
from orbits.cli import app
from orbits.events import Collision, FartherThan, Merge, Pericentre

SYSTEM = orbits.System(
    ["star", "ship"], gm=[1.0, 1e-30], q=[[0, 0, 0], [1, 0, 0]], v=[[0, 0, 0], [0, 1.1, 0]], units=orbits.DIMENSIONLESS
)
STOP = Pericentre("ship", "star", then="stop")


def info(path: Path) -> tuple[str, dict[str, Any]]:
    text, record = (CliRunner().invoke(app, ["info", str(path), *more]) for more in ([], ["--json"]))
    assert text.exit_code == record.exit_code == 0
    return text.output, json.loads(record.stdout)


def test_info_says_what_was_sought_and_found_and_why_a_run_stopped(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    sky = orbits.System.solar_system("2026-02-01", bodies=["Sun", "Mercury", "Venus"])
    events = [Pericentre("Mercury"), FartherThan(0.46 * u.au, "Mercury", "Sun", then="stop")]
    orbits.propagate(sky, duration=1 * u.yr, samples=5, events=events, archive=path, dense=True).close()
    text, record = info(path)
    assert "\nstopped: Mercury and Sun: farther than 0.46 AU at t = " in text
    assert "sought: Pericentre(body='Mercury')\n        FartherThan(" in text
    assert "distance='0.46 AU'" in text
    assert "2 events\n" in text
    assert "dense output from " in text
    assert f"not complete: go on with  orbits resume {path}" in text
    assert record["ended"]["how"] == "stopped"
    assert [event["kind"] for event in record["events"]] == ["pericentre", "farther than 0.46 AU"]
    assert record["reached"] == record["events"][-1]["time"]
    assert (record["end"], record["complete"]) == (365.25, False)
    assert record["sought"][1] == {
        "kind": "FartherThan",
        "given": {"body": "Mercury", "distance": "0.46 AU", "other": "Sun"},
        "then": "stop",
    }
    assert record["dense_states"] > 10


def test_info_says_which_bodies_merged_and_when(tmp_path: Path) -> None:
    path, q, v = tmp_path / "run.h5", [[0, 0, 0], [1, 0, 0]], [[0, 0, 0], [0, 0.1, 0]]
    pair = orbits.System(["a", "b"], [1, 1e-3], q, v, radii=[0.05, 0.05], units=orbits.DIMENSIONLESS)
    merge = Collision(then=Merge())
    run = orbits.propagate(pair, duration=3.0, events=merge, archive=path)
    when = float(run.events.time.value[0])
    run.close()
    text, record = info(path)
    assert "2 legs, with other bodies, masses or radii\n" in text
    assert f"b gone, a of another mass  {when:.10g}" in text
    assert "sought: Collision(), then Merge()\n1 event\n" in text
    assert [leg["names"] for leg in record["legs"]] == [["a", "b"], ["a"]]
    assert record["legs"][1]["time"] == when
    assert "not complete" not in text


def test_info_tells_how_to_go_on_with_functions(tmp_path: Path) -> None:
    def fails(t: Any, system: orbits.System) -> None:
        raise RuntimeError("no fuel")

    path = tmp_path / "run.h5"
    with pytest.raises(RuntimeError):
        orbits.propagate(SYSTEM, duration=20.0, events=Pericentre("ship", then=fails), archive=path)
    text, record = info(path)
    assert "\nfailed after t = " in text
    assert ": RuntimeError: no fuel\n" in text
    assert "sought: Pericentre(body='ship'), then test_info_tells_how" not in text
    assert "sought: Pericentre(body='ship'), then fails\nno events; never: pericentre\n" in text
    assert f"orbits.resume('{path}', events=[...]), in Python" in text
    assert record["ended"] == {"how": "failed", "why": "RuntimeError: no fuel"}


def test_info_of_a_run_that_came_to_its_end_has_no_more_than_before(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    orbits.propagate(SYSTEM, duration=20.0, archive=path, samples=[1.0]).close()
    text, record = info(path)
    assert "Trajectory(2 bodies, 1 sample, t = 1 of a run to 20;" in text
    for word in ("stopped", "failed", "sought", "events", "legs", "dense", "not complete"):
        assert word not in text
    assert (record["ended"], record["events"], record["sought"], record["dense_states"]) == (None, [], [], None)
