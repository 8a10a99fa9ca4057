"""Campaigns on a Dask cluster with separate processes: the bits of threads, whatever happens to the workers."""

from __future__ import annotations

import gc
import os
import signal
import sys
import threading
import time

import numpy as np
import pytest
from astropy import units as u

from orbits import ensemble
from orbits.ensemble import dask_workers, running
from orbits.errors import InputError, Interrupted, MissingPackageError
from tests.ensemble.belts import OPTIONS, belt

distributed = pytest.importorskip("distributed")

LONG = {**OPTIONS, "duration": 1500 * u.yr, "block": 16}
"""Blocks of some tenths of a second, so that a worker that is killed is at work."""

QUIET = {"dashboard_address": None, "silence_logs": "CRITICAL"}
WORKERS = {"threads_per_worker": 1, "processes": True, **QUIET}


@pytest.fixture(scope="module")
def cluster():
    with distributed.LocalCluster(n_workers=1, **WORKERS) as made:
        yield made


@pytest.fixture(scope="module")
def client(cluster):
    with distributed.Client(cluster, set_as_default=False) as made:
        yield made


@pytest.fixture(scope="module")
def two_workers():
    """Give a client with two workers, each of which costs seconds to start."""
    with (
        distributed.LocalCluster(n_workers=2, **WORKERS) as cluster,
        distributed.Client(cluster, set_as_default=False) as made,
    ):
        yield made


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    return ensemble.run(belt(160), tmp_path_factory.mktemp("threads") / "c", **LONG)


def test_a_worker_gives_the_bits_of_threads_through_a_client_and_through_an_address(tmp_path, client):
    options = {**OPTIONS, "block": 16}
    threads = ensemble.run(belt(64), tmp_path / "threads", **options)
    one = ensemble.run(belt(64), tmp_path / "client", client=client, **options)
    assert one.bits == threads.bits
    np.testing.assert_array_equal(one["p50"].q, threads["p50"].q)
    address = client.scheduler.address
    other = ensemble.run(belt(64), tmp_path / "address", client=address, **options)
    assert other.bits == threads.bits
    assert client.status == "running"


@pytest.mark.nightly
def test_both_workers_take_part_and_one_killed_in_the_middle_changes_no_bit(tmp_path, two_workers, undisturbed):
    killed: list[int] = []

    def kill() -> None:
        index = tmp_path / "c" / "index.jsonl"
        while not index.exists():
            time.sleep(0.01)
        killed.append(sorted(two_workers.run(os.getpid).values())[0])
        os.kill(killed[0], signal.SIGKILL)

    thread = threading.Thread(target=kill, daemon=True)
    thread.start()
    campaign = ensemble.run(belt(160), tmp_path / "c", client=two_workers, **LONG)
    thread.join()
    assert killed
    assert len({block.worker for block in campaign.blocks}) >= 2
    assert campaign.bits == undisturbed.bits
    assert not campaign.failed


@pytest.mark.nightly
def test_a_campaign_on_workers_that_was_stopped_goes_on_to_the_same_bits(tmp_path, two_workers, undisturbed):
    def send() -> None:
        index = tmp_path / "c" / "index.jsonl"
        while not index.exists():
            time.sleep(0.01)
        os.kill(os.getpid(), signal.SIGTERM)

    thread = threading.Thread(target=send, daemon=True)
    thread.start()
    with pytest.raises(Interrupted, match="stopped by SIGTERM") as raised:
        ensemble.run(belt(160), tmp_path / "c", client=two_workers, **LONG)
    thread.join()
    assert 0 < raised.value.trajectory.progress.done < 10
    campaign = ensemble.run(belt(160), tmp_path / "c", client=two_workers, **LONG)
    assert campaign.bits == undisturbed.bits


def test_functions_of_a_session_are_sent_to_the_workers_of_a_cluster(tmp_path, cluster):
    from orbits import DIMENSIONLESS, System

    def pair(e):
        v = [0, ((1 + e) / 2) ** 0.5, 0]
        return System(["A", "B"], [1, 0], [[0, 0, 0], [2, 0, 0]], [[0, 0, 0], v], units=DIMENSIONLESS)

    grid = ensemble.grid(pair, e=[0.0, 0.1, 0.2])
    options = {"duration": 3.0, "dt": 0.1, "progress": False, "check_step": False}
    campaign = ensemble.run(grid, tmp_path / "c", client=cluster, **options)
    assert campaign.bits == ensemble.run(grid, tmp_path / "threads", **options).bits


