"""Long runs: lines on their way, limits of the wall time, memory, and what is seen of them while they are written."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from astropy import units as u

import orbits
from orbits.errors import InputError
from orbits.propagation.control import heartbeat, wall_clock
from orbits.propagation.control.wall_clock import seconds_of, wall_time_text

from ..coverings import only

GIANTS = ("Sun", "Jupiter", "Saturn", "Uranus", "Neptune")


@pytest.fixture(scope="module")
def giants() -> orbits.System:
    return orbits.System.solar_system("2026-01-01", bodies=list(GIANTS))


@pytest.fixture(scope="module")
def belt(giants: orbits.System) -> orbits.System:
    return giants.add(["p", "q", "r"], primary="Sun", a=[2.2, 2.7, 3.1] * u.au, e=[0.1, 0.2, 0.0])


def lines_of(system: orbits.System, *given: Any, **options: Any) -> tuple[list[str], orbits.Trajectory]:
    lines: list[str] = []
    return lines, orbits.propagate(system, *given, heartbeat=orbits.Heartbeat(1e-9, to=lines.append), **options)


@pytest.fixture
def looks(monkeypatch: pytest.MonkeyPatch) -> Any:
    """A limit that is over after a number of looks, whatever the speed of the machine."""
    left = [0]

    def over(deadline: wall_clock.Deadline) -> bool:
        left[0] -= 1
        return left[0] < 0

    monkeypatch.setattr(wall_clock.Deadline, "over", property(over))
    return left


def test_a_heartbeat_tells_time_rate_rest_drift_and_samples(belt: orbits.System, tmp_path: Path) -> None:
    lines, run = lines_of(
        belt, "wisdom-holman", dt="50 d", duration="1000 yr", samples=11, archive=tmp_path / "run.h5"
    )
    drift = run.drift()
    assert len(lines) > 4
    for line in lines[1:-1]:
        assert re.fullmatch(
            r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d  \d+\.\d%, t = [\d.,]+ of 1,000 yr, [\d,]+ steps/s, (.+ left, )?dE/E \S+, "
            r"dL/L \S+, 3 of 3 particles, \d+ of 11 samples in run.h5, [\d.]+ kB", line
        ), line  # fmt: skip
    shares = [float(line.split("  ")[1].split("%")[0]) for line in lines]
    assert shares == sorted(shares)
    assert shares[-1] == 100.0
    assert "11 of 11 samples" in lines[-1]
    assert ", after " in lines[-1]
    # The energy of the last line is that of the last whole step, 9.75 d before the end; it oscillates within that.
    assert float(re.findall(r"dE/E (\S+),", lines[-1])[0]) < 3 * drift.energy.max_fraction


def test_the_drift_of_a_heartbeat_is_that_of_the_samples(giants: orbits.System) -> None:
    lines, run = lines_of(giants, "stormer-verlet", dt="64 d", duration=64 * 1000 * u.day, samples=3)
    drift = run.drift()
    assert f"dE/E {drift.energy.last_fraction:.1e}, dL/L {drift.angular_momentum.last_fraction:.1e}" in lines[-1]


def test_a_heartbeat_has_no_energy_where_none_is_kept_and_counts_bodies_that_merge() -> None:
    bodies = {
        "star": {"gm": 1.0, "radius": 0.05},
        "a": {"a": 1.0, "e": 0.1, "gm": 1e-6, "radius": 0.05},
        "b": {"a": 1.1, "e": 0.1, "gm": 2e-6, "radius": 0.05, "l": 1.0, "pomega": 3.0},
    }
    system = orbits.System.from_elements(bodies, units=orbits.DIMENSIONLESS)
    lines, _ = lines_of(system, duration=20.0, events=orbits.events.Collision(then=orbits.events.Merge()))
    assert "3 of 3 massive bodies" in lines[0]
    assert lines[-1].endswith("2 of 3 massive bodies")
    assert float(re.findall(r"dE/E (\S+),", lines[-1])[0]) < 1e-12  # what the merger took is not an error


def test_a_heartbeat_on_standard_error_takes_the_place_of_the_bar(giants, capsys) -> None:
    orbits.propagate(giants, "stormer-verlet", dt="64 d", duration="5000 yr", samples=3, heartbeat=1e-9)
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "100.0%, t = 5,000 of 5,000 yr" in captured.err


def test_a_list_of_systems_has_one_line_for_all(giants: orbits.System) -> None:
    lines: list[str] = []
    orbits.propagate(
        [giants] * 3, "stormer-verlet", dt="64 d", duration="3000 yr", samples=3,
        heartbeat=orbits.Heartbeat(1e-9, to=lines.append),
    )  # fmt: skip
    assert lines[-1].endswith("3 of 3 systems done")


@pytest.mark.parametrize("bad", [0, -1.0, "soon", "25:61:00", 3 * u.m, float("nan"), [1]])
def test_what_is_no_wall_time_is_refused_by_name(giants: orbits.System, bad: Any) -> None:
    for name in ("heartbeat", "wall_time"):
        with pytest.raises(orbits.errors.InputError, match=name):
            orbits.propagate(giants, duration="1 yr", **{name: bad})


def test_wall_times_are_read_as_batch_systems_write_them_and_written_in_words() -> None:
    given = {"2 h": 7200, "12:00:00": 43200, "2-01:00:05": 176405, 90: 90, 1.5 * u.min: 90, "0.5 d": 43200}
    assert {key: seconds_of(key, "x") for key in given} == given
    words = {0.25: "0.25 s", 45: "45 s", 90: "1 min 30 s", 7800: "2 h 10 min", 7200: "2 h", 1e6: "11 d 13 h"}
    assert {key: wall_time_text(key) for key in words} == words


CASES = {
    "wisdom-holman": {"integrator": "wisdom-holman", "dt": "50 d"},
    "chosen steps": {"integrator": "gauss"},
    "gauss": {"integrator": "gauss(stages=4)", "dt": "100 d", "dense": True},
}


@pytest.mark.parametrize("limit", [{"wall_time": 1e-9}, {"stop": orbits.events.WallTimeOver(1e-9)}])
def test_a_run_whose_first_block_leads_to_its_end_is_not_ended_by_its_wall_time(limit, giants: orbits.System) -> None:
    run = orbits.propagate(giants, "wisdom-holman", dt="50 d", duration="1000 d", samples=5, **limit)
    assert run.complete
    assert run.stopped is None


@pytest.mark.parametrize("name", only(("wisdom-holman", "chosen steps"), CASES))
def test_a_run_that_its_wall_time_ends_again_and_again_gets_the_bits_of_one_that_was_never_ended(
    name: str, belt: orbits.System, tmp_path: Path, looks: list[int]
) -> None:
    options = {"duration": "1000 yr", "samples": 9, **CASES[name]}
    looks[0] = 10**9
    straight = orbits.propagate(belt, archive=tmp_path / "straight.h5", **options)
    looks[0], path = 2, tmp_path / "run.h5"
    run = orbits.propagate(belt, archive=path, wall_time="2 h", **options)
    assert not run.complete
    assert run.stopped.condition == orbits.events.WallTimeOver(7200.0)
    assert run.stopped.reason.startswith("the wall time of 2 h is over at t = ")
    looks[0] = 1
    part = orbits.resume(path, wall_time=60)
    assert not part.complete
    assert part._reached > run._reached
    part.close()
    again = orbits.resume(path, wall_time=1e6) if looks.__setitem__(0, 10**9) is None else None
    assert again.complete
    assert np.array_equal(again.q, straight.q)
    assert np.array_equal(again.v, straight.v)
    assert again.stopped is None
    if again._kept is not None:
        assert np.array_equal(again._kept.times, straight._kept.times)


def test_the_systems_of_a_list_keep_one_limit(giants: orbits.System, looks: list[int]) -> None:
    looks[0] = 3
    runs = orbits.propagate([giants] * 6, "wisdom-holman", dt="100 d", duration="1e5 yr", wall_time=60)
    assert not any(run.complete for run in runs)
    assert all(isinstance(run.stopped.condition, orbits.events.WallTimeOver) for run in runs)


def test_error_bars_are_refused_beside_a_limit(giants: orbits.System) -> None:
    with pytest.raises(orbits.errors.InputError, match=r"call run.error_estimate\(\) when the run is complete"):
        orbits.propagate(giants, duration="1 yr", wall_time=60, error_estimate=True)


def test_a_file_tells_who_writes_it_and_its_pace_without_being_locked(giants: orbits.System, tmp_path: Path) -> None:
    path, seen = tmp_path / "run.h5", []

    def look(t: u.Quantity, system: orbits.System) -> None:
        archive = orbits.Archive.open(path)
        seen.append((archive.writer, archive.pace))
        archive.close()

    run = orbits.propagate(
        giants, "stormer-verlet", dt="64 d", duration="2000 yr", samples=9, archive=path, callback=look
    )
    assert {writer for writer, _ in seen} == {os.getpid()}
    pace = run.archive.pace
    assert pace.start == 0.0
    assert pace.committed > pace.begun > 1.7e9
    assert abs(pace.reached - run.times[-1]) <= 64.0
    assert pace.rate > 0.0
    assert orbits.Archive.open(path).writer is None


def test_a_file_without_a_pace_as_earlier_versions_wrote_is_resumed_where_it_is(giants, tmp_path, monkeypatch) -> None:
    from orbits.propagation import making_runs as module
    from orbits.propagation.resuming import sample_store

    path, options = tmp_path / "run.h5", {"dt": "64 d", "duration": "9000 yr", "samples": 9}
    straight = orbits.propagate(giants, "stormer-verlet", **options)
    made = sample_store.checkpoint_of

    def earlier(*given: Any, **more: Any) -> Any:
        return {name: array for name, array in made(*given, **more).items() if name != "pace"}

    with monkeypatch.context() as patched:
        patched.setattr(module, "checkpoint_of", earlier)
        part = orbits.propagate(
            giants, "stormer-verlet", archive=path, callback=lambda t, x: t.to_value("yr") > 4000, **options
        )
    assert "pace" not in part.archive.checkpoint()
    part.close()
    inode = path.stat().st_ino
    whole = orbits.resume(path)
    assert path.stat().st_ino == inode  # not copied into a larger file
    assert np.array_equal(whole.q, straight.q)
    assert np.isnan(whole.archive.pace.rate)


RESIDENT = """
import gc, os, sys
import orbits
from astropy import units as u

