"""Campaigns on threads and processes: the same bits however they are cut and stopped, and tables that are right."""

from __future__ import annotations

import os
import re
import shutil
import signal
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from astropy import units as u

import orbits
from orbits import ensemble
from orbits.ensemble import dask_workers, tasks
from orbits.errors import ArchiveError, InputError, Interrupted, OrbitsWarning, StorageError, UnknownNameError
from tests.ensemble.belts import OPTIONS, belt, giants, system

from ..coverings import first

LONG = {**OPTIONS, "duration": 1500 * u.yr}
"""Blocks of a tenth of a second, so that a signal finds some at work."""


def interrupted(folder: Path, number: signal.Signals, after: int, **options: object) -> ensemble.Campaign:
    """Run a campaign, send this process a signal as soon as some blocks are done, and return what is there."""

    def send() -> None:
        while True:
            time.sleep(0.005)
            index = folder / "index.jsonl"
            if index.exists() and index.read_bytes().count(b"\n") >= after:
                os.kill(os.getpid(), number)
                return

    thread = threading.Thread(target=send, daemon=True)
    thread.start()
    with pytest.raises(Interrupted, match="the same call goes on") as raised:
        ensemble.run(belt(96), folder, **options)
    thread.join()
    return raised.value.trajectory


@pytest.fixture(scope="module")
def whole() -> orbits.Trajectory:
    return orbits.propagate(system(100), **OPTIONS)


@pytest.mark.parametrize(("block", "workers"), first(2, [(16, 2), (37, 1), (100, 1)]))
def test_particles_have_the_bits_of_one_run_with_all_of_them_in_blocks_of_any_size(tmp_path, whole, block, workers):
    campaign = ensemble.run(belt(100), tmp_path / "c", block=block, workers=workers, **OPTIONS)
    for name in ("p0", "p36", "p37", "p99"):
        np.testing.assert_array_equal(campaign[name].q, whole[name].q)
        np.testing.assert_array_equal(campaign[name].v, whole[name].v)


def test_a_fraction_of_the_shortest_period_is_that_of_all_particles_whatever_their_blocks(tmp_path):
    options = {**OPTIONS, "integrator": "stormer-verlet", "dt": "P/40", "check_step": False}
    run = orbits.propagate(system(40), **options)
    campaign = ensemble.run(belt(40), tmp_path / "c", block=9, **options)
    assert [campaign.run(k).dt for k in (0, 9, 18, 27, 36)] == [run.dt] * 5
    np.testing.assert_array_equal(campaign["p20"].q, run["p20"].q)


def places(campaign, block):
    """The places of all particles, (samples, particles, 3), from the files of the blocks."""
    return np.concatenate([campaign.run(k).q.value[:, len(giants().names):] for k in range(0, len(campaign), block)], 1)


@pytest.mark.parametrize("method", first(1, [orbits.StormerVerlet(), orbits.Gauss()]), ids=lambda m: m.name)
def test_other_methods_give_particles_bits_that_do_not_depend_on_the_block(tmp_path, method):
    options = {**OPTIONS, "integrator": method, "dt": None if method.name == "gauss" else "5 d"}
    one, other = (ensemble.run(belt(40), tmp_path / str(b), block=b, **options) for b in (40, 9))
    np.testing.assert_array_equal(places(one, 40), places(other, 9))


@pytest.mark.filterwarnings("ignore::orbits.errors.OrbitsWarning")
def test_particles_that_are_followed_through_encounters_have_bits_that_do_not_depend_on_the_block(tmp_path):
    near = 5.0
    options = {**OPTIONS, "integrator": orbits.WisdomHolman(encounters="follow particles")}
    one, other = (ensemble.run(belt(40, near), tmp_path / str(b), block=b, **options) for b in (40, 9))
    found = places(one, 40)
    np.testing.assert_array_equal(found, places(other, 9))
    left = orbits.propagate(system(40, near), **{**options, "integrator": orbits.WisdomHolman(), "check_step": False})
    followed = (found != left.q.value[:, len(giants().names):]).any(axis=(0, 2))
    assert followed.sum() > 5


def test_a_process_gives_the_bits_of_a_thread(tmp_path):
    one = ensemble.run(belt(20), tmp_path / "threads", block=16, **OPTIONS)
    other = ensemble.run(belt(20), tmp_path / "processes", block=16, workers=1, processes=True, **OPTIONS)
    assert one.bits == other.bits
    assert "SpawnProcess" in other.blocks[0].worker