def test_a_cluster_that_is_not_there_is_said_at_once(tmp_path, monkeypatch):
    monkeypatch.setattr(dask_workers, "PATIENCE", 0.5)
    begun = time.perf_counter()
    with pytest.raises(InputError, match=r"no Dask scheduler answers at tcp://127.0.0.1:1 .*'dask scheduler'"):
        ensemble.run(belt(20), tmp_path / "c", client="tcp://127.0.0.1:1", **OPTIONS)
    assert time.perf_counter() - begun < 10.0
    with pytest.raises(InputError, match="'not an address'"):
        ensemble.run(belt(20), tmp_path / "c", client="not an address", **OPTIONS)
    with pytest.raises(InputError, match=r"client is 3; expected a distributed\.Client"):
        ensemble.run(belt(20), tmp_path / "c", client=3, **OPTIONS)


def test_a_client_that_does_not_connect_is_closed_at_once(tmp_path):
    """One that is left to the garbage collector can wait forever for a lock of whatever that interrupts."""
    with pytest.raises(InputError, match="'not an address'") as refused:
        ensemble.run(belt(20), tmp_path / "c", client="not an address", **OPTIONS)
    left = [one for one in gc.get_objects() if type(one) is distributed.Client and one.status != "running"]
    assert left, refused  # which keeps it until here
    assert all(one.status == "closed" for one in left)


def test_a_cluster_without_workers_is_said(tmp_path, monkeypatch):
    monkeypatch.setattr(dask_workers, "ARRIVAL", 0.2)
    with (
        distributed.LocalCluster(n_workers=0, **QUIET) as empty,
        pytest.raises(InputError, match=r"has no workers; start some: dask worker tcp://"),
    ):
        ensemble.run(belt(20), tmp_path / "c", client=empty.scheduler_address, **OPTIONS)


def test_workers_of_other_versions_are_refused_with_both(tmp_path, client, monkeypatch):
    """Workers whose answer has other versions."""
    here = running.provenance()
    there = dask_workers.QUESTION.replace("'host'", "'orbits': '0.0.1', 'numba': '0.1', 'host'")
    monkeypatch.setattr(dask_workers, "QUESTION", there)
    with pytest.raises(InputError) as raised:
        ensemble.run(belt(20), tmp_path / "c", client=client, **OPTIONS)
    told = str(raised.value)
    assert f"has orbits 0.0.1, this process {here['orbits']}" in told
    assert f"has numba 0.1, this process {here['numba']}" in told


def test_a_worker_that_cannot_load_the_package_is_refused(tmp_path, client, monkeypatch):
    monkeypatch.setattr(dask_workers, "QUESTION", "__import__('no_such_package')")
    with pytest.raises(InputError, match=r"cannot load orbits \(ModuleNotFoundError: No module named 'no_such_pack"):
        ensemble.run(belt(20), tmp_path / "c", client=client, **OPTIONS)


def test_without_dask_the_message_says_how_it_is_installed(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(MissingPackageError, match=r"pip install 'orbits\[distributed\]'"):
        ensemble.run(belt(20), tmp_path / "c", client="tcp://127.0.0.1:1", **OPTIONS)
    assert not (tmp_path / "c").exists()


@pytest.mark.slow
def test_a_belt_of_100_000_with_a_worker_killed_and_a_stop_has_the_bits_of_the_undisturbed_one(tmp_path):
    """A minute or two: through Dask undisturbed, with a worker killed by SIGKILL, and stopped and resumed."""
    members = belt(100_000, outermost=4.5)
    options = {**OPTIONS, "samples": 2, "block": 2048}
    with (
        distributed.LocalCluster(n_workers=2, **WORKERS) as cluster,
        distributed.Client(cluster, set_as_default=False) as client,
    ):
        undisturbed = ensemble.run(members, tmp_path / "undisturbed", client=client, **options)

        def when(folder, blocks, act):
            index = tmp_path / folder / "index.jsonl"
            while not index.exists() or index.read_bytes().count(b"\n") < blocks:
                time.sleep(0.01)
            act()

        def kill():
            os.kill(sorted(client.run(os.getpid).values())[0], signal.SIGKILL)

        threading.Thread(target=when, args=("killed", 8, kill), daemon=True).start()
        killed = ensemble.run(members, tmp_path / "killed", client=client, **options)
        assert killed.bits == undisturbed.bits

        stop = (lambda: os.kill(os.getpid(), signal.SIGINT),)
        threading.Thread(target=when, args=("stopped", 8, *stop), daemon=True).start()
        with pytest.raises(Interrupted):
            ensemble.run(members, tmp_path / "stopped", client=client, **options)
        stopped = ensemble.run(members, tmp_path / "stopped", client=client, **options)
        assert stopped.bits == undisturbed.bits
