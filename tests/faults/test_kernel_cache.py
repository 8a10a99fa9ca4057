"""Damage of the files in which compiled kernels are kept, and files planted there by others."""

import importlib.util
import os
import pickle
import py_compile
import shutil
import subprocess
import sys
import time
import warnings
from pathlib import Path

import pytest

from orbits.errors import OrbitsWarning
from orbits.kernels.compile import trusted_files
from orbits.kernels.compile.disk_cache import checksum
from orbits.lagrangians.symbolic import modules

KERNELS = """
import orbits

@orbits.kernel
def horner(x, n):
    total = 0.0
    for k in range(n):
        total = total * x + 1.0 / (k + 1)
    return total

@orbits.kernel
def twice(x, n):
    return horner(x, n) + horner(-x, n)
"""

ATTACK = """
import random, sys, warnings
from pathlib import Path

folder, seed, rounds = Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])
warnings.simplefilter("ignore")
sys.path.insert(0, str(folder))
import importlib
import kernels
right = kernels.horner(0.25, 30), kernels.twice(0.25, 30)
kinds = random.Random(seed)
for _ in range(rounds):
    # One that was emptied stays so as long as no process needs it: what `twice` calls is in the file of `twice` too.
    path = kinds.choice(sorted(p for p in folder.rglob("kernels.*.nb?") if p.stat().st_size))
    data = bytearray(path.read_bytes())
    place = kinds.randrange(len(data))
    kind = kinds.choice(["cut", "emptied", "zeroed", "zeroed from", "flipped"])
    if kind == "cut":
        data = data[:place]
    elif kind == "emptied":
        data = b""
    elif kind == "zeroed":
        data = bytes(len(data))
    elif kind == "zeroed from":
        data[place:] = bytes(len(data) - place)
    else:
        data[place] ^= 1 << kinds.randrange(8)
    path.write_bytes(data)
    print(kind, place, path.name, flush=True)
    importlib.reload(kernels)  # dispatchers of which nothing is compiled yet, as in a new process
    if (kernels.horner(0.25, 30), kernels.twice(0.25, 30)) != right:
        sys.exit("another number")
"""


def damage(folder: Path, seed: int, rounds: int) -> None:
    (folder / "kernels.py").write_text(KERNELS)
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(folder / "cache")}
    command = [sys.executable, "-c", ATTACK, str(folder), str(seed), str(rounds)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, (done.returncode, done.stdout.splitlines()[-1:], done.stderr[-800:])
    assert len(done.stdout.splitlines()) == rounds


def test_a_damaged_cache_file_costs_a_compilation_and_nothing_else(tmp_path):
    damage(tmp_path, seed=1, rounds=5)


@pytest.mark.faults
@pytest.mark.parametrize("seed", range(10))
def test_many_damaged_cache_files_cost_a_compilation_each_and_nothing_else(tmp_path, seed):
    """100 damages in each of 10 processes."""
    damage(tmp_path, seed=100 + seed, rounds=100)


RUN = """
import numpy as np
from orbits.marching.legs.leg import Leg
from orbits.integrators.stormer_verlet import StormerVerlet
from orbits.lagrangians.newtonian import newtonian, parameters
q, v = np.array([[0.0, 0, 0], [1.0, 0, 0]]), np.array([[0.0, 0, 0], [0, 1.0, 0]])
run = Leg.of(newtonian, StormerVerlet(), parameters(np.array([1.0, 1e-3])), np.array([True, True]), q, v, 0.01)
run.advance(10)
print(float(run.state()[0][1, 0]).hex())
"""


def python(program: str, cache: Path, *options: str) -> subprocess.CompletedProcess:
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(cache)}
    return subprocess.run([sys.executable, *options, "-c", program], env=environment, capture_output=True, text=True)