def test_the_table_has_what_the_runs_have(tmp_path):
    options = {**OPTIONS, "samples": 41}
    campaign = ensemble.run(belt(24, outermost=5.0), tmp_path / "c", block=16, **options)
    with pytest.warns(orbits.errors.RetiredWarning):
        run = orbits.propagate(system(24, outermost=5.0), approaches=True, **options)
    table, elements = campaign.summary, run.elements(primary="Sun")
    lost = {one.name: one for one in run.retired}
    assert 0 < len(lost) < 24
    approaches = run.closest_approaches().distance[:, 1]
    for row in table:
        own, one = elements[row["name"]], lost.get(row["name"])
        assert row["state"] == ("survived" if one is None else "lost")
        assert row["end"] == (run.t[-1] if one is None else one.time)
        assert row["reason"] == ("" if one is None else one.reason)
        for key in ("a", "e", "inc"):
            values = getattr(own, key).value
            assert u.Quantity(row[f"{key}_min"]).value == np.nanmin(values)
            assert u.Quantity(row[f"{key}_max"]).value == np.nanmax(values)
        # The table has the recorded distance, to a few 1e-4 of what a march through the approach gives.
        exact = approaches[run.system.index(row["name"])]
        if np.isfinite(exact):
            np.testing.assert_allclose(row["closest"].value, exact.value, rtol=3e-3)
    near = np.isfinite(table["closest"].value)
    assert set(table["closest_to"][near]) <= {"Jupiter", "Saturn"}


def test_members_of_a_block_are_read_from_one_opened_file_until_it_is_replaced(tmp_path, monkeypatch):
    campaign = ensemble.run(belt(6), tmp_path / "c", block=3, **OPTIONS)
    opened = []

    class Counted:
        @staticmethod
        def open(path):
            opened.append(path)
            return orbits.Trajectory.open(path)

    monkeypatch.setattr("orbits.ensemble.campaign.Trajectory", Counted)
    before = [campaign[name].q for name in campaign]
    assert len(opened) == 2
    again = opened[-1].with_suffix(".copy")
    shutil.copyfile(opened[-1], again)
    os.replace(again, opened[-1])
    np.testing.assert_array_equal(campaign["p5"].q, before[5])
    np.testing.assert_array_equal(campaign["p0"].q, before[0])
    assert len(opened) == 4


@pytest.mark.nightly
def test_megno_of_members_is_that_of_a_run_with_all_of_them(tmp_path):
    options = {key: OPTIONS[key] for key in ("duration", "dt")}
    campaign = ensemble.run(belt(20), tmp_path / "c", block=16, megno={"vectors": 2}, trajectories=False, **OPTIONS)
    found = orbits.megno(system(20), OPTIONS["integrator"], **options, vectors=2)
    np.testing.assert_array_equal(campaign.summary["megno"], [one.megno[-1] for one in found.particles])
    with pytest.raises(ArchiveError, match="keeps no samples"):
        campaign["p3"]


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    return ensemble.run(belt(96), tmp_path_factory.mktemp("whole") / "c", block=16, **LONG)


@pytest.mark.parametrize("number", first(1, [signal.SIGINT, signal.SIGTERM]))
def test_a_campaign_that_a_signal_stopped_goes_on_to_the_same_bits(tmp_path, number, undisturbed):
    part = interrupted(tmp_path / "c", number, 2, block=16, workers=1, **LONG)
    assert 0 < part.progress.done < 6
    assert not part.complete
    assert (part.summary["state"] == "waiting").any()
    told: list[str] = []
    campaign = ensemble.run(belt(96), tmp_path / "c", block=16, workers=2, say=told.append, **LONG)
    assert any("are there already" in line for line in told)
    assert campaign.bits == undisturbed.bits


@pytest.mark.nightly
def test_a_block_that_was_interrupted_goes_on_where_it_was(tmp_path, monkeypatch):
    """Its archive is taken up at the step that it had reached, which the second run does not march again."""
    longer = {**OPTIONS, "duration": 2e4 * u.yr, "block": 32, "workers": 1}
    path = tmp_path / "c" / "block-00000.h5"

    def send():
        while not path.exists():
            time.sleep(0.01)
        time.sleep(0.2)
        os.kill(os.getpid(), signal.SIGINT)

    threading.Thread(target=send, daemon=True).start()
    with pytest.raises(Interrupted):
        ensemble.run(belt(32), tmp_path / "c", **longer)
    before = orbits.Trajectory.open(path)
    assert not before.complete
    assert 0.0 < before.span[1] < 2e4 * 365.25
    before.close()
    seen = []
    original = tasks.resumed
    monkeypatch.setattr(tasks, "resumed", lambda *given, **known: seen.append(original(*given, **known)) or seen[0])
    campaign = ensemble.run(belt(32), tmp_path / "c", **longer)
    assert seen[0].first > 0 or seen[0].marcher.step > 0
    assert campaign.complete
    whole = orbits.propagate(system(32), **{**OPTIONS, "duration": 2e4 * u.yr})
    np.testing.assert_array_equal(campaign["p31"].q, whole["p31"].q)