name, path = sys.argv[1:]
giants = orbits.System.solar_system("2026-01-01", bodies=["Sun", "Jupiter", "Saturn", "Uranus", "Neptune"])
belt = giants.add(["p", "q", "r"], primary="Sun", a=[2.2, 2.7, 3.1] * u.au, e=[0.1, 0.2, 0.0])
for steps in (10**4, 10**5, 10**6, 10**7):
    run = orbits.propagate(
        belt, name, dt="20 d", duration=steps * 20 * u.day, samples=1001, archive=path, overwrite=True,
        check_step=False, heartbeat=orbits.Heartbeat(0.1, to=lambda line: None),
    )
    run.close()
    del run
    gc.collect()
    with open("/proc/self/statm") as status:
        print(int(status.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20)
"""
"""Prints MiB that are in memory after runs of more and more steps, in a process without the rest of other tests."""


@pytest.mark.slow
@pytest.mark.skipif(not os.path.exists("/proc/self/statm"), reason="memory is read from /proc")
@pytest.mark.parametrize("name", ["wisdom-holman", "stormer-verlet"])
def test_memory_stays_flat_over_ten_million_steps(name: str, tmp_path: Path) -> None:
    command = [sys.executable, "-c", RESIDENT, name, str(tmp_path / "run.h5")]
    printed = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    _, few, _, many = map(float, printed.split())
    assert many - few < 8.0, printed  # MiB; a number kept for each step would be 80


@pytest.mark.parametrize(
    ("rate", "said"), [(3_554_321.0, "3,550,000"), (12_345_678.0, "12,300,000"), (123.4, "123"), (0.1234, "0.123")]
)
def test_the_rate_of_a_heartbeat_is_written_without_powers_of_ten(rate: float, said: str) -> None:
    assert heartbeat._in_digits(rate) == said


def test_a_wall_time_that_is_none_is_refused_with_what_was_given_and_the_forms_that_it_can_have(
    giants: orbits.System,
) -> None:
    with pytest.raises(InputError, match=r"wall_time is '0'; expected a time, such as .*'2 h' or '12:00:00'"):
        orbits.propagate(giants, dt=100, duration=1000, wall_time="0")
