"""Generated modules on disk: processes and threads at once, folders that cannot be written, names that are code."""

import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
import sympy

import orbits
from orbits.kernels.compile import trusted_files
from orbits.lagrangians.symbolic import modules

q, v, k = sympy.symbols("q v k")

PROGRAM = """
import os, sys, time
from orbits.lagrangians.symbolic.modules import module
print("ready", flush=True)
sys.stdin.readline()
made = module("race", lambda: time.sleep(0.2) or "A = 1\\n")
print(made.A, os.stat(made.__file__).st_mtime_ns, os.stat(made.__file__).st_ino)
"""


@pytest.mark.nightly
def test_processes_that_make_one_module_at_the_same_time_share_one_file(tmp_path):
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    pipe = subprocess.PIPE
    all_ = [
        subprocess.Popen([sys.executable, "-c", PROGRAM], stdin=pipe, stdout=pipe, env=environment, text=True)
        for _ in range(3)
    ]
    for process in all_:
        assert process.stdout.readline() == "ready\n"
    for process in all_:
        process.stdin.write("go\n")
        process.stdin.flush()
    said = {process.communicate()[0] for process in all_}
    assert len(said) == 1  # one time stamp: with a second, the code that Numba kept would be stale
    assert said.pop().startswith("1 ")
    assert [path.name for path in tmp_path.glob("orbits/orbits_*")] == ["orbits_lagrangian_race.py"]


DAMAGED, GOOD = b"# damaged\nA = 3\n", modules._signed("A = 2\n")


def test_a_damaged_module_keeps_its_place_until_another_is_put_there(tmp_path, monkeypatch):
    """Removing it first could remove a good one that another process has just written."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    path = trusted_files.user_folder("lagrangians") / "orbits_lagrangian_place.py"
    path.write_bytes(DAMAGED)
    there = []
    with pytest.warns(orbits.errors.OrbitsWarning, match=r"place\.py is damaged"):
        assert modules.module("place", lambda: there.append(path.exists()) or "A = 1\n").A == 1
    assert there == [True]


@pytest.mark.parametrize("other", [Path.unlink, lambda path: path.write_bytes(GOOD)], ids=["removes it", "mends it"])
def test_a_damaged_module_that_another_process_deals_with_meanwhile_is_made_all_the_same(tmp_path, monkeypatch, other):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    path, read = trusted_files.user_folder("lagrangians") / "orbits_lagrangian_meanwhile.py", trusted_files.read
    path.write_bytes(DAMAGED)
    monkeypatch.setattr(trusted_files, "read", lambda path: (read(path), other(path))[0])
    with pytest.warns(orbits.errors.OrbitsWarning, match="damaged"):
        assert modules.module("meanwhile", lambda: "A = 2\n").A == 2
    del sys.modules["orbits_lagrangian_meanwhile"]
    assert path.read_bytes() == GOOD


def test_the_first_file_stays(tmp_path):
    path = tmp_path / "m.py"
    trusted_files.write(path, b"A = 1", replace=False)
    trusted_files.write(path, b"A = 2", replace=False)
    assert path.read_bytes() == b"A = 1"
    assert list(tmp_path.iterdir()) == [path]


def test_without_hard_links_a_file_is_whole_too(tmp_path, monkeypatch):
    def refuse(*_):
        raise OSError("no hard links here")

    monkeypatch.setattr(os, "link", refuse)
    trusted_files.write(tmp_path / "m.py", b"A = 1", replace=False)
    assert [path.read_text() for path in tmp_path.iterdir()] == ["A = 1"]


def test_threads_never_see_half_a_module(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    seen = []

    def use():
        made = modules.module("threads", lambda: "import time\ntime.sleep(0.2)\nA = 1\n")
        seen.append(getattr(made, "A", None))

    threads = [threading.Thread(target=use) for _ in range(3)]
    for thread in threads:
        thread.start()
        time.sleep(0.05)
    for thread in threads:
        thread.join()
    assert seen == [1, 1, 1]


def test_a_cache_that_cannot_be_written_is_replaced_by_a_private_folder(tmp_path, monkeypatch):
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert trusted_files.user_folder("lagrangians") == tmp_path / "orbits" / "lagrangians"
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "tmp"))
    monkeypatch.setattr(trusted_files, "temporary_folder", trusted_files.temporary_folder.__wrapped__)
    (tmp_path / "tmp").mkdir()
    assert trusted_files.user_folder("lagrangians").parent == tmp_path / "tmp"
    assert trusted_files.user_folder("lagrangians").stat().st_mode & 0o777 == 0o700


@pytest.mark.parametrize("text", ["a\\N", "{d}", "a/b", "Hénon ∂"])
def test_a_name_may_be_any_text(text):
    L = orbits.Lagrangian.from_sympy(v**2 / 2 - q**2, q=[q], v=[v], name=text)
    assert L.name == text
    assert L.dimension == 1


def test_four_coupled_pendulums_take_seconds():
    """Their determinant, simplified, took 57 s; this takes 1 s, mostly derivatives. No bound is asserted, only that it
    ends.
    """
    angles, rates = sympy.symbols("q:4"), sympy.symbols("w:4")
    kinetic = potential = x = y = 0
    for angle, rate in zip(angles, rates, strict=True):
        x, y = x + sympy.cos(angle) * rate, y + sympy.sin(angle) * rate
        kinetic, potential = kinetic + (x**2 + y**2) / 2, potential - sympy.cos(angle)
    L = orbits.Lagrangian.from_sympy(kinetic - potential, q=angles, v=rates, name="chain")
    assert L.dimension == 4