@pytest.mark.nightly
@pytest.mark.parametrize("moment", first(2, ["while they are made ready", "while they are marched", "before"]))
def test_a_block_of_systems_that_is_to_stop_begins_no_more_of_them_and_loses_none(tmp_path, monkeypatch, moment):
    """Systems that were not begun would each take as long to be made ready, and to be stored, as the stop may take."""
    plan = ensemble.Plan(
        ensemble.grid(pair, speed=np.linspace(0.7, 1.1, 12)), duration=40.0, dt=0.01, integrator="stormer-verlet",
        block=12,
    )  # fmt: skip
    task = plan.task(0, plan.ensemble.part(0, 12), stem="block-00000")
    ready, begun = [], tasks.begun
    monkeypatch.setattr(tasks, "begun", lambda *given, **known: ready.append(given[0]) or begun(*given, **known))
    files = tmp_path / "block-00000"

    def asked() -> str:
        stops = {"before": True, "while they are made ready": len(ready) == 3}
        return "Ctrl-C" * stops.get(moment, files.is_dir() and any(files.glob("*.h5")))

    stopped = tasks.integrate(task, tmp_path, "here", asked)
    assert stopped.state == tasks.INTERRUPTED
    assert len(ready) == {"before": 0, "while they are made ready": 3}.get(moment, 12)
    there = sorted(files.glob("*.h5"))
    assert len(there) <= (8 if moment == "while they are marched" else 0)  # those of one group, in lanes
    monkeypatch.setattr(tasks, "begun", begun)
    whole = tasks.integrate(task, tmp_path, "here")
    (tmp_path / "other").mkdir()
    assert whole.state == tasks.DONE
    assert whole.bits == tasks.integrate(task, tmp_path / "other", "here").bits


@pytest.mark.parametrize(
    "stop", first(2, [orbits.events.FartherThan(1.5, "A", "B"), orbits.events.EnergyErrorAbove(2e-6)]), ids=type
)
def test_members_that_had_stopped_in_a_block_that_was_interrupted_do_not_go_on_past_it(tmp_path, stop):
    """The first stops within a turn; the others are circles."""
    plan = ensemble.Plan(
        ensemble.grid(pair, speed=[1.3, 1.0, 1.001]), duration=2e4, dt=0.01, integrator="stormer-verlet", stop=stop
    )
    task = plan.task(0, plan.ensemble.part(0, 3), stem="block-00000")
    files, other = tmp_path / "block-00000", tmp_path / "other"
    stopped = tasks.integrate(task, tmp_path, "here", lambda: "Ctrl-C" * (len(list(files.glob("*.h5"))) > 1))
    assert stopped.state == tasks.INTERRUPTED
    whole = tasks.integrate(task, tmp_path, "here")
    other.mkdir()
    alone = tasks.integrate(task, other, "here")
    assert {*alone.columns["state"]} == {"survived", "stopped"}
    np.testing.assert_array_equal(whole.columns["end"], alone.columns["end"])
    assert whole.bits == alone.bits


@pytest.mark.nightly
def test_a_campaign_is_readable_while_it_runs(tmp_path):
    seen: list[ensemble.Progress] = []

    def look() -> None:
        while not seen or not seen[-1].complete:
            time.sleep(0.01)
            try:
                campaign = ensemble.open(tmp_path / "c")
            except ArchiveError:
                continue
            seen.append(campaign.progress)
            if seen[-1].done:
                assert len(campaign["p0"].q) == 5
                assert (campaign.summary["state"][:16] == "survived").all()

    thread = threading.Thread(target=look)
    thread.start()
    ensemble.run(belt(96), tmp_path / "c", block=16, workers=1, **LONG)
    thread.join()
    assert len({progress.done for progress in seen}) > 2  # some of them within


