"""Creating, reopening and extending archives: refusals, reserved space, and survival of interruptions."""

from __future__ import annotations

import errno
import fcntl
import os
import resource
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from orbits.archive import Archive, ArchiveWriter, extended
from orbits.archive.creation import partial_path
from orbits.archive.storage import Storage
from orbits.errors import ArchiveError, InputError, StorageError
from orbits.time_grid import TimeGrid

from . import runs


def leftovers(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_creating_takes_all_of_its_room_on_the_device_at_once(tmp_path):
    path = tmp_path / "run.h5"
    with runs.create(path, 2000, bodies=50):
        status = path.stat()
        assert status.st_size > 2000 * 50 * 48
        assert status.st_blocks * 512 >= status.st_size
    assert leftovers(tmp_path) == ["run.h5"]


def test_an_existing_file_is_refused_and_left_alone(tmp_path):
    path = tmp_path / "run.h5"
    path.write_text("precious")
    with pytest.raises(ArchiveError, match=r"run\.h5 exists already; give overwrite=True"):
        runs.create(path, 3)
    assert path.read_text() == "precious"
    assert leftovers(tmp_path) == ["run.h5"]


def test_overwriting_replaces_the_file_in_one_step(tmp_path):
    path = runs.finished(tmp_path / "run.h5", 4)
    old = Archive.open(path)
    runs.finished(path, 6, overwrite=True)
    runs.assert_whole(path, 6)
    # Who had the old one open still reads the old one.
    assert np.array_equal(old.q, runs.samples(4)[0])
    assert leftovers(tmp_path) == ["run.h5"]


def test_the_old_file_survives_an_overwriting_that_fails(tmp_path, monkeypatch):
    path = runs.finished(tmp_path / "run.h5")
    monkeypatch.setattr(Storage, "reserve", lambda self: (_ for _ in ()).throw(OSError(errno.ENOSPC, "full")))
    with pytest.raises(StorageError, match="are free in"):
        runs.create(path, 4, overwrite=True)
    runs.assert_whole(path)
    assert leftovers(tmp_path) == ["run.h5"]


def test_a_link_is_followed_and_stays_a_link(tmp_path):
    (tmp_path / "disk").mkdir()
    link = tmp_path / "run.h5"
    link.symlink_to(tmp_path / "disk" / "real.h5")
    runs.finished(link)
    runs.finished(link, overwrite=True)
    assert link.is_symlink()
    runs.assert_whole(tmp_path / "disk" / "real.h5")


@pytest.mark.parametrize(
    ("name", "words"),
    [
        (".", "is a folder; give a file in it"),
        ("no/such/run.h5", r"the folder .*no/such does not exist; make it"),
        ("file.txt/run.h5", r"the folder .*file.txt does not exist"),
        ("x" * 300 + ".h5", "File name too long"),
        ("a\0b", "is not a path"),
        ("/dev/null", "is not a file, so it cannot be replaced"),
        ("/proc/run.h5", "cannot be written|does not exist"),
    ],
)
def test_a_path_where_no_file_can_be_is_refused_in_words(name, words, tmp_path):
    (tmp_path / "file.txt").touch()
    with pytest.raises(ArchiveError, match=words) as caught:
        runs.create(tmp_path / name, 3, overwrite=True)
    assert caught.value.exit_code == 2
    assert leftovers(tmp_path) == ["file.txt"]


@pytest.mark.skipif(os.geteuid() == 0, reason="nothing is forbidden to root")
def test_a_folder_without_permission_is_refused_in_words(tmp_path):
    tmp_path.chmod(0o555)
    try:
        with pytest.raises(ArchiveError, match=r"cannot be written \(Permission denied\)"):
            runs.create(tmp_path / "run.h5", 3)
    finally:
        tmp_path.chmod(0o755)


@pytest.mark.parametrize("number", [errno.EACCES, errno.EROFS])
def test_a_device_without_permission_is_refused_in_words(tmp_path, monkeypatch, number):
    def refuse(*arguments: object) -> int:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(os, "open", refuse)
    with pytest.raises(ArchiveError, match=f"cannot be written .{os.strerror(number)}"):
        runs.create(tmp_path / "run.h5", 3)


def test_a_run_that_no_disk_can_hold_says_what_it_needs_and_what_is_free(tmp_path):
    system = runs.system(1000)
    times = np.broadcast_to(np.arange(2.0), (2,)).copy()
    times = np.linspace(0, 1, 10**6)
    too_large = {name: np.broadcast_to(array, array.shape) for name, array in runs.checkpoint(0, 1000).items()}
    too_large["memory"] = np.broadcast_to(0.0, (10**9, 10**6))
    with pytest.raises(StorageError, match=r"needs 16\.0 PB, but .* are free in .*Take fewer samples") as caught:
        ArchiveWriter.create(
            tmp_path / "run.h5", system=system, integrator=runs.INTEGRATOR, grid=TimeGrid(1.0, times),
            checkpoint=too_large, provenance={},
        )  # fmt: skip
    assert caught.value.exit_code == 1
    assert leftovers(tmp_path) == []


def test_a_device_that_turns_out_full_leaves_nothing_behind(tmp_path):
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (2**20, before[1]))
    try:
        words = r"run\.h5 needs 4\.9 MB, but this process may write no file larger than 1\.0 MB.*ulimit"
        with pytest.raises(StorageError, match=words):
            runs.create(tmp_path / "run.h5", 1000, bodies=100)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert leftovers(tmp_path) == []


