"""The disk cache: hit across processes, and stale as a whole after an edit in any kernel file."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import orbits
from orbits.kernels.compile import kernel, source_stamp

PROGRAM = """
import numpy as np
from orbits.integrators.marcher import Marcher
from orbits.integrators.stormer_verlet import StormerVerlet
from orbits.lagrangians.newtonian import newtonian, parameters
q, v = np.array([[0.0, 0, 0], [1.0, 0, 0]]), np.array([[0.0, 0, 0], [0, 1.0, 0]])
run = Marcher(newtonian, StormerVerlet(), parameters(np.array([1.0, 1e-3])), np.array([True, True]), q, v, 0.01)
run.advance(10)
print(float(run.state()[0][1, 0]).hex())
hits = StormerVerlet.advance.stats.cache_hits
print(sum(hits.values()))
"""


def run(folder):
    environment = {**os.environ, "PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"}
    environment.pop("NUMBA_CACHE_DIR", None)
    out = subprocess.run(
        [sys.executable, "-c", PROGRAM], cwd=folder, env=environment, capture_output=True, text=True, check=True
    )
    digits, hits = out.stdout.split()
    return digits, int(hits)


def test_the_cache_is_hit_and_an_edit_in_another_kernel_file_is_seen(tmp_path):
    package = tmp_path / "orbits"
    shutil.copytree(Path(orbits.__file__).parent, package, ignore=shutil.ignore_patterns("__pycache__"))
    before, cold = run(tmp_path)
    again, warm = run(tmp_path)
    assert again == before
    assert (cold, warm) == (0, 1)
    gravity = package / "kernels" / "gravity.py"
    text = gravity.read_text()
    edited = text.replace("w = rsqrt_cubed(r2) * strength[1 + j]", "w = 1.01 * rsqrt_cubed(r2) * strength[1 + j]")
    assert edited != text
    gravity.write_text(edited)
    after, hits = run(tmp_path)
    assert hits == 0
    assert abs(float.fromhex(after) - float.fromhex(before)) > 1e-6  # 1 % more pull for 0.1: 5e-5


def test_the_stamp_is_part_of_every_cache_entry():
    @kernel
    def nothing():
        return 0.0

    assert nothing._cache._cache_file._version.endswith(source_stamp())


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