@pytest.mark.parametrize("how", first(2, ["damaged", "missing", "shorter"]))
def test_a_damaged_block_is_said_and_done_again(tmp_path, how):
    first = ensemble.run(belt(40), tmp_path / "c", block=16, **OPTIONS)
    bits, path = first.bits, tmp_path / "c" / "block-00001.h5"
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    if how == "missing":
        path.unlink()
    else:
        path.write_bytes(data if how == "damaged" else data[:-1])
    assert list(first.verify()) == [1]
    told: list[str] = []
    again = ensemble.run(belt(40), tmp_path / "c", block=16, say=told.append, **OPTIONS)
    assert any("block 1: block-00001.h5 is" in line and "done again" in line for line in told)
    assert not again.verify()
    assert again.bits == bits


def test_the_end_of_a_line_that_a_kill_left_is_removed(tmp_path):
    first = ensemble.run(belt(40), tmp_path / "c", block=16, **OPTIONS)
    index = tmp_path / "c" / "index.jsonl"
    lines = index.read_bytes().splitlines(keepends=True)
    index.write_bytes(b"".join(lines[:-1]) + lines[-1][:30])
    assert first.progress.done == 2
    again = ensemble.run(belt(40), tmp_path / "c", block=16, **OPTIONS)
    assert again.progress.done == 3


def test_the_store_of_another_campaign_is_refused_with_what_differs(tmp_path):
    ensemble.run(belt(20), tmp_path / "c", block=16, **OPTIONS)
    with pytest.raises(ArchiveError, match=r"another campaign. What differs: dt: '30 d' there, '20 d' here"):
        ensemble.run(belt(20), tmp_path / "c", block=16, **{**OPTIONS, "dt": "20 d"})
    with pytest.raises(ArchiveError, match="members: 20 there, 21 here"):
        ensemble.run(belt(21), tmp_path / "c", block=16, **OPTIONS)
    with pytest.raises(ArchiveError, match="block: 16 there, 8 here"):
        ensemble.run(belt(20), tmp_path / "c", block=8, **OPTIONS)
    (tmp_path / "d").mkdir()
    (tmp_path / "d" / "notes.txt").write_text("mine")
    with pytest.raises(ArchiveError, match="not the folder of a campaign"):
        ensemble.run(belt(20), tmp_path / "d", **OPTIONS)
    with pytest.raises(ArchiveError, match=r"it has no campaign\.json"):
        ensemble.open(tmp_path / "d")


def test_the_store_of_an_earlier_version_is_read_and_not_gone_on_with(tmp_path):
    """Its quantities are told apart by eight digits: the same text may be of another campaign."""
    campaign = ensemble.run(belt(20), tmp_path / "c", block=16, **OPTIONS)
    about = tmp_path / "c" / "campaign.json"
    text = about.read_text()
    about.write_text(text.replace("orbits campaign 2", "orbits campaign 1"))
    assert ensemble.open(tmp_path / "c").bits == campaign.bits
    with pytest.raises(ArchiveError, match=r"begun by an earlier version of orbits.*orbits\.ensemble\.open reads"):
        ensemble.run(belt(20), tmp_path / "c", block=16, **OPTIONS)
    about.write_text(text.replace("orbits campaign 2", "orbits campaign 3"))
    with pytest.raises(ArchiveError, match=r"has format 'orbits campaign 3'; .* written by a newer one"):
        ensemble.open(tmp_path / "c")


def test_a_folder_in_which_nothing_was_done_yet_takes_another_campaign(tmp_path, monkeypatch):
    monkeypatch.setattr(dask_workers, "PATIENCE", 0.5)
    with pytest.raises(InputError):
        ensemble.run(belt(20), tmp_path / "c", client="tcp://127.0.0.1:1", **OPTIONS)
    assert ensemble.run(belt(20), tmp_path / "c", **{**OPTIONS, "dt": "20 d"}).complete


def test_two_processes_on_one_folder_exclude_each_other(tmp_path):
    refused: list[BaseException] = []

    def second(text: str) -> None:
        if not refused:
            try:
                ensemble.run(belt(40), tmp_path / "c", block=16, **OPTIONS)
            except ArchiveError as error:
                refused.append(error)

    ensemble.run(belt(40), tmp_path / "c", block=16, **OPTIONS)
    (tmp_path / "c" / "block-00001.h5").unlink()
    ensemble.run(belt(40), tmp_path / "c", block=16, say=second, **OPTIONS)
    assert f"is being run by another process (process {os.getpid()} on" in str(refused[0])


