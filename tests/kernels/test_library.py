"""Compiled and loaded kernels give the same bits, in whatever order a process compiled or loaded others before."""

import importlib.util
import os
import subprocess
import sys

import pytest
from llvmlite.binding import Linkage

MARCH = """
import orbits
gauss = orbits.Gauss(stages=2)
path = orbits.march(orbits.lagrangians.kepler, gauss, q=[0.4, 0.0], v=[0.0, 2.0], dt=0.05, steps=300)
print(path.q.tobytes().hex(), path.v.tobytes().hex())
"""


@pytest.mark.nightly
def test_a_process_that_compiles_gives_the_bits_of_one_that_loads(tmp_path):
    """The step of Gauss is called, not copied into the loop around it: its copies differed by 1e-16 in each step."""
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    cold, warm = (
        subprocess.run([sys.executable, "-c", MARCH], env=environment, capture_output=True, text=True, check=True)
        for _ in range(2)
    )
    assert list(tmp_path.rglob("*.nbc")), "nothing was kept for the second process"
    assert warm.stdout == cold.stdout


CLIMBING = """
from orbits import kernel

@kernel
def climbed(x, n):
    '''A kernel that calls itself is never copied into its caller.'''
    return x if n == 0 else 1.0 + 2.0 * climbed(x, n - 1)

@kernel
def climbed_here(x, n):
    return climbed(x, n)

@kernel
def climbed_there(x, n):
    return climbed(x, n + 1)

@kernel
def climbed_twice(x, n):
    return climbed_here(x, n) * climbed_there(x, n)
"""


@pytest.fixture
def climbing(tmp_path, monkeypatch):
    """Kernels that are compiled here; the functions of a kernel loaded from disk are not visible."""
    monkeypatch.setattr("numba.core.config.CACHE_DIR", str(tmp_path / "cache"))
    (tmp_path / "climbing.py").write_text(CLIMBING)
    spec = importlib.util.spec_from_file_location("climbing", tmp_path / "climbing.py")
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, "climbing", module)
    spec.loader.exec_module(module)
    assert module.climbed_twice(0.5, 3) == 11.0 * 23.0
    return module


def definitions(module):
    return {function.name: function.linkage for function in module.functions if not function.is_declaration}


def test_a_library_calls_its_own_copies_of_kernels_and_lets_no_other_call_them(climbing):
    (entry,) = climbing.climbed_twice.entry.overloads.values()
    found = definitions(entry.library._final_module)
    own = {entry.fndesc.llvm_func_name, entry.fndesc.llvm_cpython_wrapper_name}
    assert {name for name, linkage in found.items() if linkage != Linkage.internal} == own
    assert sum("climbed" in name for name in found.keys() - own) > 0, "no copy: this test shows nothing"


def test_what_two_callees_call_is_copied_once_into_their_caller(climbing):
    (entry,) = climbing.climbed_twice.entry.overloads.values()
    (callee,) = climbing.climbed.callee.overloads.values()
    name = callee.fndesc.llvm_func_name
    assert [found for found in definitions(entry.library._final_module) if found.startswith(name)] == [name]


def test_what_only_kernels_call_becomes_machine_code_in_its_callers_alone(climbing):
    (callee,) = climbing.climbed_here.callee.overloads.values()
    assert not definitions(callee.library._final_module)
    kept = definitions(callee.library._get_module_for_linking())
    assert kept[callee.fndesc.llvm_func_name] == Linkage.linkonce_odr


CALLED = """
from orbits import kernel

@kernel
def squared(x):
    return x * x - 0.1
"""

CALLING = """
import sys
from orbits import kernel
from called import squared

@kernel
def {name}(x):
    return squared(x) + squared(2.0 * x)

print({name}(0.3).hex(), *squared.callee.stats.cache_hits.values(), "numba.np.arraymath" in sys.modules)
"""


@pytest.mark.nightly
def test_a_caller_compiled_later_copies_a_kernel_found_on_disk_and_what_is_loaded_needs_no_compiler(tmp_path):
    """Numba's compiler takes a tenth of a second of imports; `arraymath` is one of them."""
    (tmp_path / "called.py").write_text(CALLED)
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": str(tmp_path)}
    found = []
    for name in ("one", "other", "one"):
        (tmp_path / f"{name}.py").write_text(CALLING.format(name=name))
        program = [sys.executable, "-c", f"import {name}"]
        found.append(subprocess.run(program, env=environment, capture_output=True, text=True, check=True).stdout)
    bits = found[0].split()[0]
    assert [text.split() for text in found] == [[bits, "True"], [bits, "1", "True"], [bits, "False"]]


IN_TURN = """
from orbits import kernel

@kernel
def even(n):
    if n == 0:
        return 1.0
    return 0.5 * odd(n - 1)

@kernel
def odd(n):
    if n == 0:
        return 0.0
    return 0.25 * even(n - 1)

@kernel
def both(n):
    return even(n) + odd(n + 1)
"""


@pytest.mark.nightly
def test_kernels_that_call_each_other_work_in_a_second_process(tmp_path):
    """Numba resolves such calls through memory of the process that compiled; loaded from the cache, they crashed the
    next one.
    """
    (tmp_path / "in_turn.py").write_text(IN_TURN)
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": str(tmp_path)}
    program = [sys.executable, "-c", "import in_turn; print(in_turn.both(2))"]
    for _ in range(2):
        done = subprocess.run(program, env=environment, capture_output=True, text=True)
        assert (done.returncode, done.stdout) == (0, "0.15625\n"), done.stderr


NUMBERS = """
import os, orbits.kernels.compile
from numba.core.bytecode import FunctionIdentity
if not os.fork():
    print(next(FunctionIdentity._unique_ids), flush=True)
    os._exit(0)
os.wait()
print(next(FunctionIdentity._unique_ids))
"""


def test_no_two_processes_give_functions_the_same_numbers():
    """Two closures of one factory, one of them out of the cache, had one name in a kernel for particles under drag: it
    called the same one twice, and was wrong by 2e-5, or by other numbers in each call.
    """
    run = [sys.executable, "-c", NUMBERS]
    numbers = [line for _ in range(3) for line in subprocess.check_output(run, text=True).split()]
    assert len(set(numbers)) == 6
    assert min(map(int, numbers)) > 10**6