def test_messages_name_the_file_as_it_is_called_once_it_is_whole(tmp_path):
    for overwrite in (False, True):
        writer = runs.create(tmp_path / "run.h5", 3, overwrite=overwrite)
        os.truncate(tmp_path / "run.h5", 100)
        with pytest.raises(ArchiveError, match=r"/run\.h5 is truncated"):
            writer._storage.read(100, 1)
        writer.close()
        with pytest.raises(ArchiveError, match=r"/run\.h5 was closed"):
            writer._storage.read(0, 1)


def test_an_interrupt_while_creating_leaves_nothing_behind(tmp_path, monkeypatch):
    def interrupt(self: Storage) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Storage, "reserve", interrupt)
    with pytest.raises(KeyboardInterrupt):
        runs.create(tmp_path / "run.h5", 3)
    assert leftovers(tmp_path) == []


def test_room_is_taken_where_the_system_cannot_reserve_it(tmp_path, monkeypatch):
    monkeypatch.delattr(os, "posix_fallocate")
    path = runs.finished(tmp_path / "run.h5", 400, 100, 50)
    runs.assert_whole(path, 400, 50)
    assert path.stat().st_blocks * 512 >= path.stat().st_size


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EIO])
@pytest.mark.parametrize("operation", ["_write_some", "sync"])
def test_a_device_that_fails_while_running_keeps_what_was_committed(tmp_path, monkeypatch, number, operation):
    path, (q, v) = tmp_path / "run.h5", runs.samples(6)
    with runs.create(path, 6) as writer:
        writer.commit(q[:2], v[:2], runs.checkpoint(1))
        with monkeypatch.context() as patch:
            patch.setattr(Storage, operation, lambda *a: (_ for _ in ()).throw(OSError(number, os.strerror(number))))
            with pytest.raises(StorageError, match=rf"{os.strerror(number)}.*its 2 committed samples stay readable"):
                writer.commit(q[2:4], v[2:4], runs.checkpoint(2))
        assert writer.committed == 2
        with pytest.raises(ArchiveError, match=r"did not finish.*reopen"):
            writer.commit(q[2:4], v[2:4], runs.checkpoint(2))
    with Archive.open(path) as archive:
        assert np.array_equal(archive.q, q[:2])
    with ArchiveWriter.reopen(path) as writer:
        writer.commit(q[2:], v[2:], runs.checkpoint(2))
    runs.assert_whole(path)


def in_a_child(use):
    """Return the message of the error that something raises in another process."""
    receiver, sender = os.pipe()
    child = os.fork()
    if not child:
        try:
            use()
        except ArchiveError as error:
            os.write(sender, str(error).encode())
        finally:
            os._exit(0)
    os.close(sender)
    os.waitpid(child, 0)
    with os.fdopen(receiver) as said:
        return said.read()