def test_a_worker_of_other_versions_refuses_a_block_and_both_are_told(tmp_path):
    """As one that joins a cluster later; those that are there at the start are asked before."""
    plan = ensemble.Plan(belt(20), **{key: OPTIONS[key] for key in OPTIONS if key != "progress"})
    for made_by, told in (
        ({"numba": "0.1"}, r"numba \d.*, this process 0.1"),
        ({"cpu_features": "none"}, "another processor"),
        ({"kernel_sources": "none"}, "other kernels of orbits"),
    ):
        outcome = tasks.integrate(plan.task(0, plan.ensemble.sample(), stem="block", made_by=made_by), tmp_path, "here")
        assert outcome.state == tasks.REFUSED
        assert re.match(told, outcome.reason)
    assert not list(tmp_path.iterdir())


def test_a_folder_that_is_replaced_during_a_campaign_is_not_written_to(tmp_path):
    ensemble.run(belt(40), tmp_path / "c", block=16, **OPTIONS)
    (tmp_path / "c" / "block-00001.h5").unlink()

    def replace(text):
        if not (tmp_path / "old").exists():
            (tmp_path / "c").rename(tmp_path / "old")
            (tmp_path / "c").mkdir()

    with pytest.raises(StorageError, match="was deleted or replaced"):
        ensemble.run(belt(40), tmp_path / "c", block=16, say=replace, **OPTIONS)
    assert not (tmp_path / "c" / "index.jsonl").exists()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"block": 0}, "block must be a whole number >= 1, got 0"),
        ({"block": 1.5}, "block must be a whole number"),
        ({"workers": 0}, "workers, if given, must be a whole number >= 1"),
        ({"megno": "yes"}, "megno is 'yes'; expected True, False or a dict"),
        ({"trajectories": 2}, "trajectories is 2; expected True or False"),
        ({"client": "tcp://127.0.0.1:1", "workers": 2}, "brings its own workers"),
        ({"duration": None}, "duration"),
    ],
)
def test_wrong_arguments_are_refused_before_there_is_a_folder(tmp_path, changes, message):
    with pytest.raises(InputError, match=message):
        ensemble.run(belt(20), tmp_path / "c", **{**OPTIONS, **changes})
    assert not (tmp_path / "c").exists()


@pytest.mark.parametrize("given", [{"megno": True}, {"trajectories": False}, {"block": 4}, {"samples": 3}])
def test_what_a_plan_has_is_not_given_beside_it(tmp_path, given):
    plan = ensemble.Plan(belt(20), **{name: value for name, value in OPTIONS.items() if name != "progress"})
    with pytest.raises(InputError, match=f"a Plan has its own {next(iter(given))}; change it by plan.changed"):
        ensemble.run(plan, tmp_path / "c", **given)


def test_other_arguments_are_answered_with_a_hint(tmp_path):
    with pytest.raises(UnknownNameError, match=r"no argument 'n_jobs': threads"):
        ensemble.run(belt(20), tmp_path / "c", n_jobs=2, **OPTIONS)
    with pytest.raises(UnknownNameError, match="an archive for each block"):
        ensemble.run(belt(20), tmp_path / "c", archive="x.h5", **OPTIONS)
    with pytest.raises(InputError, match=r"the ensemble is System.*expected one from orbits.ensemble"):
        ensemble.run(giants(), tmp_path / "c", **OPTIONS)


def test_a_campaign_that_would_not_fit_on_the_disk_is_refused_before_it_starts(tmp_path, monkeypatch):
    monkeypatch.setattr("orbits.ensemble.plan.free_bytes", lambda folder: 1_000_000)
    with pytest.raises(StorageError, match=r"would need about \d+\.\d MB in .*, but 1.0 MB are free"):
        ensemble.run(belt(1000), tmp_path / "c", **{**OPTIONS, "samples": 100})
    assert not list(tmp_path.glob("c/block*"))


@pytest.mark.nightly
def test_the_estimate_of_the_disk_is_that_of_the_files(tmp_path):
    """Within a quarter, for few and for many samples, of particles and of systems."""
    particles, systems = belt(60), ensemble.systems([giants()] * 5)
    for samples, members in ((2, particles), (200, particles), (200, systems)):
        folder = tmp_path / f"{samples}-{members.kind}"
        options = {**OPTIONS, "samples": samples}
        ensemble.run(members, folder, block=20, **options)
        options.pop("progress")
        plan = ensemble.Plan(members, block=20, **options)
        needed = plan.bytes_needed(plan.grid(plan.first()), 3, 20)
        there = sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
        assert 0.8 < needed / there < 1.6, (samples, members.kind, needed, there)


