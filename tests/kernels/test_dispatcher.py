"""Compiled kernels: no reference counts, no allocation, no entry point for Python unless called from Python."""

import pickle
import subprocess
import sys

import numpy as np
import pytest

import orbits
from orbits.errors import InputError
from orbits.kernels.compile import kernel

from ..coverings import at


@kernel
def middle(q):
    part = q[1:3]
    return part[0] + part[1]


@kernel
def twice_the_middle(q):
    return 2.0 * middle(q)


@kernel
def fresh(q):
    out = np.empty(3)
    out[0] = q[0]
    return out[0]


@kernel
def calls_fresh(q):
    return fresh(q)


@kernel
def listed(q):
    values = [q[0], 1.0]
    return values[0]


@kernel
def copied(q):
    q[:] = q[::-1]


@kernel
def doubled(q):
    q[:] = 2.0 * q


@kernel
def shortened(q):
    return q[1:]


@kernel
def filled(q):
    q[:] = 0.0


Q = np.arange(4.0)


def test_a_kernel_that_takes_a_part_of_an_array_counts_no_references():
    """Numba 0.61 to 0.68 honour the private option `_nrt`; without it the slice is counted."""
    assert middle(Q) == 3.0
    (text,) = middle.entry.inspect_llvm().values()
    assert "NRT_" not in text


@pytest.mark.parametrize(
    ("allocating", "line"),
    at((0, 1, 2, 5), [
        (fresh, "out = np.empty(3)"),
        (calls_fresh, "out = np.empty(3)"),
        (listed, "values = [q[0], 1.0]"),
        (copied, "q[:] = q[::-1]"),
        (doubled, "q[:] = 2.0 * q"),
        (shortened, ""),
    ]),
    ids=lambda given: getattr(given, "__name__", ""),
)
def test_a_kernel_that_allocates_is_refused_with_its_place_and_the_remedy(allocating, line):
    with pytest.raises(InputError, match=r"allocates.*write into arrays that the kernel is given") as caught:
        allocating(Q.copy())
    assert line in str(caught.value)
    assert ("the kernel fresh" in str(caught.value)) == (allocating in (fresh, calls_fresh))


def test_a_number_may_be_written_into_a_whole_array():
    q = Q.copy()
    filled(q)
    assert not q.any()


@kernel
def allocating_force(parameters, q, out):
    g = -parameters[0] * q
    out[0] = g[0]


def test_a_lagrangian_whose_kernel_allocates_is_refused_when_it_is_first_marched():
    made = orbits.Lagrangian.from_kernels(
        {"accelerate": allocating_force}, coordinates=["q"], name="spring", parameters={"k": 1.0}
    )
    with pytest.raises(InputError, match=r"the kernel allocating_force .*`g = -parameters") as caught:
        orbits.march(made, orbits.StormerVerlet(), q=[1.0], v=[0.0], dt=0.1, steps=1)
    assert "numba" not in str(caught.value).lower()


def test_only_what_python_calls_has_an_entry_for_python(tmp_path, monkeypatch):
    monkeypatch.setattr("numba.core.config.CACHE_DIR", str(tmp_path))  # what is found on disk shows no functions

    @kernel
    def half(x):
        return 0.5 * x

    @kernel
    def quarter(x):
        return half(half(x))

    assert quarter(6.0) == 1.5
    (inner,) = half.callee.overloads.values()
    assert f"@{inner.fndesc.llvm_func_name}" in inner.library.get_llvm_str()
    assert f"@{inner.fndesc.llvm_cpython_wrapper_name}" not in inner.library.get_llvm_str()
    (outer,) = quarter.entry.overloads.values()
    assert f"@{outer.fndesc.llvm_cpython_wrapper_name}" in outer.library.get_llvm_str()
    for entry in (inner, outer):
        assert entry.fndesc.llvm_cfunc_wrapper_name not in entry.library.get_llvm_str()


def test_what_compiled_code_called_first_can_be_called_from_python_with_the_same_bits():
    @kernel
    def inner(x):
        return x * x - 0.1 * x

    @kernel
    def outer(x):
        return inner(x)

    assert outer(0.3).hex() == inner(0.3).hex()


def test_a_kernel_of_the_package_makes_what_numba_needs_when_it_is_first_used():
    """Numba takes half a millisecond for one, and a process imports hundreds."""
    code = "from orbits.kernels.sums.summation import two_sum; print({'entry', 'callee'} & vars(two_sum).keys())"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=300)
    assert done.stdout == "set()\n"


def test_a_kernel_can_be_pickled():
    assert pickle.loads(pickle.dumps(twice_the_middle))(Q) == 6.0
