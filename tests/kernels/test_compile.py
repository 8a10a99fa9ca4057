"""The disk cache: used across processes, and completely stale after a change of any kernel file."""

import importlib.util
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import orbits
from orbits.kernels.compile import kernel
from orbits.kernels.compile.source_hash import source_stamp

PROGRAM = """
import numpy as np
from orbits.lagrangians.newtonian import value
q = np.array([0.0, 1.0, 0.0, 0.0, 0.0, 0.0])
print(value(np.array([0.0, 1.0, 1e-3]), 0.0, q, np.zeros(6)).hex())
print(sum(value.entry.stats.cache_hits.values()))
"""


def run(folder):
    environment = {**os.environ, "PYTHONPATH": str(folder)}
    for name in ("NUMBA_CACHE_DIR", "PYTHONDONTWRITEBYTECODE"):
        environment.pop(name, None)
    out = subprocess.run(
        [sys.executable, "-c", PROGRAM], cwd=folder, env=environment, capture_output=True, text=True, check=True
    )
    digits, hits = out.stdout.split()
    return digits, int(hits)


def test_the_cache_is_hit_after_an_edit_of_prose_and_an_edit_of_code_in_another_file_is_seen(tmp_path):
    package = tmp_path / "orbits"
    shutil.copytree(Path(orbits.__file__).parent, package, ignore=shutil.ignore_patterns("__pycache__"))
    before, hits = run(tmp_path)
    assert hits == 0
    gravity = package / "kernels" / "gravity" / "pair_sums.py"
    for path in (gravity, package / "lagrangians" / "newtonian.py"):  # the file of the kernel itself as well
        path.write_text(path.read_text().replace('"""', '"""Prose on\n\nthree lines. ', 1).replace("Return", "Give"))
    assert run(tmp_path) == (before, 1), "prose leaves compiled code as it is, in another process too"
    text = gravity.read_text()
    edited = text.replace("value = value - strength[1 + i]", "value = value - 1.01 * strength[1 + i]")
    assert edited != text
    gravity.write_text(edited)
    after, hits = run(tmp_path)
    assert hits == 0
    assert float.fromhex(after) == pytest.approx(1.01 * float.fromhex(before), rel=1e-15)


ALIKE = """
from orbits import kernel

@kernel
def scaled(x):
    return 2.0 * x

double = scaled

@kernel
def scaled(x):
    '''Of the same name and the same bytecode.'''
    return 3.0 * x

def times(factor):
    @kernel
    def scaled(x):
        return factor * x
    return scaled
"""


def test_kernels_of_one_name_in_one_file_are_not_confused(tmp_path, monkeypatch):
    """Names of cache files have no line numbers, so that prose may move kernels: entries are identified by their
    code.
    """
    monkeypatch.setattr("numba.core.config.CACHE_DIR", "")
    (tmp_path / "alike.py").write_text(ALIKE)
    hits, kept = [], []
    for _ in range(2):
        spec = importlib.util.spec_from_file_location("alike", tmp_path / "alike.py")
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        all_ = [module.double, module.scaled, module.times(5.0), module.times(7.0)]
        assert [f(1.0) for f in all_] == [2.0, 3.0, 5.0, 7.0]
        kept += all_  # Numba finds again what captures something while the first of its kind lives
        hits.append([sum(f.entry.stats.cache_hits.values()) for f in all_])
    assert hits == [[0, 0, 0, 0], [1, 1, 1, 1]]


RECORD = """
from typing import NamedTuple
from orbits.kernels.compile import kernel

class Pair(NamedTuple):
    near: float
    far: float

@kernel
def nearer(pair):
    return pair.near
"""


def test_a_record_whose_fields_change_places_is_not_taken_for_the_one_before(tmp_path, monkeypatch):
    """Compiled code finds fields by their places, and the record may stand in a file that no kernel imports."""
    monkeypatch.setattr("numba.core.config.CACHE_DIR", "")
    file = tmp_path / "record.py"
    found = []
    for text in (RECORD, RECORD.replace("near: float\n    far", "far: float\n    near")):
        file.write_text(text)
        os.utime(file, (0, 0))  # as if the kernel's own file had not changed
        spec = importlib.util.spec_from_file_location("record", file)
        module = importlib.util.module_from_spec(spec)
        monkeypatch.setitem(sys.modules, "record", module)
        spec.loader.exec_module(module)
        found.append(module.nearer(module.Pair(near=1.0, far=2.0)))
    assert found == [1.0, 1.0]


def test_the_stamp_is_part_of_every_cache_entry():
    @kernel
    def nothing():
        return 0.0

    for entries in (nothing.entry.cache, nothing.callee.cache):
        assert entries._cache_file._version.endswith(source_stamp())


def test_products_are_fused_unless_a_kernel_is_exact():
    @kernel
    def fused(a):
        return a * a - 1.0

    @kernel(exact=True)
    def exact(a):
        return a * a - 1.0

    a = 1.0 + 2.0**-30
    assert exact(a) == 2.0**-29
    assert fused(a) - 2.0**-29 in (0.0, 2.0**-60)  # 0 where the processor has no fused multiply-add