def test_a_block_that_cannot_be_integrated_is_reported_and_the_others_go_on(tmp_path):
    """Two bodies with mass collide head on in one system; a function refuses the parameters of another."""
    campaign_of = {"duration": 5.0, "dt": 0.01, "integrator": "gauss", "block": 1, "progress": False}
    made = ensemble.grid(pair, speed=[-1.0, 0.0, 1.0, 0.9])
    with pytest.warns(OrbitsWarning, match="A falls straight into B") as told:
        campaign = ensemble.run(made, tmp_path / "c", **campaign_of)
    (said,) = (str(one.message) for one in told if "campaign.failed_members" in str(one.message))
    assert said.startswith("2 of 4 members could not be integrated")
    assert all(f"{name}: {reason}".removesuffix(".") in said for name, reason in campaign.failed_members.items())
    assert list(campaign.failed_members) == [campaign.names[0], campaign.names[1]]
    assert "no such speed" in campaign.failed_members[campaign.names[0]]
    assert not campaign.failed  # no block as a whole
    assert campaign.progress.members_failed == 2
    assert "4 of 4 members, 2 of them to the end; 2 could not be integrated" in str(campaign.progress)
    table = campaign.summary
    assert list(table["state"]) == ["failed", "failed", "survived", "survived"]
    assert "ConvergenceError" in table["reason"][1]
    assert "no such speed" in table["reason"][0]
    np.testing.assert_array_equal(table["speed"], [-1.0, 0.0, 1.0, 0.9])
    assert table["energy_error"][2] < 1e-13  # Gauss with 8 stages, 500 steps


def test_a_block_of_particles_whose_planets_collide_is_listed_as_failed(tmp_path):
    bodies = orbits.System(["A", "B"], [1.0, 1.0], [[-0.5, 0, 0], [0.5, 0, 0]], np.zeros((2, 3)),
                                       units=orbits.DIMENSIONLESS)  # fmt: skip
    members = {"q": np.array([[3.0, 0, 0], [0, 4, 0]]), "v": np.array([[0, 0.8, 0], [-0.7, 0, 0]])}
    options = {"duration": 5.0, "dt": 0.01, "integrator": "gauss", "block": 1, "check_step": False, "progress": False}
    with pytest.warns(OrbitsWarning, match="2 of 2 blocks could not be integrated"):
        campaign = ensemble.run(ensemble.particles(bodies, members), tmp_path / "c", **options)
    assert list(campaign.failed) == [0, 1]
    assert campaign.complete
    assert list(campaign.summary["state"]) == ["failed", "failed"]
    assert list(campaign.failed_members) == ["p0", "p1"]
    assert campaign.progress.members_failed == 2
    with pytest.raises(ArchiveError, match="could not be integrated: ConvergenceError"):
        campaign["p0"]


def pair(speed: float) -> orbits.System:
    """Two equal masses, at rest if `speed` is 0."""
    if speed < 0:
        raise ValueError("no such speed")
    q, v = np.array([0.5, 0, 0]), np.array([0, speed / 2**0.5, 0])
    return orbits.System(["A", "B"], [1.0, 1.0], [q, -q], [v, -v], units=orbits.DIMENSIONLESS)


def test_systems_that_failed_are_tried_again_if_asked_for(tmp_path):
    """A function that lacks something the first time, as a file that is not there yet."""
    ready = tmp_path / "ready"

    def late(speed):
        if speed > 0.95 and not ready.exists():
            raise ValueError("not ready")
        return pair(speed)

    made = ensemble.grid(late, speed=[0.9, 1.0])
    options = {"duration": 1.0, "dt": 0.01, "integrator": "stormer-verlet", "block": 1, "progress": False}
    with pytest.warns(OrbitsWarning, match="1 of 2 members could not be integrated"):
        ensemble.run(made, tmp_path / "c", **options)
    ready.touch()
    with pytest.warns(OrbitsWarning, match="1 of 2 members could not be integrated"):
        ensemble.run(made, tmp_path / "c", **options)
    told: list[str] = []
    again = ensemble.run(made, tmp_path / "c", retry=True, say=told.append, **options)
    assert told == ["block 1: 1 member failed; it is done again", "1 of 2 blocks are there already"]
    assert not again.failed_members
    assert list(again.summary["state"]) == ["survived", "survived"]