def test_two_writers_exclude_each_other_and_readers_do_not(tmp_path):
    path = tmp_path / "run.h5"
    (q, v), busy = runs.samples(6), "is being written by another run"
    with runs.create(path, 6) as writer:
        writer.commit(q[:2], v[:2], runs.checkpoint(1))
        for use in (ArchiveWriter.reopen, Archive.claim, lambda p: runs.create(p, 3, overwrite=True)):
            with pytest.raises(ArchiveError, match=busy):
                use(path)
        assert busy in in_a_child(lambda: ArchiveWriter.reopen(path))
        # A reader that comes and goes does not take the lock along.
        Archive.open(path).close()
        with pytest.raises(ArchiveError, match=busy):
            ArchiveWriter.reopen(path)
        writer.commit(q[2:], v[2:], runs.checkpoint(2))
    runs.assert_whole(path)
    ArchiveWriter.reopen(path).close()


@pytest.mark.skipif(not hasattr(fcntl, "F_OFD_SETLK"), reason="our lock is HDF5's own kind of lock on this system")
def test_plain_h5py_reads_a_run_that_is_under_way(tmp_path):
    path, (q, v) = tmp_path / "run.h5", runs.samples(6)
    with runs.create(path, 6) as writer:
        writer.commit(q[:2], v[:2], runs.checkpoint(1))
        code = f"import h5py; print(h5py.File({str(path)!r})['commits'][:]['samples'])"
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
        assert done.stdout == "[0 2]\n"


def test_what_a_killed_run_left_while_creating_is_in_nobodys_way(tmp_path):
    path = tmp_path / "run.h5"
    partial_path(path).write_bytes(b"half a file")
    runs.finished(path)
    assert leftovers(tmp_path) == ["run.h5"]


@pytest.mark.parametrize("target", ["nowhere", "precious"])
def test_a_link_where_the_file_is_made_is_taken_away_and_not_followed(tmp_path, target):
    path = tmp_path / "run.h5"
    (tmp_path / "precious").write_text("precious")
    partial_path(path).symlink_to(tmp_path / target)
    runs.finished(path)
    runs.assert_whole(path)
    assert leftovers(tmp_path) == ["precious", "run.h5"]
    assert (tmp_path / "precious").read_text() == "precious"


@pytest.mark.parametrize("make", [Path.mkdir, os.mkfifo])
def test_what_is_no_file_where_the_file_is_made_is_named(tmp_path, make):
    path = tmp_path / "run.h5"
    make(partial_path(path))
    with pytest.raises(ArchiveError, match=r"\.run\.h5\.partial is in the way: .*Remove it"):
        runs.create(path, 3)
    assert leftovers(tmp_path) == [".run.h5.partial"]


@pytest.mark.parametrize("mode", [0o600, 0o640, 0o664])
def test_a_file_keeps_its_permissions_when_it_is_overwritten_or_extended(tmp_path, mode):
    path = runs.finished(tmp_path / "run.h5")
    path.chmod(mode)
    runs.finished(path, 4, overwrite=True)
    assert path.stat().st_mode & 0o777 == mode
    extended(Archive.claim(path), TimeGrid(0.25, np.arange(9) * 0.5)).close()
    assert path.stat().st_mode & 0o777 == mode


def test_the_unfinished_copy_of_a_private_file_is_never_open_to_others(tmp_path, monkeypatch):
    path = runs.finished(tmp_path / "run.h5")
    path.chmod(0o600)
    modes = []

    def look(name: str) -> None:
        real = getattr(Storage, name)

        def looked(self: Storage, *arguments: object) -> object:
            modes.append(os.fstat(self.fileno()).st_mode & 0o777)
            return real(self, *arguments)

        monkeypatch.setattr(Storage, name, looked)

    for name in ("lock", "become", "resize", "write", "sync"):
        look(name)
    runs.finished(path, overwrite=True)
    assert set(modes) == {0o600}


def test_a_new_file_has_the_permissions_that_the_user_gives_to_new_files(tmp_path):
    before = os.umask(0o027)
    try:
        path = runs.finished(tmp_path / "run.h5")
    finally:
        os.umask(before)
    assert path.stat().st_mode & 0o777 == 0o640