@pytest.mark.faults
def test_a_run_after_damage_of_the_package_s_own_kernels_gives_the_same_bits(tmp_path):
    """Every file of the loop of a method in turn, in a process of its own each."""
    right = python(RUN, tmp_path).stdout
    assert right
    files = sorted(tmp_path.rglob("driver.*.nb?"))
    assert files
    for k, path in enumerate(files):
        data = bytearray(path.read_bytes())
        data[(k + 1) * len(data) // (len(files) + 1)] ^= 0x10
        path.write_bytes(data)
        done = python(RUN, tmp_path)
        assert done.returncode == 0, (path.name, done.returncode, done.stderr[-500:])
        assert done.stdout == right, path.name
        assert path.name in done.stderr, "the warning names the file"


SMALL = """
import sys
sys.path.insert(0, {folder!r})
import kernels
print(kernels.twice(0.25, 30).hex())
"""


class Planted:
    """Leaves a file behind when it is unpickled."""

    def __init__(self, mark: Path) -> None:
        self.mark = mark

    def __reduce__(self):
        return Path.touch, (self.mark,)


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """A program that calls two kernels, what it prints, and a cache that holds them."""
    folder = tmp_path_factory.mktemp("kept")
    (folder / "kernels.py").write_text(KERNELS)
    program = SMALL.format(folder=str(folder))
    done = python(program, folder / "cache")
    assert done.returncode == 0, done.stderr
    return program, done.stdout, folder / "cache"


def planted_index(kept: Path, cache: Path, mark: Path) -> Path:
    """Copy a cache and put what others would like to have executed in place of an index, with its checksum."""
    shutil.copytree(kept, cache)
    path = next(cache.rglob("kernels.twice*.nbi"))
    body = pickle.dumps(Planted(mark))
    path.unlink()
    path.write_bytes(checksum(body) + body)
    return path


def test_a_cache_file_that_others_may_write_is_not_read(kept, tmp_path):
    program, right, cache = kept
    path = planted_index(cache, tmp_path / "cache", tmp_path / "executed")
    path.chmod(0o666)
    done = python(program, tmp_path / "cache")
    assert (done.returncode, done.stdout) == (0, right)
    assert not (tmp_path / "executed").exists()
    assert path.name in done.stderr
    assert "0666" in done.stderr
    assert path.stat().st_mode & 0o777 == 0o644, "it was replaced"


@pytest.mark.nightly
def test_a_cache_folder_that_others_may_write_is_not_used(kept, tmp_path):
    program, right, cache = kept
    path = planted_index(cache, tmp_path / "cache", tmp_path / "executed")
    for folder in (tmp_path / "cache").rglob("*/"):
        folder.chmod(0o777)
    done = python(program, tmp_path / "cache")
    assert (done.returncode, done.stdout) == (0, right)
    assert not (tmp_path / "executed").exists()
    assert str(path.parent) in done.stderr
    assert "0777" in done.stderr


CROWDED = """
import sys, time
sys.path.insert(0, {folder!r})
import kernels
time.sleep(max(0.0, {begin} - time.time()))  # all begin to compile together
for x in (0.25, 1)[:: {order}]:  # two signatures, whose entries share an index
    print(repr(x), kernels.twice(x, 30).hex())
"""


@pytest.mark.faults
def test_processes_that_compile_into_one_cache_at_once_give_the_same_bits_and_leave_it_whole(tmp_path):
    """As workers of a test run do. Of two that write an index at once one may lose its entry, and compiles again."""
    (tmp_path / "kernels.py").write_text(KERNELS)
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache")}

    def begun(order: int, begin: float) -> subprocess.Popen[str]:
        program = CROWDED.format(folder=str(tmp_path), order=order, begin=begin)
        return subprocess.Popen(
            [sys.executable, "-c", program], env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )

    crowd = [begun(order, time.time() + 1.5) for order in (1, -1)]
    told = [process.communicate(timeout=120) for process in crowd]
    later = begun(1, 0.0).communicate(timeout=120)
    assert [errors for _, errors in (*told, later)] == [""] * 3
    assert {tuple(sorted(out.splitlines())) for out, _ in (*told, later)} == {tuple(sorted(later[0].splitlines()))}
    assert len(later[0].splitlines()) == 2


@pytest.mark.nightly
def test_a_full_disk_costs_the_cache_and_not_the_result(kept, tmp_path):
    """A limit on the size of files refuses what is written, as a full disk would."""
    program, right, _ = kept
    limit = "import resource\nresource.setrlimit(resource.RLIMIT_FSIZE, (512, 512))\n"
    done = python(limit + program, tmp_path, "-B")
    assert (done.returncode, done.stdout) == (0, right), done.stderr
    assert "cannot be kept" in done.stderr
    assert not list(tmp_path.rglob("*.partial"))


STRICT = "import warnings\nfrom orbits.errors import OrbitsWarning\nwarnings.simplefilter('error', OrbitsWarning)\n"


@pytest.mark.nightly
@pytest.mark.parametrize(
    "unusable",
    [
        lambda path: path.write_bytes(b"x" * 100),
        pytest.param(lambda path: path.chmod(0o666), marks=pytest.mark.faults),
    ],
)
def test_where_warnings_are_errors_a_file_that_cannot_be_used_ends_one_process_only(kept, tmp_path, unusable):
    program, right, cache = kept
    shutil.copytree(cache, tmp_path / "cache")
    path = next((tmp_path / "cache").rglob("kernels.twice*.nbi"))
    unusable(path)
    done = python(STRICT + program, tmp_path / "cache")
    assert done.returncode == 1
    assert "OrbitsWarning" in done.stderr.splitlines()[-1]
    assert path.name in done.stderr
    done = python(STRICT + program, tmp_path / "cache")
    assert (done.returncode, done.stdout) == (0, right), done.stderr[-500:]


@pytest.fixture
def formulas(tmp_path, monkeypatch):
    """An empty folder of generated modules, and a function that loads one as a new process would."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    trusted_files.warn.cache_clear()

    def load():
        sys.modules.pop("orbits_lagrangian_formula", None)
        return modules.module("formula", lambda: "A = 1\n").A

    assert load() == 1
    return tmp_path / "cache" / "orbits" / "orbits_lagrangian_formula.py", load


@pytest.mark.parametrize("folder_mode", [0o700, 0o777])
def test_a_planted_module_is_not_executed(formulas, tmp_path, folder_mode):
    """A folder of formulas that others may write; and a file of theirs in a folder that is private now."""
    path, load = formulas
    body = f"open({str(tmp_path / 'executed')!r}, 'w')\nA = 2\n"
    path.write_text(f"# {checksum(body.encode()).hex()}\n{body}")
    path.chmod(0o666)
    path.parent.chmod(folder_mode)
    with pytest.warns(OrbitsWarning, match="can be written by other users"):
        assert load() == 1
    assert not (tmp_path / "executed").exists()


def test_a_planted_pyc_is_not_executed(formulas):
    """Python would execute the compiled file beside a source without a look at who wrote it."""
    path, load = formulas
    planted = path.with_name("planted.py")
    planted.write_text("A = 2\n")
    cached = Path(importlib.util.cache_from_source(str(path)))
    cached.parent.mkdir(exist_ok=True)
    py_compile.compile(str(planted), str(cached), invalidation_mode=py_compile.PycInvalidationMode.UNCHECKED_HASH)
    assert load() == 1


@pytest.mark.parametrize("damage", [lambda text: text[:20], lambda text: b"", lambda text: bytes(len(text))])
def test_a_damaged_module_is_named_and_made_anew(formulas, damage):
    path, load = formulas
    whole = path.read_bytes()
    path.write_bytes(damage(whole))
    with pytest.warns(OrbitsWarning, match=path.name):
        assert load() == 1
    assert path.read_bytes() == whole


@pytest.mark.parametrize("unusable", [lambda path: path.write_bytes(b""), lambda path: path.chmod(0o666)])
def test_where_warnings_are_errors_a_module_that_cannot_be_used_fails_once(formulas, unusable):
    path, load = formulas
    unusable(path)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(OrbitsWarning, match=path.name):
            load()
        assert load() == 1


def test_files_of_another_user_are_not_trusted_but_those_of_root_are(monkeypatch):
    mine = os.stat_result((0o100600, 0, 0, 1, 1000, 1000, 0, 0, 0, 0))
    monkeypatch.setattr(os, "getuid", lambda: 1000)
    assert trusted_files.distrusted(mine) is None
    monkeypatch.setattr(os, "getuid", lambda: 1001)
    assert trusted_files.distrusted(mine) == "belongs to user 1000"
    assert trusted_files.distrusted(mine, owners=frozenset({1000})) is None
    root = os.stat_result((0o100600, 0, 0, 1, trusted_files.ROOT, 0, 0, 0, 0, 0))
    assert trusted_files.distrusted(root) is None


SCENARIO = """
import orbits
from orbits.scenario import Study, StudyResult

@orbits.kernel
def square(x):
    return x * x

scenario = Study(name="squares", title="Squares", experiment=lambda say: StudyResult())
print(square(3.0), sum(square.entry.stats.cache_hits.values()))
"""
AS_A_FILE = "import runpy\nrunpy.run_path({path!r}, run_name='__main__')"
LOADED = "from orbits.scenario import load\nload({path!r})"


@pytest.mark.parametrize(
    "ways",
    [
        pytest.param((AS_A_FILE, LOADED), id="script first"),
        pytest.param((LOADED, AS_A_FILE), id="script second", marks=pytest.mark.faults),
    ],
)
def test_a_scenario_s_kernels_are_found_again_however_its_file_was_started(tmp_path, ways):
    """Compiled code remembers its module by name: that of a script does not exist for `orbits run`."""
    path = tmp_path / "squares.py"
    path.write_text(SCENARIO)
    first, second = (way.format(path=str(path)) for way in ways)
    said = []
    for program in (first, second, f"{first}\n{second}"):
        done = python(program, tmp_path / "cache")
        assert done.returncode == 0, done.stderr[-500:]
        said.append(done.stdout)
    assert said == ["9.0 0\n", "9.0 0\n", "9.0 1\n9.0 1\n"]


@pytest.mark.parametrize(("mode", "beside"), [(0o755, True), (0o777, False)])
def test_the_cache_is_beside_the_source_only_where_nobody_else_may_write(tmp_path, monkeypatch, mode, beside):
    monkeypatch.setattr("numba.core.config.CACHE_DIR", "")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    source, place = tmp_path / "mine.py", tmp_path / "__pycache__"
    source.write_text(KERNELS)
    place.mkdir()
    place.chmod(mode)
    spec = importlib.util.spec_from_file_location("mine", source)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    assert (Path(module.twice.entry.cache.cache_path) == place) == beside