def test_the_closest_approach_of_a_system_is_that_of_two_others_than_the_one_that_dominates(tmp_path):
    """That of Mercury and Jupiter, not the perihelion of Mercury; with two bodies there is none."""
    sun = ["Sun", "Mercury", "Jupiter", "Saturn"]
    members = [orbits.System.solar_system("2026-01-01", bodies=sun[:k]) for k in (4, 2)]
    campaign = ensemble.run(ensemble.systems(members), tmp_path / "c", duration="1 yr", dt="4 d", progress=False,
                            integrator="wisdom-holman", check_step=False, trajectories=False)  # fmt: skip
    run = orbits.propagate(members[0], "wisdom-holman", duration="1 yr", dt="4 d", check_step=False, approaches=True)
    nearest = next(one for one in run.closest_approaches()["Mercury"] if one.other != "Sun")
    table = campaign.summary
    assert list(table["closest_to"]) == ["Mercury, Jupiter", ""]
    # As recorded, from the two-body orbit within the step.
    np.testing.assert_allclose(table["closest"][0].to_value(u.au), nearest.distance.to_value(u.au), rtol=2e-3)
    assert table["closest"][1].value == np.inf


def meeting(turn):
    """Two planets, which merge at t = 7.6 if `turn` is 1."""
    a = {"a": 1.0, "e": 0.1, "gm": 1e-3, "radius": 0.05}
    b = {"a": 1.1, "e": 0.1, "gm": 2e-3, "radius": 0.05, "l": turn, "pomega": 3.0}
    star = {"gm": 1.0, "radius": 0.05}
    return orbits.System.from_elements({"star": star, "a": a, "b": b}, units=orbits.DIMENSIONLESS)


MERGING = {"duration": 20.0, "integrator": "gauss", "progress": False,
           "events": [orbits.events.Collision(then=orbits.events.Merge())]}  # fmt: skip


def test_the_table_of_systems_that_merge_has_the_error_of_the_energy_and_does_not_say_that_nothing_came_near(tmp_path):
    """The energy that a merger takes, a hundredth here, is no error; closest approaches of such runs are not known."""
    campaign = ensemble.run(ensemble.systems([meeting(1.0), meeting(4.0)]), tmp_path / "c", samples=11, **MERGING)
    assert [len(campaign.run(k).legs) for k in range(2)] == [2, 1]
    assert campaign.run(0).energy_lost()[-1].value > 1e-6
    table = campaign.summary
    assert (table["energy_error"] < 2e-15).all()  # round-off
    assert np.isnan(table["closest"][0])
    assert np.isfinite(table["closest"][1])
    assert list(table["closest_to"]) == ["", "a, b"]


def test_megno_is_nan_of_particles_that_merged_and_where_planets_merge(tmp_path):
    """Tangent vectors know no mergers: they would be those of bodies that pass through each other."""
    how = {**MERGING, "dt": 0.05, "megno": True, "integrator": "stormer-verlet", "check_step": False}
    merged = ensemble.run(ensemble.systems([meeting(1.0), meeting(4.0)]), tmp_path / "systems", **how)
    np.testing.assert_array_equal(np.isnan(merged.summary["megno"]), [True, False])
    planets = meeting(4.0).add(["falls", "far"], primary="star", a=[2.5, 3.0], e=[0.99, 0.0], M=3.0)
    lost = ensemble.run(ensemble.particles(planets, planets), tmp_path / "particles", **how)
    assert list(lost.summary["state"]) == ["lost", "survived"]
    np.testing.assert_array_equal(np.isnan(lost.summary["megno"]), [True, False])


def test_a_grid_of_systems_has_the_bits_of_a_list_of_them(tmp_path):
    options = {"duration": 5.0, "dt": 0.01, "integrator": "stormer-verlet", "samples": 4}
    speeds = np.linspace(0.7, 1.1, 5)
    campaign = ensemble.run(ensemble.grid(pair, speed=speeds), tmp_path / "c", block=2, progress=False, **options)
    runs, table = orbits.propagate([pair(speed) for speed in speeds], **options), campaign.summary
    for k, run in enumerate(runs):
        np.testing.assert_array_equal(campaign[k].q, run.q)
        np.testing.assert_allclose(table["e_max"][k, 1], run.elements(primary="A").e.value.max())
    np.testing.assert_array_equal(campaign.axes["speed"], speeds)
    assert campaign.map("energy_error").shape == (5,)