def test_the_start_is_committed_before_the_file_takes_its_name(tmp_path, monkeypatch):
    path = tmp_path / "run.h5"
    real = os.link

    def look(partial: Path, target: Path) -> None:
        with Archive.open(partial) as archive:
            assert (archive.committed, archive.complete) == (0, False)
            assert runs.same_checkpoint(archive.checkpoint(), runs.checkpoint(0))
        real(partial, target)

    monkeypatch.setattr(os, "link", look)
    runs.create(path, 6).close()
    q, v = runs.samples(6)
    with ArchiveWriter.reopen(path) as writer:
        writer.commit(q, v, runs.checkpoint(1))
    runs.assert_whole(path)


def test_a_second_name_of_an_archive_that_creating_left_is_never_written_to(tmp_path):
    # A run killed between giving the file its name and taking the first name away.
    path, kept = tmp_path / "run.h5", tmp_path / "kept.h5"
    os.link(runs.finished(path), partial_path(path))
    path.rename(kept)
    runs.finished(path, 4)
    runs.assert_whole(kept)
    runs.assert_whole(path, 4)


def test_two_runs_cannot_create_the_same_file(tmp_path, monkeypatch):
    path = tmp_path / "run.h5"
    first = Storage(partial_path(path), os.O_RDWR | os.O_CREAT)
    assert first.lock()
    with pytest.raises(ArchiveError, match="is being written by another run"):
        runs.create(path, 3)
    first.close()
    sync = Storage.sync

    def other_was_faster(self: Storage) -> None:
        path.write_text("theirs")
        sync(self)

    monkeypatch.setattr(Storage, "sync", other_was_faster)
    with pytest.raises(ArchiveError, match="exists already"):
        runs.create(path, 3)
    assert path.read_text() == "theirs"
    assert leftovers(tmp_path) == ["run.h5"]


@pytest.mark.parametrize("links", [True, False])
def test_creating_works_where_there_are_no_links(tmp_path, monkeypatch, links):
    def no_links(*paths: object) -> None:
        raise PermissionError(errno.EPERM, "no links here")

    if not links:
        monkeypatch.setattr(os, "link", no_links)
    runs.finished(tmp_path / "run.h5")
    runs.assert_whole(tmp_path / "run.h5")
    assert leftovers(tmp_path) == ["run.h5"]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"times": []}, r"times have shape \(0,\)"),
        ({"times": [0.0, float("nan")]}, "all finite"),
        ({"times": [[0.0]]}, r"times have shape \(1, 1\)"),
        ({"provenance": {"where": "a\0b"}}, "provenance@where holds .* NUL"),
        ({"provenance": {"where": "\ud800"}}, "not valid Unicode"),
        ({"integrator": {"name": "gauss", "parameters": {"f": object()}}}, "which JSON cannot hold"),
        ({"integrator": {"name": "gauss", "parameters": {"f": float("nan")}}}, "which JSON cannot hold"),
    ],
)
def test_what_no_file_can_hold_is_refused_in_words(change, words, tmp_path):
    with pytest.raises(InputError, match=words):
        runs.create(tmp_path / "run.h5", change.pop("times", 3), **change)
    assert leftovers(tmp_path) == []


@pytest.mark.parametrize("bad", [np.array("text"), np.array([1j]), [1.0], np.array([None])])
def test_a_checkpoint_that_is_no_array_of_numbers_is_refused(bad, tmp_path):
    with pytest.raises(ArchiveError, match="checkpoint 'x' is"):
        ArchiveWriter.create(
            tmp_path / "run.h5", system=runs.system(), integrator=runs.INTEGRATOR, grid=TimeGrid(1.0, [0.0]),
            checkpoint={"x": bad}, provenance={},
        )  # fmt: skip


def test_a_commit_that_does_not_fit_is_refused_and_harms_nothing(tmp_path):
    path, (q, v) = tmp_path / "run.h5", runs.samples(6)
    good = runs.checkpoint(1)
    wrong_checkpoints = [
        {**good, "more": np.zeros(1)},
        {name: array for name, array in good.items() if name != "counts"},
        {**good, "memory": np.zeros((3, 3))},
        {**good, "counts": good["counts"].astype(np.int32)},
    ]
    with runs.create(path, 6) as writer:
        writer.commit(q[:4], v[:4], good)
        for checkpoint in wrong_checkpoints:
            with pytest.raises(ArchiveError, match="checkpoint"):
                writer.commit(q[4:], v[4:], checkpoint)
        for wrong_q, wrong_v in ((q[4:5], v[4:6]), (q[4:, :2], v[4:, :2]), (q[4], v[4])):
            with pytest.raises(ArchiveError, match="has shape"):
                writer.commit(wrong_q, wrong_v, good)
        with pytest.raises(ArchiveError, match=r"3 samples are too many: .* has room for 2 more"):
            writer.commit(q[:3], v[:3], good)
        writer.commit(q[4:], v[4:], good)
    runs.assert_whole(path)
    with pytest.raises(ArchiveError, match=r"was closed"):
        writer.commit(q[:0], v[:0], good)


