"""`orbits.verify`: it finds what is wrong in an archive, says what is whole, and integrates the run again."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from astropy import units as u
from typer.testing import CliRunner

import orbits
from orbits.archive import ArchiveWriter
from orbits.cli import app
from orbits.propagation.resuming import sample_store, verification
from orbits.propagation.resuming.recomputing import Compared

from ..coverings import cover

BODIES = {
    "star": {"gm": 1.0, "radius": 0.05},
    "a": {"a": 1.0, "e": 0.1, "gm": 1e-6, "radius": 0.05},
    "b": {"a": 1.1, "e": 0.1, "gm": 2e-6, "radius": 0.05, "l": 1.0, "pomega": 3.0},
}


@pytest.fixture(scope="module")
def belt() -> orbits.System:
    giants = orbits.System.solar_system("2026-01-01", bodies=["Sun", "Jupiter", "Saturn"])
    return giants.add(["p", "q"], primary="Sun", a=[2.7, 3.1] * u.au, e=[0.2, 0.0])


@pytest.fixture(scope="module")
def colliding() -> orbits.System:
    return orbits.System.from_elements(BODIES, units=orbits.DIMENSIONLESS)


RUNS: dict[str, dict[str, Any]] = {
    "wisdom-holman": {"integrator": "wisdom-holman", "dt": "50 d", "duration": "400 yr"},
    "gauss": {"integrator": "gauss(stages=4)", "dt": "50 d", "duration": "100 yr", "dense": True},
    "chosen steps": {"duration": "100 yr"},
    "samples off the grid, and an end behind them": {
        "integrator": "stormer-verlet", "dt": "20 d", "duration": "100 yr", "samples": [7, 1000.5, 20000] * u.day
    },
}  # fmt: skip


@pytest.fixture
def often(monkeypatch: pytest.MonkeyPatch) -> None:
    """Commit after each sample."""
    monkeypatch.setattr(sample_store, "CHUNK_BYTES", 1)


def found_in(checked: orbits.Verification, part: str) -> verification.Finding:
    return next(one for one in checked.findings if one.part == part)


@cover(("name", "recompute"), RUNS, ["all", "last"], strength=1)
def test_a_good_archive_is_computed_again_to_the_last_bit(
    name: str, recompute: Any, belt: orbits.System, tmp_path: Path, often: None
) -> None:
    run = orbits.propagate(belt, archive=tmp_path / "run.h5", **{"samples": 9, **RUNS[name]})
    checked = orbits.verify(tmp_path / "run.h5", recompute=recompute)
    assert checked.ok, checked
    assert (checked.readable, checked.samples) == (len(run), len(run))
    said = found_in(checked, "computed").said
    assert said.endswith("the same bits, and the same state at the last checkpoint")
    if recompute == "all":
        assert said.startswith(f"samples 0 to {len(run) - 1} in ")
    assert str(checked).endswith("\nok")


@pytest.mark.parametrize(("dt", "duration"), [(None, 20.0), (orbits.TimeTransformed(step=0.3), -20.0)])
def test_the_last_state_of_chosen_steps_is_compared_where_no_sample_follows(colliding, tmp_path, dt, duration) -> None:
    two, path = colliding.remove("b"), tmp_path / "run.h5"
    orbits.propagate(two, dt=dt, duration=duration, samples=[0.15 * duration], archive=path).close()
    for recompute in ("all", "last"):
        said = found_in(orbits.verify(path, recompute=recompute), "computed").said
        assert said.endswith("the same bits, and the same state at the last checkpoint")
    archive = orbits.Archive.open(path)
    checkpoint = archive.checkpoint()
    checkpoint["q"].ravel()[-1] = np.nextafter(checkpoint["q"].ravel()[-1], 9.0)
    with creation_of(tmp_path / "forged.h5", archive) as writer:
        writer.commit(np.array(archive.q[:]), np.array(archive.v[:]), checkpoint)
    (failure,) = orbits.verify(tmp_path / "forged.h5", recompute="all").failures
    assert failure.endswith("the same samples, but another state at the last checkpoint")


def test_where_nothing_was_compared_that_is_said(colliding, tmp_path, monkeypatch) -> None:
    orbits.propagate(colliding.remove("b"), duration=20.0, samples=2, archive=tmp_path / "run.h5").close()
    monkeypatch.setattr(verification, "recomputed", lambda *_, **__: Compared(1, steps=50))
    found = found_in(orbits.verify(tmp_path / "run.h5"), "computed")
    assert found.ok is None
    assert found.said.startswith("no samples in 50 steps: nothing was compared")


def test_runs_that_merge_or_were_stopped_are_computed_again(colliding: orbits.System, tmp_path: Path) -> None:
    merge = orbits.events.Collision(then=orbits.events.Merge())
    orbits.propagate(colliding, duration=20.0, events=merge, archive=tmp_path / "merged.h5").close()
    stop = orbits.events.CloserThan(0.5, "a", "b")
    orbits.propagate(colliding, "wisdom-holman", dt=0.1, duration=20.0, stop=stop, archive=tmp_path / "s.h5").close()
    for name in ("merged.h5", "s.h5"):
        checked = orbits.verify(tmp_path / name, recompute="all")
        assert checked.ok, checked
        assert "the same bits" in found_in(checked, "computed").said
    assert "1 body ends: a" in str(orbits.verify(tmp_path / "merged.h5", recompute="none"))


def changed(path: Path, offset: int) -> None:
    """Change one bit of a file."""
    with path.open("r+b") as file:
        file.seek(offset)
        byte = file.read(1)[0]
        file.seek(offset)
        file.write(bytes([byte ^ 1]))


def place_of(path: Path, name: str) -> int:
    with h5py.File(path) as file:
        return int(file[name].id.get_offset())


def test_one_bit_of_a_sample_is_found_and_the_others_are_counted_as_readable(belt, tmp_path, often) -> None:
    path = tmp_path / "run.h5"
    orbits.propagate(belt, archive=path, samples=9, **RUNS["wisdom-holman"]).close()
    changed(path, place_of(path, "v") + 3 * 5 * 24 + 50)
    changed(path, place_of(path, "q") + 4 * 5 * 24)
    checked = orbits.verify(path)
    assert not checked.ok
    assert checked.failures == ("samples: 3 to 4 do not hold their checksums; the others of 9 do",)
    assert checked.readable == 7
    assert "7 of 9 samples are whole; orbits.Archive.open(path, salvage=True) reads those before the damage" in str(
        checked
    )
    assert found_in(checked, "computed").ok


@pytest.mark.parametrize("what", ["checkpoints/0/q", "checkpoints/1/q"])
def test_a_damaged_checkpoint_is_found_or_was_not_the_last_one(what: str, belt, tmp_path, often) -> None:
    path = tmp_path / "run.h5"
    orbits.propagate(belt, archive=path, samples=9, **RUNS["wisdom-holman"]).close()
    last = orbits.Archive.open(path).last.slot
    changed(path, place_of(path, what) + 8)
    checked = orbits.verify(path)
    if what.endswith(f"{last}/q"):
        assert checked.failures[0].endswith("salvage=True).")
        assert "the checkpoint does not hold its checksum" in checked.failures[0]
        assert checked.readable == 9
    else:
        assert checked.ok  # from the start then, as there is no other checkpoint
        assert found_in(checked, "computed").said.startswith("samples 0 to 8 in ")


def test_numbers_that_no_run_gave_are_found_even_with_a_right_checksum(belt, tmp_path) -> None:
    """A sample replaced in the file, checksums included: only computing it again tells."""
    path = tmp_path / "run.h5"
    run = orbits.propagate(belt, archive=path, samples=9, **RUNS["wisdom-holman"])
    archive = orbits.Archive.open(path)
    q, v = np.array(archive.q[:]), np.array(archive.v[:])
    q[6, 2, 1] = np.nextafter(q[6, 2, 1], 9.0)
    with creation_of(tmp_path / "forged.h5", archive) as writer:
        writer.commit(q, v, archive.checkpoint())
    run.close()
    checked = orbits.verify(tmp_path / "forged.h5", recompute="all")
    assert found_in(checked, "samples").ok
    (failure,) = checked.failures
    assert "other bits from sample 6 on, at first of Saturn, by up to" in failure
    assert orbits.verify(tmp_path / "forged.h5", recompute="none").ok


def creation_of(path: Path, archive: orbits.Archive) -> ArchiveWriter:
    return ArchiveWriter.create(
        path, system=archive.system, integrator=archive.integrator, grid=archive.grid,
        checkpoint=archive.checkpoint(), provenance=archive.provenance,
    )  # fmt: skip


def test_samples_that_are_not_finite_and_bodies_that_come_back_are_found(belt, tmp_path) -> None:
    run = orbits.propagate(belt, archive=tmp_path / "run.h5", samples=9, **RUNS["wisdom-holman"])
    q, v = np.array(run.archive.q[:]), np.array(run.archive.v[:])
    for name, change, said in (
        ("inf", (3, 1, np.inf), "Jupiter is not finite at sample 3"),
        ("back", (4, 3, np.nan), "p is there again at sample 5"),  # of which 4 is at the end of a step
        ("start", (0, 0, 0.5), "the first sample is not the start of the run"),
    ):
        other_q, other_v = q.copy(), v.copy()
        sample, body, value = change
        other_q[sample, body] = value
        if name == "back":
            other_v[sample, body] = value
        with creation_of(tmp_path / f"{name}.h5", run.archive) as writer:
            writer.commit(other_q, other_v, run.archive.checkpoint())
        checked = orbits.verify(tmp_path / f"{name}.h5", recompute="none")
        assert found_in(checked, "values") == verification.Finding("values", said, False)


def test_other_bits_on_another_machine_are_told_but_no_damage(belt, tmp_path, often, monkeypatch) -> None:
    path = tmp_path / "run.h5"
    orbits.propagate(belt, archive=path, samples=9, **RUNS["wisdom-holman"]).close()
    monkeypatch.setattr(verification, "differences", lambda recorded: ["numba 0.1 -> 0.2"])
    assert orbits.verify(path).ok
    assert "its last bits may be others here: numba 0.1 -> 0.2" in str(orbits.verify(path))


def test_what_is_no_archive_or_not_there_is_said(tmp_path: Path) -> None:
    with pytest.raises(orbits.errors.ArchiveError, match="is not there"):
        orbits.verify(tmp_path / "none.h5")
    with pytest.raises(orbits.errors.InputError, match="expected 'all', 'last' or 'none'"):
        orbits.verify(tmp_path / "none.h5", recompute="some")
    (tmp_path / "text.h5").write_text("no archive")
    checked = orbits.verify(tmp_path / "text.h5")
    assert (checked.ok, checked.readable, checked.samples) == (False, 0, None)
    assert "is not an HDF5 file" in str(checked)


def test_a_run_with_functions_in_its_events_is_computed_again_if_they_are_given(colliding, tmp_path) -> None:
    def far(t: np.ndarray, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        return t - 5.5

    event, path = orbits.events.Event(far), tmp_path / "run.h5"
    orbits.propagate(colliding, dt=0.1, integrator="stormer-verlet", duration=9.0, events=event, archive=path).close()
    without = orbits.verify(path)
    assert without.ok
    assert found_in(without, "computed").ok is None
    assert "nothing: " in found_in(without, "computed").said
    assert "the same bits" in found_in(orbits.verify(path, events=event), "computed").said


@pytest.fixture
def killed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., list[Path]]:
    """What is left of a run if it is killed after any of its commits, of which there are as many as can be."""
    monkeypatch.setattr(sample_store, "FIRST_COMMIT_SECONDS", 0.0)
    monkeypatch.setattr(sample_store, "COMMIT_SHARE", 0.0)
    path, kept, commit = tmp_path / "run.h5", [], ArchiveWriter.commit

    def copied(writer: ArchiveWriter, *samples: Any) -> None:
        commit(writer, *samples)
        kept.append(tmp_path / f"{len(kept)}.h5")
        shutil.copy(path, kept[-1])

    def run(*given: Any, **options: Any) -> list[Path]:
        with monkeypatch.context() as during:
            during.setattr(ArchiveWriter, "commit", copied)
            orbits.propagate(*given, archive=path, **options).close()
        return kept

    return run


def test_a_run_killed_between_an_action_and_the_next_step_of_a_map_is_whole(belt, killed) -> None:
    """Bodies go on by chosen steps for the rest of the step, which is not computed again up to there: "DAMAGED"."""
    burn = orbits.events.Event(lambda t, q, v: t - 100.0, then=lambda event, now: now.replaced(v=now.v * 1.0001))
    follow = orbits.WisdomHolman(encounters="follow")
    kept = killed(belt, follow, dt="60 d", duration="180 d", samples=3, events=burn)
    states = {each: orbits.Archive.open(each).checkpoint() for each in kept}
    left = [each for each, state in states.items() if state["change_counts"][0] and state["excursion_counts"][0]]
    assert left
    assert all(orbits.verify(each, events=burn).ok for each in left)


def test_a_run_killed_before_its_first_step_which_retires_a_particle_is_whole(killed) -> None:
    pair = {"a": {"a": 1.0, "e": 0.05, "gm": 1e-4}, "b": {"a": 1.15, "e": 0.1, "gm": 1e-4, "l": 2.0}}
    start = orbits.System.from_elements({"s": {"gm": 1.0}, **pair}, units=orbits.DIMENSIONLESS)
    start = start.add(["x", "y"], primary="s", a=[1.05, 2.0], e=[0.1, 0.3])
    method = orbits.WisdomHolman(encounters="retire particles, follow planets")
    with pytest.warns(orbits.errors.RetiredWarning):
        kept = killed(start, method, dt=0.1, duration=1.0, samples=3)
    states = {each: orbits.Archive.open(each).checkpoint() for each in kept}
    before = [each for each, state in states.items() if state["retired"].any() and not state["counts"][0]]
    assert before
    assert all(orbits.verify(each).ok for each in before)


def test_a_sample_between_two_steps_to_which_no_partial_step_leads_is_no_damage(tmp_path) -> None:
    """A body falls straight into a star, over which the whole step leaps: "there again"."""
    q, v = [[0, 0, 0], [-2.0, 0, 0], [3.0, 3.0, 0]], [[0, 0, 0], [0, 0, 0], [0, 0.5, 0]]
    start = orbits.System(["star", "falls", "far"], [1, 0, 0], q, v, units=orbits.DIMENSIONLESS)
    options = {"dt": 0.01, "duration": 6.295, "samples": 9, "check_step": False}
    run = orbits.propagate(start, "gauss", archive=tmp_path / "run.h5", **options)
    lost = np.isnan(run["falls"].q.value[:, 0])
    assert lost.any()
    assert not lost[-1]
    run.close()
    checked = orbits.verify(tmp_path / "run.h5", recompute="all")
    assert checked.ok
    assert "without some samples between two steps: falls" in str(checked)


def test_the_command_ends_with_1_for_a_damaged_file_and_has_json(belt, tmp_path) -> None:
    path = tmp_path / "run.h5"
    orbits.propagate(belt, archive=path, samples=9, **RUNS["wisdom-holman"]).close()
    good = CliRunner().invoke(app, ["verify", str(path), "--recompute", "all"])
    assert good.exit_code == 0
    assert good.output.endswith("\nok\n")
    changed(path, place_of(path, "q") + 100)
    bad = CliRunner().invoke(app, ["verify", str(path), "--json"])
    assert bad.exit_code == 1
    record = json.loads(bad.stdout)
    assert record["ok"] is False
    assert {"part", "ok", "said"} == set(record["findings"][0])