@pytest.mark.nightly
def test_a_killed_process_is_replaced_and_its_blocks_are_done_again(tmp_path):
    told: list[str] = []

    def kill() -> None:
        import multiprocessing

        while not (tmp_path / "c" / "index.jsonl").exists():
            time.sleep(0.01)
        os.kill(multiprocessing.active_children()[0].pid or 0, signal.SIGKILL)

    thread = threading.Thread(target=kill, daemon=True)
    thread.start()
    longer = {**OPTIONS, "duration": 2500 * u.yr}
    campaign = ensemble.run(belt(64), tmp_path / "c", block=16, workers=1, processes=True, say=told.append, **longer)
    thread.join()
    assert any("its worker was lost; it is done again" in line for line in told)
    assert campaign.bits == ensemble.run(belt(64), tmp_path / "whole", block=16, **longer).bits


def test_megno_of_a_member_that_was_stopped_is_that_of_its_end(tmp_path):
    """With the same steps and vectors, of a run of that length: on to the end of the campaign it differs by a tenth."""
    stop = orbits.events.FartherThan(1.9, "a", "b")
    how = {"integrator": "stormer-verlet", "dt": 0.05}
    campaign = ensemble.run(
        ensemble.systems([meeting(2.0)]), tmp_path / "c", duration=40.0, stop=stop, megno=True, progress=False, **how
    )
    (row,) = campaign.summary
    assert row["state"] == "stopped"
    alone = orbits.megno(meeting(2.0), duration=float(row["end"]), samples=2, **how)
    np.testing.assert_allclose(row["megno"], alone.massive.megno[-1], rtol=1e-12)


def test_the_method_of_rigid_members_is_by_default_that_of_propagate(tmp_path):
    q, v = [[0, 0, 0], [1, 0, 0]], [[0, 0, 0], [0, 1, 0]]
    bodies = orbits.System(["star", "stone"], [1, 0], q, v, units=orbits.DIMENSIONLESS)
    turning = bodies.with_rigid("stone", orbits.RigidBody(shape=(3e-3, 2e-3, 1e-3), attitude="star"))
    how = {"dt": 0.05, "duration": 5.0, "samples": 3, "progress": False}
    campaign = ensemble.run(ensemble.particles(bodies.remove("stone"), turning), tmp_path / "c", **how)
    run = orbits.propagate(turning, **how)
    np.testing.assert_array_equal(campaign["stone"].q, run["stone"].q)


def test_members_that_an_event_stopped_did_not_survive_and_are_no_failures(tmp_path):
    stop = orbits.events.FartherThan(1.5, "A", "B", then="stop")
    made = ensemble.grid(pair, speed=[0.9, 1.9])
    options = {"duration": 5.0, "dt": 0.01, "integrator": "gauss", "events": stop, "progress": False}
    campaign = ensemble.run(made, tmp_path / "c", **options)
    table = campaign.summary
    assert list(table["state"]) == ["survived", "stopped"]
    assert table["end"][1] < 5.0 == table["end"][0]
    assert "farther" in table["reason"][1]
    assert (campaign.progress.survivors, campaign.progress.members_failed) == (1, 0)


def test_events_that_name_a_member_are_sought_in_its_block_and_the_other_blocks_go_on(tmp_path):
    own = orbits.events.Pericentre("P30", "Sun"), orbits.events.CloserThan(2.0 * u.au, "p2", "Sun", then="stop")
    also = orbits.events.Pericentre("Jupiter", "Sun"), orbits.events.FartherThan(9 * u.au, "p35", "Sun")
    campaign = ensemble.run(belt(40), tmp_path / "c", block=9, events=own, stop=also[1], **OPTIONS)
    assert campaign.complete
    assert not campaign.failed
    run = orbits.propagate(system(40), events=own[:1], **OPTIONS)
    assert len(run.events) > 3
    assert campaign.run("p30").events.time.value.tolist() == run.events.time.value.tolist()
    assert not len(campaign.run("p10").events)
    stopped = [name for name, state in campaign.summary["name", "state"] if state == "stopped"]
    assert stopped == [f"p{k}" for k in range(9)]
    planets = ensemble.run(belt(20), tmp_path / "planets", block=9, events=also[0], **OPTIONS)
    assert [len(planets.run(k).events) for k in (0, 9, 18)] == [len(planets.run(0).events)] * 3


def test_an_event_of_two_members_of_different_blocks_is_refused_before_there_is_a_folder(tmp_path):
    event = orbits.events.CloseApproach("p2", "p30")
    with pytest.raises(InputError, match=r"CloseApproach of 'p2' and 'p30': .* block=31") as refused:
        ensemble.run(belt(40), tmp_path / "c", block=9, events=event, **OPTIONS)
    assert not (tmp_path / "c").exists(), refused
    assert ensemble.run(belt(40), tmp_path / "c", block=31, events=event, **OPTIONS).complete