def test_reopening_goes_on_after_the_last_commit(tmp_path):
    path, (q, v) = tmp_path / "run.h5", runs.samples(6)
    with runs.create(path, 6) as writer:
        writer.commit(q[:1], v[:1], runs.checkpoint(1))
    for done in range(1, 6):
        with ArchiveWriter.reopen(path) as writer:
            assert writer.committed == done
            writer.commit(q[done : done + 1], v[done : done + 1], runs.checkpoint(done + 1))
        with Archive.open(path) as archive:
            assert archive.complete == (done == 5)
            assert runs.same_checkpoint(archive.checkpoint(), runs.checkpoint(done + 1))
    runs.assert_whole(path)


@pytest.mark.parametrize("done", [0, 3, 6])
def test_extending_keeps_all_and_makes_room_for_more(tmp_path, done):
    path, (q, v) = tmp_path / "run.h5", runs.samples(9)
    with runs.create(path, 6) as writer:
        writer.commit(q[:done], v[:done], runs.checkpoint(5))
    with Archive.open(path) as archive:
        before = (archive.system, archive.integrator, archive.dt, dict(archive.provenance))
    times = np.concatenate([np.arange(6) * 0.5, [7.0, 8.0, 9.0]])
    with extended(Archive.claim(path), TimeGrid(0.25, times)) as writer:
        assert (writer.committed, writer.capacity) == (done, 9)
        with Archive.open(path) as archive:
            assert (archive.system, archive.integrator, archive.dt, dict(archive.provenance)) == before
            assert np.array_equal(archive.times, times)
            assert np.array_equal(archive.q, q[:done])
            assert runs.same_checkpoint(archive.checkpoint(), runs.checkpoint(5))
        with pytest.raises(ArchiveError, match="is being written"):
            ArchiveWriter.reopen(path)
        writer.commit(q[done:], v[done:], runs.checkpoint(6))
    runs.assert_whole(path, 9)
    assert leftovers(tmp_path) == ["run.h5"]


def test_extending_copies_block_by_block(tmp_path, monkeypatch):
    path = runs.finished(tmp_path / "run.h5", 6, 6)
    monkeypatch.setattr("orbits.archive.writer.BLOCK", 2 * 48 * 3)
    with extended(Archive.claim(path), TimeGrid(0.25, np.arange(6) * 0.5)):
        pass
    runs.assert_whole(path)
    with Archive.open(path) as archive:
        assert archive.chunks["samples"].tolist() == [2, 4, 6]


@pytest.mark.parametrize(
    ("times", "h"),
    [
        ([0.0, 0.5], 0.25),
        ([0.0, 0.5, 1.0, 1.5, 2.0, 2.6, 3.0], 0.25),
        (np.arange(9) * 0.5, 0.125),
    ],
)
def test_extending_cannot_change_what_is_there(tmp_path, times, h):
    path = runs.finished(tmp_path / "run.h5")
    with pytest.raises(ArchiveError, match="have to come first, as they are"):
        extended(Archive.claim(path), TimeGrid(h, times))
    runs.assert_whole(path)


def test_extending_refuses_damage_and_leaves_the_file(tmp_path):
    path = runs.finished(tmp_path / "run.h5")
    data = bytearray(path.read_bytes())
    data[data.index(runs.samples(6)[0][0].tobytes())] ^= 1
    path.write_bytes(data)
    with pytest.raises(ArchiveError, match="samples 0 to 1 do not hold their checksum"):
        extended(Archive.claim(path), TimeGrid(0.25, np.arange(9) * 0.5))
    assert path.read_bytes() == data
    assert leftovers(tmp_path) == ["run.h5"]
